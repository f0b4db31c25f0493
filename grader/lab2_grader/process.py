"""The only module that starts processes: a request goes in, an outcome comes out, and nothing is left running.

Every process gets a session of its own, a deadline on the monotonic clock and a cap on the output that is kept.
Stopping climbs a ladder: SIGINT to the process group, then SIGTERM, then SIGKILL; afterwards whatever is left of
its descendants is killed. Memory and number of processes are watched over the whole tree of descendants.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import resource
import selectors
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from lab2_grader import lab
from lab2_grader.errors import FaultError
from lab2_grader.records import EndedBy, Outcome, Request

POLL_SECONDS = 0.1
CHUNK_BYTES = 65_536
LAST_OUTPUT_SECONDS = 0.5  # how long output of an ended process is waited for
PAGE_BYTES = resource.getpagesize()
PR_SET_CHILD_SUBREAPER = 36

MARK = "LAB2_GRADER_RUN"  # a variable in the environment of every process of one run, to find strays by

OnOutput = Callable[[str, bytes], None]

_counter = itertools.count()


def become_reaper() -> None:
    """Let orphaned descendants come back to this process, so that they can be found and killed (`prctl(2)`)."""
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def environment(*names: str) -> tuple[tuple[str, str], ...]:
    """Those of the named variables that are set here, as a request's environment."""
    return tuple((name, os.environ[name]) for name in names if name in os.environ)


class ProcessInfo:
    """A line of the process table: `pid`, `parent`, `command` (its arguments) and `resident_bytes`."""

    __slots__ = ("command", "parent", "pid", "resident_bytes")

    def __init__(self, pid: int, parent: int, command: tuple[str, ...], resident_bytes: int) -> None:
        self.pid = pid
        self.parent = parent
        self.command = command
        self.resident_bytes = resident_bytes


def _stat(pid: int) -> tuple[int, int, int] | None:
    """(parent, threads, resident bytes) of *pid*, or None when it is gone or a zombie."""
    try:
        text = Path(f"/proc/{pid}/stat").read_bytes()
    except OSError:
        return None
    fields = text[text.rindex(b")") + 2 :].split()
    if fields[0] in (b"Z", b"X"):
        return None
    return int(fields[1]), int(fields[17]), int(fields[21]) * PAGE_BYTES


def _descendants(root: int) -> dict[int, tuple[int, int, int]]:
    """*root* and all its living descendants, with what `_stat` says of each."""
    table: dict[int, tuple[int, int, int]] = {}
    for entry in os.scandir("/proc"):
        if entry.name.isdigit() and (found := _stat(int(entry.name))) is not None:
            table[int(entry.name)] = found
    children: dict[int, list[int]] = {}
    for pid, (parent, _, _) in table.items():
        children.setdefault(parent, []).append(pid)
    tree: dict[int, tuple[int, int, int]] = {}
    pending = [root]
    while pending:
        pid = pending.pop()
        if pid in table and pid not in tree:
            tree[pid] = table[pid]
        pending.extend(children.pop(pid, ()))
    return tree


def tree(root: int) -> tuple[ProcessInfo, ...]:
    """The living processes below and including *root*, by pid, each with its arguments."""
    found = []
    for pid, (parent, _, resident) in sorted(_descendants(root).items()):
        try:
            raw = Path(f"/proc/{pid}/cmdline").read_bytes()
        except OSError:
            continue
        command = tuple(part.decode(errors="replace") for part in raw.rstrip(b"\0").split(b"\0"))
        found.append(ProcessInfo(pid, parent, command, resident))
    return tuple(found)


def busy(root: int) -> bool:
    """Whether a thread of *root* or of its descendants runs, or waits for a processor or a disk."""
    for pid in _descendants(root):
        with contextlib.suppress(OSError):
            for thread in Path(f"/proc/{pid}/task").iterdir():
                text = (thread / "stat").read_bytes()
                if text[text.rindex(b")") + 2 :][:1] in (b"R", b"D"):
                    return True
    return False


class Process:
    """A started process whose output is pumped by a thread of its own.

    Args:
        request: What to start.
        on_output: Called from the pump with (`stdout` or `stderr`, bytes) as output comes, up to the limit; when it
            is given, nothing is kept for the outcome.
        keep_stdin: Whether `send` will be used; otherwise standard input is empty.

    Raises:
        FaultError: The program could not be started at all.
    """

    def __init__(self, request: Request, on_output: OnOutput | None = None, keep_stdin: bool = False) -> None:
        self._limits = request.limits
        self._on_output = on_output
        self._kept: dict[str, bytearray] = {"stdout": bytearray(), "stderr": bytearray()}
        self._taken = 0
        self._dropped = 0
        self._ended_by = EndedBy.ITSELF
        self._limit = ""
        self._rung = 0
        self._next_rung_at = 0.0
        self._outcome: Outcome | None = None
        self._finished = threading.Event()
        self._asked_to_stop: EndedBy | None = None
        self._began = time.monotonic()
        self._token = f"{MARK}={os.getpid()}-{next(_counter)}"
        argv = list(request.argv)
        if self._limits.file_bytes:
            argv = ["prlimit", f"--fsize={self._limits.file_bytes}", "--core=0", "--", *argv]
        try:
            self._popen = subprocess.Popen(
                argv,
                env=dict(request.env) | dict([self._token.split("=")]),
                cwd=request.cwd,
                stdin=subprocess.PIPE if keep_stdin else subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
        except OSError as error:
            raise FaultError(f"{argv[0]} could not be started: {error.strerror}.") from error
        self.pid = self._popen.pid
        self._wake_read, self._wake_write = os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)
        self._pump = threading.Thread(target=self._run, name=f"pump-{self.pid}", daemon=True)
        self._pump.start()

    @property
    def running(self) -> bool:
        """Whether the process has not ended yet."""
        return not self._finished.is_set()

    def send(self, data: bytes) -> None:
        """Write *data* to its standard input; a process that has ended does not mind."""
        assert self._popen.stdin is not None
        with contextlib.suppress(OSError, ValueError):
            self._popen.stdin.write(data)
            self._popen.stdin.flush()

    def stop(self, by: EndedBy = EndedBy.GRADER) -> None:
        """Begin to stop it and return at once; `wait` tells when it has ended."""
        self._asked_to_stop = by
        with contextlib.suppress(OSError):
            os.write(self._wake_write, b"s")

    def wait(self) -> Outcome:
        """Wait for its end; bounded by its deadline and the ladder."""
        self._finished.wait()
        assert self._outcome is not None
        return self._outcome

    # --- the pump ---------------------------------------------------------------------------

    def _run(self) -> None:
        assert self._popen.stdout is not None
        assert self._popen.stderr is not None
        deadline = self._began + self._limits.seconds
        watched = bool(self._limits.processes or self._limits.memory_bytes)
        next_watch = self._began + POLL_SECONDS
        ended_at: float | None = None
        with selectors.DefaultSelector() as selector:
            for stream, name in ((self._popen.stdout, "stdout"), (self._popen.stderr, "stderr")):
                os.set_blocking(stream.fileno(), False)
                selector.register(stream, selectors.EVENT_READ, name)
            selector.register(self._wake_read, selectors.EVENT_READ, "wake")
            pidfd = os.pidfd_open(self.pid)
            selector.register(pidfd, selectors.EVENT_READ, "end")
            open_streams = 2
            while True:
                now = time.monotonic()
                if ended_at is None:
                    if self._asked_to_stop is not None and self._rung == 0:
                        self._begin_stop(self._asked_to_stop)
                    elif now >= deadline and self._rung == 0:
                        self._begin_stop(EndedBy.DEADLINE)
                    elif self._rung and now >= self._next_rung_at:
                        self._climb()
                    elif watched and now >= next_watch and self._rung == 0:
                        self._watch()
                        next_watch = time.monotonic() + POLL_SECONDS
                elif open_streams == 0 or now >= ended_at + LAST_OUTPUT_SECONDS:
                    break
                for key, _ in selector.select(0.02 if ended_at is not None or self._rung else POLL_SECONDS):
                    if key.data == "wake":
                        os.read(self._wake_read, 64)
                    elif key.data == "end":
                        selector.unregister(pidfd)
                        ended_at = time.monotonic()
                        self._popen.wait()
                        self._kill_rest()
                    elif not self._take(key.data, key.fd):
                        selector.unregister(key.fileobj)
                        open_streams -= 1
        for descriptor in (pidfd, self._wake_read, self._wake_write):
            os.close(descriptor)
        self._popen.stdout.close()
        self._popen.stderr.close()
        if self._popen.stdin is not None:
            with contextlib.suppress(OSError):
                self._popen.stdin.close()
        code = self._popen.returncode
        self._outcome = Outcome(
            code=code if code >= 0 else None,
            signal=-code if code < 0 else None,
            ended_by=self._ended_by,
            limit=self._limit,
            stdout=bytes(self._kept["stdout"]),
            stderr=bytes(self._kept["stderr"]),
            dropped_bytes=self._dropped,
            seconds=round((ended_at or time.monotonic()) - self._began, 3),
        )
        self._finished.set()

    def _take(self, name: str, descriptor: int) -> bool:
        """Read what is there; False at the end of the stream."""
        try:
            data = os.read(descriptor, CHUNK_BYTES)
        except BlockingIOError:
            return True
        if not data:
            return False
        keep = data[: max(0, self._limits.output_bytes - self._taken)]
        self._taken += len(keep)
        self._dropped += len(data) - len(keep)
        if keep and self._on_output is not None:
            self._on_output(name, keep)
        elif keep:
            self._kept[name] += keep
        return True

    def _watch(self) -> None:
        """Strike when the whole tree uses more processes (threads count) or memory than it may."""
        found = _descendants(self.pid).values()
        if self._limits.processes and sum(threads for _, threads, _ in found) > self._limits.processes:
            self._strike("processes")
        elif self._limits.memory_bytes and sum(size for _, _, size in found) > self._limits.memory_bytes:
            self._strike("memory")

    def _strike(self, limit: str) -> None:
        self._limit = limit
        self._ended_by = EndedBy.LIMIT
        self._rung = 3
        self._next_rung_at = time.monotonic() + 1
        self._kill_rest()

    def _begin_stop(self, by: EndedBy) -> None:
        self._ended_by = by
        self._limit = "seconds" if by is EndedBy.DEADLINE else ""
        self._climb()

    def _climb(self) -> None:
        """The next rung of the ladder; the last one is repeated until the process is gone."""
        budget = lab.limits().stop
        self._rung = min(self._rung + 1, 3)
        if self._rung == 3:
            self._kill_rest()
            wait = 1.0
        else:
            number, wait = (
                (signal.SIGINT, budget.interrupt_seconds)
                if self._rung == 1
                else (signal.SIGTERM, budget.terminate_seconds)
            )
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, number)
        self._next_rung_at = time.monotonic() + wait

    def _kill_rest(self) -> None:
        """SIGKILL to the group, to every descendant, and to strays that carry this run's mark, until none is found."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        for _ in range(20):
            alive = set(_descendants(self.pid)) | {pid for pid in _descendants(os.getpid()) if self._marked(pid)}
            if not alive:
                return
            for pid in alive:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(pid, signal.SIGKILL)

    def _marked(self, pid: int) -> bool:
        try:
            return self._token.encode() in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
        except OSError:
            return False


def run(request: Request, on_output: OnOutput | None = None) -> Outcome:
    """Start *request*, wait for its end and return how it ended.

    Raises:
        FaultError: The program could not be started at all.
    """
    return Process(request, on_output).wait()


@contextlib.contextmanager
def temporary_directory() -> Iterator[Path]:
    """A private directory that is gone afterwards, also when this process is killed with SIGKILL.

    A tiny shell waits at the other end of a pipe and removes the directory when the pipe closes.
    """
    path = Path(tempfile.mkdtemp(prefix="lab2-"))
    script = 'trap "" INT TERM HUP; cat >/dev/null; chmod -R u+rwX -- "$1"; rm -rf -- "$1"'
    with subprocess.Popen(
        ["sh", "-c", script, "lab2-cleaner", str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        cwd="/",
    ) as cleaner:
        try:
            yield path
        finally:
            assert cleaner.stdin is not None
            cleaner.stdin.close()
            cleaner.wait()
            if path.exists():
                shutil.rmtree(path, ignore_errors=True)
