"""The page about the formats says every file and field, and what the records say."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from lab2_grader.records import EVIDENCE_SCHEMA, Result, SceneName

DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_the_page_is_up_to_date() -> None:
    made = subprocess.run([sys.executable, DOCS / "make_formats.py"], capture_output=True, text=True, check=True).stdout
    assert made == (DOCS / "formats.md").read_text(encoding="utf-8"), "run: make formats"


def files_named(of: str) -> set[str]:
    """The files that the page says a folder *of* a result or a class holds, `<scene>` filled in."""
    text = (DOCS / "formats.md").read_text(encoding="utf-8")
    table = text.split(f"{of}'s folder holds\n\n")[1].split("\n\n")[0]
    named = {name for row in table.splitlines()[2:] for name in re.findall("`([^`]+)`", row.split("|")[1])}
    scenes = {name for name in named if "<scene>" in name}
    return named - scenes | {name.replace("<scene>", scene) for name in scenes for scene in SceneName}


def test_the_page_names_what_a_grade_leaves(solution_graded: tuple[Result, Path]) -> None:
    _, folder = solution_graded
    left = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    # The talker is played alone only where the launched pair does not show it.
    assert left == files_named("A result") - {f"evidence/{SceneName.TALKER.value}.jsonl"}


def test_schemas_are_said_as_they_stand_in_the_files() -> None:
    text = (DOCS / "formats.md").read_text(encoding="utf-8")
    assert f"`{EVIDENCE_SCHEMA}`" in text and "_SCHEMA" not in text


def test_every_field_has_a_meaning() -> None:
    rows = [line for line in (DOCS / "formats.md").read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    assert len(rows) > 150
    assert [row for row in rows if row.endswith("|  |")] == []
