"""What students get holds nothing of what staff get, and every edition is whole."""

from __future__ import annotations

import html
import re
import time
from datetime import timedelta
from itertools import pairwise
from pathlib import Path

import pytest
from lab2_grader import lab

from lab2_worksheet.blocks import CANARY
from lab2_worksheet.build import STUDENT_BYTES, build
from lab2_worksheet.errors import SourceError
from lab2_worksheet.listings import changed_lines, template
from lab2_worksheet.manifest import questions, tasks
from lab2_worksheet.pages import Editions
from lab2_worksheet.places import SOURCE, TEMPLATE, TEMPLATE_README
from lab2_worksheet.release import in_words, solutions_released

CHANGES = [change for task in tasks().values() for change in task.changes]


def telling_lines() -> list[str]:
    """The lines that the solution adds and that tell something: not those which the template has too, not `else:`."""
    handed_out = {
        line.strip() for path in TEMPLATE.rglob("*.py") for line in path.read_text(encoding="utf-8").splitlines()
    }
    added = {line for change in CHANGES for line in changed_lines(change.began_as, change.file)}
    return sorted(line for line in added - handed_out if len(re.findall(r"\w", line)) >= 8)


def squeezed(text: str) -> str:
    """*text* without tags and white space, so that no colouring hides a line."""
    return re.sub(r"\s+", "", html.unescape(re.sub(r"<[^>]+>", "", text)))


def test_the_solution_has_lines_to_hide() -> None:
    lines = telling_lines()
    assert len(lines) > 20
    assert any("Int8" in line for line in lines) and any("entry" in c.file or c.file == "setup.py" for c in CHANGES)


@pytest.mark.parametrize("edition", ["student", "fragment", "readme"])
def test_no_line_of_the_solution_reaches_students(made: Editions, edition: str) -> None:
    text = squeezed(getattr(made, edition))
    assert [line for line in telling_lines() if squeezed(line) in text] == []


def test_no_line_of_the_solution_is_in_the_template() -> None:
    text = squeezed("\n".join(p.read_text(encoding="utf-8") for p in TEMPLATE.rglob("*") if p.is_file()))
    assert [line for line in telling_lines() if squeezed(line) in text] == []


def test_staff_see_the_solution(made: Editions) -> None:
    text = squeezed(made.staff)
    missing = [line for line in telling_lines() if squeezed(line) not in text]
    assert missing == []


def test_the_canary_is_in_every_staff_block_and_in_nothing_for_students(made: Editions) -> None:
    blocks = sum(path.read_text(encoding="utf-8").count("call staff_only(") for path in SOURCE.rglob("*.j2"))
    assert blocks >= 3
    assert made.staff.count(CANARY) == blocks + len(tasks())
    assert made.staff.count('class="staff"') == blocks + len(tasks())
    for text in (made.student, made.fragment, made.readme):
        assert CANARY not in text
        assert 'class="staff"' not in text


def test_staff_words_are_absent_for_students(made: Editions) -> None:
    for task in tasks().values():
        for fault in task.faults:
            words = re.sub(r"[`*]", "", fault.text)[:40]
            assert words not in html.unescape(re.sub(r"<[^>]+>", "", made.student))


def test_hints_are_words_and_names_only() -> None:
    for task in tasks().values():
        for hint in task.hints:
            assert "```" not in hint
            for code in re.findall(r"`([^`]+)`", hint):
                assert re.fullmatch(r"[\w./-]+|(ros2|git|ssh) [\w .@-]+", code), (task.id, code)


def test_the_student_edition_is_small_and_quickly_built(tmp_path: Path) -> None:
    begun = time.process_time()  # of the processor: a busy machine is not a slow build
    written = build(tmp_path, tmp_path / "README.md")
    assert time.process_time() - begun < 2
    sizes = {file.path.name: file.size for file in written}
    assert set(sizes) == {"student.html", "staff.html", "fragment.html", "README.md"}
    assert 50_000 < sizes["student.html"] < STUDENT_BYTES


def test_the_fragment_is_a_body_only(made: Editions) -> None:
    for tag in ("<html", "<head", "<body", "<script", "<!doctype"):
        assert tag not in made.fragment.lower()
    assert "http-equiv" not in made.fragment


def test_the_template_readme_is_up_to_date(made: Editions) -> None:
    assert TEMPLATE_README.read_text(encoding="utf-8") == made.readme, "run: python -m lab2_worksheet build"


def test_every_section_number_of_the_original_is_there(made: Editions) -> None:
    numbers = ("6", "6.1", "6.2", "6.3", "6.3.1", "6.4", "6.4.1", "6.5", "6.6", "6.7", "6.8", "6.9")
    numbers += tuple(f"6.7.{part}" for part in range(1, 7))
    for text in (made.student, made.staff, made.fragment):
        for number in numbers:
            assert f'id="section-{number.replace(".", "-")}"' in text


def test_every_check_and_item_of_the_rubric_is_shown_once(made: Editions) -> None:
    for check in lab.rubric().check:
        assert made.student.count(f"<code>{check.id}</code>") == 1
    for item in lab.rubric().checklist:
        assert f'data-done="checklist-{item.item}"' in made.student


def test_headings_are_in_order(made: Editions) -> None:
    for text in (made.student, made.staff):
        levels = [int(level) for level in re.findall(r"<h([1-6])[ >]", text)]
        assert levels[0] == 1 and levels.count(1) == 1
        assert all(later <= earlier + 1 for earlier, later in pairwise(levels))


def test_questions_have_reasons() -> None:
    assert len(questions()) >= 10
    for question in questions().values():
        assert len(question.option) >= 3
        assert all(len(option.reason) > 20 for option in question.option), question.id


def test_solutions_are_released_on_their_day_and_not_before(made: Editions) -> None:
    day = lab.course().solutions_release
    assert not solutions_released(day - timedelta(days=1))
    assert solutions_released(day)
    assert in_words(day) in made.student


def test_an_anchor_must_stand_in_exactly_one_line() -> None:
    listing = template("lab2/talker.py")
    assert listing.text.splitlines()[listing.line("create_publisher") - 1].count("create_publisher") == 1
    with pytest.raises(SourceError, match="no line"):
        listing.line("create_subscription")
    with pytest.raises(SourceError, match="lines"):
        listing.line("self.")


def test_every_line_reference_leads_to_its_line(made: Editions) -> None:
    links = re.findall(r'<a class="to-line" href="#([\w-]+-L(\d+))">[Ll]ines? (\d+)', made.student)
    assert len(links) > 25
    for anchor, number, said in links:
        assert number == said
        assert f'id="{anchor}"' in made.student


def test_listings_are_the_real_files(made: Editions) -> None:
    for path in ("lab2/talker.py", "lab2/listener.py", "launch/chatter.py"):
        figure = re.search(rf"<figcaption>{path}</figcaption>(.*?)</figure>", made.student, re.DOTALL)
        assert figure
        shown = html.unescape(re.sub(r"<[^>]+>", "", figure.group(1)))
        assert shown.strip() == (TEMPLATE / path).read_text(encoding="utf-8").strip()
