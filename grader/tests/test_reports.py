"""The reports of three real submissions: what stands in them, and that their readers' own rules accept them."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import msgspec
import pytest
from markdown_it import MarkdownIt

from lab2_grader import lab, pipeline
from lab2_grader.records import Result, Status
from lab2_grader.report import FORMATS, Audience, Report, files, report_of
from lab2_grader.report.classroom50 import Assignment, classroom50
from lab2_grader.report.github import MOST, command, defused, workflow_commands
from lab2_grader.report.gradescope import begun, gradescope, said
from lab2_grader.report.markdown import markdown, sparkline
from lab2_grader.report.observed import expected_numbers
from lab2_grader.report.pictures import Mark, first_departure

DATA = Path(__file__).parent / "data"
NAMES = ("perfect", "middling", "broken")
HOSTILE = (
    "<img src=x onerror=alert(1)> ::error::forged ##[error]forged | `x` **b** @all [l](http://e.example) \x1b[2J\x00"
)


@pytest.fixture(params=NAMES)
def report(request: pytest.FixtureRequest, samples: dict[str, Path]) -> Report:
    """The student's report of each sample."""
    return report_of(*pipeline.read(samples[request.param]))


def hostile(report: Report) -> Report:
    """*report* in which every text that can come from a submission is an attack."""
    checks = tuple(
        msgspec.structs.replace(
            check,
            status=Status.FAIL,
            observed=HOSTILE,
            hint=HOSTILE,
            expected=HOSTILE,
            file=HOSTILE,
            line=1,
        )
        for check in report.result.checks
    )
    submission = msgspec.structs.replace(report.result.submission, name=HOSTILE)
    result = msgspec.structs.replace(report.result, checks=checks, notes=(HOSTILE,) * 3, submission=submission)
    return Report(**{**vars(report), "result": result, "package_files": (HOSTILE,)})


def withheld(report: Report) -> Report:
    """*report* of a run in which one check could not be judged."""
    checks = tuple(
        msgspec.structs.replace(check, status=Status.INCONCLUSIVE, points=0) if check.id == "talker-wrap" else check
        for check in report.result.checks
    )
    return Report(
        **{**vars(report), "result": msgspec.structs.replace(report.result, graded=False, score=None, checks=checks)}
    )


# --- all of them --------------------------------------------------------------------------------


def test_the_files_are_there_small_and_made_anew_alike(samples: dict[str, Path]) -> None:
    for name in NAMES:
        folder = samples[name]
        made = dict(files(*pipeline.read(folder)))
        assert set(made) == {"report.html", "report.md", "junit.xml", "staff.html", "result.json"}
        assert all((folder / file).read_bytes() == data for file, data in made.items())
        assert len(made["report.html"]) < 150_000
        assert len(made["report.md"]) < 64_000


def test_what_only_staff_may_see_is_not_in_what_students_get(samples: dict[str, Path]) -> None:
    for name in NAMES:
        result, observed = pipeline.read(samples[name])
        secrets = (result.submission.source, *msgspec.structs.astuple(result.digests), "For staff")
        staff = FORMATS["html"](report_of(result, observed, Audience.STAFF))
        assert all(secret in staff for secret in secrets)
        student = report_of(result, observed)
        for form, render in FORMATS.items():
            if form not in ("json", "gradescope"):
                assert not any(secret in render(student) for secret in secrets), form
        assert result.submission.source not in FORMATS["json"](student)


def test_a_withheld_mark_is_a_number_nowhere(report: Report) -> None:
    unjudged = withheld(report)
    for form in ("html", "md"):
        text = FORMATS[form](unjudged)
        assert "withheld" in text
        assert f"{report.result.score} of {report.result.max_score}" not in text
        assert "not judged" in text
    assert "score=withheld" in FORMATS["junit"](unjudged).replace('name="score" value="', "score=")
    data = json.loads(gradescope(unjudged))
    assert data["extra_data"]["graded"] is False
    assert not any("score" in test for test in data["tests"])
    assert "No mark was given" in workflow_commands(unjudged)[0]


# --- the page -----------------------------------------------------------------------------------


class Page(HTMLParser):
    """Collects the elements, attributes and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def test_the_page_is_self_contained(report: Report) -> None:
    text = FORMATS["html"](report)
    page = Page(text)
    names = {tag for tag, _ in page.tags}
    assert not names & {"script", "link", "img", "iframe", "object", "embed", "form", "base"}
    assert not re.search(r"url\(|@import", text)
    for _, attributes in page.tags:
        assert "src" not in attributes and not any(name.startswith("on") for name in attributes)
        target = urlsplit(attributes.get("href") or "")
        assert target.scheme in ("", "mailto")
    ids = [attributes["id"] for _, attributes in page.tags if attributes.get("id")]
    assert len(ids) == len(set(ids))
    links = {attributes["href"] for tag, attributes in page.tags if tag == "a" and attributes.get("href")}
    assert {link[1:] for link in links if link and link.startswith("#")} <= set(ids)


def test_every_check_says_what_was_asked_seen_and_to_try(report: Report) -> None:
    words = " ".join(" ".join(Page(FORMATS["html"](report)).text).split())
    for check in report.result.checks:
        assert check.title in words
        if check.status is Status.FAIL:
            for text in (check.expected, check.observed, check.hint):
                assert " ".join(text.replace("`", " ").split()) in words.replace(" .", ".") or "`" in text
    for item in report.result.checklist:
        assert item.text in words


def test_links_lead_to_the_worksheet_when_its_address_is_known(
    samples: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    address = "https://lab.example/worksheet.html"
    course = msgspec.structs.replace(lab.course(), worksheet_url=address)
    monkeypatch.setattr(lab, "course", lambda: course)
    report = report_of(*pipeline.read(samples["middling"]))
    page = Page(FORMATS["html"](report))
    links = {attributes["href"] for tag, attributes in page.tags if tag == "a"}
    assert f"{address}#section-6-7-1" in links
    assert f"{address}#symptom-jumps-to-minus-128" in links
    assert f"({address}#section-6-7-1)" in FORMATS["md"](report)


def test_the_pictures_tell_what_departs(samples: dict[str, Path]) -> None:
    perfect = report_of(*pipeline.read(samples["perfect"]))
    assert perfect.sequence is not None and perfect.sequence.departure is None
    assert perfect.seen is not None
    assert {part.mark for part in (*perfect.seen.nodes, *perfect.seen.topics)} == {Mark.OK}
    assert [row.label for row in perfect.timeline.rows][:2] == ["Build", "The launched pair"]

    middling = report_of(*pipeline.read(samples["middling"]))
    assert middling.sequence is not None and middling.sequence.departure == 128
    assert middling.seen is not None
    silent = [edge for edge in middling.seen.edges if edge.label == "never published"]
    assert [(edge.topic.split("|")[0], edge.mark) for edge in silent] == [("/chatter", Mark.WRONG)]
    assert "message 129 is −128, expected 0" in FORMATS["html"](middling)

    broken = report_of(*pipeline.read(samples["broken"]))
    assert broken.sequence is None and broken.seen is None
    assert "no sequence to draw" in FORMATS["html"](broken)


def test_either_way_to_return_is_as_expected() -> None:
    late = [float(number % 128) for number in range(300)]
    early = [float(number % 127) for number in range(300)]
    for observed in (late, early):
        assert first_departure(observed, expected_numbers(observed)) is None
    assert first_departure([1.0, 2.0, 3.0], expected_numbers([1.0, 2.0, 3.0])) == 0
    no_return = [float(number) for number in range(140)]
    assert first_departure(no_return, expected_numbers(no_return)) == 128
    assert first_departure([0.0, None, 2.0], expected_numbers([0.0, None, 2.0])) is None


def test_text_of_theirs_is_text_in_the_page(report: Report) -> None:
    page = Page(FORMATS["html"](hostile(report)))
    assert not any(tag == "img" or "onerror" in attributes for tag, attributes in page.tags)
    assert any("<img src=x onerror=alert(1)>" in text for text in page.text)


# --- Markdown and GitHub ------------------------------------------------------------------------


def test_the_markdown_is_one_table_with_a_row_a_check(report: Report) -> None:
    tokens = MarkdownIt("commonmark").enable("table").parse(markdown(report))
    assert sum(token.type == "table_open" for token in tokens) == 1
    assert sum(token.type == "tr_open" for token in tokens) == 1 + len(report.result.checks)
    assert {token.type for token in tokens if token.type.startswith("html")} <= {"html_inline"}


def test_text_of_theirs_is_text_in_the_markdown(report: Report) -> None:
    text = markdown(hostile(report))
    assert len(text.encode()) < 64_000
    assert not re.search(r"^\s*::", text, re.MULTILINE) and "##[" not in text
    rendered = MarkdownIt("gfm-like", {"html": True, "linkify": False}).render(text)
    page = Page(rendered)
    allowed = {"h1", "h2", "p", "ul", "li", "strong", "table", "thead", "tbody", "tr", "th", "td", "br", "code", "pre"}
    assert {tag for tag, _ in page.tags} <= allowed
    assert "<img src=x onerror=alert(1)>" in "".join(page.text)
    assert "**b**" in "".join(page.text)


def test_the_summary_stays_small_whatever_is_in_it(report: Report) -> None:
    checks = tuple(msgspec.structs.replace(check, observed="|" * 20_000) for check in hostile(report).result.checks)
    result = msgspec.structs.replace(report.result, checks=checks, notes=("&" * 300,) * 1_000)
    assert len(markdown(Report(**{**vars(report), "result": result})).encode()) < 64_000


def test_the_sparkline_shows_the_saw_tooth() -> None:
    line = sparkline([float(number % 128) for number in range(256)], 16)
    assert line == "▂▃▄▄▅▆▇█▂▃▄▄▅▆▇█"
    assert sparkline([]) == "" and sparkline([1.0, None, 1.0]) == "▁ ▁"


def is_command(line: str) -> bool:
    """Whether GitHub's runner would execute something in *line* (`ActionCommand.cs`: v2 at the start, v1 anywhere)."""
    return line.lstrip().startswith("::") or "##[" in line


def test_annotations_are_few_and_only_ours(report: Report) -> None:
    failing = sum(check.status is Status.FAIL for check in report.result.checks)
    assert len(workflow_commands(report)) == min(failing, MOST)
    lines = workflow_commands(hostile(report), "sub/folder")
    assert len(lines) == MOST + 1
    assert f"{len(report.result.checks) - MOST} more" in lines[-1]
    for line in lines:
        assert len(line.splitlines()) == 1
        assert re.match(r"::(warning|notice) (file=sub/folder/[^,:]+,line=1,)?title=[^,:]+::", line)
        assert "##[" not in line and line.count("::") == 2
    errors = workflow_commands(report, errors=True)
    assert all(line.startswith("::error ") for line in errors)


def test_a_command_cannot_be_broken_out_of() -> None:
    line = command("error", "a,b: c\n::warning::x", "one\r\ntwo % ::stop-commands::x", "a:b,c")
    assert line == (
        "::error file=a%3Ab%2Cc,title=a%2Cb%3A c%0A%3A %3Awarning%3A %3Ax::one%0D%0Atwo %25 : :stop-commands: :x"
    )
    assert not any(is_command(part) for part in defused(f"{HOSTILE}\n  ::error::x\n##[group]y").splitlines())


# --- the formats of others ----------------------------------------------------------------------


def test_junit_is_read_by_its_readers(report: Report, tmp_path: Path) -> None:
    junitparser = pytest.importorskip("junitparser")
    xmlschema = pytest.importorskip("xmlschema")
    for number, shown in enumerate((report, withheld(report), hostile(report))):
        path = tmp_path / f"{number}.xml"
        path.write_text(FORMATS["junit"](shown), encoding="utf-8")
        xmlschema.validate(str(path), str(DATA / "junit-10.xsd"))
        suite = next(iter(junitparser.JUnitXml.fromfile(str(path))))
        cases = list(suite)
        keys = [(case.classname, case.name) for case in cases]
        assert len(keys) == len(set(keys)) == len(shown.result.checks)
        counts = [
            sum(check.status is status for check in shown.result.checks)
            for status in (Status.FAIL, Status.INCONCLUSIVE)
        ]
        assert [suite.failures, suite.errors] == counts
        for case, check in zip(cases, shown.result.checks, strict=True):
            kinds = {type(entry).__name__ for entry in case.result}
            expected = {
                Status.PASS: set(),
                Status.FAIL: {"Failure"},
                Status.INCONCLUSIVE: {"Error"},
                Status.BLOCKED: {"Skipped"},
                Status.NOT_ASSESSED: {"Skipped"},
            }[check.status]
            assert kinds == expected
            if check.status is Status.FAIL:
                assert case.result[0].text and case.result[0].message


def assert_gradescope_accepts(text: str) -> dict[str, Any]:
    """The rules of Gradescope's documentation of `results.json`."""
    data: dict[str, Any] = json.loads(text)
    top = {
        *("score", "execution_time", "output", "output_format", "test_output_format", "test_name_format"),
        *("visibility", "stdout_visibility", "extra_data", "tests", "leaderboard"),
    }
    per_test = {
        *("score", "max_score", "status", "name", "name_format", "number", "output", "output_format", "tags"),
        *("visibility", "extra_data"),
    }
    visibilities = {"visible", "hidden", "after_due_date", "after_published"}
    formats = {"text", "html", "simple_format", "md", "ansi"}
    assert set(data) <= top
    assert isinstance(data.get("score"), float) or all("score" in test for test in data["tests"])
    for holder in (data, *data["tests"]):
        assert holder.get("visibility", "visible") in visibilities
        assert holder.get("output_format", "text") in formats
        assert isinstance(holder.get("extra_data", {}), dict)
    for test in data["tests"]:
        assert set(test) <= per_test
        assert test.get("status", "passed") in ("passed", "failed")
        assert isinstance(test.get("number", ""), str) and all(isinstance(tag, str) for tag in test["tags"])
        assert test["visibility"] == "visible"  # one hidden test hides the student's total
        if "score" in test:
            assert 0 <= test["score"] <= test["max_score"]
    return data


def test_gradescope_accepts_its_file(report: Report) -> None:
    result = report.result
    data = assert_gradescope_accepts(gradescope(report))
    assert data["score"] == result.score
    assert sum(test.get("max_score", 0) for test in data["tests"]) == result.max_score
    assert result.score is not None
    assert assert_gradescope_accepts(gradescope(report, total=50.0))["score"] == round(
        result.score * 50 / result.max_score, 2
    )
    half = assert_gradescope_accepts(gradescope(report, stage="build"))
    assert half["score"] == 0 and "build" in half["output"]
    for text in (begun("x"), said("y"), gradescope(withheld(report)), gradescope(hostile(report))):
        assert_gradescope_accepts(text)


def test_classroom_50_accepts_its_file(report: Report) -> None:
    data = json.loads(
        classroom50(report, Assignment("c", "a", "s", "https://commit", "https://release", "https://review"))
    )
    strings = ("schema", "classroom", "assignment", "submission", "commit", "release", "review", "datetime")
    assert all(isinstance(data[key], str) and data[key] for key in strings)
    assert data["schema"] == "classroom50/result/v1"
    assert isinstance(data["score"], int) and isinstance(data["max-score"], int)
    assert sum(test["max-score"] for test in data["tests"]) == data["max-score"]
    assert sum(test["score"] for test in data["tests"]) == data["score"]
    for test in data["tests"]:
        assert isinstance(test["test-name"], str) and isinstance(test["passed"], bool)


def test_classroom_50_gets_the_time_of_the_commit_however_often_it_is_graded(report: Report) -> None:
    committed = "2026-10-05T12:00:00+00:00"
    for began in ("2026-10-06T08:00:00Z", "2026-11-01T08:00:00Z"):
        again = Report(**{**vars(report), "committed": committed, "began": began})
        assert json.loads(classroom50(again))["datetime"] == committed


def test_the_result_keeps_its_contract(samples: dict[str, Path]) -> None:
    for name in NAMES:
        data = json.loads((samples[name] / "result.json").read_bytes())
        assert {
            "schema",
            "submission",
            "graded",
            "score",
            "max_score",
            "checklist",
            "checks",
            "notes",
            "runtime",
        } <= set(data)
        msgspec.json.decode((samples[name] / "result.json").read_bytes(), type=Result)
