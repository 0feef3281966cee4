"""The script for IIO, run on a tree of files like that of /sys/bus/iio/devices, with the registers of the driver inv_icm42600."""
import os
import subprocess

import numpy
import pytest
from conftest import G, run
from test_autopilots import BIAS, calibration, forward

# inv_icm42600_gyro.c, _accel.c: 12 bits with a sign; 64 deg/s and 1 g are 2048 steps.
STEP = {"gyro": numpy.radians(64) / 2048, "accel": 9.80665 / 2048}
CHANNEL = {"gyro": "anglvel", "accel": "accel"}


def devices(folder, *chips):
    for k, name in enumerate(["st-pressure", *(f"{chip}-{s}" for chip in chips for s in ["gyro", "accel"])]):
        device = folder / f"iio:device{k}"
        device.mkdir()
        (device / "name").write_text(name + "\n")
        yield name, device


def script(folder, root, *arguments):
    (folder / "cal.toml").write_text(calibration())
    run("export", "iio", "--calibration", "cal.toml", "-o", "calibbias.sh", cwd=folder)
    return subprocess.run(["sh", "calibbias.sh", *arguments], cwd=folder, env={**os.environ, "IIO_DEVICES": str(root)}, capture_output=True, text=True)


def test_the_chip_adds_what_removes_the_bias(tmp_path):
    (tmp_path / "root").mkdir()
    of = dict(devices(tmp_path / "root", "icm42688"))
    done = script(tmp_path, tmp_path / "root")
    assert done.returncode == 0, done.stderr
    for sensor, size in [("gyro", numpy.radians(100)), ("accel", G)]:
        device = of[f"icm42688-{sensor}"]
        written = numpy.array([float((device / f"in_{CHANNEL[sensor]}_{axis}_calibbias").read_text()) for axis in "xyz"])
        # write_offset(): the nearest step of the register, within 12 bits.
        register = numpy.round(written / STEP[sensor])
        assert (numpy.abs(register) <= 2047).all() and (register != 0).all()
        p, b = forward(sensor)
        x = numpy.array([size, -size, size])
        # The chip adds its registers: InvenSense's Ixm42xxxSelfTest.c writes the negative bias.
        output = p @ x + b + register * STEP[sensor]
        assert numpy.abs(output - p @ x).max() <= 0.5001 * STEP[sensor]
        assert numpy.abs(BIAS[sensor]).min() > 5 * STEP[sensor]


def test_of_two_chips_one_has_to_be_named(tmp_path):
    (tmp_path / "root").mkdir()
    of = dict(devices(tmp_path / "root", "icm42688", "icm42605"))
    done = script(tmp_path, tmp_path / "root")
    assert done.returncode == 1 and "several devices" in done.stderr
    assert not list((tmp_path / "root").glob("*/*calibbias"))
    done = script(tmp_path, tmp_path / "root", "icm42605")
    assert done.returncode == 0, done.stderr
    assert sorted(path.parent for path in (tmp_path / "root").glob("*/*_x_calibbias")) == sorted(of[f"icm42605-{s}"] for s in ["gyro", "accel"])


def test_without_the_driver_the_script_says_so(tmp_path):
    (tmp_path / "root").mkdir()
    list(devices(tmp_path / "root"))
    done = script(tmp_path, tmp_path / "root")
    assert done.returncode == 1 and "inv_icm42600" in done.stderr


@pytest.mark.parametrize("sensor, zero", [("gyro", 2.0), ("accel", -12.0)])
def test_a_bias_beyond_the_registers_is_refused(sensor, zero, tmp_path):
    (tmp_path / "cal.toml").write_text(calibration())
    command = [os.environ["MIMU"], "export", "iio", "--calibration", "cal.toml", "-o", "out.sh", f"--{sensor}-zero", str(zero)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and f"in_{CHANNEL[sensor]}_x_calibbias" in done.stderr, done.stderr
