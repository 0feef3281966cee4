"""The inertial keys of Basalt's calibration, by the formulas of calib_bias.hpp (basalt-headers, 2021-06)."""
import json

import noise_of_a_unit
import numpy
import pytest
from conftest import triad
from test_kalibr import driver, oblique  # noqa: F401, a fixture


def bias_and_scale(sensor, parameters):
    """getBiasAndScale() of CalibAccelBias and CalibGyroBias."""
    bias, scale = numpy.array(parameters[:3]), numpy.zeros((3, 3))
    if sensor == "accel":
        assert len(parameters) == 9
        scale[:, 0] = parameters[3:6]
        scale[1, 1], scale[2, 1], scale[2, 2] = parameters[6:]
    else:
        assert len(parameters) == 12
        for column in range(3):
            scale[:, column] = parameters[3 + 3 * column : 6 + 3 * column]
    return bias, scale


def get_calibrated(sensor, parameters, raw):
    bias, scale = bias_and_scale(sensor, parameters)
    return raw + raw @ scale.T - bias


@pytest.mark.parametrize("which", ["unit", "oblique"])
def test_calibrated_is_what_apply_gives_in_the_frame_of_the_accelerometer(which, request):
    unit = request.getfixturevalue(which)
    path, result = unit.export("basalt", name=f"{which}.json")
    text = path.read_text()
    # cereal reads an object without a name from the first member.
    assert list(json.loads(text)) == ["value0", "about"]
    read = json.loads(text)["value0"]
    forces = get_calibrated("accel", read["calib_accel_bias"], driver(unit, "accel")[0])
    rates = get_calibrated("gyro", read["calib_gyro_bias"], driver(unit, "gyro")[0])
    body = triad(unit.applied, "accel")
    rotation = numpy.linalg.lstsq(body, forces, rcond=None)[0].T
    assert numpy.allclose(rotation @ rotation.T, numpy.eye(3), atol=1e-6) and numpy.linalg.det(rotation) > 0
    assert numpy.allclose(forces, body @ rotation.T, atol=1e-6)
    assert numpy.allclose(rates, triad(unit.applied, "gyro") @ rotation.T, atol=1e-6)
    # The file says which frame that is.
    stated = next(line for line in result["formulas"] if "Q by rows = " in line).split("Q by rows = ")[1]
    assert numpy.allclose(numpy.array(json.loads(stated)).reshape(3, 3), rotation, atol=2e-6)
    if which == "oblique":
        assert numpy.abs(rotation - numpy.eye(3)).max() > 0.05
    assert "accel_noise_std" not in read


def test_densities_are_those_of_each_axis(unit, tmp_path):
    path, _ = unit.export("basalt", "--noise", noise_of_a_unit.write(tmp_path), name="noise.json")
    read = json.loads(path.read_text())["value0"]
    assert read["imu_update_rate"] == noise_of_a_unit.RATE_HZ
    for sensor in ["gyro", "accel"]:
        for axis, at in zip("xyz", range(3)):
            n, k = noise_of_a_unit.CHANNELS[f"{sensor}_{axis}"]
            # dicrete_time_*_noise_std(): density times the root of the rate.
            discrete = read[f"{sensor}_noise_std"][at] * read["imu_update_rate"] ** 0.5
            assert noise_of_a_unit.close(discrete, n * noise_of_a_unit.RATE_HZ**0.5)
            assert noise_of_a_unit.close(read[f"{sensor}_bias_std"][at], k)
