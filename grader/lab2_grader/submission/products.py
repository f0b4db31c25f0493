"""Knows what colcon, Python and other tools leave behind, by name and by content.

Which folders count as build products
    Caches, virtual environments and `*.egg-info` count wherever they lie. `build`, `install` and `log` are ordinary words,
    so they count as colcon's only where colcon is run: in the package or in a folder above it, up to the top of the
    submission; and anywhere else when they hold a file that colcon writes into them. A Python package `lab2/log/` is
    thus left alone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import PurePosixPath

COLCON = frozenset({"build", "install", "log"})

CACHES = frozenset(
    {
        "__pycache__",
        ".pytest_cache",
        ".mypy_cache",
        ".ruff_cache",
        ".tox",
        ".nox",
        ".eggs",
        ".venv",
        "node_modules",
    }
)

# What is neither the package's nor a product: version control, and what macOS and Windows add.
_NEVER_TAKEN = frozenset({".git", ".hg", ".svn", "__MACOSX", ".DS_Store", "Thumbs.db", "desktop.ini"})

# A folder that holds one of these was made by colcon (build, install or log).
_COLCON_MARKS = frozenset(
    {
        "COLCON_IGNORE",
        ".built_by",
        ".colcon_install_layout",
        "local_setup.bash",
        "local_setup.sh",
        "_local_setup_util_sh.py",
        "latest_build",
        "events.log",
    }
)
_ENVIRONMENT_MARK = "pyvenv.cfg"
_RESULT_MARKS = frozenset({"result.json", "evidence"})  # a folder of this grader's own results


def is_cache(name: str) -> bool:
    """A file or folder of that name is a cache or a product of Python's tools wherever it lies."""
    return name in CACHES or name.endswith((".egg-info", ".pyc", ".pyo"))


def is_left_out(name: str) -> bool:
    """A file or folder of that name is neither searched nor taken over, wherever it lies."""
    return name in _NEVER_TAKEN or name.startswith("._") or is_cache(name)


def is_left_out_for(name: str, children: Collection[str]) -> bool:
    """A folder called *name* that holds *children* is a virtual environment, colcon's, or a result of this grader."""
    held = frozenset(children)
    if _ENVIRONMENT_MARK in held or held >= _RESULT_MARKS:
        return True
    return is_made_by_colcon(name, held)


def is_made_by_colcon(name: str, children: Collection[str]) -> bool:
    """A folder called *name* that holds *children* is colcon's, wherever it lies."""
    return name in COLCON and not _COLCON_MARKS.isdisjoint(children)


def committed(paths: Iterable[str], package_path: str) -> tuple[str, ...]:
    """The products among *paths*, files relative to the top of the repository: each topmost folder (`build/`) or file once.

    Args:
        paths: All files that are committed.
        package_path: Where the package is, relative to the top; `.` for the top.
    """
    paths = tuple(paths)
    package = PurePosixPath(package_path)
    run_here = {str(package), *(str(folder) for folder in package.parents), "."}
    made_by_mark = {
        parent
        for parent, _, name in (path.rpartition("/") for path in paths)
        if name == _ENVIRONMENT_MARK or (name in _COLCON_MARKS and parent.rpartition("/")[2] in COLCON)
    }
    found: dict[str, None] = {}
    for path in paths:
        found.setdefault(_topmost(path, run_here, made_by_mark))
    found.pop("", None)
    return tuple(sorted(found))


def _topmost(path: str, run_here: Collection[str], made_by_mark: Collection[str]) -> str:
    """The topmost part of *path* that is a product, a folder with a slash at its end; empty when none is."""
    parts = path.split("/")
    for depth, name in enumerate(parts):
        here = "/".join(parts[: depth + 1])
        parent = "/".join(parts[:depth]) or "."
        is_folder = depth < len(parts) - 1
        if is_cache(name) or (is_folder and (here in made_by_mark or (name in COLCON and parent in run_here))):
            return here + "/" * is_folder
    return ""
