"""Many recordings: the table, the engines that it is given to, and what reads its results."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import duckdb
import fsspec
import mimu
import numpy as np
import production_line
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import EXAMPLES, ROOT, json_of, run
from mimu import _mimu

UNITS = 12
LINES = 96


def unit(by_hand: mimu.Recording, number: int) -> dict[str, Any]:
    """Readings of another unit in the same motion: other scale factors, misalignments and biases."""
    random = np.random.default_rng(number)
    gyro, accel = (readings @ (np.eye(3) + random.normal(scale=0.01, size=(3, 3))) + random.normal(scale=8, size=3) for readings in (by_hand.gyro, by_hand.accel))
    return {"t": by_hand.t, "gyro": gyro, "accel": accel, "unit": "count", "gravity": 9.80665, "device": f"unit-{number}"}


@pytest.fixture(scope="module")
def recordings(by_hand: mimu.Recording, tmp_path_factory: pytest.TempPathFactory) -> pa.Table:
    """Labels and folders of units."""
    root = tmp_path_factory.mktemp("recordings")
    paths = [str(mimu.Recording(**unit(by_hand, number)).save(root / f"u{number}")) for number in range(UNITS)]
    return pa.table({"label": [f"line={'AB'[number % 2]}/unit-{number}" for number in range(UNITS)], "path": paths})


@pytest.fixture(scope="module")
def results(recordings: pa.Table) -> pa.Table:
    """What a fit of each gives."""
    return mimu.fit_table(recordings)


def found(parts: Path) -> pa.Table:
    """All results of a folder by label, without what differs between two runs."""
    table = pa.concat_tables([pq.read_table(part) for part in parts.glob("*.parquet")])
    return without_times(table.sort_by("label"))


def without_times(table: pa.Table) -> pa.Table:
    """Without processor time and the moment of each fit."""
    text = [value and "\n".join(line for line in value.splitlines() if not line.startswith("created")) for value in table["calibration"].to_pylist()]
    return table.drop_columns(["seconds", "processor_s", "calibration"]).append_column("calibration", pa.array(text, pa.string()))


def test_a_row_has_the_numbers_of_a_fit(recordings: pa.Table, results: pa.Table) -> None:
    assert results.schema == mimu.fit_table_schema() and results["label"].to_pylist() == recordings["label"].to_pylist()
    row, fit = results.to_pylist()[6], mimu.fit(mimu.read(recordings["path"][6].as_py()))
    assert fit.gyro is not None and fit.accel is not None
    for name, sensor in (("gyro", fit.gyro), ("accel", fit.accel)):
        for key, of in (("held_out", "held_out_rms"), ("rms", "rms"), ("noise_floor", "noise_floor"), ("condition", "condition"), ("dwells", "dwells"), ("error_unit", "unit")):
            assert row[f"{name}_{key}"] == getattr(sensor, of)
        assert len(sensor.parameters) == 24
        for parameter in sensor.parameters.values():
            assert (row[f"{name}_{parameter.name}"], row[f"{name}_{parameter.name}_sigma"]) == (parameter.value, parameter.sigma)
    assert (row["judgement"], row["reason"], row["sha256"]) == (fit.judgement.kind, fit.judgement.reason, fit.to_dict()["sha256"])
    assert (row["device"], row["unit"], row["error"], row["warnings"]) == ("unit-6", "count", None, fit.warnings)
    of_text = _mimu.parse_calibration(row["calibration"], "row")
    assert (of_text.inverse("gyro")[0] == fit.gyro.C).all()
    # Every column has a value in some row, unless it is about a refusal.
    assert [name for name in results.column_names if results[name].null_count == UNITS and not name.startswith("error")] == []


def test_arrays_give_what_their_folder_gives(by_hand: mimu.Recording, recordings: pa.Table, results: pa.Table) -> None:
    of = [unit(by_hand, number) for number in (0, 1)]
    columns: dict[str, Any] = {name: [each[name] for each in of] for name in ("t", "gravity", "device")}
    # Rows of three, and the numbers of a matrix.
    columns["gyro"] = pa.array([each["gyro"].tolist() for each in of], pa.list_(pa.list_(pa.float64(), 3)))
    columns["accel"] = pa.array([each["accel"].tolist() for each in of])
    table = pa.table({"label": recordings["label"][:2], **columns})
    rate = {"unit": "count", "rate_hz": by_hand.rate_hz}
    made = mimu.fit_table(table, reading=rate)
    assert made["error"].to_pylist() == [None, None] and made["device"].to_pylist() == ["unit-0", "unit-1"]
    assert np.allclose(made["gyro_bias_x"], results["gyro_bias_x"][:2], rtol=1e-9) and np.allclose(made["accel_scale_z"], results["accel_scale_z"][:2], rtol=1e-9)
    # A record batch, and without a device.
    alone = mimu.fit_table(table.drop_columns(["device"]).to_batches()[0], reading=rate)
    assert alone["device"].to_pylist() == ["unit-0", "unit-1"] and alone["gyro_bias_x"] == made["gyro_bias_x"]


def test_what_is_refused_is_a_row_with_its_place(by_hand: mimu.Recording, recordings: pa.Table, tmp_path: Path) -> None:
    folder = Path(recordings["path"][0].as_py())
    for name in ("short", "column", "clock", "panic"):
        shutil.copytree(folder, tmp_path / name)
    samples = pq.read_table(folder / "samples.parquet")
    (tmp_path / "short" / "samples.parquet").write_bytes((folder / "samples.parquet").read_bytes()[:5000])
    pq.write_table(samples.drop_columns(["accel_z"]), tmp_path / "column" / "samples.parquet")
    t = samples["t_s"].to_numpy().copy()
    t[3000:] -= 10.0
    pq.write_table(samples.set_column(samples.schema.get_field_index("t_s"), "t_s", pa.array(t)), tmp_path / "clock" / "samples.parquet")
    by_hand[:300].save(tmp_path / "still")
    names = ["short", "column", "clock", "still", "none"]
    table = pa.table({"label": [*names, "good", "null"], "path": [*(str(tmp_path / name) for name in names), str(folder), None]})
    rows = {row["label"]: row for row in mimu.fit_table(table).to_pylist()}
    assert list(rows) == table["label"].to_pylist() and rows["good"]["judgement"] == "good" and rows["good"]["error"] is None
    for name in [*names, "null"]:
        assert rows[name]["error"] and rows[name]["error_problem"] and rows[name]["gyro_bias_x"] is None and rows[name]["calibration"] is None, name
    assert rows["short"]["error_file"] == str(tmp_path / "short" / "samples.parquet")
    assert rows["column"]["error_problem"] == "column accel_z is missing" and rows["still"]["error_kind"] == "undetermined"
    assert (rows["clock"]["error_row"], rows["clock"]["error_column"]) == (3001, "t_s") and "time goes back" in rows["clock"]["error"]
    assert rows["null"]["error"].startswith("null: it has no path")
    ragged = pa.table({"label": ["ragged", "units"], "t": [[0.0, 0.1]] * 2, "gyro": [[[1.0, 2.0, 3.0], [1.0, 2.0]], [[1.0, 2.0, 3.0]] * 2], "unit": ["count", "inch"]})
    assert [row["error_kind"] for row in mimu.fit_table(ragged).to_pylist()] == ["exception", "invalid"]


def test_what_concerns_the_call_is_an_exception(recordings: pa.Table) -> None:
    with pytest.raises(mimu.Error, match="column batch: it is neither label nor path nor a keyword of mimu.read"):
        mimu.fit_table(recordings.append_column("batch", recordings["label"]))
    with pytest.raises(mimu.Error, match="column label: it is missing, or empty in a row"):
        mimu.fit_table(recordings.drop_columns(["label"]))
    with pytest.raises(TypeError, match="holdot"):
        mimu.fit_table(recordings, holdot=2)


@pytest.fixture
def fits(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Devices that have been fitted."""
    devices: list[str] = []
    original = _mimu.fit

    def counted(recording: mimu.Recording, *arguments: Any, **options: Any) -> Any:
        devices.append(recording.device)
        return original(recording, *arguments, **options)

    monkeypatch.setattr(_mimu, "fit", counted)
    yield devices


def test_a_part_is_written_once_and_what_is_missing_is_found(recordings: pa.Table, results: pa.Table, tmp_path: Path, fits: list[str]) -> None:
    parts = tmp_path / "parts"
    assert mimu.not_fitted(recordings, parts) == recordings
    first = mimu.fit_table(recordings[:4], parts=parts)
    assert without_times(first) == without_times(results[:4]) and len(fits) == 4
    assert mimu.fit_table(recordings[:4], parts=parts) == first and len(fits) == 4
    left = mimu.not_fitted(recordings, parts)
    assert left["label"].to_pylist() == recordings["label"].to_pylist()[4:]
    mimu.fit_table(left, parts=parts)
    assert mimu.not_fitted(recordings, parts).num_rows == 0 and len(fits) == UNITS
    assert found(parts) == without_times(results.sort_by("label"))
    assert list((parts / "_attempts").iterdir()) == []
    # Other options, or another path, are another result, in place of the first.
    other = mimu.fit_table(recordings[:4], parts=parts, holdout=2)
    assert len(fits) == UNITS + 4 and other["gyro_held_out"] != first["gyro_held_out"] and len(list(parts.glob("*.parquet"))) == 2
    assert json.loads(other["options"][0].as_py())["fit"] == ["--holdout=2"]
    moved = pa.table({"label": recordings["label"][:4], "path": recordings["path"][4:8]})
    assert mimu.fit_table(moved, parts=parts, holdout=2)["device"].to_pylist() == ["unit-4", "unit-5", "unit-6", "unit-7"]


def test_an_interrupted_call_leaves_no_part_and_no_mark(recordings: pa.Table, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(_mimu, "fit", interrupted)
    with pytest.raises(KeyboardInterrupt):
        mimu.fit_table(recordings[:2], parts=tmp_path)
    assert [path.name for path in tmp_path.rglob("*")] == ["_attempts"]


def test_a_recording_that_ends_its_process_twice_is_refused_and_the_others_are_not(recordings: pa.Table, tmp_path: Path) -> None:
    code = f"""if True:
        import os, pyarrow.parquet as pq, mimu
        from mimu import _mimu
        fit = _mimu.fit
        def deadly(recording, *given, **options):
            if recording.device == "unit-2":
                os.kill(os.getpid(), {signal.SIGKILL})
            return fit(recording, *given, **options)
        _mimu.fit = deadly
        mimu.fit_table(pq.read_table("table.parquet"), parts="parts")
    """
    pq.write_table(recordings[:4], tmp_path / "table.parquet")
    ended = [subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False).returncode for _ in range(4)]
    assert ended == [-signal.SIGKILL] * 3 + [0]
    rows = pq.read_table(next((tmp_path / "parts").glob("*.parquet"))).to_pylist()
    assert [row["error_kind"] for row in rows] == [None, None, "worker", None] and "two processes ended" in rows[2]["error"]
    assert rows[2]["path"] == recordings["path"][2].as_py() and rows[3]["judgement"] == "good"
    assert list((tmp_path / "parts" / "_attempts").iterdir()) == []


def test_recordings_and_parts_may_be_wherever_fsspec_reads(recordings: pa.Table, results: pa.Table) -> None:
    memory = fsspec.filesystem("memory")
    memory.put(recordings["path"][0].as_py(), "/bucket/u0", recursive=True)
    memory.pipe("/bucket/u1/recording.toml", b"broken")
    table = pa.table({"label": ["a", "b", "c"], "path": [f"memory://bucket/u{number}" for number in range(3)]})
    made = mimu.fit_table(table, parts="memory://results").to_pylist()
    assert made[0]["gyro_bias_x"] == results["gyro_bias_x"][0].as_py() and made[0]["path"] == "memory://bucket/u0"
    assert made[1]["error_file"] == "memory://bucket/u1/recording.toml" and made[1]["error"].startswith("memory://bucket/u1/recording.toml")
    assert made[2]["error_kind"] == "io" and "FileNotFoundError" in made[2]["error"]
    assert len(memory.glob("/results/*.parquet")) == 1 and mimu.not_fitted(table, "memory://results").num_rows == 0


#: How many processes each starts, and what it needs beside its package.
ENGINES = {"dask": ["distributed"], "ray": ["ray"], "spark": ["pyspark"], "slurm": []}

#: What `sbatch` does with an array: its tasks run one after the other, and one that is killed is queued again.
SBATCH = f"""#!{sys.executable}
import os, subprocess, sys
options = dict(argument[2:].split("=", 1) for argument in sys.argv[1:] if "=" in argument)
tasks = int(options["array"].split("-")[1]) + 1
for task in range(tasks):
    env = os.environ | {{"SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": str(tasks)}}
    while subprocess.run("exec " + options["wrap"], shell=True, env=env).returncode:
        pass
"""


@pytest.mark.parametrize("engine", [pytest.param(name, marks=[pytest.mark.nightly] if name in ("ray", "spark") else []) for name in ENGINES])
def test_an_engine_whose_worker_is_killed_fits_everything_once(engine: str, recordings: pa.Table, results: pa.Table, tmp_path: Path) -> None:
    for package in ENGINES[engine]:
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"{package} is not installed")
    if engine == "spark" and shutil.which("java") is None:
        pytest.skip("Spark needs Java, and there is none")
    pq.write_table(recordings, tmp_path / "recordings.parquet")
    (tmp_path / "sbatch").write_text(SBATCH)
    (tmp_path / "sbatch").chmod(0o755)
    asked = [sys.executable, EXAMPLES / f"many_units_{engine}.py", "recordings.parquet", "results", "--rows", "4"]
    asked += ["--master", "local[2,4]"] if engine == "spark" else []
    env = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "RAY_DATA_DISABLE_PROGRESS_BARS": "1"}
    done = subprocess.Popen(asked, cwd=tmp_path, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    killed = killed_at_work(tmp_path / "results" / "_attempts", done)
    output = done.communicate(timeout=600)[0]
    assert done.returncode == 0 and killed, output
    assert found(tmp_path / "results") == without_times(results.sort_by("label")), output
    again = subprocess.run(asked, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=600, check=False)
    assert f"0 recordings {'are left' if engine == 'slurm' else 'fitted'}" in again.stdout, again.stderr


def killed_at_work(attempts: Path, until: subprocess.Popen[str]) -> bool:
    """Kills the first process that is at work: its mark names it."""
    while until.poll() is None:
        # Parts that are being written have a point in their names.
        for mark in attempts.glob("*"):
            with suppress(FileNotFoundError):
                if "." not in mark.name and (said := mark.read_text()):
                    os.kill(int(said.split()[1]), signal.SIGKILL)
                    return True
        time.sleep(0.002)
    return False


def test_a_fleet_reads_the_parts_as_it_reads_calibration_files(recordings: pa.Table, results: pa.Table, tmp_path: Path) -> None:
    wrong = pa.table({"label": ["line=A/gone"], "path": ["nowhere"]})
    mimu.fit_table(recordings[:5], parts=tmp_path / "parts")
    mimu.fit_table(pa.concat_tables([recordings[5:], wrong]), parts=tmp_path / "parts")
    shutil.copytree(recordings["path"][0].as_py(), tmp_path / "parts" / "recording")
    for label, text in zip(results["label"].to_pylist(), results["calibration"].to_pylist(), strict=True):
        file = tmp_path / "files" / f"{label}.toml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    parts, files = (json_of("fleet", tmp_path / name) for name in ("parts", "files"))
    left_out = parts.pop("left_out")
    assert left_out == [{"file": "line=A/gone", "reason": "nowhere: no such file or directory; check the path"}] and files.pop("left_out") == []
    # recording.toml and samples.parquet of the recording.
    assert (parts.pop("other_files"), files.pop("other_files")) == (2, 0)
    assert parts == files and parts["units"] == UNITS and parts["labels"] == {"line": 2}
    prior = run("fleet", tmp_path / "parts", "-o", tmp_path / "fleet.html")
    assert prior.returncode == 0 and (tmp_path / "fleet.html").stat().st_size > 10_000


@pytest.mark.nightly
def test_the_questions_find_what_is_wrong_with_the_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Built together with the package, to share its features: nothing is compiled twice.
    built = ["cargo", "build", "--locked", "-q", "-p", "mimu-rig", "-p", "mimu-python", "--bin", "mimu-rig"]
    subprocess.run(built, cwd=ROOT, check=True)
    made = production_line.produce(tmp_path / "recordings", LINES)
    table = pa.table({"label": [one.folder for one in made], "path": [str(tmp_path / "recordings" / one.folder) for one in made]})
    mimu.fit_table(table, parts=tmp_path / "results")
    monkeypatch.chdir(tmp_path)
    database = duckdb.connect()
    worst, drifts, reasons, _ = [database.execute(query).fetchall() for query in database.extract_statements((EXAMPLES / "many_units.sql").read_text())][1:]
    assert worst[0][:2] == ("C", production_line.BATCHES[-1]) and worst[0][3] > 2 * worst[1][3]
    assert [row[:2] for row in drifts if row[-1]] == [("B", "gyro_bias_z")]
    slope, sigma = drifts[0][3:5]
    assert abs(slope - 100 * production_line.DRIFT_COUNT) < 3 * sigma < 20
    broken = {one.folder: one.broken for one in made if one.broken}
    assert sum(row[1] for row in reasons) == len(broken) and len(reasons) == len(production_line.BREAK)
    # The output shows one decimal.
    assert all(abs(row[2] - 100.0 * row[1] / LINES) <= 0.05 for row in reasons)
    refused = database.sql("select label from results where error is not null").fetchall()
    assert {label for (label,) in refused} == set(broken) and set(broken.values()) == set(production_line.BREAK)
