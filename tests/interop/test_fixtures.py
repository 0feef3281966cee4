"""Checks the units of the other tests, which otherwise would show nothing."""
import numpy
from conftest import inverse, triad


def test_apply_is_the_affine_model(unit):
    for sensor in ["gyro", "accel"]:
        c, o = unit.model(sensor)
        assert numpy.allclose(triad(unit.raw, sensor) @ c.T + o, triad(unit.applied, sensor), rtol=1e-6, atol=1e-9)


def test_apply_follows_temperature(thermal_unit):
    # After the first minutes, a die that lags by 60 s at 7 K/min is 7 K behind.
    last = -1
    temp_c = thermal_unit.raw["temp_c"][last] - 60.0 * 70 / 600
    for sensor in ["gyro", "accel"]:
        c, o = inverse(temp_c)[sensor]
        ours = c @ triad(thermal_unit.raw, sensor)[last] + o
        assert numpy.allclose(ours, triad(thermal_unit.applied, sensor)[last], atol=2e-4)
