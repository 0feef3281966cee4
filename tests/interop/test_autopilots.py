"""Parameters of PX4 and ArduPilot: pymavlink reads the files, and the formulas from the sources of both recover the input of the unit."""
import os
import subprocess

import numpy
import pytest
from conftest import G, Unit, curves, run
from pymavlink import mavparm

# A unit at one temperature whose driver converts with nominal factors: its biases, scale factors and cross terms, readings in SI.
SCALE = {"gyro": numpy.array([1.004, 0.997, 1.01]), "accel": numpy.array([1.02, 0.985, 1.006])}
BIAS = {"gyro": numpy.array([0.01, -0.02, 0.03]), "accel": numpy.array([0.2, -0.3, 0.1])}
ACROSS = numpy.array([[0, 0.003, -0.002], [0.001, 0, 0.002], [-0.002, 0.001, 0]])


def forward(sensor):
    return numpy.diag(SCALE[sensor]) + ACROSS, BIAS[sensor]


def calibration(raw_unit="SI", factor=1.0, zero=0.0):
    """Its file, with readings `v / factor + zero` where the driver computes `v`."""
    rows = lambda m: str(numpy.asarray(m).tolist())  # noqa: E731
    text = f'format = "mimu-calibration/1"\ndevice = "unit"\ncreated = "2026-01-02T03:04:05Z"\ntool = "test"\n[recording]\nraw_unit = "{raw_unit}"\ntemp_c = 22.0\n'
    for sensor, unit in [("gyro", "rad/s"), ("accel", "m/s^2")]:
        p, b = forward(sensor)
        p, b = p / factor, b / factor + zero
        c = numpy.linalg.inv(p)
        text += f'[{sensor}]\nformula = "x = C u + o"\ndirection = "raw to SI"\nraw_unit = "{raw_unit}"\nunit = "{unit}"\nframe = "body"\n'
        text += f"C = {rows(c)}\no = {rows(-c @ b)}\n"
        text += f'[{sensor}.forward]\nformula = "u = P x + b"\ndirection = "SI to raw"\nP = {rows(p)}\nb = {rows(b)}\n'
        text += f'[{sensor}.physical]\nformula = ""\nscale_factor = {rows(numpy.diag(p))}\nbias = {rows(b)}\n'
        text += "misalignment_deg = [0.0, 0.0, 0.0]\nnon_orthogonality_deg = [0.0, 0.0, 0.0]\n"
    return text


def export(folder, form, *arguments):
    """The parameters as pymavlink reads them, and the lines of the file."""
    run("export", form, "--calibration", "cal.toml", "-o", "out.param", *arguments, cwd=folder)
    read = mavparm.MAVParmDict()
    assert read.load(str(folder / "out.param"))
    lines = (folder / "out.param").read_text().splitlines()
    # Every line that is not a comment was read.
    assert len(read) == sum(not line.startswith("#") for line in lines)
    # Names of MAVLink have 16 characters.
    assert all(len(name) <= 16 for name in read)
    return dict(read), "\n".join(line for line in lines if line.startswith("#"))


def of(p, pattern):
    return numpy.array([p[pattern.replace("#", axis)] for axis in "XYZ"])


def px4(p, sensor, v, n=0):
    """src/lib/sensor_calibration/Accelerometer.hpp, Gyroscope.hpp: Correct() without rotation and thermal offset."""
    if sensor == "gyro":
        return v - of(p, f"CAL_GYRO{n}_#OFF")
    return (v - of(p, f"CAL_ACC{n}_#OFF")) * of(p, f"CAL_ACC{n}_#SCALE")


def ardupilot(p, sensor, v, number=""):
    """libraries/AP_InertialSensor/AP_InertialSensor_Backend.cpp: _rotate_and_correct_gyro() and _accel() without rotations."""
    if sensor == "gyro":
        return v - of(p, f"INS_GYR{number}OFFS_#")
    return (v - of(p, f"INS_ACC{number}OFFS_#")) * of(p, f"INS_ACC{number}SCAL_#")


def assert_input_comes_back(correct, head):
    for sensor, size, scales in [("gyro", numpy.radians(100), False), ("accel", G, True)]:
        p, b = forward(sensor)
        rms = {"across": [], "scale": []}
        for k in range(6):
            x = numpy.zeros(3)
            x[k // 2] = size if k % 2 else -size
            off = correct(sensor, p @ x + b) - x
            gain = numpy.diag(p)
            # Only what has no parameter: cross terms, and the scale factors of a gyro.
            left = ACROSS @ x / gain if scales else (p - numpy.eye(3)) @ x
            assert numpy.allclose(off, left, atol=2e-6 * size), (sensor, off, left)
            rms["across"].append(ACROSS @ x / gain)
            rms["scale"].append((gain - 1) * x)
        # Both are reported with their sizes.
        worst = {key: numpy.abs(value).max() for key, value in rms.items()}
        assert f"{sensor}: cross terms, at" in head
        assert (f"{sensor}: scale factors, at" in head) == (not scales)
        if not scales:
            shown = f"{numpy.degrees(worst['scale']):.2f}"
            line = next(line for line in head.splitlines() if "gyro: scale factors, at" in line)
            assert shown[:4] in line, (shown, line)


@pytest.mark.parametrize("imu", [1, 2])
def test_px4_at_one_temperature(tmp_path, imu):
    (tmp_path / "cal.toml").write_text(calibration())
    p, head = export(tmp_path, "px4", "--imu", imu, "--gyro-id", 2490378, "--accel-id", 4000000000)
    n = imu - 1
    # PX4 keeps ids in int32.
    assert (p[f"CAL_GYRO{n}_ID"], p[f"CAL_ACC{n}_ID"]) == (2490378, 4000000000 - 2**32)
    assert len(p) == 2 + 3 + 6
    assert_input_comes_back(lambda sensor, v: px4(p, sensor, v, n), head)


@pytest.mark.parametrize("imu", [1, 2, 3])
def test_ardupilot_at_one_temperature(tmp_path, imu):
    (tmp_path / "cal.toml").write_text(calibration())
    number = "" if imu == 1 else str(imu)
    p, head = export(tmp_path, "ardupilot", "--imu", imu, "--accel-id", 2753036)
    assert p[f"INS_ACC{number}_ID"] == 2753036 and len(p) == 1 + 3 + 6
    assert_input_comes_back(lambda sensor, v: ardupilot(p, sensor, v, number), head)


def test_readings_in_volts_need_the_conversion_of_the_driver(tmp_path):
    (tmp_path / "cal.toml").write_text(calibration("V", 20.0, 1.65))
    known = ["--gyro-si-per-raw", 20, "--accel-si-per-raw", 20, "--gyro-zero", 1.65, "--accel-zero", 1.65]
    p, head = export(tmp_path, "ardupilot", *known)
    assert_input_comes_back(lambda sensor, v: ardupilot(p, sensor, v), head)
    # Without it, the driver is assumed to convert with the calibration. The output says so, and no factor remains.
    p, head = export(tmp_path, "px4")
    assert "--accel-si-per-raw" in head and (of(p, "CAL_ACC0_#SCALE") == 1).all()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--accel-si-per-raw", "20", "--gyro-si-per-raw", "20"], "--accel-zero"),
        (["--accel-si-per-raw", "15", "--accel-zero", "1.65"], "--accel-si-per-raw"),
    ],
)
def test_what_ardupilot_does_not_take_is_refused(tmp_path, arguments, says):
    (tmp_path / "cal.toml").write_text(calibration("V", 20.0, 1.65))
    command = [os.environ["MIMU"], "export", "ardupilot", "--calibration", "cal.toml", "-o", "p.param", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and says in done.stderr and "INS_ACC" in done.stderr, done.stderr
    assert not (tmp_path / "p.param").exists()


def reading(sensor, temp_c):
    """Reading of the driver for the unit over temperature at rest."""
    factor, zero = {"gyro": (1 / 0.344, 2.5), "accel": (1 / 0.0306, 1.65)}[sensor]
    return (curves(temp_c)[sensor][1] - zero) * factor


NOMINAL = ["--gyro-si-per-raw", 1 / 0.344, "--accel-si-per-raw", 1 / 0.0306, "--gyro-zero", 2.5, "--accel-zero", 1.65]


@pytest.mark.parametrize("temp_c", [-20.0, -3.0, 20.0, 47.0, 60.0])
def test_px4_over_temperature(thermal_unit: Unit, temp_c):
    p, _ = export(thermal_unit.folder, "px4", *NOMINAL)
    for sensor, letter in [("gyro", "G"), ("accel", "A")]:
        d = temp_c - p[f"TC_{letter}0_TREF"]
        offset = [sum(p[f"TC_{letter}0_X{k}_{axis}"] * d**k for k in range(4)) for axis in range(3)]
        # Biases of this unit are cubics; the tolerance covers single precision and the six decimals of the conversion.
        assert numpy.allclose(offset, reading(sensor, temp_c), atol=2e-5)


@pytest.mark.parametrize("temp_c", [-20.0, -3.0, 20.0, 47.0, 60.0])
def test_ardupilot_over_temperature(thermal_unit: Unit, temp_c):
    p, _ = export(thermal_unit.folder, "ardupilot", *NOMINAL)
    for sensor, short in [("gyro", "GYR"), ("accel", "ACC")]:
        # AP_InertialSensor_tempcal.cpp: polynomial_eval() about 35 °C in millionths, minus its value at the temperature of the calibration.
        def polynomial(temp_c, axis, short=short):
            d = temp_c - 35.0
            return sum(p[f"INS_TCAL1_{short}{k}_{axis}"] * d**k for k in (1, 2, 3)) * 1e-6

        settled_c = p[f"INS_{short}1_CALTEMP"]
        offset = [polynomial(temp_c, a) - polynomial(settled_c, a) + p[f"INS_{short}OFFS_{a}"] for a in "XYZ"]
        assert numpy.allclose(offset, reading(sensor, temp_c), atol=2e-5)


def rest_bias(sensor, temp_c):
    """Biases in SI of a unit at rest while its temperature changes."""
    x = (numpy.asarray(temp_c)[..., None] - 20.0) / 30.0
    size = {"gyro": 0.01, "accel": 0.1}[sensor]
    return size * (numpy.array([0.5, -0.3, 0.2]) + numpy.array([1.0, -0.7, 0.4]) * x + numpy.array([0.2, 0.1, -0.3]) * x**2 + numpy.array([0.1, 0.0, 0.2]) * x**3)


@pytest.fixture(scope="session")
def at_rest(tmp_path_factory):
    """Biases of a recording at rest in an unknown pose, from -10 to 50 °C and back in two hours; without a calibration."""
    folder = tmp_path_factory.mktemp("at-rest")
    t_s = numpy.arange(0, 7200, 0.1)
    temp_c = 50.0 - numpy.abs(t_s - 3600.0) / 60.0
    random = numpy.random.default_rng(5)
    up = numpy.array([0.1, -0.2, 0.97])
    gyro = rest_bias("gyro", temp_c) + 5e-4 * random.standard_normal((len(t_s), 3))
    accel = rest_bias("accel", temp_c) + G * up / numpy.linalg.norm(up) + 0.01 * random.standard_normal((len(t_s), 3))
    thermometer = temp_c + 0.02 * random.standard_normal(len(t_s))
    (folder / "rest").mkdir()
    header = "t_s,temp_c," + ",".join(f"{sensor}_{axis}" for sensor in ["gyro", "accel"] for axis in "xyz")
    numpy.savetxt(folder / "rest" / "samples.csv", numpy.column_stack([t_s, thermometer, gyro, accel]), "%.9g", ",", header=header, comments="")
    (folder / "rest" / "recording.toml").write_text(
        f'format = "mimu-recording/1"\ndevice = "unit"\nsample_rate_hz = 10.0\ngravity_mps2 = {G}\nraw_unit = "SI"\nreference = "gravity"\n'
    )
    run("thermal", "fit", "rest", "-o", "cal.toml", cwd=folder)
    return folder


# White noise over 10 of 60 K, and the errors of the fit at the ends of the range.
LEFT = {"gyro": 2e-5, "accel": 4e-4}


def test_px4_from_a_recording_at_rest_alone(at_rest):
    p, head = export(at_rest, "px4", "--gyro-id", 7, "--accel-id", 8)
    # TemperatureCompensation.cpp: calc_thermal_offsets_3D(), with the temperature clamped to TMIN to TMAX.
    temperatures = numpy.linspace(-9.0, 49.0, 30)
    for sensor, letter in [("gyro", "G"), ("accel", "A")]:
        of = lambda name, letter=letter: p[f"TC_{letter}0_{name}"]  # noqa: E731
        assert of("TMIN") == pytest.approx(-10, abs=0.5) and of("TMAX") == pytest.approx(50, abs=0.5)
        d = temperatures - of("TREF")
        offset = numpy.stack([sum(of(f"X{k}_{axis}") * d**k for k in range(4)) for axis in range(3)], axis=1)
        truth = rest_bias(sensor, temperatures)
        if sensor == "accel":
            # As in accel.cpp of PX4's own calibration: zero at the reference temperature.
            assert all(of(f"X0_{axis}") == 0 for axis in range(3))
            truth = truth - rest_bias(sensor, of("TREF"))
        assert numpy.abs(offset - truth).max() < LEFT[sensor], numpy.abs(offset - truth).max(axis=0)
    assert "Scale factors stay the flight controller's own" in head and "scale factors and cross terms: unknown" in head


def test_ardupilot_from_a_recording_at_rest_alone(at_rest):
    p, head = export(at_rest, "ardupilot", "--imu", 3)
    # Only the parameters that its own calibration over temperature writes.
    assert len(p) == 3 + 2 * 9 and all(name.startswith("INS_TCAL3_") for name in p)
    temperatures, calibrated_c = numpy.linspace(-9.0, 49.0, 30), 22.0
    for sensor, short in [("gyro", "GYR"), ("accel", "ACC")]:
        # AP_InertialSensor_tempcal.cpp: correct_sensor() from CALTEMP, with polynomial_eval() about 35 °C in millionths.
        def polynomial(temp_c, short=short):
            d = numpy.asarray(temp_c)[..., None] - 35.0
            return 1e-6 * sum(numpy.array([p[f"INS_TCAL3_{short}{k}_{a}"] for a in "XYZ"]) * d**k for k in (1, 2, 3))

        change = polynomial(temperatures) - polynomial(calibrated_c)
        truth = rest_bias(sensor, temperatures) - rest_bias(sensor, calibrated_c)
        assert numpy.abs(change - truth).max() < 2 * LEFT[sensor], numpy.abs(change - truth).max(axis=0)
    assert "Scale factors and offsets stay the flight controller's own (INS_ACC3SCAL, INS_ACC3OFFS)" in head
