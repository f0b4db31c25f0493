"""Reads the lines that nodes print: what a node said, and which numbers stand in it as numbers of their own.

Pure functions of text, used live by the observer and later by the checks, so that both read alike.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

# What rcutils puts before each log line by default: [INFO] [1700000000.123456789] [node_name]: …
LOG_PREFIX = re.compile(r"^\[(?:DEBUG|INFO|WARN|ERROR|FATAL)\] \[\d+\.\d+\] \[[^\]]*\]: ")

# What `ros2 launch` puts before each line of a process: [numeric_listener-2] …
PROCESS_LABEL = re.compile(r"^\[([^\[\]\n]{1,120})-(\d{1,4})\] ?(.*)$", re.DOTALL)

# What `ros2 launch` says itself of a process: [INFO] [numeric_talker-1]: process started with pid [123]
PROCESS_STARTED = re.compile(r"^\[INFO\] \[([^\[\]\n]{1,120})-(\d{1,4})\]: process started with pid \[(\d+)\]$")
PROCESS_DIED = re.compile(r"^\[ERROR\] \[([^\[\]\n]{1,120})-(\d{1,4})\]: process has died ")

# A whole number that is no part of a longer number or of a decimal fraction (5.0 is 5). It may touch a word (number5) or
# a dot that belongs to words (No.5, heard...5).
NUMBER = re.compile(r"(?<!\d)(?<!\d\.)([+-]?\d{1,12})(?:\.0+)?(?!\d|\.\d)")
SIGNED_AFTER_WORD = re.compile(r"(?<=\w)[-+](\d{1,12})(?:\.0+)?(?!\d|\.\d)")


def said(line: str) -> str:
    """*line* without the prefix of the ROS logger."""
    return LOG_PREFIX.sub("", line, count=1)


def numbers_in(line: str, beside: Iterable[str] = ()) -> frozenset[int]:
    """The whole numbers that stand in *line*, the logger's prefix left out.

    A minus directly after a word (`number-5`) may be a dash, so both readings count.

    Args:
        line: As it was printed.
        beside: Texts whose own numbers do not count: a greeting that ends in a count must not pass for that number.
    """
    text = said(line)
    for other in sorted(beside, key=len, reverse=True):
        if any(letter.isalpha() for letter in other):  # a text that is nothing but a number is no greeting
            text = text.replace(other, " … ")
    found = {int(number) for number in NUMBER.findall(text)}
    found |= {int(number) for number in SIGNED_AFTER_WORD.findall(text)}
    found |= {-int(number) for number in SIGNED_AFTER_WORD.findall(text)}
    return frozenset(found)


def split_label(line: str) -> tuple[str, str]:
    """(executable, rest) of a line that a launcher labelled; ("launch", line) of one that it printed itself."""
    match = PROCESS_LABEL.match(line)
    return (match.group(1), match.group(3)) if match else ("launch", line)
