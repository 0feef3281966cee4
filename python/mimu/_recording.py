"""Recordings from files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from mimu import _mimu
from mimu._arguments import Path, arguments
from mimu._mimu import Recording

def read(
    *files: Path,
    output: Path | None = None,
    reference: str | None = None,
    gravity: float | None = None,
    latitude: float | None = None,
    raw_unit: str | None = None,
    units: str | None = None,
    columns: str | Sequence[str] | None = None,
    preset: str | None = None,
    rate_hz: float | None = None,
    time_unit: str | None = None,
    scale: Mapping[str, float] | None = None,
    offset: Mapping[str, float] | None = None,
    zero: Mapping[str, float] | None = None,
    twos_complement: Mapping[str, int] | None = None,
    signed_low_byte: str | Sequence[str] | None = None,
    where: Mapping[str, Any] | None = None,
    rows: str | None = None,
    topic: str | Sequence[str] | None = None,
    instance: int | str | None = None,
    means: bool = False,
    sequence: bool = False,
    faces: Mapping[str, Path] | None = None,
    step_gap: float | None = None,
    inputs: Path | None = None,
    rate_dps: str | None = None,
    rate_error: str | None = None,
    separator: str | None = None,
    comment: str | None = None,
    skip_broken: int | str | bool = False,
    trust_readings: bool = False,
    device: str | None = None,
    format: str | None = None,
    replace: bool = False,
) -> Recording:
    """Reads a recording of mimu, or the files of another program: every format of ``mimu import``, with its options as keywords.

    ``files``: a folder with ``recording.toml``, which takes no other argument; or text, Parquet, bags of ROS, logs of PX4 and
    ArduPilot. The later files are joined onto the times of the first.

    Columns and units that are not given are found in the file: by the names of its columns, by gravity at rest, and by how the gyro's turns move
    gravity. What the file does not show is asked: the :class:`mimu.Error` says what to add. ``units="g,deg/s"`` says the units of both sensors.
    ``reference`` is ``"gravity"`` unless there are known inputs.

    ``columns`` is one list for each file, ``"t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,-"`` from the left or
    ``"gyro_x=wx,t_s=time"`` by the names of the header. ``raw_unit`` is ``"V"``, ``"count"`` or ``"SI"``; ``gravity`` is in m/s²,
    ``latitude`` in degrees, ``rate_hz`` in samples a second, ``step_gap`` in seconds. ``scale``, ``offset``, ``zero`` and
    ``twos_complement`` are by column or sensor: ``scale={"gyro": 0.0174533}``. ``faces`` maps the axis that was up to a file:
    ``{"+x": "a.csv", "-x": "b.csv", ...}``. For a turntable with known rates, give ``rate_dps="200,270"`` and ``rate_error="0.3%"``.
    If a file has both sensors in different rows, give two lists of ``columns`` and ``where={"flag": [1, 2]}``. ``rows="..8799"`` reads these data rows
    only. ``skip_broken=True`` leaves out up to 1 % of rows that cannot be read. ``trust_readings=True`` uses readings that look
    wrongly coded, or of another range from some row on.

    The recording is written to ``output``, or to a temporary folder that is removed with it. Its ``imported`` and ``warnings`` are the results
    of the import.
    """
    if len(files) == 1 and os.path.isdir(files[0]) and os.path.exists(os.path.join(files[0], "recording.toml")):
        return _mimu.open(files[0])
    options: dict[str, Any] = dict(
        reference=reference, gravity=gravity, latitude=latitude, raw_unit=raw_unit, units=units, columns=columns, preset=preset, rate_hz=rate_hz,
        time_unit=time_unit, scale=scale, offset=offset, zero=zero, twos_complement=twos_complement, signed_low_byte=signed_low_byte,
        where=where, rows=rows, topic=topic, instance=instance, means=means, sequence=sequence, faces=bool(faces), step_gap=step_gap, inputs=inputs,
        rate_dps=rate_dps, rate_error=rate_error, separator=separator, comment=comment, skip_broken=skip_broken, trust_readings=trust_readings,
        device=device, format=format, replace=replace,
    )
    named = [f"{face}={os.fspath(file)}" for face, file in (faces or {}).items()]
    # After `--`, a name that begins with a hyphen is a name.
    positional = ["--", *(os.fspath(file) for file in files)] if files else []
    return _mimu.read([*arguments(options), *named, *positional], output)
