"""The catalogue of sentences for people, `facts/messages.toml`: the only place where they are written."""

from __future__ import annotations

import functools

from lab2_grader import lab
from lab2_grader.errors import RefusedError
from lab2_grader.records import Record
from lab2_grader.text import clean

VALUE_LENGTH = 300  # characters of one value filled into a sentence


class Fault(Record, frozen=True):
    """One way to miss a check, with `str.format` placeholders; `symptom` is the id of a troubleshooting row."""

    observed: str
    hint: str
    symptom: str = ""


class CheckTexts(Record, frozen=True):
    """What is said of one check: what it asks, how it is judged, the ruling where the worksheet is silent."""

    expected: str
    judged: str
    ruling: str
    fault: dict[str, Fault]


class Refusal(Record, frozen=True):
    """The sentence of one rule of submission, with `str.format` placeholders."""

    text: str


class Ill(Record, frozen=True):
    """One way in which a machine is unwell: what is found and the command that mends it, with placeholders."""

    found: str
    mend: str
    symptom: str = ""


class DoctorTexts(Record, frozen=True):
    """What `doctor` says of one thing: its name, that it is well, what it should be, and the ways to be unwell."""

    what: str
    well: str
    wanted: str
    ill: dict[str, Ill]


class Catalogue(Record, frozen=True):
    """`messages.toml`."""

    check: dict[str, CheckTexts]
    status: dict[str, str]
    note: dict[str, str]
    phrase: dict[str, str]
    refusal: dict[str, Refusal]
    doctor: dict[str, DoctorTexts]
    report: dict[str, str]


Value = str | int | float


@functools.cache
def catalogue() -> Catalogue:
    """The catalogue.

    Raises:
        UsageError: It is not as it must be; the text names the place.
    """
    return lab.read(lab.FACTS / "messages.toml", Catalogue)


def fill(text: str, **values: Value) -> str:
    """*text* with *values* in its placeholders, each cleaned, because it may come from the submission."""
    shown = {
        key: clean(value, VALUE_LENGTH) if isinstance(value, str) else f"{value:,}" for key, value in values.items()
    }
    return text.format_map(shown)


def status(key: str, **values: Value) -> str:
    """The sentence of `[status]` under *key*."""
    return fill(catalogue().status[key], **values)


def note(key: str, **values: Value) -> str:
    """The sentence of `[note]` under *key*."""
    return fill(catalogue().note[key], **values)


def report(key: str, **values: Value) -> str:
    """The sentence of `[report]` under *key*."""
    return fill(catalogue().report[key], **values)


def phrase(key: str, **values: Value) -> str:
    """The piece of a sentence of `[phrase]` under *key*, to be filled into another."""
    return fill(catalogue().phrase[key], **values)


def refusal(rule: str, **values: Value) -> RefusedError:
    """The refusal under *rule*."""
    return RefusedError(rule, fill(catalogue().refusal[rule].text, **values))


def limits() -> dict[str, Value]:
    """The limits of `limits.toml` as the sentences that name one use them; sizes in MB."""
    resources, build = lab.limits().resources, lab.limits().build
    return {
        "processes": resources.processes,
        "memory": resources.memory_bytes // 1_000_000,
        "cpu": round(resources.cpu_seconds),
        "file_size": resources.file_bytes // 1_000_000,
        "disk": build.disk_bytes // 1_000_000,
        "scratch": resources.scratch_bytes // 1_000_000,
        "output": resources.output_bytes // 1_000_000,
        "lines": resources.lines,
        "install": build.install_bytes // 1_000_000,
        "files": build.files,
    }
