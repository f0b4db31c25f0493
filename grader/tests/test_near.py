"""Near misses: what somebody probably meant, and which program stands for another."""

from __future__ import annotations

import msgspec
import pytest

from lab2_grader.near import nearest
from lab2_grader.records import Build, EndedBy, EntryPoint
from lab2_grader.stand_in import launched, misdirected, program

TAKEN = ("talker", "listener", "numeric_talker", "numeric_listener")


@pytest.mark.parametrize(
    ("wanted", "candidates", "found"),
    [
        ("numeric_talker", ["numerictalker", "other"], "numerictalker"),
        ("numeric_talker", ["numeric-talker"], "numeric-talker"),
        ("numeric_talker", ["Numeric_Talker"], "Numeric_Talker"),
        ("numeric_talker", ["numeric_takler"], "numeric_takler"),
        ("numeric_talker", ["talker", "listener", "numeric_listener"], ""),
        ("numeric_talker", ["turtle"], ""),
        ("/numeric_chatter", ["/numeric_chater", "/chatter"], "/numeric_chater"),
        ("/numeric_chatter", ["/chatter"], ""),
        ("/numeric_chatter", [], ""),
    ],
)
def test_nearest(wanted: str, candidates: list[str], found: str) -> None:
    assert nearest(wanted, candidates, TAKEN) == found


def built(*executables: str, modules: tuple[str, ...] = (), dangling: tuple[str, ...] = (), **targets: str) -> Build:
    points = tuple(EntryPoint(name, targets.get(name, f"lab2.{name}:main")) for name in executables)
    return Build(
        *(True, 0, EndedBy.ITSELF, "", 1.0, ""),
        executables=executables,
        entry_points=points,
        modules=modules,
        launch_files=(),
        dangling=dangling,
    )


ORIGINALS = ("listener", "talker")
BOTH = (*ORIGINALS, "numeric_listener", "numeric_talker")


@pytest.mark.parametrize(
    ("build", "stands"),
    [
        (built(*BOTH, modules=BOTH), ("executable", "numeric_talker")),
        (built(*ORIGINALS, modules=BOTH), ("module", "numeric_talker")),
        (built(*BOTH, modules=BOTH, dangling=("numeric_talker",)), ("module", "numeric_talker")),
        (built(*BOTH, modules=BOTH, numeric_talker="lab2.talker:main"), ("module", "numeric_talker")),
        (built(*BOTH, modules=ORIGINALS, numeric_talker="lab2.mine:main"), ("executable", "numeric_talker")),
        (built(*ORIGINALS, "num_talker", modules=ORIGINALS), ("executable", "num_talker")),
        (built(*ORIGINALS, "my_publisher", "my_subscriber", modules=ORIGINALS), ("executable", "my_publisher")),
        (built(*ORIGINALS, modules=(*ORIGINALS, "numeric_taker")), ("module", "numeric_taker")),
        (built(*ORIGINALS, modules=(*ORIGINALS, "a_talker", "b_talker_two")), ("", "")),
        (built(*ORIGINALS, modules=ORIGINALS), ("", "")),
    ],
)
def test_what_stands_for_the_talker(build: Build, stands: tuple[str, str]) -> None:
    assert program("numeric_talker", build) == stands


def test_a_program_that_cannot_run_is_replaced_by_its_module() -> None:
    assert program("numeric_talker", built(*BOTH, modules=BOTH), broken=("numeric_talker",)) == (
        "module",
        "numeric_talker",
    )


def test_what_a_launch_has_to_start() -> None:
    assert launched("numeric_talker", built(*BOTH)) == "numeric_talker"
    assert launched("numeric_talker", built(*ORIGINALS, "numerictalker")) == "numerictalker"
    assert launched("numeric_talker", built(*ORIGINALS)) == "numeric_talker"


def test_an_entry_point_to_another_program() -> None:
    wrong = built(*BOTH, modules=BOTH, numeric_listener="lab2.numeric_talker:main")
    assert misdirected("numeric_listener", wrong) == "numeric_talker"
    assert not misdirected("numeric_talker", wrong)
    without_its_own = msgspec.structs.replace(wrong, modules=("numeric_talker", "talker"))
    assert not misdirected("numeric_listener", without_its_own)
