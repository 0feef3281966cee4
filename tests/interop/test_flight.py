"""CLI lines of Betaflight and INAV by the formulas of their acceleration.c: codes of the accelerometer in, the input out."""
import os
import re
import subprocess

import numpy
import pytest
from conftest import G, run
from test_autopilots import ACROSS, BIAS, SCALE, calibration, forward

ACC_1G = 2048


def export(folder, form, *arguments):
    """The settings as the CLI reads them, and the comments."""
    run("export", form, "--calibration", "cal.toml", "-o", "cli.txt", *arguments, cwd=folder)
    lines = (folder / "cli.txt").read_text().splitlines()
    comments = [line for line in lines if line.startswith("#")]
    commands = lines[len(comments) :]
    assert commands[-1] == "save"
    settings = dict(re.fullmatch(r"set (\w+) = ([-\d,]+)", line).groups() for line in commands[:-1])
    return settings, "\n".join(comments)


def betaflight(settings, code):
    """accUpdate(): applyAccelerationTrims() on whole numbers; accADC is a float."""
    x, y, z, completed = map(int, settings["acc_calibration"].split(","))
    assert completed == 1
    return code - numpy.array([x, y, z])


def inav(settings, code):
    """applyAccelerationZero()"""
    zero, gain = (numpy.array([int(settings[f"{name}_{axis}"]) for axis in "xyz"]) for name in ["acczero", "accgain"])
    return (code - zero) * gain / 4096


@pytest.mark.parametrize("form, correct, scales", [("betaflight", betaflight, False), ("inav", inav, True)])
def test_the_input_comes_back(form, correct, scales, tmp_path):
    (tmp_path / "cal.toml").write_text(calibration())
    settings, head = export(tmp_path, form, "--acc-1g", ACC_1G)
    p, b = forward("accel")
    for k in range(6):
        x = numpy.zeros(3)
        x[k // 2] = G if k % 2 else -G
        code = (p @ x + b) * ACC_1G / G
        off = correct(settings, code) * G / ACC_1G - x
        # What has no setting: cross terms, and in Betaflight the scale factors. The settings are whole numbers.
        left = ACROSS @ x / SCALE["accel"] if scales else ACROSS @ x + (SCALE["accel"] - 1) * x
        whole = 0.5 * G / ACC_1G + (0.5 / 4096 * G if scales else 0)
        assert numpy.abs(off - left).max() < 1.03 * whole, (off, left)
    # The biases are larger than what is left, or their sign would not show.
    assert numpy.abs(BIAS["accel"]).min() > 10 * whole
    assert "accel: cross terms, at 1 g" in head and "accel: rounding" in head
    assert ("accel: scale factors, at 1 g" in head) == (not scales)
    shown = numpy.degrees(numpy.abs(SCALE["gyro"] - 1).max() * numpy.radians(100))
    assert f"at most {shown:.2f}"[:12] in next(line for line in head.splitlines() if "gyro: scale factors, at" in line)


@pytest.mark.parametrize("form", ["betaflight", "inav"])
def test_counts_are_the_codes_of_the_firmware(form, tmp_path):
    (tmp_path / "si").mkdir(), (tmp_path / "count").mkdir()
    (tmp_path / "si" / "cal.toml").write_text(calibration())
    # A code is G / ACC_1G m/s², in both triads of this unit.
    (tmp_path / "count" / "cal.toml").write_text(calibration("count", G / ACC_1G))
    si, _ = export(tmp_path / "si", form, "--acc-1g", ACC_1G)
    counts, head = export(tmp_path / "count", form, "--acc-1g", ACC_1G)
    assert si == counts
    # The codes of a gyro are others, and nobody said which.
    assert "gyro: scale factors: unknown" in head


def test_a_number_beyond_the_range_is_refused(tmp_path):
    (tmp_path / "cal.toml").write_text(calibration())
    command = [os.environ["MIMU"], "export", "inav", "--calibration", "cal.toml", "-o", "cli.txt", "--acc-1g", "2048", "--accel-si-per-raw", "0.4"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and "accgain_x" in done.stderr and "1 to 8192" in done.stderr, done.stderr
    assert not (tmp_path / "cli.txt").exists()
