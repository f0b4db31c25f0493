"""The one-way flow of the design, held by walking the imports and the syntax of the package."""

from __future__ import annotations

import ast
import inspect
import re
import sys
import types
import typing
from collections.abc import Iterator
from enum import Enum
from pathlib import Path

import msgspec
import pytest

import lab2_grader
from lab2_grader import records

PACKAGE = Path(lab2_grader.__file__).parent
LAUNCHER = PACKAGE / "ros" / "launcher"  # a program of its own, run inside the sandbox

# From the top down: a module imports only from those above it, or from its own group.
LAYERS = (
    ("records", "errors", "text", "tar", "decoding", "reading", "near"),
    ("lab", "sections"),
    ("messages", "stand_in"),
    ("process", "process_table", "cgroup"),
    ("sandbox",),
    ("ros",),
    ("submission",),
    ("build",),
    ("observe",),
    ("evidence",),
    ("stage",),
    ("checks",),
    ("score",),
    ("report",),
    ("provenance", "bag", "outlets"),
    ("pipeline",),
    ("classroom", "doctor"),
    ("cli", "__main__"),
)
LEVEL = {name: level for level, layer in enumerate(LAYERS) for name in layer}
# Imported and no dependency of every machine: ROS, colcon's setuptools, and the extras `bag` and `dask`.
ELSEWHERE = {"rclpy", "std_msgs", "rosgraph_msgs", "launch", "launch_ros", "setuptools", "rosbags", "distributed"}
NOT_IMPORTED = {"tomli"}  # msgspec's, on Python 3.10
PURE = ("checks", "score", "report", "near", "reading", "stand_in", "records", "text")


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Every module of the package (`checks/talker.py`, …) and its tree, without the launcher."""
    for path in sorted(PACKAGE.rglob("*.py")):
        if not path.is_relative_to(LAUNCHER):
            yield str(path.relative_to(PACKAGE)), ast.parse(path.read_text())


MODULES = dict(modules())


def layer(name: str) -> str:
    """The part of the package that the module at *name* belongs to."""
    return name.removesuffix(".py").split("/")[0]


def imported(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """(module, name) of every import, wherever it stands; the name is empty for a plain import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield from ((node.module or "", alias.name) for alias in node.names)


def own_imports(tree: ast.Module) -> Iterator[str]:
    """The parts of this package that a module imports."""
    for module, name in imported(tree):
        if module == "lab2_grader":
            yield name
        elif module.startswith("lab2_grader."):
            yield module.split(".")[1]


def external_imports(tree: ast.Module) -> set[str]:
    return {module.split(".")[0] for module, _ in imported(tree)}


def test_each_part_has_one_place_in_the_order() -> None:
    named = [name for names in LAYERS for name in names]
    assert sorted(named) == sorted({layer(name) for name in MODULES} - {"__init__", "build_proof"})


@pytest.mark.parametrize("name", MODULES)
def test_imports_go_up_only(name: str) -> None:
    if name in ("__init__.py", "ros/time_lapse_launch.py", "build_proof/setup.py"):
        return
    here = layer(name)
    assert here in LEVEL, f"{name} has no place in the order of modules"
    for other in own_imports(MODULES[name]):
        if other in LEVEL:
            assert other == here or LEVEL[other] < LEVEL[here] or other in LAYERS[LEVEL[here]], (
                f"{name} imports {other}"
            )


def test_one_module_decodes() -> None:
    """Elsewhere two threads that are the first to decode a type would end the interpreter; see `decoding`."""
    names = {
        name
        for name, tree in MODULES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and re.fullmatch(r"msgspec(\.\w+)?\.(decode|Decoder|convert)", ast.unparse(node))
    }
    assert names == {"decoding.py"}


def test_a_class_is_graded_from_the_top_down() -> None:
    order = re.findall(r"`(\w+)`", (ast.get_docstring(MODULES["classroom/__init__.py"]) or "").split("before it:")[1])
    inside = {Path(name).stem: tree for name, tree in MODULES.items() if layer(name) == "classroom"}
    assert sorted(order) == sorted(inside.keys() - {"__init__"})
    for name in order:
        for module, imports in imported(inside[name]):
            if module.startswith("lab2_grader.classroom"):
                other = [*module.split("."), imports][2]
                assert order.index(other) < order.index(name), f"{name} imports {other}"


def test_what_is_imported_is_declared() -> None:
    project = msgspec.toml.decode((PACKAGE.parent / "pyproject.toml").read_bytes())["project"]
    declared = {re.match(r"[\w-]+", line)[0] for line in project["dependencies"]}
    used = set().union(*map(external_imports, MODULES.values()))
    assert used - sys.stdlib_module_names - ELSEWHERE - {"lab2_grader"} == declared - NOT_IMPORTED


@pytest.mark.parametrize("name", [name for name in MODULES if layer(name) in PURE])
def test_right_of_the_evidence_nothing_happens(name: str) -> None:
    forbidden = {"rclpy", "subprocess", "socket", "threading", "tempfile", "time", "random", "signal"}
    assert not external_imports(MODULES[name]) & forbidden
    assert "process" not in set(own_imports(MODULES[name]))


@pytest.mark.parametrize("name", MODULES)
def test_only_process_starts_processes(name: str) -> None:
    if name == "process.py":
        return
    assert not external_imports(MODULES[name]) & {"subprocess", "multiprocessing"}
    assert "ProcessPoolExecutor" not in {imports for _, imports in imported(MODULES[name])}
    spawners = {"system", "popen", "fork", "forkpty", "posix_spawn", "posix_spawnp", "startfile"}
    for node in ast.walk(MODULES[name]):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "os":
            assert node.attr not in spawners and not node.attr.startswith(("exec", "spawn")), f"{name}: os.{node.attr}"


@pytest.mark.parametrize("name", MODULES)
def test_only_the_command_line_prints(name: str) -> None:
    if layer(name) in ("cli", "__main__"):
        return
    for node in ast.walk(MODULES[name]):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id != "print", f"{name}, line {node.lineno}"
    assert ("rich.console", "Console") not in set(imported(MODULES[name]))


@pytest.mark.parametrize("name", MODULES)
def test_only_the_observer_imports_rclpy(name: str) -> None:
    if layer(name) != "observe":
        assert not external_imports(MODULES[name]) & {"rclpy", "std_msgs", "rosgraph_msgs"}


# --- records ----------------------------------------------------------------------------------------

RECORDS = [
    kind
    for _, kind in inspect.getmembers(records, inspect.isclass)
    if issubclass(kind, msgspec.Struct) and kind.__module__ == records.__name__
]


def parts(annotation: object) -> Iterator[object]:
    """*annotation* and what stands in its brackets."""
    origin = typing.get_origin(annotation)
    if origin not in (types.UnionType, typing.Union):
        yield origin or annotation
    for argument in typing.get_args(annotation):
        yield from parts(argument)


@pytest.mark.parametrize("kind", RECORDS)
def test_records_are_frozen_through_and_through(kind: type[msgspec.Struct]) -> None:
    assert kind.__struct_config__.frozen
    for name, annotation in typing.get_type_hints(kind).items():
        if name.startswith("__"):
            continue
        for part in parts(annotation):
            assert part not in (list, dict, set, bytearray), f"{kind.__name__}.{name}"
            if isinstance(part, type) and issubclass(part, msgspec.Struct):
                assert part in RECORDS
            elif isinstance(part, type):
                assert issubclass(part, Enum) or part in (int, float, str, bytes, bool, tuple, type(None))
