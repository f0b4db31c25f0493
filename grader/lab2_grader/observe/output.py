"""Cuts a stream of output into lines and says which process printed each."""

from __future__ import annotations

from lab2_grader.reading import split_label
from lab2_grader.records import Line
from lab2_grader.text import clean


class OutputLines:
    """The lines of one stream.

    Args:
        stream: `stdout` or `stderr`.
        label: The executable that prints; empty when a launcher prints and labels the lines itself.
        line_bytes: How much of one line is kept; the rest of it is thrown away.
    """

    def __init__(self, stream: str, label: str, line_bytes: int) -> None:
        self._stream = stream
        self._label = label
        self._line_bytes = line_bytes
        self._rest = b""
        self._overlong = False

    def take(self, data: bytes, at: float) -> list[Line]:
        """The lines that *data* completes."""
        *complete, rest = (self._rest + data).split(b"\n")
        lines = (
            [self._line(raw, at) for raw in complete[1:]] if self._overlong else [self._line(r, at) for r in complete]
        )
        if complete:
            self._overlong = False
        self._rest = rest
        if len(rest) > self._line_bytes:
            if not self._overlong:
                lines.append(self._line(rest, at))
            self._overlong = True
            self._rest = b""
        return lines

    def rest(self, at: float) -> list[Line]:
        """What stands there without an end of line, as a line."""
        raw, self._rest = self._rest, b""
        return [self._line(raw, at)] if raw and not self._overlong else []

    def _line(self, raw: bytes, at: float) -> Line:
        text = clean(raw[: self._line_bytes].decode(errors="replace").rstrip("\r"), self._line_bytes)
        source, text = (self._label, text) if self._label else split_label(text)
        return Line(at, source, self._stream, text)
