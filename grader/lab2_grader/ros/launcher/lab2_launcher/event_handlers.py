"""The event handlers of `launch.event_handlers`."""

from __future__ import annotations

from collections.abc import Iterable

from .core import Action, BaseEventHandler, Event, ExecutionComplete, LaunchContext, LaunchDescriptionEntity
from .events import ProcessExited, ProcessIO, ProcessStarted, Shutdown
from .process import ExecuteLocal

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def event_named(name: str) -> Callable[[Event], bool]:
    """A matcher for the events of a name."""
    return lambda event: event.name == name


class OnActionEventBase(BaseEventHandler):
    """Answers events of one kind, of one action, of those a callable picks, or of any."""

    def __init__(
        self,
        *,
        action_matcher: Any,
        on_event: Any,
        target_event_cls: type[Event],
        target_action_cls: type[Action],
        handle_once: bool = False,
    ) -> None:
        if not (action_matcher is None or isinstance(action_matcher, target_action_cls) or callable(action_matcher)):
            raise TypeError(f"action_matcher must be an '{target_action_cls.__name__}' instance or a callable")

        def matches(event: Any) -> bool:
            if not isinstance(event, target_event_cls):
                return False
            if action_matcher is None:
                return True
            if isinstance(action_matcher, target_action_cls):
                return event.action is action_matcher
            return bool(action_matcher(event.action))

        super().__init__(matcher=matches, handle_once=handle_once)
        self._on_event = on_event
        if not callable(on_event):
            self._on_event = list(on_event) if isinstance(on_event, Iterable) else [on_event]
            for entity in self._on_event if isinstance(on_event, Iterable) else ():
                if not isinstance(entity, LaunchDescriptionEntity):
                    raise TypeError(
                        "expected all items in 'on_event' iterable to be of type "
                        f"'LaunchDescriptionEntity' but got '{type(entity)}'"
                    )

    def handle(self, event: Event, context: LaunchContext) -> Any:
        super().handle(event, context)
        return self._on_event(event, context) if callable(self._on_event) else self._on_event


class OnProcessStart(OnActionEventBase):
    """Answers the start of a process."""

    def __init__(self, *, target_action: Any = None, on_start: Any, handle_once: bool = False) -> None:
        super().__init__(
            action_matcher=target_action,
            on_event=on_start,
            target_event_cls=ProcessStarted,
            target_action_cls=ExecuteLocal,
            handle_once=handle_once,
        )


class OnProcessExit(OnActionEventBase):
    """Answers the end of a process."""

    def __init__(self, *, target_action: Any = None, on_exit: Any, handle_once: bool = False) -> None:
        super().__init__(
            action_matcher=target_action,
            on_event=on_exit,
            target_event_cls=ProcessExited,
            target_action_cls=ExecuteLocal,
            handle_once=handle_once,
        )


class OnProcessIO(OnActionEventBase):
    """Answers what a process prints."""

    def __init__(
        self,
        *,
        target_action: Any = None,
        on_stdin: Any = None,
        on_stdout: Any = None,
        on_stderr: Any = None,
        handle_once: bool = False,
    ) -> None:
        def answer(event: Any, context: LaunchContext) -> Any:
            chosen = on_stdout if event.from_stdout else on_stderr
            return chosen(event) if chosen is not None else None

        super().__init__(
            action_matcher=target_action,
            on_event=answer,
            target_event_cls=ProcessIO,
            target_action_cls=ExecuteLocal,
            handle_once=handle_once,
        )


class OnExecutionComplete(OnActionEventBase):
    """Answers the completion of an action."""

    def __init__(self, *, target_action: Any = None, on_completion: Any, handle_once: bool = False) -> None:
        super().__init__(
            action_matcher=target_action,
            on_event=on_completion,
            target_event_cls=ExecutionComplete,
            target_action_cls=Action,
            handle_once=handle_once,
        )


class OnShutdown(BaseEventHandler):
    """Answers the end of the launch."""

    def __init__(self, *, on_shutdown: Any, handle_once: bool = False) -> None:
        super().__init__(matcher=lambda event: isinstance(event, Shutdown), handle_once=handle_once)
        self._on_shutdown = on_shutdown

    def handle(self, event: Event, context: LaunchContext) -> Any:
        super().handle(event, context)
        return self._on_shutdown(event, context) if callable(self._on_shutdown) else self._on_shutdown
