"""Renders the editions: sources and facts in, text out. Reads files, writes none."""

from __future__ import annotations

import base64
import functools
import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.exceptions import TemplateError
from lab2_grader.report.pictures import PICTURE_CSS
from markupsafe import Markup

from lab2_worksheet import handout, markdown
from lab2_worksheet.blocks import HtmlBlocks, MarkdownBlocks
from lab2_worksheet.errors import SourceError
from lab2_worksheet.manifest import commands, facts, questions, tasks
from lab2_worksheet.places import ASSETS, SOURCE


@dataclass(frozen=True)
class Editions:
    """All that the build makes, as text."""

    student: str
    staff: str
    fragment: str
    readme: str


def editions() -> Editions:
    """Render every edition.

    Raises:
        SourceError: A source is wrong; the text says which and how.
    """
    handout.check()
    student = _body(staff=False)
    return Editions(
        student=_page(student, "student"),
        staff=_page(_body(staff=True), "staff"),
        fragment=_fragment(student),
        readme=readme(),
    )


def readme() -> str:
    """The README of the template, as Markdown.

    Raises:
        SourceError: A source is wrong.
    """
    # Markdown is not HTML: what autoescape would do to a quote would be shown as it stands in a block of code.
    env = _environment(autoescape=False)
    text = _render(env, "readme.md.j2", MarkdownBlocks().names())
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def _environment(*, autoescape: bool = True) -> Environment:
    return Environment(
        loader=FileSystemLoader([SOURCE, ASSETS]),
        undefined=StrictUndefined,
        autoescape=autoescape,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


@functools.cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _render(env: Environment, name: str, more: Mapping[str, object]) -> str:
    try:
        return env.get_template(name).render({**facts(), **more})
    except TemplateError as error:
        raise SourceError(f"{name}: {error}.") from error


def _body(*, staff: bool) -> Markup:
    env = _environment()
    blocks = HtmlBlocks(env, staff=staff)
    source = _render(env, "worksheet.md.j2", {**blocks.names(), "staff": staff})
    body = blocks.finish(markdown.html(source))
    _all_used(blocks.used)
    return body


def _all_used(used: frozenset[str]) -> None:
    """Raise when a task or question is in the data and not in the page, or a command is played and not shown."""
    shown = {f"task:{key}" for key in tasks()} | {f"question:{key}" for key in questions()}
    shown |= {f"command:{key}" for key in commands()}
    if missing := sorted(shown - used):
        raise SourceError(f"In the data, but nowhere in the page: {', '.join(missing)}.")


def _page(body: Markup, edition: str) -> str:
    script = _asset("script.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return _render(
        _environment(),
        "page.html.j2",
        {
            "edition": edition,
            "body": body,
            "headings": markdown.headings(body),
            "style": Markup(_asset("page.css") + _asset("content.css") + PICTURE_CSS),
            "script": Markup(script),
            "script_digest": digest,
        },
    )


def _fragment(body: Markup) -> str:
    """The body alone, with the styles of its own parts, for a page that has styles of its own. No script."""
    return _render(
        _environment(), "fragment.html.j2", {"body": body, "style": Markup(_asset("content.css") + PICTURE_CSS)}
    )
