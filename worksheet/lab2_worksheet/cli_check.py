"""Tier 1: every package, executable, launch file, topic, verb and option that the page names exists. Needs no ROS."""

from __future__ import annotations

import functools
import re
import shlex
from pathlib import Path

from lab2_grader import lab

from lab2_worksheet.places import SOLUTION
from lab2_worksheet.recording import recording

_GIT = {
    "add": (),
    "branch": ("-M",),
    "clone": (),
    "commit": ("-m",),
    "config": ("--global",),
    "diff": (),
    "log": ("--oneline",),
    "push": ("-u",),
    "pull": (),
    "remote": ("-v",),
    "rm": ("-r", "--cached"),
    "status": (),
}
_COLCON = {"list": (), "build": None}  # None: the recorded options
_SHELL = {
    "cd": (),
    "echo": (),
    "env": (),
    "export": (),
    "grep": (),
    "hostname": (),
    "ls": ("-a",),
    "mkdir": ("-p",),
    "python3": ("-m", "--version"),
    "rm": ("-r", "-rf"),
    "source": (),
    "ssh": ("-T",),
    "which": (),
}
_ROS_VARIABLES = (
    "ROS_AUTOMATIC_DISCOVERY_RANGE",
    "ROS_DISTRO",
    "ROS_DOMAIN_ID",
    "ROS_PYTHON_CHECK_FIELDS",
)
_TOPICS_OF_ROS = ("/rosout", "/parameter_events")


def problems(text: str) -> list[str]:
    """What is wrong with the command *text*; empty when all that it names exists.

    A beginning of a command (`ros2 topic`, `ros2 run lab2`) is right as far as it goes.
    """
    found: list[str] = []
    for part in text.split(" | "):
        found += _problems(shlex.split(part))
    return found


def _problems(words: list[str]) -> list[str]:
    while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):
        name = words.pop(0).partition("=")[0]
        if name not in _ROS_VARIABLES:
            return [f"{name} is no variable that the worksheet knows."]
    if not words:
        return []
    program = words[0].rpartition("/")[2]
    options = [word for word in words[1:] if word.startswith("-")]
    arguments = [word for word in words[1:] if not word.startswith("-")]
    if program == "ros2":
        return _ros2(arguments, options)
    if program == "colcon":
        known = _COLCON.get(arguments[0], ()) if arguments else ()
        return (
            [] if not arguments else _options("colcon build", options, recording().colcon if known is None else known)
        )
    if program == "git":
        if arguments and arguments[0] not in _GIT:
            return [f"git {arguments[0]} is not among the git commands that the worksheet uses."]
        return _options(f"git {arguments[0]}", options, _GIT[arguments[0]]) if arguments else []
    if program in ("pip", "lab2-grader"):
        return []
    if program not in _SHELL:
        return [f"{program} is no program that the worksheet knows."]
    wrong = _options(program, options, _SHELL[program])
    if program == "python3" and not options:
        wrong += _file(arguments[0])
    return wrong


def _options(what: str, options: list[str], known: tuple[str, ...]) -> list[str]:
    return [f"{what} has no option {option}." for option in options if option not in known]


def _ros2(arguments: list[str], options: list[str]) -> list[str]:
    verbs = recording().cli
    verb = next((v for v in (" ".join(arguments[:2]), " ".join(arguments[:1])) if v in verbs), None)
    if verb is None:
        begun = " ".join(arguments)
        return [] if any(known.startswith(begun) for known in verbs) else [f"ros2 {begun} is no known verb."]
    rest = arguments[len(verb.split()) :]
    return _options(f"ros2 {verb}", options, verbs[verb]) + _ros2_arguments(verb, rest)


def _ros2_arguments(verb: str, rest: list[str]) -> list[str]:
    spec = lab.specification()
    wrong: list[str] = []
    if verb in ("run", "launch", "pkg executables") and rest:
        if "/" in rest[0] or rest[0].endswith(".py"):
            return _file(rest[0])
        if rest[0] != spec.package:
            wrong.append(f"the package is {spec.package}, not {rest[0]}.")
    if verb == "run" and len(rest) > 1 and rest[1] not in executables():
        wrong.append(f"no executable {rest[1]}.")
    if verb == "launch" and len(rest) > 1:
        wrong += _file(f"launch/{rest[1]}")
    if verb.startswith("topic ") and verb != "topic list" and rest:
        types = {topic.name: topic.type for topic in (spec.text_topic, spec.number_topic)}
        if rest[0] not in types and rest[0] not in _TOPICS_OF_ROS:
            wrong.append(f"no topic {rest[0]}.")
        if verb == "topic pub" and len(rest) > 1 and rest[1] != types.get(rest[0]):
            wrong.append(f"{rest[0]} does not carry {rest[1]}.")
    if verb == "node info" and rest and rest[0] not in node_names():
        wrong.append(f"no node {rest[0]}.")
    if verb == "interface show" and rest and rest[0] not in (spec.text_topic.type, spec.number_topic.type):
        wrong.append(f"no type {rest[0]} in this lab.")
    return wrong


def _file(path: str) -> list[str]:
    """Whether the finished package has the file that *path* names, from the workspace or from the package."""
    inside = path.partition(f"/src/{lab.specification().package}/")[2] or path
    name = Path(inside)
    exists = (SOLUTION / name).is_file() or (SOLUTION / "launch" / name.name).is_file()
    return [] if exists else [f"the finished package has no {inside}."]


@functools.cache
def executables() -> tuple[str, ...]:
    """The console scripts that the finished package's `setup.py` names."""
    text = (SOLUTION / "setup.py").read_text(encoding="utf-8")
    return tuple(re.findall(r"'(\w+) = lab2\.", text))


@functools.cache
def node_names() -> tuple[str, ...]:
    """The node names of the package's own files, absolute."""
    text = "".join(path.read_text(encoding="utf-8") for path in sorted(SOLUTION.rglob("*.py")))
    return tuple("/" + name for name in re.findall(r"(?:name=|__init__\()'(\w+)'", text))
