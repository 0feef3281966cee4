"""acc.calib and gyro.calib as IMU-TK's CalibratedTriad_ loads them: 9, 9 and 3 numbers from a stream, whatever follows."""
import numpy
import pytest
from conftest import run, triad
from test_kalibr import text_of


def load(path):
    """`file >> number` 21 times."""
    words = path.read_text().split()
    numbers = numpy.array([float(word) for word in words[:21]])
    assert words[21] == "#", "comments are behind the numbers"
    return numbers[:9].reshape(3, 3), numbers[9:18].reshape(3, 3), numbers[18:]


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_unbias_normalize_is_what_apply_gives(sensor, unit):
    path, _ = unit.export("imu-tk", "--sensor", sensor, name=f"{sensor}.calib")
    misalignment, scale, bias = load(path)
    assert numpy.array_equal(numpy.diag(misalignment), numpy.ones(3))
    assert numpy.array_equal(scale, numpy.diag(numpy.diag(scale)))
    ours = (triad(unit.raw, sensor) - bias) @ (misalignment @ scale).T
    assert numpy.allclose(ours, triad(unit.applied, sensor), rtol=1e-6, atol=1e-9)


def test_over_temperature_it_says_what_it_leaves(thermal_unit):
    path, result = thermal_unit.export("imu-tk", "--sensor", "gyro", name="gyro.calib")
    load(path)
    assert "at 20.0 °C" in path.read_text()
    left = {r["source"]: r for r in result["remaining"]}
    assert {r["sensor"] for r in result["remaining"]} == {"gyro"}
    # x is -1 at the cold end: gyro_bias is 0.344 (0.01 - 0.02 x + ...), the scale factors are off by 1.6 % of 100 deg/s.
    assert left["bias over temperature"]["max"] > 0.01
    assert left["scale factors and cross terms over temperature"]["max"] > 0.01


def test_permuted_axes_are_refused(tmp_path):
    # T has ones on its diagonal, so C may have no zeros there.
    permuted = 0.344 * numpy.roll(numpy.eye(3), 1, axis=1)
    (tmp_path / "cal.toml").write_text(text_of({"gyro": (permuted, [2.5, 2.5, 2.5], "rad/s")}))
    with pytest.raises(AssertionError, match="gyro, axis x: only 0 % of its sensitivity is along x of the body; order"):
        run("export", "imu-tk", "--sensor", "gyro", "--calibration", "cal.toml", "-o", "gyro.calib", cwd=tmp_path)
    assert not (tmp_path / "gyro.calib").exists()
    with pytest.raises(AssertionError, match="the accel is not calibrated"):
        run("export", "imu-tk", "--sensor", "accel", "--calibration", "cal.toml", "-o", "accel.calib", cwd=tmp_path)
