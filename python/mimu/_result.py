"""What all results share: the JSON of the command as typed objects."""

from __future__ import annotations

import functools
import json
import os
import types
import warnings
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, ClassVar, Protocol, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from mimu._mimu import Calibration, Noise

Array = NDArray[np.float64]
T = TypeVar("T")


@dataclass(frozen=True)
class Judgement:
    """Whether a result may be used, with the one reason."""

    #: ``"good"``, ``"untested"`` (the data cannot contradict it), ``"suspect"`` (unit, rate, sign, range or columns of the input), ``"unexplained"``
    #: (errors beyond the noise) or ``"misfit"`` (the model does not describe the readings).
    kind: str
    reason: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.reason}"


class Message(str):
    """A warning: the sentence, with its kind and what it is about. Programs rely on the kind and not on the sentence."""

    #: As in ``"gaps"`` or ``"clipped"``.
    kind: str
    #: The sensor or channel: ``"gyro"``, ``"accel_x"``; None if it is about the whole.
    about: str | None

    def __new__(cls, message: str, kind: str = "", about: str | None = None) -> Message:
        made = super().__new__(cls, message)
        made.kind, made.about = kind, about
        return made

    def __getnewargs__(self) -> tuple[str, str, str | None]:  # type: ignore[override]
        return str(self), self.kind, self.about


class Native(Protocol):
    """A result of the compiled part."""

    def json(self) -> str: ...
    def html(self) -> str: ...
    @property
    def text(self) -> Any: ...


class OfCalibration(Native, Protocol):
    """One that gives a calibration."""

    def calibration(self) -> Calibration: ...


class OfNoise(Native, Protocol):
    """One that gives noise."""

    def noise(self) -> Noise: ...


class _Kept:
    """What the compiled part of a result answered: what a pickle keeps of it."""

    def __init__(self, answers: dict[str, Any]) -> None:
        self._answers = answers

    def __getattr__(self, question: str) -> Callable[..., Any]:
        answers = self.__dict__.get("_answers", {})
        if question not in answers:
            raise AttributeError(question)
        # The only argument that a question has is `everything`, of a diagnosis.
        return lambda *arguments: answers[question][bool(arguments and arguments[0])]


def _unpickled(cls: type[Result], answers: dict[str, Any]) -> Result:
    with warnings.catch_warnings():
        # Its maker was warned.
        warnings.simplefilter("ignore")
        return cls(cast(Any, _Kept(answers)))


class Result:
    """A result of mimu. Attributes have their units in their names, or in ``unit`` beside them."""

    _native: Native

    def __init__(self, native: Any) -> None:
        """The public attributes of the class are the keys of this name in the JSON, as their types say."""
        self._native = native
        self._json = native.json()
        data = self.to_dict()
        for name, hint in _hints(cast(Any, type(self))):
            setattr(self, name, _value(hint, data.get(name)))
        self._fill(data)

    def _fill(self, data: dict[str, Any]) -> None:
        """Attributes that the JSON has in another form."""

    #: Questions to the compiled part, without arguments; a pickle keeps their answers.
    _questions: ClassVar[tuple[str, ...]] = ("json", "text", "html")

    def to_dict(self) -> dict[str, Any]:
        """The whole result: the JSON that the command writes. NaN becomes None."""
        return cast(dict[str, Any], json.loads(self._json))

    def __reduce__(self) -> tuple[Any, ...]:
        answers = {}
        for question in self._questions:
            ask = getattr(self._native, question)
            answers[question] = (ask(False), ask(True)) if question == "text" and self._texts else (ask(), None)
        return _unpickled, (type(self), answers)

    #: Whether the text is asked for with ``everything`` or without.
    _texts: ClassVar[bool] = False

    def _repr_html_(self) -> str:
        """Tables and plots for a notebook, as self-contained HTML."""
        return self._native.html()

    def __str__(self) -> str:
        return cast(str, self._native.text())


class Judged(Result):
    """A result with a judgement. One that is suspect is also a warning of Python, because its numbers look good."""

    #: Whether it may be used.
    judgement: Judgement

    def __init__(self, native: Any) -> None:
        super().__init__(native)
        if self.judgement.kind == "suspect":
            # Its reader has called a function that has called this.
            warnings.warn(str(self.judgement), stacklevel=3)


class GivesCalibration(Judged):
    """A result with a calibration."""

    _native: OfCalibration
    _questions: ClassVar[tuple[str, ...]] = ("json", "text", "html", "calibration")

    device: str

    @property
    def calibration(self) -> Calibration:
        """The calibration, to apply, save or export: with the effects, the curves or the intervals of the next power-on that were found."""
        return self._native.calibration()

    def to_toml(self) -> str:
        """The calibration file that the command's ``-o`` writes."""
        return self.calibration.to_toml()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the calibration file, as the command's ``-o`` does: whole or not at all."""
        self.calibration.save(path)


class GivesNoise(Judged):
    """A result with noise."""

    _native: OfNoise
    _questions: ClassVar[tuple[str, ...]] = ("json", "text", "html", "noise")

    device: str

    @property
    def noise(self) -> Noise:
        """The argument ``noise`` of :func:`mimu.fit`, :func:`mimu.export` and others."""
        return self._native.noise()

    def to_toml(self) -> str:
        """The noise file that the command's ``-o`` writes."""
        return self.noise.to_toml()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the noise file, as the command's ``-o`` does: whole or not at all."""
        self.noise.save(path)


def typed(cls: type[T], data: Any) -> T:
    """``data`` of a JSON as a ``cls``."""
    return cast(T, _value(cls, data))


def _value(hint: Any, data: Any) -> Any:
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        # One side of each union here is None.
        (inner,) = (a for a in args if a is not type(None))
        return None if data is None else _value(inner, data)
    if origin is np.ndarray:
        return np.array(data if data is not None else [], dtype=np.float64)
    if origin is list:
        return [_value(args[0], item) for item in data or []]
    if origin is tuple:
        return tuple(_value(of, item) for of, item in zip(args, data, strict=True))
    if origin is dict:
        named = {item["name"]: item for item in data} if isinstance(data, list) else data or {}
        return {key: _value(args[1], item) for key, item in named.items()}
    if hint is float:
        return float("nan") if data is None else float(data)
    if hint is Message:
        return Message(data["text"], data["kind"], data.get("about"))
    if isinstance(hint, type) and is_dataclass(hint):
        return hint(**{name: _value(of, data.get(name)) for name, of in _hints(hint)})
    return data


@functools.cache
def _hints(cls: type) -> list[tuple[str, Any]]:
    """Fields of a dataclass, or public attributes of a result, with their types; Python evaluates their text at each call."""
    hints = get_type_hints(cls)
    names = [f.name for f in fields(cls) if f.init] if is_dataclass(cls) else [name for name in hints if not name.startswith("_")]
    return [(name, hints[name]) for name in names]
