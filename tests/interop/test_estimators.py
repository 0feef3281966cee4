"""Noise for VINS, ORB-SLAM3, LIO-SAM and FAST-LIO: their readers, and the results of their filters after two seconds at rest.

The truth is that of the noise: after a time t, white noise N has the variance N² t in its integral, and a bias with random walk K has K² t.
"""
import cv2
import noise_of_a_unit
import numpy
import pytest
import yaml
from conftest import run
from noise_of_a_unit import RATE_HZ, WORST, close, random_walk_variances
from test_kalibr import noise  # noqa: F401

DT = 1 / RATE_HZ
STEPS = 400
SECONDS = STEPS * DT


def export(form, noise, folder, *arguments):  # noqa: F811
    run("export", form, "--noise", noise, "-o", "out.yaml", *arguments, cwd=folder)
    return folder / "out.yaml"


def opencv(path, keys):
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    nodes = {key: file.getNode(key) for key in keys}
    assert all(node.isReal() or node.isInt() for node in nodes.values())
    return {key: node.real() for key, node in nodes.items()}


def expected(sensor):
    return random_walk_variances(*WORST[sensor], SECONDS)


def test_vins(noise, tmp_path):  # noqa: F811
    numbers = opencv(export("vins", noise, tmp_path), ["acc_n", "gyr_n", "acc_w", "gyr_w", "g_norm"])
    assert numbers["g_norm"] == 9.80665
    for sensor, key in [("accel", "acc"), ("gyr", "gyr")]:
        n, w = numbers[f"{key}_n"], numbers[f"{key}_w"]
        white, walk = expected("gyro" if key == "gyr" else sensor)
        # midPointIntegration at rest: V has dt / 2 for the previous reading and for the present one, and dt for the bias.
        integral = sum((0.5 * DT) ** 2 * n**2 * 2 for _ in range(STEPS))
        bias = sum(DT**2 * w**2 for _ in range(STEPS))
        assert close(bias, walk)
        # It treats the two as independent, so it has half the variance of such readings ...
        assert close(2 * integral, white)
        # ... as the mean over readings with this standard deviation shows.
        random = numpy.random.default_rng(3)
        readings = random.normal(0, n, (4000, STEPS + 1))
        made = (0.5 * DT * (readings[:, 1:] + readings[:, :-1])).sum(axis=1).var()
        assert close(made, white, 0.1)


def test_orbslam3(noise, tmp_path):  # noqa: F811
    keys = ["IMU.NoiseGyro", "IMU.NoiseAcc", "IMU.GyroWalk", "IMU.AccWalk", "IMU.Frequency"]
    path = export("orbslam3", noise, tmp_path)
    numbers = opencv(path, keys)
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    # The older reader requires an integer here and reals there.
    assert file.getNode("IMU.Frequency").isInt() and all(file.getNode(key).isReal() for key in keys[:4])
    sf = numbers["IMU.Frequency"] ** 0.5
    for sensor, noise_key, walk_key in [("gyro", "IMU.NoiseGyro", "IMU.GyroWalk"), ("accel", "IMU.NoiseAcc", "IMU.AccWalk")]:
        # Calib(Tbc, Ng*sf, Na*sf, Ngw/sf, Naw/sf); B has dt, and the covariance of the walk is added at every reading.
        white = sum((numbers[noise_key] * sf) ** 2 * DT**2 for _ in range(STEPS))
        walk = sum((numbers[walk_key] / sf) ** 2 for _ in range(STEPS))
        assert close(white, expected(sensor)[0]) and close(walk, expected(sensor)[1])


@pytest.mark.parametrize("ros", [1, 2])
def test_liosam(ros, noise, tmp_path):  # noqa: F811
    path = export("liosam", noise, tmp_path, "--gravity", 9.81744, *(["--ros2"] if ros == 2 else []))
    read = yaml.safe_load(path.read_text())
    numbers = read["/**"]["ros__parameters"] if ros == 2 else read["lio_sam"]
    assert numbers["imuGravity"] == 9.81744
    for sensor, key in [("accel", "Acc"), ("gyro", "Gyr")]:
        # GTSAM: the discrete covariance is the continuous one over dt; the bias changes by sqrt(deltaTij) imuAccBiasN.
        white = sum(numbers[f"imu{key}Noise"] ** 2 / DT * DT**2 for _ in range(STEPS))
        walk = (SECONDS**0.5 * numbers[f"imu{key}BiasN"]) ** 2
        assert close(white, expected(sensor)[0]) and close(walk, expected(sensor)[1])


@pytest.mark.parametrize("ros", [1, 2])
def test_fastlio(ros, noise, tmp_path):  # noqa: F811
    read = yaml.safe_load(export("fastlio", noise, tmp_path, *(["--ros2"] if ros == 2 else [])).read_text())
    numbers = read["/**"]["ros__parameters"]["mapping"] if ros == 2 else read["mapping"]
    for sensor, key in [("accel", "acc"), ("gyro", "gyr")]:
        # esekf::predict adds (dt F_w) Q (dt F_w)'.
        white = sum(DT**2 * numbers[f"{key}_cov"] for _ in range(STEPS))
        walk = sum(DT**2 * numbers[f"b_{key}_cov"] for _ in range(STEPS))
        assert close(white, expected(sensor)[0]) and close(walk, expected(sensor)[1])


def test_the_rate_is_that_of_the_messages(noise, tmp_path):  # noqa: F811
    numbers = opencv(export("vins", noise, tmp_path, "--update-rate", 50), ["acc_n"])
    assert close(numbers["acc_n"], WORST["accel"][0] * 50**0.5)
    assert noise_of_a_unit.RATE_HZ != 50


def test_gravity_is_that_of_the_calibration(unit, noise):  # noqa: F811
    path, result = unit.export("vins", "--noise", noise)
    gravity = unit.calibration["recording"]["gravity_mps2"]
    assert close(opencv(path, ["g_norm"])["g_norm"], gravity)
    # It reports what it does not use of a calibration.
    assert any("no place for a calibration" in note for note in result["notes"])
