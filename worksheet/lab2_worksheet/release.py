"""When the solutions may leave the house."""

from __future__ import annotations

from datetime import date

from lab2_grader import lab


def solutions_released(today: date) -> bool:
    """Whether *today* is the release date of the solutions, or later."""
    return today >= lab.course().solutions_release


def in_words(day: date) -> str:
    """A date as British people write it: 1 May 2030."""
    return f"{day.day} {day:%B %Y}"
