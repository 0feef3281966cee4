"""Results as tables of pandas, which is imported only when a table is asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from mimu._diagnosis import Effect
    from mimu._fit import SensorFit
    from mimu._mimu import Recording


def of_recording(recording: Recording) -> Any:
    """The samples, in the columns of a file."""
    import pandas

    columns: dict[str, Any] = {"t_s": recording.t}
    for name in ("step", "temp_c"):
        if (values := getattr(recording, name)) is not None:
            columns[name] = values
    triads = [("gyro", "{}_{}"), ("accel", "{}_{}"), ("ref_rate_dps", "ref_rate_{1}_dps"), ("ref_force_mps2", "ref_force_{1}_mps2")]
    for name, named in triads:
        if (values := getattr(recording, name)) is not None:
            columns |= {named.format(name, axis): values[:, k] for k, axis in enumerate("xyz")}
    return pandas.DataFrame(columns)


def of_parameters(sensors: Mapping[str, SensorFit | None]) -> Any:
    """A row for each parameter of a fit."""
    import pandas

    rows = [
        {"sensor": sensor, "parameter": p.name, "value": p.value, "sigma": p.sigma, "lower": p.lower, "upper": p.upper, "unit": p.unit}
        for sensor, fit in sensors.items() if fit is not None for p in fit.parameters.values()
    ]
    return pandas.DataFrame(rows)


def of_effects(effects: Sequence[Effect]) -> Any:
    """A row for each coefficient of the effects."""
    import pandas

    names = ["effect", "sensor", "coefficient", "value", "sigma", "unit"]
    rows = [(e.id, e.sensor, c.name, c.value, c.sigma, c.unit) for e in effects for c in e.coefficients]
    return pandas.DataFrame(rows, columns=names)


def of_curves(curves: Sequence[Mapping[str, Any]]) -> Any:
    """Curves below each other; what is one word of a curve stands in each of its rows."""
    import pandas

    tables = [pandas.DataFrame({name: np.asarray(values) if np.ndim(values) else values for name, values in curve.items()}) for curve in curves]
    return pandas.concat(tables, ignore_index=True) if tables else pandas.DataFrame()
