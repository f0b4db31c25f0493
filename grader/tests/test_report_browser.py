"""The page in a real Chromium, from a file and with the network off: axe-core, keyboard, phone, print."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
AXE = ROOT / "worksheet" / "tests" / "node_modules" / "axe-core" / "axe.min.js"  # one installation for both
PHONE, DESKTOP = {"width": 390, "height": 844}, {"width": 1280, "height": 900}
NAMES = ("perfect", "middling", "broken")
STANDARDS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


@pytest.fixture
def show(browser: Any) -> Iterator[Any]:
    """Opens a page; afterwards, it must have asked for nothing but itself and complained of nothing."""
    contexts, asked, complaints, paths = [], [], [], []

    def open_page(path: Path, **settings: Any) -> Any:
        context = browser.new_context(offline=True, **{"viewport": DESKTOP, **settings})
        page = context.new_page()
        page.on("request", lambda request: asked.append(request.url))
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(path.as_uri())
        contexts.append(context)
        paths.append(path.as_uri())
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert complaints == []
    assert set(asked) <= set(paths)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [PHONE, DESKTOP], ids=["phone", "desktop"])
@pytest.mark.parametrize("edition", ["report.html", "staff.html"])
def test_axe_finds_nothing(samples: dict[str, Path], show: Any, scheme: str, viewport: Any, edition: str) -> None:
    if not AXE.exists():
        pytest.skip("axe-core is not installed (npm ci --prefix worksheet/tests)")
    for name in NAMES:
        page = show(samples[name] / edition, color_scheme=scheme, viewport=viewport, bypass_csp=True)
        page.evaluate("() => document.querySelectorAll('details').forEach(found => { found.open = true })")
        page.evaluate(AXE.read_text())
        found = page.evaluate("tags => axe.run({ runOnly: { type: 'tag', values: tags } })", STANDARDS)
        assert [(item["id"], item["nodes"][0]["html"]) for item in found["violations"]] == []


@pytest.mark.parametrize("viewport", [{"width": 320, "height": 700}, PHONE, DESKTOP], ids=["320", "phone", "desktop"])
def test_nothing_is_wider_than_the_page(samples: dict[str, Path], show: Any, viewport: Any) -> None:
    for name in NAMES:
        page = show(samples[name] / "report.html", viewport=viewport)
        page.evaluate("() => document.querySelectorAll('details').forEach(found => { found.open = true })")
        assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]


def test_it_can_be_read_with_the_keyboard_alone(samples: dict[str, Path], show: Any) -> None:
    page = show(samples["middling"] / "report.html")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    seen = []
    for _ in range(200):
        page.keyboard.press("Tab")
        name = page.evaluate("document.activeElement.tagName")
        if name == "SUMMARY":
            page.keyboard.press("Enter")
            seen.append(page.evaluate("document.activeElement.parentElement.open"))
            assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none"
            page.keyboard.press("Enter")
        if name == "BODY":
            break
    assert len(seen) > 10 and all(seen)


def test_one_picture_of_two_is_shown_and_has_words(samples: dict[str, Path], show: Any) -> None:
    for viewport in (PHONE, DESKTOP):
        page = show(samples["middling"] / "report.html", viewport=viewport)
        shown = page.locator("svg[role=img]:visible")
        assert shown.count() == 4  # the numbers, the graph as asked and as seen, the timeline
        for index in range(shown.count()):
            assert len(shown.nth(index).locator("desc").text_content()) > 40


def test_a_link_into_something_folded_opens_it(samples: dict[str, Path], show: Any) -> None:
    page = show(samples["middling"] / "report.html")
    link = page.locator(".waiting a").first
    target = page.locator(link.get_attribute("href"))
    link.click()
    assert target.is_visible()


def test_everything_folded_is_printed(samples: dict[str, Path], show: Any) -> None:
    page = show(samples["middling"] / "report.html")
    closed = page.locator("details:not([open]) pre").first
    assert not closed.is_visible()
    page.emulate_media(media="print")
    assert closed.bounding_box()["height"] > 0
    assert page.pdf().startswith(b"%PDF")
