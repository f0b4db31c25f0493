"""Finds the near miss of a name: what somebody probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

CUTOFF = 0.7


def nearest(name: str, candidates: Iterable[str], taken: Iterable[str] = ()) -> str:
    """The candidate that looks most like *name*, letter case and separators aside; empty when none does.

    Args:
        name: What was asked for.
        candidates: What is there.
        taken: Names that are something else and so cannot be meant.
    """
    excluded = set(taken) | {name}
    plain = {_plain(candidate): candidate for candidate in sorted(set(candidates) - excluded, reverse=True)}
    found = difflib.get_close_matches(_plain(name), plain, n=1, cutoff=CUTOFF)
    return plain[found[0]] if found else ""


def _plain(name: str) -> str:
    return name.lower().replace("-", "").replace("_", "").replace(" ", "")
