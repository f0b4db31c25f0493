"""The table of checks: pure functions from evidence to verdicts. No ROS, no processes, no clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from lab2_grader import messages
from lab2_grader.checks import interpreter, launch, listener, originals, package, repository, talker
from lab2_grader.checks.verdicts import blocked, inconclusive
from lab2_grader.checks.view import View
from lab2_grader.records import Evidence, Status, Verdict

Check = Callable[[View, Mapping[str, Verdict]], Verdict]

# In the order of DESIGN section 5. A check may look at the verdicts of those above it, to say what blocks it.
CHECKS: tuple[tuple[str, Check], ...] = (
    ("package-builds", package.package_builds),
    ("entry-points", package.entry_points),
    ("talker-type", talker.talker_type),
    ("talker-start", talker.talker_start),
    ("talker-step", talker.talker_step),
    ("talker-wrap", talker.talker_wrap),
    ("talker-chatter", talker.talker_chatter),
    ("listener-numeric", listener.listener_numeric),
    ("listener-chatter", listener.listener_chatter),
    ("launch-starts", launch.launch_starts),
    ("launch-only-numeric", launch.launch_only_numeric),
    ("launch-conversation", launch.launch_conversation),
    ("originals-kept", originals.originals_kept),
    ("git-pushed", repository.git_pushed),
    ("git-clean", repository.git_clean),
)

NEEDS_NO_BUILD = ("package-builds", "git-pushed", "git-clean")


def judge(evidence: Evidence) -> tuple[Verdict, ...]:
    """What every check says of *evidence*, in the order of the table."""
    view = View(evidence)
    verdicts: dict[str, Verdict] = {}
    for name, check in CHECKS:
        verdicts[name] = interpreter.excused(view, _judge_one(name, check, view, verdicts))
    return tuple(verdicts.values())


def _judge_one(name: str, check: Check, view: View, earlier: Mapping[str, Verdict]) -> Verdict:
    if name not in NEEDS_NO_BUILD:
        base = earlier["package-builds"]
        if view.evidence.faults or (view.build is None and base.status is Status.INCONCLUSIVE):
            fault = (*view.evidence.faults, messages.phrase("no-build"))[0]
            return inconclusive(name, "inconclusive-scene", fault=fault)
        if base.status is not Status.PASS:
            return blocked(name, "package-builds")
    return check(view, earlier)
