"""What a bulk download of submissions from Minerva (Blackboard Learn) says by its names and its texts. Pure.

Names are `<Assignment>_<user name>_attempt_<time>_<original name>`, and `<Assignment>_<user name>_attempt_<time>.txt`
for the text that comes with each attempt (https://help.anthology.com/blackboard, "Download assignments").
"""

from __future__ import annotations

import html
import re

from lab2_grader.records import Record
from lab2_grader.submission.address import is_address

# The first time stamp counts: a student may hand in a file that bears another in its own name.
_NAME = re.compile(
    r"(?P<head>.+?)_attempt_(?P<time>\d{4}(?:-\d{2}){5})(?:_(?P<original>.+)|(?P<text>\.txt))", re.DOTALL
)
_PERSON = re.compile(r"(?P<name>.*?)\s*\((?P<user>[^()]*)\)\s*")
_FIELDS = (
    "Name",
    "Assignment",
    "Date Submitted",
    "Current Grade",
    "Override Grade",
    "Submission Field",
    "Comments",
    "Files",
)
_FIELD = re.compile(rf"(?P<field>{'|'.join(_FIELDS)}):[ \t]*(?P<rest>.*)")
_ADDRESS = re.compile(
    r"(?:https?://|git@)[^\s<>\"'()\[\]{}|\\^`]+|(?:www\.)?github\.com/[\w.-]+/[\w.-]+", re.IGNORECASE
)
_TAG = re.compile(r"<[^>]{0,500}>")


class MemberName(Record, frozen=True):
    """A member's name, taken apart.

    Args:
        head: Assignment and user name, which only the text can tell apart for certain.
        time: When it was submitted, as text that sorts by time.
        original: The name of the student's file; empty for the text that comes with the attempt.
    """

    head: str
    time: str
    original: str


class Text(Record, frozen=True):
    """What the text that comes with an attempt says.

    Args:
        name: The student's name; empty when it does not say.
        user: The user name; empty when it does not say.
        field: What was typed into the submission field.
        files: Names under which the files stand in the download.
    """

    name: str
    user: str
    field: str
    files: tuple[str, ...]


def member_name(name: str) -> MemberName | None:
    """*name* taken apart; None when it is not of this kind."""
    match = _NAME.fullmatch(name)
    return MemberName(match["head"], match["time"], match["original"] or "") if match else None


def user_of(head: str, text: Text | None) -> str:
    """The user name at the end of *head*: what the text says when it fits, else what stands after the last `_`."""
    if text is not None and text.user and head.endswith(f"_{text.user}"):
        return text.user
    return head.rpartition("_")[2]


def read_text(raw: bytes) -> Text:
    """The text that comes with an attempt, whatever its encoding and line ends."""
    text = raw.decode("utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", errors="replace")
    values: dict[str, list[str]] = {}
    current: list[str] = []
    seen = -1
    for line in text.splitlines():
        match = _FIELD.match(line)
        # Fields come in this order, so that one named in what a student typed is not taken for one.
        if match and _FIELDS.index(match["field"]) > seen:
            seen = _FIELDS.index(match["field"])
            current = values.setdefault(match["field"], [])
            current.append(match["rest"])
        else:
            current.append(line)
    person = "\n".join(values.get("Name", ())).strip()
    match = _PERSON.fullmatch(person)
    files = (line.strip() for line in values.get("Files", ()))
    return Text(
        name=match["name"] if match else person,
        user=match["user"].strip() if match else "",
        field="\n".join(values.get("Submission Field", ())).strip(),
        files=tuple(line.removeprefix("Filename:").strip() for line in files if line.startswith("Filename:")),
    )


def addresses(text: str) -> tuple[str, ...]:
    """Addresses of repositories that a student pasted into *text*, plain or HTML, each once.

    Only what is reached over https or as `git@…`: a student's words must not make the grader read this machine's files.
    """
    found: dict[str, str] = {}
    for plain in (html.unescape(_TAG.sub(" ", text)), html.unescape(text)):
        for raw in _ADDRESS.findall(plain):
            address = raw.rstrip(".,;:!?*_").removesuffix("/")
            if address.lower().startswith("git@") and not is_address(address):
                continue
            if address.lower().startswith("http://"):
                address = "https://" + address[len("http://") :]
            bare = re.sub(r"^(?:https://|git@)", "", address, flags=re.IGNORECASE).replace(":", "/", 1)
            found.setdefault(bare.removesuffix(".git").lower(), address)
    return tuple(found.values())
