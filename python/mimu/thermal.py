"""Curves over temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mimu import _frame, _mimu, _plot
from mimu._arguments import CalibrationLike, NoiseLike, arguments, calibration_of, noise_of, several
from mimu._fit import Steps
from mimu._mimu import Recording
from mimu._result import Array, GivesCalibration, Message


@dataclass(frozen=True)
class Curve:
    """A parameter over the temperature of the die, with its 95 % band."""

    name: str
    sensor: str
    #: Unit of value and bounds.
    unit: str
    temp_c: Array
    value: Array
    lower: Array
    upper: Array


@dataclass(frozen=True)
class Lag:
    """Time constant of the die behind the thermometer, s, with its 95 % interval."""

    value: float
    lower: float
    upper: float


@dataclass(frozen=True)
class SensorThermal:
    """Figures of one triad."""

    #: Unit of the errors.
    unit: str
    rms: float | None
    held_out_rms: float | None
    noise_floor: float | None
    #: None if it is unknown, with the reason in ``lag_reason``.
    lag_s: Lag | None
    lag_reason: str | None


class ThermalFit(GivesCalibration):
    """All parameters over temperature, and the lag of the dies behind the thermometer."""

    _native: _mimu.ThermalFit

    #: ``"fitted"``, ``"one-way"`` or ``"misfit"``.
    verdict: str
    #: Lowest and highest temperature of the dies, degrees Celsius.
    range_c: tuple[float, float]
    sensors: dict[str, SensorThermal]
    #: By sensor and parameter: ``gyro_bias_x``, ``accel_C_xx``.
    curves: dict[str, Curve]
    #: Warnings, one sentence each, with its ``kind``.
    warnings: list[Message]

    def to_dataframe(self) -> Any:
        """The curves as a table of pandas: a row for each parameter and temperature."""
        return _frame.of_curves(
            [{"parameter": c.name, "sensor": c.sensor, "temp_c": c.temp_c, "value": c.value, "lower": c.lower, "upper": c.upper, "unit": c.unit}
             for c in self.curves.values()]
        )

    def plot(self, parameter: str = "gyro_bias_x", ax: Any = None) -> Any:
        """A curve with its 95 % band, by its name in ``curves``, on axes of matplotlib: on ``ax``, or on axes of its own, which it returns."""
        of = self.curves[parameter]
        ax = _plot.axes(ax)
        (line,) = ax.plot(of.temp_c, of.value, label=of.name)
        ax.fill_between(of.temp_c, of.lower, of.upper, color=line.get_color(), alpha=0.2, linewidth=0)
        ax.set(xlabel="temperature of the die, °C", ylabel=f"{of.name}, {of.unit}")
        return ax

    def __repr__(self) -> str:
        return f"<mimu.thermal.ThermalFit of {self.device!r}: {self.verdict}, {self.range_c[0]:.1f} to {self.range_c[1]:.1f} °C>"


def fit(
    recordings: Recording | Sequence[Recording],
    *,
    verify: Recording | Sequence[Recording] = (),
    lag_s: float | None = None,
    range_c: tuple[float, float] | None = None,
    base: CalibrationLike | None = None,
    noise: NoiseLike | None = None,
    still: float | None = None,
    steps: Steps | None = None,
    at_rest: bool = False,
) -> ThermalFit:
    """Estimates all parameters over temperature, as ``mimu thermal fit`` does.

    ``recordings`` belong to one unit, one for each power-on. Recordings in ``verify`` only judge the result. ``lag_s`` is the lag of the dies,
    if it is known. ``range_c`` are the temperatures that the curves must cover. ``base`` is the calibration at one temperature, to which
    recordings at rest add the change of the biases; ``at_rest``: the unit lay still throughout.
    """
    covered = None if range_c is None else "..".join(map(str, range_c))
    options = dict(lag=lag_s, range=covered, still=still, steps=steps, at_rest=at_rest)
    return ThermalFit(
        _mimu.thermal_fit(
            several(recordings), arguments(options), verify=several(verify, "verify"), base=None if base is None else calibration_of(base, "base"),
            noise=noise_of(noise),
        )
    )
