"""Where things stand: the folders of the repository that the build reads and writes."""

from __future__ import annotations

from pathlib import Path

WORKSHEET = Path(__file__).resolve().parents[1]
REPOSITORY = WORKSHEET.parent
SOURCE = WORKSHEET / "source"
ASSETS = WORKSHEET / "assets"
RECORDED = WORKSHEET / "recorded" / "session.json"
TEMPLATE = REPOSITORY / "lab2_template"
SOLUTION = REPOSITORY / "solution"
TEMPLATE_README = TEMPLATE / "README.md"
OUTPUT = REPOSITORY / "build" / "worksheet"
