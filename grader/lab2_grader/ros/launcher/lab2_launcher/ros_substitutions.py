"""The substitutions of `launch_ros.substitutions`."""

from __future__ import annotations

import os

from . import packages
from .core import (
    LaunchContext,
    Substitution,
    normalize_to_list_of_substitutions,
    perform_substitutions,
)
from .substitutions import SubstitutionFailure, described, normalized_default

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from .core import SomeSubstitutionsType


class FindPackage(Substitution):
    """Base of those that find something of a package."""

    def __init__(self, package: SomeSubstitutionsType) -> None:
        self.package = normalize_to_list_of_substitutions(package)

    def find(self, package_name: str) -> str:
        """What is to be found.

        Raises:
            NotImplementedError: A class made from this one does not say how.
        """
        raise NotImplementedError

    def describe(self) -> str:
        return f"{type(self).__name__}(pkg={described(self.package)})"

    def perform(self, context: LaunchContext) -> str:
        return self.find(perform_substitutions(context, self.package))


class FindPackagePrefix(FindPackage):
    """The prefix that a package is installed in."""

    def find(self, package_name: str) -> str:
        return packages.package_prefix(package_name)


class FindPackageShare(FindPackage):
    """The share directory of a package."""

    def find(self, package_name: str) -> str:
        return packages.share_directory(package_name)


class ExecutableInPackage(FindPackagePrefix):
    """The path of an executable of a package."""

    def __init__(self, executable: SomeSubstitutionsType, package: SomeSubstitutionsType) -> None:
        super().__init__(package)
        self.executable = normalize_to_list_of_substitutions(executable)

    def describe(self) -> str:
        return f"ExecInPkg(pkg={described(self.package)}, exec={described(self.executable)})"

    def perform(self, context: LaunchContext) -> str:
        executable = perform_substitutions(context, self.executable)
        package = perform_substitutions(context, self.package)
        prefix = super().perform(context)
        directory = os.path.join(prefix, "lib", package)
        if not os.path.exists(directory):
            raise SubstitutionFailure(
                f"package '{package}' found at '{prefix}', but libexec directory '{directory}' does not exist"
            )
        path = os.path.join(directory, executable)
        if not (os.path.isfile(path) and os.access(path, os.X_OK)):
            raise SubstitutionFailure(f"executable '{executable}' not found on the libexec directory '{directory}' ")
        return path


class Parameter(Substitution):
    """The value of a parameter set by SetParameter."""

    def __init__(self, name: SomeSubstitutionsType, *, default: Any = None) -> None:
        self.name = normalize_to_list_of_substitutions(name)
        self._default = normalized_default(default)

    def perform(self, context: LaunchContext) -> str:
        name = perform_substitutions(context, self.name)
        for entry in context.launch_configurations.get("global_params", []):
            if isinstance(entry, tuple) and entry[0] == name:
                return str(entry[1])
        if self._default is None:
            raise SubstitutionFailure(f"parameter '{name}' not found")
        return perform_substitutions(context, self._default)
