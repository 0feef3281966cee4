"""Files for simulations: the JSON of MATLAB's imuSensor and Gazebo's <imu>, with the models in their sources."""
import json
import xml.etree.ElementTree

import noise_of_a_unit
import numpy
import pytest
from conftest import run, triad
from test_kalibr import driver, oblique  # noqa: F401, a fixture


@pytest.fixture(scope="module")
def noise(tmp_path_factory):
    return noise_of_a_unit.write(tmp_path_factory.mktemp("noise"))


def imu_sensor(parameters, ideal):
    """IMUSensorSimulator.m, stepBulkModel()"""
    return ideal @ (numpy.array(parameters["AxesMisalignment"]) / 100).T + parameters["ConstantBias"]


@pytest.mark.parametrize("which", ["unit", "oblique"])
def test_matlab_reads_what_the_driver_reads(which, noise, request):
    unit = request.getfixturevalue(which)
    path, _ = unit.export("matlab", "--noise", noise, "--name", "my_unit", name="unit.json")
    # SensorParamLoader.m joins the text without its white space, looks for the part by its name, and takes numbers only.
    parts = json.loads("".join(path.read_text().split()))
    sensors = parts["my_unit"]
    assert set(sensors) == {"Accelerometer", "Gyroscope"}
    rates, forces = triad(unit.applied, "gyro"), triad(unit.applied, "accel")
    assert numpy.allclose(imu_sensor(sensors["Gyroscope"], rates), driver(unit, "gyro")[0], atol=1e-6)
    # AccelerometerSimulator.m, NED.m, ENU.m: ideal = LinAccelSign acceleration + gravity, LinAccelSign = -1 in both frames; at rest in NED +g along z.
    assert numpy.allclose(-imu_sensor(sensors["Accelerometer"], -forces), driver(unit, "accel")[0], atol=1e-6)
    for sensor, parameters in [("gyro", sensors["Gyroscope"]), ("accel", sensors["Accelerometer"])]:
        for axis in range(3):
            n, k = noise_of_a_unit.CHANNELS[f"{sensor}_{'xyz'[axis]}"]
            bandwidth = noise_of_a_unit.RATE_HZ / 2
            # setStdDevWhiteNoise(), setStdDevRandWalk() with the default NoiseType, double-sided.
            assert noise_of_a_unit.close(bandwidth**0.5 * parameters["NoiseDensity"][axis], n * noise_of_a_unit.RATE_HZ**0.5)
            assert noise_of_a_unit.close(parameters["RandomWalk"][axis] / bandwidth**0.5, k / noise_of_a_unit.RATE_HZ**0.5)


def gaussian(element, dt, samples, random):
    """GaussianNoiseModel.cc, ApplyImpl(): the noise of `samples` messages."""
    value = lambda name: float(element.findtext(name, "0"))  # noqa: E731
    assert element.get("type") == "gaussian"
    tau, sigma = value("dynamic_bias_correlation_time"), value("dynamic_bias_stddev")
    step = numpy.sqrt(-(sigma**2) * tau / 2 * numpy.expm1(-2 * dt / tau))
    bias, out = value("bias_mean"), []
    for drawn, white in zip(random.standard_normal(samples), random.standard_normal(samples)):
        bias = numpy.exp(-dt / tau) * bias + step * drawn
        out.append(bias + value("mean") + value("stddev") * white)
    return numpy.array(out), step


def elements(path):
    imu = xml.etree.ElementTree.parse(path).getroot()
    assert imu.tag == "imu"
    for sensor, name in [("gyro", "angular_velocity"), ("accel", "linear_acceleration")]:
        for axis in "xyz":
            yield sensor, axis, imu.find(f"{name}/{axis}/noise")


def test_gazebo_makes_the_noise_of_the_record(noise, tmp_path):
    run("export", "gazebo", "--noise", noise, "--correlation-time", 1e5, "-o", "imu.sdf", cwd=tmp_path)
    random, dt, samples = numpy.random.default_rng(3), 1 / noise_of_a_unit.RATE_HZ, 20000
    for sensor, axis, element in elements(tmp_path / "imu.sdf"):
        n, k = noise_of_a_unit.CHANNELS[f"{sensor}_{axis}"]
        made, step = gaussian(element, dt, samples, random)
        # White noise by differences of neighbours: 2 % is four standard deviations of 20000 of them. The walk of a step is 1e-3 of it.
        white = numpy.diff(made).std() / 2**0.5
        assert abs(white / (n / dt**0.5) - 1) < 0.025, (sensor, axis)
        assert noise_of_a_unit.close(step, k * dt**0.5)
        assert float(element.findtext("mean")) == 0


def test_gazebo_has_the_bias_of_the_readings(noise, unit):
    path, result = unit.export("gazebo", "--noise", noise, name="biased.sdf")
    for sensor, axis, element in elements(path):
        _, bias = driver(unit, sensor)
        assert numpy.isclose(float(element.findtext("mean")), bias["xyz".index(axis)], rtol=1e-8)
        # Gazebo turns the sign of bias_mean at random.
        assert element.find("bias_mean") is None
    assert {r["sensor"] for r in result["remaining"] if r["source"] == "scale factors and cross terms"} == {"gyro", "accel"}
