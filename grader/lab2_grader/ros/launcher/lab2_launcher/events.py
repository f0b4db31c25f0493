"""The events of `launch.events` and `launch.events.process`."""

from __future__ import annotations

import signal as signals

from .core import Action, Event, ExecutionComplete, ensure_argument_type

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable

    from .actions import TimerAction
    from .process import ExecuteLocal

__all__ = ["ExecutionComplete"]


class Shutdown(Event):
    """The launch is to end."""

    name = "launch.events.Shutdown"

    def __init__(self, *, reason: str = "reason not given", due_to_sigint: bool = False) -> None:
        self.reason = reason
        self.due_to_sigint = due_to_sigint


class TimerEvent(Event):
    """A timer is due."""

    name = "launch.events.TimerEvent"

    def __init__(self, *, timer_action: TimerAction) -> None:
        self.timer_action = timer_action


def matches_action(target_action: Action) -> Callable[[Action], bool]:
    """A matcher for one action."""
    return lambda action: action is target_action


def matches_pid(pid: int) -> Callable[[ExecuteLocal], bool]:
    """A matcher for the process with an id."""
    return lambda action: action.process_details is not None and action.process_details["pid"] == pid


def matches_name(name: str) -> Callable[[ExecuteLocal], bool]:
    """A matcher for the processes of a name."""
    return lambda action: action.process_details is not None and action.process_details["name"] == name


class RunningProcessEvent(Event):
    """Something about a process that was started."""

    name = "launch.events.process.RunningProcessEvent"

    def __init__(
        self,
        *,
        action: ExecuteLocal,
        name: str,
        cmd: list[str],
        cwd: str | None,
        env: dict[str, str] | None,
        pid: int,
    ) -> None:
        self.action = action
        self.execute_process_action = action
        self.process_name = name
        self.cmd = cmd
        self.cwd = cwd
        self.env = env
        self.pid = pid


class ProcessStarted(RunningProcessEvent):
    """A process was started."""

    name = "launch.events.process.ProcessStarted"


class ProcessExited(RunningProcessEvent):
    """A process ended; `returncode` is negative when a signal ended it."""

    name = "launch.events.process.ProcessExited"

    def __init__(
        self,
        *,
        returncode: int,
        action: ExecuteLocal,
        name: str,
        cmd: list[str],
        cwd: str | None,
        env: dict[str, str] | None,
        pid: int,
    ) -> None:
        super().__init__(action=action, name=name, cmd=cmd, cwd=cwd, env=env, pid=pid)
        self.returncode = returncode


class ProcessIO(RunningProcessEvent):
    """A process printed something; `fd` is 1 or 2."""

    name = "launch.events.process.ProcessIO"

    def __init__(
        self,
        *,
        text: bytes,
        fd: int,
        action: ExecuteLocal,
        name: str,
        cmd: list[str],
        cwd: str | None,
        env: dict[str, str] | None,
        pid: int,
    ) -> None:
        super().__init__(action=action, name=name, cmd=cmd, cwd=cwd, env=env, pid=pid)
        self.text = text
        self.from_stdin = fd == 0
        self.from_stdout = fd == 1
        self.from_stderr = fd == 2


class ProcessTargetedEvent(Event):
    """Something that certain processes are to do."""

    name = "launch.events.process.ProcessTargetedEvent"

    def __init__(self, *, process_matcher: Callable[[ExecuteLocal], bool]) -> None:
        self.process_matcher = process_matcher


class ShutdownProcess(ProcessTargetedEvent):
    """Certain processes are to end."""

    name = "launch.events.process.ShutdownProcess"


class SignalProcess(ProcessTargetedEvent):
    """Certain processes are to get a signal: one of `signal.Signals`, or its name."""

    name = "launch.events.process.SignalProcess"

    def __init__(
        self, *, signal_number: str | signals.Signals, process_matcher: Callable[[ExecuteLocal], bool]
    ) -> None:
        super().__init__(process_matcher=process_matcher)
        ensure_argument_type(signal_number, (str, signals.Signals), "signal_number", "SignalProcess")
        self.signal = signal_number

    @property
    def signal_name(self) -> str:
        """The signal's name, for example SIGINT."""
        return self.signal if isinstance(self.signal, str) else self.signal.name

    @property
    def number(self) -> int:
        """The signal's number."""
        return signals.Signals[self.signal_name].value
