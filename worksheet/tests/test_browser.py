"""The student edition in a real Chromium, opened from a file with the network off, by mouse and by keyboard."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from lab2_grader import lab

from lab2_worksheet.manifest import commands, questions, tasks
from lab2_worksheet.pages import Editions

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
AXE = Path(__file__).parent / "node_modules" / "axe-core" / "axe.min.js"
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PHONE, DESKTOP = {"width": 390, "height": 844}, {"width": 1280, "height": 900}

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed (apt-get install chromium)")
sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed") if BROWSER else None


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    assert sync_api is not None
    with sync_api.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=BROWSER, args=list(FLAGS))
        yield opened
        opened.close()


class Opened:
    """A page from a file, with all that it asked for and all that it complained of."""

    def __init__(self, browser: Any, path: Path, *, viewport: dict[str, int] | None = None, **settings: Any) -> None:
        self.context = browser.new_context(viewport=viewport or DESKTOP, offline=True, **settings)
        self.page = self.context.new_page()
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.path = path
        self.page.goto(path.as_uri())

    def close(self) -> None:
        assert self.complaints == []
        assert {url for url in self.requests if not url.startswith("data:")} == {self.path.as_uri()}
        self.context.close()


@pytest.fixture(scope="module")
def files(made: Editions, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("editions")
    found = {}
    for name in ("student", "staff", "fragment"):
        found[name] = folder / f"{name}.html"
        text = getattr(made, name)
        if name == "fragment":
            text = f'<!doctype html><html lang="en"><title>A module’s page</title><main>{text}</main></html>'
        found[name].write_text(text, encoding="utf-8")
    return found


@pytest.fixture
def opened(browser: Any, files: dict[str, Path]) -> Iterator[Opened]:
    page = Opened(browser, files["student"])
    yield page
    page.close()


@pytest.fixture
def page(opened: Opened) -> Any:
    return opened.page


def axe(page: Any) -> list[str]:
    """What axe-core finds, a line each."""
    assert AXE.is_file(), f"run: npm ci --prefix {AXE.parents[2]}"
    # The page's own policy forbids scripts that are not its own: axe comes in through the debugging protocol.
    page.evaluate(AXE.read_text(encoding="utf-8"))
    page.evaluate("for (const details of document.querySelectorAll('details')) details.open = true")
    found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    return [
        f"{violation['id']}: {node['html'][:160]}" for violation in found["violations"] for node in violation["nodes"]
    ]


@pytest.mark.parametrize("edition", ["student", "staff", "fragment"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(browser: Any, files: dict[str, Path], edition: str, scheme: str) -> None:
    opened = Opened(browser, files[edition], color_scheme=scheme)
    if edition != "fragment":
        opened.page.locator("#question-period input").first.check()
        opened.page.locator("#question-period input").nth(1).check()
    assert axe(opened.page) == []
    opened.close()


def test_axe_finds_nothing_on_a_phone_or_on_paper(browser: Any, files: dict[str, Path]) -> None:
    opened = Opened(browser, files["student"], viewport=PHONE)
    assert axe(opened.page) == []
    opened.page.emulate_media(media="print")
    assert axe(opened.page) == []
    opened.close()


def test_axe_can_find_something(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "bad.html"
    path.write_text("<!doctype html><html lang=en><title>x</title><main><h1>x</h1><input></main>", encoding="utf-8")
    opened = Opened(browser, path)
    assert any(line.startswith("label:") for line in axe(opened.page))
    opened.close()


@pytest.mark.parametrize("viewport", [PHONE, DESKTOP, {"width": 320, "height": 600}])
def test_nothing_is_wider_than_the_screen(browser: Any, files: dict[str, Path], viewport: dict[str, int]) -> None:
    opened = Opened(browser, files["student"], viewport=viewport)
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    opened.close()


def test_hints_open_one_after_the_other_by_keyboard(page: Any) -> None:
    task = page.locator("section.task").first
    hints = task.locator("details.hint")
    assert hints.count() == 3
    assert [hints.nth(number).locator("> summary").is_visible() for number in range(3)] == [True, False, False]
    for number in range(3):
        hints.nth(number).locator("> summary").focus()
        page.keyboard.press("Enter")
        assert hints.nth(number).locator("> .hint-text").is_visible()
    assert page.locator("details.hint").count() == 3 * len(tasks())


def test_a_question_answers_by_mouse_and_by_keyboard(page: Any) -> None:
    question = page.locator("#question-period")
    verdict = question.locator(".verdict")
    options = next(entry for entry in questions().values() if entry.id == "period").option
    question.locator("label").nth(0).click()
    assert "Not quite" in verdict.inner_text()
    assert "not a frequency" in verdict.inner_text()
    page.keyboard.press("ArrowDown")
    assert options[1].right
    assert "Right." in verdict.inner_text()
    assert verdict.get_attribute("role") == "status"


def test_ticks_and_answers_are_remembered_and_can_be_forgotten(page: Any) -> None:
    boxes = page.locator("input[data-done]")
    total = boxes.count()
    assert total >= 10 + len(lab.rubric().checklist)
    page.locator("[data-done=files]").check()
    page.locator("[data-done=checklist-topics]").focus()
    page.keyboard.press("Space")
    page.locator("#question-overflow input").nth(2).check()
    assert page.locator("#progress-text").inner_text() == f"2 of {total} done"
    page.reload()
    assert page.locator("[data-done=files]").is_checked()
    assert page.locator("[data-done=checklist-topics]").is_checked()
    assert "Right." in page.locator("#question-overflow .verdict").inner_text()
    page.once("dialog", lambda dialog: dialog.dismiss())
    page.locator("#progress-reset").click()
    assert page.locator("[data-done=files]").is_checked()
    page.once("dialog", lambda dialog: dialog.accept())
    page.locator("#progress-reset").click()
    assert not page.locator("[data-done=files]").is_checked()
    page.reload()
    assert page.locator("#progress-text").inner_text() == f"0 of {total} done"
    assert page.locator("#question-overflow .verdict").inner_text() == ""


def test_what_an_older_page_remembered_does_no_harm(page: Any) -> None:
    page.evaluate("localStorage.setItem('lab2-worksheet', '[1')")
    page.reload()
    page.locator("[data-done=files]").check()
    page.reload()
    assert page.locator("[data-done=files]").is_checked()


@pytest.mark.parametrize(
    ("pasted", "first"),
    [
        ("bash: ros2: command not found", "command-not-found"),
        ("Package 'lab2' not found", "package-not-found"),
        ("No executable found", "no-executable-found"),
        (
            "[ERROR] [launch]: Caught exception in launch (see debug for traceback): executable 'numeric_talker' "
            "not found on the libexec directory '/home/me/ros2_ws/install/lab2/lib/lab2'",
            "executable-not-found-by-launch",
        ),
        (
            "file 'numeric_chatter.py' was not found in the share directory of package 'lab2' which is at '/home/me'",
            "launch-file-not-found",
        ),
        ("Traceback …\nModuleNotFoundError: No module named 'lab2.numeric_talkr'", "module-not-found"),
        ("ModuleNotFoundError: No module named 'rclpy'", "no-rclpy"),
        ("git@github.com: Permission denied (publickey).\nfatal: Could not read", "permission-denied"),
        ("Assertion `PyLong_Check(field)' failed.\nAborted (core dumped)", "node-dies-with-assertion"),
        ("TypeError: Expected <class 'std_msgs.msg._string.String'>, got <class 'x'>", "expected-got-other-type"),
        ("Cannot echo topic '/numeric_chatter', as it contains more than one type: [..]", "cannot-echo-two-types"),
        ("AttributeError: property 'publishers' of 'NumericTalker' object has no setter", "no-setter"),
        ("data: -128", "jumps-to-minus-128"),
        ("my numbers jump to -128", "jumps-to-minus-128"),
        ("Hello World of someone else", "someone-else"),
        ("127 never appears", "never-127"),
        ("tab completion", "tab-completion"),
        ("nothing under ros2 launch", "print-under-launch"),
        ("empty folder on GitHub", "empty-folder-on-github"),
    ],
)
def test_a_pasted_error_finds_its_row(page: Any, pasted: str, first: str) -> None:
    page.locator("#symptom-search").fill(pasted)
    shown = page.locator("#symptoms article:not([hidden])")
    assert shown.first.get_attribute("id") == f"symptom-{first}"
    assert shown.count() <= 10
    assert "fit" in page.locator("#symptom-count").inner_text()


def test_the_search_can_find_nothing_and_be_cleared(page: Any) -> None:
    page.locator("#symptom-search").fill("xyzzy plugh")
    assert page.locator("#symptoms article:not([hidden])").count() == 0
    assert "No row fits" in page.locator("#symptom-count").inner_text()
    page.locator("#symptom-clear").focus()
    page.keyboard.press("Enter")
    assert page.locator("#symptoms article:not([hidden])").count() == len(lab.symptoms())
    assert page.evaluate("document.activeElement.id") == "symptom-search"


def test_a_link_to_a_row_shows_it_whatever_was_searched(page: Any) -> None:
    page.locator("#symptom-search").fill("publickey")
    page.evaluate("location.hash = '#symptom-someone-else'")
    page.locator("#symptom-someone-else").wait_for(state="visible")


def test_copying_takes_the_commands_and_nothing_else(browser: Any, files: dict[str, Path]) -> None:
    opened = Opened(browser, files["student"], permissions=["clipboard-read", "clipboard-write"])
    page = opened.page
    button = page.locator("figure.commands", has_text="colcon build").first.locator("button")
    button.focus()
    page.keyboard.press("Enter")
    page.get_by_text("Copied", exact=True).first.wait_for()
    expected = "\n".join(commands()[key].run for key in ("to-workspace", "build"))
    assert page.evaluate("navigator.clipboard.readText()") == expected
    assert "Copied" in page.locator("#announce").inner_text()
    assert page.locator("figure.commands button").count() == page.locator("figure.commands").count()
    opened.close()


def test_line_numbers_and_prompts_are_not_selected(page: Any) -> None:
    text = page.evaluate(
        """() => { const range = document.createRange();
        range.selectNodeContents(document.querySelector('.listing pre'));
        getSelection().removeAllRanges(); getSelection().addRange(range); return getSelection().toString(); }"""
    )
    assert text.startswith('"""A node')
    assert "\n2" not in text


def test_without_scripts_everything_can_be_read(browser: Any, files: dict[str, Path]) -> None:
    opened = Opened(browser, files["student"], java_script_enabled=False)
    page = opened.page
    assert page.locator(".search").is_hidden() and page.locator(".progress").is_hidden()
    assert page.locator("noscript").first.is_visible()
    for summary in page.locator("#question-period summary, section.task .hint > summary").all()[:2]:
        summary.click()
    assert page.locator("#question-period .reasons li").first.is_visible()
    assert page.locator("section.task .hint-text").first.is_visible()
    assert page.locator("#symptoms article").count() == len(lab.symptoms())
    assert page.locator("figure.commands button").count() == 0
    opened.close()


def test_on_paper_everything_folded_is_open(browser: Any, files: dict[str, Path]) -> None:
    opened = Opened(browser, files["student"])
    page = opened.page
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("main details:not([open])").count() == 0
    assert page.locator(".contents").is_hidden() and page.locator(".search").is_hidden()
    assert page.locator("main button:visible").count() == 0
    assert len(page.pdf()) > 50_000
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator("section.task details[open]").count() == 0
    opened.close()


def test_the_keyboard_reaches_the_content_first(page: Any) -> None:
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    page.keyboard.press("Enter")
    page.wait_for_function("document.activeElement.id === 'content'")


def test_the_contents_say_where_one_is(page: Any) -> None:
    page.locator("#section-6-5").evaluate("element => element.scrollIntoView({behavior: 'instant'})")
    page.wait_for_function("document.querySelector('.contents [aria-current]').hash === '#section-6-5'")
