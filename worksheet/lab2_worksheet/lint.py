"""Checks of the sources that need no browser: British spelling, links within the page, commands, stray facts."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path

from lab2_grader import lab
from lab2_grader.sections import section_anchor, symptom_anchor
from spellchecker import SpellChecker

from lab2_worksheet import cli_check
from lab2_worksheet.manifest import commands
from lab2_worksheet.pages import Editions, editions
from lab2_worksheet.places import ASSETS, SOURCE

WORDS = SOURCE / "words.txt"
_WORD = re.compile(r"[A-Za-z][A-Za-z’']*[A-Za-z]|[A-Za-z]")
_NOT_PROSE = ("code", "samp", "script", "style", "svg", "pre")
_VOID = ("meta", "link", "input", "br", "hr", "img")


class Page(HTMLParser):
    """What of a page is checked: its prose, its ids, its links, its inline code.

    Args:
        html: The page.
    """

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.ids: list[str] = []
        self.links: list[str] = []
        self.code: list[str] = []
        self._open: list[str] = []
        self._prose: list[str] = []
        self.feed(html)

    @property
    def prose(self) -> str:
        """The text for people, without code, output and pictures."""
        return " ".join(self._prose)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note ids and links."""
        found = dict(attrs)
        if found.get("id"):
            self.ids.append(str(found["id"]))
        if tag == "a" and found.get("href"):
            self.links.append(str(found["href"]))
        if tag == "code":
            self.code.append("")
        if tag not in _VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Close *tag* and what was left open in it."""
        if tag in self._open:
            while self._open.pop() != tag:
                pass

    def handle_data(self, data: str) -> None:
        """Keep text where it belongs."""
        if "code" in self._open and "pre" not in self._open and self.code:
            self.code[-1] += data
        if not any(tag in self._open for tag in _NOT_PROSE):
            self._prose.append(data)


def everything() -> list[str]:
    """Everything that is wrong, a line each; empty when all is well."""
    made = editions()
    return [*spelling(made), *links(made), *tier_one(made), *stray_facts()]


# --- spelling -----------------------------------------------------------------------------------


def spelling(made: Editions) -> list[str]:
    """Words of the pages that no dictionary knows, and American spellings."""
    found = []
    american, known, speller = _american(), _project_words(), SpellChecker(language="en")
    for name, text in (("staff edition", Page(made.staff).prose), ("template's README", _markdown_prose(made.readme))):
        words = {word.replace("’", "'").removesuffix("'s") for word in _WORD.findall(_without_addresses(text))}
        plain = {word for word in words if word.lower() not in known}
        found += [
            f"{name}: {word}: in British English {american[word.lower()]}."
            for word in sorted(plain)
            if word.lower() in american
        ]
        unknown = speller.unknown(sorted(plain - {word for word in plain if word.lower() in american}))
        found += [f"{name}: {word}: not in the dictionary nor in {WORDS.name}." for word in sorted(unknown)]
    return found


def _without_addresses(text: str) -> str:
    return re.sub(r"\S+[@/_.]\S+|\b\w*\d\w*", " ", text)


def _markdown_prose(text: str) -> str:
    text = re.sub(r"```.*?```|<!--.*?-->", " ", text, flags=re.DOTALL)
    return re.sub(r"`[^`]*`|\]\([^)]*\)|<[^>]*>", " ", text)


@functools.cache
def _american() -> dict[str, str]:
    """American spellings and the British ones: the list that codespell keeps, read the other way round."""
    path = resources.files("codespell_lib") / "data" / "dictionary_en-GB_to_en-US.txt"
    pairs = (line.split("->") for line in path.read_text(encoding="utf-8").splitlines() if "->" in line)
    return {us.strip(" ,").lower(): gb.lower() for gb, us in pairs if "," not in us.strip(" ,")}


@functools.cache
def _project_words() -> frozenset[str]:
    lines = WORDS.read_text(encoding="utf-8").splitlines()
    names = lab.course().contact_name.lower().split()
    return frozenset([*(line.strip().lower() for line in lines if line and not line.startswith("#")), *names])


# --- links --------------------------------------------------------------------------------------


def links(made: Editions) -> list[str]:
    """Links within an edition that lead nowhere, ids that stand twice, and addresses of the grader that are missing."""
    found = []
    for name, text in (("student edition", made.student), ("staff edition", made.staff), ("fragment", made.fragment)):
        page = Page(text)
        ids = set(page.ids)
        found += [
            f"{name}: {link} leads nowhere." for link in page.links if link.startswith("#") and link[1:] not in ids
        ]
        found += [
            f"{name}: the id {key} stands there {page.ids.count(key)} times."
            for key in sorted(ids)
            if page.ids.count(key) > 1
        ]
        wanted = {section_anchor(check.section) for check in lab.rubric().check}
        wanted |= {section_anchor(row.section) for row in lab.symptoms()} | {
            symptom_anchor(row.id) for row in lab.symptoms()
        }
        found += [f"{name}: nothing has the id {anchor}, to which feedback links." for anchor in sorted(wanted - ids)]
    return found


# --- commands -----------------------------------------------------------------------------------


def tier_one(made: Editions) -> list[str]:
    """Commands of the manifest, and commands in the text, that name something that does not exist."""
    found = [
        f"commands.toml: {key}: {wrong}"
        for key, command in commands().items()
        for wrong in cli_check.problems(command.run)
    ]
    mentioned = {code for code in Page(made.staff).code if code.split(" ")[0] in ("ros2", "colcon", "git", "source")}
    found += [f"in the text: {code}: {wrong}" for code in sorted(mentioned) for wrong in cli_check.problems(code)]
    return found


# --- facts --------------------------------------------------------------------------------------

_STRAY = (
    (re.compile(r"\b20\d\d\b"), "a year"),
    (re.compile(r"\b[Ww]eek \d"), "a week"),
    (re.compile(r"[\w.]+@(?!github\.com|example\.com)[\w-]+\.[\w.]+"), "an e-mail address"),
    (re.compile(r"https?://(?!www\.w3\.org/)[\w.-]+"), "an address"),
    (re.compile(r"github\.com[:/](?!YOUR-USERNAME)\w"), "a repository"),
)


def sources() -> Iterator[Path]:
    """The files whose facts must come from the lab's TOML."""
    yield from sorted(path for folder in (SOURCE, ASSETS) for path in folder.rglob("*") if path.is_file())
    yield lab.FACTS / "symptoms.toml"


def stray_facts() -> list[str]:
    """Facts of the course that stand in a source instead of the lab's TOML."""
    course = lab.course()
    values = {
        course.module_code,
        course.contact_name,
        course.contact_email,
        course.worksheet_url,
        course.template_clone_url,
        course.solutions_url,
        course.grader_install_url,
    } - {""}
    found = []
    for path in sources():
        text = path.read_text(encoding="utf-8")
        for number, line in enumerate(text.splitlines(), 1):
            found += [
                f"{path.name}:{number}: {what}: {match.group()}"
                for kind, what in _STRAY
                for match in kind.finditer(line)
            ]
            found += [
                f"{path.name}:{number}: a fact of the course: {value}" for value in sorted(values) if value in line
            ]
    return found
