"""The picture on the page: that of `firable draw`, asked for apart from the page, with tasks folded."""

from __future__ import annotations

import asyncio
import json
import re
import urllib.request
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route, expect
from support.browser import PATIENCE_MS, browser, command, needs_browser, page_at

from firable.cli.main import main
from firable.cli.operate import _page
from firable.cli.options import load_net
from firable.cli.view.drawing import KEPT_MAX, Look, Pictures
from firable.cli.view.live import LivePage
from firable.cli.view.playing import Playing
from firable.decompose.splitting.cut import split
from firable.executor import Host
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.operating.recorder import Recorder
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError

expect.set_options(timeout=PATIENCE_MS)

WIDE = "catalogue:manufacturing_cells-14"
BELT = """\
firable: 1
cell: belt
controllers:
  robot:
    start: free
    places: {free: , busy: }
  belt:
    start: empty
    places: {empty: , full: }
transitions:
  take: {from: [robot.free, belt.full], to: [robot.busy, belt.empty]}
  done: {from: robot.busy, to: robot.free}
  bring: {from: belt.empty, to: belt.full}
"""
LAYOUT = """\
firable_layout: 1
lanes:
- owner: belt
  tracks: [[belt.full], [belt.empty]]
- owner: robot
  tracks: [[robot.busy], [robot.free]]
rows: [[done], [take], [bring]]
"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with browser() as made:
        yield made


@pytest.fixture(scope="module")
def one_robot() -> Iterator[str]:
    with command("view", "catalogue:one_robot", "--no-browser") as (address, _):
        yield address


def drawn(net: str, *options: str, out: Path) -> str:
    """The picture that `firable draw` writes, without its tokens: on the page these come and go."""
    assert main(["draw", net, *options, "-o", str(out)]) == 0
    return re.sub(r'<circle class="token"[^>]* r="5\.5"/>\n', "", out.read_text("utf-8")).rstrip("\n")


def asked(address: str) -> str:
    """The picture that the page gets."""
    base, _, token = address.partition("#token=")
    request = urllib.request.Request(f"{base}api/picture", b"{}", {"Authorization": f"Bearer {token}"})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return str(json.loads(answer.read())["picture"]).rstrip("\n")


def tokens(page: Page) -> set[str]:
    page.locator(".live").first.wait_for(state="attached")
    ids = page.locator(".live.there").evaluate_all("all => all.map(one => one.parentElement.id)")
    return {str(name).removeprefix("place:") for name in ids}


def test_the_picture_is_that_of_draw_by_the_same_layout_file_and_folding(tmp_path: Path) -> None:
    net = tmp_path / "cell.firable.yaml"
    net.write_text(BELT)
    free = drawn(str(net), out=tmp_path / "free.svg")
    (tmp_path / "cell.layout.yaml").write_text(LAYOUT)
    kept = drawn(str(net), out=tmp_path / "kept.svg")
    assert free != kept
    with command("view", net, "--no-browser") as (address, _):
        assert asked(address) == kept
    collapse = ("--collapse", "all")
    with command("view", "catalogue:one_robot", "--no-browser", *collapse) as (address, _):
        assert asked(address) == drawn("catalogue:one_robot", *collapse, out=tmp_path / "folded.svg")


def test_a_wide_net_is_wrapped_as_draw_wraps_it(tmp_path: Path) -> None:
    playing = Playing(load_net(WIDE), WIDE)
    picture = asyncio.run(playing.picture({}))["picture"].rstrip("\n")
    assert picture == drawn(WIDE, out=tmp_path / "wide.svg")
    assert 'transform="translate(0 ' in picture, "the net has panels below each other"


def test_a_layout_or_task_that_is_none_is_refused_before_anything_is_served(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net = tmp_path / "cell.firable.yaml"
    net.write_text(BELT)
    assert main(["view", str(net), "--collapse", "robto", "--no-browser"]) == 2
    assert "no place and no controller 'robto'; did you mean 'robot'" in capsys.readouterr().err
    (tmp_path / "cell.layout.yaml").write_text("firable_layout: 1\nlanes: 3\n")
    assert main(["view", str(net), "--no-browser"]) == 2
    assert "error[F1010]" in capsys.readouterr().err


def test_pictures_are_drawn_once_and_the_last_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    net = catalogue_net("one_robot")
    pictures = Pictures(net, Look(folded=("robot", "gone")))
    made: list[int] = []

    def draw(folded: Collection[str], _: object) -> str:
        made.append(len(folded))
        return str(made)

    monkeypatch.setattr(pictures, "_drawn", draw)
    assert len(pictures.foldable) > 3

    def picture(**how: object) -> str:
        return str(asyncio.run(pictures.picture(how))["picture"])

    assert picture() == picture() == picture(folded=list(pictures.at_first)) == "[2]"
    assert picture(folded=[]) != picture()
    some = [pictures.foldable[:1], pictures.foldable[1:2], pictures.foldable[2:3]]
    sets = [*some, *(one + two for one in some for two in some if one < two), [], *([] for _ in range(KEPT_MAX))]
    for one in sets:
        picture(folded=one)
    assert len(pictures.kept) <= KEPT_MAX
    wrong: object
    for wrong in (["robot.free"], ["no.place"], [[]], "all", 3):
        with pytest.raises(InputError, match="F5070"):
            picture(folded=wrong)


def test_after_an_edit_tasks_that_are_gone_are_folded_no_more() -> None:
    playing = Playing(load_net("catalogue:one_robot"), "", look=Look(folded=("robot",)))
    assert asyncio.run(playing.picture({}))["members"]
    playing.take(load_net("catalogue:philosophers-2"))
    assert asyncio.run(playing.picture({}))["members"] == {}


def test_the_page_of_a_run_follows_the_layout_beside_its_bundle_and_a_wrong_one_stops_no_cell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    decomposition = split(catalogue_net("one_robot"))
    kept = tmp_path / "cell.layout.yaml"

    def picture() -> str:
        host = Host(decomposition, DryRunDriver(decomposition.subnets, 0.0), Recorder(decomposition.net, "", None))
        page = _page(host, str(tmp_path / "cell.bundle"), None, None)
        assert isinstance(page, LivePage)
        return str(asyncio.run(page.pictures.picture({}))["picture"])

    free = picture()
    kept.write_text("firable_layout: 1\nlanes: [{owner: mc}, {owner: robot}, {owner: gone}]\n")
    assert picture() != free
    assert "warning[F1021]" in capsys.readouterr().err
    kept.write_text("firable_layout: 1\nlanes: 3\n")
    assert picture() == free
    assert "warning[F1010]" in capsys.readouterr().err


@needs_browser
def test_it_is_said_what_is_drawn_and_one_plays_meanwhile(chromium: Browser, one_robot: str) -> None:
    held: list[Route] = []
    with page_at(chromium, one_robot) as page:
        page.route("**/api/picture", lambda route: held.append(route))
        page.reload()
        net = catalogue_net("one_robot")
        said = f"Drawing one-robot: {len(net.places)} places and {len(net.transitions)} transitions…"
        expect(page.locator(".picture")).to_have_text(said)
        page.get_by_role("switch", name="Gates free").click()
        page.locator("[data-transition=G1]").click()
        expect(page.locator("#said")).to_contain_text("G1 has fired")
        held.pop().continue_()
        expect(page.locator('[id="place:system.carrying_in"] .live')).to_contain_class("there")
        expect(page.locator('[id="transition:G2"]')).to_contain_class("may-fire")
        expect(page.locator(".drawing-note")).to_be_empty()


@needs_browser
def test_a_picture_that_does_not_come_is_asked_for_again(chromium: Browser, one_robot: str) -> None:
    with page_at(chromium, one_robot) as page:
        page.route("**/api/picture", lambda route: route.abort())
        page.reload()
        expect(page.locator(".picture")).to_contain_text("The net cannot be drawn: the connection is lost.")
        page.unroute("**/api/picture")
        page.get_by_role("button", name="Try again").click()
        expect(page.locator('[id="place:robot.free"]')).to_be_visible()


@needs_browser
def test_tasks_are_folded_and_one_is_unfolded_by_the_keyboard(chromium: Browser, one_robot: str) -> None:
    with page_at(chromium, one_robot) as page:
        page.get_by_role("switch", name="Gates free").click()
        fold = page.get_by_role("button", name="Fold tasks")
        expect(fold).to_have_attribute("aria-pressed", "false")
        fold.click()
        expect(fold).to_have_attribute("aria-pressed", "true")
        expect(page.locator("#said")).to_contain_text("tasks folded")
        assert page.locator('[id="place:robot.grasp_cv1"]').count() == 0
        for name in ("G1", "G2", "t1-a"):
            page.locator(f"[data-transition={name}]").click()
        task = page.locator('[id="place:robot.to_cv1"]')
        expect(task.locator(".live")).to_contain_class("there")
        expect(task).to_have_attribute(
            "aria-label",
            "the task of robot.to_cv1, robot.grasp_cv1, robot.to_mc, robot.put_mc, robot.back, with a token",
        )
        task.focus()
        page.keyboard.press("Enter")
        expect(page.locator('[id="place:robot.grasp_cv1"] .live')).to_contain_class("there")
        assert "robot.to_cv1" not in tokens(page)
        expect(page.locator(".picture")).to_be_focused()
        fold.click()
        expect(fold).to_have_attribute("aria-pressed", "false")
        expect(page.locator(".macro")).to_have_count(0)


@needs_browser
def test_a_transition_in_two_panels_is_the_same_in_both(chromium: Browser) -> None:
    with command("view", WIDE, "--no-browser") as (address, _), page_at(chromium, address) as page:
        again = page.locator("g.transition[aria-hidden]").first
        expect(again).to_contain_class("may-not")
        name = str(again.get_attribute("id")).split(":")[1]
        again.locator("rect.hit").first.click()
        expect(page.locator(".hint")).to_contain_text(f"{name} waits for")
