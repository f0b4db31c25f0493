"""Sequences of numbers, taken apart."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from lab2_grader.checks.sequence import Sequel, analyse, around, whole
from lab2_grader.records import Message

TOPIC, TYPE = "/numeric_chatter", "std_msgs/msg/Int8"


def said(data: Iterable[int | float | str], missed: Iterable[int] = ()) -> list[Message]:
    """Messages with *data*, but for those whose numbers (from 1) were *missed*."""
    lost = set(missed)
    found = [Message(i / 2, TOPIC, TYPE, i, value) for i, value in enumerate(data, 1)]
    return [message for message in found if message.number not in lost]


def taken_apart(data: Iterable[int | float | str], missed: Iterable[int] = ()) -> Sequel:
    sequel = analyse(said(data, missed), 0, 127)
    assert sequel is not None
    return sequel


COUNT = [n % 128 for n in range(300)]


def test_a_right_count() -> None:
    sequel = taken_apart(COUNT)
    assert not sequel.irregular and sequel.common_rise == 1 and sequel.first_number == 1
    assert [(step.before, step.after) for step in sequel.returns] == [(127, 0), (127, 0)]


@pytest.mark.parametrize("missed", [[1], [1, 2, 3], [50], [128], [129], [128, 129], range(100, 140)])
def test_what_was_missed_is_no_fault(missed: Iterable[int]) -> None:
    sequel = taken_apart(COUNT, missed)
    assert not sequel.irregular and sequel.common_rise == 1
    assert all(step.before == 127 and step.after == 0 for step in sequel.returns)
    assert sequel.values[0] - (sequel.first_number - 1) * sequel.common_rise == 0


@pytest.mark.parametrize(
    ("data", "rise"),
    [
        ([0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20], 2),
        ([0, -1, -2, -3, -4, -5, -6, -7, -8, -9, -10, -11], -1),
        ([0] * 20, 0),
        ([0, 0, 1, 1, 2, 2, 3, 3, 4, 4], 0),
        ([5, 3, 9, 1, 7, 2, 4], 0),
        ([0], 0),
    ],
)
def test_the_common_rise(data: list[int], rise: int) -> None:
    assert taken_apart(data).common_rise == rise


def test_one_skipped_number() -> None:
    sequel = taken_apart([*range(64), *range(65, 100)])
    assert [(step.before, step.after) for step in sequel.irregular] == [(63, 65)]
    assert sequel.common_rise == 1


def test_overflow_is_one_return() -> None:
    overflowed = [(n + 128) % 256 - 128 for n in range(300)]
    sequel = taken_apart(overflowed)
    assert [(step.before, step.after) for step in sequel.returns] == [(127, -128)]
    assert not sequel.irregular


@pytest.mark.parametrize("slipped", [[-128], [-128, -127, -126]])
def test_set_back_too_late_is_one_fault(slipped: list[int]) -> None:
    sequel = taken_apart([*range(128), *slipped, *range(100)])
    assert [(step.before, step.after) for step in sequel.returns] == [(127, -128)]
    assert not sequel.irregular


def test_staying_at_the_largest() -> None:
    sequel = taken_apart([*range(128), 127, 127, 127])
    assert len(sequel.stays) == 3 and not sequel.irregular and not sequel.returns


def test_a_restarted_publisher_counts_from_one_again() -> None:
    messages = said(range(5)) + said(range(5))
    sequel = analyse(messages, 0, 127)
    assert sequel is not None and sequel.first_number == 1
    assert [(step.before, step.after) for step in sequel.returns] == [(4, 0)]


def test_a_middleware_that_does_not_number_its_messages() -> None:
    messages = [Message(i / 2, TOPIC, TYPE, 0, value) for i, value in enumerate(COUNT)]
    sequel = analyse(messages, 0, 127)
    assert sequel is not None and not sequel.irregular and len(sequel.returns) == 2 and sequel.first_number == 1


@pytest.mark.parametrize(
    ("data", "value"), [(5, 5), (-128, -128), (5.0, 5), (5.5, None), ("5", 5), (" -7 ", -7), ("Number: 5", None), ("", None), (None, None), (True, None), ("٣", None)]
)  # fmt: skip
def test_whole_numbers(data: float | str | None, value: int | None) -> None:
    assert whole(data) == value


def test_words_are_no_sequence() -> None:
    assert analyse(said(["Number: 1", "Number: 2"]), 0, 127) is None
    assert taken_apart(["0", "1", "2"]).values == (0, 1, 2)


def test_what_is_shown() -> None:
    assert around(range(20), 10) == "… 6, 7, 8, 9, 10, 11, 12, 13 …"
    assert around([0, 1, 2], 1) == "0, 1, 2"
    assert around([7], 0) == "7"
