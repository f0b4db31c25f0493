"""How a check says what became of it: a verdict with its words from the catalogue."""

from __future__ import annotations

from collections.abc import Mapping

from lab2_grader import lab, messages
from lab2_grader.records import Status, Verdict


def known(check: str) -> dict[str, messages.Value]:
    """The lab's names and numbers as the sentences of *check* may use them."""
    specification, course = lab.specification(), lab.course()
    numbers, texts = specification.number_topic, specification.text_topic
    pair = specification.original if check == "originals-kept" else specification.numeric
    topic = texts if check.endswith("chatter") or check == "originals-kept" else numbers
    return messages.limits() | {
        "package": specification.package,
        "workspace": course.workspace,
        "smallest": numbers.smallest,
        "largest": numbers.largest,
        "before": numbers.largest - 1,
        "after": numbers.smallest + 1,
        "above": numbers.largest + 1,
        "number_topic": numbers.name,
        "text_topic": texts.name,
        "talker": pair.talker,
        "listener": pair.listener,
        "launch_file": pair.launch_file,
        "topic": topic.name,
        "name": topic.name.lstrip("/"),
        "type": topic.type,
        "wanted": ", ".join(specification.programs),
    }


def passed(check: str) -> Verdict:
    """The check holds."""
    return Verdict(check, Status.PASS, expected=_expected(check))


def failed(check: str, key: str, file: str = "", line: int = 0, **values: messages.Value) -> Verdict:
    """The check does not hold, in the way that the catalogue has under *key*; *file* and *line* tell where the cause is."""
    fault = messages.catalogue().check[check].fault[key]
    filled = known(check) | values
    if line:
        filled |= {"file": file, "line": line}
    return Verdict(
        check,
        Status.FAIL,
        message=key,
        expected=_expected(check),
        observed=messages.fill(fault.observed, **filled),
        hint=messages.fill(fault.hint, **filled),
        symptom=fault.symptom,
        file=file,
        line=line,
    )


def blocked(check: str, *because: str) -> Verdict:
    """Another check failed, so this one could not show."""
    observed = messages.status("blocked", because=", ".join(because))
    return Verdict(check, Status.BLOCKED, expected=_expected(check), observed=observed, because=because)


def no_program(check: str, earlier: Mapping[str, Verdict]) -> Verdict:
    """There was no program to run: its file lies in the wrong folder, which has its own check, or is not there."""
    misplaced = earlier["entry-points"].message == "misplaced"
    return blocked(check, "entry-points") if misplaced else failed(check, "missing")


def not_assessed(check: str, key: str) -> Verdict:
    """There is nothing to judge it by."""
    return Verdict(check, Status.NOT_ASSESSED, message=key, expected=_expected(check), observed=messages.status(key))


def inconclusive(check: str, key: str, **values: messages.Value) -> Verdict:
    """The grader or the machine failed; *values* fill the reason, sentences among them without their full stop."""
    inner = {name: value.rstrip(".") if isinstance(value, str) else value for name, value in values.items()}
    observed = messages.status(key, **inner)
    return Verdict(check, Status.INCONCLUSIVE, message=key, expected=_expected(check), observed=observed)


def _expected(check: str) -> str:
    return messages.fill(messages.catalogue().check[check].expected, **known(check))


def explanation(check: lab.RubricCheck) -> str:
    """What *check* asks, how it is judged, what the ruling is where the worksheet is silent."""
    texts, values = messages.catalogue().check[check.id], known(check.id)
    asked, judged, ruling = (messages.fill(text, **values) for text in (texts.expected, texts.judged, texts.ruling))
    return (
        messages.catalogue()
        .phrase["explanation"]
        .format(
            check=check.id,
            title=check.title,
            section=check.section,
            points=check.points,
            asked=asked,
            judged=judged,
            ruling=ruling,
        )
    )
