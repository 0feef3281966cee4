"""Results on axes of matplotlib, which is imported only when a plot is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mimu._error import Error

if TYPE_CHECKING:
    from mimu._allan import Allan
    from mimu._fit import Fit
    from mimu.thermal import Curve


def _axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]


def residuals(fit: Fit, sensor: str, ax: Any) -> Any:
    """The size of each residual, held out where it was, and the noise that is due."""
    of = getattr(fit, sensor)
    if of is None:
        raise Error.of("sensor", f"the fit has no {sensor}", "give one that was fitted")
    ax = _axes(ax)
    at = np.arange(len(of.residuals))
    held = [r.held_out is not None for r in of.residuals]
    size = [float(np.linalg.norm(r.held_out if r.held_out is not None else r.value)) for r in of.residuals]
    ax.plot(at, size, "o", label="held out" if all(held) and held else "residual")
    ax.plot(at, [r.floor for r in of.residuals], "_", color="0.5", label="noise")
    # A label for each is unreadable beyond a few dozen.
    every = max(1, len(at) // 20)
    ax.set_xticks(at[::every], [str(r.step) for r in of.residuals][::every])
    ax.set(xlabel="dwell", ylabel=f"error of the {sensor}, {of.unit}", yscale="log")
    ax.legend()
    return ax


def deviations(allan: Allan, sensor: str, ax: Any) -> Any:
    """Deviations with their intervals, double logarithmic."""
    channels = [channel for channel in allan.channels if channel.name.startswith(sensor)]
    if not channels:
        raise Error.of("sensor", f"the noise lacks channels of the {sensor}", "give gyro or accel")
    ax = _axes(ax)
    for channel in channels:
        (line,) = ax.loglog(channel.tau_s, channel.adev, label=channel.name)
        ax.fill_between(channel.tau_s, channel.lower, channel.upper, color=line.get_color(), alpha=0.2, linewidth=0)
    ax.set(xlabel="averaging time, s", ylabel=f"deviation, {channels[0].unit}")
    ax.grid(which="both", alpha=0.3)
    ax.legend()
    return ax


def curve(of: Curve, ax: Any) -> Any:
    """A parameter over the temperature of the die, with its band."""
    ax = _axes(ax)
    (line,) = ax.plot(of.temp_c, of.value, label=of.name)
    ax.fill_between(of.temp_c, of.lower, of.upper, color=line.get_color(), alpha=0.2, linewidth=0)
    ax.set(xlabel="temperature of the die, °C", ylabel=f"{of.name}, {of.unit}")
    return ax
