"""The actions of `launch_ros.actions`: `Node`, and those that set something for the nodes that follow."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from .core import (
    Action,
    LaunchContext,
    LaunchDescriptionEntity,
    ensure_argument_type,
    normalize_to_list_of_substitutions,
    perform_substitutions,
)
from .output import log
from .process import ExecuteProcess
from .ros_parameters import (
    Parameter,
    as_yaml,
    evaluate_parameter_dict,
    normalize_parameter_dict,
    normalize_parameters,
)
from .ros_substitutions import ExecutableInPackage
from .substitutions import SubstitutionFailure

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from .core import SomeSubstitutionsType, Substitution


# --- names --------------------------------------------------------------------------------------


def prefix_namespace(base_ns: str | None, ns: str | None) -> str | None:
    """*ns* below *base_ns*, unless it is absolute; None when there is neither."""
    if ns is None:
        combined = base_ns
    elif not base_ns or ns.startswith("/"):
        combined = ns
    else:
        combined = f"{base_ns.rstrip('/')}/{ns}"
    if combined is None or combined == "/":
        return combined
    return combined.rstrip("/")


def make_namespace_absolute(ns: str | None) -> str | None:
    """*ns* with a slash before it."""
    return ns if ns is None or ns.startswith("/") else f"/{ns}"


def _invalid(kind: str, reason: str, name: str, index: int) -> ValueError:
    return ValueError(f"Invalid {kind}: {kind} {reason}:\n  '{name}'\n   {' ' * index}^")


def validate_node_name(name: str) -> None:
    """Check *name* by the rules of ROS.

    Raises:
        ValueError: It breaks one; the text is that of rclpy.
    """
    kind = "node name"
    if not name:
        raise _invalid(kind, "must not be empty", name, 0)
    for index, char in enumerate(name):
        if not (char.isascii() and (char.isalnum() or char == "_")):
            raise _invalid(kind, "must not contain characters other than alphanumerics or '_'", name, index)
    if name[0].isdigit():
        raise _invalid(kind, "must not start with a number", name, 0)


def validate_namespace(namespace: str) -> None:
    """Check an absolute *namespace* by the rules of ROS.

    Raises:
        ValueError: It breaks one; the text is that of rclpy.
    """
    kind = "namespace"
    if namespace == "/":
        return
    for index, char in enumerate(namespace):
        if not (char.isascii() and (char.isalnum() or char in "_/")):
            raise _invalid(kind, "must not contain characters other than alphanumerics, '_', or '/'", namespace, index)
    if namespace.endswith("/"):
        raise _invalid(kind, "must not end with a '/', unless only a '/'", namespace, len(namespace) - 1)
    for index in range(1, len(namespace)):
        if namespace[index - 1] == "/" and namespace[index] == "/":
            raise _invalid(kind, "must not contain repeated '/'", namespace, index)
        if namespace[index - 1] == "/" and namespace[index].isdigit():
            reason = "must not have a token that starts with a number"
            raise _invalid(kind, reason, namespace, index)


# --- Node ---------------------------------------------------------------------------------------


def normalize_remap_rules(rules: Iterable[Any]) -> list[tuple[list[Substitution], list[Substitution]]]:
    """Prepare what a node is given as `remappings`.

    Raises:
        TypeError: One is not a tuple of two.
    """
    pairs = []
    for rule in rules:
        ensure_argument_type(rule, (tuple,), "remap_rule")
        if len(rule) != 2:
            raise TypeError(f"remap_rule must be a tuple of length 2, got length {len(rule)}")
        pairs.append((normalize_to_list_of_substitutions(rule[0]), normalize_to_list_of_substitutions(rule[1])))
    return pairs


class Node(ExecuteProcess):
    """Starts a node: an executable of a package, with its name, parameters and remappings as ROS arguments."""

    UNSPECIFIED_NODE_NAME = "<node_name_unspecified>"
    UNSPECIFIED_NODE_NAMESPACE = "<node_namespace_unspecified>"

    def __init__(
        self,
        *,
        executable: SomeSubstitutionsType,
        package: SomeSubstitutionsType | None = None,
        name: SomeSubstitutionsType | None = None,
        namespace: SomeSubstitutionsType | None = None,
        exec_name: SomeSubstitutionsType | None = None,
        parameters: list[Any] | None = None,
        remappings: Iterable[Any] | None = None,
        ros_arguments: list[SomeSubstitutionsType] | None = None,
        arguments: Iterable[SomeSubstitutionsType] | None = None,
        **kwargs: Any,
    ) -> None:
        cmd: list[Any] = [executable if package is None else ExecutableInPackage(executable, package)]
        cmd += arguments if arguments is not None else []
        cmd += [] if ros_arguments is None else ["--ros-args"] + ros_arguments
        cmd += ["--ros-args"]
        if parameters is not None:
            ensure_argument_type(parameters, (list,), "parameters", "Node")
        self._parameters = [] if parameters is None else normalize_parameters(parameters)
        kwargs["name"] = exec_name
        super().__init__(cmd=cmd, **kwargs)
        self.node_package = package
        self.node_executable = executable
        self._given_name = name
        self._given_namespace = namespace
        self._remappings = [] if remappings is None else normalize_remap_rules(remappings)
        self._node_name: str | None = None
        self._expanded = False

    @property
    def node_name(self) -> str:
        """The full name of the node.

        Raises:
            RuntimeError: It is not known before the action is executed.
        """
        if self._node_name is None:
            raise RuntimeError("cannot access 'node_name' before executing action")
        return self._node_name

    def is_node_name_fully_specified(self) -> bool:
        """Whether the launch file gives name and namespace."""
        return not any(part in self.node_name for part in (self.UNSPECIFIED_NODE_NAME, self.UNSPECIFIED_NODE_NAMESPACE))

    def execute(self, context: LaunchContext) -> Sequence[LaunchDescriptionEntity] | None:
        if not self._expanded:
            self._expanded = True
            for argument in self._ros_arguments(context):
                self.process_description.cmd.append(normalize_to_list_of_substitutions(argument))
        answer = super().execute(context)
        if self.is_node_name_fully_specified():
            self._count(context)
        return answer

    def _ros_arguments(self, context: LaunchContext) -> list[str]:
        """The arguments by which the node gets name, namespace, parameters and remappings, in launch_ros's order."""
        arguments = self._name_arguments(context)
        for entry in context.launch_configurations.get("global_params", []):
            if isinstance(entry, tuple):
                arguments += ["-p", f"{entry[0]}:={entry[1]}"]
            else:
                path = os.path.abspath(entry)
                assert os.path.isfile(path)
                arguments += ["--params-file", path]
        for parameters in self._parameters:
            arguments += self._parameter_arguments(context, parameters)
        remappings = list(context.launch_configurations.get("ros_remaps", []))
        remappings += [
            (perform_substitutions(context, source), perform_substitutions(context, target))
            for source, target in self._remappings
        ]
        for source, target in remappings:
            arguments += ["-r", f"{source}:={target}"]
        return arguments

    def _name_arguments(self, context: LaunchContext) -> list[str]:
        arguments: list[str] = []
        name, namespace = self.UNSPECIFIED_NODE_NAME, None
        try:
            if self._given_name is not None:
                name = perform_substitutions(context, normalize_to_list_of_substitutions(self._given_name))
                validate_node_name(name)
                arguments += ["-r", f"__node:={name}"]
            if self._given_namespace is not None:
                namespace = perform_substitutions(context, normalize_to_list_of_substitutions(self._given_namespace))
            base = context.launch_configurations.get("ros_namespace")
            namespace = make_namespace_absolute(prefix_namespace(base, namespace))
            if namespace is not None:
                validate_namespace(namespace)
                arguments += ["-r", f"__ns:={namespace}"]
        except Exception:
            log(
                "ERROR",
                "launch_ros.actions.node",
                "Error while expanding or validating node name or namespace for "
                f"'package={self.node_package}, executable={self.node_executable}, "
                f"name={self._given_name}, namespace={self._given_namespace}':",
            )
            raise
        self._node_name = prefix_namespace(namespace or self.UNSPECIFIED_NODE_NAMESPACE, name)
        return arguments

    def _parameter_arguments(self, context: LaunchContext, parameters: Any) -> list[str]:
        if isinstance(parameters, dict):
            return ["--params-file", self._write_parameters(evaluate_parameter_dict(context, parameters))]
        if isinstance(parameters, Parameter):
            name, value = parameters.evaluate(context)
            return ["-p", f"{name}:={as_yaml(value)}"]
        path: Path = parameters.evaluate(context)
        if not path.is_file():
            log("WARNING", "launch_ros.actions.node", f"Parameter file path is not a file: {path}")
            return []
        return ["--params-file", str(path)]

    def _write_parameters(self, parameters: dict[str, Any]) -> str:
        """Write a YAML file (in flow style) of *parameters* for this node into TMPDIR; its path."""
        from tempfile import NamedTemporaryFile

        node = self.node_name if self.is_node_name_fully_specified() else "/**"
        with NamedTemporaryFile("w", prefix="launch_params_", delete=False, encoding="utf-8") as file:
            file.write(as_yaml({node: {"ros__parameters": parameters}}) + "\n")
            return file.name

    def _count(self, context: LaunchContext) -> None:
        counts = context.get_locals_as_dict().get("unique_ros_node_names")
        if counts is None:
            counts = {}
            context.extend_globals({"unique_ros_node_names": counts})
        counts[self.node_name] = counts.get(self.node_name, 0) + 1
        if counts[self.node_name] > 1:
            log(
                "WARNING",
                str(self.name),
                f"there are now at least {counts[self.node_name]} nodes with the name {self.node_name} "
                "created within this launch context",
            )


# --- for the nodes that follow ------------------------------------------------------------------


class PushROSNamespace(Action):
    """Puts the nodes that follow into a namespace."""

    def __init__(self, namespace: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.namespace = normalize_to_list_of_substitutions(namespace)

    def execute(self, context: LaunchContext) -> None:
        pushed = perform_substitutions(context, self.namespace)
        previous = context.launch_configurations.get("ros_namespace")
        namespace = make_namespace_absolute(prefix_namespace(previous, pushed))
        assert namespace is not None
        try:
            validate_namespace(namespace)
        except ValueError as error:
            raise SubstitutionFailure(
                f"The resulting namespace is invalid: [previous_namespace='{previous}', pushed_namespace='{pushed}']"
            ) from error
        context.launch_configurations["ros_namespace"] = namespace


PushRosNamespace = PushROSNamespace


class SetParameter(Action):
    """Sets a parameter for the nodes that follow."""

    def __init__(self, name: SomeSubstitutionsType, value: Any, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._parameters = normalize_parameter_dict({tuple(normalize_to_list_of_substitutions(name)): value})

    @property
    def name(self) -> tuple[Substitution, ...]:
        """The parameter's name."""
        return next(iter(self._parameters))

    @property
    def value(self) -> Any:
        """The parameter's value."""
        return self._parameters[self.name]

    def execute(self, context: LaunchContext) -> None:
        # Like the real one this changes a list that an outer scope may share.
        entries = context.launch_configurations.setdefault("global_params", [])
        entries.extend(evaluate_parameter_dict(context, self._parameters).items())


class SetParametersFromFile(Action):
    """Sets the parameters of a YAML file for the nodes that follow."""

    def __init__(self, filename: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._filename = normalize_to_list_of_substitutions(filename)

    def execute(self, context: LaunchContext) -> None:
        entries = context.launch_configurations.setdefault("global_params", [])
        entries.append(perform_substitutions(context, self._filename))


class SetRemap(Action):
    """Sets a remapping for the nodes that follow."""

    def __init__(self, src: SomeSubstitutionsType, dst: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.src = normalize_to_list_of_substitutions(src)
        self.dst = normalize_to_list_of_substitutions(dst)

    def execute(self, context: LaunchContext) -> None:
        entries = context.launch_configurations.setdefault("ros_remaps", [])
        entries.append((perform_substitutions(context, self.src), perform_substitutions(context, self.dst)))


class SetROSLogDir(Action):
    """Sets the directory of the logs of the nodes that follow."""

    def __init__(self, new_log_dir: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.log_dir = normalize_to_list_of_substitutions(new_log_dir)

    def execute(self, context: LaunchContext) -> None:
        home = os.environ.get("ROS_HOME") or os.path.expanduser("~/.ros")
        current = os.environ.get("ROS_LOG_DIR") or os.path.join(home, "log")
        os.environ["ROS_LOG_DIR"] = os.path.join(current, perform_substitutions(context, self.log_dir))
