"""What mimu refuses."""

from __future__ import annotations


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
