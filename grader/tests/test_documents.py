"""What the documents tell people to type can be typed, and does what they say."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
from pathlib import Path

import msgspec
import pytest
from conftest import ROOT
from zoo_builder import Animal, animals

from lab2_grader import cli

README = ROOT / "README.md"
CONTRIBUTING = ROOT / ".github" / "CONTRIBUTING.md"
DOCUMENTS = (
    README,
    CONTRIBUTING,
    ROOT / "grader/README.md",
    ROOT / "grader/SECURITY.md",
    ROOT / "grader/docs/cluster.md",
)
BOOK = '"Username","Lab 2 [Total Pts: 20 Score] |987654"\r\n"ada",""\r\n"ben",""\r\n'


def commands(document: Path, program: str) -> set[str]:
    """What follows *program* in *document*, wherever it is given to be typed."""
    return set(re.findall(rf"(?:^|`|&& ){program} ([a-z0-9-]+)", document.read_text("utf-8"), re.MULTILINE))


def block(document: Path, beginning: str) -> str:
    """The block of code in *document* that begins so."""
    found = re.findall(r"^```\w*\n(.*?)^```", document.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    (text,) = [text for text in found if text.startswith(beginning)]
    return text


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_command_is_there(document: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert commands(document, "make") <= targets
    for name in commands(document, "lab2-grader"):
        with pytest.raises(SystemExit) as ended:
            cli.main([name, "--help"])
        assert ended.value.code == 0, name


def test_every_variable_is_one_of_the_makefile() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for document in DOCUMENTS:
        for name in re.findall(r"make [^`\n]*?\b([A-Z]+)=", document.read_text("utf-8")):
            assert f"$({name})" in makefile, f"{document.name}: {name}"


def test_the_tree_is_as_contributing_draws_it() -> None:
    for line in block(CONTRIBUTING, "facts/").splitlines():
        for name in re.findall(r"(?:^|\s{2,})([a-z_]+(?:/|\.py))", line):
            assert (ROOT / "grader" / "lab2_grader" / name).exists(), name


def test_the_animal_in_contributing_is_one_of_the_zoo() -> None:
    shown = msgspec.toml.decode(block(CONTRIBUTING, "[[animal]]"), type=dict[str, list[Animal]])["animal"]
    assert [animals()[animal.name] for animal in shown] == shown


def test_a_class_by_the_readme(tmp_path: Path) -> None:
    inbox, results, book, upload = (tmp_path / name for name in ("inbox", "results", "book.csv", "upload.csv"))
    shutil.copytree(ROOT / "solution", inbox / "ada")
    shutil.copytree(ROOT / "lab2_template", inbox / "ben")
    book.write_bytes(BOOK.encode())
    ours = tmp_path / "ours.toml"
    ours.write_text((ROOT / "grader/lab2_grader/facts/rubric.toml").read_text().replace("points = 12", "points = 32"))
    given = {
        "INBOX=download.zip": f"INBOX={inbox} OUT={results}",
        "BOOK=gradebook.csv OUT=upload.csv": f"BOOK={book} OUT={upload} RESULTS={results}",
        "RESULTS=results RUBRIC=ours.toml": f"RESULTS={results} RUBRIC={ours}",
    }
    lines = [line.split("#")[0] for line in block(README, "make grade-all").splitlines()]
    said = []
    for line, (shown, real) in zip(lines, given.items(), strict=True):
        assert shown in line
        done = subprocess.run(line.replace(shown, real).split(), cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        said.append(done.stdout)
    with upload.open(newline="") as file:
        marks = {row[0]: row[1] for row in csv.reader(file)}
    assert marks["ada"] == "20" and 0 < float(marks["ben"]) < 5
    assert {"index.html", "summary.csv", "ada", "ben"} <= {path.name for path in results.iterdir()}
    assert "ada" in said[2] and "112 of 112" in said[2]
