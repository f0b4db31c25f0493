"""Plays the worksheet's commands in a real workspace, in as many terminals as the page has, and compares (tier 2)."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import date
from importlib import metadata
from pathlib import Path

from lab2_grader import lab

from lab2_worksheet.manifest import Command, commands, tasks
from lab2_worksheet.places import SOLUTION, TEMPLATE
from lab2_worksheet.recording import Recording, normalise
from lab2_worksheet.terminal import Terminal

START_SECONDS = 40.0  # until a command has shown what it must
STOP_SECONDS = 15.0  # from Ctrl-C to the prompt
VERSIONED = ("ros2cli", "rclpy", "launch_ros", "colcon-core")
_ASKED_AGAIN = ("ros2 node ", "ros2 topic list", "ros2 topic info")
_DROPPED = ("ROS_HOME", "ROS_LOG_DIR", "PWD", "OLDPWD", "PYTHONDONTWRITEBYTECODE", "VIRTUAL_ENV")
_OPTION = re.compile(r"(?<![\w-])(-\w|--[a-z][a-z-]+)")
_VERBS = ("run", "launch", "pkg executables", "node list", "node info", "topic list", "topic info", "topic echo")
_MORE_VERBS = ("topic hz", "topic pub", "interface show", "pkg create", "daemon stop")


@dataclass
class Played:
    """What came of playing: the recording, and each thing that was not as the manifest says."""

    recording: Recording
    wrong: list[str] = field(default_factory=list)


def available() -> bool:
    """Whether `ros2`, `colcon` and `git` are on the path."""
    return all(shutil.which(program) for program in ("ros2", "colcon", "git", "bash"))


def play(say: Callable[[str], None] = lambda text: None) -> Played:
    """Play every command that a machine can play, in order, in a home folder of its own.

    The course's repository and the student's own are bare repositories in that folder, reached by the addresses that
    the page names. Before the first command that needs it, the files of `solution/` are put in place, as a student
    would have written them.

    Args:
        say: Told what is being played.
    """
    with tempfile.TemporaryDirectory(prefix="lab2-play-") as folder, ExitStack() as stack:
        home = Path(folder).resolve() / "home"
        home.mkdir()
        env = _environment(home)
        _repositories(home, env)
        wrong: list[str] = []
        outputs: dict[str, tuple[str, ...]] = {}
        terminals: dict[str, Terminal] = {}
        running: dict[str, str] = {}  # command → terminal
        host = os.uname().nodename
        exercise_done = False
        stack.callback(_stop_daemon, env)

        def keep(command: Command, terminal: Terminal) -> None:
            if command.show:
                lines = normalise(terminal.output, str(home), host)
                if len(lines) < command.show:
                    wrong.append(f"{command.id}: printed {len(lines)} lines, the page wants {command.show}.")
                outputs[command.id] = lines[: command.show]

        def stop(ids: Iterable[str]) -> None:
            for key in ids:
                terminal = terminals[running.pop(key)]
                keep(commands()[key], terminal)
                if not terminal.interrupt(STOP_SECONDS):
                    wrong.append(f"{key}: did not stop within {STOP_SECONDS:g} s of Ctrl-C.")

        for command in commands().values():
            if command.not_played:
                continue
            if command.needs_exercise and not exercise_done:
                _do_exercise(home)
                exercise_done = True
            stop(command.stop)
            if command.terminal not in terminals:
                terminals[command.terminal] = stack.enter_context(Terminal(env, str(home)))
            if command.terminal in running.values():
                wrong.append(
                    f"{command.id}: terminal {command.terminal} is busy; the manifest must stop what runs there."
                )
                break
            say(f"{command.terminal}$ {command.run}")
            terminal = terminals[command.terminal]
            wrong += _type_and_compare(command, terminal)
            for key, pattern in command.elsewhere:
                if not terminals[running[key]].wait_for(pattern, START_SECONDS):
                    wrong.append(f"{command.id}: after it, {key} did not print {pattern!r}.")
            if command.keeps_running:
                running[command.id] = command.terminal
            else:
                keep(command, terminal)
        stop(tuple(running))
        made = Recording(
            recorded=date.today(),
            distro=env.get("ROS_DISTRO", ""),
            versions=_versions(),
            cli={verb: _options(["ros2", *verb.split(), "--help"], env) for verb in (*_VERBS, *_MORE_VERBS)},
            colcon=_options(["colcon", "build", "--help"], env),
            outputs=outputs,
        )
    return Played(made, wrong)


def _type_and_compare(command: Command, terminal: Terminal) -> list[str]:
    """Type *command* and compare. A question about the graph is asked again for a while: discovery takes a moment."""
    deadline = time.monotonic() + START_SECONDS
    while True:
        terminal.clear()
        terminal.type(command.run)
        wrong = _compare(command, terminal)
        if not wrong or not command.run.startswith(_ASKED_AGAIN) or time.monotonic() > deadline:
            return wrong


def _compare(command: Command, terminal: Terminal) -> list[str]:
    """Wait for what *command* must show, and say what it did not."""
    if not command.keeps_running and not terminal.wait_ready(START_SECONDS):
        return [f"{command.id}: was still running after {START_SECONDS:g} s."]
    missing = [
        f"{command.id}: did not print {pattern!r}, but: {terminal.output.strip()[-400:]!r}"
        for pattern in command.see
        if not terminal.wait_for(pattern, START_SECONDS if command.keeps_running else 0)
    ]
    if not command.keeps_running and terminal.code != 0:
        missing.append(f"{command.id}: ended with {terminal.code}: {terminal.output.strip()[-400:]!r}")
    if command.keeps_running and terminal.code is not None:
        missing.append(f"{command.id}: ended by itself with {terminal.code}: {terminal.output.strip()[-400:]!r}")
    return missing


def _environment(home: Path) -> dict[str, str]:
    """This process's environment in a home of its own, in a ROS domain of its own."""
    kept = {key: value for key, value in os.environ.items() if key not in _DROPPED}
    return {
        **kept,
        "HOME": str(home),
        "TERM": "dumb",
        "LANG": "C.UTF-8",
        "LC_ALL": "C.UTF-8",
        "COLCON_LOG_LEVEL": "error",
        "RCUTILS_COLORIZED_OUTPUT": "0",
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "GIT_CONFIG_NOSYSTEM": "1",
        "GIT_PAGER": "cat",
    }


def _repositories(home: Path, env: dict[str, str]) -> None:
    """The course's repository, holding the template, and an empty one of the student's own, at the page's addresses."""
    served = home.parent / "served"
    course, own = served / "course.git", served / "own.git"
    checkout = served / "checkout"
    shutil.copytree(TEMPLATE, checkout, ignore=shutil.ignore_patterns("__pycache__", "build", "install", "log"))
    who = ["-c", "user.name=The lab team", "-c", "user.email=lab2@example.com"]
    for arguments in (
        ["init", "--quiet", "--initial-branch=main", str(checkout)],
        ["-C", str(checkout), "add", "."],
        ["-C", str(checkout), *who, "commit", "--quiet", "--message=Lab 2"],
        ["clone", "--quiet", "--bare", str(checkout), str(course)],
        ["init", "--quiet", "--bare", "--initial-branch=main", str(own)],
    ):
        subprocess.run(["git", *arguments], env=env, check=True, capture_output=True)
    address = next(shlex.split(c.run)[-1] for c in commands().values() if c.run.startswith("git remote add origin"))
    (home / ".gitconfig").write_text(
        f'[url "file://{course}"]\n\tinsteadOf = {lab.course().template_clone_url}\n'
        f'[url "file://{own}"]\n\tinsteadOf = {address}\n',
        encoding="utf-8",
    )


def _do_exercise(home: Path) -> None:
    """Put the files that the tasks ask for in place, as a student would have written them."""
    target = home / lab.course().workspace.removeprefix("~/") / "src" / lab.specification().package
    for task in tasks().values():
        for change in task.changes:
            shutil.copyfile(SOLUTION / change.file, target / change.file)


def _options(argv: list[str], env: dict[str, str]) -> tuple[str, ...]:
    """The options that the help of *argv* names, sorted."""
    done = subprocess.run(argv, env={**env, "COLUMNS": "200"}, capture_output=True, text=True, check=True, timeout=60)
    return tuple(sorted(set(_OPTION.findall(done.stdout))))


def _versions() -> dict[str, str]:
    """Versions of what is played with, as far as they can be told."""
    found = {}
    for name in VERSIONED:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _stop_daemon(env: dict[str, str]) -> None:
    subprocess.run(["ros2", "daemon", "stop"], env=env, capture_output=True, check=False, timeout=60)
