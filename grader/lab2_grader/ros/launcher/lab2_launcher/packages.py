"""Finds packages in the ament index, as `ament_index_python` does."""

from __future__ import annotations

import os


class PackageNotFoundError(KeyError):
    """No prefix of AMENT_PREFIX_PATH has the package."""


def search_paths() -> list[str]:
    """The prefixes of AMENT_PREFIX_PATH that exist.

    Raises:
        LookupError: It is not set.
    """
    value = os.environ.get("AMENT_PREFIX_PATH")
    if not value:
        raise LookupError("Environment variable 'AMENT_PREFIX_PATH' is not set or empty")
    return [path for path in value.split(os.pathsep) if path and os.path.exists(path)]


def package_prefix(name: str) -> str:
    """The prefix that *name* is installed in.

    Raises:
        PackageNotFoundError: There is none.
        ValueError: No package can have that name.
    """
    letters = name.replace("_", "a").replace("-", "a")
    if len(name) < 2 or not (letters.isascii() and letters.isalnum()) or name[0] in "_-":
        raise ValueError(f"'{name}' is not a valid package name")
    paths = search_paths()
    for path in paths:
        if os.path.isfile(os.path.join(path, "share", "ament_index", "resource_index", "packages", name)):
            return path
    raise PackageNotFoundError(f"package '{name}' not found, searching: {paths}")


def share_directory(name: str) -> str:
    """The share directory of package *name*.

    Raises:
        PackageNotFoundError: There is no such package.
    """
    return os.path.join(package_prefix(name), "share", name)
