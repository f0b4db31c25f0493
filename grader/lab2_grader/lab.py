"""Reads and validates the lab's facts: course, specification, rubric and limits, all TOML beside this module."""

from __future__ import annotations

import functools
import re
from datetime import date
from pathlib import Path
from typing import TypeVar

import msgspec

from lab2_grader import decoding
from lab2_grader.errors import UsageError
from lab2_grader.records import Limits, Record

FACTS = Path(__file__).parent / "facts"
TABLE = re.compile(r"\[\[?\s*([\w.-]+)\s*\]")  # the header of a table in TOML
VALUE = re.compile(r"at `\$\.(\w+)\[(\d+)\](?:\.(\w+))?`")  # where a value stands, as msgspec says it

T = TypeVar("T")


def _hold(condition: bool, otherwise: str) -> None:
    if not condition:
        raise ValueError(otherwise)


class Course(Record, frozen=True):
    """This year's course: the facts that change when the lab is rolled over."""

    title: str
    module_code: str
    year: int
    week: int
    contact_name: str
    contact_email: str
    worksheet_url: str
    template_clone_url: str
    solutions_url: str
    solutions_release: date
    grader_install_url: str
    workspace: str
    ros_distro: str
    ros_python: str
    fail_workflow_on_lost_points: bool

    def __post_init__(self) -> None:
        """Refuse what nothing could follow."""
        _hold(1 <= self.week <= 52, f"week = {self.week}: a week is from 1 to 52")
        _hold(
            re.fullmatch(r"3\.\d+", self.ros_python) is not None,
            f"ros_python = {self.ros_python!r}: give a version such as 3.12",
        )
        _hold("@" in self.contact_email, f"contact_email = {self.contact_email!r}: that is no e-mail address")
        _hold(
            self.solutions_release.year in (self.year, self.year + 1),
            f"solutions_release = {self.solutions_release}: it must be in {self.year} or the year after",
        )
        _hold(
            self.worksheet_url == "" or self.worksheet_url.startswith("https://"),
            f"worksheet_url = {self.worksheet_url!r}: it must begin with https://, or be empty",
        )


class Pair(Record, frozen=True):
    """A talker, a listener and the launch file that starts both, by name."""

    talker: str
    listener: str
    launch_file: str

    @property
    def programs(self) -> tuple[str, str]:
        """The talker and the listener."""
        return self.talker, self.listener


class TextTopic(Record, frozen=True):
    """The topic with greetings; `period_seconds` is that of the talker as handed out."""

    name: str
    type: str
    period_seconds: float

    def __post_init__(self) -> None:
        """Refuse a period that no lesson could use."""
        _hold(0.01 <= self.period_seconds <= 10, f"period_seconds = {self.period_seconds}: it must be from 0.01 to 10")


class NumberTopic(Record, frozen=True):
    """The topic with numbers; the count runs from `smallest` to `largest` and back to `smallest`."""

    name: str
    type: str
    smallest: int
    largest: int

    def __post_init__(self) -> None:
        """Refuse what the messages and the grader's own numbers could not carry."""
        _hold(self.type == "std_msgs/msg/Int8", f"type = {self.type!r}: the lab and its hints are about Int8")
        _hold(self.smallest == 0, f"smallest = {self.smallest}: the count begins at 0")
        _hold(9 <= self.largest <= 127, f"largest = {self.largest}: an Int8 holds no more than 127, and 9 make a count")


class Specification(Record, frozen=True):
    """What the worksheet asks of the package."""

    package: str
    original: Pair
    numeric: Pair
    text_topic: TextTopic
    number_topic: NumberTopic

    @property
    def programs(self) -> tuple[str, ...]:
        """The four programs by name, the numeric pair first."""
        return *self.numeric.programs, *self.original.programs

    @property
    def work(self) -> tuple[str, ...]:
        """The files that students write: their paths within the package."""
        modules = (f"{self.package}/{name}.py" for name in self.numeric.programs)
        return *modules, f"launch/{self.numeric.launch_file}"


class IntakeLimits(Record, frozen=True):
    """Bounds of what may be handed in, and of how long a clone may take."""

    archive_bytes: int
    unpacked_bytes: int
    members: int
    ratio: int
    path_length: int
    clone_seconds: float
    source_file_bytes: int


class BuildLimits(Record, frozen=True):
    """Bounds of `colcon build`."""

    seconds: float
    output_bytes: int
    disk_bytes: int
    install_bytes: int
    files: int


class StartLimits(Record, frozen=True):
    """From starting the nodes to a complete graph."""

    seconds: float
    settle_seconds: float


class ConversationLimits(Record, frozen=True):
    """Bounds and amounts of the conversation and of the talker alone."""

    timelapse_seconds: float
    realtime_seconds: float
    slow_ticks: int
    wraps: int
    silence_seconds: float
    answer_seconds: float


class ListenerLimits(Record, frozen=True):
    """Amounts of the listener alone."""

    numbers: int
    texts: int
    paced: int
    answer_seconds: float


class OriginalsLimits(Record, frozen=True):
    """Bounds of the originals."""

    seconds: float
    messages: int


class StopLimits(Record, frozen=True):
    """How long each rung of the ladder INT, TERM, KILL waits."""

    interrupt_seconds: float
    terminate_seconds: float


class ResourceLimits(Record, frozen=True):
    """What the whole tree of a submission's processes may use."""

    processes: int
    memory_bytes: int
    cpu_seconds: float
    file_bytes: int
    scratch_bytes: int
    output_bytes: int
    line_bytes: int
    lines: int
    messages: int
    topics: int

    def limits(self, seconds: float, output_bytes: int | None = None) -> Limits:
        """These limits for one run of at most *seconds*, keeping *output_bytes* of its output."""
        return Limits(
            seconds=seconds,
            output_bytes=self.output_bytes if output_bytes is None else output_bytes,
            processes=self.processes,
            memory_bytes=self.memory_bytes,
            file_bytes=self.file_bytes,
            cpu_seconds=self.cpu_seconds,
        )


class AllLimits(Record, frozen=True):
    """`limits.toml`."""

    intake: IntakeLimits
    build: BuildLimits
    start: StartLimits
    conversation: ConversationLimits
    listener: ListenerLimits
    originals: OriginalsLimits
    stop: StopLimits
    resources: ResourceLimits


class ChecklistItem(Record, frozen=True):
    """An item of the worksheet's checklist (6.8)."""

    item: str
    text: str


class RubricCheck(Record, frozen=True):
    """A check as the rubric has it: what it is worth and which item it serves."""

    id: str
    item: str
    title: str
    section: str
    points: int


class Rubric(Record, frozen=True):
    """The checklist and the checks, in the order in which reports show them."""

    checklist: tuple[ChecklistItem, ...]
    check: tuple[RubricCheck, ...]


class Symptom(Record, frozen=True):
    """A row of the worksheet's troubleshooting table; texts are Markdown.

    Args:
        id: What messages of the grader and the page call it.
        section: The section of the worksheet that explains what went wrong.
        see: What the student sees.
        pasted: Pieces of an error message by which the row is found; `*` stands for anything.
        cause: The likely cause.
        check: How to make sure.
        fix: How to mend it.
    """

    id: str
    section: str
    see: str
    pasted: tuple[str, ...]
    cause: str
    check: str
    fix: str


class _Symptoms(Record, frozen=True):
    symptom: tuple[Symptom, ...]


def read(path: Path, kind: type[T]) -> T:
    """Decode the file of facts *path* as *kind*.

    Raises:
        UsageError: It cannot be read, is no TOML, or has a key or value that is not allowed; the text names it.
    """
    try:
        return decoding.from_toml(path.read_bytes(), kind)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path.name} is not valid: {error}{_where(path, str(error))}.") from error


def _where(path: Path, error: str) -> str:
    """` (line 12)` when *error* says which value of which table it is about; else empty."""
    if (value := VALUE.search(error)) and (line := _line(path.read_text("utf-8"), value[1], int(value[2]), value[3])):
        return f" (line {line})"
    return ""


@functools.cache
def course() -> Course:
    """The facts of this year's course."""
    return read(FACTS / "course.toml", Course)


@functools.cache
def specification() -> Specification:
    """What the worksheet asks of the package."""
    return read(FACTS / "specification.toml", Specification)


@functools.cache
def limits() -> AllLimits:
    """Budgets of time and limits of resources."""
    return read(FACTS / "limits.toml", AllLimits)


def rubric(path: Path | None = None) -> Rubric:
    """The rubric of *path*, or the lab's own.

    Raises:
        UsageError: The file does not validate; the text names the line.
    """
    own = FACTS / "rubric.toml"
    found = read(path or own, Rubric)
    if path is not None:
        _refuse_odd_rubric(path, found, {check.id for check in read(own, Rubric).check})
    return found


def _refuse_odd_rubric(path: Path, found: Rubric, known: set[str]) -> None:
    """Refuse what is a rubric by its form, but cannot be one of this lab.

    Args:
        path: Where it stands.
        found: What stands there.
        known: The ids of all checks.
    """
    text = path.read_text(encoding="utf-8")
    ids, items = [check.id for check in found.check], [item.item for item in found.checklist]

    def refuse(table: str, index: int, key: str, why: str) -> None:
        raise UsageError(f"{path.name}, line {_line(text, table, index, key)}: {why}")

    for index, check in enumerate(found.check):
        if check.id not in known:
            refuse("check", index, "id", f"there is no check {check.id}. There are: {', '.join(sorted(known))}.")
        if check.id in ids[:index]:
            refuse("check", index, "id", f"the check {check.id} stands here a second time.")
        if check.item not in items:
            refuse("check", index, "item", f"there is no checklist item {check.item}. There are: {', '.join(items)}.")
        if check.points < 0:
            refuse("check", index, "points", f"a check cannot be worth {check.points} points.")
    if missing := sorted(known.difference(ids)):
        raise UsageError(f"{path.name} lacks the check {missing[0]}. Give it 0 points if it is not to count.")
    for index, item in enumerate(items):
        if item in items[:index]:
            refuse("checklist", index, "item", f"the item {item} stands here a second time.")
        if not any(check.points for check in found.check if check.item == item):
            refuse("checklist", index, "item", f"no check gives points for the item {item}.")


def _line(text: str, table: str, index: int, key: str) -> int:
    """The line of *key* in the table of that name and number (from 0) in the TOML *text*; 0 when it is not found."""
    count = -1
    within = False
    for number, line in enumerate(text.splitlines(), 1):
        if header := TABLE.match(line):
            within = header[1] == table
            count += within
            if within and count == index and not key:
                return number
        elif within and count == index and line.split("=")[0].strip() == key:
            return number
    return 0


@functools.cache
def symptoms() -> tuple[Symptom, ...]:
    """The rows of the troubleshooting table, with the lab's facts in their texts.

    Raises:
        UsageError: The file does not validate, or names a fact that there is not.
    """
    spec, names = specification(), course()
    facts = {
        "package": spec.package,
        "workspace": names.workspace,
        "distro": names.ros_distro,
        "text_topic": spec.text_topic.name,
        "number_topic": spec.number_topic.name,
        "number_type": spec.number_topic.type,
        "smallest": str(spec.number_topic.smallest),
        "largest": str(spec.number_topic.largest),
        "before_largest": str(spec.number_topic.largest - 1),
        "numeric_talker": spec.numeric.talker,
        "numeric_listener": spec.numeric.listener,
        "numeric_launch": spec.numeric.launch_file,
    }

    def filled(row: Symptom) -> Symptom:
        try:
            return Symptom(
                id=row.id,
                section=row.section,
                see=row.see.format_map(facts),
                pasted=tuple(piece.format_map(facts) for piece in row.pasted),
                cause=row.cause.format_map(facts),
                check=row.check.format_map(facts),
                fix=row.fix.format_map(facts),
            )
        except (KeyError, ValueError, IndexError) as error:
            raise UsageError(f"symptoms.toml: {row.id} names a fact that there is not: {error}.") from error

    return tuple(filled(row) for row in read(FACTS / "symptoms.toml", _Symptoms).symptom)
