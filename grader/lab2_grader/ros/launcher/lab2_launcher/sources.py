"""Where launch descriptions come from: Python launch files, by path or included by another."""

from __future__ import annotations

import os
from contextlib import suppress
from types import ModuleType

from . import api
from .core import (
    Action,
    InvalidLaunchFileError,
    Known,
    LaunchContext,
    LaunchDescription,
    LaunchDescriptionEntity,
    normalize_to_list_of_substitutions,
    perform_substitutions,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

    from .core import SomeSubstitutionsType

_MARKUP = (".xml", ".yaml", ".yml", ".launch")


class InvalidPythonLaunchFileError(Exception):
    """A Python launch file without `generate_launch_description`."""


class InvalidFrontendLaunchFileError(InvalidLaunchFileError):
    """What the real one reports of its attempt to read a Python file as XML or YAML."""


def load_python_launch_file_as_module(python_launch_file_path: str) -> ModuleType:
    """Execute a Python launch file.

    Raises:
        Exception: Whatever it raises.
    """
    module = ModuleType("python_launch_file")
    module.__file__ = python_launch_file_path
    with open(python_launch_file_path, "rb") as file:
        code = compile(file.read(), python_launch_file_path, "exec", dont_inherit=True)
    exec(code, module.__dict__)
    return module


def get_launch_description_from_python_launch_file(python_launch_file_path: str) -> Any:
    """What `generate_launch_description` of a Python launch file returns, ideally a LaunchDescription.

    Raises:
        InvalidPythonLaunchFileError: It has no such function.
        Exception: Whatever the file raises.
    """
    module = load_python_launch_file_as_module(python_launch_file_path)
    if not hasattr(module, "generate_launch_description"):
        raise InvalidPythonLaunchFileError(
            f"launch file at '{python_launch_file_path}' does not contain the required function "
            "'generate_launch_description()'"
        )
    return module.generate_launch_description()


def get_launch_description_from_any_launch_file(launch_file_path: str) -> Any:
    """What a launch file describes.

    Raises:
        InvalidLaunchFileError: It cannot be loaded; the text says why, as that of the real one.
        api.Unsupported: It is written in XML or YAML.
    """
    extension = os.path.splitext(launch_file_path)[1]
    if extension in _MARKUP:
        api.refuse(f"launch file {os.path.basename(launch_file_path)}: only Python launch files are supported")
    try:
        return get_launch_description_from_python_launch_file(launch_file_path)
    except Exception as error:
        errors = [error, InvalidFrontendLaunchFileError()]
        raise InvalidLaunchFileError("py" if extension == ".py" else "", likely_errors=errors) from error


class LaunchDescriptionSource(Known):
    """A launch description, or the launch file that it will be loaded from."""

    def __init__(
        self,
        launch_description: LaunchDescription | None = None,
        location: SomeSubstitutionsType = "<string>",
        method: str = "unspecified mechanism from a script",
    ) -> None:
        self.method = method
        self._description: Any = launch_description
        self._location = normalize_to_list_of_substitutions(location)
        self._path: str | None = None

    @property
    def location(self) -> str:
        """The path, or what it will be made of."""
        return " + ".join(str(sub) for sub in self._location) if self._path is None else self._path

    def get_launch_description(self, context: LaunchContext) -> Any:
        """The launch description, loaded if it was not before."""
        if self._path is None:
            self._path = perform_substitutions(context, self._location)
        if self._description is None:
            self._description = self._get_launch_description(self._path)
        return self._description

    def try_get_launch_description_without_context(self) -> Any:
        """The launch description, if its path does not depend on the launch and it can be loaded; else None."""
        if self._description is None:
            with suppress(Exception):
                self._description = self._get_launch_description(perform_substitutions(LaunchContext(), self._location))
        return self._description

    def _get_launch_description(self, location: str) -> Any:
        raise RuntimeError(
            "LaunchDescriptionSource.get_launch_description(): called without launch description being set"
        )


class PythonLaunchDescriptionSource(LaunchDescriptionSource):
    """A Python launch file, by path."""

    def __init__(self, launch_file_path: SomeSubstitutionsType) -> None:
        super().__init__(None, launch_file_path, "interpreted python launch file")

    def _get_launch_description(self, location: str) -> Any:
        return get_launch_description_from_python_launch_file(location)


class AnyLaunchDescriptionSource(LaunchDescriptionSource):
    """A launch file of any kind, by path; of us, a Python one."""

    def __init__(self, launch_file_path: SomeSubstitutionsType) -> None:
        super().__init__(None, launch_file_path, "interpreted from launch file")

    def _get_launch_description(self, location: str) -> Any:
        return get_launch_description_from_any_launch_file(location)


class IncludeLaunchDescription(Action):
    """Includes another launch file."""

    def __init__(
        self,
        launch_description_source: LaunchDescriptionSource | SomeSubstitutionsType,
        *,
        launch_arguments: Iterable[tuple[SomeSubstitutionsType, SomeSubstitutionsType]] | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        if not isinstance(launch_description_source, LaunchDescriptionSource):
            launch_description_source = AnyLaunchDescriptionSource(launch_description_source)
        self.launch_description_source = launch_description_source
        self.launch_arguments = () if launch_arguments is None else tuple(launch_arguments)

    def get_sub_entities(self) -> Sequence[LaunchDescriptionEntity]:
        description = self.launch_description_source.try_get_launch_description_without_context()
        return [] if description is None else [description]

    def execute(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity]:
        from .actions import SetLaunchConfiguration

        description = self.launch_description_source.get_launch_description(context)
        path = os.path.abspath(self.launch_description_source.location)
        directory = os.path.dirname(path) if os.path.exists(path) else self.launch_description_source.location
        context.extend_locals({"current_launch_file_path": path, "current_launch_file_directory": directory})
        self._require_arguments(context, description)
        return [*(SetLaunchConfiguration(name, value) for name, value in self.launch_arguments), description]

    def _require_arguments(self, context: LaunchContext, description: Any) -> None:
        """Raise a RuntimeError when an argument without a default that the file declares was not given."""
        given = self._argument_names(context)
        for argument, includes in description.get_launch_arguments_with_include_launch_description_actions():
            if argument.conditionally_included or argument.default_value is not None:
                continue
            for include in includes or ():
                given.extend(include._argument_names(LaunchContext()))
            if argument.name not in given:
                raise RuntimeError(
                    f"Included launch description missing required argument '{argument.name}' "
                    f"(description: '{argument.description}'), given: [{', '.join(given)}]"
                )

    def _argument_names(self, context: LaunchContext) -> list[str]:
        return [
            perform_substitutions(context, normalize_to_list_of_substitutions(name))
            for name, _ in self.launch_arguments
        ]
