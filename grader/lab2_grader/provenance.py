"""Whether a result still is what the grader wrote: its digests fit what lies beside it, and its signature is ours."""

from __future__ import annotations

import hashlib
import hmac
import os
from enum import Enum
from pathlib import Path

import msgspec

from lab2_grader import __version__, evidence
from lab2_grader.records import Record, Result

KEY = "LAB2_GRADER_KEY"  # the environment variable with the key; whoever has it can sign, so submissions never see it


class Verified(Enum):
    """What became of one comparison."""

    YES = "matches"
    NO = "does not match"
    UNKNOWN = "not checked"


class Finding(Record, frozen=True):
    """One comparison: `what` was compared, whether it `holds`, and a sentence for people."""

    what: str
    holds: Verified
    text: str


def sign(result: Result) -> Result:
    """*result* with a signature (HMAC-SHA-256, RFC 2104) when there is a key in the environment, else without one."""
    key = os.environ.get(KEY, "")
    return msgspec.structs.replace(result, signature=_signature(result, key) if key else "")


def _signature(result: Result, key: str) -> str:
    """Over the whole result but its signature, as JSON with the fields in the order of `Result`."""
    unsigned = msgspec.json.encode(msgspec.structs.replace(result, signature=""))
    return hmac.new(key.encode(), unsigned, hashlib.sha256).hexdigest()


def compare(result: Result, folder: Path, again: Result, submission: str = "") -> tuple[Finding, ...]:
    """What of *result* still holds.

    Args:
        result: As it stands in `result.json`.
        folder: The folder of its evidence.
        again: The evidence in that folder, judged anew.
        submission: Digest of the submission, when it is at hand.
    """
    return (
        _digest(
            "submission", result.digests.submission, again.digests.submission, "the evidence is of another submission"
        ),
        *(
            [_digest("hand-in", result.digests.submission, submission, "this is not the submission that was graded")]
            if submission
            else []
        ),
        _digest("evidence", result.digests.evidence, evidence.digest(folder), "the evidence was changed after grading"),
        _digest("rubric", result.digests.rubric, again.digests.rubric, "it was marked by another rubric than this one"),
        _mark(result, again),
        _signed(result),
    )


def _digest(what: str, recorded: str, found: str, otherwise: str) -> Finding:
    if recorded == found:
        return Finding(what, Verified.YES, f"the {what} is the one that was graded")
    return Finding(what, Verified.NO, f"{otherwise} (recorded {recorded[:12] or 'nothing'}, found {found[:12]})")


def _mark(result: Result, again: Result) -> Finding:
    """The mark, every verdict and what is said of it, judged again: all follow from evidence and rubric alone."""
    if msgspec.structs.replace(result, digests=again.digests, signature=again.signature) == again:
        return Finding("mark", Verified.YES, "the mark follows from the evidence")
    if result.runtime == again.runtime and again.runtime.grader != __version__:
        text = f"graded by version {result.runtime.grader} of the grader, which may have judged otherwise"
        return Finding("mark", Verified.UNKNOWN, text)
    changed = [one.id for one, other in zip(result.checks, again.checks, strict=False) if one != other]
    shown = ", ".join(changed)
    if (result.score, result.max_score) != (again.score, again.max_score):
        shown = f"{result.score} of {result.max_score}, not {again.score} of {again.max_score}"
    return Finding("mark", Verified.NO, f"the result does not follow from the evidence ({shown or 'its facts'})")


def _signed(result: Result) -> Finding:
    key = os.environ.get(KEY, "")
    if not key:
        said = "signed, but" if result.signature else "not signed, and"
        return Finding("signature", Verified.UNKNOWN, f"{said} there is no key in {KEY} to check it with")
    if not result.signature:
        return Finding("signature", Verified.NO, "the result is not signed")
    if hmac.compare_digest(result.signature.encode(), _signature(result, key).encode()):
        return Finding("signature", Verified.YES, "the signature was made with this key")
    return Finding("signature", Verified.NO, "the signature was not made with this key, or the result was changed")
