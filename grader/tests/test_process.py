"""How processes are started, stopped, held and listened to: real ones, each with what it does and what became of it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import msgspec
import pytest
from zoo_builder import ROOT

from lab2_grader import lab, process, process_table
from lab2_grader.errors import FaultError
from lab2_grader.records import EndedBy, Limits, Request

# --- starting -------------------------------------------------------------------------------------

# A shell gives SIGINT and SIGQUIT to what runs in the background of a script as ignored, nohup does so with SIGHUP;
# a program that is started inherits it.
IGNORING = "trap '' INT QUIT HUP; exec \"$@\""
STARTS = """
from lab2_grader import process
from lab2_grader.records import Limits, Request
status = ("cat", "/proc/self/status")
outcome = process.run(Request(status, (("PATH", "/usr/bin:/bin"),), "/", Limits(seconds=20)))
print(outcome.stdout.decode())
"""


def test_a_grader_in_the_background_of_a_script_starts_programs_that_can_be_interrupted() -> None:
    ignoring = ("sh", "-c", IGNORING, "sh", sys.executable, "-c", STARTS)
    done = subprocess.run(ignoring, cwd=ROOT / "grader", capture_output=True, text=True, check=True)
    status = dict(line.split(":", 1) for line in done.stdout.splitlines() if ":" in line)
    ignored = int(status["SigIgn"], 16)
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP):
        assert not ignored >> (number - 1) & 1, number.name


# --- stopping -------------------------------------------------------------------------------------

# What each of them prints first says that it is ready. `sh` waits for what it started even while it is deaf.
HEARS_AND_STAYS = "trap 'echo heard' INT; echo ready; while :; do sleep 0.05; done"
DEAF = "trap '' INT TERM; setsid sleep 600 & echo $!; wait"


@pytest.fixture
def ladder(monkeypatch: pytest.MonkeyPatch) -> Callable[[float, float], None]:
    """Sets how long the rungs wait, in seconds: after SIGINT, after SIGTERM."""
    limits = lab.limits()

    def set_to(interrupt: float, terminate: float) -> None:
        changed = msgspec.structs.replace(limits, stop=lab.StopLimits(interrupt, terminate))
        monkeypatch.setattr(lab, "limits", lambda: changed)

    return set_to


class Started:
    """A shell that runs *script*, with what it printed so far; killed at the latest when the block ends."""

    def __init__(self, script: str, **limits: float) -> None:
        self.printed = bytearray()
        self.process = process.Process(requested(script, **limits), self._take)

    def _take(self, stream: str, data: bytes) -> None:
        self.printed += data

    def __enter__(self) -> Started:
        return self

    def __exit__(self, *exception: object) -> None:
        self.process.kill()


def requested(script: str, announces: str = "", **limits: float) -> Request:
    bounds = msgspec.convert({"seconds": 60, **limits}, Limits)
    return Request(("sh", "-c", script), (("PATH", "/usr/bin:/bin"),), "/", bounds, announces=announces)


def until(condition: Callable[[], object], seconds: float = 30) -> bool:
    """Whether *condition* comes true in time; looked at again and again, for machines that have other things to do."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def test_who_stays_at_the_first_signal_is_ended_by_the_second(ladder: Callable[[float, float], None]) -> None:
    ladder(1, 30)
    with Started(HEARS_AND_STAYS) as started:
        assert until(lambda: b"ready" in started.printed)
        asked = time.monotonic()
        started.process.stop()
        outcome = started.process.wait()
        assert time.monotonic() - asked >= 1
    assert (outcome.signal, outcome.code, outcome.ended_by) == (signal.SIGTERM, None, EndedBy.GRADER)
    assert started.printed == b"ready\nheard\n"


def test_who_is_deaf_is_killed_with_all_that_it_started(ladder: Callable[[float, float], None]) -> None:
    ladder(0.2, 0.2)
    process.become_reaper()  # as the grader does: what is orphaned comes back to it
    with Started(DEAF) as started:
        assert until(lambda: started.printed.endswith(b"\n"))
        grandchild = int(started.printed)
        assert until(lambda: os.getsid(grandchild) == grandchild)  # no signal to the group reaches it any more
        asked = time.monotonic()
        started.process.stop()
        outcome = started.process.wait()
        assert 0.4 <= time.monotonic() - asked < 30  # it would sleep for ten minutes
    assert (outcome.signal, outcome.code, outcome.ended_by) == (signal.SIGKILL, None, EndedBy.GRADER)
    assert not process_table.alive(started.process.pid)
    assert until(lambda: not process_table.alive(grandchild))


def test_at_its_deadline_a_process_is_stopped_like_at_a_call() -> None:
    with Started("exec sleep 600", seconds=0.3) as started:
        outcome = started.process.wait()
    assert (outcome.signal, outcome.ended_by, outcome.limit) == (signal.SIGINT, EndedBy.DEADLINE, "seconds")
    assert outcome.seconds >= 0.3


def test_what_ends_by_itself_is_not_said_to_be_stopped() -> None:
    with Started("exit 3") as started:
        outcome = started.process.wait()
        started.process.stop()  # too late to matter
    assert (outcome.signal, outcome.code, outcome.ended_by, outcome.limit) == (None, 3, EndedBy.ITSELF, "")
    assert not started.process.running


# --- looking and holding --------------------------------------------------------------------------


def test_what_is_held_does_not_run_and_then_goes_on() -> None:
    with Started("while :; do :; done") as started:
        pid = started.process.pid
        assert until(lambda: process_table.busy([pid]))
        with contextlib.suppress(ValueError), process_table.held([pid]):
            assert until(lambda: not process_table.busy([pid]))
            before = process_table.stat(pid)
            time.sleep(0.2)
            after = process_table.stat(pid)
            assert before is not None and after is not None and before.cpu_seconds == after.cpu_seconds
            raise ValueError
        assert until(lambda: process_table.busy([pid]))


def test_who_waits_is_not_busy_and_who_is_gone_is_nobody() -> None:
    with Started("echo ready; exec sleep 600") as started:
        assert until(lambda: b"ready" in started.printed and not process_table.busy([started.process.pid]))
    gone = started.process.pid
    assert not process_table.alive(gone) and not process_table.busy([gone])
    with process_table.held([gone]):
        pass


# --- output ---------------------------------------------------------------------------------------

MUCH = "head -c 5000 /dev/zero; head -c 500 /dev/zero >&2"


def test_of_each_stream_only_so_much_is_kept() -> None:
    outcome = process.run(requested(MUCH, output_bytes=1_000))
    assert (len(outcome.stdout), len(outcome.stderr), outcome.dropped_bytes) == (1_000, 500, 4_000)


def test_what_is_handed_on_is_bounded_too_and_not_kept() -> None:
    handed = {"stdout": 0, "stderr": 0}

    def take(stream: str, data: bytes) -> None:
        handed[stream] += len(data)

    outcome = process.run(requested(MUCH, output_bytes=1_000), take)
    assert handed == {"stdout": 1_000, "stderr": 500}
    assert (outcome.stdout, outcome.stderr, outcome.dropped_bytes) == (b"", b"", 4_000)


def test_what_walls_say_before_they_stand_is_not_the_program_s() -> None:
    script = "echo noise >&2; echo out; printf 'walls ' >&2; sleep 0.1; printf 'stand\nown\n' >&2"
    outcome = process.run(requested(script, "walls stand"))
    assert (outcome.code, outcome.stdout, outcome.stderr) == (0, b"out\n", b"own\n")


@pytest.mark.parametrize(("script", "said"), [("echo first >&2; echo no room >&2; exit 1", "no room"), ("exit 7", "7")])
def test_walls_that_never_stood_are_a_fault_of_ours(script: str, said: str) -> None:
    with pytest.raises(FaultError, match=f"sandbox did not start: .*{said}"):
        process.run(requested(script, "walls stand"))


def test_what_is_not_there_cannot_be_started() -> None:
    request = Request(("/nowhere/at-all",), (), "/", Limits(seconds=5))
    with pytest.raises(FaultError, match="could not be started: it is not there"):
        process.run(request)
