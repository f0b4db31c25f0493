"""Makes text from a submission safe to keep."""

from __future__ import annotations


def clean(text: str, limit: int) -> str:
    return "".join(c if c.isprintable() else " " for c in text)[:limit]
