"""Calibrates every recording of a folder and writes one table of results, a row for each, on this machine's cores or on a cluster.

    python many_units.py fit recordings results.parquet                                    # a process for each core
    python many_units.py fit recordings results.parquet --scheduler tcp://head:8786        # the workers of a cluster
    python many_units.py fit recordings results.parquet --calibrations cal --limits limits.toml
    python many_units.py ask results.parquet

With ``--calibrations``, each unit gets its calibration file, in folders like those of the recordings. With ``--limits``, a row has ``passed`` and what
``failed``: limits.toml has the largest value of columns, as in ``gyro_held_out_rad = 0.01``.

A recording is a folder with recording.toml and samples.parquet. Folders above it with names like ``line=B`` become columns. A recording
that is refused keeps its row, with the reason and the place. A second run fits only what is new or has changed, so it also continues
after Ctrl-C.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import sys
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import dask
import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
from distributed import Client, KilledWorker, LocalCluster, as_completed

Row = dict[str, Any]

#: Columns that are not numbers.
TYPES = {
    "recording": pa.string(), "device": pa.string(), "sha256": pa.string(), "mimu": pa.string(), "warnings": pa.list_(pa.string()),
    "rows": pa.int64(), "gyro_dwells": pa.int64(), "accel_dwells": pa.int64(), "problems": pa.list_(pa.string()), "modified_ns": pa.int64(), "error": pa.string(), "error_kind": pa.string(), "error_file": pa.string(),
    "judgement": pa.string(), "reason": pa.string(), "calibration": pa.string(), "passed": pa.bool_(), "failed": pa.list_(pa.string()),
    "error_row": pa.int64(), "error_column": pa.string(), "error_problem": pa.string(), "error_remedy": pa.string(),
}
#: How often the table is written while there is work left.
SAVE_S = 60.0


def column(name: str, unit: str) -> str:
    """``gyro_bias_x`` in count is ``gyro_bias_x_count``; rad/s are ``radps`` and m/s² are ``mps2``."""
    for written, short in (("(", ""), (")", ""), ("rad/s", "radps"), ("m/s^2", "mps2"), ("/", "_per_")):
        unit = unit.replace(written, short)
    return f"{name}_{unit.lower()}"


def calibrated(folder: str, to: Mapping[str, str] | None = None, limits: Mapping[str, float] | None = None) -> Row:
    """The row of one recording; this runs on a worker. ``to`` has the calibration file of each folder, ``limits`` the largest value of columns."""
    # A worker has one core to itself, and a fit would start a thread for each core of the machine. The first fit reads this.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    import mimu

    begun = time.monotonic()
    row: Row = {"mimu": mimu.__version__}
    try:
        # For logs of another program: mimu.read(file, columns="t_s=t,gyro_x=wx,...", raw_unit="count", gravity=9.81)
        recording = mimu.read(folder)
        row |= {"device": recording.device, "rate_hz": recording.rate_hz}
        fit = mimu.fit(recording)
    except mimu.Error as error:
        row |= {"error": str(error), "error_kind": error.kind, "error_file": error.file, "error_row": error.row}
        row |= {"error_column": error.column, "error_problem": error.problem, "error_remedy": error.remedy}
        return row | ({"passed": False, "failed": [str(error)]} if limits is not None else {})
    found = fit.to_dict()
    row |= {"sha256": found["sha256"], "rows": found["rows"], "gravity_mps2": found["gravity_mps2"], "warnings": fit.warnings}
    row |= {"judgement": fit.judgement.kind, "reason": fit.judgement.reason}
    row["problems"] = [problem["id"] for problem in found["recording_problems"]]
    for name, sensor in (("gyro", fit.gyro), ("accel", fit.accel)):
        if sensor is None:
            continue
        row[f"{name}_dwells"] = sensor.dwells
        row[column(f"{name}_held_out", sensor.unit)] = sensor.held_out_rms
        row[column(f"{name}_in_sample", sensor.unit)] = sensor.rms
        row[column(f"{name}_noise", sensor.unit)] = sensor.noise_floor
        for parameter in sensor.parameters.values():
            # C and o are the same calibration in another form, in SI.
            if parameter.name[:2] not in ("C_", "o_"):
                row[column(f"{name}_{parameter.name}", parameter.unit)] = parameter.value
                row[column(f"{name}_{parameter.name}_sigma", parameter.unit)] = parameter.sigma
    if limits is not None:
        row["failed"] = failures(row, limits)
        row["passed"] = not row["failed"]
    # What does not describe its readings is no calibration.
    if to is not None and fit.judgement.kind != "misfit":
        Path(to[folder]).parent.mkdir(parents=True, exist_ok=True)
        fit.save(to[folder])
        row["calibration"] = to[folder]
    row["seconds"] = time.monotonic() - begun
    return row


def failures(row: Row, limits: Mapping[str, float]) -> list[str]:
    """The limits that a row exceeds; a value that it lacks exceeds every limit. Signs do not count."""
    failed = []
    for name, most in limits.items():
        value = row.get(name)
        if value is None or not abs(value) <= most:
            failed.append(f"{name} {'is missing' if value is None else f'{value:.6g}'}, at most {most:g}")
    if row["judgement"] in ("suspect", "misfit"):
        failed.append(f"{row['judgement']}: {row['reason']}")
    return failed


def rows(client: Client, folders: list[str], calibrate: Callable[[str], Row] = calibrated) -> Iterator[tuple[str, Row]]:
    """Rows of the recordings, in the order in which they become ready."""
    futures = client.map(calibrate, folders, pure=False)
    folder_of = dict(zip(futures, folders, strict=True))
    for future in as_completed(futures):
        folder = folder_of.pop(future)
        if future.status == "finished":
            yield folder, future.result()
            continue
        # Cancelled: the scheduler has gone.
        error = future.exception() if future.status == "error" else RuntimeError(f"the scheduler has dropped it ({future.status})")
        if isinstance(error, KilledWorker):
            problem = f"{error.allowed_failures + 1} workers ended while they had it"
            remedy = "run `mimu fit` on it alone, and watch its memory"
            yield folder, {"error": f"{folder}: {problem}; {remedy}", "error_kind": "worker", "error_problem": problem, "error_remedy": remedy}
        else:
            yield folder, {"error": f"{folder}: {error!r}", "error_kind": "exception", "error_problem": repr(error)}


def recordings(root: Path) -> dict[str, Row]:
    """Folders of the recordings, each with what is known of it before it is read."""
    found: dict[str, Row] = {}
    for manifest in sorted(root.rglob("recording.toml")):
        folder = manifest.parent
        relative = folder.relative_to(root)
        modified = max(file.stat().st_mtime_ns for file in folder.iterdir())
        keys = dict(part.split("=", 1) for part in relative.parts if "=" in part)
        found[str(folder.resolve())] = {"recording": str(relative), **keys, "modified_ns": modified}
    return found


def table(data: list[Row]) -> pa.Table:
    """One table of rows that have different columns."""
    names = dict.fromkeys([*TYPES, *(name for row in data for name in row)])
    # Values from the names of folders are text.
    text = {name for row in data for name, value in row.items() if isinstance(value, str)}
    types = {name: TYPES.get(name, pa.string() if name in text else pa.float64()) for name in names}
    ordered = sorted(data, key=lambda row: row["recording"])
    return pa.table({name: pa.array([row.get(name) for row in ordered], type=kind) for name, kind in types.items()})


def save(data: list[Row], path: Path) -> None:
    """Writes the table whole or not at all."""
    unfinished = path.with_name(f".{path.name}.unfinished")
    pq.write_table(table(data), unfinished)
    os.replace(unfinished, path)


def kept(path: Path, known: dict[str, Row]) -> dict[str, Row]:
    """Rows of an earlier run whose recording and program are the same. One whose worker ended is tried again."""
    import mimu

    if not path.exists():
        return {}
    before = {row["recording"]: row for row in pq.read_table(path).to_pylist()}
    found = {}
    for folder, row in known.items():
        old = before.get(row["recording"])
        if old and old["modified_ns"] == row["modified_ns"] and old["mimu"] == mimu.__version__:
            found[folder] = old
    return found


def calibrate_all(client: Client, root: Path, path: Path, calibrate: Callable[[str], Row] = calibrated) -> list[Row]:
    """Fits what is new under ``root``, and writes and returns the table's rows."""
    known = recordings(root)
    if not known:
        sys.exit(f"{root}: it has no folder with recording.toml; check the path")
    done = kept(path, known)
    todo = [folder for folder in known if folder not in done]
    print(f"{len(todo)} of {len(known)} recordings to fit", flush=True)
    before = client.run(used)
    begun = saved = time.monotonic()
    try:
        for number, (folder, row) in enumerate(rows(client, todo, calibrate), start=1):
            done[folder] = known[folder] | row
            if time.monotonic() - saved > SAVE_S:
                save(list(done.values()), path)
                saved = time.monotonic()
                print(f"{number} of {len(todo)}", file=sys.stderr, flush=True)
    finally:
        # Also after Ctrl-C, so that finished rows are not computed again.
        if done:
            save(list(done.values()), path)
        took = time.monotonic() - begun
        refused = sum(row.get("error") is not None for row in done.values())
        failed = sum(row.get("passed") is False for row in done.values())
        if failed:
            print(f"{failed} failed a limit, as the column failed says", flush=True)
        print(f"{path}: {len(done)} of {len(known)} recordings, {refused} refused; {len(known) - len(todo)} of them from before", flush=True)
    if todo:
        after = client.run(used)
        # For a restarted worker, all that it has used counts.
        processor_s = sum(now[0] - before.get(worker, (0.0, 0.0))[0] for worker, now in after.items())
        memory = max(memory_mb for _, memory_mb in after.values())
        print(f"{len(todo)} in {took:.1f} s, {len(todo) / took:.1f} a second, by {len(after)} workers with {sum(client.nthreads().values())} threads")
        print(f"processor time of one: {1e3 * processor_s / len(todo):.0f} ms; peak memory of a worker: {memory:.0f} MB")
    return list(done.values())


def used() -> tuple[float, float]:
    """Processor time of this process in s, and its peak memory in MB."""
    of = resource.getrusage(resource.RUSAGE_SELF)
    return of.ru_utime + of.ru_stime, of.ru_maxrss / 1024


#: Questions to the table, with their names.
QUESTIONS = {
    "worst held-out error by batch": """
        select line, batch, count(*) as units, round(degrees(max(gyro_held_out_rad)), 4) as gyro_worst_deg,
               arg_max(device, gyro_held_out_rad) as gyro_worst, round(1e3 * max(accel_held_out_mps2), 2) as accel_worst_mmps2,
               arg_max(device, accel_held_out_mps2) as accel_worst
        from results where error is null group by all order by gyro_worst_deg desc limit 5
    """,
    "drift of a line: bias over serial number": """
        with biases as (
            unpivot (select line, regexp_extract(device, '[0-9]+$')::int as number, columns('^(gyro|accel)_bias_[xyz]_[a-z]*$')
                     from results where error is null)
            on * exclude (line, number) into name parameter value bias
        ), slopes as (
            select line, parameter, count(*) as units, regr_slope(bias, number) as slope,
                   sqrt((1 - regr_r2(bias, number)) / (count(*) - 2)) * stddev_samp(bias) / stddev_samp(number) as sigma
            from biases group by all
        )
        select line, parameter, units, round(100 * slope, 1) as per_100_units, round(100 * sigma, 1) as sigma_per_100_units, abs(slope) > 4 * sigma as drifts
        from slopes order by abs(slope) / sigma desc limit 5
    """,
    "share of failures by reason": """
        select regexp_replace(error_problem, '[0-9][0-9.e-]*', '#', 'g') as reason, count(*) as recordings,
               round(100.0 * count(*) / (select count(*) from results), 1) as percent, min(recording) as for_example,
               arg_min(error_row, recording) as row, arg_min(error_column, recording) as column
        from results where error is not null group by all order by recordings desc, reason
    """,
}


def answers(path: Path) -> dict[str, duckdb.DuckDBPyRelation]:
    """The questions answered by the table."""
    database = duckdb.connect()
    database.read_parquet(str(path)).create_view("results")
    return {question: database.sql(query) for question, query in QUESTIONS.items()}


def main(arguments: list[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    commands = parser.add_subparsers(dest="command", required=True)
    fit = commands.add_parser("fit", help="fit the recordings that are new")
    fit.add_argument("recordings", type=Path)
    fit.add_argument("results", type=Path)
    fit.add_argument("--calibrations", type=Path, help="folder for a calibration file of each unit")
    fit.add_argument("--limits", type=Path, help="TOML file with the largest value of columns")
    fit.add_argument("--scheduler", help="address of a cluster's scheduler; without it, workers on this machine")
    fit.add_argument("--workers", type=int, default=os.cpu_count(), help="processes on this machine")
    fit.add_argument("--threads", type=int, default=1, help="threads of each process")
    ask = commands.add_parser("ask", help="answer the questions")
    ask.add_argument("results", type=Path)
    given = parser.parse_args(arguments)
    if given.command == "ask":
        for question, answer in answers(given.results).items():
            print(question)
            answer.show(max_width=160)
        return
    limits = tomllib.loads(given.limits.read_text()) if given.limits else None
    to = None
    if given.calibrations:
        at = {folder: given.calibrations.resolve() / f"{row['recording']}.toml" for folder, row in recordings(given.recordings).items()}
        to = {folder: str(file) for folder, file in at.items()}
    calibrate = partial(calibrated, to=to, limits=limits)
    if given.scheduler:
        with Client(given.scheduler) as client:
            calibrate_all(client, given.recordings, given.results, calibrate)
        return
    # A terminal sends Ctrl-C to the workers too. They inherit that it is ignored, so that this process ends them in good order.
    on_ctrl_c = signal.signal(signal.SIGINT, signal.SIG_IGN)
    with LocalCluster(n_workers=given.workers, threads_per_worker=given.threads, dashboard_address=":0") as cluster, Client(cluster) as client:
        signal.signal(signal.SIGINT, on_ctrl_c)
        calibrate_all(client, given.recordings, given.results, calibrate)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        print("interrupted; run it again to go on", file=sys.stderr)
        sys.exit(130)
