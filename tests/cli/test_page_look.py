"""The report's page in a real browser: nothing of it is cut off, however wide the window is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from support.browser import browser, needs_browser, page_at

from firable.cli.main import main

CELLS = {"one_robot": (), "two_cells": (), "long_names": ("--faults", "--wrong")}
"""The cells, and what is asked of the protocol of each: for every section, of one with long names and few markings."""
LONG_NAMES = """\
firable: 1
cell: long-names
controllers:
  coordinator_of_the_line:
    coordinator: true
  coordinator_of_the_cell:
    under: coordinator_of_the_line
  robot_of_the_cell:
    under: coordinator_of_the_cell
    start: [holding_a_workpiece]
    places: {holding_a_workpiece: {}, empty_handed: {}}
  lathe_of_the_cell:
    under: coordinator_of_the_cell
    start: [empty_and_open]
    places: {empty_and_open: {}, full_and_closed: {}}
transitions:
  hand_over_to_the_lathe:
    from: [robot_of_the_cell.holding_a_workpiece, lathe_of_the_cell.empty_and_open]
    to: [robot_of_the_cell.empty_handed, lathe_of_the_cell.full_and_closed]
  fetch_the_next_workpiece: {from: robot_of_the_cell.empty_handed, to: robot_of_the_cell.holding_a_workpiece}
  take_out_of_the_lathe: {from: lathe_of_the_cell.full_and_closed, to: lathe_of_the_cell.empty_and_open}
"""
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
    found, folder = {}, tmp_path_factory.mktemp("look")
    (folder / "long_names.firable.yaml").write_text(LONG_NAMES, "utf-8")
    for name, asked in CELLS.items():
        net = str(folder / "long_names.firable.yaml") if name == "long_names" else f"catalogue:{name}"
        page = folder / f"{name}.html"
        assert main(["prove", net, *asked, "--report", str(page)]) == 0
        found[name] = page.as_uri()
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
def test_what_is_told_of_transitions_with_long_names_is_not_cut_off(chromium: Browser, tmp_path: Path) -> None:
    net, page = tmp_path / "net.firable.yaml", tmp_path / "page.html"
    one, other = "lathe_takes_the_next_workpiece_from_the_robot", "lathe_gives_the_workpiece_back_to_the_conveyor"
    inputs = "from: robot_of_the_cell.holding_a_workpiece, to: robot_of_the_cell.empty_handed"
    again = LONG_NAMES.replace("transitions:", f"transitions:\n  {one}: {{{inputs}}}\n  {other}: {{{inputs}}}")
    net.write_text(again, "utf-8")
    main(["check", str(net), "--report", str(page), "--no-cache"])
    with page_at(chromium, page.as_uri(), viewport={"width": 360, "height": 900}) as shown:
        needed, there = shown.evaluate(WINDOW)
        assert needed <= there


@needs_browser
def test_a_link_leads_to_a_heading_that_the_links_do_not_cover(chromium: Browser, pages: dict[str, str]) -> None:
    with page_at(chromium, pages["two_cells"], viewport={"width": 1000, "height": 900}) as page:
        page.locator("nav a", has_text="Arbitration").click()
        heading, links = page.locator("#groups h2").bounding_box(), page.locator("nav").bounding_box()
        assert heading is not None
        assert links is not None
        assert heading["y"] >= links["y"] + links["height"]
