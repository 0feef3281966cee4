"""Noise of a unit in motion."""

from __future__ import annotations

import os
from dataclasses import dataclass

from mimu import _mimu
from mimu._arguments import CalibrationLike, NoiseLike, arguments, calibration_of, noise_of
from mimu._fit import Steps
from mimu._mimu import Recording
from mimu._result import GivesNoise, Message


@dataclass(frozen=True)
class Density:
    """A density that a filter takes; ``unit`` is that of value and interval."""

    sensor: str
    #: ``"white"`` or ``"walk"``.
    term: str
    value: float
    interval: list[float]
    unit: str
    #: The same at rest, and value over it; None where the noise file shows none.
    allan: float | None
    factor: float | None
    factor_interval: list[float] | None


@dataclass(frozen=True)
class Nees:
    """Squared errors of held-out segments over what a filter believes; 1 is right."""

    value: float
    #: Where chance puts 95 of 100 recordings.
    by_chance: list[float]
    dof: int


@dataclass(frozen=True)
class Consistency:
    """The same by Allan's noise alone, with the calibration's uncertainty, and by the noise in use."""

    allan: Nees
    with_calibration: Nees
    in_use: Nees


@dataclass(frozen=True)
class Cause:
    """A cause of errors beyond Allan's noise; ``sensor`` is None for the reference."""

    sensor: str | None
    cause: str
    size: float
    unit: str
    #: Share of the errors of its sensor beyond Allan's noise, from 0 to 1.
    share: float


@dataclass(frozen=True)
class Estimate:
    """An estimate with its 95 % interval."""

    value: float
    interval: list[float]


@dataclass(frozen=True)
class Biases:
    """Biases beyond those of the calibration in the middle of the recording, rad/s and m/s²."""

    gyro: list[Estimate]
    accel: list[Estimate]


@dataclass(frozen=True)
class Mounted:
    """How a trajectory is mounted and timed against the unit."""

    #: What to add to its times, s.
    clock_s: Estimate
    #: Rotation vector from the unit's axes to those of the trajectory, in axes of the unit, rad.
    rotation_rad: list[Estimate]
    #: Where its point lies, in axes of the unit, m.
    lever_m: list[Estimate]


class NoiseInUse(GivesNoise):
    """The densities that explain the errors of dead reckoning in motion."""

    _native: _mimu.NoiseInUse

    biases: Biases
    #: None by rests.
    mounted: Mounted | None
    densities: list[Density]
    nees: Consistency
    causes: list[Cause]
    #: For each sensor whose noise is inflated, one sentence that says why.
    sentences: list[str]
    #: Warnings, one sentence each, with its ``kind``.
    warnings: list[Message]

    def __repr__(self) -> str:
        return f"<mimu.NoiseInUse of {self.device!r}: {self.judgement}>"


def noise_in_use(
    recording: Recording,
    calibration: CalibrationLike | None,
    noise: NoiseLike,
    *,
    trajectory: str | os.PathLike[str] | None = None,
    trajectory_zero: float = 0.0,
    still: float | None = None,
    steps: Steps | None = None,
) -> NoiseInUse:
    """Finds the noise that a filter wants, as ``mimu noise`` does.

    Parameters
    ----------
    recording : Recording
        In motion, with rests before and after each motion, or with a ``trajectory``. It must not be the one that the calibration was made from.
    calibration : Calibration, Fit, SessionsFit, Diagnosis, thermal.ThermalFit or path, or None
        Of the unit; None for readings in rad/s and m/s² as they are.
    noise : Noise, Allan or path
        Of the unit at rest.
    trajectory, trajectory_zero
        A file with poses of the unit by another instrument: ground truth of EuRoC, or of TUM's benchmarks; and its time at which ``t`` is 0, s.
    still, steps
        As for :func:`mimu.fit`.

    Returns
    -------
    NoiseInUse
        With a ``judgement``, the ``densities``, and the ``causes``.
    """
    given = noise_of(noise)
    if given is None:
        raise TypeError("noise: None gives no noise; give a mimu.Noise, a mimu.Allan or the path of a file")
    by = None if calibration is None else calibration_of(calibration)
    options = dict(trajectory=trajectory, trajectory_zero=trajectory_zero if trajectory else None, still=still, steps=steps)
    return NoiseInUse(_mimu.noise_in_use(recording, by, given, arguments(options)))
