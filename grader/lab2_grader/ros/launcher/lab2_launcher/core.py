"""What launch descriptions are made of: entities, actions, substitutions, conditions, events, and their context."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence

from . import api
from .output import log

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, MutableMapping
    from typing import Any

    from .service import LaunchService


class Known:
    """Base of what launch files get from us: an attribute that only the real object has is refused by name."""

    def __getattr__(self, name: str) -> Any:
        api.missing_attribute(self, name)


# --- substitutions ------------------------------------------------------------------------------


class Substitution(Known):
    """A text that is worked out while launching."""

    def perform(self, context: LaunchContext) -> str:
        """The text.

        Raises:
            NotImplementedError: A class made from this one does not say how.
        """
        raise NotImplementedError("perform() not implemented for Substitution base class.")

    def describe(self) -> str:
        """A description for people."""
        return repr(self)


class TextSubstitution(Substitution):
    """A text that stands as it is."""

    def __init__(self, *, text: str) -> None:
        if not isinstance(text, str):
            raise TypeError(f"TextSubstitution expected Text object got '{type(text)}' instead.")
        self.text = text

    def perform(self, context: LaunchContext) -> str:
        return self.text

    def describe(self) -> str:
        return f"'{self.text}'"


SomeSubstitutionsType_types_tuple = (str, Substitution, Iterable)
if TYPE_CHECKING:
    SomeSubstitutionsType = str | Substitution | Iterable[str | Substitution]
else:
    SomeSubstitutionsType = SomeSubstitutionsType_types_tuple


def normalize_to_list_of_substitutions(subs: SomeSubstitutionsType) -> list[Substitution]:
    """Make a list of substitutions of a text, a substitution or a sequence of both.

    Raises:
        TypeError: It is something else.
    """
    if isinstance(subs, str):
        return [TextSubstitution(text=subs)]
    if isinstance(subs, Substitution):
        return [subs]
    entries: Iterable[object] = subs
    return [_normalized(entry) for entry in entries]


def _normalized(entry: object) -> Substitution:
    if isinstance(entry, Substitution):
        return entry
    if isinstance(entry, str):
        return TextSubstitution(text=entry)
    raise TypeError(
        f"Failed to normalize given item of type '{type(entry)}', when only "
        "'str' or 'launch.Substitution' were expected."
    )


def perform_substitutions(context: LaunchContext, subs: Iterable[Substitution]) -> str:
    """The text of several substitutions, one after the other."""
    return "".join([context.perform_substitution(sub) for sub in subs])


def ensure_argument_type(argument: object, types: Any, argument_name: str, caller: str | None = None) -> None:
    """Refuse an argument of the wrong type.

    Raises:
        TypeError: *argument* is of none of *types*.
    """
    kinds = types if isinstance(types, Iterable) else [types]
    if not any(isinstance(argument, kind) for kind in kinds):
        start = "E" if caller is None else f"'{caller}' e"
        listed = ", ".join(str(kind) for kind in kinds)
        raise TypeError(
            f"{start}xpected '{argument_name}' to be one of [{listed}], but got '{argument}' of type '{type(argument)}'"
        )


# --- values with a type -------------------------------------------------------------------------

_SCALARS = (int, float, bool, str)


def yaml_value(text: str) -> Any:
    """What *text* means in YAML, the rule by which launch finds the type of a performed substitution."""
    if text.isascii() and text.isalpha() and text.lower() not in _YAML_WORDS:
        return text
    import yaml  # type: ignore[import-untyped, unused-ignore]  # costs 30 ms, and comes with rclpy

    return yaml.safe_load(text)


_YAML_WORDS = frozenset(("y", "n", "yes", "no", "on", "off", "true", "false", "null"))


def is_substitution(value: object) -> bool:
    """Whether *value* is a substitution, or a sequence of texts and at least one substitution."""
    if isinstance(value, Substitution):
        return True
    return (
        isinstance(value, Iterable)
        and not isinstance(value, str)
        and all(isinstance(entry, Substitution | str) for entry in value)
        and any(isinstance(entry, Substitution) for entry in value)
    )


def _element_type(data_type: Any) -> tuple[Any, bool]:
    """The scalar type that *data_type* (`int`, `List[int]`, …) is made of, and whether it is a list."""
    is_list = getattr(data_type, "__origin__", None) is list
    scalar = data_type.__args__[0] if is_list else data_type
    if scalar not in _SCALARS:
        raise ValueError(f"Unrecognized data type: {data_type}")
    return scalar, is_list


def _is_instance(value: Any, data_type: Any) -> bool:
    if data_type is None:
        if isinstance(value, list):
            return not value or (type(value[0]) in _SCALARS and all(isinstance(x, type(value[0])) for x in value))
        return isinstance(value, _SCALARS)
    scalar, is_list = _element_type(data_type)
    if is_list:
        return isinstance(value, list) and all(isinstance(entry, scalar) for entry in value)
    return isinstance(value, scalar)


def normalize_typed_substitution(value: Any, data_type: Any) -> Any:
    """Prepare a value that may also be given as a substitution: a scalar, a list, or a list of substitutions.

    Raises:
        TypeError: It can never become a *data_type*.
    """
    if isinstance(value, _SCALARS):
        if not _is_instance(value, data_type):
            raise TypeError(f"value='{value}' is not an instance of {data_type}")
        return value
    if is_substitution(value):
        return normalize_to_list_of_substitutions(value)
    if not isinstance(value, Iterable):
        raise TypeError(
            "value should be either a scalar, a substitutions, or a mixed list of scalars and substitutions. "
            f"Got `value={value}` of type `{type(value)}`. "
        )
    entries = list(value)
    scalar, is_list = (None, True) if data_type is None else _element_type(data_type)
    if not is_list:
        raise TypeError(
            "The provided value resolves to a list, though the required type is a scalar. "
            f"Got value='{value}', data_type='{scalar}'."
        )
    kinds = {type(entry) for entry in entries if isinstance(entry, _SCALARS)}
    if not all(isinstance(entry, _SCALARS) or is_substitution(entry) for entry in entries):
        raise TypeError(
            "value is a list, and one of the items is not a scalar, a Substitution "
            f"or a list of substitutions. Got value='{value}'"
        )
    if kinds == {int, float}:
        entries = [float(entry) if isinstance(entry, int) else entry for entry in entries]
        kinds = {float}
    if len(kinds) > 1:
        raise TypeError(f"Input value is not an acceptable 'SomeValueType'.Got value='{value}'")
    if kinds and scalar not in (None, *kinds):
        raise TypeError(f"Got a list of '{kinds.pop()}', expected a list of '{scalar}'. value='{value}'")
    return [normalize_to_list_of_substitutions(entry) if is_substitution(entry) else entry for entry in entries]


def coerce(text: str, data_type: Any) -> Any:
    """Make a *data_type* of a performed substitution, by the rules of YAML when *data_type* is None.

    Raises:
        ValueError: It is not one.
    """
    scalar, is_list = (None, False) if data_type is None else _element_type(data_type)
    if not is_list:
        if scalar is str:
            return text
        if scalar in (int, float):
            return scalar(text)
        if scalar is bool:
            text = {"1": "true", "0": "false"}.get(text, text)
    try:
        value = yaml_value(text) if text else text
    except Exception as error:
        raise ValueError(f"Failed to convert '{text}' using yaml rules: yaml.safe_load() failed\n{error}") from error
    if not _is_instance(value, data_type):
        if data_type is None:
            raise ValueError(
                f"Failed to convert '{text}' using yaml rules: output type is not allowed, got {type(value)}"
            )
        raise ValueError(f"Cannot convert value '{text}' to '{data_type}'")
    return value


def perform_typed_substitution(context: LaunchContext, value: Any, data_type: Any) -> Any:
    """The value of what `normalize_typed_substitution` prepared.

    Raises:
        ValueError: It is not a *data_type*.
    """
    if not isinstance(value, list):
        return value
    if value and all(isinstance(entry, Substitution) for entry in value):
        return coerce(perform_substitutions(context, value), data_type)
    scalar = None if data_type is None else _element_type(data_type)[0]
    performed = [
        coerce(perform_substitutions(context, entry), scalar) if isinstance(entry, list) else entry for entry in value
    ]
    if not _is_instance(performed, data_type):
        raise ValueError(
            "The output list is not uniform"
            if data_type is None
            else f"The output list does not match the expected type Got value='{value}', expected type {scalar}."
        )
    return performed


# --- conditions ---------------------------------------------------------------------------------


class Condition(Known):
    """Decides while launching whether an action is executed."""

    def __init__(self, *, predicate: Callable[[LaunchContext], bool] | None = None) -> None:
        self._predicate = predicate

    def evaluate(self, context: LaunchContext) -> bool:
        """The decision; False without a predicate."""
        return self._predicate(context) if self._predicate is not None else False

    def describe(self) -> str:
        """A description for people."""
        return repr(self)


# --- events -------------------------------------------------------------------------------------


class Event(Known):
    """Something that happened while launching."""

    name = "launch.Event"


class BaseEventHandler(Known):
    """Answers events with further entities."""

    def __init__(self, *, matcher: Callable[[Event], bool], handle_once: bool = False) -> None:
        self._matcher = matcher
        self.handle_once = handle_once

    def matches(self, event: Event) -> bool:
        """Whether *event* is one for this handler."""
        return self._matcher(event)

    def handle(self, event: Event, context: LaunchContext) -> Any:
        """What to visit because of *event*: nothing, an entity, or several."""
        context.extend_locals({"event": event})
        if self.handle_once:
            context.unregister_event_handler(self)
        return None


class EventHandler(BaseEventHandler):
    """Answers with always the same entities."""

    def __init__(
        self,
        *,
        matcher: Callable[[Event], bool],
        entities: Any = None,
        handle_once: bool = False,
    ) -> None:
        super().__init__(matcher=matcher, handle_once=handle_once)
        self.entities = entities

    def handle(self, event: Event, context: LaunchContext) -> Any:
        super().handle(event, context)
        return self.entities


class ExecutionComplete(Event):
    """An action was executed and all that it began has ended."""

    name = "launch.events.ExecutionComplete"

    def __init__(self, *, action: Action) -> None:
        self.action = action


# --- entities -----------------------------------------------------------------------------------


class LaunchDescriptionEntity(Known):
    """One item of a launch description."""

    def visit(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity] | None:
        """Do what the item is for; answer with further entities to visit."""
        return None

    def describe(self) -> str:
        """A description for people."""
        raise NotImplementedError

    def describe_sub_entities(self) -> Sequence[LaunchDescriptionEntity]:
        """Entities that will be visited because of this one."""
        return []

    def describe_conditional_sub_entities(self) -> Sequence[tuple[str, Iterable[LaunchDescriptionEntity]]]:
        """Entities that may be visited because of this one, with the condition."""
        return []


SomeEntitiesType_types_tuple = (LaunchDescriptionEntity, Iterable)
SomeEntitiesType = SomeEntitiesType_types_tuple


class Action(LaunchDescriptionEntity):
    """An entity that does something, if its condition allows."""

    def __init__(self, *, condition: Condition | None = None) -> None:
        self.condition = condition
        self._on_completion: list[Callable[[], None]] = []

    def describe(self) -> str:
        return repr(self)

    def get_sub_entities(self) -> Sequence[LaunchDescriptionEntity]:
        """Entities that this action brings along."""
        return []

    def describe_sub_entities(self) -> Sequence[LaunchDescriptionEntity]:
        return self.get_sub_entities() if self.condition is None else []

    def describe_conditional_sub_entities(self) -> Sequence[tuple[str, Iterable[LaunchDescriptionEntity]]]:
        if self.condition is None:
            return []
        return [(f"Conditionally included by {self.describe()}", self.get_sub_entities())]

    def visit(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity] | None:
        if self.condition is not None and not self.condition.evaluate(context):
            return None
        try:
            return self.execute(context)
        finally:
            event = ExecutionComplete(action=self)
            if context.would_handle_event(event):
                if context.service is not None and context.service.is_active(self):
                    self._on_completion.append(lambda: context.emit_event_sync(event))
                else:
                    context.emit_event_sync(event)

    def execute(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity] | None:
        """Do it; answer with further entities to visit."""
        return None

    def completed(self) -> None:
        """All that the action began has ended."""
        for callback in self._on_completion:
            callback()
        self._on_completion.clear()


class LaunchDescription(LaunchDescriptionEntity):
    """A list of entities: what `generate_launch_description` returns."""

    def __init__(
        self,
        initial_entities: Iterable[LaunchDescriptionEntity] | None = None,
        *,
        deprecated_reason: str | None = None,
    ) -> None:
        self.entities = list(initial_entities) if initial_entities is not None else []
        self.deprecated_reason = deprecated_reason

    @property
    def deprecated(self) -> bool:
        """Whether a reason was given not to use it any more."""
        return self.deprecated_reason is not None

    def add_entity(self, entity: LaunchDescriptionEntity) -> None:
        """Append *entity*."""
        self.entities.append(entity)

    def add_action(self, action: Action) -> None:
        """Append *action*."""
        self.add_entity(action)

    def describe_sub_entities(self) -> Sequence[LaunchDescriptionEntity]:
        return self.entities

    def visit(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity] | None:
        if self.deprecated_reason is not None:
            path = context.get_locals_as_dict().get("current_launch_file_path")
            what = f"launch file [{path}] is deprecated" if path else "deprecated launch description"
            log("WARNING", "root", f"{what}: {self.deprecated_reason}")
        return self.entities

    def get_launch_arguments(self, conditional_inclusion: bool = False) -> list[Any]:
        """The launch arguments that the description declares, as far as that shows without launching it."""
        return [
            pair[0] for pair in self.get_launch_arguments_with_include_launch_description_actions(conditional_inclusion)
        ]

    # The long name is the real API's; it also shows in the error of a launch file that returns something else.
    def get_launch_arguments_with_include_launch_description_actions(
        self, conditional_inclusion: bool = False
    ) -> list[tuple[Any, Any]]:
        """The declared launch arguments, each with the include actions around it (None: the file's own)."""
        from .actions import DeclareLaunchArgument, ResetLaunchConfigurations
        from .sources import IncludeLaunchDescription

        found: dict[str, tuple[DeclareLaunchArgument, list[IncludeLaunchDescription] | None]] = {}

        def search(entities: Iterable[LaunchDescriptionEntity], conditional: bool, includes: list[Any] | None) -> None:
            for entity in entities:
                if isinstance(entity, DeclareLaunchArgument) and entity.name not in found:
                    entity.conditionally_included = conditional or entity.condition is not None
                    found[entity.name] = (entity, includes)
                if isinstance(entity, ResetLaunchConfigurations):
                    return
                inner = includes
                if isinstance(entity, IncludeLaunchDescription):
                    inner = [*(includes or ()), entity]
                search(entity.describe_sub_entities(), False, inner)
                for _, entities_below in entity.describe_conditional_sub_entities():
                    search(entities_below, True, inner)

        search(self.entities, conditional_inclusion, None)
        return list(found.values())


class InvalidLaunchFileError(Exception):
    """A launch file that cannot be loaded.

    Args:
        extension: The file's, without the dot.
        likely_errors: What went wrong, in the order of the attempts.
    """

    def __init__(self, extension: str = "", *, likely_errors: Sequence[Exception] | None = None) -> None:
        super().__init__(extension)
        if not extension or not likely_errors:
            self._text = "The launch file may have a syntax error, or its format is unknown"
            return
        several = "multiple exceptions" if len(likely_errors) > 1 else "exception"
        self._text = f"Caught {several} when trying to load file of format [{extension}]:"
        for error in likely_errors:
            self._text += f"\n - {type(error).__name__}: {error}"
        self.__cause__ = likely_errors[0]

    def __str__(self) -> str:
        return self._text


# --- context ------------------------------------------------------------------------------------


class _Locals:
    """Read-only view of the context's local values as attributes."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.__dict__["_values"] = values

    def __getattr__(self, name: str) -> Any:
        values = self.__dict__["_values"]
        if name not in values:
            raise AttributeError(
                f"context.locals does not contain attribute '{name}', it contains: [{', '.join(values)}]"
            )
        return values[name]

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"can't set attribute '{name}', locals are read-only")


class LaunchContext(Known):
    """What entities know of the launch while they are visited."""

    def __init__(self, *, argv: Iterable[str] | None = None, noninteractive: bool = False) -> None:
        self.argv = argv if argv is not None else []
        self.noninteractive = noninteractive
        self.is_shutdown = False
        self.service: LaunchService | None = None
        self.launch_configurations: dict[str, Any] = {}
        self.events: list[Event] = []
        self.handlers: list[BaseEventHandler] = []
        self._configurations_stack: list[dict[str, Any]] = []
        self._environment_stack: list[dict[str, str]] = []
        self._environment_at_start = dict(os.environ)
        self._globals: dict[str, Any] = {}
        self._locals: dict[str, Any] = {}
        self._locals_stack: list[dict[str, Any]] = []

    @property
    def environment(self) -> MutableMapping[str, str]:
        """The environment that processes get; it is the launcher's own."""
        return os.environ

    @property
    def locals(self) -> _Locals:
        """The local values, as attributes."""
        return _Locals(self.get_locals_as_dict())

    def get_locals_as_dict(self) -> dict[str, Any]:
        """The local values."""
        return {**self._globals, **self._locals}

    def extend_globals(self, extensions: Mapping[str, Any]) -> None:
        """Add values that stay."""
        self._globals.update(extensions)

    def extend_locals(self, extensions: Mapping[str, Any]) -> None:
        """Add values that stay until the event at hand is done with."""
        self._locals.update(extensions)

    def push_locals(self) -> None:
        """Remember the local values."""
        self._locals_stack.append(dict(self._locals))

    def pop_locals(self) -> None:
        """Go back to the local values remembered last."""
        self._locals = self._locals_stack.pop()

    def push_launch_configurations(self) -> None:
        """Remember the launch configurations."""
        self._configurations_stack.append(dict(self.launch_configurations))

    def pop_launch_configurations(self) -> None:
        """Go back to the launch configurations remembered last."""
        if not self._configurations_stack:
            raise RuntimeError("launch_configurations stack unexpectedly empty")
        self.launch_configurations = self._configurations_stack.pop()

    def push_environment(self) -> None:
        """Remember the environment."""
        self._environment_stack.append(dict(os.environ))

    def pop_environment(self) -> None:
        """Go back to the environment remembered last."""
        if not self._environment_stack:
            raise RuntimeError("environment stack unexpectedly empty")
        self._set_environment(self._environment_stack.pop())

    def reset_environment(self) -> None:
        """Go back to the environment in which the launch began."""
        self._set_environment(self._environment_at_start)

    @staticmethod
    def _set_environment(values: Mapping[str, str]) -> None:
        os.environ.clear()
        os.environ.update(values)

    def perform_substitution(self, substitution: Substitution) -> str:
        """The text of *substitution*."""
        return substitution.perform(self)

    def emit_event_sync(self, event: Event) -> None:
        """Let *event* be handled after those that came before it."""
        self.events.append(event)

    def would_handle_event(self, event: Event) -> bool:
        """Whether any handler is there for *event*."""
        return any(handler.matches(event) for handler in self.handlers)

    def register_event_handler(self, event_handler: BaseEventHandler, append: bool = False) -> None:
        """Add a handler, before the others unless *append*."""
        self.handlers.insert(len(self.handlers) if append else 0, event_handler)

    def unregister_event_handler(self, event_handler: BaseEventHandler) -> None:
        """Take a handler away."""
        self.handlers.remove(event_handler)
