"""The page and names as long as engineers give them: nothing of it runs out of its panel, or over its neighbour."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import pytest
from playwright.sync_api import Browser, Page, expect
from support.browser import PATIENCE_MS, browser, command, needs_browser, page_at

expect.set_options(timeout=PATIENCE_MS)

START = "stacking_robot_starts_for_the_crate_under_the_scanner"
NET = f"""\
firable: 1
cell: long
description: two robots take crates from the infeed and stack them, and what the scanner cannot read gets another label
controllers:
  stacking_robot_with_vacuum_gripper:
    start: home
    inputs: [crate_seen_by_the_second_scanner_of_the_line]
    places:
      home:
      taking_the_crate_from_the_scanner: {{send: {{machine: ROBOT_STACKING, command: GO, to: BELT}}, until: arrived}}
transitions:
  {START}:
    from: stacking_robot_with_vacuum_gripper.home
    to: stacking_robot_with_vacuum_gripper.taking_the_crate_from_the_scanner
    if: stacking_robot_with_vacuum_gripper.crate_seen_by_the_second_scanner_of_the_line
    description: the crate was read
  back:
    from: stacking_robot_with_vacuum_gripper.taking_the_crate_from_the_scanner
    to: stacking_robot_with_vacuum_gripper.home
"""
PLANT = """\
firable_plant: 1
plant: long
stations: [belt_entry_from_hall_three, scanner_at_end_of_infeed, table_with_label_printer, outfeed_to_warehouse_lift]
arrivals: {station: belt_entry_from_hall_three, every_s: 9}
departures: {station: outfeed_to_warehouse_lift}
machines:
  ROBOT_STACKING:
    hand: HOME
    positions: {HOME: , BELT: scanner_at_end_of_infeed, OUT: outfeed_to_warehouse_lift}
    commands: {GO: {does: move, takes_s: 1}}
  ROBOT_REWORKING:
    hand: HOME
    positions: {HOME: , BELT: scanner_at_end_of_infeed, OUT: outfeed_to_warehouse_lift}
    commands: {GO: {does: move, takes_s: 1}}
  INFEED_CONVEYOR_FROM_HALL_THREE:
    commands: {RUN: {does: carry, from: belt_entry_from_hall_three, to: scanner_at_end_of_infeed, takes_s: 1}}
  LABEL_PRINTER_LEFT: {commands: {GO: {does: work, takes_s: 1}}}
  LABEL_PRINTER_RIGHT: {commands: {GO: {does: work, takes_s: 1}}}
sensors:
  stacking_robot_with_vacuum_gripper.crate_seen_by_the_second_scanner_of_the_line: {occupied: scanner_at_end_of_infeed}
  stacking_robot_with_vacuum_gripper.arrived: {occupied: outfeed_to_warehouse_lift}
"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with browser() as made:
        yield made


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    path = tmp_path_factory.mktemp("names") / "long.firable.yaml"
    path.write_text(NET)
    path.with_name("long.plant.yaml").write_text(PLANT)
    with command("view", path, "--no-browser") as (shown, _):
        yield shown


def stays_inside(page: Page) -> None:
    """Nothing in the panels beside the picture stands out of them: what does is cut off, and scrolled to by nobody."""
    room = page.locator("aside").bounding_box()
    assert room is not None
    seen = page.locator("aside *").evaluate_all("all => all.map((one) => one.getBoundingClientRect().right)")
    assert max(seen) <= room["x"] + room["width"]


@needs_browser
@pytest.mark.parametrize("width", [380, 1280])
def test_long_names_stay_in_their_panels(chromium: Browser, address: str, width: int) -> None:
    with page_at(chromium, address, viewport={"width": width, "height": 800}) as page:
        stays_inside(page)
        page.get_by_role("switch", name="Gates free").click()
        expect(page.locator(f"[data-transition={START}]")).to_be_visible()
        stays_inside(page)
        page.get_by_role("button", name="Edit", exact=True).click()
        page.get_by_label("Chosen").select_option(f"transition:{START}")
        expect(page.get_by_role("button", name="Rename")).to_be_visible()
        stays_inside(page)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@needs_browser
@pytest.mark.parametrize("size", [(1280, 800), (1000, 480)])
def test_a_wide_window_is_filled_and_not_scrolled(chromium: Browser, address: str, size: tuple[int, int]) -> None:
    with page_at(chromium, address, viewport={"width": size[0], "height": size[1]}) as page:
        expect(page.locator(".picture .drawing-note")).to_be_hidden()
        assert page.evaluate("document.documentElement.scrollHeight") == size[1]
        boxes = [page.locator(one).bounding_box() for one in ("header", ".stage", "aside")]
        head, *below = [box for box in boxes if box is not None]
        assert len(below) == 2
        for box in below:
            assert abs(box["y"] - head["height"]) < 1
            assert abs(box["y"] + box["height"] - size[1]) < 1


@needs_browser
def test_long_names_stand_apart_in_the_top_view_and_are_told_whole(chromium: Browser, address: str) -> None:
    with page_at(chromium, address) as page:
        page.get_by_role("tab", name="Top view").click()
        top = page.get_by_role("tabpanel", name="Top view")
        boxes = top.locator("svg text").evaluate_all(
            """all => all.filter((one) => one.textContent).map((one) => {
                const { left, right, top, bottom } = one.getBoundingClientRect();
                return [left, right, top, bottom];
            })"""
        )
        assert len(boxes) == 9
        for (a, b, c, d), (e, f, g, i) in combinations(boxes, 2):
            assert b <= e or f <= a or d <= g or i <= c
        expect(top.locator("[data-machine=LABEL_PRINTER_LEFT] title")).to_have_text("LABEL_PRINTER_LEFT")
        expect(top).to_contain_text("LABEL_PRINTER_RIGHT: at rest")
