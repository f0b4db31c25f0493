"""What a download of submissions from Moodle says by its names. Pure.

Folders are `<Full name>_<participant>_assignsubmission_<file or onlinetext>_`, with the files below; older versions put
the files beside each other with that in front of their names (https://docs.moodle.org, "Using Assignment").
"""

from __future__ import annotations

import re

from lab2_grader.records import Record

_NAME = re.compile(
    r"(?P<student>.+)_(?P<participant>\d+)_assignsubmission_(?P<kind>file|onlinetext)(?:_(?P<rest>.*))?", re.DOTALL
)


class MemberName(Record, frozen=True):
    """The first part of a member's path, taken apart.

    Args:
        student: Full name.
        participant: Number of the participant.
        online_text: It holds what was typed, not a file.
        rest: What follows in the same part of the path: a file's name in older downloads, else empty.
    """

    student: str
    participant: str
    online_text: bool
    rest: str


def member_name(first: str) -> MemberName | None:
    """*first*, the first part of a member's path, taken apart; None when it is not of this kind."""
    match = _NAME.fullmatch(first)
    if match is None:
        return None
    return MemberName(match["student"], match["participant"], match["kind"] == "onlinetext", match["rest"] or "")
