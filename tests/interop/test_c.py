"""The header compiles without a warning, and computes what `mimu apply` writes, to within the rounding of single precision."""
import os
import shutil
import subprocess

import numpy
import pytest
import test_adafruit
import test_autopilots
from conftest import Unit, run, triad

# A program that reads "follow dt temp" and "sample x y z x y z" and writes six numbers for each sample. The contents of the header depend on the
# calibration, so the calls do too.
MAIN = """
#include <stdio.h>
#include "calibration.h"
int main(void)
{{
    float u[6], x[6], dt, temp_c;
    char kind;
    {start}
    (void)dt, (void)temp_c;
    while (scanf(" %c", &kind) == 1) {{
        if (kind == 'f') {{
            if (scanf("%f %f", &dt, &temp_c) != 2)
                return 1;
            {follow}
            continue;
        }}
        if (scanf("%f %f %f %f %f %f", u, u + 1, u + 2, u + 3, u + 4, u + 5) != 6)
            return 1;
        {apply}
        printf("%.9g %.9g %.9g %.9g %.9g %.9g\\n", x[0], x[1], x[2], x[3], x[4], x[5]);
    }}
    return 0;
}}
"""
# Half a unit in the last place of 1: the largest error of one rounding.
U = 2.0**-24


def compiler(name):
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is missing here")
    return path


def steps(unit):
    """What `mimu apply` tells the calibration of time and temperature: at the first sample of each block of 0.1 s, and of four samples at
    least, the middle of the block and its mean temperature."""
    t_s = unit.raw["t_s"]
    temp_c = unit.raw.get("temp_c", numpy.full(len(t_s), numpy.nan))
    rows = max(round(0.1 / numpy.median(numpy.diff(t_s))), 4)
    told_s = t_s[0]
    for first in range(0, len(t_s), rows):
        block = slice(first, first + rows)
        middle_s = 0.5 * (t_s[block][0] + t_s[block][-1])
        yield first, middle_s - told_s, temp_c[block].mean()
        told_s = middle_s


def by_c(unit, name, state=False, follow=False, effects=False, sample_rate_hz=None):
    """Samples computed by a program that is compiled with the header."""
    folder = unit.folder / f"by-{name}"
    folder.mkdir(exist_ok=True)
    unit.export("c", "--prefix", "unit7", name=folder / "calibration.h")
    start = "unit7_state s; unit7_start(&s);" if state else ""
    if sample_rate_hz is not None:
        start += f" s.sample_rate_hz = {sample_rate_hz}f;"
    of = "&s, " if "temperature" in unit.calibration else ""
    apply = f"unit7_gyro({of}u, x); unit7_accel({of}u + 3, x + 3);" + ("unit7_remove_effects(&s, x, x + 3);" if effects else "")
    text = MAIN.format(start=start, follow="unit7_follow(&s, dt, temp_c);" if follow else "", apply=apply)
    (folder / "main.c").write_text(text)
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2", "-ffp-contract=off"]
    command = [compiler(name), *flags, "main.c", "-o", "main", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = []
    told = {first: f"f {dt_s:.9g} {temp_c:.9g}" for first, dt_s, temp_c in steps(unit)} if follow else {}
    for k, row in enumerate(numpy.hstack([triad(unit.raw, "gyro"), triad(unit.raw, "accel")])):
        if k in told:
            lines.append(told[k])
        lines.append("s " + " ".join(f"{v:.9g}" for v in row))
    done = subprocess.run(["./main"], cwd=folder, input="\n".join(lines) + "\n", capture_output=True, text=True, check=True)
    ours = numpy.array([line.split() for line in done.stdout.splitlines()], float)
    return {"gyro": ours[:, :3], "accel": ours[:, 3:]}


def magnitude(unit, sensor):
    """Sum of the absolute terms of C u + o: what is rounded."""
    c, o = unit.model(sensor)
    return numpy.abs(triad(unit.raw, sensor)) @ numpy.abs(c).T + numpy.abs(o)


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_at_one_temperature(unit, name):
    ours = by_c(unit, name)
    for sensor in ["gyro", "accel"]:
        off = numpy.abs(ours[sensor] - triad(unit.applied, sensor))
        # In each term C, u and their product are rounded, and three sums follow.
        assert (off <= 6 * U * magnitude(unit, sensor)).all(), off.max()


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_over_temperature_behind_the_lag_of_the_dies(thermal_unit, name):
    ours = by_c(thermal_unit, name, state=True, follow=True)
    for sensor in ["gyro", "accel"]:
        off = numpy.abs(ours[sensor] - triad(thermal_unit.applied, sensor))
        # Each number of the model: four products with weights of up to six roundings, and their sums. The lag is a sum of 1500 steps of a difference
        # of 7 K, each of which loses a share of 0.4 s / 60 s: 150 roundings of 7 K, and half a unit in the last place of 55 °C.
        die_c = U * (150 * 7.0 + 55.0)
        nodes = thermal_unit.calibration["temperature"]["node"]
        slope_c = numpy.max([numpy.abs(node[sensor]["slope_C"]) for node in nodes], axis=0)
        slope_o = numpy.max([numpy.abs(node[sensor]["slope_o"]) for node in nodes], axis=0)
        per_k = numpy.abs(triad(thermal_unit.raw, sensor)) @ slope_c.T + slope_o
        bound = 20 * U * magnitude(thermal_unit, sensor) + die_c * per_k
        assert (off <= bound).all(), (off / bound).max()
        # The model does follow: the model at one temperature would be far off.
        c, o = thermal_unit.model(sensor)
        assert numpy.abs(triad(thermal_unit.raw, sensor) @ c.T + o - ours[sensor]).max() > 1000 * bound.max()


def effect(identity, coefficients, about="", **more):
    lines = [
        "[[effect]]", f'id = "{identity}"', f'sensor = "{identity.split(":")[-1].split("_")[0]}"', f'about = "{about}"',
        'formula = "x = C (u - S e) + o, e_i = sum of coefficient * regressor"', 'direction = "raw to SI"',
    ]  # fmt: skip
    lines += [f"{key} = {value}" for key, value in more.items()]
    each = [f'{{ name = "{n}", value = {v!r}, unit = "{u}" }}' for n, v, u in coefficients]
    return "\n".join([*lines, f"coefficients = [{', '.join(each)}]"]) + "\n"


EFFECTS = [
    effect("gyro_g_sensitivity", [("xz", 4e-4, "rad/s/(m/s^2)"), ("yx", -2e-4, "rad/s/(m/s^2)"), ("zz", 1e-4, "rad/s/(m/s^2)")]),
    effect("gyro_scale_asymmetry", [("x", 2e-3, "1"), ("y", -1e-3, "1")]),
    effect("accel_scale_quadratic", [("x", 5e-4, "1/(m/s^2)"), ("z", -3e-4, "1/(m/s^2)")]),
    effect("accel_scale_cubic", [("y", 4e-5, "1/(m/s^2)^2")]),
    effect("accel_cross_axis_product", [("x yz", 3e-4, "1/(m/s^2)"), ("z xy", 2e-4, "1/(m/s^2)")]),
    effect("accel_size_effect", [("xx", 0.01, "m"), ("yz", -0.02, "m")]),
    effect("term:gyro_y~rate_x*force_z", [("y", 1e-3, "rad/s/((rad/s)*(m/s^2))")]),
    effect("gyro_thermal_bias", [("x", 1e-3, "rad/s/K"), ("x squared", 2e-5, "rad/s/K^2")]),
    effect("accel_thermal_scale", [("y", 3e-4, "1/K")]),
    effect("gyro_thermal_lag", [("z", 2e-3, "rad/s/K")], nonlinear_parameter='{ name = "lag_s", value = 90.0 }'),
    effect("accel_warm_up", [("x", 0.05, "m/s^2")], nonlinear_parameter='{ name = "time_constant_s", value = 200.0 }'),
    effect("term:accel_z~temp_rate", [("z", 0.5, "m/s^2/(K/s)")]),
]


@pytest.fixture(scope="module")
def unit_with_effects(thermal_unit, tmp_path_factory):
    """The unit over temperature with made-up effects: of rate and force, of temperature, of its change, and of time."""
    folder = tmp_path_factory.mktemp("effects")
    shutil.copytree(thermal_unit.folder / "recording", folder / "recording")
    text = (thermal_unit.folder / "cal.toml").read_text()
    (folder / "cal.toml").write_text(text + "\n" + "\n".join(EFFECTS))
    return Unit(folder, "recording")


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_with_effects(thermal_unit, unit_with_effects, name):
    unit = unit_with_effects
    _, result = unit.export("c")
    sources = {r["source"] for r in result["remaining"]}
    for written in EFFECTS:
        assert written.split('"')[1] not in sources
    ours = by_c(unit, name, state=True, follow=True, effects=True, sample_rate_hz="10.0")
    for sensor in ["gyro", "accel"]:
        applied = triad(unit.applied, sensor)
        off = numpy.abs(ours[sensor] - applied)
        # As without effects. An error is a function of rounded inputs: its share of them, below 3 %, adds less than one rounding. The angular
        # acceleration is a difference of two rates times 10 Hz.
        bound = 22 * U * magnitude(unit, sensor) + U * (150 * 7.0 + 55.0) * 0.05
        bound += {"gyro": 0.0, "accel": 2 * 10.0 * 0.02 * 22 * U * magnitude(unit, "gyro").max()}[sensor]
        assert (off <= bound).all(), (off / bound).max()
        # The effects make a difference.
        without = triad(thermal_unit.applied, sensor)
        assert numpy.abs(applied - without).max() > 100 * bound.max()


def test_the_head_says_what_to_compute_with_it(thermal_unit):
    path, result = thermal_unit.export("c", "--prefix", "left_imu")
    head = path.read_text().split("#ifndef LEFT_IMU_H")[0]
    for said in ["unit", "calibrated 2026-01-02", "readings in V, output in rad/s in the frame \"body\"", "raw to SI", *result["notes"]]:
        assert said in head, said


def test_a_prefix_that_is_no_name_is_refused(unit):
    done = subprocess.run(
        [os.environ["MIMU"], "export", "c", "--calibration", "cal.toml", "--prefix", "7up", "-o", "x.h"],
        cwd=unit.folder, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 1 and "--prefix" in done.stderr and not (unit.folder / "x.h").exists()


BODY_MAIN = """
#include <stdio.h>
#include "calibration.h"
int main(void)
{
    const float raw[3] = {120.0f, -75.0f, 300.0f};
    float x[3];
    const imu_triad *mag = &imu_body[IMU_MAG];
    imu_triad_reading(mag, raw, x);
    printf("%s %s %.9g %.9g %.9g %d %d %d\\n", mag->name, mag->reference, x[0], x[1], x[2], mag->has_rotation, mag->has_delay, mag->has_lever_arm);
    return 0;
}
"""


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_a_further_triad_comes_out_in_the_frame_of_its_reference(name, tmp_path):
    path = compiler(name)
    (tmp_path / "cal.toml").write_text(test_autopilots.calibration() + test_adafruit.body())
    run("export", "c", "--calibration", "cal.toml", "--prefix", "imu", "-o", "calibration.h", cwd=tmp_path)
    (tmp_path / "main.c").write_text(BODY_MAIN)
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([path, *flags, "main.c", "-o", "main"], cwd=tmp_path, check=True)
    triad_name, reference, *values = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout.split()
    assert (triad_name, reference, values[3:]) == ("mag", "gyro", ["1", "0", "0"])
    expected = test_adafruit.QUARTER @ (test_adafruit.SOFT @ [120.0, -75.0, 300.0] + test_adafruit.SHIFT)
    assert numpy.allclose([float(v) for v in values[:3]], expected, atol=1e-4)
