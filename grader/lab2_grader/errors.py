"""The exception tree: whose fault it is decides what happens next.

Lab2Error
├── UsageError          the caller asked for something that cannot be done      exit 2
├── RefusedError        the submission breaks a rule of submission              exit 2
└── FaultError          the grader's or the machine's fault; no mark is given   exit 3
"""

from __future__ import annotations


class Lab2Error(Exception):
    """Base of all that this package raises on purpose; its text is a sentence for people."""

    exit_code = 3


class UsageError(Lab2Error):
    """The command, an option or a file of settings is wrong; the text says how to put it right."""

    exit_code = 2


class RefusedError(Lab2Error):
    """The submission cannot be graded as it was handed in; the text says what to hand in instead.

    Args:
        rule: The key of the broken rule in the catalogue of messages, for example `no-package`.
        text: The sentence for people.
    """

    exit_code = 2

    def __init__(self, rule: str, text: str) -> None:
        super().__init__(text)
        self.rule = rule


class FaultError(Lab2Error):
    """Something of ours or of the machine's failed: the mark is withheld, never lost.

    Args:
        text: What failed, as a sentence for staff.
        stage: The stage of the pipeline that failed, for example `build`; empty when outside one.
    """

    exit_code = 3

    def __init__(self, text: str, stage: str = "") -> None:
        super().__init__(text)
        self.stage = stage
