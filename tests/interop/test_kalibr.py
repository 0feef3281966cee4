"""imu.yaml as read by Kalibr, and its scale-misalignment model as in IccSensors.py."""
import numpy
import noise_of_a_unit
import pytest
import yaml
from conftest import Unit, run, triad

SAG = [[2e-4, -1e-4, 3e-4], [5e-5, 1e-4, -2e-4], [1e-4, 2e-4, -3e-4]]


@pytest.fixture(scope="module")
def noise(tmp_path_factory):
    return noise_of_a_unit.write(tmp_path_factory.mktemp("noise"))


@pytest.fixture(scope="module")
def oblique(thermal_unit, tmp_path_factory):
    """A unit in volts with its triads rotated by degrees against the body and each other, one axis of the gyro inverted."""
    p_gyro = 0.344 * numpy.array([[0.98, 0.05, -0.02], [0.04, -1.01, 0.06], [-0.03, 0.08, 1.03]])
    p_accel = 0.0306 * numpy.array([[1.02, -0.07, 0.03], [0.06, 0.99, 0.01], [-0.02, 0.04, 0.97]])
    triads = {"gyro": (p_gyro, [2.51, 2.48, 2.53], "rad/s"), "accel": (p_accel, [1.66, 1.64, 1.67], "m/s^2")}
    return variant(text_of(triads), thermal_unit.folder / "recording", tmp_path_factory.mktemp("oblique"))


@pytest.fixture(scope="module")
def sagging(oblique, tmp_path_factory):
    """The same with a g-sensitivity in its calibration, as written by a diagnosis; `mimu apply` removes it."""
    text = (oblique.folder / "cal.toml").read_text()
    text += '\n[[effect]]\nid = "gyro_g_sensitivity"\nsensor = "gyro"\nabout = ""\n'
    text += 'formula = "x = C (u - S e) + o, e_i = sum of coefficient * regressor"\ndirection = "raw to SI"\n'
    for i, row in enumerate(SAG):
        for j, value in enumerate(row):
            name = "xyz"[i] + "xyz"[j]
            text += f'[[effect.coefficients]]\nname = "{name}"\nvalue = {value}\nsigma = 1e-6\nunit = "rad/s/(m/s^2)"\n'
    return variant(text, oblique.folder / "recording", tmp_path_factory.mktemp("sagging"))


def text_of(triads):
    """A calibration at one temperature from P, b and the unit of each triad, readings in volts; not written by mimu."""
    text = 'format = "mimu-calibration/1"\ndevice = "unit"\ncreated = "2026-01-02T03:04:05Z"\ntool = "test"\n[recording]\nraw_unit = "V"\n'
    for sensor, (p, b, unit_name) in triads.items():
        c = numpy.linalg.inv(p)
        text += f'[{sensor}]\nformula = "x = C u + o"\ndirection = "raw to SI"\nraw_unit = "V"\nunit = "{unit_name}"\nframe = "body"\n'
        text += f"C = {c.tolist()}\no = {(-c @ b).tolist()}\n"
        text += f'[{sensor}.forward]\nformula = "u = P x + b"\ndirection = "SI to raw"\nP = {p.tolist()}\nb = {b}\n'
        text += f'[{sensor}.physical]\nformula = ""\nscale_factor = {numpy.linalg.norm(p, axis=1).tolist()}\nbias = {b}\n'
        text += "misalignment_deg = [0.0, 0.0, 0.0]\nnon_orthogonality_deg = [0.0, 0.0, 0.0]\n"
    return text


def variant(calibration, recording, folder):
    (folder / "cal.toml").write_text(calibration)
    (folder / "recording").symlink_to(recording)
    return Unit(folder, "recording")


def driver(unit, sensor, si_per_raw=None, zero=0.0):
    """The readings in SI, and their bias, from the tables of cal.toml."""
    forward = unit.calibration[sensor]["forward"]
    factors = 1 / numpy.linalg.norm(forward["P"], axis=1) if si_per_raw is None else si_per_raw
    return factors * (triad(unit.raw, sensor) - zero), factors * (numpy.array(forward["b"]) - zero)


def kalibr_model(imu, rates, forces):
    """IccScaledMisalignedImu: w = M (C_gyro_i w_i) + A (C_gyro_i a_i), a = M a_i; one row a sample."""
    m_accel = numpy.array(imu["accelerometers"]["M"])
    m, c, a = (numpy.array(imu["gyroscopes"][key]) for key in ["M", "C_gyro_i", "A"])
    return rates @ (m @ c).T + forces @ (a @ c).T, forces @ m_accel.T


def check_intrinsics(imu, unit, gyro, accel):
    m_accel = numpy.array(imu["accelerometers"]["M"])
    m_gyro, c = numpy.array(imu["gyroscopes"]["M"]), numpy.array(imu["gyroscopes"]["C_gyro_i"])
    for m in [m_accel, m_gyro]:
        assert numpy.array_equal(m, numpy.tril(m)), "Kalibr's M is lower triangular"
    assert numpy.allclose(c @ c.T, numpy.eye(3), atol=1e-9) and numpy.linalg.det(c) > 0
    # The frame of Kalibr: a rotation of the calibration's frame, determined here from the forces alone.
    (y_gyro, b_gyro), (y_accel, b_accel) = gyro, accel
    body = triad(unit.applied, "accel")
    in_frame = (y_accel - b_accel) @ numpy.linalg.inv(m_accel).T
    rotation = numpy.linalg.lstsq(body, in_frame, rcond=None)[0].T
    assert numpy.allclose(rotation @ rotation.T, numpy.eye(3), atol=1e-6) and numpy.linalg.det(rotation) > 0
    rates, forces = triad(unit.applied, "gyro") @ rotation.T, body @ rotation.T
    w, a = kalibr_model(imu, rates, forces)
    assert numpy.allclose(w + b_gyro, y_gyro, atol=1e-6)
    assert numpy.allclose(a + b_accel, y_accel, atol=1e-6)
    return rotation


def test_densities_are_those_of_the_worst_axis(noise, tmp_path):
    out = tmp_path / "imu.yaml"
    run("export", "kalibr", "--noise", noise, "-o", out, "--rostopic", "/imu/raw", cwd=tmp_path)
    imu = yaml.safe_load(out.read_text())
    assert imu["rostopic"] == "/imu/raw" and imu["update_rate"] == noise_of_a_unit.RATE_HZ
    for sensor, prefix in [("gyro", "gyroscope"), ("accel", "accelerometer")]:
        n, k = noise_of_a_unit.WORST[sensor]
        # Kalibr: discrete standard deviation = density / sqrt(1 / update_rate).
        assert noise_of_a_unit.close(imu[f"{prefix}_noise_density"] / (1 / imu["update_rate"]) ** 0.5, n * noise_of_a_unit.RATE_HZ**0.5)
        assert noise_of_a_unit.close(imu[f"{prefix}_random_walk"], k)
    assert "accelerometers" not in imu


def test_an_option_that_nothing_uses_is_refused(noise, tmp_path):
    with pytest.raises(AssertionError, match=r"this option needs a calibration.*\(--gyro-zero\)"):
        run("export", "kalibr", "--noise", noise, "-o", "imu.yaml", "--gyro-zero", 3, cwd=tmp_path)


@pytest.mark.parametrize("which", ["unit", "oblique"])
def test_intrinsics_give_the_readings(which, noise, request):
    unit = request.getfixturevalue(which)
    path, result = unit.export("kalibr", "--noise", noise)
    imu = yaml.safe_load(path.read_text())
    rotation = check_intrinsics(imu, unit, driver(unit, "gyro"), driver(unit, "accel"))
    stated = next(line for line in path.read_text().splitlines() if "R = " in line).split("R = ")[1]
    assert numpy.allclose(yaml.safe_load(stated), rotation, atol=2e-6)
    if which == "oblique":
        assert numpy.abs(rotation - numpy.eye(3)).max() > 0.05 and imu["gyroscopes"]["M"][1][1] < -0.9
    assert not numpy.any(imu["gyroscopes"]["A"])
    assert {"rms", "source"} <= set(result["remaining"][0])
    # If the driver scales correctly, the densities are those of calibrated readings.
    assert noise_of_a_unit.close(imu["gyroscope_noise_density"], noise_of_a_unit.WORST["gyro"][0])


def test_a_driver_of_other_factors_and_zeros(unit, noise):
    arguments = ["--gyro-si-per-raw", 2e-4, "--accel-si-per-raw", 3e-4, "--gyro-zero", 100, "--accel-zero", 50]
    path, _ = unit.export("kalibr", "--noise", noise, "--result", *arguments)
    imu = yaml.safe_load(path.read_text())["imu0"]
    check_intrinsics(imu, unit, driver(unit, "gyro", 2e-4, 100), driver(unit, "accel", 3e-4, 50))
    # The noise is that of these readings: density times the driver's gain, on the axis where this is largest.
    gains = 2e-4 * numpy.linalg.norm(unit.calibration["gyro"]["forward"]["P"], axis=1)
    ours = max(gain * noise_of_a_unit.CHANNELS[f"gyro_{axis}"][0] for gain, axis in zip(gains, "xyz"))
    assert noise_of_a_unit.close(imu["gyroscope_noise_density"], ours)


def test_g_sensitivity_has_a_place(sagging, noise):
    path, result = sagging.export("kalibr", "--noise", noise)
    imu = yaml.safe_load(path.read_text())
    check_intrinsics(imu, sagging, driver(sagging, "gyro"), driver(sagging, "accel"))
    # Otherwise the test would show nothing: without A the readings would have the error of the g-sensitivity under gravity.
    assert numpy.abs(numpy.array(imu["gyroscopes"]["A"])).max() > 1e-4
    assert "gyro_g_sensitivity" not in [r["source"] for r in result["remaining"]]
