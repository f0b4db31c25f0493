"""Makes text that a submission brought fit to be shown: nothing in it can move a cursor, hide or reorder what is read."""

from __future__ import annotations

import re
import unicodedata

# Terminal sequences whole, so that no remains of them (`[31m`) are left; a string sequence only when it is closed, so
# that an open one cannot swallow what follows.
_SEQUENCES = re.compile(
    r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]"  # CSI
    r"|(?:\x1b[\]PX^_]|[\x9d\x90\x98\x9e\x9f])[^\x07\x1b\x9c\x9d\x90\x98\x9e\x9f]*(?:\x07|\x1b\\|\x9c)"  # OSC, DCS, SOS, PM, APC
    r"|\x1b[ -/]*[0-~]"  # the others
)
# Controls, soft hyphen, bidirectional and other invisible formatting, tags, and what is no character at all. The two
# joiners (U+200C, U+200D) stay: scripts and emoji need them.
_INVISIBLE = re.compile(
    "[\x00-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b\u200e\u200f\u202a-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\U000e0000-\U000e0fff]"
)
_BLANKS = re.compile("[\t\n\x0b\x0c\r\x1c-\x1e\x85\u2028\u2029]")
_LINE_ENDS = re.compile("\r\n?|[\x0b\x0c\x85\u2028\u2029]")
_BLANKS_BUT_NEWLINE = re.compile("\t|\x1c|\x1d|\x1e")
_JOINERS = "\u200c\u200d"
_NO_CHARACTERS = ("Cs", "Cn")  # lone surrogates, and what Unicode has not assigned

ELLIPSIS = "…"


def _shown(letter: str) -> str:
    category = unicodedata.category(letter)
    if category in _NO_CHARACTERS:
        return "\ufffd"
    return "" if category == "Cf" and letter not in _JOINERS else letter


def clean(text: str, limit: int, *, lines: bool = False) -> str:
    r"""*text* on one line, without anything invisible or executable by a terminal, at most *limit* characters long.

    Terminal sequences, control characters, bidirectional controls and other invisible formatting go; tabs and line ends
    become spaces; lone surrogates and unassigned characters become U+FFFD. What is too long ends in an ellipsis. It is not escaped for HTML,
    Markdown or a spreadsheet: that is the renderer's part.

    Args:
        text: Whatever a submission brought.
        limit: How many characters to keep, at least 1.
        lines: Keep line ends, as `\n`.
    """
    if not text.isprintable():  # true for nearly all text there is, and quick
        text = _SEQUENCES.sub("", text)
        if lines:
            text = _BLANKS_BUT_NEWLINE.sub(" ", _LINE_ENDS.sub("\n", text))
            text = "\n".join(_INVISIBLE.sub("", line) for line in text.split("\n"))
        else:
            text = _INVISIBLE.sub("", _BLANKS.sub(" ", text))
        text = "".join(_shown(letter) for letter in text)
    if len(text) > limit:
        text = text[: limit - 1] + ELLIPSIS
    return text
