"""Reads the catalogue of sentences for people, `facts/messages.toml`."""

from __future__ import annotations

import functools

import msgspec

from lab2_grader.errors import RefusedError
from lab2_grader.lab import FACTS
from lab2_grader.records import Record
from lab2_grader.text import clean

VALUE_LENGTH = 300  # characters of one value filled into a sentence


class Refusal(Record):
    """The sentence of one rule of submission, with `str.format` placeholders."""

    text: str


class Catalogue(Record):
    """`messages.toml`."""

    refusal: dict[str, Refusal]


@functools.cache
def catalogue() -> Catalogue:
    """The catalogue."""
    return msgspec.toml.decode((FACTS / "messages.toml").read_bytes(), type=Catalogue)


def refusal(rule: str, **values: str | float) -> RefusedError:
    """The refusal under *rule*; *values* fill its sentence and are cleaned, because they come from the submission."""
    shown = {
        key: clean(value, VALUE_LENGTH) if isinstance(value, str) else f"{value:,}" for key, value in values.items()
    }
    return RefusedError(rule, catalogue().refusal[rule].text.format_map(shown))
