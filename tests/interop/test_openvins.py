"""kalibr_imu_chain.yaml read by OpenCV, and the readings that Propagator.cpp computes from raw ones."""
import cv2
import numpy
import noise_of_a_unit
import pytest
from conftest import run, triad
from test_kalibr import driver, noise, oblique, sagging  # noqa: F401


def read(path):
    """As in opencv_yaml_parse.h: a matrix element by element."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert file.isOpened()
    imu = file.getNode("imu0")
    matrices = {}
    for key in ["Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC", "Tg"]:
        node = imu.getNode(key)
        matrices[key] = numpy.array([[node.at(i).at(j).real() for j in range(3)] for i in range(3)])
    numbers = ["accelerometer_noise_density", "accelerometer_random_walk", "gyroscope_noise_density", "gyroscope_random_walk"]
    numbers += ["update_rate", "time_offset"]
    return matrices, {key: imu.getNode(key).real() for key in numbers}, imu.getNode("model").string()


def openvins(matrices, model, y_gyro, b_gyro, y_accel, b_accel):
    """State::Dm keeps half of the inverse of Tw and Ta, by the model; then Propagator.cpp, with Rot() the transpose of the file's matrix."""
    half = {"kalibr": numpy.tril, "rpng": numpy.triu}[model]
    dw, da = half(numpy.linalg.inv(matrices["Tw"])), half(numpy.linalg.inv(matrices["Ta"]))
    forces = (y_accel - b_accel) @ (matrices["R_IMUtoACC"].T @ da).T
    rates = (y_gyro - b_gyro - forces @ matrices["Tg"].T) @ (matrices["R_IMUtoGYRO"].T @ dw).T
    return rates, forces


@pytest.mark.parametrize("model", ["kalibr", "rpng"])
@pytest.mark.parametrize("which", ["unit", "oblique", "sagging"])
def test_readings_become_those_of_apply(which, model, noise, request):  # noqa: F811
    unit = request.getfixturevalue(which)
    path, _ = unit.export("openvins", "--noise", noise, "--model", model)
    matrices, numbers, name = read(path)
    assert name == model and numbers["update_rate"] == noise_of_a_unit.RATE_HZ
    rates, forces = openvins(matrices, model, *driver(unit, "gyro"), *driver(unit, "accel"))
    assert numpy.allclose(forces, triad(unit.applied, "accel"), atol=1e-6)
    assert numpy.allclose(rates, triad(unit.applied, "gyro"), atol=1e-6)
    assert numpy.any(matrices["Tg"]) == (which == "sagging")


def test_without_a_calibration_readings_stay_as_they_are(noise, tmp_path):  # noqa: F811
    run("export", "openvins", "--noise", noise, "-o", "chain.yaml", cwd=tmp_path)
    matrices, numbers, _ = read(tmp_path / "chain.yaml")
    for key, matrix in matrices.items():
        assert numpy.array_equal(matrix, numpy.zeros((3, 3)) if key == "Tg" else numpy.eye(3))
    for sensor, prefix in [("gyro", "gyroscope"), ("accel", "accelerometer")]:
        n, k = noise_of_a_unit.WORST[sensor]
        assert noise_of_a_unit.close(numbers[f"{prefix}_noise_density"], n)
        assert noise_of_a_unit.close(numbers[f"{prefix}_random_walk"], k)
