"""The result as JUnit XML, for GitLab, Jenkins and the actions that read it.

`failure` is the student's, `error` is ours or the machine's, `skipped` is what another check blocks or nothing was there
to judge by. The text stands in the element's body too, because GitLab shows only that.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

from lab2_grader.records import CheckResult, Status
from lab2_grader.report.view import Report
from lab2_grader.report.words import STATUS_WORDS

ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # in XML 1.0, production [2]
SKIPPED = (Status.BLOCKED, Status.NOT_ASSESSED)


def junit(report: Report) -> str:
    """One `testsuite`, one `testcase` for each check, named by the check's id within its checklist item."""
    result = report.result
    failures = sum(check.status in (Status.FAIL, Status.PARTIAL) for check in result.checks)
    errors = sum(check.status is Status.INCONCLUSIVE for check in result.checks)
    counts = {"tests": str(len(result.checks)), "failures": str(failures), "errors": str(errors)}
    time = _time(result.seconds.total)
    root = ET.Element("testsuites", {"name": "lab2", "time": time, **counts})
    attributes = {"name": _legal(result.submission.name), "time": time, **counts}
    attributes["skipped"] = str(sum(check.status in SKIPPED for check in result.checks))
    attributes["hostname"] = "lab2-grader"
    if report.began:
        attributes["timestamp"] = report.began.removesuffix("Z")
    suite = ET.SubElement(root, "testsuite", attributes)
    properties = ET.SubElement(suite, "properties")
    for name, value in (
        ("score", "withheld" if result.score is None else str(result.score)),
        ("max_score", str(result.max_score)),
        ("commit", result.submission.commit or ""),
        ("grader", result.runtime.grader),
        ("ros", f"{result.runtime.distro} ({result.runtime.ros})"),
        ("clock", result.runtime.clock),
        ("isolation", result.runtime.isolation),
    ):
        ET.SubElement(properties, "property", {"name": name, "value": _legal(value)})
    for check in result.checks:
        _case(suite, check, result.seconds.build if check.id == "package-builds" else 0.0)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _case(suite: ET.Element, check: CheckResult, seconds: float) -> None:
    case = ET.SubElement(
        suite, "testcase", {"classname": f"lab2.{check.item}", "name": check.id, "time": _time(seconds)}
    )
    word = STATUS_WORDS[check.status]
    where = f"{check.file}:{check.line}" if check.line else check.file
    body = "\n".join(
        f"{name}: {text}"
        for name, text in (
            ("Expected", check.expected),
            ("Observed", check.observed),
            ("Try", check.hint),
            ("Where", where),
            ("Worksheet", f"section {check.section}"),
        )
        if text
    )
    match check.status:
        case Status.FAIL | Status.PARTIAL:
            kind = ET.SubElement(case, "failure", {"type": check.message or word, "message": _legal(check.observed)})
            kind.text = _legal(body)
        case Status.INCONCLUSIVE:
            kind = ET.SubElement(case, "error", {"type": "not-judged", "message": _legal(check.observed)})
            kind.text = _legal(body)
        case Status.BLOCKED | Status.NOT_ASSESSED:
            said = f"blocked by {', '.join(check.because)}" if check.because else check.observed
            ET.SubElement(case, "skipped", {"type": word, "message": _legal(said)})
        case Status.PASS:
            pass
    points = ET.SubElement(case, "system-out")
    points.text = _legal(f"{check.title}: {word}, {check.points} of {check.max_points} points")


def _legal(text: str) -> str:
    """*text* without the characters that XML 1.0 does not allow."""
    return ILLEGAL.sub("\ufffd", text)


def _time(seconds: float) -> str:
    return f"{seconds:.3f}"
