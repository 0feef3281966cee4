"""The effect behind a residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mimu import _mimu
from mimu._arguments import CalibrationLike, NoiseLike, arguments, calibration_of, kept, noise_of, several
from mimu._error import Error
from mimu._fit import Keep, Steps
from mimu._mimu import Recording
from mimu._result import GivesCalibration, Judgement, Message


@dataclass(frozen=True)
class Coefficient:
    """A coefficient of an effect."""

    name: str
    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class Effect:
    """An effect that was found."""

    id: str
    sensor: str
    coefficients: list[Coefficient]
    #: Errors without it and with it, in the unit of its sensor.
    held_out_rms_before: float
    held_out_rms_after: float


@dataclass(frozen=True)
class Rejected:
    """An effect that was tried and not accepted."""

    id: str
    reason: str


@dataclass(frozen=True)
class NotExcited:
    """An effect that the recording could not show, and the experiment that would."""

    id: str
    experiment: str


@dataclass(frozen=True)
class Leftover:
    """An error beyond the known noise that no effect explains."""

    sensor: str
    axis: str
    against: str
    strength: float


@dataclass(frozen=True)
class SensorDiagnosis:
    """Errors of a sensor without the effects and with them, root mean square."""

    unit: str
    figure: str
    rms_before: float
    rms_after: float
    held_out_rms_before: float
    held_out_rms_after: float
    noise_floor: float


@dataclass(frozen=True)
class TurnPart:
    """A part of what turns err by, root mean square, rad."""

    rms: float
    #: Bounds of the 95 % interval.
    lower: float
    upper: float
    #: The same by noise alone.
    noise_floor: float


@dataclass(frozen=True)
class Pairs:
    """What the pairs of a body (a gyro and an accelerometer each) err by after turns."""

    turns: int
    #: The part that all share.
    common: TurnPart
    #: The part of each, by its number: ``"2"`` for ``gyro2`` with ``accel2``.
    own: dict[str, TurnPart]
    #: Whether noise does not explain the common part.
    exceeds_noise: bool
    #: Judgement of each by its own part; empty for two pairs, or if noise explains the common part.
    judged: dict[str, Judgement]


class Diagnosis(GivesCalibration):
    """The effects behind the residual of a unit."""

    _native: _mimu.Diagnosis
    _texts = True

    #: ``"clean"``, ``"explained"``, ``"unexplained"`` or ``"untestable"``.
    verdict: str
    effects: list[Effect]
    rejected: list[Rejected]
    not_excited: list[NotExcited]
    leftover: list[Leftover]
    sensors: dict[str, SensorDiagnosis]
    #: Of recordings with several pairs; else None.
    body: Pairs | None
    #: Warnings, one sentence each, with its ``kind``.
    warnings: list[Message]

    def to_dataframe(self) -> Any:
        """The coefficients as a table of pandas: a row for each, with ``effect``, ``sensor``, ``coefficient``, ``value``, ``sigma`` and ``unit``."""
        import pandas

        names = ["effect", "sensor", "coefficient", "value", "sigma", "unit"]
        rows = [(e.id, e.sensor, c.name, c.value, c.sigma, c.unit) for e in self.effects for c in e.coefficients]
        return pandas.DataFrame(rows, columns=names)

    def text(self, *, everything: bool = False) -> str:
        """What ``mimu diagnose`` prints; ``everything`` as with ``--all --next``."""
        return self._native.text(everything)

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        found = ", ".join(effect.id for effect in self.effects) or "no effect"
        return f"<mimu.Diagnosis of {self.device!r}: {self.verdict}, {found}>"


def diagnose(
    recordings: Recording | Sequence[Recording],
    *,
    verify: Recording | Sequence[Recording] | None = None,
    calibration: CalibrationLike | None = None,
    still: float | None = None,
    steps: Steps | None = None,
    keep: Keep | None = None,
    noise: NoiseLike | None = None,
    whole_turns: int | bool = False,
    placement: float | None = None,
    field: float | None = None,
) -> Diagnosis:
    """Finds the effect behind the residual of a unit, as ``mimu diagnose`` does.

    ``recordings``: one, or more of the same unit; the calibration is that of the first. ``verify`` is one other recording, or a list of one, in
    which no effect is searched: an effect that it contradicts is not accepted. Judge by further recordings with :func:`mimu.verify`. The matrices
    of ``calibration`` are kept, for a unit that is never turned. The other arguments are those of
    :func:`mimu.fit`.
    """
    others = [] if verify is None else several(verify, "verify")
    if len(others) > 1:
        raise Error.of("verify", "a diagnosis is judged by one other recording", "judge its calibration by more with mimu.verify")
    options = dict(still=still, steps=steps, keep=kept(keep), whole_turns=whole_turns, placement=placement, field=field)
    return Diagnosis(
        _mimu.diagnose(
            several(recordings), arguments(options), verify=others[0] if others else None,
            calibration=None if calibration is None else calibration_of(calibration), noise=noise_of(noise),
        )
    )
