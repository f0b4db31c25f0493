"""A real terminal: bash behind a pseudo-terminal, typed into and read from as a person would."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import termios
import time
from collections.abc import Mapping
from types import TracebackType

_PROMPT = "<|ready {}|>"
_READY = re.compile(r"<\|ready (\d+)\|>")
_ESCAPES = re.compile(r"\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)|\x1b\[[0-?]*[ -/]*[@-~]|\x1b[=>()][0-9A-Za-z]?")
_CHUNK = 65_536


class Terminal:
    """One bash, with the environment given and nothing of the caller's start-up files.

    Args:
        env: The whole environment.
        cwd: Where it starts.
    """

    def __init__(self, env: Mapping[str, str], cwd: str) -> None:
        self._pid, self._fd = pty.fork()
        if self._pid == 0:  # pragma: no cover - the child
            os.chdir(cwd)
            os.execvpe("bash", ["bash", "--norc", "--noprofile", "--noediting"], {**env, "PS1": "", "PS2": ""})
        settings = termios.tcgetattr(self._fd)
        settings[3] &= ~termios.ECHO
        termios.tcsetattr(self._fd, termios.TCSANOW, settings)
        termios.tcsetwinsize(self._fd, (50, 120)) if hasattr(termios, "tcsetwinsize") else None
        self._raw = b""
        self.type("PS1='" + _PROMPT.format("$?") + "'")
        self.wait_for(_READY.pattern, 10)
        self.clear()

    def __enter__(self) -> Terminal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def text(self) -> str:
        """What stands on the screen since `clear`: no escape sequences, and of a rewritten line its last state."""
        plain = _ESCAPES.sub("", self._raw.decode(errors="replace")).replace("\r\n", "\n")
        return "\n".join(line.rstrip("\r").rpartition("\r")[2] for line in plain.split("\n"))

    @property
    def output(self) -> str:
        """`text` without the prompt."""
        return _READY.sub("", self.text)

    @property
    def code(self) -> int | None:
        """The exit code of the command typed last; None while it runs."""
        found = _READY.findall(self.text)
        return int(found[-1]) if found else None

    def clear(self) -> None:
        """Forget what was printed."""
        self._raw = b""

    def type(self, line: str) -> None:
        """Type *line* and press Enter."""
        os.write(self._fd, line.encode() + b"\n")

    def interrupt(self, seconds: float) -> bool:
        """Press Ctrl-C, and again as a person would, until the prompt is back or *seconds* are over; whether it is.

        One Ctrl-C can be lost: what arrives while bash is still starting a program interrupts neither.
        """
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            os.write(self._fd, b"\x03")
            if self.wait_ready(min(5.0, seconds)):
                return True
        return False

    def read(self, seconds: float) -> None:
        """Take in what is printed, for at most *seconds*."""
        ready, _, _ = select.select([self._fd], [], [], seconds)
        if ready:
            try:
                self._raw += os.read(self._fd, _CHUNK)
            except OSError:  # Linux says so when the other side is gone
                return

    def wait_for(self, pattern: str, seconds: float) -> bool:
        """Read until *pattern* is found or *seconds* are over; whether it was found."""
        deadline = time.monotonic() + seconds
        while not re.search(pattern, self.text, re.MULTILINE):
            left = deadline - time.monotonic()
            if left <= 0:
                return False
            self.read(min(left, 0.2))
        return True

    def wait_ready(self, seconds: float) -> bool:
        """Read until the prompt is back or *seconds* are over; whether it is back."""
        return self.wait_for(_READY.pattern, seconds)

    def close(self) -> None:
        """End bash and what still runs in it."""
        for number in (signal.SIGINT, signal.SIGHUP, signal.SIGKILL):
            try:
                os.kill(self._pid, number)
                for _ in range(20):
                    if os.waitpid(self._pid, os.WNOHANG)[0]:
                        os.close(self._fd)
                        return
                    self.read(0.05)
            except (ProcessLookupError, ChildProcessError):
                break
        os.close(self._fd)
