"""The catalogue of sentences: every one is used, none is written elsewhere, and all placeholders are filled."""

from __future__ import annotations

import ast
import re
import string
from pathlib import Path

import msgspec
import pytest
import zoo_builder
from test_judging import BY_HAND

import lab2_grader
from lab2_grader import lab, messages
from lab2_grader.checks import CHECKS
from lab2_grader.checks.verdicts import known

PACKAGE = Path(lab2_grader.__file__).parent
CATALOGUE = messages.catalogue()
FAULTS = [(check, key) for check, texts in CATALOGUE.check.items() for key in texts.fault]


# Ids that results of past years bear (DESIGN section 5): checks may be added, these stay.
CONTRACT = (
    *("package-builds", "entry-points", "talker-type", "talker-start", "talker-step", "talker-wrap", "talker-chatter"),
    *("listener-numeric", "listener-chatter", "launch-starts", "launch-only-numeric", "launch-conversation"),
    *("originals-kept", "git-pushed", "git-clean"),
)


def test_every_check_has_words_and_points_and_no_other() -> None:
    ids = [check.id for check in lab.rubric().check]
    assert ids == [name for name, _ in CHECKS]
    assert set(CATALOGUE.check) == set(ids)


def test_ids_stay() -> None:
    assert {name for name, _ in CHECKS} >= set(CONTRACT)


def test_every_fault_is_shown_by_an_animal_or_by_hand() -> None:
    animals = [*zoo_builder.animals().values(), *zoo_builder.repositories().values()]
    shown = {(check, key) for animal in animals for check, (key, _) in animal.fails.items()}
    assert shown | set(BY_HAND) == set(FAULTS)
    assert not shown & set(BY_HAND), "what an animal shows needs no evidence made by hand"


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def strings() -> set[str]:
    """Every string that stands in the code or is called for in a template."""
    nodes = [node for path in PACKAGE.rglob("*.py") for node in ast.walk(tree_of(path))]
    found = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    return found | {key for path in PACKAGE.rglob("*.j2") for key in re.findall(r'\bsay\("([\w-]+)"', path.read_text())}


def limits_struck() -> set[str]:
    """The limits that a program may be said to have struck: the answers of what looks for them."""
    found: set[str] = set()
    for node in [node for name in ("process.py", "cgroup.py") for node in ast.walk(tree_of(PACKAGE / name))]:
        answers: list[ast.AST] = []
        if isinstance(node, ast.FunctionDef) and node.name in ("_used_up", "struck"):
            answers = [inner for inner in ast.walk(node) if isinstance(inner, ast.Return)]
        elif isinstance(node, ast.Assign) and getattr(node.targets[0], "attr", "") == "_limit":
            answers = [node.value]
        constants = [inner for answer in answers for inner in ast.walk(answer) if isinstance(inner, ast.Constant)]
        found |= {constant.value for constant in constants if constant.value}
    return found


@pytest.mark.parametrize("table", ["status", "note", "phrase", "report"])
def test_every_other_sentence_is_used(table: str) -> None:
    used = strings() | {f"limit-{limit}" for limit in limits_struck()}
    assert not getattr(CATALOGUE, table).keys() - used


def test_every_limit_that_a_program_may_strike_has_a_note() -> None:
    noted = {key.removeprefix("limit-") for key in CATALOGUE.note if key.startswith("limit-")}
    assert noted - {"disk"} == limits_struck()  # a full disk is told by what is printed


@pytest.mark.parametrize(("check", "key"), FAULTS)
def test_words_are_complete(check: str, key: str) -> None:
    fault, texts = CATALOGUE.check[check].fault[key], CATALOGUE.check[check]
    assert fault.observed and fault.hint and texts.expected and texts.judged and texts.ruling
    for text in (texts.expected, texts.judged, texts.ruling):
        assert "{" not in messages.fill(text, **known(check))
    for sentence in (fault.hint, texts.judged, texts.ruling):
        assert sentence[0].isupper() or sentence.startswith(("self.", "setup.", "print()", "colcon"))
        assert sentence.rstrip("\"`'").endswith((".", ")", "`", "?", '"')) or "git" in sentence


def test_placeholders_are_names() -> None:
    for check, key in FAULTS:
        fault = CATALOGUE.check[check].fault[key]
        for text in (fault.observed, fault.hint):
            for _, name, _, _ in string.Formatter().parse(text):
                assert name is None or name.isidentifier(), f"{check}.{key}: {name}"


def test_symptoms_are_rows_of_the_troubleshooting_table() -> None:
    rows = {row["id"] for row in msgspec.toml.decode((lab.FACTS / "symptoms.toml").read_bytes())["symptom"]}
    named = {CATALOGUE.check[check].fault[key].symptom for check, key in FAULTS} - {""}
    assert named and named <= rows


def test_nothing_promises_an_exception_that_jazzy_does_not_raise() -> None:
    overflow = CATALOGUE.check["talker-wrap"].fault["overflow"]
    assert "says nothing" in overflow.hint
    assert not re.search(r"exception|raises", overflow.hint + overflow.observed)


@pytest.mark.parametrize(
    "path", [*sorted(PACKAGE.glob("checks/*.py")), PACKAGE / "score.py", PACKAGE / "near.py"], ids=lambda p: p.stem
)
def test_no_sentence_is_written_elsewhere(path: Path) -> None:
    tree = ast.parse(path.read_text())
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = {
        id(n.body[0].value) for n in ast.walk(tree) if isinstance(n, documented) and isinstance(n.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            sentence = (
                re.search(r"[a-z] [a-z]+ [a-z]", node.value) and path.stem != "verdicts"
            )  # `explain` is for staff
            assert not sentence or node.value in ROBOTS, f"{path.name}: {node.value!r}"


# What programs say, by which their faults are known.
ROBOTS = (
    "cannot import name '(",
    "' has no attribute '(",
    "No module named 'tomllib'",
    "callable with one argument",
    "Traceback (most recent call last):",
    r"executable '([^']*)' not found on the libexec directory",
    "' has no attribute '",
    "'NoneType' object has no attribute 'get_launch_arguments",
    "required keyword-only argument: 'executable'",
    "No space left on device",
    "File too large",
    "has no setter",
    "object cannot be interpreted as an integer",
    "object has no attribute '(_[a-z]\\w*)'",
    "takes 0 positional arguments but 1 was given",
    "'NoneType' object is not callable",
)
