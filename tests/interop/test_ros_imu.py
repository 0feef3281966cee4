"""Covariances of sensor_msgs/Imu by PyYAML, and imu_corrector.param.yaml with the formulas of imu_corrector_core.cpp (autoware_universe 0ddc7223)."""
import noise_of_a_unit
import numpy
import pytest
import yaml
from conftest import run, triad
from test_kalibr import driver


@pytest.fixture(scope="module")
def noise(tmp_path_factory):
    return noise_of_a_unit.write(tmp_path_factory.mktemp("noise"))


@pytest.mark.parametrize("rate", [noise_of_a_unit.RATE_HZ, 50.0])
def test_covariances_are_those_of_one_message(rate, noise, tmp_path):
    run("export", "ros-imu", "--noise", noise, "--update-rate", rate, "-o", "imu.yaml", cwd=tmp_path)
    message = yaml.safe_load((tmp_path / "imu.yaml").read_text())
    assert set(message) == {"orientation_covariance", "angular_velocity_covariance", "linear_acceleration_covariance"}
    # Imu.msg: without an estimate of a quantity, element 0 of its covariance is -1.
    assert message["orientation_covariance"] == [-1, 0, 0, 0, 0, 0, 0, 0, 0]
    for sensor, key in [("gyro", "angular_velocity_covariance"), ("accel", "linear_acceleration_covariance")]:
        densities = numpy.array([noise_of_a_unit.CHANNELS[f"{sensor}_{axis}"][0] for axis in "xyz"])
        assert numpy.allclose(numpy.array(message[key]).reshape(3, 3), numpy.diag(densities**2 * rate), rtol=1e-6, atol=0)


@pytest.mark.parametrize("arguments, factor, zero", [([], None, 0.0), (["--gyro-si-per-raw", 2e-4, "--gyro-zero", 40], 2e-4, 40.0)])
def test_autoware_subtracts_the_bias(arguments, factor, zero, noise, unit):
    path, result = unit.export("autoware", "--noise", noise, *arguments, name="imu_corrector.param.yaml")
    read = yaml.safe_load(path.read_text())["/**"]["ros__parameters"]
    assert len(read) == 7 and all(isinstance(value, float) for value in read.values())
    readings, bias = driver(unit, "gyro", factor, zero)
    # callback_imu(): angular_velocity -= angular_velocity_offset.
    offset = numpy.array([read[f"angular_velocity_offset_{axis}"] for axis in "xyz"])
    corrected = readings - offset
    assert numpy.allclose(offset, bias, rtol=1e-7, atol=1e-9)
    # What it leaves are scale factors and cross terms alone: nothing where the rate is 0.
    p = numpy.array(unit.calibration["gyro"]["forward"]["P"])
    p = p / numpy.linalg.norm(p, axis=1)[:, None] if factor is None else factor * p
    assert numpy.allclose(corrected, triad(unit.applied, "gyro") @ p.T, atol=1e-6)
    left = [r for r in result["remaining"] if r["sensor"] == "gyro" and r["source"] == "scale factors and cross terms"]
    assert numpy.isclose(left[0]["max"], numpy.radians(100) * numpy.abs(p - numpy.eye(3)).max())
    assert any(r["sensor"] == "accel" and r["source"] == "bias" and r["max"] > 0 for r in result["remaining"])
    # covariance = stddev²; the deviation of one message of the driver's readings.
    gain = numpy.linalg.norm(p, axis=1)
    for axis, g in zip("xyz", gain):
        n = noise_of_a_unit.CHANNELS[f"gyro_{axis}"][0]
        assert noise_of_a_unit.close(read[f"angular_velocity_stddev_{axis}{axis}"] ** 2, g**2 * n**2 * noise_of_a_unit.RATE_HZ, 1e-4)
    assert noise_of_a_unit.close(read["acceleration_stddev"], noise_of_a_unit.WORST["accel"][0] * noise_of_a_unit.RATE_HZ**0.5, 1e-4)
