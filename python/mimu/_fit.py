"""A fit of both triads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mimu import _mimu
from mimu._mimu import Calibration, Noise, Recording
from mimu._result import Array, Judgement, Message, Result, judged, messages, typed

Steps = Literal["given", "found"]
Sensor = Literal["gyro", "accel"]
Keep = Literal["all"] | Sequence[int]


@dataclass(frozen=True)
class Parameter:
    """A parameter with its uncertainty."""

    name: str
    value: float
    #: Standard deviation.
    sigma: float
    #: Ends of the 95 % interval.
    lower: float
    upper: float
    #: Unit of these four.
    unit: str


@dataclass(frozen=True)
class Dwell:
    """A time in which pose and rate are constant."""

    step: int
    label: str | None
    first_row: int
    rows: int
    start_s: float
    duration_s: float
    temp_c: float
    #: Gyro x, y, z, accelerometer x, y, z, in the unit of the readings.
    raw_mean: Array
    #: Why it is not used for the sensor; None if it is.
    gyro_not_used: str | None
    accel_not_used: str | None


@dataclass(frozen=True)
class Figures:
    """Errors of a sensor, root mean square."""

    #: On data held out of the fit; None if nothing was held out.
    held_out_rms: float | None
    #: On the fitted data.
    rms: float
    #: What noise alone would give.
    noise_floor: float
    unit: str
    #: The quantity whose errors these are.
    figure: str


@dataclass(frozen=True)
class SensorFit:
    """The calibration of one triad: ``x = C @ u + o``, raw to SI."""

    #: SI per raw unit.
    C: Array
    #: SI.
    o: Array
    #: Standard deviations of ``C``, and of ``o``.
    sigma: Array
    sigma_o: Array
    #: By name: ``C_xx`` to ``o_z``, and ``scale_x``, ``bias_x``, ``misalignment_x``, ``non_orthogonality_yz`` and so on.
    parameters: dict[str, Parameter]
    estimator: str
    held_out_rms: float | None
    rms: float
    noise_floor: float
    #: Unit of the three errors.
    unit: str
    #: The quantity whose errors these are.
    figure: str
    #: Dwells used.
    dwells: int
    #: Condition number of the experiment.
    condition: float
    #: For gyros with unknown input: errors at rest, rad/s.
    static_rms: float | None
    static_held_out_rms: float | None

    @staticmethod
    def _of(data: dict[str, Any]) -> SensorFit:
        # The first twelve parameters are C, by rows, and o.
        value, sigma = (np.array([p[key] for p in data["parameters"][:12]], dtype=float) for key in ("value", "sigma"))
        own = {
            "C": value[:9].reshape(3, 3), "o": value[9:], "sigma": sigma[:9].reshape(3, 3), "sigma_o": sigma[9:],
            "parameters": {p["name"]: p for p in data["parameters"]},
        }
        return typed(SensorFit, {**data, **own})


class Fit(Result):
    """A calibration of a recording, judged on data held out of the fit."""

    _native: _mimu.Fit

    #: The triads; None if the recording has no such sensor.
    gyro: SensorFit | None
    accel: SensorFit | None
    #: By sensor, the errors. Quote ``held_out_rms``.
    held_out: dict[str, Figures]
    #: All dwells, used or not.
    dwells: list[Dwell]
    #: Whether it may be used.
    judgement: Judgement
    #: Warnings, one sentence each, with its ``kind``.
    warnings: list[Message]
    device: str

    def __init__(self, native: _mimu.Fit) -> None:
        super().__init__(native)
        data = self.to_dict()
        sensors = data["sensors"]
        self.gyro, self.accel = (SensorFit._of(sensors[s]) if s in sensors else None for s in ("gyro", "accel"))
        self.held_out = {name: typed(Figures, sensor) for name, sensor in sensors.items()}
        self.dwells = [typed(Dwell, dwell) for dwell in data["dwells"]]
        self.judgement = judged(data)
        self.warnings = messages(data)
        self.device = data["device"]

    @property
    def calibration(self) -> Calibration:
        """The calibration, to apply, save or export."""
        return self._native.calibration()

    def apply(self, gyro: Any = None, accel: Any = None) -> tuple[Array | None, Array | None]:
        """Compensated readings in rad/s and m/s², a row for each sample. A :class:`mimu.Recording` may replace both arguments."""
        return self.calibration.apply(gyro, accel)

    def to_toml(self) -> str:
        """The calibration file that ``mimu fit -o`` writes."""
        return self.calibration.to_toml()

    def __str__(self) -> str:
        return self._native.text()

    def __repr__(self) -> str:
        return f"<mimu.Fit of {self.device!r}: held out " + ", ".join(
            f"{name} {f.held_out_rms if f.held_out_rms is not None else f.rms:.4g} {f.unit}" for name, f in self.held_out.items()
        ) + ">"


def fit(
    recording: Recording,
    *,
    holdout: int = 4,
    method: Literal["least-squares", "kalman", "inverse-form", "six-positions"] | None = None,
    only: Sensor | None = None,
    still: float | None = None,
    steps: Steps | None = None,
    keep: Keep | None = None,
    noise: Noise | None = None,
) -> Fit:
    """Calibrates the gyro and the accelerometer of a recording, as ``mimu fit`` does.

    ``holdout`` blocks of time are left out in turn, and the error on them is reported; 0 for none. ``method`` chooses the estimator
    if the input is known. ``only`` calibrates one sensor. ``still`` is the largest variance of a dwell, as a multiple of that of the quietest
    times; ``steps="given"`` takes the dwells of the step column as they are, ``"found"`` searches for them. ``keep`` uses dwells that the
    others contradict: ``"all"``, or their numbers. ``noise`` is that of the unit at rest: ``mimu.allan(...).noise``, or from
    :func:`mimu.load_noise`.
    """
    return Fit(
        _mimu.fit(recording, holdout=holdout, method=method, only=only, still=still, steps=steps, keep=_keep(keep), noise=noise)
    )


def _keep(keep: Keep | None) -> str | list[int] | None:
    return keep if keep is None or isinstance(keep, str) else list(keep)
