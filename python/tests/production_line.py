"""Recordings of units from three production lines, with known faults: the data of the questions in many_units.sql.

The virtual bench (``mimu-rig``, docs/bench.md) turns each unit by hand and records it; it shares no code with mimu. Line B's gyro z drifts
from unit to unit, line C glued the gyros of its last batch badly, and some files are broken on the way to the disk.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

ROOT = Path(__file__).resolve().parents[2]
BENCH = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug" / "mimu-rig"

LINES = "ABC"
BATCHES = ("2026-08", "2026-09", "2026-10", "2026-11")
#: Standard deviation of the biases of gyros, counts.
SCATTER_COUNT = 8.0
#: Rise of the bias of line B's gyro z from one serial number to the next, counts.
DRIFT_COUNT = 0.5
#: g-sensitivity of badly glued gyros, deg/s per g.
G_SENSITIVITY_DPS_PER_G = 0.3
#: One recording in this many is broken, each time in the next way.
BROKEN = 16

PLAN = """\
format = "mimu-plan/1"
device = "{device}"
sample_rate_hz = 100.0
carrier = "hands"
latitude_deg = 48.0
lead_in_s = 3.0

[[step]]
poses = {poses}
dwell_s = {dwell_s}
"""

RIG = """\
format = "mimu-rig/1"

[unit]
gyro = "MPU6050-gyro"
accel = "MPU6050-accel"

[unit.gyro_axes]
null_raw = [{null[0]:.3f}, {null[1]:.3f}, {null[2]:.3f}]

[thermal]
on_before_s = inf
"""

GLUE = """
[[effect]]
id = "gyro_g_sensitivity"
matrix_dps_per_g = [[0.0, {g}, 0.0], [{g}, 0.0, 0.0], [0.0, 0.0, {g}]]
"""


@dataclass(frozen=True)
class Unit:
    """A unit, and what is wrong with it or with its recording."""

    number: int
    line: str
    batch: str
    #: Bias of its gyros at rest, counts.
    null: tuple[float, float, float]
    badly_glued: bool
    #: One of ``BREAK``, or None.
    broken: str | None

    @property
    def folder(self) -> str:
        return f"line={self.line}/batch={self.batch}/unit-{self.number:05d}"


def units(count: int) -> list[Unit]:
    """Units in the order of their serial numbers."""
    random = np.random.default_rng(1)
    ways = list(BREAK)
    made = []
    for number in range(1, count + 1):
        line = LINES[number % len(LINES)]
        batch = BATCHES[(number - 1) * len(BATCHES) // count]
        null = random.normal(scale=SCATTER_COUNT, size=3)
        null[2] += DRIFT_COUNT * number if line == "B" else 0.0
        broken = ways[number // BROKEN % len(ways)] if number % BROKEN == 0 else None
        x, y, z = (float(v) for v in null)
        made.append(Unit(number, line, batch, (x, y, z), line == "C" and batch == BATCHES[-1], broken))
    return made


def record(unit: Unit, root: Path, bench: Path, poses: int) -> None:
    """Records a unit, and breaks the recording where it is to be broken."""
    folder = root / unit.folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(folder, ignore_errors=True)
    plan, rig, truth = (root / f"{unit.number}.{kind}.toml" for kind in ("plan", "rig", "truth"))
    # A unit that never moved lies on the table for as long as the others are turned.
    poses, dwell_s = (1, 60.0) if unit.broken == "never moved" else (poses, 3.0)
    plan.write_text(PLAN.format(device=f"unit-{unit.number:05d}", poses=poses, dwell_s=dwell_s))
    rig.write_text(RIG.format(null=unit.null) + (GLUE.format(g=G_SENSITIVITY_DPS_PER_G) if unit.badly_glued else ""))
    asked = [bench, "record", plan, "--rig", rig, "--seed", str(unit.number), "-o", folder, "--truth", truth]
    subprocess.run(asked, check=True, capture_output=True)
    for file in (plan, rig, truth):
        file.unlink()
    if unit.broken is not None:
        BREAK[unit.broken](folder / "samples.parquet")


def cut_short(file: Path) -> None:
    """The disk was full."""
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])


def without_a_column(file: Path) -> None:
    """The logger was set up without accel z."""
    pq.write_table(pq.read_table(file).drop_columns(["accel_z"]), file)


def clock_set_back(file: Path) -> None:
    """The logger's clock was set by ten seconds in the middle of the recording."""
    data = pq.read_table(file)
    t = data["t_s"].to_numpy().copy()
    t[len(t) // 2 :] -= 10.0
    pq.write_table(data.set_column(data.schema.get_field_index("t_s"), "t_s", pa.array(t)), file)


def never_moved(_file: Path) -> None:
    """The unit lay on the table: it was recorded like that."""


#: Ways to break a recording.
BREAK = {"cut short": cut_short, "without accel z": without_a_column, "clock set back": clock_set_back, "never moved": never_moved}


def produce(root: Path, count: int, bench: Path = BENCH, poses: int = 24) -> list[Unit]:
    """Records ``count`` units under ``root``, as many at once as there are cores. Units that are there from an earlier run are recorded anew."""
    root.mkdir(parents=True, exist_ok=True)
    made = units(count)
    with ThreadPoolExecutor() as pool:
        list(pool.map(lambda unit: record(unit, root, bench, poses), made))
    return made
