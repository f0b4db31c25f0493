"""The command line of the launcher: finds the launch file and launches it."""

from __future__ import annotations

import os
import sys

from . import api, output, packages

HERE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
USAGE = "usage: run.py [--use-sim-time] <package> <launch file name> [name:=value …]"


class CannotLaunch(Exception):
    """There is nothing to launch; the text is that of `ros2 launch`."""


def launch_file(package: str, name: str) -> str:
    """The path of the launch file *name* of *package*, wherever in its share directory it is.

    Raises:
        CannotLaunch: There is no such package, no such file, or more than one.
    """
    try:
        share = packages.share_directory(package)
    except packages.PackageNotFoundError as error:
        raise CannotLaunch(f"Package '{package}' not found: {error}") from error
    except (LookupError, ValueError) as error:
        raise CannotLaunch(str(error)) from error
    found = [os.path.join(root, name) for root, _, files in os.walk(share) if name in files]
    if not found:
        raise CannotLaunch(
            f"file '{name}' was not found in the share directory of package '{package}' which is at '{share}'"
        )
    if len(found) > 1:
        listed = ", ".join(f"'{path}'" for path in found)
        raise CannotLaunch(
            f"file '{name}' was found more than once in the share directory of package '{package}': [{listed}]"
        )
    return found[0]


def launch_arguments(arguments: list[str]) -> list[tuple[str, str]]:
    """Names and values of `name:=value`; the last of a name counts.

    Raises:
        CannotLaunch: One does not look like that.
    """
    values: dict[str, str] = {}
    for argument in arguments:
        name, sign, value = argument.partition(":=")
        if not sign or not name or not value:
            raise CannotLaunch(f"malformed launch argument '{argument}', expected format '<name>:=<value>'")
        values[name] = value
    return list(values.items())


def launch(path: str, arguments: list[str], use_sim_time: bool) -> int:
    """Launch the file at *path*; the exit code."""
    from . import ros_actions, service, sources
    from .core import LaunchDescription

    named = launch_arguments(arguments)
    file = sources.AnyLaunchDescriptionSource(path)
    description = LaunchDescription()
    if use_sim_time:
        description.add_action(ros_actions.SetParameter("use_sim_time", True))
    description.add_action(sources.IncludeLaunchDescription(file, launch_arguments=named))
    return service.LaunchService(argv=arguments, noninteractive=not sys.stdin.isatty()).run(description)


def prepare() -> None:
    """Make `launch` importable, and what launch files and processes find around them as with a ROS installation."""
    api.install()
    output.launch_config.log_dir = output.log_directory()
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    # Lines of Python processes are to be seen when they are printed, as `ros2 launch` is run by the grader.
    os.environ.setdefault("PYTHONUNBUFFERED", "1")
    # `ros2 run` for launch files that use it, behind a real one.
    os.environ["PATH"] = os.pathsep.join([os.environ.get("PATH") or os.defpath, os.path.join(HERE, "bin")])
    os.environ["LAB2_LAUNCHER_PYTHON"] = sys.executable


def main(arguments: list[str]) -> int:
    """Run the command line; the exit code."""
    use_sim_time = arguments[:1] == ["--use-sim-time"]
    if use_sim_time:
        arguments = arguments[1:]
    if len(arguments) < 2 or arguments[0].startswith("-"):
        sys.stderr.write(f"{USAGE}\n")
        return 2
    try:
        path = launch_file(arguments[0], arguments[1])
        prepare()
        return launch(path, arguments[2:], use_sim_time)
    except CannotLaunch as error:
        sys.stderr.write(f"{error}\n")
        return 1
    except api.Unsupported:
        return api.EXIT_UNSUPPORTED
