"""Writes `lab2_launcher/jazzy_names.txt` anew from the real `launch` and `launch_ros`: run it where ROS 2 is sourced.

Only names are taken: of modules, of what a module offers, of a class's public attributes and of its arguments.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import sys
from pathlib import Path
from types import ModuleType

PACKAGES = ("launch", "launch_ros")
TARGET = Path(__file__).parent / "lab2_launcher" / "jazzy_names.txt"


def module_names(module: ModuleType) -> list[str]:
    """The public names that *module* offers of its own packages, modules below it that are loaded with it included."""
    names: set[str] = set()
    for node in ast.parse(inspect.getsource(module)).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names.update(target.id for target in node.targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
        elif isinstance(node, ast.ImportFrom) and (node.level or (node.module or "").split(".")[0] in PACKAGES):
            names.update(alias.asname or alias.name for alias in node.names)
    names.update(
        name
        for name, value in vars(module).items()
        if isinstance(value, ModuleType) and value.__name__ == f"{module.__name__}.{name}"
    )
    return sorted(name for name in names if not name.startswith("_") and hasattr(module, name))


def arguments(kind: type) -> list[str]:
    """Names of the arguments of the constructor, those included that `**kwargs` passes on to a base class."""
    names: list[str] = []
    for base in kind.__mro__:
        if "__init__" not in vars(base) or base is object:
            continue
        parameters = list(inspect.signature(base.__init__).parameters.values())[1:]  # type: ignore[misc]
        for parameter in parameters:
            if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY):
                names.append(parameter.name)
        if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
            break
    return sorted(dict.fromkeys(names))


def lines() -> list[str]:
    """The lines of the file: `module: names`, `Class( arguments`, `Class. attributes`."""
    modules: dict[str, list[str]] = {}
    classes: dict[str, type] = {}
    for name in PACKAGES:
        package = importlib.import_module(name)
        found = [name, *(info.name for info in pkgutil.walk_packages(package.__path__, f"{name}."))]
        for module_name in found:
            module = importlib.import_module(module_name)
            modules[module_name] = module_names(module)
            for value in vars(module).values():
                if inspect.isclass(value) and value.__module__ == module_name:
                    # Two classes may share a name (the action and the event Shutdown): told apart by their module.
                    classes[f"{module_name}.{value.__name__}"] = value
    written = [f"{name}: {' '.join(names)}" for name, names in sorted(modules.items())]
    for name, kind in sorted(classes.items()):
        attributes = sorted(entry for entry in dir(kind) if not entry.startswith("_"))
        written.append(f"{name}( {' '.join(arguments(kind))}")
        written.append(f"{name}. {' '.join(attributes)}")
    return [line.rstrip() for line in written]


def main() -> None:
    """Write the file, or with `--print` show it."""
    text = "".join(f"{line}\n" for line in lines())
    if sys.argv[1:] == ["--print"]:
        sys.stdout.write(text)
    else:
        TARGET.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
