"""The page about the formats says every field, and what the records say."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_the_page_is_up_to_date() -> None:
    made = subprocess.run([sys.executable, DOCS / "make_formats.py"], capture_output=True, text=True, check=True).stdout
    assert made == (DOCS / "formats.md").read_text(encoding="utf-8"), "run: make formats"


def test_every_field_has_a_meaning() -> None:
    rows = [line for line in (DOCS / "formats.md").read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    assert len(rows) > 150
    assert [row for row in rows if row.endswith("|  |")] == []
