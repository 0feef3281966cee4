"""A unit measured by ``mimu accept`` as a phase of an OpenHTF test: values, units and the limits minus the guard band.

    python station_openhtf.py --port /dev/ttyUSB0 --text --limits limits.toml --latitude 48.1
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import openhtf as htf
from openhtf.util.units import UnitDescriptor


def measure(*arguments: str) -> dict[str, Any]:
    """The result of one unit; a unit that could not be measured has a result too."""
    run = subprocess.run(["mimu", "accept", *arguments, "--json", "-"], stdout=subprocess.PIPE, text=True, check=False)
    return json.loads(run.stdout)


def phase_of(result: dict[str, Any]) -> htf.PhaseDescriptor:
    """A phase with a measurement for each quantity."""
    guard = result["decision"]["k"]
    declared = []
    for row in result["measurements"]:
        unit = UnitDescriptor(row["unit"], None, row["unit"])
        measurement = htf.Measurement(row["name"]).with_units(unit).doc(f"standard uncertainty {row['sigma']:.3g}")
        if row["passed"] is not None:
            lower, upper = row["lower"], row["upper"]
            within = guard * row["sigma"]
            measurement.in_range(None if lower is None else lower + within, None if upper is None else upper - within)
        declared.append(measurement)

    @htf.measures(*declared)
    def at_rest(test: htf.TestApi) -> None:
        for row in result["measurements"]:
            test.measurements[row["name"]] = row["value"]
        if result["problem"]:
            raise RuntimeError("{place}: {problem}; {remedy}".format(**result["problem"]))

    return at_rest


if __name__ == "__main__":
    found = measure(*sys.argv[1:])
    sys.exit(not htf.Test(phase_of(found), test_name="at rest").execute(test_start=lambda: found["unit"]))
