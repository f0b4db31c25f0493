"""Starts processes, relays what they print, and ends them: `ExecuteProcess`, and the base of `Node`."""

from __future__ import annotations

import itertools
import os
import subprocess
from contextlib import suppress

from . import events
from .conditions import evaluate_condition_expression
from .core import (
    Action,
    BaseEventHandler,
    Event,
    Known,
    LaunchContext,
    LaunchDescriptionEntity,
    normalize_to_list_of_substitutions,
    normalize_typed_substitution,
    perform_substitutions,
    perform_typed_substitution,
)
from .output import STDERR, STDOUT, Lines, log
from .substitutions import LaunchConfiguration

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

    from .core import SomeSubstitutionsType, Substitution
    from .service import LaunchService, Timer

READ_BYTES = 65_536
DRAIN_BYTES = 1_048_576  # as much as a pipe may hold: what a process wrote before it ended
_OUTPUT_FORMAT = "[{this.process_description.final_name}] {line}"
_SIGTERM_TIMEOUT = LaunchConfiguration("sigterm_timeout", default=5)
_SIGKILL_TIMEOUT = LaunchConfiguration("sigkill_timeout", default=5)
_numbers = itertools.count(1)

if TYPE_CHECKING:
    _Pairs = list[tuple[list[Substitution], list[Substitution]]]


def _pairs(values: Mapping[Any, Any] | None) -> _Pairs | None:
    if values is None:
        return None
    return [
        (normalize_to_list_of_substitutions(name), normalize_to_list_of_substitutions(value))
        for name, value in values.items()
    ]


class Executable(Known):
    """A program with its arguments and surroundings; `final_…` is what came of them when they were performed."""

    def __init__(
        self,
        *,
        cmd: Iterable[SomeSubstitutionsType],
        prefix: SomeSubstitutionsType | None = None,
        name: SomeSubstitutionsType | None = None,
        cwd: SomeSubstitutionsType | None = None,
        env: Mapping[Any, Any] | None = None,
        additional_env: Mapping[Any, Any] | None = None,
        arguments: Iterable[SomeSubstitutionsType] | None = None,
    ) -> None:
        self.cmd = [normalize_to_list_of_substitutions(part) for part in [*cmd, *(arguments or ())]]
        self.arguments = arguments
        self._filtered = prefix is None
        self.prefix = normalize_to_list_of_substitutions(
            LaunchConfiguration("launch-prefix", default="") if prefix is None else prefix
        )
        self.name = None if name is None else normalize_to_list_of_substitutions(name)
        self.cwd = None if cwd is None else normalize_to_list_of_substitutions(cwd)
        self.env = _pairs(env)
        self.additional_env = _pairs(additional_env)
        self.final_cmd: list[str] = []
        self.final_name = ""
        self.final_cwd: str | None = None
        self.final_env: dict[str, str] = {}

    def prepare(self, context: LaunchContext, action: Action) -> None:
        """Perform everything, and number the process."""
        cmd = [perform_substitutions(context, part) for part in self.cmd]
        prefix = perform_substitutions(context, self.prefix)
        if prefix and self._wants_prefix(context, cmd[0]):
            import shlex

            cmd = shlex.split(prefix) + cmd
        self.final_cmd = cmd
        name = os.path.basename(cmd[0]) if self.name is None else perform_substitutions(context, self.name)
        self.final_name = f"{name}-{next(_numbers)}"
        self.final_cwd = None if self.cwd is None else perform_substitutions(context, self.cwd)
        self.final_env = dict(context.environment) if self.env is None else {}
        for key, value in [*(self.env or ()), *(self.additional_env or ())]:
            self.final_env[perform_substitutions(context, key)] = perform_substitutions(context, value)

    def _wants_prefix(self, context: LaunchContext, program: str) -> bool:
        if not self._filtered:
            return True
        import re

        pattern = LaunchConfiguration("launch-prefix-filter", default="").perform(context)
        return re.match(pattern, os.path.basename(program)) is not None


class _ProcessHandler(BaseEventHandler):
    """Takes the events that are meant for one process to it."""

    def __init__(self, action: ExecuteLocal) -> None:
        super().__init__(matcher=self._concerns)
        self._action = action

    def _concerns(self, event: Event) -> bool:
        if isinstance(event, events.ProcessTargetedEvent):
            return event.process_matcher(self._action)
        return isinstance(event, events.Shutdown)

    def handle(self, event: Event, context: LaunchContext) -> None:
        if isinstance(event, events.SignalProcess):
            self._action.send(event.signal_name, event.number)
        else:
            by_terminal = isinstance(event, events.Shutdown) and event.due_to_sigint and not context.noninteractive
            self._action.shut_down(interrupt=not by_terminal)


class Stream:
    """One stream of a running process, on its way to our own."""

    def __init__(self, fd: int, lines: Lines, number: int) -> None:
        self.fd = fd
        self.lines = lines
        self.number = number  # 1 for standard output, 2 for standard error

    def read(self, size: int) -> bytes | None:
        """What there is, at most *size* bytes; nothing at the end, None when there is nothing at the moment."""
        try:
            return os.read(self.fd, size)
        except BlockingIOError:
            return None
        except OSError:  # EIO: the other end of the terminal was closed
            return b""


class ExecuteLocal(Action):
    """Starts a process when executed, and looks after it until it has ended."""

    def __init__(
        self,
        *,
        process_description: Executable,
        shell: bool = False,
        sigterm_timeout: SomeSubstitutionsType = _SIGTERM_TIMEOUT,
        sigkill_timeout: SomeSubstitutionsType = _SIGKILL_TIMEOUT,
        emulate_tty: bool = False,
        output: Any = "log",  # what is printed goes to our own output, whatever is asked for
        output_format: str = _OUTPUT_FORMAT,
        cached_output: bool = False,
        log_cmd: bool = False,
        on_exit: Any = None,
        respawn: bool | SomeSubstitutionsType = False,
        respawn_delay: float | None = None,
        respawn_max_retries: int = -1,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        self.process_description = process_description
        self.shell = shell
        self.sigterm_timeout = normalize_to_list_of_substitutions(sigterm_timeout)
        self.sigkill_timeout = normalize_to_list_of_substitutions(sigkill_timeout)
        self.emulate_tty = emulate_tty
        self.output = output
        self.process_details: dict[str, Any] | None = None
        self._output_format = output_format
        self._log_cmd = log_cmd
        self._on_exit = on_exit
        self._respawn = normalize_typed_substitution(respawn, bool)
        self._respawn_delay = respawn_delay
        self._respawns_left = respawn_max_retries if respawn_max_retries >= 0 else float("inf")
        self._context: LaunchContext | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._streams: list[Stream] = []
        self._timers: list[Timer] = []
        self._executed = False
        self._ending = False

    @property
    def return_code(self) -> int | None:
        """The exit code, negative for a signal; None as long as the process runs."""
        return None if self._process is None else self._process.returncode

    def get_sub_entities(self) -> Sequence[LaunchDescriptionEntity]:
        return self._on_exit if isinstance(self._on_exit, list) else []

    def prepare(self, context: LaunchContext) -> None:
        """Perform everything that was given as substitutions."""
        what = self.process_description
        what.prepare(context, self)
        self.process_details = {
            "action": self,
            "name": what.final_name,
            "cmd": what.final_cmd,
            "cwd": what.final_cwd,
            "env": what.final_env,
        }
        self._respawn = perform_typed_substitution(context, self._respawn, bool)

    def execute(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity] | None:
        self.prepare(context)
        if self._executed:
            raise RuntimeError(f"ExecuteLocal action '{self._name}': executed more than once: {self.describe()}")
        self._executed = True
        self._output_format.format(line="", this=self)  # a bad one shows now, not when the process prints
        if context.is_shutdown or context.service is None:
            return None
        self._context = context
        context.register_event_handler(_ProcessHandler(self))
        if self._on_exit is not None:
            from .event_handlers import OnProcessExit

            context.register_event_handler(OnProcessExit(target_action=self, on_exit=self._on_exit))
        context.service.begin(self)
        context.service.call_soon(self._start)
        return None

    # --- while it runs ---

    @property
    def _name(self) -> str:
        return self.process_description.final_name

    @property
    def _service(self) -> LaunchService:
        assert self._context is not None and self._context.service is not None
        return self._context.service

    @property
    def running(self) -> bool:
        """Whether the process was started and has not ended."""
        return self._process is not None and self._process.returncode is None

    def _start(self) -> None:
        assert self._context is not None and self.process_details is not None
        if self._ending or self._context.is_shutdown:
            self._service.end(self)
            return
        what = self.process_description
        shown = " ".join(part for part in what.final_cmd if part.strip())
        if self._log_cmd:
            log("INFO", self._name, f"process details: cmd='{shown}', cwd='{what.final_cwd}', custom_env?=True")
        try:
            self._spawn()
        except Exception:  # noqa: BLE001 - whatever is wrong with the command is the launch file's
            from traceback import format_exc

            log("ERROR", self._name, f"exception occurred while executing process:\n{format_exc()}")
            self._service.end(self)
            return
        assert self._process is not None
        log("INFO", self._name, f"process started with pid [{self._process.pid}]")
        self.process_details["pid"] = self._process.pid
        self._context.emit_event_sync(events.ProcessStarted(**self.process_details))
        self._service.watch(self)

    def _spawn(self) -> None:
        assert self._context is not None
        what = self.process_description
        emulate_tty = self.emulate_tty
        if "emulate_tty" in self._context.launch_configurations:
            value = self._context.launch_configurations["emulate_tty"]
            emulate_tty = evaluate_condition_expression(self._context, normalize_to_list_of_substitutions(value))
        out, child_out = os.openpty() if emulate_tty else os.pipe()
        err, child_err = os.openpty() if emulate_tty else os.pipe()
        try:
            self._process = subprocess.Popen(
                " ".join(what.final_cmd) if self.shell else what.final_cmd,
                shell=self.shell,
                cwd=what.final_cwd,
                env=what.final_env,
                stdin=subprocess.PIPE,
                stdout=child_out,
                stderr=child_err,
            )
        except BaseException:
            os.close(out)
            os.close(err)
            raise
        finally:
            os.close(child_out)
            os.close(child_err)
        self._streams = []
        for fd, number in ((out, STDOUT), (err, STDERR)):
            os.set_blocking(fd, False)
            self._streams.append(Stream(fd, self._lines(number), number))

    def _lines(self, number: int) -> Lines:
        decorate = None
        if self._output_format != _OUTPUT_FORMAT:

            def decorate(line: str) -> str:
                return self._output_format.format(line=line, this=self)

        return Lines(number, f"[{self._name}] ", decorate)

    def streams(self) -> list[Stream]:
        """The streams that are to be read."""
        return self._streams

    def relay(self, stream: Stream, data: bytes) -> None:
        """Print *data*, and tell those who want to know."""
        stream.lines.feed(data)
        assert self._context is not None and self.process_details is not None
        event = events.ProcessIO(text=data, fd=stream.number, **self.process_details)
        if self._context.would_handle_event(event):
            self._context.emit_event_sync(event)

    def poll(self) -> bool:
        """Whether the process has ended; if so, all that it printed is printed and its end is told."""
        assert self._process is not None and self._context is not None and self.process_details is not None
        code = self._process.poll()
        if code is None:
            return False
        for stream in self._streams:
            left = DRAIN_BYTES
            while left > 0 and (data := stream.read(min(READ_BYTES, left))):
                left -= len(data)
                self.relay(stream, data)
            stream.lines.flush()
            os.close(stream.fd)
        self._streams = []
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()
        pid = self._process.pid
        if code == 0:
            log("INFO", self._name, f"process has finished cleanly [pid {pid}]")
        else:
            cmd = " ".join(part for part in self.process_description.final_cmd if part.strip())
            log("ERROR", self._name, f"process has died [pid {pid}, exit code {code}, cmd '{cmd}'].")
        self._context.emit_event_sync(events.ProcessExited(returncode=code, **self.process_details))
        if self._respawn and not self._ending and not self._context.is_shutdown and self._respawns_left > 0:
            self._respawns_left -= 1
            self._timers = [self._service.call_later(self._respawn_delay or 0.0, self._start)]
        else:
            self._service.end(self)
        return True

    # --- to its end ---

    def shut_down(self, *, interrupt: bool) -> None:
        """Let the process end: SIGINT now (unless the terminal has sent it), SIGTERM and SIGKILL when time is up."""
        if self._ending or self._context is None:
            return
        self._ending = True
        if not self.running:
            for timer in self._timers:  # a respawn that is waiting
                timer.cancel()
                self._service.end(self)
            return
        term = perform_substitutions(self._context, self.sigterm_timeout)
        kill = str(float(term) + float(perform_substitutions(self._context, self.sigkill_timeout)))
        self._timers = [
            self._service.call_later(float(term), lambda: self._escalate(term, "SIGINT", "SIGTERM")),
            self._service.call_later(float(kill), lambda: self._escalate(kill, "SIGTERM", "SIGKILL")),
        ]
        if interrupt:
            self._send_named("SIGINT")

    def _escalate(self, seconds: str, tried: str, next_one: str) -> None:
        log(
            "ERROR",
            self._name,
            f"process[{self._name}] failed to terminate '{seconds}' seconds after receiving '{tried}', "
            f"escalating to '{next_one}'",
        )
        self._send_named(next_one)

    def terminate(self) -> None:
        """Do not wait for the process any longer: SIGTERM now, SIGKILL after `sigkill_timeout`."""
        assert self._context is not None
        if not self.running:
            return
        for timer in self._timers:
            timer.cancel()
        seconds = perform_substitutions(self._context, self.sigkill_timeout)
        self._timers = [self._service.call_later(float(seconds), lambda: self._escalate(seconds, "SIGTERM", "SIGKILL"))]
        self._send_named("SIGTERM")

    def kill(self) -> None:
        """End the process at once, without a word."""
        if self._process is not None:
            with suppress(ProcessLookupError):
                self._process.kill()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(1.0)

    def _send_named(self, name: str) -> None:
        import signal

        self.send(name, signal.Signals[name].value)

    def send(self, name: str, number: int) -> None:
        """Send a signal to the process.

        Raises:
            RuntimeError: It was not started yet.
        """
        if self._process is None:
            raise RuntimeError("Signal event received before execution.")
        if not self.running:
            return
        log("INFO", self._name, f"sending signal '{name}' to process[{self._name}]")
        self._process.send_signal(number)


class ExecuteProcess(ExecuteLocal):
    """Starts a command."""

    def __init__(
        self,
        *,
        cmd: Iterable[SomeSubstitutionsType],
        prefix: SomeSubstitutionsType | None = None,
        name: SomeSubstitutionsType | None = None,
        cwd: SomeSubstitutionsType | None = None,
        env: Mapping[Any, Any] | None = None,
        additional_env: Mapping[Any, Any] | None = None,
        **kwargs: Any,
    ) -> None:
        described = Executable(cmd=cmd, prefix=prefix, name=name, cwd=cwd, env=env, additional_env=additional_env)
        super().__init__(process_description=described, **kwargs)

    @property
    def name(self) -> Any:
        """The final name once executed, before that what was given."""
        return self.process_description.final_name or self.process_description.name

    @property
    def cmd(self) -> Any:
        """The final command once executed, before that what was given."""
        return self.process_description.final_cmd or self.process_description.cmd

    @property
    def cwd(self) -> Any:
        """The final working directory once executed, before that what was given."""
        return self.process_description.final_cwd or self.process_description.cwd

    @property
    def env(self) -> Any:
        """The final environment once executed, before that what was given."""
        return self.process_description.final_env or self.process_description.env
