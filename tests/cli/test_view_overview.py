"""A large net on the page: its overview, and some of its controllers opened."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, Route, expect
from support.browser import PATIENCE_MS, browser, command, needs_browser, page_at

from firable.cli.main import main
from firable.cli.options import load_net
from firable.cli.view.drawing import AT_ONCE_MAX, KEPT_MAX, Look, Pictures
from firable.cli.view.editing import editing_of
from firable.cli.view.playing import Playing
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.diagnostics import InputError
from firable.nets.drawing import NODES_MAX
from firable.nets.net import Net, Place
from firable.semantics.trace import Discipline, Trace

expect.set_options(timeout=PATIENCE_MS)

LARGE = "catalogue:manufacturing_cells-80"
"""It is too large to be drawn whole."""
TABLE = "catalogue:philosophers-30"
"""It is drawn whole where that is asked for, and deadlocks."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with browser() as made:
        yield made


@pytest.fixture(scope="module")
def large() -> Iterator[str]:
    with command("view", LARGE, "--no-browser") as (address, _):
        yield address


@pytest.fixture(scope="module")
def table() -> Iterator[str]:
    with command("view", TABLE, "--no-browser") as (address, _):
        yield address


def drawn(out: Path, *arguments: str) -> str:
    """A picture that `firable draw` writes, without its tokens: on the page these come and go."""
    assert main(["draw", *arguments, "-o", str(out)]) == 0
    return out.read_text("utf-8")


def plain(picture: str) -> str:
    return re.sub(r'<circle class="token"[^>]* r="5\.5"/>\n|(?<=class="held")[^<]*', "", picture)


def answer(pictures: Pictures, **how: object) -> dict[str, Any]:
    return asyncio.run(pictures.picture(how))


def test_a_large_net_begins_with_its_overview_and_opens_what_draw_draws(tmp_path: Path) -> None:
    pictures = Pictures(family_net("manufacturing_cells-80"), Look())
    first = answer(pictures)
    assert (first["opened"], first["members"], first["foldable"], first["whole"]) == ([], {}, [], False)
    assert plain(first["picture"]) == plain(drawn(tmp_path / "overview.svg", LARGE, "--what", "overview"))
    some = answer(pictures, opened=["s9", "r4"])
    assert some["opened"] == [owner for owner in first["owners"] if owner in {"s9", "r4"}]
    controllers = ("--controller", "r4", "--controller", "s9")
    assert plain(some["picture"]) == plain(drawn(tmp_path / "some.svg", LARGE, *controllers))
    assert {name.split(".")[0] for name in some["foldable"]} <= {"s9", "r4"}


def test_a_small_net_begins_whole_and_a_command_says_what_a_net_begins_with() -> None:
    small = Pictures(catalogue_net("two_cells"), Look())
    assert answer(small)["opened"] == answer(small)["owners"] == answer(small, opened=small.owners)["opened"]
    assert len(small.net.places) + len(small.net.transitions) <= AT_ONCE_MAX
    look = Look(folded=("robot_a", "robot_b"), opened=("robot_b", "gone"))
    told = answer(Pictures(catalogue_net("two_cells"), look))
    assert told["opened"] == ["robot_b"]
    assert {name.split(".")[0] for name in told["members"]} == {"robot_b"}, "what is not drawn is not folded"
    assert answer(Pictures(catalogue_net("two_cells"), Look(opened=("gone",))))["opened"] == small.owners


def test_of_a_net_of_one_controller_the_whole_is_drawn_and_no_overview_is_offered() -> None:
    pictures = Pictures(family_net("counter-100"), Look())  # 201 places and transitions
    assert (answer(pictures)["opened"], answer(pictures)["owners"]) == (["counter"], [])
    opened: list[str] | None
    for opened in (None, []):
        empty = answer(Pictures(Net("empty"), Look()), opened=opened)
        assert (empty["opened"], empty["owners"]) == ([], [])
        assert empty["picture"].startswith("<svg")


def test_what_nobody_owns_is_opened_like_a_controller() -> None:
    net = catalogue_net("two_cells")
    mixed = Net("mixed", (*net.places, Place("loose")), net.transitions, net.signals, net.controllers)
    assert 'id="place:loose"' in answer(Pictures(mixed, Look()), opened=[None])["picture"]


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("two_cells", ["robot_c"], "a controller that the net has not"),
        ("two_cells", [[]], "a controller that the net has not"),
        ("two_cells", "robot_a", "a controller that the net has not"),
        ("counter-5", [], "an overview, and the net has none"),
        ("manufacturing_cells-80", None, "make no picture that anybody can read"),
    ],
)
def test_what_cannot_be_opened_is_refused(name: str, wrong: object, words: str) -> None:
    pictures = Pictures(catalogue_net(name), Look())
    asked = pictures.owners if wrong is None else wrong
    with pytest.raises(InputError, match="F5070") as refused:
        answer(pictures, opened=asked)
    assert words in refused.value.diagnostics[0].message


def test_each_choice_of_controllers_is_drawn_once_and_the_last_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = Pictures(family_net("manufacturing_cells-80"), Look())
    made: list[object] = []

    def draw(_: object, opened: object) -> str:
        made.append(opened)
        return str(opened)

    monkeypatch.setattr(pictures, "_drawn", draw)
    for _ in range(2):
        assert answer(pictures, opened=["r2", "r1"])["picture"] == "('r1', 'r2')"
        assert answer(pictures)["picture"] == "()"
    assert made == [("r1", "r2"), ()]
    for owner in pictures.owners[: KEPT_MAX + 1]:
        answer(pictures, opened=[owner])
    assert len(pictures.kept) == KEPT_MAX


def test_a_net_that_is_too_large_to_be_drawn_whole_is_edited(tmp_path: Path) -> None:
    path = tmp_path / "large.firable.yaml"
    assert main(["convert", LARGE, "-o", str(path)]) == 0
    loaded = load_net(str(path))
    assert len(loaded.net.places) + len(loaded.net.transitions) > NODES_MAX
    editing = editing_of(Playing(loaded, str(path)), str(path), read_only=False)
    version = asyncio.run(editing.state({}))["version"]
    edit = {"do": "describe", "kind": "place", "name": loaded.net.places[0].name, "words": "seen", "version": version}
    told = asyncio.run(editing.edit(edit))
    assert told["page"]["net"]["places"][0]["says"] == "seen"
    assert "seen" in path.read_text("utf-8")


def held(page: Page, controller: str) -> Any:
    return expect(page.locator(f'[id="held:{controller}"]'))


@needs_browser
def test_a_controller_is_opened_by_a_click_and_others_beside_it(chromium: Browser, large: str) -> None:
    with page_at(chromium, large) as page:
        lanes, close = page.locator('[id^="lane:"]'), page.get_by_role("button", name="Close r4")
        page.locator('[id="controller:r4"] .name').click()
        expect(lanes).to_have_count(1)
        expect(page.locator("#said")).to_have_text("Drawn: r4.")
        choice = page.get_by_label("Open a controller")
        expect(choice.locator("optgroup").first).to_have_attribute("label", "share transitions")
        expect(choice.locator("optgroup").first.locator("option")).to_have_text(["s6", "s7", "s8"])
        choice.focus()
        choice.select_option(label="s7")
        expect(lanes).to_have_count(2)
        expect(choice).to_be_focused()
        page.reload()
        expect(lanes).to_have_count(2)
        close.click()
        expect(lanes).to_have_count(1)
        expect(close).to_have_count(0)
        expect(page.get_by_role("button", name="Whole net")).to_be_hidden()
        page.get_by_role("button", name="Overview").click()
        expect(page.locator('[id="controller:r4"]')).to_be_visible()
        expect(page.get_by_role("button", name="Overview")).to_be_hidden()
        expect(page.get_by_role("button", name="Fold tasks")).to_be_hidden()


@needs_browser
def test_the_last_controller_that_is_closed_leaves_the_overview(chromium: Browser, table: str) -> None:
    with page_at(chromium, table) as page:
        page.locator('[id="controller:p3"] .name').click()
        page.get_by_role("button", name="Close p3").click()
        expect(page.locator('[id="controller:p3"]')).to_be_visible()
        page.get_by_role("button", name="Whole net").click()
        expect(page.locator('[id^="lane:"]')).to_have_count(30)
        expect(page.get_by_role("group", name="Controllers that are drawn")).to_be_hidden()


@needs_browser
def test_an_overview_is_played_and_says_where_the_tokens_are(chromium: Browser, table: str) -> None:
    with page_at(chromium, table) as page:
        held(page, "p1").to_have_text("thinking +1")
        expect(page.locator('[id="controller:p1"]')).to_have_attribute("aria-label", "p1, tokens on thinking, fork")
        page.get_by_role("switch", name="Gates free").click()
        page.locator("[data-transition=p1_takes_left]").click()
        held(page, "p1").to_have_text("left")
        expect(page.locator('[id="transition:p1_takes_right"]')).to_contain_class("may-fire")
        page.locator('[id="transition:p1_takes_right"] rect.hit').first.click()
        held(page, "p1").to_have_text("eating")
        held(page, "p2").to_have_text("thinking")
        expect(page.locator(".picture svg")).not_to_contain_class("passing")


@needs_browser
def test_who_points_at_a_controller_sees_with_whom_it_shares_what(chromium: Browser, table: str) -> None:
    with page_at(chromium, table) as page:
        beside = page.locator(".beside")
        page.locator('[id="controller:p4"] .name').hover()
        expect(beside).to_have_count(7)
        ids = beside.evaluate_all("all => all.map(one => one.id).sort()")
        assert ids == [
            *(f"controller:p{i}" for i in (3, 4, 5)),
            *(f"transition:p{i}_{what}" for i in (3, 4) for what in ("gives", "takes_right")),
        ]
        page.locator('[id="transition:p3_gives"] rect.hit').first.hover()
        expect(beside).to_have_count(2)
        page.locator("h1").hover()
        expect(beside).to_have_count(0)


@needs_browser
def test_what_is_chosen_to_be_edited_has_its_controller_opened(chromium: Browser, tmp_path: Path) -> None:
    path = tmp_path / "large.firable.yaml"
    assert main(["convert", LARGE, "-o", str(path)]) == 0
    with command("view", path, "--no-browser") as (address, _), page_at(chromium, address) as page:
        page.get_by_role("button", name="Edit").click()
        page.locator('[id="transition:s2_load"] rect.hit').first.click()
        expect(page.get_by_label("Chosen")).to_have_value(re.compile("s2_load"))
        expect(page.locator('[id="controller:r1"]')).to_be_visible()  # what is shared is in sight there
        page.get_by_label("Chosen").select_option(label="r4.free")
        expect(page.locator('[id="place:r4.free"]')).to_contain_class("chosen")
        chosen = page.locator(".panel").filter(has=page.get_by_role("heading", name="Chosen"))
        chosen.get_by_label("Name").fill("idle")
        page.keyboard.press("Enter")
        expect(page.locator('[id="place:r4.idle"]')).to_contain_class("chosen")
        expect(page.locator('[id^="lane:"]')).to_have_count(1)


@needs_browser
def test_what_a_run_passes_through_stands_out_and_is_opened(chromium: Browser, tmp_path: Path) -> None:
    trace = tmp_path / "run.trace.jsonl"
    fired = [("p4_takes_left",), ("p4_takes_right",), ("p4_gives",)]
    with trace.open("w", encoding="utf-8") as stream:
        Trace.of_firings(load_net(TABLE).net, fired, Discipline.INTERLEAVING).write(stream)
    with command("view", TABLE, "--trace", trace, "--no-browser") as (address, _), page_at(chromium, address) as page:
        page.get_by_role("button", name="▶ Play").click()
        expect(page.locator(".picture svg")).to_contain_class("passing")
        passed = page.locator(".passed")
        expect(passed).to_have_count(4)
        ids = passed.evaluate_all("all => all.map(one => one.id).sort()")
        assert ids == ["controller:p4", "controller:p5", "transition:p4_gives", "transition:p4_takes_right"]
        page.keyboard.press("ArrowRight")
        held(page, "p4").to_have_text("left")
        page.get_by_role("button", name="Open its controllers").click()
        expect(page.locator('[id^="lane:"]')).to_have_count(2)
        expect(page.locator('[id="place:p4.left"] .live')).to_contain_class("there")
        expect(page.locator(".picture svg")).not_to_contain_class("passing")
        page.get_by_role("button", name="Overview").click()
        expect(passed).to_have_count(4)
        page.locator(".playback").get_by_role("button", name="Close").click()
        expect(passed).to_have_count(0)


@needs_browser
def test_a_run_that_is_asked_for_before_the_net_is_drawn_opens_its_controllers_too(
    chromium: Browser, tmp_path: Path
) -> None:
    trace, waiting = tmp_path / "run.trace.jsonl", list[Route]()
    with trace.open("w", encoding="utf-8") as stream:
        Trace.of_firings(load_net(TABLE).net, [("p4_takes_left",)], Discipline.INTERLEAVING).write(stream)
    with command("view", TABLE, "--trace", trace, "--no-browser") as (address, _), page_at(chromium, address) as page:
        page.route("**/api/picture", lambda route: waiting.append(route))
        with page.expect_response("**/api/run"), page.expect_request("**/api/picture"):
            page.reload()
            page.get_by_role("button", name="▶ Play").click()
        for route in waiting:
            route.continue_()
        expect(page.get_by_role("button", name="Open its controllers")).to_be_visible()


@needs_browser
def test_what_cannot_be_drawn_is_said_and_what_was_drawn_stays(chromium: Browser, large: str) -> None:
    with page_at(chromium, large) as page:
        page.locator('[id="controller:r4"]').wait_for()
        page.route("**/api/picture", lambda route: route.continue_(post_data='{"opened": ["no such"]}'))
        page.locator('[id="controller:r4"] .name').click()
        note = page.locator(".drawing-note")
        expect(note).to_contain_text("This cannot be drawn: the page asks for a controller that the net has not")
        expect(page.locator('[id="controller:r4"]')).to_be_visible()
        note.get_by_role("button", name="Close").click()
        expect(note).to_be_empty()
