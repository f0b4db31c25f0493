"""Prints as `ros2 launch` does: the launcher's own lines, and what the launched processes print."""

from __future__ import annotations

import os
import sys

from . import api

TYPE_CHECKING = False
if TYPE_CHECKING:
    import logging
    from collections.abc import Callable

STDOUT, STDERR = 1, 2
LINE_BYTES = 16_384  # of one line of a process; the rest of a longer one is thrown away
_REFUSAL = api.MARK.encode()
_CUT = b" [line cut by the launcher]"


class ReaderGone(OSError):
    """Nobody reads our output any more."""


def write(fd: int, data: bytes) -> None:
    """Write all of *data* to *fd*.

    Raises:
        ReaderGone: Nobody reads it any more.
    """
    view = memoryview(data)
    try:
        while view:
            view = view[os.write(fd, view) :]
    except OSError as error:
        raise ReaderGone(error.errno, error.strerror) from error


def log(level: str, name: str, message: str) -> None:
    """Print a line of the launcher: `[INFO] [launch]: …`."""
    write(STDOUT, f"[{level}] [{name}]: {message}\n".encode(errors="replace"))


def get_logger(name: str | None = None) -> logging.Logger:
    """A logger for launch files that log by themselves (`launch.logging.get_logger`)."""
    import logging

    logger = logging.getLogger(name)
    if not logger.handlers:
        handler = logging.StreamHandler(sys.stdout)
        handler.setFormatter(logging.Formatter("[{levelname}] [{name}]: {msg}", style="{"))
        logger.addHandler(handler)
        logger.propagate = False
        if logger.level == logging.NOTSET:
            logger.setLevel(logging.INFO)
    return logger


class Lines:
    """Cuts what one stream of a process prints into lines and prints them with the process's name before each.

    Args:
        fd: Where the lines go.
        prefix: What stands before each line.
        decorate: Makes the printed line of the line instead, when the launch file has an `output_format` of its own.
    """

    def __init__(self, fd: int, prefix: str, decorate: Callable[[str], str] | None = None) -> None:
        self._fd = fd
        self._prefix = prefix.encode(errors="replace")
        self._decorate = decorate
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> None:
        """Take *data* over and print the lines that are complete."""
        if self._skipping:
            _, newline, data = data.partition(b"\n")
            if not newline:
                return
            self._skipping = False
        lines = (self._rest + data).split(b"\n")
        self._rest = lines.pop()
        printed = [self._printed(line) for line in lines]
        if len(self._rest) > LINE_BYTES:
            printed.append(self._printed(self._rest))
            self._rest = b""
            self._skipping = True
        if printed:
            write(self._fd, b"".join(printed))

    def flush(self) -> None:
        """Print the last line, though no newline ends it."""
        if self._rest:
            write(self._fd, self._printed(self._rest))
        self._rest = b""
        self._skipping = False

    def _printed(self, line: bytes) -> bytes:
        if self._fd == STDERR and line.startswith(_REFUSAL):  # of bin/ros2, or of a launcher that it has started
            api.refuse(line[len(_REFUSAL) : LINE_BYTES].decode(errors="replace"))
        if len(line) > LINE_BYTES:
            line = line[:LINE_BYTES] + _CUT
        if self._decorate is not None:
            return self._decorate(line.decode(errors="replace")).encode(errors="replace") + b"\n"
        if not line.isascii():
            line = line.decode(errors="replace").encode()
        return self._prefix + line + b"\n"


def log_directory() -> str:
    """Make and name a directory for log files as `ros2 launch` does, below ROS_LOG_DIR, ROS_HOME or `~/.ros`.

    It stays empty: what is printed is all there is. Where it cannot be made it is only named.
    """
    import time
    from contextlib import suppress

    base = os.environ.get("ROS_LOG_DIR") or os.path.join(os.environ.get("ROS_HOME") or "~/.ros", "log")
    now = time.time_ns()
    stamp = time.strftime("%Y-%m-%d-%H-%M-%S", time.localtime(now // 1_000_000_000))
    name = f"{stamp}-{now // 1000 % 1_000_000:06d}-{os.uname().nodename}-{os.getpid()}"
    path = os.path.join(os.path.normpath(os.path.expanduser(base)), name)
    with suppress(OSError):
        os.makedirs(path, exist_ok=True)
    return path


class LaunchConfig:
    """`launch.logging.launch_config`: only the directory of the logs."""

    def __init__(self) -> None:
        self.log_dir = ""

    def __getattr__(self, name: str) -> object:
        api.missing_attribute(self, name)


launch_config = LaunchConfig()
