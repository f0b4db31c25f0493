"""Parameters of nodes as launch files give them: dictionaries, YAML files, and `launch_ros.parameter_descriptions`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from . import api
from .core import (
    Known,
    LaunchContext,
    SomeSubstitutionsType_types_tuple,
    Substitution,
    TextSubstitution,
    ensure_argument_type,
    normalize_to_list_of_substitutions,
    normalize_typed_substitution,
    perform_substitutions,
    perform_typed_substitution,
    yaml_value,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from .core import SomeSubstitutionsType

    # A name is a tuple of substitutions; a value a scalar, a tuple, or something to be performed.
    Normalized = dict[tuple[Substitution, ...], Any]

_SCALARS = (bool, int, float, str)
_QUOTE = "If the parameter is meant to be a string, try wrapping it in launch_ros.parameter_descriptions.ParameterValue"


class ParameterValue(Known):
    """A value, which a substitution may give, and its type."""

    def __init__(self, value: Any, *, value_type: Any = None) -> None:
        self.value = normalize_typed_substitution(value, value_type)
        self.value_type = value_type

    def evaluate(self, context: LaunchContext) -> Any:
        """The value."""
        return perform_typed_substitution(context, self.value, self.value_type)


class Parameter(Known):
    """A name and a value, passed to the node as `-p name:=value`."""

    def __init__(self, name: SomeSubstitutionsType, value: Any, *, value_type: Any = None) -> None:
        ensure_argument_type(name, SomeSubstitutionsType_types_tuple, "name")
        self.name = normalize_to_list_of_substitutions(name)
        self._value = ParameterValue(value, value_type=value_type)

    def evaluate(self, context: LaunchContext) -> tuple[str, Any]:
        """Name and value."""
        return perform_substitutions(context, self.name), self._value.evaluate(context)


class ParameterFile(Known):
    """A YAML file of parameters."""

    def __init__(
        self, param_file: SomeSubstitutionsType | os.PathLike[str] | bytes, *, allow_substs: bool = False
    ) -> None:
        kinds = (*SomeSubstitutionsType_types_tuple, os.PathLike, bytes)
        ensure_argument_type(param_file, kinds, "param_file", "ParameterFile()")
        ensure_argument_type(allow_substs, bool, "allow_subst", "ParameterFile()")
        if allow_substs:
            api.refuse("ParameterFile(allow_substs=True)")
        if isinstance(param_file, os.PathLike | bytes):
            self._subs: list[Substitution] = [TextSubstitution(text=os.fsdecode(param_file))]
        else:
            self._subs = normalize_to_list_of_substitutions(param_file)

    def evaluate(self, context: LaunchContext) -> Path:
        """The path of the file."""
        return Path(perform_substitutions(context, self._subs))


def normalize_parameters(parameters: Any) -> list[ParameterFile | Parameter | Normalized]:
    """Prepare what a node is given as `parameters`.

    Raises:
        TypeError: It is not a list of dictionaries, paths and descriptions.
    """
    if isinstance(parameters, str) or not isinstance(parameters, Sequence):
        raise TypeError(f"Expecting list of parameters, got {parameters}")
    return [_normalize(entry) for entry in parameters]


def _normalize(entry: Any) -> ParameterFile | Parameter | Normalized:
    if isinstance(entry, Mapping):
        return normalize_parameter_dict(entry)
    return entry if isinstance(entry, Parameter | ParameterFile) else ParameterFile(entry)


def normalize_parameter_dict(parameters: Mapping[Any, Any], prefix: Sequence[Substitution] = ()) -> Normalized:
    """Prepare a dictionary of parameters; nested ones become names with dots.

    Raises:
        TypeError: A value is of no type that a parameter can have.
    """
    if not isinstance(parameters, Mapping):
        raise TypeError("expected dict")
    normalized: Normalized = {}
    for key, value in parameters.items():
        name = normalize_to_list_of_substitutions(key)
        if prefix:
            name = [*prefix, TextSubstitution(text="."), *name]
        if isinstance(value, Mapping):
            normalized.update(normalize_parameter_dict(value, name))
        elif isinstance(value, Substitution):
            normalized[tuple(name)] = (value,)
        elif isinstance(value, ParameterValue | str | float | bool | int | bytes):
            normalized[tuple(name)] = value
        elif isinstance(value, Sequence):
            normalized[tuple(name)] = _normalize_sequence(value)
        else:
            raise TypeError(f"Unexpected type for parameter value {value!r}")
    return normalized


def _normalize_sequence(values: Sequence[Any]) -> tuple[Any, ...]:
    for value in values:
        ensure_argument_type(value, (float, int, str, bool, *SomeSubstitutionsType_types_tuple), "subvalue")
    kinds = {Substitution if isinstance(value, Substitution) else type(value) for value in values}
    if Substitution in kinds and kinds <= {str, Substitution}:
        return tuple(normalize_to_list_of_substitutions(values))  # one text made of several parts
    if kinds == {int, float}:
        return tuple(float(value) for value in values)
    if len(kinds) == 1 and kinds <= set(_SCALARS):
        return tuple(values)
    # What is left are lists of substitutions, each of which makes one item.
    return tuple(
        [value] if isinstance(value, _SCALARS) else normalize_to_list_of_substitutions(value) for value in values
    )


def evaluate_parameter_dict(context: LaunchContext, parameters: Normalized) -> dict[str, Any]:
    """Names and values of a prepared dictionary; values are scalars, bytes or tuples.

    Raises:
        TypeError: A performed value is of no type that a parameter can have.
    """
    values: dict[str, Any] = {}
    for key, value in parameters.items():
        name = perform_substitutions(context, key)
        values[name] = _evaluate(context, name, value)
    return values


def _evaluate(context: LaunchContext, name: str, value: Any) -> Any:
    if isinstance(value, ParameterValue):
        return value.evaluate(context)
    if not isinstance(value, tuple):
        return value
    if not value:
        ensure_argument_type(value, (float, int, str, bool, bytes), "value")
    if isinstance(value[0], Substitution):
        return _typed(name, perform_substitutions(context, value))
    if isinstance(value[0], list):
        items = [
            entry[0] if isinstance(entry[0], _SCALARS) else yaml_value(perform_substitutions(context, entry))
            for entry in value
        ]
        return _uniform(name, items)
    return value


def _typed(name: str, text: str) -> Any:
    try:
        value = yaml_value(text) if text else ""
    except Exception as error:
        raise TypeError(
            f"Unable to parse the value of parameter {name} as yaml. {_QUOTE}(value, value_type=str)"
        ) from error
    if isinstance(value, (*_SCALARS, bytes)):
        return value
    if isinstance(value, Sequence):
        return _uniform(name, value)
    raise TypeError(
        "Allowed value types are bytes, bool, int, float, str, Sequence[bool], Sequence[int], Sequence[float], "
        f'Sequence[str]. Got {type(value)} for "{name}". {_QUOTE}(value, value_type=str)'
    )


def _uniform(name: str, values: Sequence[Any]) -> tuple[Any, ...]:
    if not values or type(values[0]) not in _SCALARS or not all(isinstance(x, type(values[0])) for x in values):
        raise TypeError(
            "Expected a non-empty sequence, with items of uniform type. Allowed sequence item types are "
            f'bool, int, float, str. Got inconsistent input for "{name}"'
        )
    return tuple(values)


def as_yaml(value: Any) -> str:
    """*value* in YAML that keeps its type: true, 1, 1.0, "text", [1, 2], {"name": 1}."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return _float_as_yaml(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{as_yaml(str(key))}: {as_yaml(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(as_yaml(entry) for entry in value) + "]"
    if isinstance(value, bytes):
        api.refuse("a parameter of type bytes")
    return '"' + "".join(_ESCAPES.get(char) or _escaped(char) for char in str(value)) + '"'


_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def _escaped(char: str) -> str:
    return char if char.isprintable() else f"\\U{ord(char):08x}"


def _float_as_yaml(value: float) -> str:
    text = repr(value)
    special = {"inf": ".inf", "-inf": "-.inf", "nan": ".nan"}
    if text in special:
        return special[text]
    mantissa, e, exponent = text.partition("e")
    return text if "." in mantissa or not e else f"{mantissa}.0e{exponent}"
