"""Pages in a real browser, driven by Playwright: what a person who opens one can do with it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import find_browser, needs_browser
from fake_analysis import CASES, fake_analysis, fake_closed
from fake_study import fake_study

from bayeshaptic.report import write, write_report
from bayeshaptic.report.study.write import write_study_report
from bayeshaptic.report.walls.section import table_of

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
pytestmark = needs_browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=find_browser(), args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module", params=["explained", "refused", "study"])
def page(request: pytest.FixtureRequest, browser: Any, tmp_path_factory: Any) -> Iterator[Any]:
    """A page of each kind on a phone, with what the browser complained of."""
    folder = tmp_path_factory.mktemp(request.param)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "table_of", lambda cases: table_of(cases, draws=200))
        path = _written(request.param, folder)
    opened = browser.new_page(viewport={"width": 390, "height": 800})
    opened.complaints = []
    opened.on("console", lambda said: opened.complaints.append(said.text))
    opened.on("pageerror", lambda error: opened.complaints.append(str(error)))
    opened.goto(path.as_uri())
    yield opened
    opened.close()


def _written(kind: str, folder: Path) -> Path:
    if kind == "study":
        return write_study_report(fake_study(people=2, free=1), folder, walls=False)
    return write_report(
        fake_closed() if kind == "explained" else fake_analysis(**CASES["amperes"]), folder
    )


def test_nothing_is_complained_of_and_nothing_leads_nowhere(page: Any) -> None:
    folder = Path(page.evaluate("decodeURIComponent(location.pathname)")).parent
    assert page.complaints == []
    for link in page.eval_on_selector_all("a", "all => all.map(a => a.getAttribute('href'))"):
        if link.startswith("#"):
            assert page.locator(f"[id='{link[1:]}']").count() == 1, link
        else:
            assert (folder / link).exists(), link
    assert (folder / "report.html").stat().st_size < 2e6


def test_headings_are_in_order_and_the_title_names_the_recording(page: Any) -> None:
    levels = page.eval_on_selector_all("h1, h2, h3", "all => all.map(h => +h.tagName[1])")
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(b <= a + 1 for a, b in zip(levels, levels[1:], strict=False))
    assert page.title().endswith(page.locator("h1").inner_text()) or "study" in page.title()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_it_and_everybody_can_read_it(page: Any, scheme: str) -> None:
    page.emulate_media(color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not here")
    page.eval_on_selector_all("details", "all => all.forEach(part => { part.open = true; })")
    found = axe.Axe().run(page).response["violations"]
    assert [(one["id"], one["nodes"][0]["html"][:120]) for one in found] == []


def test_a_figure_tells_its_values_and_switches(page: Any) -> None:
    plots = page.locator(".plot[data-readings]")
    for number in range(plots.count()):
        plot = plots.nth(number)
        plot.focus()
        page.keyboard.press("ArrowRight")
        assert re.search(r": .*\d", plot.locator(".tip").inner_text())
        page.keyboard.press("Escape")
        assert plot.locator(".tip").is_hidden()
    for group in page.locator(".switch").all():
        figure = group.locator("xpath=ancestor::figure")
        group.get_by_text("before").click()
        assert figure.locator("svg .before").first.evaluate("e => e.style.display") == ""
        assert figure.locator("svg .after").first.evaluate("e => e.style.display") == "none"
    if "study" not in page.title():
        assert plots.count() >= (3 if page.locator("#walls").count() else 1)


def test_a_table_sorts(page: Any) -> None:
    table = page.locator("table.sortable:visible").first
    button = table.locator("thead button").first
    cells = table.locator("tbody tr > :first-child")
    button.click()
    once = cells.all_inner_texts()
    assert once == sorted(once, key=str.lower)
    button.click()
    assert cells.all_inner_texts() == once[::-1]
