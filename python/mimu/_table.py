"""Fits of many recordings: a table of Arrow in, a table of results out."""

from __future__ import annotations

import functools
import hashlib
import inspect
import json
import os
import socket
import tempfile
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.metadata import version
from typing import Any

from mimu import _mimu
from mimu._arguments import Path, arguments, kept, noise_of
from mimu._error import Error
from mimu._fit import fit
from mimu._mimu import Recording
from mimu._recording import read

_AXES = "xyz"
_PARAMETERS = [
    *(f"C_{row}{column}" for row in _AXES for column in _AXES), *(f"{of}_{axis}" for of in ("o", "scale", "bias", "misalignment") for axis in _AXES),
    *(f"non_orthogonality_{pair}" for pair in ("yz", "zy", "zx")),
]
_REFUSAL = ("kind", "file", "row", "column", "problem", "remedy")
_COLUMNS = {
    "string": ["label", "path", "device", "mimu", "options", "sha256", "unit", "reference", "judgement", "reason", "gyro_error_unit", "accel_error_unit"],
    "double": ["rate_hz", "gravity_mps2", "seconds", "processor_s"],
    "int64": ["rows", "gyro_dwells", "accel_dwells"],
    "list": ["warnings", "problems"],
}
#: Folder for marks of running processes and for unfinished parts. Readers of data sets skip names that begin with an underscore.
_ATTEMPTS = "_attempts"


@functools.cache
def fit_table_schema() -> Any:
    """The schema of the results of :func:`mimu.fit_table`, for engines that want it beforehand."""
    import pyarrow as pa

    types = {"string": pa.string(), "double": pa.float64(), "int64": pa.int64(), "list": pa.list_(pa.string())}
    fields = [(name, types[kind]) for kind, names in _COLUMNS.items() for name in names]
    for sensor in ("gyro", "accel"):
        figures = ["held_out", "rms", "noise_floor", "condition", *_PARAMETERS, *(f"{parameter}_sigma" for parameter in _PARAMETERS)]
        fields += [(f"{sensor}_{name}", pa.float64()) for name in figures]
    refusal = [("error", pa.string()), *((f"error_{part}", pa.int64() if part == "row" else pa.string()) for part in _REFUSAL)]
    return pa.schema([*fields, ("calibration", pa.string()), *refusal])


def fit_table(
    table: Any,
    *,
    parts: Path | None = None,
    reading: Mapping[str, Any] | None = None,
    storage_options: Mapping[str, Any] | None = None,
    **options: Any,
) -> Any:
    """Fits every recording of a table of Arrow, and gives a table of results: a row for each, in the same order.

    A recording that is refused is a row with its refusal. The function is what an engine calls with each of its batches: Spark's ``mapInArrow``, Ray's
    ``map_batches``, a partition of Dask or a task of Slurm.

    Parameters
    ----------
    table : pyarrow.Table, RecordBatch, or a table of another library with Arrow's interface
        A row for each recording. ``label`` names it, ``path`` is a folder or a file as :func:`mimu.read` takes it, also ``s3://bucket/folder`` and
        whatever fsspec reads. Without ``path``, the row has arrays in lists: ``t``, ``gyro``, ``accel`` and so on. Every other column is a
        keyword of :func:`mimu.read`, or of :class:`mimu.Recording` for arrays, as ``gravity`` or ``device``.
    parts : path or URL, optional
        Folder for the results: the table of this call becomes one Parquet file, whole or not at all. If it is there from an earlier run, with the same options and
        version, nothing is fitted. A recording at which two processes ended becomes a row with that refusal.
    reading : mapping, optional
        Keywords for all rows: ``{"units": "deg/s,g"}``.
    storage_options : mapping, optional
        Options of fsspec's file system, for paths and parts.
    **options
        Keywords of :func:`mimu.fit`.

    Returns
    -------
    pyarrow.Table
        With the schema :func:`mimu.fit_table_schema`. Scale factors and biases are in ``unit``, all else is SI; ``calibration`` is the text of the calibration file.

    Examples
    --------
    >>> mimu.fit_table(pyarrow.table({"label": ["u1"], "path": ["recordings/u1"]}), parts="results")["judgement"]
    """
    import pyarrow as pa

    table = _labelled(table)
    inspect.signature(fit).bind(None, **options)
    reading, storage = dict(reading or {}), dict(storage_options or {})
    of_paths = "path" in table.column_names
    _check([*table.column_names, *reading], of_paths)
    noise = noise_of(options.pop("noise", None))
    given = arguments({**options, "keep": kept(options.get("keep"))})
    said = json.dumps({"fit": given, "noise": noise and noise.to_toml(), "reading": reading}, default=str)
    same = {"mimu": version("mimu"), "options": said}

    def result(row: Mapping[str, Any], ended: bool = False) -> dict[str, Any]:
        label, path = row["label"].as_py(), row["path"].as_py() if of_paths else None
        found = {"label": label, "path": path, **same}
        begun, used = time.monotonic(), time.process_time()
        try:
            if ended:
                raise Error.of(label, "two processes ended while they fitted it", "run `mimu fit` on it alone, and watch its memory", kind="worker")
            keywords = {name: _value(value) for name, value in row.items() if value.is_valid and name not in ("label", "path")}
            with _opened(label, path, of_paths, {**reading, **keywords}, storage) as recording:
                made = _mimu.fit(recording, given, noise=noise)
                found |= {"rate_hz": recording.rate_hz, "calibration": made.calibration().to_toml()} | _found(json.loads(made.json()))
        except (KeyboardInterrupt, SystemExit):
            raise
        # A panic of the compiled part too, which is not an `Exception`: the other recordings of the batch do not depend on it.
        except BaseException as error:
            found |= _refused(error)
        return found | {"seconds": time.monotonic() - begun, "processor_s": time.process_time() - used}

    if parts is None:
        return pa.Table.from_pylist([result(row) for row in _rows(table)], fit_table_schema())
    return _part(table, result, same, _Folder(parts, storage))


def not_fitted(table: Any, parts: Path, *, storage_options: Mapping[str, Any] | None = None) -> Any:
    """The rows of a table whose ``label`` has no result in a folder of parts: what is left to do after a run that was cut short, or with a longer table.

    A result belongs to its label, so a unit that is recorded again needs another one, as ``unit-7/2026-11-02``.
    """
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.dataset as ds

    table, folder = _labelled(table), _Folder(parts, dict(storage_options or {}))
    if not folder.system.exists(folder.root):
        return table
    # With the schema given, no file is opened to find it.
    known = ds.dataset(folder.root, filesystem=folder.system, format="parquet", schema=pa.schema([("label", pa.string())])).to_table()
    return table.filter(pc.invert(pc.is_in(table["label"], known["label"])))


class _Folder:
    """A folder of parts, on any file system of fsspec."""

    def __init__(self, parts: Path, storage: Mapping[str, Any]) -> None:
        from fsspec.core import url_to_fs

        self.system, root = url_to_fs(os.fspath(parts), **storage)
        self.system.invalidate_cache()
        self.root = root.rstrip("/")

    @contextmanager
    def mark(self, name: str) -> Iterator[None]:
        """A file with host and number of this process during some work. Only a process that is killed leaves it behind."""
        path = f"{self.root}/{name}"
        self.system.pipe_file(path, f"{socket.gethostname()} {os.getpid()}".encode())
        try:
            yield
        finally:
            # An engine may run the same batch twice, and the other process may have finished.
            with suppress(FileNotFoundError):
                self.system.rm_file(path)

    def has(self, name: str) -> bool:
        return bool(self.system.exists(f"{self.root}/{name}"))


def _part(table: Any, result: Any, same: Mapping[str, str], folder: _Folder) -> Any:
    """The results as a file of the folder, or those that are there."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    name = hashlib.sha256("\0".join(table["label"].to_pylist()).encode()).hexdigest()[:24]
    file, attempt = f"{folder.root}/{name}.parquet", f"{_ATTEMPTS}/{name}"
    if folder.has(f"{name}.parquet"):
        with folder.system.open(file, "rb") as stored:
            found = pq.read_table(stored)
        paths = table["path"].to_pylist() if "path" in table.column_names else [None] * table.num_rows
        if found.schema == fit_table_schema() and found["path"].to_pylist() == paths and all(found[key].unique().to_pylist() == [value] for key, value in same.items()):
            return found
    folder.system.makedirs(f"{folder.root}/{_ATTEMPTS}", exist_ok=True)
    # A process that is killed leaves its mark. The next one then marks each recording before its fit, which shows the recording that ends processes. Marks for
    # each recording cost two requests to a store beside every fit, so a batch that has not failed does without.
    ended = folder.has(attempt)
    with folder.mark(attempt):
        rows = []
        for number, row in enumerate(_rows(table)):
            once, twice = (f"{attempt}.{number}.{time}" for time in (1, 2))
            if not ended:
                rows.append(result(row))
            elif folder.has(twice):
                rows.append(result(row, ended=True))
            else:
                with folder.mark(twice if folder.has(once) else once):
                    rows.append(result(row))
        made = pa.Table.from_pylist(rows, fit_table_schema())
        content = pa.BufferOutputStream()
        pq.write_table(made, content, compression="zstd")
        unfinished = f"{folder.root}/{_ATTEMPTS}/unfinished.{uuid.uuid4().hex}"
        folder.system.pipe_file(unfinished, content.getvalue().to_pybytes())
        folder.system.mv(unfinished, file)
    if ended:
        for mark in folder.system.glob(f"{folder.root}/{attempt}.*"):
            folder.system.rm_file(mark)
    return made


def _check(names: list[str], of_paths: bool) -> None:
    """Refuses columns without a meaning here: their values would be missing from the results, and nothing would say so."""
    taken = set(inspect.signature(read if of_paths else Recording).parameters) - {"files", "output"} | {"label", "path"}
    for name in names:
        if name not in taken:
            keywords = "mimu.read" if of_paths else "mimu.Recording"
            remedy = "select the others, and join the results to it by label"
            raise Error.of(f"table, column {name}", f"it is neither label nor path nor a keyword of {keywords}", remedy)


def _labelled(table: Any) -> Any:
    """A table of Arrow whose rows have a label each, as text."""
    import pyarrow as pa

    table = pa.Table.from_batches([table]) if isinstance(table, pa.RecordBatch) else pa.table(table)
    if "label" not in table.column_names or table["label"].null_count:
        raise Error.of("table, column label", "it is missing, or empty in a row", "name each recording")
    return table.set_column(table.column_names.index("label"), "label", table["label"].cast(pa.string()))


def _rows(table: Any) -> Iterator[dict[str, Any]]:
    """Rows of scalars: lists stay in Arrow's memory."""
    for batch in table.to_batches():
        for number in range(batch.num_rows):
            yield {name: batch.column(name)[number] for name in batch.schema.names}


def _value(scalar: Any) -> Any:
    """A cell as a keyword: lists of numbers as arrays, with three columns if they are of threes."""
    import pyarrow as pa

    if not isinstance(scalar, (pa.ListScalar, pa.LargeListScalar, pa.FixedSizeListScalar)):
        return scalar.as_py()
    values, nested = scalar.values, False
    while pa.types.is_nested(values.type):
        values, nested = values.flatten(), True
    numbers = values.to_numpy(zero_copy_only=False)
    return numbers.reshape(len(scalar.values), -1) if nested else numbers


@contextmanager
def _opened(label: str, path: str | None, of_paths: bool, keywords: dict[str, Any], storage: Mapping[str, Any]) -> Iterator[Recording]:
    """The recording of a row; one on another machine is copied for as long as it is used."""
    if not of_paths:
        yield Recording(**{"device": label.rsplit("/", 1)[-1], **keywords})
    elif path is None:
        raise Error.of(label, "it has no path", "give a folder or a file")
    elif "://" not in path:
        yield read(path, **keywords)
    else:
        from fsspec.core import url_to_fs

        system, inner = url_to_fs(path, **storage)
        with tempfile.TemporaryDirectory(prefix="mimu-") as folder:
            copy = os.path.join(folder, inner.rstrip("/").rsplit("/", 1)[-1])
            system.get(inner, copy, recursive=True)
            try:
                yield read(copy, **keywords)
            except Error as error:
                place, problem, remedy = (text.replace(copy, path) for text in (error.place, error.problem, error.remedy))
                raise Error.of(place, problem, remedy, error.kind) from None


def _found(data: Mapping[str, Any]) -> dict[str, Any]:
    """The row of a fit's JSON."""
    found = {name: data[name] for name in ("device", "sha256", "reference", "gravity_mps2", "rows")}
    found |= {"unit": data["raw_unit"], "judgement": data["judgement"]["kind"], "reason": data["judgement"]["reason"]}
    found |= {"warnings": [warning["text"] for warning in data["warnings"]], "problems": [problem["id"] for problem in data["recording_problems"]]}
    for sensor, of in data["sensors"].items():
        figures = {"held_out": "held_out_rms", "rms": "rms", "noise_floor": "noise_floor", "condition": "condition", "dwells": "dwells", "error_unit": "unit"}
        found |= {f"{sensor}_{name}": of[key] for name, key in figures.items()}
        for parameter in of["parameters"]:
            found |= {f"{sensor}_{parameter['name']}": parameter["value"], f"{sensor}_{parameter['name']}_sigma": parameter["sigma"]}
    return found


def _refused(error: BaseException) -> dict[str, Any]:
    """The columns of a refusal: by mimu, by a file system, or any other error."""
    if isinstance(error, Error):
        return {"error": str(error)} | {f"error_{part}": getattr(error, part) for part in _REFUSAL}
    return {"error": repr(error), "error_kind": "io" if isinstance(error, OSError) else "exception", "error_problem": repr(error)}
