"""The actions of `launch.actions`, but for those that start processes (`process`) and include files (`sources`)."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable

from . import events
from .core import (
    Action,
    BaseEventHandler,
    Event,
    LaunchContext,
    LaunchDescriptionEntity,
    SomeSubstitutionsType_types_tuple,
    ensure_argument_type,
    normalize_to_list_of_substitutions,
    normalize_typed_substitution,
    perform_substitutions,
    perform_typed_substitution,
)
from .output import log
from .sources import IncludeLaunchDescription

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any

    from .core import SomeSubstitutionsType
    from .service import Timer

__all__ = ["IncludeLaunchDescription"]


class DeclareLaunchArgument(Action):
    """Declares an argument of the launch file; without a value for it the default becomes the launch configuration."""

    def __init__(
        self,
        name: str,
        *,
        default_value: SomeSubstitutionsType | None = None,
        description: str | None = None,
        choices: list[str] | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        self.name = name
        self.default_value = None if default_value is None else normalize_to_list_of_substitutions(default_value)
        self.choices = choices
        self.conditionally_included = False
        if choices is not None:
            if not choices:
                self._fail("Provided choices arg is empty. Use None to ignore the choice list.")
            if isinstance(default_value, str) and default_value not in choices:
                self._fail(f'Provided default_value "{default_value}" is not in provided choices "{choices}".')
        self.description = description if description is not None else "no description given"
        if choices is not None:
            dot = "" if self.description.endswith(".") else "."
            self.description = (
                f"One of: {choices}" if description is None else f"{description}{dot} Valid choices are: {choices}"
            )

    @staticmethod
    def _fail(text: str, logged: str | None = None) -> None:
        log("ERROR", "launch.actions.declare_launch_argument", logged or text)
        raise RuntimeError(text)

    def execute(self, context: LaunchContext) -> None:
        if self.name not in context.launch_configurations:
            if self.default_value is None:
                self._fail(
                    f'Required launch argument "{self.name}" was not provided.',
                    f'Required launch argument "{self.name}" (description: "{self.description}") was not provided',
                )
            else:
                context.launch_configurations[self.name] = perform_substitutions(context, self.default_value)
        if self.choices is not None and context.launch_configurations[self.name] not in self.choices:
            value = context.launch_configurations[self.name]
            self._fail(
                f'Argument "{self.name}" provided value "{value}" is not valid. Valid options are: {self.choices}'
            )


class SetLaunchConfiguration(Action):
    """Sets a launch configuration."""

    def __init__(self, name: SomeSubstitutionsType, value: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.name = normalize_to_list_of_substitutions(name)
        self.value = normalize_to_list_of_substitutions(value)

    def execute(self, context: LaunchContext) -> None:
        value = perform_substitutions(context, self.value)
        context.launch_configurations[perform_substitutions(context, self.name)] = value


class UnsetLaunchConfiguration(Action):
    """Takes a launch configuration away."""

    def __init__(self, name: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.name = normalize_to_list_of_substitutions(name)

    def execute(self, context: LaunchContext) -> None:
        context.launch_configurations.pop(perform_substitutions(context, self.name), None)


class ResetLaunchConfigurations(Action):
    """Takes all launch configurations away but those given here."""

    def __init__(
        self,
        launch_configurations: Mapping[SomeSubstitutionsType, SomeSubstitutionsType] | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        self._kept = launch_configurations or {}

    def execute(self, context: LaunchContext) -> None:
        kept = {
            perform_substitutions(context, normalize_to_list_of_substitutions(name)): perform_substitutions(
                context, normalize_to_list_of_substitutions(value)
            )
            for name, value in self._kept.items()
        }
        context.launch_configurations.clear()
        context.launch_configurations.update(kept)


class PushLaunchConfigurations(Action):
    """Remembers the launch configurations."""

    def execute(self, context: LaunchContext) -> None:
        context.push_launch_configurations()


class PopLaunchConfigurations(Action):
    """Goes back to the launch configurations remembered last."""

    def execute(self, context: LaunchContext) -> None:
        context.pop_launch_configurations()


class PushEnvironment(Action):
    """Remembers the environment."""

    def execute(self, context: LaunchContext) -> None:
        context.push_environment()


class PopEnvironment(Action):
    """Goes back to the environment remembered last."""

    def execute(self, context: LaunchContext) -> None:
        context.pop_environment()


class ResetEnvironment(Action):
    """Goes back to the environment in which the launch began."""

    def execute(self, context: LaunchContext) -> None:
        context.reset_environment()


class SetEnvironmentVariable(Action):
    """Sets an environment variable for the processes started later."""

    def __init__(self, name: SomeSubstitutionsType, value: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.name = normalize_to_list_of_substitutions(name)
        self.value = normalize_to_list_of_substitutions(value)

    def execute(self, context: LaunchContext) -> None:
        value = perform_substitutions(context, self.value)
        context.environment[perform_substitutions(context, self.name)] = value


class AppendEnvironmentVariable(Action):
    """Appends to an environment variable, or puts before it."""

    def __init__(
        self,
        name: SomeSubstitutionsType,
        value: SomeSubstitutionsType,
        prepend: bool | SomeSubstitutionsType = False,
        separator: SomeSubstitutionsType = os.pathsep,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        self.name = normalize_to_list_of_substitutions(name)
        self.value = normalize_to_list_of_substitutions(value)
        self.prepend = normalize_typed_substitution(prepend, bool)
        self.separator = normalize_to_list_of_substitutions(separator)

    def execute(self, context: LaunchContext) -> None:
        name = perform_substitutions(context, self.name)
        parts = [perform_substitutions(context, self.value)]
        if name in context.environment:
            before = not perform_typed_substitution(context, self.prepend, bool)
            parts.insert(0 if before else 1, context.environment[name])
        context.environment[name] = perform_substitutions(context, self.separator).join(parts)


class UnsetEnvironmentVariable(Action):
    """Takes an environment variable away."""

    def __init__(self, name: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.name = normalize_to_list_of_substitutions(name)

    def execute(self, context: LaunchContext) -> None:
        context.environment.pop(perform_substitutions(context, self.name), None)


class GroupAction(Action):
    """Actions in a scope of their own."""

    def __init__(
        self,
        actions: Iterable[Action],
        *,
        scoped: bool = True,
        forwarding: bool = True,
        launch_configurations: Mapping[SomeSubstitutionsType, SomeSubstitutionsType] | None = None,
        **left_over_kwargs: Any,
    ) -> None:
        super().__init__(**left_over_kwargs)
        self._actions = actions
        self._scoped = scoped
        self._forwarding = forwarding
        self._configurations = launch_configurations or {}
        self._entities: list[LaunchDescriptionEntity] | None = None

    def get_sub_entities(self) -> Sequence[LaunchDescriptionEntity]:
        if self._entities is None:
            self._entities = [*self._beginning(), *self._actions]
            if self._scoped:
                self._entities += [PopEnvironment(), PopLaunchConfigurations()]
        return self._entities

    def _beginning(self) -> list[Action]:
        begin: list[Action] = [PushLaunchConfigurations(), PushEnvironment()] if self._scoped else []
        if self._scoped and not self._forwarding:
            return [*begin, ResetEnvironment(), ResetLaunchConfigurations(self._configurations)]
        return [*begin, *(SetLaunchConfiguration(name, value) for name, value in self._configurations.items())]

    def execute(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity]:
        return self.get_sub_entities()


class LogInfo(Action):
    """Prints a line."""

    def __init__(self, *, msg: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.msg = normalize_to_list_of_substitutions(msg)

    def execute(self, context: LaunchContext) -> None:
        log("INFO", "launch.user", perform_substitutions(context, self.msg))


class OpaqueFunction(Action):
    """Calls a function, which may answer with further entities."""

    def __init__(
        self,
        *,
        function: Callable[..., Any],
        args: Iterable[Any] | None = None,
        kwargs: dict[str, Any] | None = None,
        **left_over_kwargs: Any,
    ) -> None:
        super().__init__(**left_over_kwargs)
        if not callable(function):
            raise TypeError(f"OpaqueFunction expected a callable for 'function', got '{type(function)}'")
        ensure_argument_type(args, (Iterable, type(None)), "args", "OpaqueFunction")
        ensure_argument_type(kwargs, (dict, type(None)), "kwargs", "OpaqueFunction")
        self._function = function
        self._args = [] if args is None else args
        self._kwargs = {} if kwargs is None else kwargs

    def execute(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity] | None:
        answer: Sequence[LaunchDescriptionEntity] | None = self._function(context, *self._args, **self._kwargs)
        return answer


class EmitEvent(Action):
    """Emits an event."""

    def __init__(self, *, event: Event, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        if not isinstance(event, Event):
            raise RuntimeError(  # noqa: TRY004 - the real one's
                f"EmitEvent() expected an event instance, got '{event}'."
            )
        self.event = event

    def execute(self, context: LaunchContext) -> None:
        context.emit_event_sync(self.event)


class Shutdown(EmitEvent):
    """Ends the launch."""

    def __init__(self, *, reason: str = "reason not given", **kwargs: Any) -> None:
        super().__init__(event=events.Shutdown(reason=reason), **kwargs)

    def execute(self, context: LaunchContext) -> None:
        event = context.get_locals_as_dict().get("event")
        if isinstance(event, events.ProcessExited):
            log("INFO", "launch", f"process[{event.process_name}] was required: shutting down launched system")
        super().execute(context)


class RegisterEventHandler(Action):
    """Registers an event handler."""

    def __init__(self, event_handler: BaseEventHandler, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.event_handler = event_handler

    def execute(self, context: LaunchContext) -> None:
        context.register_event_handler(self.event_handler)


class UnregisterEventHandler(Action):
    """Takes an event handler away."""

    def __init__(self, event_handler: BaseEventHandler, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.event_handler = event_handler

    def execute(self, context: LaunchContext) -> None:
        context.unregister_event_handler(self.event_handler)


class _TimerHandler(BaseEventHandler):
    """Lets a timer that is due yield its actions, and cancels it when the launch ends."""

    def __init__(self, timer: TimerAction, cancel_on_shutdown: bool) -> None:
        super().__init__(matcher=self._concerns)
        self._timer = timer
        self._cancel_on_shutdown = cancel_on_shutdown

    def _concerns(self, event: Event) -> bool:
        if isinstance(event, events.TimerEvent):
            return event.timer_action is self._timer
        return self._cancel_on_shutdown and isinstance(event, events.Shutdown)

    def handle(self, event: Event, context: LaunchContext) -> Any:
        if isinstance(event, events.Shutdown):
            return self._timer.cancel()
        context.extend_locals({"event": event})
        return self._timer.handle(context)


class TimerAction(Action):
    """Visits actions when a time has passed."""

    def __init__(
        self,
        *,
        period: float | SomeSubstitutionsType,
        actions: Iterable[LaunchDescriptionEntity],
        cancel_on_shutdown: bool | SomeSubstitutionsType = True,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        ensure_argument_type(period, (*SomeSubstitutionsType_types_tuple, float), "period", "TimerAction")
        ensure_argument_type(actions, Iterable, "actions", "TimerAction")
        if isinstance(period, str):
            period = float(period)
            warnings.warn(
                "The parameter 'period' must be a float or substitution,passing a string literal was deprecated",
                stacklevel=2,
            )
        self.period = normalize_typed_substitution(period, float)
        self.actions = actions
        self._cancel_on_shutdown = normalize_typed_substitution(cancel_on_shutdown, bool)
        self._locals: dict[str, Any] = {}
        self._cancelled = False
        self._context: LaunchContext | None = None
        self._timer: Timer | None = None

    def describe(self) -> str:
        return f"TimerAction(period={self.period}, actions=<actions>)"

    def describe_conditional_sub_entities(self) -> Sequence[tuple[str, Iterable[LaunchDescriptionEntity]]]:
        return [(f"{self.period} seconds pass without being canceled", self.actions)]

    def execute(self, context: LaunchContext) -> None:
        if self._cancelled or context.service is None:
            return
        self._locals = context.get_locals_as_dict()
        self._context = context
        seconds = perform_typed_substitution(context, self.period, float)
        cancel_on_shutdown = perform_typed_substitution(context, self._cancel_on_shutdown, bool)
        context.register_event_handler(_TimerHandler(self, cancel_on_shutdown))
        context.service.begin(self)
        self._timer = context.service.call_later(seconds, self._due)

    def _due(self) -> None:
        assert self._context is not None and self._context.service is not None
        self._timer = None
        self._context.emit_event_sync(events.TimerEvent(timer_action=self))
        self._context.service.end(self)

    def handle(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity]:
        """The actions, to be visited with the locals that were there when the timer was started."""
        context.extend_locals(self._locals)
        return self.actions

    def cancel(self) -> None:
        """Stop the timer, if it is not yet due."""
        self._cancelled = True
        if self._timer is not None:
            assert self._context is not None and self._context.service is not None
            self._timer.cancel()
            self._timer = None
            self._context.service.end(self)
