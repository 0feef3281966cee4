"""A unit measured by ``mimu accept`` as a run of TofuPilot. The API key is in TOFUPILOT_API_KEY.

    mimu accept --port /dev/ttyUSB0 --text --limits limits.toml --latitude 48.1 --json unit-7.json
    python station_tofupilot.py unit-7.json PROCEDURE PART-NUMBER
"""

from __future__ import annotations

import json
import sys
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from tofupilot.v2 import TofuPilot

OUTCOMES = {"passed": "PASS", "failed": "FAIL", "not_measured": "ERROR"}
PASSED = {True: "PASS", False: "FAIL", None: "PASS"}


def run_of(result: dict[str, Any], procedure: str, part: str) -> dict[str, Any]:
    """The arguments of ``runs.create``. The outcomes are mimu's, which take the uncertainty into account."""
    begun = datetime.fromisoformat(result["time"].replace("Z", "+00:00"))
    ended = begun + timedelta(seconds=result["duration_s"] or 0.0)
    rows = [
        {
            "name": row["name"], "measured_value": row["value"], "units": row["unit"], "outcome": PASSED[row["passed"]],
            "docstring": f"standard uncertainty {row['sigma']:.3g} {row['unit']}",
            **{f"{end}_limit": row[end] for end in ("lower", "upper") if row[end] is not None},
        }
        for row in result["measurements"]
    ]
    outcome = OUTCOMES[result["verdict"]]
    phase = {"name": "at rest", "outcome": outcome, "started_at": begun, "ended_at": ended, "measurements": rows}
    why = result["problem"] and "{place}: {problem}; {remedy}".format(**result["problem"])
    return {
        "outcome": outcome, "procedure_id": procedure, "part_number": part, "serial_number": result["unit"],
        "started_at": begun, "ended_at": ended, "phases": [phase], **({"docstring": why} if why else {}),
    }


if __name__ == "__main__":
    path, *of = sys.argv[1:]
    with TofuPilot() as client:
        print(client.runs.create(**run_of(json.loads(Path(path).read_text(encoding="utf-8")), *of)).id)
