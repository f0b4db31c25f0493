"""Turns Markdown into HTML as the worksheet wants it: tables, curly quotes, headings with the section's anchor."""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from typing import Any

from lab2_grader.sections import section_anchor
from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token
from markdown_it.utils import EnvType, OptionsDict
from markupsafe import Markup

_NUMBER = re.compile(r"(\d+(?:\.\d+)*)\s+")


@functools.cache
def _parser() -> MarkdownIt:
    parser = MarkdownIt("commonmark", {"html": True, "typographer": True, "quotes": "“”‘’"})
    parser.enable(["table", "smartquotes"])
    parser.add_render_rule("heading_open", _heading_open)
    parser.add_render_rule(
        "table_open", lambda *_: '<div class="scroll" tabindex="0" role="group" aria-label="Table"><table>'
    )
    parser.add_render_rule("table_close", lambda *_: "</table></div>\n")
    return parser


def _heading_open(self: RendererHTML, tokens: Sequence[Token], index: int, options: OptionsDict, env: EnvType) -> str:
    """`## 6.1 …` gets the section's anchor; another heading gets one made of its words."""
    text = tokens[index + 1].content
    number = _NUMBER.match(text)
    words = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
    tokens[index].attrSet("id", section_anchor(number.group(1)) if number else words)
    return self.renderToken(tokens, index, options, env)


def html(text: str) -> Markup:
    """A page of Markdown as HTML."""
    return Markup(_parser().render(text))


def inline(text: str) -> Markup:
    """A line of Markdown as HTML, without a paragraph around it."""
    return Markup(_parser().renderInline(text))


def headings(page: str) -> list[tuple[int, str, Markup]]:
    """Level, anchor and content of the headings of level 2 and 3 in a page of HTML."""
    found: list[Any] = re.findall(r'<h([23]) id="([^"]+)"[^>]*>(.*?)</h\1>', page, re.DOTALL)
    return [(int(level), anchor, Markup(content)) for level, anchor, content in found]
