"""How far a class is: counted here, shown by the command line, live on a terminal and as plain lines elsewhere."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from lab2_grader.records import ClassLine, ClassState

RECENT = 40  # ends that the rate is taken from
SHOWN_RUNNING = 12

Say = Callable[[str], None]


class Progress:
    """Watches a class (`run.Watcher`).

    Args:
        say: Told one line for each thing that happens; None when the live display is shown instead.
    """

    def __init__(self, say: Say | None) -> None:
        self._say = say
        self._lock = threading.Lock()
        self._began = time.monotonic()
        self._total = 0
        self._unknown = 0
        self._ended: dict[str, ClassLine] = {}
        self._from_before = 0
        self._running: dict[str, tuple[str, float]] = {}
        self._ends: deque[float] = deque(maxlen=RECENT)

    # --- what happens ------------------------------------------------------------------------

    def total(self, entries: int, unknown: int) -> None:
        """So many submissions are to be graded, so many things were not understood."""
        self._total, self._unknown = entries, unknown
        if self._say:
            more = f", {unknown} not understood" if unknown else ""
            self._say(f"{entries} submissions{more}")

    def begins(self, name: str, doing: str) -> None:
        """What is being done with the submission *name*."""
        with self._lock:
            self._running[name] = (doing, self._running.get(name, ("", time.monotonic()))[1])

    def ended(self, line: ClassLine, *, before: bool) -> None:
        """What became of a submission."""
        with self._lock:
            self._running.pop(line.name, None)
            self._ended[line.name] = line
            self._from_before += before
            if not before:
                self._ends.append(time.monotonic())
            done = len(self._ended)
        if self._say:
            mark = (
                f"{line.score} of {line.max_score}" if line.score is not None else f"{line.state.value}: {line.reason}"
            )
            known = " (graded before)" if before else f" ({line.seconds:.1f} s)" if line.seconds else ""
            self._say(f"[{done}/{self._total}] {line.name}: {mark}{known}{self._left()}")

    def again(self, names: tuple[str, ...]) -> None:
        """These were inconclusive and are tried once more, one by one."""
        with self._lock:
            for name in names:
                self._ended.pop(name, None)
        if self._say:
            self._say(f"Trying again, one by one: {', '.join(names)}")

    # --- what is shown -----------------------------------------------------------------------

    def _rate(self) -> float:
        """Submissions a minute, by the last ones that ended; 0 while too few have."""
        if len(self._ends) < 3:
            return 0.0
        span = self._ends[-1] - (self._ends[0] if len(self._ends) == RECENT else self._began)
        return 60 * len(self._ends) / span if span > 0 else 0.0

    def _left(self) -> str:
        rate, left = self._rate(), self._total - len(self._ended)
        if not rate or left <= 0:
            return ""
        seconds = 60 * left / rate
        return f", about {seconds:.0f} s left" if seconds < 90 else f", about {seconds / 60:.0f} min left"

    def __rich__(self) -> RenderableType:
        with self._lock:
            states = Counter(line.state for line in self._ended.values())
            full = sum(line.score == line.max_score for line in self._ended.values() if line.score is not None)
            running = sorted(self._running.items(), key=lambda item: item[1][1])
            done, now = len(self._ended), time.monotonic()
            rate = self._rate()
        head = Table.grid(padding=(0, 1))
        head.add_row(
            ProgressBar(total=max(1, self._total), completed=done, width=40),
            Text(f"{done} of {self._total}", style="bold"),
            Text(f"{rate:.0f} a minute{self._left()}" if rate else "", style="dim"),
        )
        words = [f"{full} with full marks", f"{states[ClassState.GRADED] - full} below"]
        for state, word in ((ClassState.WITHHELD, "not judged"), (ClassState.REFUSED, "refused")):
            if states[state]:
                words.append(f"{states[state]} {word}")
        if self._from_before:
            words.append(f"{self._from_before} graded before")
        words.append(f"{max(0, self._total - done - len(running))} waiting")
        rows = Table.grid(padding=(0, 2))
        for name, (doing, since) in running[:SHOWN_RUNNING]:
            rows.add_row(Text(f"  {name}"), Text(doing, style="dim"), Text(f"{now - since:.0f} s", style="dim"))
        return Group(head, Text(", ".join(words)), rows)
