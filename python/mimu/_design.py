"""The design of an experiment."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Literal

from mimu import _mimu
from mimu._arguments import arguments
from mimu._result import Array, Result, typed


@dataclass(frozen=True)
class ParameterSigma:
    """How well a parameter is determined."""

    name: str
    #: Standard deviation, and half of the 95 % interval, in ``unit``; infinite ones are not a number.
    value: float
    half_width_95: float
    #: SI; "1" for a ratio.
    unit: str


class Design(Result):
    """Which attitudes, and how well they determine the parameters."""

    _native: _mimu.Design

    title: str
    #: Direction in the body frame that points up, a row for each dwell, in order.
    positions: Array
    #: Rate about the vertical in each dwell, deg/s; None of an accelerometer.
    rates_dps: Array | None
    #: 1 is the best possible, 0 singular.
    d_efficiency: float
    sigma_per_parameter: list[ParameterSigma]
    dwell_s: float
    #: All dwells and moves.
    time_s: float
    #: Parameters that it does not determine.
    undetermined: list[str]

    def __init__(self, native: _mimu.Design) -> None:
        super().__init__(native)
        data = self.to_dict()
        self.title = data["title"]
        self.positions = typed(Array, data["positions"]).reshape(-1, 3)
        self.rates_dps = typed(Array, data["rates_dps"]) if "rates_dps" in data else None
        self.d_efficiency = data["d_efficiency"]
        self.sigma_per_parameter = [typed(ParameterSigma, sigma) for sigma in data["sigma_per_parameter"]]
        self.dwell_s = data["dwell_s"]
        self.time_s = data["time_s"]
        self.undetermined = data["undetermined"]

    def to_toml(self) -> str:
        """The plan that ``mimu design -o`` writes, for a table or a person to carry out."""
        return self._native.plan()

    def __str__(self) -> str:
        return self._native.text()

    def __repr__(self) -> str:
        return f"<mimu.Design: {self.title}, D-efficiency {self.d_efficiency:.3f}>"


def design(
    *,
    n: int | None = None,
    budget: float | None = None,
    scheme: Literal["six-face", "fang-nine", "xu-33", "xu-rates", "niu-8"] | None = None,
    sensor: Literal["gyro", "accel"] = "accel",
    reference: Literal["table", "gravity"] = "table",
    model: str | None = None,
    table: Literal["three-axis", "two-axis", "faces", "hand"] | None = None,
    dwell: float | None = None,
    order: Literal["shortest", "randomised"] | None = None,
    rates: str | None = None,
    slew: float | None = None,
    settle: float | None = None,
    sigma: float | None = None,
    noise: float | str | os.PathLike[str] | None = None,
    instability: float | None = None,
    walk: float | None = None,
    seed: int | None = None,
) -> Design:
    """Designs an experiment, as ``mimu design`` does: the best ``n`` dwells, the best within ``budget`` minutes, or a published ``scheme``.

    ``dwell`` and ``settle`` are in seconds, ``slew`` and ``rates`` in deg/s (``"10,100,300"``, or ``"..300"`` for any up to 300), ``sigma``,
    ``instability``, ``walk`` and a number as ``noise`` in SI; ``noise`` may also be a noise file. ``model`` lists terms: ``"affine,cubic"``.
    """
    options = dict(
        n=n, budget=budget, scheme=scheme, sensor=sensor, reference=reference, model=model, table=table, dwell=dwell, order=order,
        rates=rates, slew=slew, settle=settle, sigma=sigma, noise=noise, instability=instability, walk=walk, seed=seed,
    )
    return Design(_mimu.design(arguments(options)))
