"""imu_calib.yaml by PyYAML, with the formula of accel_calib.cpp."""
import numpy
import pytest
import yaml
from conftest import triad
from test_kalibr import driver


@pytest.mark.parametrize("factor, zero", [(None, 0.0), (3e-4, 120.0)])
def test_corrected_is_what_apply_gives(factor, zero, unit):
    arguments = [] if factor is None else ["--accel-si-per-raw", factor, "--accel-zero", zero]
    path, result = unit.export("imu-calib", *arguments)
    read = yaml.safe_load(path.read_text())
    assert set(read) == {"SM", "bias"} and len(read["SM"]) == 9 and len(read["bias"]) == 3
    sm = numpy.array(read["SM"]).reshape(3, 3)
    readings, _ = driver(unit, "accel", factor, zero)
    corrected = readings @ sm.T - read["bias"]
    assert numpy.allclose(corrected, triad(unit.applied, "accel"), atol=1e-6)
    # It reports the gyro's remaining error: the largest error from scale factors and cross terms, at 100 deg/s.
    stays = [r for r in result["remaining"] if r["sensor"] == "gyro"]
    p = numpy.array(unit.calibration["gyro"]["forward"]["P"])
    off = numpy.radians(100) * (p / numpy.linalg.norm(p, axis=1)[:, None] - numpy.eye(3))
    assert numpy.isclose(stays[0]["max"], numpy.abs(off).max())
