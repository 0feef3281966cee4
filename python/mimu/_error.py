"""What mimu refuses."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence


class Error(ValueError):
    """Something that mimu refuses, in one line: where, what is wrong, and what to do.

    ``kind`` is ``"io"`` (the operating system refused a file), ``"undetermined"`` (the experiment does not determine
    what was asked for), ``"device"`` or ``"invalid"``. ``place``, ``problem`` and ``remedy`` are the parts of the line.
    ``file``, ``row`` and ``column`` are what ``place`` names, or None.
    """

    __module__ = "mimu"

    def __init__(
        self,
        message: str,
        *,
        kind: str = "invalid",
        place: str = "",
        problem: str = "",
        remedy: str = "",
        file: str | None = None,
        row: int | None = None,
        column: str | None = None,
    ) -> None:
        super().__init__(message)
        self.kind = kind
        self.place = place
        self.problem = problem
        self.remedy = remedy
        self.file = file
        self.row = row
        self.column = column

    def __reduce__(self) -> tuple[object, ...]:
        # Without this, another process would receive only the message.
        return (type(self), self.args, self.__dict__)

    @classmethod
    def of(cls, place: str, problem: str, remedy: str, kind: str = "invalid", flags: Sequence[str] = ()) -> Error:
        """Of the parts of an error of the command, and the options that it is about."""
        place, problem, remedy = keywords(place), keywords(problem), keywords(remedy)
        settings = [f'{keywords(name)}={value and repr(value)}' for flag in flags for name, value in re.findall(r"(--[a-z-]+)(?: (given|found|line))?", flag)]
        if said := [setting for setting in settings if setting.split("=")[0] not in remedy]:
            remedy += f" ({', '.join(said)})"
        file, *parts = place.split(", ")
        # A data row is counted without the header, a row is a line of an editor.
        row = re.search(r", (?:data )?row (\d+)", place)
        column = re.search(r", (?:column )?((?<=column )[^,]+|t_s)", place)
        return cls(
            f"{place}: {problem}; {remedy}", kind=kind, place=place, problem=problem, remedy=remedy, file=file or None, row=int(row[1]) if row else None,
            column=column[1] if column else None,
        )


#: Keywords that are not called as the option.
_NAMES = {"class": "part_class", "from": "from_s", "to": "to_s", "lag": "lag_s", "range": "range_c"}


def keywords(text: str) -> str:
    """A text of the command with keywords in place of its options, and the call in place of a command that is to be completed."""
    text = re.sub(r"(?<=say it: )mimu import .*", lambda line: _call(line[0]), text)
    text = re.sub(r"mimu import(?= --)", "mimu.read", text)
    text = re.sub(r"'(--[a-z-]+)(?:[ =\[]+<[^']*)?'", r"\1", text)
    return re.sub(r"(?<![\w-])--([a-z][a-z-]*)", lambda option: _NAMES.get(option[1], option[1].replace("-", "_")), text)


def _call(line: str) -> str:
    """``mimu import log.csv -o DIR --units UNITS`` as ``mimu.read("log.csv", units="UNITS")``; what follows, as a choice in words, stays."""
    words = shlex.split(line)[2:]
    arguments: list[str] = []
    while words:
        word = words.pop(0)
        if word == "-o":
            words.pop(0)
        elif word.startswith("--"):
            arguments.append(keywords(word) + (f'="{words.pop(0)}"' if words and not words[0].startswith("-") else "=True"))
        elif any(argument.count("=") for argument in arguments):
            return f"mimu.read({', '.join(arguments)}) {' '.join([word, *words])}"
        else:
            arguments.append(f'"{word}"')
    return f"mimu.read({', '.join(arguments)})"
