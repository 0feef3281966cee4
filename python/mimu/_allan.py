"""Noise of a unit at rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from mimu import _frame, _mimu, _plot
from mimu._arguments import CalibrationLike, arguments, calibration_of, several
from mimu._error import Error
from mimu._mimu import Recording
from mimu._result import Array, GivesNoise, Message


@dataclass(frozen=True)
class NoiseCoefficient:
    """A coefficient of the noise model with its interval."""

    value: float
    sigma: float
    lower: float
    upper: float
    unit: str


@dataclass(frozen=True)
class Channel:
    """Noise of one channel; deviations are in ``unit``."""

    name: str
    recording: str
    temp_c: float | None
    unit: str
    #: Samples that it was computed from.
    samples: int
    #: Averaging times, deviations and the ends of their intervals.
    tau_s: Array
    adev: Array
    lower: Array
    upper: Array
    #: White noise, bias instability, rate random walk, quantization and rate ramp; None with the reason in ``reasons``.
    n: NoiseCoefficient | None
    b: NoiseCoefficient | None
    k: NoiseCoefficient | None
    q: NoiseCoefficient | None
    r: NoiseCoefficient | None
    #: By the letter of a coefficient, why it is missing.
    reasons: dict[str, str]
    #: Averaging time beyond which none is better by more than 5 %.
    useful_average_s: float | None


class Allan(GivesNoise):
    """Allan deviation and noise model of a unit at rest."""

    _native: _mimu.Allan
    _questions = ("json", "text", "html", "svg", "noise")

    channels: list[Channel]
    #: Warnings, one sentence each, with its ``kind``.
    warnings: list[Message]

    def __getitem__(self, name: str) -> Channel:
        """The first channel of this name: ``gyro_x`` to ``accel_z``."""
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise KeyError(name)

    def to_dataframe(self) -> Any:
        """The curves as a table of pandas: a row for each channel and averaging time."""
        return _frame.of_curves(
            [{"channel": c.name, "recording": c.recording, "tau_s": c.tau_s, "adev": c.adev, "lower": c.lower, "upper": c.upper, "unit": c.unit}
             for c in self.channels]
        )

    def plot(self, sensor: Literal["gyro", "accel"] = "gyro", ax: Any = None) -> Any:
        """The deviations of a sensor with their intervals, on axes of matplotlib: on ``ax``, or on axes of its own, which it returns."""
        channels = [channel for channel in self.channels if channel.name.startswith(sensor)]
        if not channels:
            raise Error.of("sensor", f"the noise lacks channels of the {sensor}", "give gyro or accel")
        ax = _plot.axes(ax)
        for channel in channels:
            (line,) = ax.loglog(channel.tau_s, channel.adev, label=channel.name)
            ax.fill_between(channel.tau_s, channel.lower, channel.upper, color=line.get_color(), alpha=0.2, linewidth=0)
        ax.set(xlabel="averaging time, s", ylabel=f"deviation, {channels[0].unit}")
        ax.grid(which="both", alpha=0.3)
        ax.legend()
        return ax

    def svg(self) -> str:
        """The plot that ``mimu allan --plot`` writes."""
        return self._native.svg()

    def __repr__(self) -> str:
        return f"<mimu.Allan of {self.device!r}: {', '.join(channel.name for channel in self.channels)}>"


def allan(
    *recordings: Recording,
    from_s: float | None = None,
    to_s: float | None = None,
    step: int | None = None,
    kind: Literal["allan", "modified", "hadamard"] = "allan",
    per_decade: int = 10,
    confidence: float = 0.95,
    calibration: CalibrationLike | None = None,
) -> Allan:
    """Allan deviation and noise model of a unit at rest, as ``mimu allan`` computes them.

    Several recordings must belong to one unit, each at another temperature. ``from_s`` and ``to_s``, or a ``step``, choose a segment. With a
    ``calibration``, a result that gives one, or its file, readings in V or counts become SI.
    """
    options = {"from": from_s, "to": to_s, "step": step, "kind": kind, "per_decade": per_decade, "confidence": confidence}
    by = None if calibration is None else calibration_of(calibration)
    return Allan(_mimu.allan(several(recordings), arguments(options), calibration=by))
