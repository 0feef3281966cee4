"""Keywords as the arguments of the command."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any


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
    return isinstance(value, Sequence) and not isinstance(value, str)


def _text(value: Any) -> str:
    # The shortest text that is read as the same number.
    return repr(float(value)) if isinstance(value, float) else os.fspath(value) if isinstance(value, os.PathLike) else str(value)
