"""Results of ``mimu accept -o results`` as one CSV for statistical process control: a row for each quantity of each unit.

    python station_csv.py results > line.csv
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

COLUMNS = ["time", "unit", "product", "verdict", "name", "value", "unit_of_value", "sigma", "lower", "upper", "passed"]


def rows_of(result: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The rows of one unit; one that could not be measured has a row with its reason as the name."""
    unit = {key: result[key] for key in ("time", "unit", "product", "verdict")}
    for row in result["measurements"]:
        yield {**row, **unit, "unit_of_value": row["unit"]}
    if result["problem"]:
        yield {**unit, "name": result["problem"]["problem"]}


def write(folder: Path, to: TextIO) -> None:
    """All results of a folder, in order of time."""
    results = [json.loads(path.read_text(encoding="utf-8")) for path in folder.glob("*.json")]
    table = csv.DictWriter(to, COLUMNS, extrasaction="ignore")
    table.writeheader()
    for result in sorted(results, key=lambda result: (result["time"], result["unit"])):
        table.writerows(rows_of(result))


if __name__ == "__main__":
    write(Path(sys.argv[1]), sys.stdout)
