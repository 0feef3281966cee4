"""Many units on a cluster of this machine: the example of docs/python.md."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import mimu
import pyarrow.parquet as pq
import pytest
from conftest import EXAMPLES, ROOT, example
from distributed import Client, LocalCluster

pytestmark = pytest.mark.nightly

UNITS = 96


@pytest.fixture(scope="module")
def many() -> ModuleType:
    """The example; a worker imports it by the path that it inherits from this process."""
    sys.path.insert(0, str(EXAMPLES))
    return importlib.import_module("many_units")


@pytest.fixture(scope="module")
def line() -> ModuleType:
    """The units and their faults."""
    return example("production_line")


@pytest.fixture(scope="module")
def recordings(line: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings of the bench."""
    # Built together with the package, to share its features: nothing is compiled twice.
    built = ["cargo", "build", "--locked", "-q", "-p", "mimu-rig", "-p", "mimu-python", "--bin", "mimu-rig"]
    subprocess.run(built, cwd=ROOT, check=True)
    root = tmp_path_factory.mktemp("line") / "recordings"
    line.produce(root, UNITS)
    return root


@pytest.fixture(scope="module")
def client(many: ModuleType) -> Iterator[Client]:
    """Two workers, which can import the example."""
    assert many
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster, Client(cluster) as client:
        yield client


@pytest.fixture(scope="module")
def results(many: ModuleType, recordings: Path, client: Client, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The table of results."""
    path = tmp_path_factory.mktemp("results") / "results.parquet"
    many.calibrate_all(client, recordings, path)
    return path


def rows(path: Path) -> dict[str, dict[str, Any]]:
    """Rows of the table by recording."""
    return {row["recording"]: row for row in pq.read_table(path).to_pylist()}


def test_every_recording_has_a_row_and_its_numbers_are_those_of_a_fit(line: ModuleType, recordings: Path, results: Path) -> None:
    found, units = rows(results), line.units(UNITS)
    assert set(found) == {unit.folder for unit in units}
    unit = units[6]
    assert unit.broken is None
    row, fit = found[unit.folder], mimu.fit(mimu.read(recordings / unit.folder))
    assert fit.gyro is not None and fit.accel is not None
    assert (row["line"], row["batch"], row["device"]) == (unit.line, unit.batch, "unit-00007")
    assert row["gyro_held_out_rad"] == fit.gyro.held_out_rms and row["accel_held_out_mps2"] == fit.accel.held_out_rms
    assert row["gyro_bias_z_count"] == fit.gyro.parameters["bias_z"].value
    assert row["accel_scale_x_sigma_count_per_mps2"] == fit.accel.parameters["scale_x"].sigma
    assert row["sha256"] == fit.to_dict()["sha256"] and row["error"] is None


def test_a_broken_recording_is_a_row_with_its_reason_and_place(line: ModuleType, recordings: Path, results: Path) -> None:
    found = rows(results)
    broken = {unit.folder: unit.broken for unit in line.units(UNITS) if unit.broken}
    assert set(broken) == {name for name, row in found.items() if row["error"]} and set(broken.values()) == set(line.BREAK)
    for folder, why in broken.items():
        row, samples = found[folder], str(recordings / folder / "samples.parquet")
        if why == "cut short":
            assert row["error_file"] == samples
        elif why == "without accel z":
            assert row["error_file"] == samples and row["error_problem"] == "column accel_z is missing"
        elif why == "clock set back":
            assert (row["error_file"], row["error_column"]) == (samples, "t_s") and "time goes back" in row["error_problem"]
            assert row["error_row"] > 1000
        else:
            assert row["error_kind"] == "undetermined"
        assert row["error_problem"] and row["error_remedy"] and row["gyro_bias_x_count"] is None


def test_the_questions_find_what_is_wrong_with_the_lines(many: ModuleType, line: ModuleType, results: Path) -> None:
    answers = many.answers(results)
    worst = answers["worst held-out error by batch"].fetchall()
    assert worst[0][:2] == ("C", line.BATCHES[-1]) and worst[0][3] > 2 * worst[1][3]
    drifts = answers["drift of a line: bias over serial number"].fetchall()
    assert [row[:2] for row in drifts if row[-1]] == [("B", "gyro_bias_z_count")]
    slope, sigma = drifts[0][3:5]
    assert abs(slope - 100 * line.DRIFT_COUNT) < 3 * sigma < 20
    reasons = answers["share of failures by reason"].fetchall()
    broken = sum(unit.broken is not None for unit in line.units(UNITS))
    assert sum(row[1] for row in reasons) == broken and len(reasons) == len(line.BREAK)
    # The output shows one decimal.
    assert all(abs(row[2] - 100.0 * row[1] / UNITS) <= 0.05 for row in reasons)


def test_each_unit_has_its_calibration_file_and_passes_or_fails(
    many: ModuleType, line: ModuleType, recordings: Path, tmp_path: Path
) -> None:
    limits = tmp_path / "limits.toml"
    limits.write_text("gyro_held_out_rad = 0.002\ngyro_bias_x_count = 1000\n")
    many.main(["fit", str(recordings), str(tmp_path / "table.parquet"), "--workers", "2", "--calibrations", str(tmp_path / "cal"), "--limits", str(limits)])
    found, units = rows(tmp_path / "table.parquet"), line.units(UNITS)
    for unit in units:
        row = found[unit.folder]
        if unit.broken:
            assert row["passed"] is False and row["calibration"] is None
            continue
        assert mimu.load(row["calibration"]).device == row["device"]
        assert row["passed"] == (not row["failed"])
        assert unit.badly_glued == any("gyro_held_out_rad" in failed for failed in row["failed"]), row["failed"]
    assert any(row["passed"] for row in found.values())


def test_only_what_is_new_is_fitted_again(
    many: ModuleType, recordings: Path, results: Path, client: Client, capsys: pytest.CaptureFixture[str]
) -> None:
    before = rows(results)
    capsys.readouterr()
    many.calibrate_all(client, recordings, results)
    assert f"{UNITS} of them from before" in capsys.readouterr().out
    one = next(name for name, row in before.items() if row["error"] is None)
    os.utime(recordings / one / "recording.toml")
    many.calibrate_all(client, recordings, results)
    assert f"{UNITS - 1} of them from before" in capsys.readouterr().out
    after = rows(results)
    assert after[one]["modified_ns"] > before[one]["modified_ns"]
    assert {name: row for name, row in after.items() if name != one} == {name: row for name, row in before.items() if name != one}


def test_a_worker_that_ends_costs_no_recording(many: ModuleType, tmp_path: Path, client: Client) -> None:
    def calibrated(folder: str) -> dict[str, Any]:
        """Ends its worker: always, or once."""
        if folder == "deadly" or (folder == "unlucky" and not (tmp_path / "ended").exists()):
            (tmp_path / "ended").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(0.05)
        return {"mimu": "1"}

    folders = [*(str(n) for n in range(20)), "deadly", "unlucky"]
    found = dict(many.rows(client, folders, calibrated))
    assert set(found) == set(folders)
    deadly = found.pop("deadly")
    assert deadly["error_kind"] == "worker" and deadly["error"].startswith("deadly: 4 workers ended")
    assert all(row == {"mimu": "1"} for row in found.values()), found


def gone(group: int, within_s: float) -> bool:
    """Whether all processes of the group have ended."""
    until = time.monotonic() + within_s
    while time.monotonic() < until:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


def test_ctrl_c_keeps_what_is_done_and_another_run_goes_on(recordings: Path, tmp_path: Path) -> None:
    path = tmp_path / "results.parquet"
    asked = [sys.executable, EXAMPLES / "many_units.py", "fit", recordings, path, "--workers", "2"]
    # A shell starts what it runs in the background with the signal ignored, and children inherit that.
    noticed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    run = subprocess.Popen(asked, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=noticed)
    assert run.stdout is not None
    assert run.stdout.readline() == f"{UNITS} of {UNITS} recordings to fit\n"
    time.sleep(1.5)
    # Also to the workers, as from a terminal.
    os.killpg(run.pid, signal.SIGINT)
    asked_s = time.monotonic()
    out, errors = run.communicate(timeout=60)
    assert run.returncode == 130 and errors.endswith("interrupted; run it again to go on\n") and "Traceback" not in errors, errors
    assert time.monotonic() - asked_s < 10.0
    first = rows(path)
    assert 0 < len(first) < UNITS and f"{len(first)} of {UNITS} recordings" in out
    assert gone(run.pid, 10.0), "a worker is left"
    again = subprocess.run(asked, capture_output=True, text=True, timeout=300, check=True)
    assert f"{UNITS - len(first)} of {UNITS} recordings to fit" in again.stdout
    both = rows(path)
    assert len(both) == UNITS and {name: both[name] for name in first} == first
