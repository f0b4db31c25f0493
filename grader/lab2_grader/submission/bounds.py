"""Counts what is taken in against the limits, judges names, and is the only writer of what is taken over."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol

from lab2_grader import lab
from lab2_grader.errors import FaultError
from lab2_grader.messages import refusal

CHUNK = 64 * 1024  # bytes read at once, of anything

_RATIO_FROM = 1_000_000  # bytes below which no ratio is judged: a page of zeros is no bomb
_COMPONENT_BYTES = 255  # what Linux file systems allow
_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")


class Readable(Protocol):
    """Whatever can be read piece by piece."""

    def read(self, size: int, /) -> bytes | None:
        """At most *size* bytes; none at the end."""


class Bounds:
    """What has been taken in of one submission so far, against `intake` of the limits.

    Args:
        packed_bytes: Size of the archive that is being unpacked; None when there is none and no ratio to be judged.
    """

    def __init__(self, packed_bytes: int | None = None) -> None:
        self.limits = lab.limits().intake
        self._packed = packed_bytes
        self._members = 0
        self._bytes = 0

    def member(self) -> None:
        """One more file or folder.

        Raises:
            RefusedError: There are too many.
        """
        self._members += 1
        if self._members > self.limits.members:
            raise refusal("too-many-files", limit=self.limits.members)

    def expect(self, size: int) -> None:
        """*size* more bytes are announced; nothing is counted yet.

        Raises:
            RefusedError: They are too many.
        """
        if self._bytes + size > self.limits.unpacked_bytes:
            raise refusal("too-large", limit=self.limits.unpacked_bytes // 1_000_000)

    def took(self, size: int) -> None:
        """*size* more bytes were read, whatever was announced.

        Raises:
            RefusedError: They are too many, or far more than the archive can honestly hold.
        """
        self._bytes += size
        self.expect(0)
        if self._packed is not None and self._bytes > max(_RATIO_FROM, self._packed * self.limits.ratio):
            raise refusal("archive-bomb", limit=self.limits.ratio)

    def counted(self, source: Readable) -> Iterator[bytes]:
        """What *source* holds, piece by piece, each counted before it is handed on."""
        while piece := source.read(CHUNK):
            self.took(len(piece))
            yield piece

    def check_name(self, name: str) -> None:
        """Judge *name*, a path relative to the top of what is taken in.

        Raises:
            RefusedError: It is not UTF-8, has control characters (line ends among them), or is too long.
        """
        try:
            size = len(name.encode())
        except UnicodeEncodeError:
            raise refusal("name-not-utf8", name=name) from None
        if _CONTROL.search(name):
            raise refusal("name-control", name=_CONTROL.sub("?", name))
        if size > self.limits.path_length or any(len(part.encode()) > _COMPONENT_BYTES for part in name.split("/")):
            raise refusal("name-too-long", name=name[:60], limit=self.limits.path_length)


class Destination:
    """An empty folder that is filled with regular files and folders of ordinary modes, and nothing else.

    Two names that differ only in case are two files here, as they are for Python and colcon on Linux.

    Args:
        root: The folder; made when it is not there.

    Raises:
        FaultError: It cannot be made.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.files: dict[str, None] = {}
        self._folders: set[str] = set()
        try:
            root.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise _fault(self.root, error) from error

    def folder(self, path: str) -> None:
        """Make the folder *path* and those above it.

        Raises:
            RefusedError: A file of that name is there.
            FaultError: The machine does not let us.
        """
        if path in self._folders or path in ("", "."):
            return
        self.folder(path.rpartition("/")[0])
        if path in self.files:
            raise refusal("name-twice", name=path)
        try:
            (self.root / path).mkdir()
        except OSError as error:
            raise _fault(self.root, error) from error
        self._folders.add(path)

    def file(self, path: str, pieces: Iterable[bytes], executable: bool) -> None:
        """Write the file *path*.

        Raises:
            RefusedError: There is a file or folder of that name already.
            FaultError: The machine does not let us: no space, no permission.
        """
        self.folder(path.rpartition("/")[0])
        if path in self.files or path in self._folders:
            raise refusal("name-twice", name=path)
        try:
            descriptor = os.open(self.root / path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC)
        except OSError as error:
            raise _fault(self.root, error) from error
        self.files[path] = None
        with open(descriptor, "wb", buffering=0) as target:
            for piece in pieces:  # what goes wrong in here is the reader's, not ours
                try:
                    rest = memoryview(piece)
                    while rest:
                        rest = rest[target.write(rest) :]
                except OSError as error:
                    raise _fault(self.root, error) from error
            os.fchmod(descriptor, 0o755 if executable else 0o644)


def _fault(root: Path, error: OSError) -> FaultError:
    return FaultError(f"The submission could not be copied to {root}: {error.strerror or error}.", "submission")
