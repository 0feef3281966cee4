"""Results of ``mimu accept`` in OpenHTF, in TofuPilot's client and in a table for process control, by the adapters in python/examples."""

from __future__ import annotations

import csv
import importlib
import io
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import openhtf as htf
import pytest
from openhtf.core.test_record import Outcome
from tofupilot.v2 import TofuPilot

ROOT = Path(__file__).resolve().parents[2]
LIMITS = """\
format = "mimu-limits/1"
product = "board"
ranges = { accel_g = 2, gyro_dps = 500 }
rows = [
    { name = "gyro_offset", lower = -2, upper = 2, unit = "deg/s" },
    { name = "gravity_error", lower = -40, upper = 40, unit = "mg" },
]
"""
#: Counts for one deg/s and one g.
PER_DPS, PER_G = 65.5, 16384.0


def record(folder: Path, device: str, offset_dps: float, *, turned: bool = False) -> None:
    """A recording of ten seconds at rest; ``turned``: on another side from the middle on."""
    rng = np.random.default_rng(len(device))
    n = 2000
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    if turned:
        up[n // 2 :] = [0.0, 1.0, 0.0]
    gyro = PER_DPS * (np.array([0.1, -0.2, offset_dps]) + rng.normal(0, 0.05, (n, 3)))
    accel = PER_G * (up + rng.normal(0, 0.003, (n, 3)))
    raw = np.round(np.column_stack([gyro, accel]))
    folder.mkdir()
    (folder / "recording.toml").write_text(
        f'format = "mimu-recording/1"\ndevice = "{device}"\nsample_rate_hz = 200.0\ngravity_mps2 = 9.80665\nraw_unit = "count"\nreference = "gravity"\n'
    )
    header = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    table = np.column_stack([np.arange(n) / 200.0, raw])
    np.savetxt(folder / "samples.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with recordings, the limits, and results of a good unit, of a bad one, and of one that was turned."""
    folder = tmp_path_factory.mktemp("station")
    (folder / "limits.toml").write_text(LIMITS)
    record(folder / "good", "unit-1", 0.3)
    record(folder / "bad", "unit-2", 2.5)
    record(folder / "turned", "unit-3", 0.3, turned=True)
    run = subprocess.run(
        [os.environ["MIMU"], "accept", "good", "bad", "turned", "--limits", "limits.toml", "-o", "results"],
        cwd=folder, capture_output=True, text=True, check=False,
    )
    assert run.returncode == 1, run.stderr
    sys.path.insert(0, str(ROOT / "python" / "examples"))
    yield folder
    sys.path.pop(0)


def of(folder: Path, verdict: str) -> dict[str, Any]:
    """The result with this verdict."""
    all_of_them = [json.loads(path.read_text()) for path in (folder / "results").iterdir()]
    [found] = [result for result in all_of_them if result["verdict"] == verdict]
    return found


def adapter(name: str) -> ModuleType:
    return importlib.import_module(f"station_{name}")


@pytest.mark.parametrize(("verdict", "outcome"), [("passed", Outcome.PASS), ("failed", Outcome.FAIL), ("not_measured", Outcome.ERROR)])
def test_openhtf_comes_to_the_same_outcome(results: Path, verdict: str, outcome: Outcome) -> None:
    result = of(results, verdict)
    records = []
    test = htf.Test(adapter("openhtf").phase_of(result), test_name="at rest")
    test.add_output_callbacks(records.append)
    test.execute(test_start=lambda: result["unit"])
    [record] = records
    assert (record.dut_id, record.outcome) == (result["unit"], outcome)
    measured = {name: m for phase in record.phases for name, m in phase.measurements.items()}
    for row in result["measurements"]:
        of_htf = measured[row["name"]]
        assert of_htf.measured_value.value == row["value"]
        assert (of_htf.outcome.name == "FAIL") == (row["passed"] is False)
        assert of_htf.units.suffix == row["unit"]


def test_openhtf_rejects_within_the_guard_band_as_mimu_does(results: Path) -> None:
    result = of(results, "passed")
    row = next(row for row in result["measurements"] if row["name"] == "gyro_z_offset")
    row["value"] = row["upper"] - 1.5 * row["sigma"]
    records = []
    test = htf.Test(adapter("openhtf").phase_of(result), test_name="at rest")
    test.add_output_callbacks(records.append)
    test.execute(test_start=lambda: result["unit"])
    assert records[0].outcome == Outcome.FAIL


@pytest.mark.parametrize(("verdict", "outcome"), [("passed", "PASS"), ("failed", "FAIL"), ("not_measured", "ERROR")])
def test_tofupilots_client_sends_the_run(results: Path, verdict: str, outcome: str) -> None:
    sent: list[Any] = []

    class Server(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            sent.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            body = b'{"id": "00000000-0000-0000-0000-000000000001"}'
            self.send_response(200)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    result = of(results, verdict)
    with HTTPServer(("127.0.0.1", 0), Server) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        client = TofuPilot(api_key="none", server_url=f"http://127.0.0.1:{server.server_port}")
        created = client.runs.create(**adapter("tofupilot").run_of(result, "procedure", "board"))
        server.shutdown()
    assert created.id.endswith("1")
    [run] = sent
    assert (run["outcome"], run["serial_number"]) == (outcome, result["unit"])
    rows = run["phases"][0]["measurements"]
    assert [(row["name"], row["measured_value"], row["units"]) for row in rows] == [(m["name"], m["value"], m["unit"]) for m in result["measurements"]]
    failed = [row["name"] for row in rows if row["outcome"] == "FAIL"]
    assert failed == [m["name"] for m in result["measurements"] if m["passed"] is False]
    for row, m in zip(rows, result["measurements"], strict=True):
        assert (row.get("lower_limit"), row.get("upper_limit")) == (m["lower"], m["upper"])


def test_the_table_has_every_quantity_of_every_unit(results: Path) -> None:
    out = io.StringIO()
    adapter("csv").write(results / "results", out)
    rows = list(csv.DictReader(io.StringIO(out.getvalue())))
    units = {row["unit"]: row["verdict"] for row in rows}
    assert sorted(units.values()) == ["failed", "not_measured", "passed"]
    good = {row["name"]: row for row in rows if row["verdict"] == "passed"}
    assert float(good["gyro_z_offset"]["value"]) == pytest.approx(0.3, abs=0.01)
    assert good["gyro_z_offset"]["unit_of_value"] == "deg/s"
    assert (good["gyro_z_offset"]["passed"], good["accel_x_noise_rms"]["passed"]) == ("True", "")
    assert "moved" in next(row["name"] for row in rows if row["verdict"] == "not_measured")
