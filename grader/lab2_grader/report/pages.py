"""What the report's and the class's page share: their templates, and the environment that fills them."""

from __future__ import annotations

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

TEMPLATES = Path(__file__).parent / "templates"


def environment(*, trim: bool) -> Environment:
    """An environment in which every value is escaped and every name must have one.

    Args:
        trim: Whether lines that hold only a statement leave nothing behind.
    """
    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=trim,
        lstrip_blocks=trim,
        keep_trailing_newline=not trim,
    )
