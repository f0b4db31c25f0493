"""The substitutions of `launch.substitutions`."""

from __future__ import annotations

import os
from collections.abc import Iterable

from . import output
from .core import (
    LaunchContext,
    Substitution,
    TextSubstitution,
    ensure_argument_type,
    is_substitution,
    normalize_to_list_of_substitutions,
    perform_substitutions,
    perform_typed_substitution,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from .core import SomeSubstitutionsType

__all__ = ["TextSubstitution"]  # it stands in `core`; offered from here


class SubstitutionFailure(RuntimeError):
    """A substitution could not be performed."""

    def __init__(self, msg: object) -> None:
        super().__init__(msg)


def described(subs: Iterable[Substitution]) -> str:
    """Descriptions of several substitutions in one."""
    return " + ".join(sub.describe() for sub in subs)


def normalized_default(default: Any) -> list[Substitution] | None:
    """Make substitutions of a default of any type, as LaunchConfiguration takes it; None stays None."""
    if default is None:
        return None
    entries = default if isinstance(default, Iterable) else [default]
    return normalize_to_list_of_substitutions(
        [entry if isinstance(entry, str | Substitution) else str(entry) for entry in entries]
    )


class LaunchConfiguration(Substitution):
    """The value of a launch configuration, which is also how launch arguments are read."""

    def __init__(self, variable_name: SomeSubstitutionsType, *, default: Any = None) -> None:
        self.variable_name = normalize_to_list_of_substitutions(variable_name)
        self._default = normalized_default(default)

    def describe(self) -> str:
        return f"LaunchConfig({described(self.variable_name)})"

    def perform(self, context: LaunchContext) -> str:
        name = perform_substitutions(context, self.variable_name)
        if name in context.launch_configurations:
            value: str = context.launch_configurations[name]
            return value
        if self._default is None:
            raise SubstitutionFailure(f"launch configuration '{name}' does not exist")
        return perform_substitutions(context, self._default)


class EnvironmentVariable(Substitution):
    """The value of an environment variable of the launch."""

    def __init__(self, name: SomeSubstitutionsType, *, default_value: SomeSubstitutionsType | None = None) -> None:
        self.name = normalize_to_list_of_substitutions(name)
        self.default_value = None if default_value is None else normalize_to_list_of_substitutions(default_value)

    def describe(self) -> str:
        return f"EnvVar({described(self.name)})"

    def perform(self, context: LaunchContext) -> str:
        default = None if self.default_value is None else perform_substitutions(context, self.default_value)
        name = perform_substitutions(context, self.name)
        value = context.environment.get(name, default)
        if value is None:
            raise SubstitutionFailure(f"environment variable '{name}' does not exist")
        return value


class PathJoinSubstitution(Substitution):
    """Paths joined."""

    def __init__(self, substitutions: Iterable[str | Substitution]) -> None:
        self.substitutions = normalize_to_list_of_substitutions(substitutions)

    def describe(self) -> str:
        return f"PathJoin('{described(self.substitutions)}')"

    def perform(self, context: LaunchContext) -> str:
        return os.path.join(*[sub.perform(context) for sub in self.substitutions])


class PythonExpression(Substitution):
    """The value of a Python expression, as text."""

    def __init__(self, expression: SomeSubstitutionsType, python_modules: SomeSubstitutionsType = ("math",)) -> None:
        for argument, name in ((expression, "expression"), (python_modules, "python_modules")):
            ensure_argument_type(argument, (str, Substitution, Iterable), name, "PythonExpression")
        self.expression = normalize_to_list_of_substitutions(expression)
        self.python_modules = normalize_to_list_of_substitutions(python_modules)

    def describe(self) -> str:
        return f"PythonExpr({described(self.expression)}, [{described(self.python_modules)}])"

    def perform(self, context: LaunchContext) -> str:
        from importlib import import_module

        names: dict[str, object] = {}
        for module in [import_module(context.perform_substitution(sub)) for sub in self.python_modules]:
            if module.__name__ == "math":
                names.update(vars(module))
            names[module.__name__] = module
        # The launch file is code already: an expression of it can do no more than it could.
        return str(eval(perform_substitutions(context, self.expression), {}, names))


class LocalSubstitution(Substitution):
    """The value of a local of the context, for example of the event at hand."""

    def __init__(self, expression: str, description: str | None = None) -> None:
        ensure_argument_type(expression, str, "expression", "LocalSubstitution")
        self.expression = expression
        self.description = description

    def describe(self) -> str:
        return f"LocalVar('{self.description if self.description is not None else self.expression}')"

    def perform(self, context: LaunchContext) -> str:
        value: str = eval("context.locals." + self.expression)
        return value


class ThisLaunchFile(Substitution):
    """The path of the launch file."""

    def describe(self) -> str:
        return "ThisLaunchFile()"

    def perform(self, context: LaunchContext) -> str:
        path: str | None = context.get_locals_as_dict().get("current_launch_file_path")
        if path is None:
            raise SubstitutionFailure("ThisLaunchFile used outside of a launch file (in a script)")
        return path


class ThisLaunchFileDir(Substitution):
    """The directory of the launch file."""

    def describe(self) -> str:
        return "ThisLaunchFileDir()"

    def perform(self, context: LaunchContext) -> str:
        path: str | None = context.get_locals_as_dict().get("current_launch_file_directory")
        if path is None:
            raise SubstitutionFailure("ThisLaunchFileDir used outside of a launch file (in a script)")
        return path


class LaunchLogDir(Substitution):
    """The directory of this launch's logs."""

    def describe(self) -> str:
        return "LaunchLogDir()"

    def perform(self, context: LaunchContext) -> str:
        return output.launch_config.log_dir


class FindExecutable(Substitution):
    """The path of a program on the PATH."""

    def __init__(self, *, name: SomeSubstitutionsType) -> None:
        self.name = normalize_to_list_of_substitutions(name)

    def describe(self) -> str:
        return f"FindExec({described(self.name)})"

    def perform(self, context: LaunchContext) -> str:
        from shutil import which

        path = which(perform_substitutions(context, self.name))
        if path is None:
            raise SubstitutionFailure(f"executable '{self.name}' not found on the PATH")
        return path


class FileContent(Substitution):
    """What a file holds."""

    def __init__(self, path: SomeSubstitutionsType) -> None:
        self.path = normalize_to_list_of_substitutions(path)

    def describe(self) -> str:
        return f"FileContent({described(self.path)})"

    def perform(self, context: LaunchContext) -> str:
        path = perform_substitutions(context, self.path)
        try:
            with open(path, encoding="utf-8") as file:
                return file.read()
        except FileNotFoundError as error:
            raise SubstitutionFailure(f"File not found: {path}") from error


class Command(Substitution):
    """What a command prints."""

    def __init__(self, command: SomeSubstitutionsType, *, on_stderr: SomeSubstitutionsType = "fail") -> None:
        self.command = normalize_to_list_of_substitutions(command)
        self.on_stderr = normalize_to_list_of_substitutions(on_stderr)

    def describe(self) -> str:
        return f"Command({described(self.command)})"

    def perform(self, context: LaunchContext) -> str:
        import shlex
        import subprocess

        command = perform_substitutions(context, self.command)
        on_stderr = perform_substitutions(context, self.on_stderr)
        if on_stderr not in ("fail", "ignore", "warn", "capture"):
            raise SubstitutionFailure("expected 'on_stderr' to be one of: 'fail', 'ignore', 'warn' or 'capture'")
        stderr = subprocess.STDOUT if on_stderr == "capture" else subprocess.PIPE
        try:
            result = subprocess.run(shlex.split(command), stdout=subprocess.PIPE, stderr=stderr, text=True, check=False)
        except FileNotFoundError as error:
            raise SubstitutionFailure(f"file not found: {error}") from error
        if result.returncode != 0:
            captured = f"\nCaptured stderr output: {result.stderr}" if result.stderr else ""
            raise SubstitutionFailure(f"executed command failed. Command: {command}{captured}")
        if result.stderr:
            text = (
                f"executed command showed stderr output. Command: {command}\nCaptured stderr output:\n{result.stderr}"
            )
            if on_stderr == "fail":
                raise SubstitutionFailure(text)
            if on_stderr == "warn":
                output.log("WARNING", "root", text)
        return result.stdout


class AnonName(Substitution):
    """A name that nothing else has, the same for the same `name` throughout a launch."""

    def __init__(self, name: SomeSubstitutionsType) -> None:
        self.name = normalize_to_list_of_substitutions(name)

    def describe(self) -> str:
        return f"AnonName({described(self.name)})"

    def perform(self, context: LaunchContext) -> str:
        import random
        import sys

        name = perform_substitutions(context, self.name)
        if f"anon{name}" not in context.launch_configurations:
            unique = f"{name}_{os.uname().nodename}_{os.getpid()}_{random.randint(0, sys.maxsize)}"
            context.launch_configurations[f"anon{name}"] = unique.translate(str.maketrans(".-:", "___"))
        value: str = context.launch_configurations[f"anon{name}"]
        return value


# --- of truth values ----------------------------------------------------------------------------


def _truth(context: LaunchContext, subs: list[Substitution]) -> bool:
    try:
        return bool(perform_typed_substitution(context, subs, bool))
    except (TypeError, ValueError) as error:
        raise SubstitutionFailure(error) from error


def _text(truth: bool) -> str:
    return "true" if truth else "false"


class NotSubstitution(Substitution):
    """The opposite of a truth value."""

    def __init__(self, value: SomeSubstitutionsType) -> None:
        self.value = normalize_to_list_of_substitutions(value)

    def perform(self, context: LaunchContext) -> str:
        return _text(not _truth(context, self.value))


class AndSubstitution(Substitution):
    """Whether both are true."""

    def __init__(self, left: SomeSubstitutionsType, right: SomeSubstitutionsType) -> None:
        self.left = normalize_to_list_of_substitutions(left)
        self.right = normalize_to_list_of_substitutions(right)

    def perform(self, context: LaunchContext) -> str:
        left, right = _truth(context, self.left), _truth(context, self.right)
        return _text(left and right)


class OrSubstitution(Substitution):
    """Whether one is true."""

    def __init__(self, left: SomeSubstitutionsType, right: SomeSubstitutionsType) -> None:
        self.left = normalize_to_list_of_substitutions(left)
        self.right = normalize_to_list_of_substitutions(right)

    def perform(self, context: LaunchContext) -> str:
        left, right = _truth(context, self.left), _truth(context, self.right)
        return _text(left or right)


class AnySubstitution(Substitution):
    """Whether any is true."""

    def __init__(self, *args: SomeSubstitutionsType) -> None:
        self.args = [normalize_to_list_of_substitutions(arg) for arg in args]

    def perform(self, context: LaunchContext) -> str:
        return _text(any(_truth(context, arg) for arg in self.args))


class AllSubstitution(Substitution):
    """Whether all are true."""

    def __init__(self, *args: SomeSubstitutionsType) -> None:
        self.args = [normalize_to_list_of_substitutions(arg) for arg in args]

    def perform(self, context: LaunchContext) -> str:
        return _text(all(_truth(context, arg) for arg in self.args))


class IfElseSubstitution(Substitution):
    """One of two texts."""

    def __init__(
        self,
        condition: SomeSubstitutionsType,
        if_value: SomeSubstitutionsType = "",
        else_value: SomeSubstitutionsType = "",
    ) -> None:
        if if_value == else_value == "":
            raise RuntimeError("One of if_value and else_value must be specified")
        self.condition = normalize_to_list_of_substitutions(condition)
        self.if_value = normalize_to_list_of_substitutions(if_value)
        self.else_value = normalize_to_list_of_substitutions(else_value)

    def perform(self, context: LaunchContext) -> str:
        chosen = self.if_value if _truth(context, self.condition) else self.else_value
        return perform_substitutions(context, chosen)


def _comparable(value: Any) -> list[Substitution]:
    if not is_substitution(value):
        value = "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
    return normalize_to_list_of_substitutions(value)


def _equal(left: str, right: str) -> bool:
    truths = {"true": True, "1": True, "false": False, "0": False}
    if left.lower() in truths and right.lower() in truths:
        return truths[left.lower()] == truths[right.lower()]
    try:
        numbers = float(left), float(right)
    except ValueError:
        return left == right
    from math import isclose

    return isclose(*numbers)


class EqualsSubstitution(Substitution):
    """Whether two are equal, as truth values, numbers or texts."""

    def __init__(self, left: Any, right: Any) -> None:
        self.left = _comparable(left)
        self.right = _comparable(right)

    def perform(self, context: LaunchContext) -> str:
        return _text(_equal(perform_substitutions(context, self.left), perform_substitutions(context, self.right)))


class NotEqualsSubstitution(EqualsSubstitution):
    """Whether two differ."""

    def perform(self, context: LaunchContext) -> str:
        return _text(super().perform(context) != "true")
