"""Arguments: keywords as options of the command, and objects or the files of them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias

from mimu import _mimu
from mimu._mimu import Calibration, Noise, Recording


class GivesCalibration(Protocol):
    """A result with a calibration: a fit, of one or several sessions or over temperature, or a diagnosis."""

    @property
    def calibration(self) -> Calibration:
        """The calibration."""


class GivesNoise(Protocol):
    """A result with noise: by the Allan deviation, or in use."""

    @property
    def noise(self) -> Noise:
        """The noise."""


#: A calibration, a result that gives one, or a file.
CalibrationLike: TypeAlias = Calibration | GivesCalibration | str | os.PathLike[str]
#: Noise, a result that gives it, or a file.
NoiseLike: TypeAlias = Noise | GivesNoise | str | os.PathLike[str]

Path: TypeAlias = str | os.PathLike[str]


def calibration_of(given: CalibrationLike, name: str = "calibration") -> Calibration:
    """The calibration that an argument gives."""
    made = _mimu.load_calibration(given) if isinstance(given, (str, os.PathLike)) else getattr(given, "calibration", given)
    if not isinstance(made, Calibration):
        raise TypeError(f"{name}: {type(given).__name__} gives no calibration; give a mimu.Calibration, a mimu.Fit or the path of a file")
    return made


def noise_of(given: NoiseLike | None) -> Noise | None:
    """The noise that the argument ``noise`` gives."""
    made = _mimu.load_noise(given) if isinstance(given, (str, os.PathLike)) else getattr(given, "noise", given)
    if made is not None and not isinstance(made, Noise):
        raise TypeError(f"noise: {type(given).__name__} gives no noise; give a mimu.Noise, a mimu.Allan or the path of a file")
    return made


def several(recordings: Recording | Sequence[Recording], name: str = "recordings") -> list[Recording]:
    """One recording, or more, as a list."""
    every = [recordings] if isinstance(recordings, Recording) else recordings
    if not (_is_list(every) and all(isinstance(each, Recording) for each in every)):
        raise TypeError(f"{name}: {type(recordings).__name__} is not a recording; give a mimu.Recording or a list of them")
    return list(every)


def kept(keep: Any) -> str | None:
    """The dwells that are kept, as the command takes them."""
    return keep if keep is None or isinstance(keep, str) else ",".join(map(str, keep))


def arguments(options: Mapping[str, Any]) -> list[str]:
    """``rate_hz=50`` as ``--rate-hz=50``. A list repeats the option, a mapping repeats it with ``KEY=VALUE``, once for each value if they are a list;
    None and False are left out."""
    out: list[str] = []
    for key, value in options.items():
        flag = f"-{key}" if len(key) == 1 else "--" + key.rstrip("_").replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            out.append(flag)
        elif isinstance(value, Mapping):
            out += [f"{flag}={k}={_text(v)}" for k, each in value.items() for v in (each if _is_list(each) else [each])]
        elif _is_list(value):
            out += [f"{flag}={_text(item)}" for item in value]
        else:
            out.append(f"{flag}={_text(value)}")
    return out


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _text(value: Any) -> str:
    # The shortest text that is read as the same number.
    return repr(float(value)) if isinstance(value, float) else os.fspath(value) if isinstance(value, os.PathLike) else str(value)
