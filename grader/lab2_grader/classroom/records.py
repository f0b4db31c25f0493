"""The frozen values of a class: what an inbox holds, what a worker is given and gives back."""

from __future__ import annotations

from datetime import datetime

from lab2_grader.lab import Rubric
from lab2_grader.records import Clock, Record, SubmissionFacts, Unknown

# --- the inbox ----------------------------------------------------------------------------------


class Part(Record, frozen=True):
    """A file that was handed in and has to be fetched before it can be graded.

    Args:
        place: The file itself, or the zip that it is a member of.
        member: Its name in that zip; empty for a file.
        path: Where it belongs in the submission: as the student named it.
    """

    place: str
    member: str
    path: str


class Entry(Record, frozen=True):
    """One student's submission.

    Args:
        name: Names the folder of its results; no two are alike, letter case aside.
        student: For people.
        keys: By what a gradebook knows the student: user name, e-mail, participant number, full name.
        source: A path or an address; empty when the submission is made of *parts*.
        shown: Where it came from, for people and reports.
        parts: Files to fetch.
        commit: Of an address, the commit to take; empty for the newest.
        before: Of an address, take the last commit not later than this.
        note: What a person should know of how it was handed in; empty for nothing.
    """

    name: str
    student: str
    keys: tuple[str, ...]
    source: str
    shown: str
    parts: tuple[Part, ...] = ()
    commit: str = ""
    before: datetime | None = None
    note: str = ""


class Inbox(Record, frozen=True):
    """What an inbox holds."""

    entries: tuple[Entry, ...]
    unknown: tuple[Unknown, ...]


# --- the unit of work ---------------------------------------------------------------------------


class Task(Record, frozen=True):
    """All that a worker needs to grade one submission; no disk is shared with it.

    Args:
        facts: What is known of the submission.
        package: The package as a tar.
        rubric: What the checks are worth.
        clock: How the numeric pair's clock is driven.
        ros: Which ROS to use: `auto`, `sourced` or `wheels`.
        isolation: False when submissions may run with the worker's own rights.
        code: Digest of the grader's code and facts, which the worker's must equal.
    """

    facts: SubmissionFacts
    package: bytes
    rubric: Rubric
    clock: Clock
    ros: str
    isolation: bool
    code: str


class Graded(Record, frozen=True):
    """What a worker gives back.

    Args:
        result: The folder of the result as a tar; empty when there is none.
        flags: What a person should look at: limits that the submission struck.
        fault: What of ours failed, as a sentence; empty when nothing did.
    """

    result: bytes
    flags: tuple[str, ...] = ()
    fault: str = ""


# --- what is on disk beside a result ------------------------------------------------------------


class Stamp(Record, frozen=True):
    """By what a finished result is known to be up to date; `class.json` beside it.

    Args:
        key: Digest of the submission's facts and package and of the grader's code.
        student: Whose it is, for people.
        keys: By what a gradebook knows the student.
        shown: Where the submission came from.
        note: What a person should know of how it was handed in; empty for nothing.
        flags: What a person should look at: limits that the submission struck.
        attempts: How often it was graded until this result came of it.
    """

    key: str
    student: str
    keys: tuple[str, ...]
    shown: str
    note: str
    flags: tuple[str, ...]
    attempts: int
