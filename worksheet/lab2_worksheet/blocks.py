"""What the sources put into the page: listings, commands, tasks, questions and the like.

Each function of a `Blocks` is a name in the sources (`{{ commands("build") }}`). `HtmlBlocks` writes them for the page;
`MarkdownBlocks` writes those that the template's README uses as Markdown.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from jinja2 import Environment
from lab2_grader import lab
from lab2_grader.checks.verdicts import known
from lab2_grader.lab import RubricCheck
from lab2_grader.messages import catalogue
from lab2_grader.sections import section_anchor
from markupsafe import Markup

from lab2_worksheet import listings, markdown
from lab2_worksheet.drawings import PICTURES
from lab2_worksheet.errors import SourceError
from lab2_worksheet.manifest import Command, Task, commands, questions, tasks
from lab2_worksheet.recording import recording
from lab2_worksheet.release import in_words

CODE = ("file", "listener", "name", "number_topic", "talker", "text_topic", "topic", "type")  # shown as code
CANARY = "staff-only-9c1f"  # stands in every staff block, and must stand nowhere in what students get


def _command(key: str) -> Command:
    try:
        return commands()[key]
    except KeyError:
        raise SourceError(f"commands.toml has no command {key!r}.") from None


def checks_of(section: str) -> tuple[RubricCheck, ...]:
    """The rubric's checks of a section, in the rubric's order."""
    return tuple(check for check in lab.rubric().check if check.section == section)


def judged(check: RubricCheck) -> str:
    """How a check is judged, and the ruling where the worksheet is silent: the words of the grader's own catalogue."""
    names = {key: f"`{value}`" if key in CODE else value for key, value in known(check.id).items()}
    texts = catalogue().check[check.id]
    return f"{texts.judged} {texts.ruling}".format_map(names)


class MarkdownBlocks:
    """The blocks as Markdown, for a README."""

    def names(self) -> dict[str, Callable[..., str]]:
        """What sources may call."""
        return {"commands": self.commands, "cmd": self.cmd, "date": in_words, "tree": self.tree, "more": self.more}

    def commands(self, *keys: str, see: str = "") -> str:
        """A fenced block with the commands."""
        return "```bash\n" + "\n".join(_command(key).run for key in keys) + "\n```"

    def cmd(self, key: str) -> str:
        """A command within a sentence."""
        return f"`{_command(key).run}`"

    def tree(self, text: str) -> str:
        """A drawing of folders."""
        return f"```text\n{text.strip()}\n```"

    def more(self, section: str, text: str) -> str:
        """A reference to a section of the worksheet: a link where its address is known."""
        address = lab.course().worksheet_url
        return f"[{text}]({address}#{section_anchor(section)})" if address else text


class HtmlBlocks:
    """The blocks as HTML.

    Markdown would take a block's blank lines and indentation for its own. So a block is kept aside, and a token stands
    for it until `finish`.

    Args:
        env: The environment that holds the blocks' templates.
        staff: Whether staff blocks are written.
    """

    def __init__(self, env: Environment, *, staff: bool) -> None:
        self._templates: Any = env.get_template("blocks.html.j2").module
        self._staff = staff
        self._kept: list[Markup] = []
        self._done: set[str] = set()
        self._used: set[str] = set()

    def names(self) -> dict[str, Callable[..., str]]:
        """What sources may call."""
        return {
            "checklist": self.checklist,
            "cmd": self.cmd,
            "commands": self.commands,
            "date": in_words,
            "done": self.done,
            "line": self.line,
            "lines": self.lines,
            "Line": lambda path, anchor: self.line(path, anchor, word="Line"),
            "Lines": lambda path, first, last: self.lines(path, first, last, word="Lines"),
            "listing": self.listing,
            "more": self.more,
            "note": self.note,
            "picture": self.picture,
            "points": self.points,
            "questions": self.questions,
            "recorded": self.recorded,
            "sec": self.sec,
            "staff_only": self.staff_only,
            "symptoms": self.symptoms,
            "task": self.task,
            "tree": self.tree,
        }

    @property
    def used(self) -> frozenset[str]:
        """The commands, tasks, questions and pictures that the sources have used, as `kind:id`."""
        return frozenset(self._used)

    def finish(self, html: str) -> Markup:
        """*html* with every token replaced by its block."""
        pattern = re.compile(r"<p>\s*@@(\d+)@@\s*</p>|@@(\d+)@@")
        while pattern.search(html):
            html = pattern.sub(lambda found: str(self._kept[int(found.group(1) or found.group(2))]), html)
        return Markup(html)

    def _keep(self, block: str) -> Markup:
        self._kept.append(Markup(block))
        return Markup(f"\n\n@@{len(self._kept) - 1}@@\n\n")

    def _keep_inline(self, block: str) -> Markup:
        self._kept.append(Markup(block))
        return Markup(f"@@{len(self._kept) - 1}@@")

    # --- listings --------------------------------------------------------------------------------

    def listing(self, path: str, *, first: str = "", last: str = "", caption: str = "") -> Markup:
        """A file of the template, or the part between two anchors."""
        body = listings.numbered(listings.template(path), first=first, last=last)
        return self._keep(self._templates.listing(caption or path, body))

    def line(self, path: str, anchor: str, word: str = "line") -> Markup:
        """`line 12`, as a link to the one line of the listing that contains *anchor*."""
        listing = listings.template(path)
        number = listing.line(anchor)
        return self._keep_inline(f'<a class="to-line" href="#{listing.key}-L{number}">{word} {number}</a>')

    def lines(self, path: str, first: str, last: str, word: str = "lines") -> Markup:
        """`lines 12 to 20`, from the line that contains *first* to the one that contains *last*."""
        listing = listings.template(path)
        start, end = listing.line(first), listing.line(last)
        if start >= end:
            raise SourceError(f"{path}: {first!r} (line {start}) must stand above {last!r} (line {end}).")
        return self._keep_inline(f'<a class="to-line" href="#{listing.key}-L{start}">{word} {start} to {end}</a>')

    # --- commands --------------------------------------------------------------------------------

    def commands(self, *keys: str, see: str = "") -> Markup:
        """Commands typed one after the other in one terminal, and what is then seen.

        Args:
            keys: Their ids.
            see: What to say above the recorded output; empty for the usual words.
        """
        return self._keep(self._commands(*keys, see=see))

    def _commands(self, *keys: str, see: str = "") -> Markup:
        chosen = [_command(key) for key in keys]
        self._used.update(f"command:{key}" for key in keys)
        terminals = {command.terminal for command in chosen}
        if len(terminals) != 1:
            raise SourceError(f"{', '.join(keys)}: the commands of one block belong into one terminal.")
        output = [line for command in chosen for line in recording().outputs.get(command.id, ())]
        return Markup(
            self._templates.commands(
                chosen, terminals.pop(), output, see, chosen[-1].keeps_running, in_words(recording().recorded)
            )
        )

    def cmd(self, key: str) -> Markup:
        """A command within a sentence."""
        self._used.add(f"command:{key}")
        return self._keep_inline(Markup("<code>{}</code>").format(_command(key).run))

    def recorded(self) -> str:
        """When and with what the outputs were recorded, in words."""
        made = recording()
        versions = ", ".join(f"{name} {version}" for name, version in made.versions.items())
        return f"{in_words(made.recorded)} with ROS 2 {made.distro.capitalize()} ({versions})"

    # --- tasks, questions, progress --------------------------------------------------------------

    def task(self, key: str) -> Markup:
        """Everything of a task but its instructions."""
        task = tasks().get(key)
        if task is None:
            raise SourceError(f"tasks.toml has no task {key!r}.")
        self._used.add(f"task:{key}")
        tries = [self._commands(*group) for group in _by_terminal(task.try_it)]
        block = self._templates.task(
            task,
            [(label, markdown.inline(value)) for label, value in task.row],
            [markdown.html(hint) for hint in task.hints],
            tries,
            markdown.html(task.expect),
            self._checks(task.section),
        )
        staff = self._staff_task(task) if self._staff else ""
        return self._keep(block + staff)

    def _staff_task(self, task: Task) -> Markup:
        return Markup(
            self._templates.staff_task(
                task,
                CANARY,
                [listings.difference(change.began_as, change.file) for change in task.changes],
                markdown.html(task.marking),
                [(markdown.inline(fault.text), fault.seen) for fault in task.faults],
            )
        )

    def points(self, section: str) -> Markup:
        """The checks of a section, with what they are worth."""
        return self._keep(self._templates.checks(self._checks(section)))

    def _checks(self, section: str) -> list[tuple[RubricCheck, Markup]]:
        return [(check, markdown.inline(judged(check))) for check in checks_of(section)]

    def questions(self, section: str) -> Markup:
        """The questions that stand at the end of a section."""
        chosen = [question for question in questions().values() if question.after == section]
        if not chosen:
            raise SourceError(f"questions.toml has no question after {section}.")
        self._used.update(f"question:{question.id}" for question in chosen)
        return self._keep(self._templates.questions(section, chosen, markdown.inline))

    def done(self, key: str, label: str) -> Markup:
        """A box to tick, kept in the browser; *key* is its name there and never changes."""
        if key in self._done:
            raise SourceError(f"done({key!r}) stands in the sources twice.")
        self._done.add(key)
        return self._keep(self._templates.done(key, markdown.inline(label)))

    def checklist(self) -> Markup:
        """The rubric's checklist as boxes to tick, with the checks that serve each item."""
        rubric = lab.rubric()
        rows = [
            (item.item, item.text, [check for check in rubric.check if check.item == item.item])
            for item in rubric.checklist
        ]
        return self._keep(self._templates.checklist(rows))

    def symptoms(self) -> Markup:
        """The troubleshooting rows with their search."""
        rows = [
            (row, *(markdown.inline(text) for text in (row.see, row.cause, row.check, row.fix)))
            for row in lab.symptoms()
        ]
        return self._keep(self._templates.symptoms(rows, section_anchor))

    # --- the rest --------------------------------------------------------------------------------

    def picture(self, name: str, caption: str) -> Markup:
        """A picture with its caption."""
        if name not in PICTURES:
            raise SourceError(f"There is no picture {name!r}.")
        self._used.add(f"picture:{name}")
        return self._keep(self._templates.picture(Markup(PICTURES[name]()), markdown.inline(caption)))

    def note(self, title: str, caller: Callable[[], str]) -> Markup:
        """A box beside the text: `{% call note("…") %}…{% endcall %}`."""
        return self._keep(self._templates.note(title, markdown.html(caller())))

    def staff_only(self, title: str, caller: Callable[[], str]) -> Markup:
        """A box that students never get: its words are not evaluated for them."""
        if not self._staff:
            return Markup("")
        return self._keep(self._templates.staff(title, CANARY, markdown.html(caller())))

    def sec(self, number: str) -> Markup:
        """A link to a section of the page."""
        return self._keep_inline(f'<a href="#{section_anchor(number)}">{number}</a>')

    def more(self, section: str, text: str) -> Markup:
        """The same as in the README: a reference to a section."""
        return self._keep_inline(Markup('<a href="#{}">{}</a>').format(section_anchor(section), text))

    def tree(self, text: str) -> Markup:
        """A drawing of folders."""
        return self._keep(
            Markup('<pre class="tree" tabindex="0" role="group" aria-label="Folders"><code>{}</code></pre>').format(
                text.strip()
            )
        )


def _by_terminal(keys: tuple[str, ...]) -> list[tuple[str, ...]]:
    """*keys* in runs that share a terminal, none beyond a command that keeps running."""
    groups: list[tuple[str, ...]] = []
    for key in keys:
        last = _command(groups[-1][-1]) if groups else None
        if last and last.terminal == _command(key).terminal and not last.keeps_running:
            groups[-1] += (key,)
        else:
            groups.append((key,))
    return groups
