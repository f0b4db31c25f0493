"""What stops a build: a mistake in a source, said so that it can be found."""

from __future__ import annotations


class SourceError(Exception):
    """A source of the worksheet is wrong; the text names the file and what to put right."""
