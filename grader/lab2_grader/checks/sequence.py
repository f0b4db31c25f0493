"""What is wrong with a sequence of numbers, and where. Pure arithmetic: no ROS, no words.

A message carries how many its publisher had sent with it, so messages that the observer missed show as gaps, and only
numbers that were published one directly after the other are compared.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

from lab2_grader.records import Message, Record

SHOWN = 4  # numbers shown on either side of a place in the sequence


class Step(Record, frozen=True):
    """Two numbers published one directly after the other; `index` is the place of the second in the sequence."""

    index: int
    before: int
    after: int

    @property
    def difference(self) -> int:
        """How much the number rose."""
        return self.after - self.before


class Sequel(Record, frozen=True):
    """A sequence taken apart.

    Args:
        values: The numbers in order.
        first_number: How many messages its publisher had sent with the first of them.
        rises: Steps that belong to counting.
        returns: Steps at which the count goes back.
        stays: Steps from the largest number to itself.
    """

    values: tuple[int, ...]
    first_number: int
    rises: tuple[Step, ...]
    returns: tuple[Step, ...]
    stays: tuple[Step, ...]

    @property
    def irregular(self) -> tuple[Step, ...]:
        """Rises that are not by one."""
        return tuple(step for step in self.rises if step.difference != 1)

    @property
    def common_rise(self) -> int:
        """The difference that at least nine of ten rises have; 0 when none is so common."""
        counts = Counter(step.difference for step in self.rises)
        if not counts:
            return 0
        difference, count = counts.most_common(1)[0]
        return difference if count >= 0.9 * len(self.rises) else 0


def analyse(messages: Sequence[Message], smallest: int, largest: int) -> Sequel | None:
    """Take the numbers of *messages* apart; None when one of them is no whole number.

    Args:
        messages: What one publisher published, in order of arrival.
        smallest: The number to which the count should return.
        largest: The number after which it should.
    """
    values = [whole(message.data) for message in messages]
    if any(value is None for value in values):
        return None
    numbers = tuple(value for value in values if value is not None)
    counted = [message.number for message in messages]
    steady = all(later > earlier for earlier, later in pairwise(counted))
    rises, returns, stays = [], [], []
    falling = False
    for index in range(1, len(numbers)):
        if steady and counted[index] != counted[index - 1] + 1:
            falling = False
            continue
        step = Step(index, numbers[index - 1], numbers[index])
        if step.difference == 0 and step.before == largest:
            stays.append(step)
        elif step.before < smallest == step.after and step.difference != 1:
            pass  # set back too late, with -128 between: the return says so, and that is one fault
        elif step.difference < 0 and not falling:
            returns.append(step)
        else:
            rises.append(step)
        falling = step.difference < 0
    first = counted[0] if counted and steady else 1
    return Sequel(numbers, first, tuple(rises), tuple(returns), tuple(stays))


def whole(data: float | str | None) -> int | None:
    """*data* as a whole number: itself, a float without a fraction, a text that is nothing but a number; else None."""
    if isinstance(data, bool) or data is None:
        return None
    if isinstance(data, int):
        return data
    if isinstance(data, float):
        return int(data) if data.is_integer() else None
    text = data.strip()
    return (
        int(text) if len(text) < 12 and text.removeprefix("-").isascii() and text.removeprefix("-").isdigit() else None
    )


def around(values: Sequence[int], index: int, shown: int = SHOWN) -> str:
    """The numbers around place *index*, for people: `… 126, 127, -128, -127 …`."""
    first, last = max(0, index - shown), min(len(values), index + shown)
    start = "… " if first > 0 else ""
    end = " …" if last < len(values) else ""
    return start + ", ".join(str(value) for value in values[first:last]) + end
