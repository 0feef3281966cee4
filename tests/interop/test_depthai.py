"""imuCalibrationParams by DepthAI's own CalibrationHandler, with the formula of its test of the camera's streams (applyCalibration)."""
import json

import depthai
import noise_of_a_unit
import numpy
import pytest
from conftest import triad
from test_kalibr import driver, oblique  # noqa: F401, a fixture


def handler(path):
    """The calibration of a camera with the file merged into it, as the file's comments say."""
    eeprom = depthai.CalibrationHandler().eepromToJson()
    eeprom["imuCalibrationParams"].update(json.loads(path.read_text())["imuCalibrationParams"])
    return depthai.CalibrationHandler.fromJson(eeprom)


def calibrated(matrix, readings):
    """output[i] = c[i][0] x + c[i][1] y + c[i][2] z + c[i][3]"""
    matrix = numpy.array(matrix)
    return readings @ matrix[:, :3].T + matrix[:, 3]


@pytest.mark.parametrize("which", ["unit", "oblique"])
@pytest.mark.parametrize("zero", [0.0, 0.5])
def test_the_calibrated_stream_is_what_apply_gives(which, zero, request):
    unit = request.getfixturevalue(which)
    path, _ = unit.export("depthai", "--gyro-zero", zero, "--accel-zero", zero, name="imu.json")
    read = handler(path)
    for sensor, matrix in [("gyro", read.getGyroscopeCalibration()), ("accel", read.getAccelerometerCalibration())]:
        readings, _ = driver(unit, sensor, zero=zero)
        error = numpy.abs(calibrated(matrix, readings) - triad(unit.applied, sensor)).max()
        # DepthAI keeps single precision.
        assert error < 1e-6 + 4e-7 * (numpy.abs(readings).max() + numpy.abs(matrix).max())
        # The sign of b shows only if there is one.
        assert numpy.abs(numpy.array(matrix)[:, 3]).max() > 1e-3


def test_noise_is_that_of_each_axis(unit, tmp_path):
    noise = noise_of_a_unit.write(tmp_path)
    path, result = unit.export("depthai", "--noise", noise, "--imu", "BMI270", name="with-noise.json")
    read = handler(path).getImuParameters().noise
    assert read.name == "BMI270"
    for sensor, triad_of in [("gyro", read.gyroscope), ("accel", read.accelerometer)]:
        for axis in "xyz":
            n, k = noise_of_a_unit.CHANNELS[f"{sensor}_{axis}"]
            one = getattr(triad_of, axis)
            assert noise_of_a_unit.close(one.noiseDensity, n) and noise_of_a_unit.close(one.randomWalk, k)
            # The noise file has no bias instability, and that is said.
            assert one.biasStability == 0 and f"{sensor}, {axis}: the record shows no bias instability" in " ".join(result["notes"])


def test_without_noise_the_camera_keeps_its_own(unit):
    path, result = unit.export("depthai", name="imu.json")
    assert "noise" not in json.loads(path.read_text())["imuCalibrationParams"]
    assert any("the camera keeps its own" in note for note in result["notes"])
