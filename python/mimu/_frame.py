"""Results as tables of pandas, which is imported only when a table is asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

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


def of_curves(curves: Sequence[Mapping[str, Any]]) -> Any:
    """Curves below each other; what is one word of a curve stands in each of its rows."""
    import pandas

    tables = [pandas.DataFrame({name: np.asarray(values) if np.ndim(values) else values for name, values in curve.items()}) for curve in curves]
    return pandas.concat(tables, ignore_index=True) if tables else pandas.DataFrame()
