"""The console line of SlimeNRF by the formulas of its console.c and sensor.c, and the lines of the Pigeon 2 by CTRE's definition of the number."""
import os
import re
import subprocess

import numpy
import pytest
from conftest import run
from test_autopilots import SCALE, calibration, forward


def line_of(folder, form, *arguments):
    run("export", form, "--calibration", "cal.toml", "-o", "out.txt", *arguments, cwd=folder)
    return (folder / "out.txt").read_text()


def slimenrf(text, revolutions, rate):
    """console.c: strtok() at the commas of the argument, den = 1 - degrees / (360 SENS_REV), gyroSensScale = 1 / den; sensor.c: g *= gyroSensScale."""
    command = next(line for line in text.splitlines() if not line.startswith("#"))
    name, argument = command.lower().split(" ", 1)
    assert name == "sens"
    degrees = numpy.array([float(token) for token in argument.split(",")])
    return rate / (1 - degrees / (360 * revolutions))


@pytest.mark.parametrize("revolutions", [2, 5])
def test_the_tracker_reads_the_rate(revolutions, tmp_path):
    (tmp_path / "cal.toml").write_text(calibration())
    text = line_of(tmp_path, "slimenrf", *([] if revolutions == 2 else ["--revolutions", revolutions]))
    p, _ = forward("gyro")
    for axis in range(3):
        # After the tracker's own bias, and about the axis alone: cross terms have no place.
        reading = p[axis, axis] * numpy.radians(100)
        assert numpy.isclose(slimenrf(text, revolutions, reading)[axis], numpy.radians(100), rtol=2e-7 * 360)
    assert numpy.abs(SCALE["gyro"] - 1).min() > 1e-3
    assert "gyro: cross terms, at 100 deg/s" in text and "accel" not in text.split("What this format adds")[1]


def test_a_pigeon_that_overshoots_gets_a_positive_number(tmp_path):
    (tmp_path / "cal.toml").write_text(calibration())
    lines = [line for line in line_of(tmp_path, "pigeon").splitlines() if not line.startswith("//")]
    found = [re.fullmatch(r"config\.GyroTrim\.GyroScalar([XYZ]) = (-?[\d.]+);", line).groups() for line in lines]
    assert [letter for letter, _ in found] == list("XYZ")
    # Pigeon2.h of Phoenix 5: degrees that it overshot after one rotation; overshot 1 degree is 1, undershot by 3 degrees is -3.
    p, _ = forward("gyro")
    read_of_a_turn = numpy.diag(p) * 360
    assert numpy.allclose([float(value) for _, value in found], read_of_a_turn - 360, atol=1e-4)
    assert (SCALE["gyro"] > 1).any() and (SCALE["gyro"] < 1).any()


@pytest.mark.parametrize("form, factor, says", [("slimenrf", 0.8, "10 %"), ("pigeon", 2.0, "-180 to 180")])
def test_a_factor_that_is_no_error_of_a_gyro_is_refused(form, factor, says, tmp_path):
    (tmp_path / "cal.toml").write_text(calibration())
    command = [os.environ["MIMU"], "export", form, "--calibration", "cal.toml", "-o", "out.txt", "--gyro-si-per-raw", str(factor)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and says in done.stderr and "--gyro-si-per-raw" in done.stderr, done.stderr


@pytest.mark.parametrize("form", ["slimenrf", "pigeon"])
def test_counts_need_the_factor_of_the_firmware(form, tmp_path):
    # Counts of 131 for 1 deg/s: with the calibration's own factor no error would be left.
    factor = numpy.radians(1 / 131)
    (tmp_path / "cal.toml").write_text(calibration("count", factor))
    command = [os.environ["MIMU"], "export", form, "--calibration", "cal.toml", "-o", "out.txt"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and "--gyro-si-per-raw" in done.stderr, done.stderr
    counts = line_of(tmp_path, form, "--gyro-si-per-raw", factor).splitlines()
    (tmp_path / "cal.toml").write_text(calibration())
    assert counts[-1] == line_of(tmp_path, form).splitlines()[-1]
