"""Workflow commands that put a result beside the lines it speaks of on GitHub.

GitHub executes commands from any line that begins with `::`, and the old form `##[…]` anywhere in a line. Everything that
came from a submission is therefore escaped here, and both forms are broken up.
"""

from __future__ import annotations

from lab2_grader import lab, messages
from lab2_grader.records import CheckResult, Status
from lab2_grader.report.view import Report
from lab2_grader.report.words import broken

MOST = 9  # GitHub keeps ten a step of each kind and drops the rest without a word
LENGTH = 600

# Where somebody would look first, when the verdict itself does not know better.
USUAL_FILES = {
    "package-builds": "setup.py",
    "entry-points": "setup.py",
    "talker-type": "{package}/{talker}.py",
    "talker-start": "{package}/{talker}.py",
    "talker-step": "{package}/{talker}.py",
    "talker-wrap": "{package}/{talker}.py",
    "talker-chatter": "{package}/{talker}.py",
    "listener-numeric": "{package}/{listener}.py",
    "listener-chatter": "{package}/{listener}.py",
    "launch-starts": "launch/{file}",
    "launch-only-numeric": "launch/{file}",
    "launch-conversation": "launch/{file}",
}


def workflow_commands(report: Report, below: str = "", errors: bool = False) -> tuple[str, ...]:
    """One command for each check that can be mended now, at most nine, and one that counts the rest.

    Args:
        report: The student's report.
        below: Where the submission is, relative to the top of the repository; empty for the top.
        errors: Whether they are errors (the run turns red) or warnings.
    """
    kind = "error" if errors else "warning"
    checks = [check for check in report.to_do if check.status in (Status.FAIL, Status.PARTIAL)]
    shown = [_command(kind, check, _path(report, check, below)) for check in checks[:MOST]]
    if not report.result.graded:
        shown = [command(kind, "No mark was given", messages.report("withheld")), *shown[: MOST - 1]]
    left = len(checks) - sum(line.startswith(f"::{kind} ") for line in shown) + (not report.result.graded)
    if left > 0:
        shown.append(command("notice", course_title(), messages.report("more", count=left)))
    return tuple(shown)


def course_title() -> str:
    """What annotations without a place of their own are called."""
    return lab.course().title


def command(kind: str, title: str, message: str, file: str = "", line: int = 0) -> str:
    """A workflow command; whatever its texts hold, it is this one command and no other."""
    places = (("file", file), ("line", str(line) if line else ""), ("title", title))
    properties = ",".join(f"{name}={_property(value)}" for name, value in places if value)
    return f"::{kind} {properties}::{_data(message)}"


def defused(text: str) -> str:
    """*text* in which no line is a workflow command: for whatever is printed where GitHub reads along."""
    lines = text.replace("##[", "# #[").splitlines()
    return "\n".join(": :" + line.lstrip()[2:] if line.lstrip().startswith("::") else line for line in lines)


def _command(kind: str, check: CheckResult, file: str) -> str:
    text = f"Expected {check.expected}. Observed: {check.observed}. Try: {check.hint} (section {check.section})"
    return command(kind, check.title, text, file, check.line if check.file else 0)


def _path(report: Report, check: CheckResult, below: str) -> str:
    """The file that the check speaks of, relative to the top of the repository; empty when there is none such."""
    specification = lab.specification()
    numeric = specification.numeric
    usual = USUAL_FILES.get(check.id, "").format(
        package=specification.package, talker=numeric.talker, listener=numeric.listener, file=numeric.launch_file
    )
    name = next((name for name in (check.file, usual) if name in report.package_files), "")
    parts = [part for part in (below, report.package_path) if part not in ("", ".")]
    return "/".join((*parts, name)) if name else ""


def _data(text: str) -> str:
    short = text if len(text) <= LENGTH else text[: LENGTH - 1] + "…"
    return broken(short).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
