"""Writes what is observed, one JSON array a line, as it happens."""

from __future__ import annotations

import time
from typing import BinaryIO

import msgspec

from lab2_grader.records import Event


class Recorder:
    """Keeps the scene's clock and writes rows to *out*."""

    def __init__(self, out: BinaryIO) -> None:
        self._out = out
        self._encoder = msgspec.json.Encoder()
        self._began = time.monotonic()

    def begin(self) -> None:
        """The scene begins now."""
        self._began = time.monotonic()

    def now(self) -> float:
        """Seconds since the scene began."""
        return round(time.monotonic() - self._began, 4)

    def write(self, row: Event) -> None:
        """Record *row*."""
        self._out.write(self._encoder.encode(row) + b"\n")

    def flush(self) -> None:
        """Hand over what was recorded so far."""
        self._out.flush()
