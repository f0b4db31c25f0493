"""Reading printed lines: which numbers stand in them, and who printed them."""

from __future__ import annotations

import pytest

from lab2_grader.reading import numbers_in, said, split_label

STAMP = "[INFO] [1795247500.476591940] [numeric_listener]: "


@pytest.mark.parametrize(
    "line",
    [
        "5", "I heard: 5", "I heard: '5'", "got 5.", "got 5, thanks", "n=5", "#5", "[5]", "<5>", "5!", "005", "+5",
        "std_msgs.msg.Int8(data=5)", "number5", "Int8:5", "5 of 127", "the 5th", "5.0", "5.000000", "(5)", "x: 5\t",
        "I heard the number: 5 (message 17, 12:30:05)", "我听到了数字:5", "5...", "12 34 5 6", "value_5",
        "I heard...5", "No.5", "msg.5", "…5", "data . 5", "0..5", "0...5", "5..127", "v1.2.3: 5", "[12:30:01.123] 5",
    ],
)  # fmt: skip
def test_a_number_of_its_own_is_found(line: str) -> None:
    assert 5 in numbers_in(line)
    assert 5 in numbers_in(STAMP + line)


@pytest.mark.parametrize(
    "line",
    [
        "",
        "55",
        "15",
        "5.5",
        "0.5",
        "1.5",
        "15.0",
        "0.05",
        "five",
        "50",
        "1,5.25",
        "5678901234567",
        "1.5.0",
        "0.5.3",
        "v1.5",
        "10.5.0.1",
        "1795247500.5",
        "12:30:01.5",
        "2026.5.11",
        "heard...55",
        "No.15",
        "msg.5.5",
    ],
)
def test_a_part_of_another_number_is_not(line: str) -> None:
    assert 5 not in numbers_in(line)


@pytest.mark.parametrize(
    "line",
    [
        "-87",
        "I heard...-87",
        "No.-87",
        "-128..-87",
        "I heard: -87",
        "data=-87)",
        "number-87",
        "[-87]",
        "-87.0",
        "'-87'",
    ],
)
def test_negative_numbers(line: str) -> None:
    assert -87 in numbers_in(line)


def test_a_dash_may_be_a_minus_or_not() -> None:
    assert numbers_in("number-5") >= {5, -5}
    assert -5 not in numbers_in("number 5")


def test_the_logger_s_own_numbers_do_not_count() -> None:
    assert numbers_in(STAMP + "nothing") == frozenset()
    assert said(STAMP + "hello") == "hello"
    assert said("hello") == "hello"


def test_a_greeting_s_count_does_not_pass_for_the_number() -> None:
    greetings = ["Hello World, 1", "Hello World, 12"]
    assert numbers_in("I heard: Hello World, 12", greetings) == frozenset()
    assert numbers_in("I heard: Hello World, 12 and 3", greetings) == {3}
    assert numbers_in("I heard: 12", ["12"]) == {12}  # a text that is only a number cannot be told from it


def test_lines_of_a_launch() -> None:
    assert split_label("[numeric_listener-2] I heard: 5") == ("numeric_listener", "I heard: 5")
    assert split_label("[numeric_listener-2] " + STAMP + "5") == ("numeric_listener", STAMP + "5")
    assert split_label("[INFO] [launch]: All log files …") == ("launch", "[INFO] [launch]: All log files …")
