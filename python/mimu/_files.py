"""Calibration and noise files, verification, exports."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Literal, cast

from mimu import _mimu
from mimu._arguments import CalibrationLike, NoiseLike, Path, arguments, calibration_of, noise_of
from mimu._fit import Steps
from mimu._mimu import Calibration, Noise, Recording
from mimu._result import _Kept, Judged, Message


def load(path: Path) -> Calibration:
    """Reads a calibration file, as ``mimu fit -o``, ``mimu diagnose -o`` and ``mimu thermal fit -o`` write it."""
    return _mimu.load_calibration(path)


def load_noise(path: Path) -> Noise:
    """Reads a noise file, as ``mimu allan -o`` writes it."""
    return _mimu.load_noise(path)


@dataclass(frozen=True)
class SensorVerification:
    """Errors of one triad, root mean square except for ``max``."""

    #: With one scale factor and bias for all axes, and no misalignment.
    rms_raw: float
    rms: float
    max: float
    #: What noise alone would give.
    noise_floor: float
    unit: str
    figure: str
    #: Dwells or turns judged.
    count: int
    #: For gyros with unknown input: errors at rest, rad/s.
    static_rms: float | None


class Verification(Judged):
    """A calibration judged by another recording."""

    _native: _mimu.Verification

    sensors: dict[str, SensorVerification]
    #: Warnings, one sentence each, with its ``kind``.
    warnings: list[Message]

    def __repr__(self) -> str:
        return "<mimu.Verification: " + ", ".join(f"{name} {s.rms:.4g} {s.unit}" for name, s in self.sensors.items()) + ">"


def verify(
    recording: Recording,
    calibration: CalibrationLike,
    *,
    still: float | None = None,
    steps: Steps | None = None,
    noise: NoiseLike | None = None,
    whole_turns: int | bool = False,
    placement: float | None = None,
    part: Path | None = None,
) -> Verification:
    """Judges a calibration by another recording, as ``mimu verify`` does.

    Parameters
    ----------
    recording : Recording
        Another recording of the same unit.
    calibration : Calibration, Fit, SessionsFit, Diagnosis, thermal.ThermalFit or path
        What is judged.
    still, steps, noise, whole_turns, placement, part
        As for :func:`mimu.fit`.

    Returns
    -------
    Verification
        With a ``judgement``, and by sensor the errors before and after.
    """
    options = dict(still=still, steps=steps, whole_turns=whole_turns, placement=placement, part=part)
    return Verification(_mimu.verify(recording, calibration_of(calibration), arguments(options), noise=noise_of(noise)))


Format = Literal[
    "c", "rust", "json", "kalibr", "openvins", "vins", "orbslam3", "liosam", "fastlio", "dlio", "kf-gins", "navego", "imu-calib",
    "imu-tk", "fusion", "realsense", "depthai", "basalt", "px4", "ardupilot", "betaflight", "inav", "adafruit", "slimenrf", "pigeon",
    "iio", "ros-imu", "autoware", "gazebo", "matlab", "core",
]


class Export:
    """A file for another program."""

    #: Bytes of the file.
    content: bytes
    #: What the program computes with it.
    formulas: list[str]
    #: What the user must know or do.
    notes: list[str]

    def __init__(self, native: _mimu.Export) -> None:
        self._native = native
        self.content = native.content()
        data = self.to_dict()
        self.formulas = data["formulas"]
        self.notes = data["notes"]

    def to_dict(self) -> dict[str, Any]:
        """Formulas, notes and the errors that remain because the format has no place for a part of the calibration."""
        return cast(dict[str, Any], json.loads(self._native.json()))

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled_export, (self.content, self._native.json())

    def save(self, path: Path) -> None:
        """Writes the file, whole or not at all."""
        _mimu.write(path, self.content)

    def __str__(self) -> str:
        return self.content.decode(errors="replace")

    def __repr__(self) -> str:
        return f"<mimu.Export to {self.to_dict()['to']}: {len(self.content)} bytes>"


def _unpickled_export(content: bytes, text: str) -> Export:
    return Export(cast(Any, _Kept({"content": (content,), "json": (text,)})))


def export(
    format: Format,
    *,
    calibration: CalibrationLike | None = None,
    noise: NoiseLike | None = None,
    **options: Any,
) -> Export:
    """A calibration, or noise, in the format of another program: every one of ``mimu export``, with its options as keywords.

    ``mimu.export("px4", calibration=fit, qgc=True).save("unit.params")``. What is not in the file is in ``notes`` and in
    ``to_dict()["remaining"]``. ``mimu export FORMAT --help`` lists the options.
    """
    of = calibration_of(calibration) if calibration is not None else None
    return Export(_mimu.export([format, *arguments(options)], calibration=of, noise=noise_of(noise)))
