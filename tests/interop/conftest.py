"""Calibrations, recordings and the output of `mimu apply`, for the tests of every format."""
import csv
import json
import os
import pathlib
import subprocess
import tomllib

import numpy
import pytest
from browser import chromium, page, server  # noqa: F401

EXAMPLE = pathlib.Path(__file__).parent.parent / "example"
G = 9.80665


def run(*arguments, cwd):
    """Runs mimu and returns its output."""
    done = subprocess.run([os.environ["MIMU"], *map(str, arguments)], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


class Unit:
    """A calibrated unit in a folder: `cal.toml`, and samples of it raw and compensated by `mimu apply`."""

    def __init__(self, folder, recording):
        self.folder = folder
        self.calibration = tomllib.loads((folder / "cal.toml").read_text())
        run("apply", recording, "--calibration", "cal.toml", "-o", "applied", "--format", "csv", cwd=folder)
        self.raw = read_samples(folder / recording)
        self.applied = read_samples(folder / "applied")

    def export(self, form, *arguments, name=None):
        """Exports to `name`; returns the path and the result as JSON."""
        path = self.folder / (name or f"export-{form}")
        path.unlink(missing_ok=True)
        out = run("export", form, "--calibration", "cal.toml", "-o", path, "--json", "-", *arguments, cwd=self.folder)
        return path, json.loads(out)

    def model(self, sensor):
        """C and o, raw to SI."""
        table = self.calibration[sensor]
        return numpy.array(table["C"]), numpy.array(table["o"])


def read_samples(folder):
    """Columns of a recording's samples by name; an empty cell is NaN."""
    with open(folder / "samples.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: numpy.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def triad(samples, sensor):
    return numpy.stack([samples[f"{sensor}_{axis}"] for axis in "xyz"], axis=1)


@pytest.fixture(scope="session")
def unit(tmp_path_factory):
    """The example by hand, at one temperature, readings in counts."""
    folder = tmp_path_factory.mktemp("unit")
    run(
        "import", EXAMPLE / "accel.txt", EXAMPLE / "gyro.txt",
        "--columns", "t_s,accel_x,accel_y,accel_z", "--columns", "t_s,gyro_x,gyro_y,gyro_z",
        "--gravity", G, "--raw-unit", "count", "--reference", "gravity", "--format", "csv", "-o", "by-hand",
        cwd=folder,
    )  # fmt: skip
    run("fit", "by-hand", "-o", "cal.toml", cwd=folder)
    return Unit(folder, "by-hand")


def curves(temp_c):
    """A made-up unit over temperature: P and b of gyro and accelerometer, SI to raw, in volts."""
    x = (temp_c - 20.0) / 40.0
    across = numpy.array([[0, 0.01, -0.004], [0.002, 0, 0.006], [-0.003, 0.005, 0]])
    gyro = 0.344 * (numpy.eye(3) * (1 + 0.016 * x) + across)
    accel = 0.0306 * (numpy.eye(3) * (1 - 0.006 * x) + across)
    gyro_bias = 2.5 + 0.344 * numpy.array([0.01 - 0.02 * x + 0.006 * x**3, -0.02 + 0.01 * x, 0.03 * x - 0.005 * x**2])
    accel_bias = 1.65 + 0.0306 * numpy.array([0.3 - 0.1 * x + 0.02 * x**3, -0.2 + 0.2 * x, 0.1 + 0.08 * x])
    return {"gyro": (gyro, gyro_bias), "accel": (accel, accel_bias)}


def inverse(temp_c):
    """C and o of the same, raw to SI."""
    result = {}
    for sensor, (p, b) in curves(temp_c).items():
        c = numpy.linalg.inv(p)
        result[sensor] = (c, -c @ b)
    return result


@pytest.fixture(scope="session")
def thermal_unit(tmp_path_factory):
    """A unit with curves from -20 to 60 °C and dies that lag by 60 s, readings in volts. Its file is written here, not by mimu."""
    folder = tmp_path_factory.mktemp("thermal")
    rows = lambda m: json.dumps(m.tolist())  # noqa: E731
    text = 'format = "mimu-calibration/2"\ndevice = "unit"\ncreated = "2026-01-02T03:04:05Z"\ntool = "test"\n'
    text += '[recording]\nraw_unit = "V"\ntemp_c = 20.0\n'
    for sensor, unit_name in [("gyro", "rad/s"), ("accel", "m/s^2")]:
        (p, b), (c, o) = curves(20.0)[sensor], inverse(20.0)[sensor]
        text += f'[{sensor}]\nformula = "x = C u + o"\ndirection = "raw to SI"\nraw_unit = "V"\nunit = "{unit_name}"\nframe = "body"\n'
        text += f"C = {rows(c)}\no = {rows(o)}\n"
        text += f'[{sensor}.forward]\nformula = "u = P x + b"\ndirection = "SI to raw"\nP = {rows(p)}\nb = {rows(b)}\n'
        text += f'[{sensor}.physical]\nformula = ""\nscale_factor = {rows(numpy.diag(p))}\nbias = {rows(b)}\n'
        text += "misalignment_deg = [0.0, 0.0, 0.0]\nnon_orthogonality_deg = [0.0, 0.0, 0.0]\n"
    text += "[temperature]\nrange_c = [-20.0, 60.0]\ndies.gyro.lag_s = 60.0\ndies.accel.lag_s = 60.0\n"
    for temp_c in range(-20, 61, 10):
        text += f"[[temperature.node]]\ntemp_c = {float(temp_c)}\n"
        for sensor in ["gyro", "accel"]:
            h = 1e-3
            c, o = inverse(temp_c)[sensor]
            (ca, oa), (cb, ob) = inverse(temp_c - h)[sensor], inverse(temp_c + h)[sensor]
            text += f"[temperature.node.{sensor}]\nC = {rows(c)}\no = {rows(o)}\n"
            text += f"slope_C = {rows((cb - ca) / (2 * h))}\nslope_o = {rows((ob - oa) / (2 * h))}\n"
            # Intervals that are visible beside the curves: wider at low temperature.
            gain, share = numpy.diag(curves(temp_c)[sensor][0]), 3e-4 * (2 - temp_c / 60)
            text += f"sigma_scale_factor = {rows(share * gain)}\nsigma_bias = {rows(share * gain * G)}\n"
    (folder / "cal.toml").write_text(text)
    # Ten minutes at 10 Hz, warming from -15 to 55 °C and turning about all axes.
    random = numpy.random.default_rng(1)
    (folder / "warming").mkdir()
    header = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,temp_c"
    lines = [header]
    for k in range(6000):
        temp_c = -15 + 70 * k / 6000
        values = [0.1 * k]
        for sensor, size in [("gyro", 2.0), ("accel", G)]:
            p, b = curves(temp_c)[sensor]
            values += list(p @ random.uniform(-size, size, 3) + b)
        lines.append(",".join(f"{v:.9g}" for v in [*values, temp_c]))
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    run(
        "import", "log.csv", "--columns", header, "--gravity", G, "--raw-unit", "V", "--reference", "gravity",
        "--format", "csv", "-o", "recording", cwd=folder,
    )  # fmt: skip
    return Unit(folder, "recording")
