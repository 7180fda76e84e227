"""The report's page in a real browser: nothing of it is cut off, however wide the window is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from support.browser import browser, needs_browser, page_at

from firable.cli.main import main

CELLS = {"one_robot": (), "two_cells": ("--faults", "--wrong")}
"""The cells, and what is asked of the protocol of each: of the wide one for every section, of the other for none."""
WINDOW = "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"
CUT_OFF = """() => [...document.querySelectorAll('nav a')].map(link => link.getBoundingClientRect())
    .filter(box => box.left < 0 || box.right > innerWidth).length"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with browser() as made:
        yield made


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The page of each cell."""
    found = {}
    for name, asked in CELLS.items():
        page = tmp_path_factory.mktemp("look") / f"{name}.html"
        assert main(["prove", f"catalogue:{name}", *asked, "--report", str(page)]) == 0
        found[name] = Path(page).as_uri()
    return found


@needs_browser
@pytest.mark.parametrize("look", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 600, 360])
@pytest.mark.parametrize("name", CELLS)
def test_the_window_shows_the_whole_width_and_every_link(
    chromium: Browser, pages: dict[str, str], name: str, width: int, look: str
) -> None:
    with page_at(chromium, pages[name], viewport={"width": width, "height": 900}, color_scheme=look) as page:
        for open_ in ("false", "true"):
            page.evaluate(f"document.querySelectorAll('details').forEach(one => {{ one.open = {open_} }})")
            needed, there = page.evaluate(WINDOW)
            assert needed <= there
        assert page.evaluate(CUT_OFF) == 0


@needs_browser
def test_a_link_leads_to_a_heading_that_the_links_do_not_cover(chromium: Browser, pages: dict[str, str]) -> None:
    with page_at(chromium, pages["two_cells"], viewport={"width": 1000, "height": 900}) as page:
        page.locator("nav a", has_text="Arbitration").click()
        heading, links = page.locator("#groups h2").bounding_box(), page.locator("nav").bounding_box()
        assert heading is not None
        assert links is not None
        assert heading["y"] >= links["y"] + links["height"]
