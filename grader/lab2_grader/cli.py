"""The command line: arguments, exit codes, the one handler of exceptions. The only module that prints."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from contextlib import nullcontext
from datetime import datetime
from enum import Enum
from pathlib import Path
from types import FrameType

from rich import box
from rich.console import Console
from rich.live import Live
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from lab2_grader import (
    __version__,
    bag,
    doctor,
    evidence,
    lab,
    pipeline,
    process,
    provenance,
    report,
    ros,
    sandbox,
    submission,
)
from lab2_grader.checks import verdicts
from lab2_grader.classroom import gradebook, remark, run
from lab2_grader.classroom.progress import Progress
from lab2_grader.errors import FaultError, Lab2Error, RefusedError, UsageError
from lab2_grader.outlets import GithubJob, Gradescope, Outlet
from lab2_grader.records import ClassState, Clock, Evidence, Result
from lab2_grader.report import Audience, github
from lab2_grader.report.classroom50 import Assignment, classroom50
from lab2_grader.report.terminal import plain, terminal

GRADED, BELOW, USAGE, NOT_GRADED, INTERRUPTED = 0, 1, 2, 3, 130
PLAIN_WIDTH = 110  # columns when the output is no terminal
LOG = "lab2-grader-fault.log"


class _Console(Console):
    """A console whose reader may go away: what was asked for is done all the same, and ends with its own exit code."""

    def on_broken_pipe(self) -> None:
        """Say nothing more."""
        self.quiet = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.file.fileno())
        os.close(nowhere)


out = _Console(highlight=False, width=None if sys.stdout.isatty() else PLAIN_WIDTH)
err = _Console(stderr=True, highlight=False, soft_wrap=True)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code (DESIGN section 3)."""
    process.become_reaper()
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        arguments = _parser().parse_args(argv)
        return int(arguments.run(arguments))
    except KeyboardInterrupt:
        err.print("Interrupted. What was recorded so far is kept; nothing is left running.")
        return INTERRUPTED
    except RefusedError as error:
        err.print(Text(github.defused(f"Refused: {error}")), soft_wrap=True)
        return error.exit_code
    except Lab2Error as error:
        err.print(Text(github.defused(str(error))), soft_wrap=True)
        return error.exit_code
    except Exception:
        told = f"lab2-grader {__version__}, Python {sys.version}\n\n{traceback.format_exc()}"
        try:
            Path(LOG).write_text(told, encoding="utf-8", errors="backslashreplace")
        except OSError:
            err.print(Text(told))
        err.print(f"The grader itself failed; no mark was given. Send the file {LOG} to whoever maintains it.")
        return NOT_GRADED


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lab2-grader", description="Grades lab 2 by building, launching and listening."
    )
    parser.add_argument("--version", action="version", version=f"lab2-grader {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    grade = commands.add_parser("grade", help="grade one submission")
    grade.add_argument("submission", help="a folder, a .zip or .tar.gz, or the address of a git repository")
    grade.add_argument("--out", type=Path, help="where the result goes (default: results/<name>)")
    grade.add_argument("--rubric", type=Path, help="a rubric of your own")
    grade.add_argument("--ros", choices=("auto", "sourced", "wheels"), default="auto", help="which ROS to use")
    grade.add_argument("--clock", choices=_values(Clock), default=Clock.TIME_LAPSE.value, help="how time is driven")
    grade.add_argument("--isolation", choices=("auto", "off"), default="auto", help="off: run it with your own rights")
    grade.add_argument("--fail-under", type=int, metavar="N", help="exit with 1 when the mark is below N")
    grade.add_argument("--ci", action="store_true", help="in a GitHub workflow: job summary, annotations, outputs")
    grade.add_argument("--gradescope", type=Path, metavar="DIR", help="Gradescope's folder, /autograder there")
    grade.set_defaults(run=_grade)

    grade_all = commands.add_parser("grade-all", help="grade a class; go on where an earlier call stopped")
    grade_all.add_argument(
        "inbox",
        help="a folder of submissions, a download from Minerva or Moodle, or a CSV of students and repositories",
    )
    grade_all.add_argument("--out", type=Path, default=Path("results"), help="where the results go (default: results)")
    grade_all.add_argument(
        "--jobs", type=_positive, default=0, help="submissions at once (default: what this machine carries)"
    )
    grade_all.add_argument("--rubric", type=Path, help="a rubric of your own")
    grade_all.add_argument(
        "--before", type=_deadline, metavar="TIME", help="of repositories, take the last commit before"
    )
    grade_all.add_argument(
        "--scheduler", default="", metavar="ADDRESS", help="send the work to a Dask cluster (tcp://…)"
    )
    grade_all.add_argument("--ros", choices=("auto", "sourced", "wheels"), default="auto", help="which ROS to use")
    grade_all.add_argument("--clock", choices=_values(Clock), default=Clock.TIME_LAPSE.value, help="how time is driven")
    grade_all.add_argument(
        "--isolation", choices=("auto", "off"), default="auto", help="off: run them with your own rights"
    )
    grade_all.set_defaults(run=_grade_all)

    book = commands.add_parser("gradebook", help="take marks to a gradebook").add_subparsers(
        required=True, metavar="COMMAND"
    )
    fill = book.add_parser("fill", help="fill a file downloaded from Minerva or Moodle with the marks of a class")
    fill.add_argument("--results", type=Path, required=True, help="the folder that grade-all wrote")
    fill.add_argument("--in", dest="download", type=Path, required=True, help="the file as it was downloaded")
    fill.add_argument("--out", type=Path, required=True, help="the file to upload")
    fill.add_argument("--column", default="", help="title or id of the column, where several could take a mark")
    fill.add_argument("--feedback", action="store_true", help="fill the column for feedback too")
    fill.set_defaults(run=_fill)

    rescore = commands.add_parser("rescore", help="judge recorded evidence again; needs no ROS")
    rescore.add_argument("results", type=Path, help="a result's folder, or a folder of such folders")
    rescore.add_argument("--rubric", type=Path, help="a rubric of your own")
    rescore.set_defaults(run=_rescore)

    show = commands.add_parser("report", help="show a result in another format, or its messages as a recording")
    show.add_argument("result", type=Path, help="the folder of a result")
    show.add_argument("--format", choices=tuple(report.FORMATS), help="print this format (default: a table)")
    show.add_argument("--audience", choices=_values(Audience), default=Audience.STUDENT.value, help="who reads it")
    show.add_argument("--output", type=Path, metavar="FILE", help="write the format to FILE instead")
    show.add_argument("--bag", type=Path, metavar="DIR", help="write what was observed as rosbag2 recordings (MCAP)")
    show.set_defaults(run=_report)

    examine = commands.add_parser("doctor", help="look at this machine and say what would get in the way")
    examine.set_defaults(run=_doctor)

    verify = commands.add_parser("verify", help="whether a result still is what was graded, and who signed it")
    verify.add_argument("result", type=Path, help="a result's folder, or the result.json in it")
    verify.add_argument("--submission", help="compare with this submission, too")
    verify.add_argument("--rubric", type=Path, help="the rubric it was marked by, when not the lab's own")
    verify.set_defaults(run=_verify)

    explain = commands.add_parser("explain", help="what a check asks and how it is judged")
    explain.add_argument("check", nargs="?", help="the id of a check; without one, all are listed")
    explain.set_defaults(run=_explain)
    return parser


# --- commands -----------------------------------------------------------------------------------


def _grade(arguments: argparse.Namespace) -> int:
    outlets = _outlets(arguments)
    destination = arguments.out or (lambda name: pipeline.results_folder(Path("results"), name))

    def publish(result: Result, observed: Evidence, stage: str) -> None:
        for outlet in outlets:
            _print_lines(outlet.stage(result, observed, stage))

    try:
        for outlet in outlets:
            _print_lines(outlet.began())
        means = _means(arguments)
        with _Progress() as progress:
            result, folder = pipeline.grade(arguments.submission, destination, means, progress, publish)
    except Exception as error:
        for outlet in outlets:
            _print_lines(outlet.failed(error))
        raise
    if arguments.ci:
        _print_lines(tuple(github.defused(line) for line in plain(result)))
    else:
        out.print(terminal(result))
    out.print(Text(f"Reports and evidence: {folder}"), soft_wrap=True)
    fail_under = arguments.fail_under
    if arguments.ci and fail_under is None and lab.course().fail_workflow_on_lost_points:
        fail_under = result.max_score
    return _exit_code(result, fail_under)


def _means(arguments: argparse.Namespace) -> pipeline.Means:
    isolation = _isolation(arguments)
    if not isolation.on:
        err.print(Text(sandbox.protections_off(isolation), style="bold yellow"))
        if isolation.mend:
            err.print(Text(f"To mend it: {isolation.mend}"))
    return pipeline.Means(ros.find(arguments.ros), isolation, lab.rubric(arguments.rubric), Clock(arguments.clock))


def _outlets(arguments: argparse.Namespace) -> tuple[Outlet, ...]:
    job = (GithubJob(arguments.submission),) if arguments.ci else ()
    return (*job, Gradescope(arguments.gradescope)) if arguments.gradescope else job


def _print_lines(lines: tuple[str, ...]) -> None:
    """Print *lines* as they are, none of them wrapped: a workflow command is a whole line."""
    for line in lines:
        out.print(Text(line), soft_wrap=True)


def _isolation(arguments: argparse.Namespace) -> sandbox.Isolation:
    if arguments.isolation == "off":
        return sandbox.Isolation(False, "it was switched off")
    return sandbox.probe()


def _exit_code(result: Result, fail_under: int | None) -> int:
    if not result.graded or result.score is None:
        return NOT_GRADED
    return BELOW if fail_under is not None and result.score < fail_under else GRADED


def _grade_all(arguments: argparse.Namespace) -> int:
    order = run.Order(
        inbox=arguments.inbox,
        out=str(arguments.out),
        rubric=lab.rubric(arguments.rubric),
        clock=Clock(arguments.clock),
        ros=arguments.ros,
        isolation=arguments.isolation != "off",
        jobs=arguments.jobs,
        before=arguments.before,
        scheduler=arguments.scheduler,
    )
    if not order.isolation:
        err.print(
            Text(
                sandbox.protections_off(sandbox.Isolation(on=False, reason="it was switched off")), style="bold yellow"
            )
        )
    live = err.is_terminal
    progress = Progress(None if live else lambda line: err.print(Text(line), soft_wrap=True))
    with Live(progress, console=err, refresh_per_second=4) if live else nullcontext():
        summary = run.grade_class(order, progress)
    for item in summary.unknown:
        out.print(Text(f"Not understood: {item.what}: {item.reason}"), soft_wrap=True)
    unmarked = [line for line in summary.lines if line.state is not ClassState.GRADED]
    for line in unmarked:
        out.print(Text(f"{line.state.value.capitalize()}: {line.name}: {line.reason}"), soft_wrap=True)
    out.print(
        Text(f"{len(summary.lines) - len(unmarked)} of {len(summary.lines)} submissions have a mark."), soft_wrap=True
    )
    out.print(Text(f"Overview: {arguments.out / 'index.html'}"), soft_wrap=True)
    return NOT_GRADED if any(line.state is ClassState.WITHHELD for line in summary.lines) else GRADED


def _fill(arguments: argparse.Namespace) -> int:
    filled = gradebook.fill(
        arguments.results, arguments.download, arguments.out, column=arguments.column, feedback=arguments.feedback
    )
    out.print(
        Text(f"{filled.cells} marks written to {arguments.out}, out of {filled.total} each, column “{filled.column}”."),
        soft_wrap=True,
    )
    for heading, names in (
        ("Without a mark, so left as they were", filled.without_mark),
        ("More than one result or row for the same student, so left as they were", filled.ambiguous),
        ("In the gradebook, but nothing was handed in", filled.only_in_book),
        ("Graded, but not in the gradebook", filled.only_in_results),
    ):
        if names:
            out.print(Text(f"{heading}: {', '.join(names)}"), soft_wrap=True)
    return GRADED


def _report(arguments: argparse.Namespace) -> int:
    result, observed = pipeline.read(arguments.result)
    if arguments.bag is not None:
        for path in bag.write(observed, arguments.bag):
            out.print(Text(f"Recording: {path}"), soft_wrap=True)
    if arguments.format is None:
        if arguments.bag is None:
            out.print(terminal(result))
        return GRADED
    shown = report.report_of(result, observed, Audience(arguments.audience))
    if arguments.format == "classroom50":
        if not result.graded:
            raise FaultError("The mark is withheld, and Classroom 50 has no word for that: nothing was written.")
        text = classroom50(shown, Assignment.told(os.environ))
    else:
        text = report.FORMATS[arguments.format](shown)
    if arguments.output is None:
        try:
            sys.stdout.buffer.write(text.encode("utf-8", "replace"))
            sys.stdout.flush()
        except BrokenPipeError:
            out.on_broken_pipe()
    else:
        evidence.write_atomically(arguments.output, text.encode("utf-8", "replace"))
    return GRADED


def _doctor(_arguments: argparse.Namespace) -> int:
    findings = doctor.examine(doctor.look_around())
    for finding in findings:
        mark = ("✓ ", "green") if finding.well else ("✗ ", "bold red")
        out.print(Text.assemble(mark, (f"{finding.what}: ", "bold"), finding.found), soft_wrap=True)
        if not finding.well:
            out.print(Text(f"    should be: {finding.wanted}"), soft_wrap=True)
            out.print(Text(f"    to mend it: {finding.mend}"), soft_wrap=True)
    ill = sum(not finding.well for finding in findings)
    out.print(Text(f"{ill} of {len(findings)} things need mending." if ill else "Nothing needs mending."))
    return BELOW if ill else GRADED


def _rescore(arguments: argparse.Namespace) -> int:
    done = remark.rescore(arguments.results, lab.rubric(arguments.rubric))
    if done.changes:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        for heading in ("Submission", "Was", "Is", "Why"):
            table.add_column(heading, justify="right" if heading in ("Was", "Is") else "left", overflow="fold")
        for change in done.changes:
            table.add_row(Text(change.name), Text(change.was), Text(change.now), Text("; ".join(change.why)))
        out.print(table)
    for name, reason in done.failed:
        err.print(Text(f"{name}: {reason}"))
    out.print(Text(f"{done.count} judged again; {len(done.changes)} changed."), soft_wrap=True)
    return USAGE if done.failed else GRADED


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError("give a whole number from 1")
    return int(text)


def _values(kind: type[Enum]) -> list[str]:
    return [member.value for member in kind]


def _deadline(text: str) -> datetime:
    try:
        found = datetime.fromisoformat(text.removesuffix("Z") + "+00:00" * text.endswith("Z"))
    except ValueError:
        raise argparse.ArgumentTypeError("give a time like 2026-10-23T17:00 or 2026-10-23T17:00+01:00") from None
    return found if found.tzinfo else found.astimezone()


def _verify(arguments: argparse.Namespace) -> int:
    folder = arguments.result.parent if arguments.result.name == report.RESULT else arguments.result
    result, _ = pipeline.read(folder)
    again = pipeline.rescore(folder, lab.rubric(arguments.rubric))
    handed_in = ""
    if arguments.submission:
        with process.temporary_directory() as scratch:
            handed_in = submission.take(arguments.submission, scratch / "package").facts.sha256
    findings = provenance.compare(result, folder / pipeline.EVIDENCE, again, handed_in)
    for finding in findings:
        out.print(Text(f"{finding.what:10} {finding.holds.value:14} {finding.text}"), soft_wrap=True)
    return BELOW if any(finding.holds is provenance.Verified.NO for finding in findings) else GRADED


def _explain(arguments: argparse.Namespace) -> int:
    checks = {check.id: check for check in lab.rubric().check}
    if arguments.check is None:
        for check in checks.values():
            out.print(Text(f"{check.id:20} {check.points:3} points  {check.title}"), soft_wrap=True)
        return GRADED
    if arguments.check not in checks:
        raise UsageError(f"There is no check {arguments.check}. There are: {', '.join(checks)}.")
    out.print(Text(verdicts.explanation(checks[arguments.check])), soft_wrap=True)
    return GRADED


# --- progress -----------------------------------------------------------------------------------


class _Progress:
    """One line that says what is being done and for how long; plain lines when not on a terminal."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._spinner = Spinner("dots")
        self._live = Live(self, console=err, transient=True, refresh_per_second=8) if err.is_terminal else None
        self._doing = ""

    def __rich__(self) -> Spinner:
        self._spinner.update(text=Text(f"{self._doing} … {time.monotonic() - self._began:.1f} s"))
        return self._spinner

    def __call__(self, doing: str) -> None:
        self._doing = doing
        if self._live is None:
            err.print(Text(f"[{time.monotonic() - self._began:5.1f} s] {doing}"))

    def __enter__(self) -> _Progress:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._live is not None:
            self._live.stop()
