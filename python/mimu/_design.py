"""The design of an experiment."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from mimu import _mimu
from mimu._arguments import arguments
from mimu._mimu import Recording
from mimu._result import Array, Result

Reference = Literal["table", "gravity"]
Table = Literal["three-axis", "two-axis", "faces", "hand"]


@dataclass(frozen=True)
class ParameterSigma:
    """How well a parameter is determined."""

    name: str
    #: Standard deviation, and half of the 95 % interval, in ``unit``; NaN if infinite.
    value: float
    half_width_95: float
    #: SI; "1" for a ratio.
    unit: str


class Design(Result):
    """The attitudes, and how well they determine the parameters."""

    _native: _mimu.Design
    _questions = ("json", "text", "html", "plan")

    title: str
    #: Direction in the body frame that points up, a row for each dwell, in order.
    positions: Array
    #: Rate about the vertical in each dwell, deg/s; None for an accelerometer.
    rates_dps: Array | None
    #: 1 is the best possible, 0 singular; None with a prior, where the optimum depends on the number of dwells.
    d_efficiency: float | None
    sigma_per_parameter: list[ParameterSigma]
    dwell_s: float
    #: All dwells and moves.
    time_s: float
    #: Parameters that it does not determine.
    undetermined: list[str]

    def to_toml(self) -> str:
        """The plan that ``mimu design -o`` writes, for a table or a person to carry out."""
        return self._native.plan()

    def __repr__(self) -> str:
        quality = "with a prior" if self.d_efficiency is None else f"D-efficiency {self.d_efficiency:.3f}"
        return f"<mimu.Design: {self.title}, {quality}>"


@dataclass(frozen=True)
class Shown:
    """How clearly an experiment shows an effect."""

    id: str
    #: Typical size over the sigma of the worst determined coefficient, or of the whole effect beside its rivals.
    sigmas: float
    #: The required ``sigmas``, and whether they are reached.
    wanted: float
    settled: bool


@dataclass(frozen=True)
class CoefficientSigma:
    """How well a coefficient of an effect is determined."""

    name: str
    value: float
    #: SI.
    unit: str


class NextExperiment(Result):
    """The smallest experiment that shows given effects."""

    _native: _mimu.Design
    _questions = ("json", "text", "html", "plan")

    title: str
    #: What to do, in order.
    experiment: str
    effects: list[Shown]
    #: Direction in the body frame that points up, a row for each dwell, in order.
    positions: Array
    #: Rate about the vertical in each dwell, deg/s, and when it begins.
    rates_dps: Array
    begin_s: Array
    #: Chamber, times in s and degrees Celsius in rows; empty if it does not matter.
    chamber_c: Array
    #: Whether the unit is switched on as the recording begins.
    cold_start: bool
    sigma_per_parameter: list[CoefficientSigma]
    dwell_s: float
    time_s: float

    def _fill(self, data: dict[str, Any]) -> None:
        self.chamber_c = self.chamber_c.reshape(-1, 2)

    def to_toml(self) -> str:
        """The plan that ``mimu design --effects -o`` writes, for a table or a person to carry out."""
        return self._native.plan()

    def __repr__(self) -> str:
        return f"<mimu.NextExperiment {self.title}: {len(self.positions)} dwells>"


def design(
    *,
    n: int | None = None,
    budget: float | None = None,
    prior: str | os.PathLike[str] | None = None,
    aim: float | None = None,
    target: Sequence[str] | None = None,
    sensor: Literal["gyro", "accel"] = "accel",
    reference: Reference | None = None,
    table: Table | None = None,
    dwell: float | None = None,
    rates: str | None = None,
    slew: float | None = None,
    settle: float | None = None,
    sigma: float | None = None,
    noise: float | str | os.PathLike[str] | None = None,
    instability: float | None = None,
    walk: float | None = None,
    seed: int | None = None,
) -> Design:
    """Designs an experiment, as ``mimu design`` does: the best ``n`` dwells, or the best within ``budget`` minutes.

    ``dwell`` and ``settle`` are in seconds, ``slew`` and ``rates`` in deg/s (``"10,100,300"``, or ``"..300"`` for any up to 300), ``sigma``,
    ``instability``, ``walk`` and a number as ``noise`` in SI; ``noise`` may also be a noise file.
    ``prior`` is a file of ``mimu fleet --prior``: poses by hand that count what the population of the unit's kind says; without ``n`` and
    ``budget`` as few as meet each ``target`` (``"accel-scale=500"``). ``aim`` is how well a person takes a pose, degrees. The reference is by default ``"table"``, with a prior ``"gravity"``.
    """
    options = dict(
        n=n, budget=budget, prior=prior, aim=aim, target=target, sensor=sensor, reference=reference, table=table,
        dwell=dwell, rates=rates, slew=slew, settle=settle, sigma=sigma, noise=noise, instability=instability, walk=walk, seed=seed,
    )
    return Design(_mimu.design(arguments(options)))


def next_experiment(
    effects: str | Sequence[str],
    *,
    after: Recording | str | os.PathLike[str] | None = None,
    chamber: tuple[float, float, float] | None = None,
    reference: Reference = "table",
    table: Table | None = None,
    dwell: float | None = None,
    rates: str | None = None,
    slew: float | None = None,
    settle: float | None = None,
    noise: float | str | os.PathLike[str] | None = None,
    seed: int | None = None,
) -> NextExperiment:
    """The smallest experiment that shows ``effects``, by their ids, as ``mimu design --effects`` finds it.

    ``after`` is a recording of the unit, for its noise, sensors, rates and fixture. ``chamber`` has three temperatures in degrees Celsius:
    where it begins and ends, and the two farthest from it. The others are those of :func:`mimu.design`.
    """
    options = dict(
        effects=[effects] if isinstance(effects, str) else list(effects), chamber=chamber and ",".join(map(str, chamber)), reference=reference,
        table=table, dwell=dwell, rates=rates, slew=slew, settle=settle, noise=noise, seed=seed,
    )
    with tempfile.TemporaryDirectory(prefix="mimu-") as folder:
        # The command reads recordings from disk, so arrays are saved first.
        if isinstance(after, Recording):
            after = after.directory or after.save(os.path.join(folder, "after"))
        return NextExperiment(_mimu.design(arguments({**options, "after": after})))
