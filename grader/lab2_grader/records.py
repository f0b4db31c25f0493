"""Every frozen value that crosses a stage, in the order in which the stages make them.

submission → build → scenes → evidence → checks → score → reports

Times inside a scene (`at`) are seconds since that scene began, on the monotonic clock. Durations are seconds.
Sequences are tuples; nothing here prints, renders or reads a file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from enum import Enum

import msgspec

EVIDENCE_SCHEMA = "lab2-grader/evidence/1"
RESULT_SCHEMA = "lab2-grader/result/1"
CLASS_SCHEMA = "lab2-grader/class/1"


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the records that are written as JSON objects."""


class Row(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag_field="row", tag=True):
    """Base of what is observed in a scene; written as one JSON array a line, its kind first."""


# --- processes ----------------------------------------------------------------------------------


class Limits(Record, frozen=True):
    """What one run of a process and all its descendants may use.

    Args:
        seconds: Wall-clock time before it is stopped.
        output_bytes: How much of each of its two streams of output is kept.
        processes: Processes and threads at once; 0 for no limit.
        memory_bytes: Resident memory of all together; 0 for no limit.
        file_bytes: Size of any one file it writes; 0 for no limit.
        cpu_seconds: Time on processors of all together; 0 for no limit.
    """

    seconds: float
    output_bytes: int = 1_000_000
    processes: int = 0
    memory_bytes: int = 0
    file_bytes: int = 0
    cpu_seconds: float = 0


class Request(Record, frozen=True):
    """A process to be started: the only way in which this package starts one.

    Args:
        argv: Program and arguments.
        env: The whole environment, nothing is inherited.
        cwd: Working directory.
        limits: What it may use.
        announces: The line with which it says on standard error that it is inside its walls, before the program begins;
            empty when there are none. It is not kept.
    """

    argv: tuple[str, ...]
    env: tuple[tuple[str, str], ...]
    cwd: str
    limits: Limits
    announces: str = ""


class EndedBy(str, Enum):
    """Who ended a process."""

    ITSELF = "itself"
    GRADER = "grader"  # the scene was over, or the run was interrupted
    DEADLINE = "deadline"  # its time was up
    LIMIT = "limit"  # it used more than it may of something else


class Outcome(Record, frozen=True):
    """How a process ended.

    Args:
        code: Exit code; None when a signal ended it.
        signal: Number of the signal that ended it; None when it exited.
        ended_by: Who ended it.
        limit: Which limit was struck (`seconds`, `memory`, `processes`, `cpu`) when `ended_by` is LIMIT, else empty.
        stdout: What was kept of standard output.
        stderr: What was kept of standard error.
        dropped_bytes: Output beyond the limit, thrown away.
        seconds: From start to end.
    """

    code: int | None
    signal: int | None
    ended_by: EndedBy
    limit: str
    stdout: bytes
    stderr: bytes
    dropped_bytes: int
    seconds: float


# --- submission ---------------------------------------------------------------------------------


class SourceFile(Record, frozen=True):
    """A text file of the package, kept so that hints can name lines; `path` is relative to the package.

    Args:
        path: Relative to the package.
        text: What stands in it, whole: a file above the limit is left out.
    """

    path: str
    text: str


class GitFacts(Record, frozen=True):
    """What the repository whose top folder is the submission says of itself.

    Args:
        commit: Full id of HEAD; None when nothing was ever committed.
        remotes: Addresses of the remotes, without user names and passwords.
        committed_work: Those files of the exercise (6.7) that HEAD holds, relative to the package.
        uncommitted: Changed or untracked files of the package that HEAD does not hold so, at most 20.
        pushed: HEAD is on a branch of a remote, as far as the repository knows.
        products: Committed build products and caches, at most 20.
        products_count: How many there are in all.
        committed: When that commit was made, ISO 8601 with its time zone; empty when unknown.
        submodule: The folder of the package, or one around it, that HEAD holds only as a link to another repository; else empty.
    """

    commit: str | None
    remotes: tuple[str, ...]
    committed_work: tuple[str, ...]
    uncommitted: tuple[str, ...]
    pushed: bool
    products: tuple[str, ...]
    products_count: int
    committed: str = ""
    submodule: str = ""


class SubmissionFacts(Record, frozen=True):
    """What was handed in, as far as it concerns the verdicts.

    Args:
        name: A short name for people and for folders of results.
        source: What the grader was given: a path or an address, without secrets.
        sha256: Digest over the names and contents of the package's files.
        commit: Full commit id when the submission is a git repository, else None.
        package_path: Where the package was found, relative to the top of the submission; "." for the top.
        git: None when no git history came with it.
        sources: The package's Python files, `setup.py`, `setup.cfg` and `package.xml`, bounded in size.
    """

    name: str
    source: str
    sha256: str
    commit: str | None
    package_path: str
    git: GitFacts | None
    sources: tuple[SourceFile, ...]


class Submission(Record, frozen=True):
    """A package found and taken over, ready to be built.

    Args:
        facts: What is recorded of it.
        package_dir: Absolute path of a clean copy of the package: regular files and folders only.
    """

    facts: SubmissionFacts
    package_dir: str


# --- build --------------------------------------------------------------------------------------


class EntryPoint(Record, frozen=True):
    """One line of `console_scripts`: `name = target`.

    Args:
        name: What `ros2 run` calls it.
        target: package.module:function, as it stands in setup.py.
    """

    name: str
    target: str


class Build(Record, frozen=True):
    """What `colcon build` made of the package.

    Args:
        ok: colcon ended with 0 and installed the package.
        code: Its exit code; None when it was ended by a signal or by us.
        ended_by: Who ended it.
        limit: Which limit it struck, else empty.
        seconds: How long it took.
        log: The end of what it printed, cleaned.
        executables: Names in `lib/lab2`, what `ros2 run` offers, sorted.
        entry_points: The console scripts that were installed.
        modules: Python modules of the package that were installed, without the package's name, sorted.
        launch_files: Files below `share/lab2` that end in `.py`, `.xml`, `.yaml` or `.yml`, sorted.
        dangling: Executables whose entry point names a module of the package that was not installed, sorted.
        python: Version of the Python that built it and runs it, such as `3.12.3`.
    """

    ok: bool
    code: int | None
    ended_by: EndedBy
    limit: str
    seconds: float
    log: str
    executables: tuple[str, ...]
    entry_points: tuple[EntryPoint, ...]
    modules: tuple[str, ...]
    launch_files: tuple[str, ...]
    dangling: tuple[str, ...]
    python: str = ""


# --- scenes: what an observer saw ---------------------------------------------------------------


class SceneName(str, Enum):
    """The scenes of DESIGN section 4."""

    CONVERSATION = "conversation"
    LISTENER = "listener"
    TALKER = "talker"
    ORIGINALS = "originals"


class Clock(str, Enum):
    """Who drives the ROS clock of a scene."""

    TIME_LAPSE = "time-lapse"
    REAL_TIME = "real-time"


class Phase(Row, frozen=True):
    """A part of the scene begins: `start`, `graph`, `period`, `slow`, `fast`, `real-time`, `send <topic>`, `stop`.

    Args:
        at: When it begins.
        name: Which part.
    """

    at: float
    name: str


class Endpoint(Row, frozen=True):
    """A publisher or subscription appears in the graph, or leaves it.

    Args:
        at: When it was seen.
        event: `appeared` or `gone`.
        kind: `publisher` or `subscription`.
        gid: Its identity in the middleware, hexadecimal.
        node: Fully qualified name of the node.
        topic: Fully qualified name of the topic.
        type: Type of the topic, for example `std_msgs/msg/Int8`.
        reliability: `reliable` or `best-effort`.
        durability: `volatile` or `transient-local`.
        program: The executable of the package whose process (or whose child) it belongs to, by the process id in its
            identity and the process table; `-` for a process that is none of them; empty when unknown.
    """

    at: float
    event: str
    kind: str
    gid: str
    node: str
    topic: str
    type: str
    reliability: str
    durability: str
    program: str = ""


SEVERAL_PUBLISHERS = 3  # of one node on one topic: so many are made in a callback


def renews_publisher(publishers: Iterable[Endpoint]) -> bool:
    """Whether one node keeps making new publishers, of *publishers* on one topic: what is sent at once with one may be lost."""
    nodes = Counter(node for node, _ in {(endpoint.node, endpoint.gid) for endpoint in publishers})
    return max(nodes.values(), default=0) >= SEVERAL_PUBLISHERS


class Message(Row, frozen=True):
    """A message arrived at the observer.

    Args:
        at: When it arrived.
        topic: Fully qualified name of the topic.
        type: Type of the topic.
        number: How many messages the publisher had published with this one, from 1.
        data: Its `data` field; None when it has none that is a number or a text.
    """

    at: float
    topic: str
    type: str
    number: int
    data: int | float | str | None


class Line(Row, frozen=True):
    """A line that a process of the submission printed.

    Args:
        at: When it was read.
        source: The executable's name as the launcher labels it (`numeric_listener`), or `launch` for the launcher's own.
        stream: `stdout` or `stderr` as the grader read it.
        text: The line, cleaned: printable characters only, cut at the limit.
    """

    at: float
    source: str
    stream: str
    text: str


class Tick(Row, frozen=True):
    """The grader moved the ROS clock; `clock` is its new time, in seconds.

    Args:
        at: When it was moved.
        clock: The ROS time it was set to, in seconds.
    """

    at: float
    clock: float


class Sent(Row, frozen=True):
    """The grader published a message of its own.

    Args:
        at: When it was published.
        topic: Fully qualified name of the topic.
        data: Its `data` field.
    """

    at: float
    topic: str
    data: int | str


class ProcessSeen(Row, frozen=True):
    """A process of the submission was seen running; `executable` is its name when it is one of the package's, else empty.

    Args:
        at: When it was seen first.
        pid: Its process id, as the grader sees it.
        executable: Name of the package's executable that it is, else empty.
        command: Its command line, cleaned and cut.
    """

    at: float
    pid: int
    executable: str
    command: str


class ProcessGone(Row, frozen=True):
    """A process seen before is no longer there; `by` says whether it ended by itself or the scene was being stopped.

    Args:
        at: When it was found gone.
        pid: Its process id, as the grader sees it.
        by: Whether it ended by itself or the scene was being stopped.
    """

    at: float
    pid: int
    by: EndedBy


class ProgramEnded(Row, frozen=True):
    """What the scene started (the launch, or the one executable) ended.

    Args:
        at: When.
        code: Exit code, None when a signal ended it.
        signal: Signal number, None when it exited.
        by: Who ended it.
        limit: Which limit it struck, else empty.
    """

    at: float
    code: int | None
    signal: int | None
    by: EndedBy
    limit: str


class Measured(Row, frozen=True):
    """A number the observer worked out.

    `graph_seconds`, `period_seconds`, `follows_ros_clock` (1 or 0), and what was more than is kept: `dropped_bytes`,
    `dropped_lines`, `dropped_messages`.

    Args:
        at: When it was known.
        name: What was measured.
        value: Seconds, a count, or 1 for yes and 0 for no.
    """

    at: float
    name: str
    value: float


class Unsupported(Row, frozen=True):
    """Our own launcher met something of the launch API that it does not know: our limit, not the student's fault.

    Args:
        at: When it said so.
        what: The name in the launch API.
    """

    at: float
    what: str


Event = (
    Phase | Endpoint | Message | Line | Tick | Sent | ProcessSeen | ProcessGone | ProgramEnded | Measured | Unsupported
)


class ScenePlan(Record, frozen=True):
    """What an observer is told to do.

    Args:
        scene: Which scene to play.
        clock: Who drives the ROS clock.
        program: What to start in the submission's sandbox.
        label: The executable's name when the program is one executable; empty when it is a launch.
        talker: The executable that is the talker of a launch.
        listener: The executable that is the listener of a launch.
        numbers: Numbers to publish (listener).
        texts: Strings to publish (listener).
    """

    scene: SceneName
    clock: Clock
    program: Request
    label: str
    talker: str = ""
    listener: str = ""
    numbers: tuple[int, ...] = ()
    texts: tuple[str, ...] = ()


class Scene(Record, frozen=True):
    """One scene as it was played.

    Args:
        name: Which scene.
        started_with: How the submission's nodes were started: `launch`, or the `executable` or `module` of a name.
        label: Name of that executable or module; empty for a launch.
        clock: Who was to drive the ROS clock.
        complete: The observer came to the end of its plan.
        fault: What of ours failed, in a sentence; empty when nothing did.
        seconds: How long the scene took.
        events: What was observed, in order.
    """

    name: SceneName
    started_with: str
    label: str
    clock: Clock
    complete: bool
    fault: str
    seconds: float
    events: tuple[Event, ...]

    @property
    def follows_own_clock(self) -> bool:
        """Whether its nodes were found not to follow the ROS clock that the grader drove."""
        return self.clock is Clock.TIME_LAPSE and any(
            isinstance(event, Measured) and event.name == "follows_ros_clock" and event.value == 0
            for event in self.events
        )


# --- evidence -----------------------------------------------------------------------------------


class Runtime(Record, frozen=True):
    """With what the submission was run.

    Args:
        ros: `sourced` or `wheels`.
        distro: Name of the ROS distribution.
        clock: How the numeric pair's clock was driven: `time-lapse` or `real-time`.
        isolation: `bubblewrap` or `off`.
        grader: Version of the grader.
    """

    ros: str
    distro: str
    clock: str
    isolation: str
    grader: str


class Seconds(Record, frozen=True):
    """How long the stages took; `run` is all scenes, side by side.

    Args:
        build: Of `colcon build`.
        run: Of all scenes together, side by side.
        total: From the start to the judgement.
    """

    build: float
    run: float
    total: float


class Evidence(Record, frozen=True):
    """All that was observed of one submission. Checks see this and nothing else.

    Args:
        submission: What was handed in.
        build: None when the build was never reached.
        scenes: Those that were played, at most one of each name.
        runtime: With what.
        faults: What of ours failed outside a scene, a sentence each.
        seconds: How long it took.
        began: When grading began, ISO 8601 in UTC.
    """

    submission: SubmissionFacts
    build: Build | None
    scenes: tuple[Scene, ...]
    runtime: Runtime
    faults: tuple[str, ...]
    seconds: Seconds
    began: str = ""

    def scene(self, name: SceneName) -> Scene | None:
        """The scene of that name, or None when it was not played."""
        return next((scene for scene in self.scenes if scene.name is name), None)


# --- verdicts and score -------------------------------------------------------------------------


class Status(str, Enum):
    """What can become of a check (DESIGN section 3)."""

    PASS = "pass"
    PARTIAL = "partial"
    FAIL = "fail"
    BLOCKED = "blocked"
    NOT_ASSESSED = "not-assessed"
    INCONCLUSIVE = "inconclusive"


class Verdict(Record, frozen=True):
    """What one check says.

    Args:
        check: Its id.
        status: What became of it.
        message: Key of the fault in the catalogue, for example `overflow`; empty on a pass.
        symptom: Id of the worksheet's troubleshooting row that fits; empty for none.
        expected: What the worksheet asks, for people.
        observed: What was seen, for people.
        hint: What to try next, for people; empty on a pass.
        because: Ids of the checks that block it.
        file: Path within the package where the cause stands; empty when unknown.
        line: Line in that file, from 1; 0 when unknown.
    """

    check: str
    status: Status
    message: str = ""
    expected: str = ""
    observed: str = ""
    hint: str = ""
    symptom: str = ""
    because: tuple[str, ...] = ()
    file: str = ""
    line: int = 0


class CheckResult(Record, frozen=True):
    """A verdict with its points, as `result.json` has it.

    Args:
        id: Its id: a contract, never changed.
        item: The item of the checklist that it serves.
        title: What it asks, for people.
        status: The verdict.
        points: Points given.
        max_points: Points that it could give; when it was not assessed, the sums leave them out.
        expected: What is asked, in a sentence.
        observed: What was seen instead; empty when it passed.
        hint: What to do next; empty when it passed.
        section: Section of the worksheet.
        message: Key of the fault in the catalogue of messages; empty when it passed.
        symptom: Row of the worksheet's troubleshooting table that fits, else empty.
        because: Checks that had to pass first, when it is blocked.
        file: File of the package that the hint is about, else empty.
        line: Line in that file, from 1; 0 for none.
    """

    id: str
    item: str
    title: str
    status: Status
    points: int
    max_points: int
    expected: str
    observed: str
    hint: str
    section: str
    message: str
    symptom: str
    because: tuple[str, ...]
    file: str
    line: int


class ItemResult(Record, frozen=True):
    """An item of the worksheet's checklist with the points of its checks.

    Args:
        item: Its id in the rubric.
        text: Its sentence in the worksheet (6.8).
        status: `pass` when all its checks passed, `partial` when some did, `blocked` when nothing but that is left.
        points: Points of its checks together.
        max_points: Points that its checks could give.
    """

    item: str
    text: str
    status: Status
    points: int
    max_points: int


class SubmissionResult(Record, frozen=True):
    """The submission as `result.json` names it.

    Args:
        name: A short name for people.
        source: What the grader was given: a path or an address, without secrets.
        sha256: Digest over the names and contents of the package's files.
        commit: Full commit id when it is a git repository, else None.
    """

    name: str
    source: str
    sha256: str
    commit: str | None


class Digests(Record, frozen=True):
    """SHA-256 of what the result was made from, hexadecimal.

    Args:
        submission: Of the package's files.
        evidence: Of the files of the evidence.
        rubric: Of the rubric it was marked by.
    """

    submission: str
    evidence: str
    rubric: str


class Result(Record, frozen=True):
    """`result.json`: the contract of DESIGN section 3.

    Args:
        schema: Always `RESULT_SCHEMA`.
        submission: What was graded.
        graded: False when the mark is withheld.
        score: Points; None when the mark is withheld.
        max_score: Points that could be had: 100 less what was not assessed.
        checklist: The worksheet's checklist, in its order.
        checks: All checks, in the rubric's order.
        notes: Information without points, and why a mark is withheld.
        runtime: With what it was run.
        seconds: How long it took.
        digests: What the result was made from.
        signature: HMAC-SHA-256 over the rest when a key was given, else empty.
    """

    schema: str
    submission: SubmissionResult
    graded: bool
    score: int | None
    max_score: int
    checklist: tuple[ItemResult, ...]
    checks: tuple[CheckResult, ...]
    notes: tuple[str, ...]
    runtime: Runtime
    seconds: Seconds
    digests: Digests
    signature: str = ""


# --- a class ------------------------------------------------------------------------------------


class Unknown(Record, frozen=True):
    """Something in the inbox that is not graded, and why.

    Args:
        what: Its name in the inbox.
        reason: Why it is not graded.
    """

    what: str
    reason: str


class ClassState(str, Enum):
    """What became of a submission."""

    GRADED = "graded"
    WITHHELD = "withheld"  # inconclusive, or the grader failed
    REFUSED = "refused"
    WAITING = "waiting"  # not graded yet: the class was interrupted


class Lost(Record, frozen=True):
    """A check that a submission lost points on.

    Args:
        check: Its id.
        status: Its status.
        points: Points lost.
        message: Key of the fault, empty when there is none.
        observed: What was seen.
    """

    check: str
    status: str
    points: int
    message: str
    observed: str


class ClassLine(Record, frozen=True):
    """One submission in the summary.

    Args:
        name: Names the folder of its results.
        student: For people.
        keys: By what a gradebook knows the student.
        state: What became of it.
        score: Points; None without a mark.
        max_score: Points that could be had; 0 when nothing was judged.
        reason: Why there is no mark; empty when there is one.
        lost: Checks that did not pass, in the rubric's order.
        not_assessed: Checks that could not be asked of what was handed in, and cost nothing, in the rubric's order.
        flags: What a person should look at.
        note: What a person should know of how it was handed in.
        shown: Where it came from.
        commit: Full commit id, or None.
        sha256: Digest of the package; empty when it was refused.
        seconds: What grading it took.
        attempts: How often it was graded.
        report: Its report, relative to the summary; empty for none.
    """

    name: str
    student: str
    keys: tuple[str, ...]
    state: ClassState
    score: int | None = None
    max_score: int = 0
    reason: str = ""
    lost: tuple[Lost, ...] = ()
    not_assessed: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    note: str = ""
    shown: str = ""
    commit: str | None = None
    sha256: str = ""
    seconds: float = 0.0
    attempts: int = 0
    report: str = ""


class CommonFault(Record, frozen=True):
    """A way in which a check was missed, how many did, and one of the observations.

    Args:
        message: Key of the fault.
        count: Submissions that have it.
        example: What was observed in one of them.
    """

    message: str
    count: int
    example: str


class CheckRate(Record, frozen=True):
    """How a class did in one check; `judged` leaves out what was not assessed or inconclusive.

    Args:
        id: Of the check.
        title: What it asks, for people.
        section: Section of the worksheet.
        passed: Submissions that passed it.
        judged: Submissions in which it could be judged.
        faults: The commonest faults, most frequent first.
    """

    id: str
    title: str
    section: str
    passed: int
    judged: int
    faults: tuple[CommonFault, ...]


class ClassSummary(Record, frozen=True):
    """`summary.json`.

    Args:
        schema: Always `CLASS_SCHEMA`.
        title: Of the lab.
        grader: Version of the grader.
        code: Digest of the grader's code and facts.
        rubric: SHA-256 of the rubric.
        max_score: What the rubric's checks are worth together.
        lines: One for each submission, by name.
        checks: One for each check, in the rubric's order.
        identical: Names of submissions with the same package, group by group.
        unknown: What in the inbox was not understood.
    """

    schema: str
    title: str
    grader: str
    code: str
    rubric: str
    max_score: int
    lines: tuple[ClassLine, ...]
    checks: tuple[CheckRate, ...]
    identical: tuple[tuple[str, ...], ...]
    unknown: tuple[Unknown, ...]
