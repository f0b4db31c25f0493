"""The recording of the commands as they were played: what the page shows as "you should see"."""

from __future__ import annotations

import functools
import re
from datetime import date
from pathlib import Path

import msgspec

from lab2_worksheet.errors import SourceError
from lab2_worksheet.manifest import Record
from lab2_worksheet.places import RECORDED


class Recording(Record, frozen=True):
    """A whole session.

    Args:
        recorded: The day it was played.
        distro: Name of the ROS distribution.
        versions: Versions of what it was played with, by name.
        cli: For each `ros2` verb of the page (`topic info`), the options that its help names.
        colcon: The options that the help of `colcon build` names.
        outputs: The first lines of what each command printed that the page shows, by id, through `normalise`.
    """

    recorded: date
    distro: str
    versions: dict[str, str]
    cli: dict[str, tuple[str, ...]]
    colcon: tuple[str, ...]
    outputs: dict[str, tuple[str, ...]]


_CHANGES = (
    (re.compile(r"\[\d{9,}\.\d+\]"), "[<time>]"),
    (re.compile(r"pid \[\d+\]"), "pid [<number>]"),
    (re.compile(r"(All log files can be found below) \S+"), r"\1 ~/.ros/log/<date and time>"),
    (re.compile(r"object at 0x[0-9a-f]+"), "object at <address>"),
    (re.compile(r"\[\d+\.\d+s\]"), "[<seconds>s]"),
    (re.compile(r"RIHS01_[0-9a-f]+"), "RIHS01_<number>"),
    (re.compile(r"GID: [0-9a-f.]+"), "GID: <number>"),
    (re.compile(r"\[main [0-9a-f]{7,}\]"), "[main <id>]"),
)
# Lines that depend on how quickly nodes found one another.
_BY_CHANCE = ("Waiting for at least 1 matching subscription", "WARNING: topic [")


def normalise(text: str, home: str, host: str) -> tuple[str, ...]:
    """The lines of *text* without what differs from run to run and from machine to machine.

    Args:
        text: What a command printed.
        home: The home folder it was played in; becomes `~`.
        host: The machine's name; becomes `<computer>`.
    """
    text = text.replace(home, "~").replace(host, "<computer>")
    for pattern, replacement in _CHANGES:
        text = pattern.sub(replacement, text)
    lines = [line.rstrip() for line in text.expandtabs(8).splitlines() if not line.startswith(_BY_CHANCE)]
    while lines and not lines[-1]:
        lines.pop()
    while lines and not lines[0]:
        lines.pop(0)
    return tuple(lines)


@functools.cache
def recording(path: Path = RECORDED) -> Recording:
    """The recording in the repository.

    Raises:
        SourceError: There is none, or it does not validate.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=Recording)
    except (OSError, msgspec.DecodeError) as error:
        raise SourceError(f"{path.name}: {error}. Where ROS 2 is sourced, `lab2_worksheet play --record`.") from error


def write(made: Recording, path: Path = RECORDED) -> None:
    """Write *made* to *path*, for people to read too."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(msgspec.json.format(msgspec.json.encode(made), indent=1) + b"\n")
