"""Runs a launch: one event after the other, the processes, the timers and the signals, until nothing is left to do."""

from __future__ import annotations

import heapq
import os
import selectors
import signal
import time
from collections import deque

from . import api, events, output
from .core import Action, LaunchContext, LaunchDescriptionEntity
from .output import log
from .process import READ_BYTES, ExecuteLocal, Stream

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import Any

    from .core import Event


class Timer:
    """A call that will be made later, unless it is cancelled."""

    def __init__(self, due: float, call: Callable[[], None]) -> None:
        self.due = due
        self.call = call
        self.cancelled = False

    def cancel(self) -> None:
        """Do not make the call."""
        self.cancelled = True

    def __lt__(self, other: Timer) -> bool:
        return self.due < other.due


class LaunchService:
    """The loop of a launch.

    Args:
        argv: The launch arguments as they were given.
        noninteractive: No terminal sends Ctrl-C to the processes along with us; we must.
    """

    def __init__(self, *, argv: Iterable[str] = (), noninteractive: bool = True) -> None:
        self.context = LaunchContext(argv=argv, noninteractive=noninteractive)
        self.context.service = self
        self._selector = selectors.DefaultSelector()
        self._active: set[Action] = set()
        self._running: list[ExecuteLocal] = []
        self._soon: deque[Callable[[], None]] = deque()
        self._timers: list[Timer] = []
        self._signals: deque[int] = deque()
        self._interrupted = False
        self._shutting_down = False
        self._exit_code = 0

    # --- what actions ask for ---

    def begin(self, action: Action) -> None:
        """*action* has something going on; the launch does not end before it says `end`."""
        self._active.add(action)

    def end(self, action: Action) -> None:
        """What *action* had going on has ended."""
        if action in self._active:
            self._active.remove(action)
            action.completed()

    def is_active(self, action: Action) -> bool:
        """Whether *action* has something going on."""
        return action in self._active

    def call_soon(self, call: Callable[[], None]) -> None:
        """Make *call* when the event at hand is done with."""
        self._soon.append(call)

    def call_later(self, seconds: float, call: Callable[[], None]) -> Timer:
        """Make *call* in *seconds*."""
        timer = Timer(time.monotonic() + seconds, call)
        heapq.heappush(self._timers, timer)
        return timer

    def watch(self, action: ExecuteLocal) -> None:
        """Look after the process that *action* has just started."""
        self._running.append(action)
        for stream in action.streams():
            self._selector.register(stream.fd, selectors.EVENT_READ, (action, stream))

    # --- the loop ---

    def run(self, description: LaunchDescriptionEntity) -> int:
        """Visit *description* and go on until nothing is left to do.

        Returns:
            0, or 1 when something in the launch failed or SIGTERM ended it.

        Raises:
            api.Unsupported: The launch needs something beyond our subset; no process is left running.
        """
        wake, wake_end = os.pipe()
        for fd in (wake, wake_end):
            os.set_blocking(fd, False)
        self._selector.register(wake, selectors.EVENT_READ, None)
        signal.set_wakeup_fd(wake_end, warn_on_full_buffer=False)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT):
            signal.signal(number, lambda number, _: self._signals.append(number))
        signal.signal(signal.SIGCHLD, lambda number, _: None)  # a handler is what makes it wake us
        try:
            log("INFO", "launch", f"All log files can be found below {output.launch_config.log_dir}")
            log("INFO", "launch", "Default logging verbosity is set to INFO")
            self._guarded(lambda: self._visit(description))
            while self._step():
                pass
            return self._exit_code
        except output.ReaderGone:
            return 1
        finally:
            for action in self._running:
                action.kill()

    def _step(self) -> bool:
        """One round of the loop; False when the launch is over."""
        if api.refused:  # also when the launch file has swallowed what refuse() raised
            raise api.Unsupported(api.refused[0])
        while self._soon:
            self._guarded(self._soon.popleft())
        if not self.context.events and not self._active:
            if self._shutting_down:
                return False
            self._shut_down("idle")
        self._wait(0.0 if self.context.events or self._soon else self._seconds_to_timer())
        while self._signals:
            self._on_signal(self._signals.popleft())
        self._reap()
        while self._timers and self._timers[0].due <= time.monotonic():
            timer = heapq.heappop(self._timers)
            if not timer.cancelled:
                self._guarded(timer.call)
        if self.context.events:
            event = self.context.events.pop(0)
            self._guarded(lambda: self._handle(event))
        return True

    def _seconds_to_timer(self) -> float | None:
        while self._timers and self._timers[0].cancelled:
            heapq.heappop(self._timers)
        return max(0.0, self._timers[0].due - time.monotonic()) if self._timers else None

    def _wait(self, seconds: float | None) -> None:
        for key, _ in self._selector.select(seconds):
            if key.data is None:
                while self._read_wakeup(key.fd):
                    pass
            elif self._relay(*key.data):
                self._selector.unregister(key.fd)

    def _relay(self, action: ExecuteLocal, stream: Stream) -> bool:
        """Print what there is; whether the stream is at its end."""
        data = stream.read(READ_BYTES)
        if data:
            self._guarded(lambda: action.relay(stream, data))
        return data == b""

    @staticmethod
    def _read_wakeup(fd: int) -> bytes:
        try:
            return os.read(fd, 4096)
        except BlockingIOError:
            return b""

    def _reap(self) -> None:
        for action in list(self._running):
            streams = action.streams()
            if action.poll():
                self._running.remove(action)
                for stream in streams:
                    # Its descriptor is closed by now; one that was read to its end is not registered any more.
                    if stream.fd in self._selector.get_map():
                        self._selector.unregister(stream.fd)

    def _guarded(self, call: Callable[[], None]) -> None:
        """Make *call*; an exception of the launch file's ends the launch, in the words of the real one."""
        try:
            call()
        except output.ReaderGone:
            raise
        except Exception as error:  # noqa: BLE001 - the launch file can raise anything
            message = f"Caught exception in launch (see debug for traceback): {error}"
            log("ERROR", "launch", message)
            self._exit_code = 1
            self._shut_down(message)

    # --- events ---

    def _visit(self, entity: Any) -> None:
        below = entity.visit(self.context)
        if below is not None:
            for entity_below in below:
                self._visit(entity_below)

    def _handle(self, event: Event) -> None:
        if isinstance(event, events.Shutdown):
            self._shutting_down = self.context.is_shutdown = True
        for handler in list(self.context.handlers):
            if not handler.matches(event):
                continue
            self.context.push_locals()
            try:
                answer = handler.handle(event, self.context)
                if answer is None:
                    continue
                for entity in [answer] if isinstance(answer, LaunchDescriptionEntity) else answer:
                    if entity is None:
                        continue
                    if not isinstance(entity, LaunchDescriptionEntity):
                        raise RuntimeError(  # noqa: TRY004 - the real one's
                            f"expected a LaunchDescriptionEntity from event_handler, got '{entity}'"
                        )
                    self._visit(entity)
            finally:
                self.context.pop_locals()

    # --- the end ---

    def _shut_down(self, reason: str, *, due_to_sigint: bool = False) -> None:
        if not self._shutting_down:
            self.context.emit_event_sync(events.Shutdown(reason=reason, due_to_sigint=due_to_sigint))
        self._shutting_down = self.context.is_shutdown = True

    def _on_signal(self, number: int) -> None:
        if number == signal.SIGINT:
            again = " again, ignoring..." if self._interrupted else ""
            log("WARNING", "launch", f"user interrupted with ctrl-c (SIGINT){again}")
            self._interrupted = True
            self._shut_down("ctrl-c (SIGINT)", due_to_sigint=True)
            return
        # The real one ends at once here and may leave its processes behind; we do not.
        name = signal.Signals(number).name
        log("ERROR", "launch", f"user interrupted with ctrl-\\ ({name}), terminating...")
        self._exit_code = 1
        if self._shutting_down:
            for action in list(self._running):
                action.terminate()
        else:
            self._shut_down(name)
