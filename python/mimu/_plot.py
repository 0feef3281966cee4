"""Axes of matplotlib, which is imported only when a plot is asked for."""

from __future__ import annotations

from typing import Any


def axes(ax: Any) -> Any:
    """The given axes, or new ones."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]
