"""Hard iron, soft iron and biases by the formulas of Adafruit_Sensor_Calibration.cpp, `calibrate`: readings in, the input out."""
import json
import re

import numpy
import pytest
from conftest import run
from test_autopilots import BIAS, calibration, forward

# uT per count with cross terms, and a quarter turn about z from the compass to the gyro.
SOFT = numpy.array([[0.1, 0.004, 0.002], [0.0, 0.11, -0.003], [0.0, 0.0, 0.125]])
SHIFT = numpy.array([-5.0, 3.0, 2.0])
QUARTER = numpy.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
FACTOR = 0.1


def body():
    none = [[0.0] * 3] * 3
    return (
        '[[body]]\ntriad = "mag"\nreference = "gyro"\nformula = "x = C u + o"\ndirection = "raw to SI"\nraw_unit = "count"\n'
        f'unit = "uT"\nC = {SOFT.tolist()}\no = {SHIFT.tolist()}\nsigma_C = {none}\nsigma_o = {none[0]}\n'
        f"interval_C = {none}\ninterval_o = {none[0]}\nrotation_deg = [0.0, 0.0, 90.0]\n"
    )


def arrays(path, layout):
    """The arrays of the file, by name."""
    text = path.read_text()
    if layout == "json":
        return {name: numpy.array(values) for name, values in json.loads(text).items()}
    found = re.findall(r"^float (\w+)\[(\d+)\] = \{(.*)\};", text, re.M)
    for name, count, values in found:
        assert len(values.split(",")) == int(count), name
    return {name: numpy.array([float(v) for v in values.split(",")]) for name, _, values in found}


@pytest.mark.parametrize("layout", ["lines", "json"])
def test_the_field_and_the_inputs_come_back(layout, tmp_path):
    (tmp_path / "cal.toml").write_text(calibration() + body())
    run("export", "adafruit", "--calibration", "cal.toml", "--layout", layout, "--mag-ut-per-raw", FACTOR, "-o", "out", cwd=tmp_path)
    of = arrays(tmp_path / "out", layout)
    code = numpy.array([120.0, -75.0, 300.0])
    field = of["mag_softiron"].reshape(3, 3) @ (FACTOR * code - of["mag_hardiron"])
    assert numpy.allclose(field, QUARTER @ (SOFT @ code + SHIFT), atol=1e-4)
    for sensor, name in [("gyro", "gyro_zerorate"), ("accel", "accel_zerog")]:
        _, b = forward(sensor)
        assert numpy.allclose(b - of[name], 0, atol=1e-7) and numpy.abs(BIAS[sensor]).min() > 1e-3

