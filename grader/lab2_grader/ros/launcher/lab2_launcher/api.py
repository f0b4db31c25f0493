"""Offers `launch` and `launch_ros` to launch files: every name of the real API, ours or refused by name, and no other.

`jazzy_names.txt` lists what the real packages of ROS 2 Jazzy offer. A name that stands there and that we implement is
handed out; one that we do not implement is a stand-in that refuses when it is used (an unused import does no harm);
one that does not stand there is an AttributeError or ImportError, as with the real packages: the launch file's fault.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

TYPE_CHECKING = False  # `typing` costs more to import than all of this
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import NoReturn

EXIT_UNSUPPORTED = 78  # EX_CONFIG of sysexits.h
MARK = "[lab2-launcher] unsupported: "
_HERE = os.path.dirname(os.path.abspath(__file__))
_ROOTS = ("launch", "launch_ros")

# Where the names of a module of the real API, and of the modules below it, are implemented.
_HOMES = {
    "launch": ("core", "sources", "output"),
    "launch.actions": ("actions", "process"),
    "launch.conditions": ("conditions",),
    "launch.descriptions": ("process",),
    "launch.event_handlers": ("event_handlers",),
    "launch.events": ("events",),
    "launch.launch_description_sources": ("sources",),
    "launch.logging": ("output",),
    "launch.substitutions": ("substitutions",),
    "launch_ros.actions": ("ros_actions",),
    "launch_ros.descriptions": ("ros_parameters",),
    "launch_ros.parameter_descriptions": ("ros_parameters",),
    "launch_ros.substitutions": ("ros_substitutions",),
}

# Packages of a ROS 2 Jazzy desktop that a launch file may import and that are not there when this launcher is needed.
_ABSENT = frozenset(
    (
        "ament_index_python",
        "composition_interfaces",
        "launch_pytest",
        "launch_testing",
        "launch_testing_ros",
        "launch_xml",
        "launch_yaml",
        "lifecycle_msgs",
        "osrf_pycommon",
        "ros2cli",
        "ros2launch",
        "ros2pkg",
        "ros2run",
        "xacro",
    )
)


class Unsupported(BaseException):  # not an Exception: a launch file that catches those must not hide it
    """A launch file uses a part of the launch API that this launcher does not have."""


refused: list[str] = []
_modules: dict[str, frozenset[str]] = {}
_attributes: dict[str, set[str]] = {}


def refuse(what: str) -> NoReturn:
    """Say on standard error, for machines, that *what* is beyond our subset, and give up.

    Raises:
        Unsupported: Always.
    """
    name = " ".join(what.split())
    if name not in refused:
        refused.append(name)
        sys.stderr.write(f"{MARK}{name}\n")
        sys.stderr.flush()
    raise Unsupported(name)


def _read_names() -> None:
    with open(os.path.join(_HERE, "jazzy_names.txt"), encoding="utf-8") as file:
        for line in file:
            head, _, names = line.partition(" ")
            if head.endswith(":"):
                _modules[head[:-1]] = frozenset(names.split())
            elif head.endswith("."):
                _attributes.setdefault(head[:-1].rpartition(".")[2], set()).update(names.split())


def module_names(module: str) -> frozenset[str]:
    """The public names of *module* in the real API; none when it has no such module."""
    if not _modules:
        _read_names()
    return _modules.get(module, frozenset())


def missing_attribute(owner: object, name: str) -> NoReturn:
    """Answer for attribute *name* that *owner*, an object of ours, does not have.

    Raises:
        Unsupported: The real object has it.
        AttributeError: It has not.
    """
    kind = type(owner).__name__
    if not name.startswith("__"):
        module_names("launch")
        if name.startswith("_") or any(name in _attributes.get(base.__name__, ()) for base in type(owner).__mro__):
            refuse(f"{kind}.{name}")
    raise AttributeError(f"'{kind}' object has no attribute '{name}'")


class _StandIn(type):
    """The class of a stand-in: any use of it is refused."""

    full_name: str

    def __call__(cls, *args: object, **kwargs: object) -> NoReturn:
        refuse(cls.full_name)

    def __getattr__(cls, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)
        refuse(f"{cls.full_name}.{name}")


def _stand_in(module: str, name: str) -> object:
    return _StandIn(name, (), {"full_name": f"{module}.{name}", "__module__": module})


class _Module(ModuleType):
    """A module of the real API; its names are looked up when they are first used."""

    def __getattr__(self, name: str) -> object:
        known = module_names(self.__name__)
        if name == "__all__":
            return sorted(entry for entry in known if f"{self.__name__}.{entry}" not in _modules)
        if name not in known:
            raise AttributeError(f"module '{self.__name__}' has no attribute '{name}'")
        value = self._find(name)
        setattr(self, name, value)
        return value

    def _find(self, name: str) -> object:
        if f"{self.__name__}.{name}" in _modules:
            return import_module(f"{self.__name__}.{name}")
        prefix = self.__name__
        while prefix not in _HOMES and "." in prefix:
            prefix = prefix.rpartition(".")[0]
        for home in _HOMES.get(prefix, ()):
            module = import_module(f"{__package__}.{home}")
            if hasattr(module, name):
                return getattr(module, name)
        return _stand_in(self.__name__, name)


class _Absent(ModuleType):
    """Stands for a module of ROS that is not installed here."""

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):
            raise AttributeError(name)
        return _stand_in(self.__name__, name)


class _Finder:
    """Finds `launch` and `launch_ros` here, before any other of the name."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: object = None) -> ModuleSpec | None:
        root = name.partition(".")[0]
        if root in _ABSENT and root.startswith("launch_"):  # made for the real `launch`, even if it is there
            return _LastFinder.find_spec(name)
        if root not in _ROOTS:
            return None
        module_names(name)
        return ModuleSpec(name, _Loader(), origin=__file__, is_package=True) if name in _modules else None  # type: ignore[arg-type]


class _LastFinder:
    """Finds a stand-in for a module of ROS that nobody else has found."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: object = None) -> ModuleSpec | None:
        if name.partition(".")[0] not in _ABSENT:
            return None
        return ModuleSpec(name, _Loader(), origin=__file__, is_package=True)  # type: ignore[arg-type]


class _Loader:
    @staticmethod
    def create_module(spec: ModuleSpec) -> ModuleType:
        module = (_Module if spec.name.partition(".")[0] in _ROOTS else _Absent)(spec.name)
        module.__file__ = __file__
        return module

    @staticmethod
    def exec_module(module: ModuleType) -> None:
        pass


def install() -> None:
    """Make `launch` and `launch_ros` importable."""
    sys.meta_path.insert(0, _Finder)
    sys.meta_path.append(_LastFinder)
