"""The header for Fusion, compiled as C and run through the library's own function."""
import json
import subprocess

import imufusion
import numpy
import pytest
from conftest import G, triad

# The types of FusionMath.h, as far as the header needs them.
FUSION_H = "typedef union { float array[3]; } FusionVector;\ntypedef union { float array[9]; } FusionMatrix;\n"
MAIN = """#include <stdio.h>
#include "calibration.h"
static void print(const char *name, const float *values, int n) {
    printf("\\"%s\\": [", name);
    for (int i = 0; i < n; i++) printf("%s%.9g", i ? ", " : "", values[i]);
    printf("],\\n");
}
int main(void) {
    printf("{");
    print("gyro_misalignment", gyroscopeMisalignment.array, 9);
    print("gyro_sensitivity", gyroscopeSensitivity.array, 3);
    print("gyro_offset", gyroscopeOffset.array, 3);
    print("accel_misalignment", accelerometerMisalignment.array, 9);
    print("accel_sensitivity", accelerometerSensitivity.array, 3);
    print("accel_offset", accelerometerOffset.array, 3);
    printf("\\"end\\": 0}\\n");
}
"""


@pytest.fixture(scope="module")
def numbers(unit):
    path, _ = unit.export("fusion", name="calibration.h")
    folder = path.parent
    (folder / "Fusion.h").write_text(FUSION_H)
    (folder / "main.c").write_text(MAIN)
    subprocess.run(["cc", "-std=c99", "-Wall", "-Werror", "-o", "main", "main.c"], cwd=folder, check=True)
    return json.loads(subprocess.run([folder / "main"], capture_output=True, text=True, check=True).stdout)


@pytest.mark.parametrize("sensor, per_si", [("gyro", numpy.degrees(1)), ("accel", 1 / G)])
def test_model_inertial_is_what_apply_gives(sensor, per_si, numbers, unit):
    misalignment = numpy.array(numbers[f"{sensor}_misalignment"]).reshape(3, 3)
    sensitivity, offset = numpy.array(numbers[f"{sensor}_sensitivity"]), numpy.array(numbers[f"{sensor}_offset"])
    raw, applied = triad(unit.raw, sensor)[::97], per_si * triad(unit.applied, sensor)[::97]
    ours = numpy.array([imufusion.model_inertial(u, misalignment, sensitivity, offset) for u in raw])
    # Single precision: seven digits of the largest reading.
    least = 4e-7 * numpy.abs(sensitivity).max() * numpy.abs(raw).max()
    assert numpy.abs(ours - applied).max() < least
    assert numpy.abs(applied).max() > 1e4 * least
