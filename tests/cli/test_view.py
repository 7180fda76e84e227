"""The page in a browser: a net is played with, checked, and its counterexamples are played."""

from __future__ import annotations

import contextlib
import json
import math
import re
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, expect
from support.browser import PATIENCE_MS, browser, command, done, needs_browser, page_at

from firable.cli.main import main
from firable.cli.view.moment import Moment, fired, told
from firable.executor.drivers.far_side.ports import free_port
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.net import Net, Place, Transition
from firable.semantics.player import Player

expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with browser() as made:
        yield made


@pytest.fixture(scope="module")
def late() -> Iterator[str]:
    """The page of the cell that deadlocks."""
    with command("view", "catalogue:one_robot_mc_late", "--no-browser") as (address, _):
        yield address


def tokens(page: Page) -> set[str]:
    """The places that show a token."""
    page.locator(".live").first.wait_for(state="attached")
    ids = page.locator(".live.there").evaluate_all("all => all.map(one => one.parentElement.id)")
    return {str(name).removeprefix("place:") for name in ids}


def is_in_sight(page: Page, transition: str) -> bool:
    room = page.locator(".picture").bounding_box()
    bar = page.locator(f'[id="transition:{transition}"] rect.hit').first.bounding_box()
    assert room is not None
    assert bar is not None
    below, right = bar["y"] - room["y"], bar["x"] - room["x"]
    return 0 <= below <= room["height"] - bar["height"] and 0 <= right <= room["width"] - bar["width"]


def asked(address: str, path: str, body: object = None, token: str | None = None) -> tuple[int, Any]:
    base, _, own = address.partition("#token=")
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(f"{base}{path}", data)
    if (shown := own if token is None else token) != "":
        request.add_header("Authorization", f"Bearer {shown}")
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


@needs_browser
def test_a_click_fires_what_may_fire_and_a_switch_opens_a_gate(chromium: Browser, late: str) -> None:
    with page_at(chromium, late) as page:
        expect(page.locator("h1")).to_have_text("one-robot-mc-late")
        assert tokens(page) == {"robot.free", "mc.free", "conveyor.cv1", "conveyor.cv2"}
        assert "token" not in page.url, "the token does not stay in the address bar"
        bar = page.locator('[id="transition:G1"]')
        expect(bar).to_have_attribute("aria-label", "G1, start of carrying in, G1 waits for conveyor.part_at_entry")
        page.get_by_role("switch", name="conveyor.part_at_entry").click()
        expect(bar).to_have_attribute("aria-label", "G1, start of carrying in, may fire")
        expect(page.locator('[id="gate:G1:conveyor.part_at_entry"]')).to_contain_class("open")
        bar.locator("rect.hit").first.click()
        expect(page.locator("#said")).to_contain_text("G1 has fired. Sent: CV1 RUN.")
        assert tokens(page) == {"system.carrying_in", "conveyor.cv1_run", "robot.free", "mc.free", "conveyor.cv2"}


@needs_browser
def test_who_drags_the_picture_by_a_transition_does_not_fire_it(chromium: Browser, late: str) -> None:
    with page_at(chromium, late) as page:
        page.get_by_role("switch", name="Gates free").click()
        for _ in range(5):
            page.get_by_role("button", name="Larger").click()
        bar = page.locator('[id="transition:G1"] rect.hit').first
        expect(page.locator('[id="transition:G1"]').first).to_contain_class("may-fire")
        page.locator(".picture").evaluate("one => one.scrollTo(0, 0)")
        bar.scroll_into_view_if_needed()
        before, room = bar.bounding_box(), page.locator(".picture").bounding_box()
        assert before is not None
        assert room is not None
        x, y = max(before["x"], room["x"]) + 60, before["y"] + before["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x - 40, y - 20, steps=6)
        page.mouse.up()
        after = bar.bounding_box()
        assert after is not None
        assert before["x"] - after["x"] == pytest.approx(40, abs=2)
        assert before["y"] - after["y"] == pytest.approx(20, abs=2)
        expect(page.locator(".log li")).to_have_count(2)  # the initial marking, and the switch
        bar.click()
        expect(page.locator("#said")).to_contain_text("G1 has fired")


@needs_browser
def test_what_may_not_fire_says_and_shows_what_is_missing(chromium: Browser, late: str) -> None:
    with page_at(chromium, late) as page:
        page.locator('[id="transition:G6"] rect.hit').first.click()
        expect(page.locator(".hint")).to_contain_text(
            "G6 waits for a token on system.processing, a token on mc.release"
        )
        expect(page.locator('[id="place:mc.release"]')).to_contain_class("missing")
        assert tokens(page) == {"robot.free", "mc.free", "conveyor.cv1", "conveyor.cv2"}


@needs_browser
def test_steps_are_undone_done_again_and_reset_and_a_reload_keeps_them(chromium: Browser, late: str) -> None:
    begin = {"robot.free", "mc.free", "conveyor.cv1", "conveyor.cv2"}
    with page_at(chromium, late) as page:
        page.get_by_role("switch", name="Gates free").click()
        page.locator("[data-transition=G1]").click()
        expect(page.locator("#said")).to_contain_text("G1 has fired")
        page.locator("[data-transition=G2]").click()
        expect(page.locator("#said")).to_contain_text("G2 has fired")
        after = tokens(page)
        assert "system.loading" in after
        page.reload()
        expect(page.locator('[id="place:system.loading"] .live')).to_contain_class("there")
        assert tokens(page) == after
        page.get_by_role("button", name="Undo").click()
        assert tokens(page) == begin
        page.keyboard.press("Control+Shift+Z")
        assert tokens(page) == after
        page.get_by_role("button", name="Reset").click()
        assert tokens(page) == begin


@needs_browser
def test_a_workpiece_stays_in_the_hand_that_carries_it(chromium: Browser, late: str) -> None:
    moves = "document.getAnimations().filter((one) => one instanceof CSSTransition)"
    rest = f"async () => {{ while ({moves}.length > 0) await new Promise(requestAnimationFrame); }}"
    begun = f"async () => {{ while ({moves}.length === 0) await new Promise(requestAnimationFrame); }}"
    halfway = f"() => {{ for (const one of {moves}) {{ one.pause(); one.currentTime = 50_000; }} }}"
    middles = """(all) => all.map((one) => {
        const { x, y, width, height } = one.getBoundingClientRect();
        return [x + width / 2, y + height / 2];
    })"""
    with page_at(chromium, late) as page:
        page.get_by_role("switch", name="Gates free").click()
        page.get_by_role("tab", name="Top view").click()
        for name in ("G1", "G2", "t1-a"):
            page.locator(f"[data-transition={name}]").click()
            expect(page.locator("#said")).to_contain_text(f"{name} has fired")
        page.evaluate(rest)
        slow = """.topview .moving:not([style*="duration: 0s"]) { transition-duration: 100s !important; }"""
        page.add_style_tag(content=slow)
        (begin,) = page.locator(".topview .hand").evaluate_all(middles)
        page.locator("[data-transition=G3]").click()
        expect(page.locator("#said")).to_contain_text("G3 has fired")
        page.evaluate(begun)
        page.evaluate(halfway)
        (hand,) = page.locator(".topview .hand").evaluate_all(middles)
        (piece,) = page.locator(".topview .piece").evaluate_all(middles)
        assert math.dist(begin, hand) > 20, "it is on its way"
        assert math.dist(hand, piece) < 2


@needs_browser
def test_a_counterexample_is_played_with_a_slider(chromium: Browser, late: str) -> None:
    with page_at(chromium, late) as page:
        asking = page.get_by_role("button", name="Check this net")
        playing = page.get_by_role("button", name="▶ Play deadlock-free")
        asking.or_(playing).first.click()  # the server knows the verdicts once somebody has asked
        cures = page.locator(".verdicts > li").filter(has_text="deadlock-free").locator(".cures")
        cures.get_by_text("2 cures of deadlock-free").click()
        cure = cures.get_by_role("listitem").first
        expect(cure).to_contain_text("give G2 the gate unless: system.processing")
        expect(cure).to_contain_text("checked: 40 markings; cures doomed-markings")
        expect(cure.get_by_role("button")).to_have_count(0)  # a net of the catalogue is no file to write it into
        playing.click()
        slider = page.get_by_role("slider", name="Steps of deadlock-free")
        expect(slider).to_be_focused()
        page.keyboard.press("ArrowRight")
        expect(slider).to_have_attribute("aria-valuetext", "1 of 15: G1 fires, start of carrying in.")
        assert "system.carrying_in" in tokens(page)
        page.locator(".picture").evaluate("one => one.scrollTo(0, one.scrollHeight)")
        assert not is_in_sight(page, "G2")
        page.keyboard.press("ArrowRight")
        assert is_in_sight(page, "G2")
        page.keyboard.press("End")
        expect(page.locator(".playback")).to_contain_text("A deadlock: nothing can fire any more.")
        expect(page.locator(".playback .circle li")).to_have_text(
            [
                "robot.put_mc (putting on MC) waits in G4 for mc.free, which comes from mc.release by G6 and G7",
                re.compile("^mc.release .* waits in G6 for robot.free, which comes from robot.put_mc by G4 and G5$"),
            ]
        )
        assert {"robot.put_mc", "mc.release"} <= tokens(page)
        page.keyboard.press("Home")
        assert "robot.free" in tokens(page)
        slider.fill("15")
        expect(page.locator(".playback")).to_contain_text("G4 waits for a token on mc.free")
        page.get_by_role("button", name="Go on from here").click()
        expect(page.locator(".status")).to_have_text("A deadlock: no transition can fire any more.")
        expect(page.locator(".own .circle li").first).to_contain_text("waits in G4 for mc.free")
        page.get_by_role("button", name="Undo").click()
        assert "robot.free" in tokens(page)


@needs_browser
def test_what_fires_is_in_sight(chromium: Browser, late: str) -> None:
    with page_at(chromium, late, viewport={"width": 500, "height": 400}) as page:
        page.get_by_role("switch", name="Gates free").click()
        for name in ("G1", "G2", "t1-a", "G3", "t1-b", "G4", "G5", "t2-a", "t2-b", "G6", "t1-c", "G7"):
            page.locator(f'[data-transition="{name}"]').click()
        expect(page.locator('[data-transition="t1-d"]')).to_be_visible()
        page.locator(".picture").evaluate("one => one.scrollTo(0, 0)")
        assert not is_in_sight(page, "t1-d")
        page.locator('[data-transition="t1-d"]').click()
        expect(page.locator("#said")).to_contain_text("t1-d has fired")
        assert is_in_sight(page, "t1-d")


@needs_browser
def test_a_check_tells_codes_hints_and_what_the_file_expects(chromium: Browser, tmp_path: Path) -> None:
    path = tmp_path / "cell.firable.yaml"
    known = "expect: {deadlock-free: violated, contact-free: violated, live: proved, home-markings: proved}"
    path.write_text(catalogue_path("one_robot_mc_late").read_text("utf-8") + f"\n{known}\n", "utf-8")
    with command("view", str(path), "--no-browser") as (address, _), page_at(chromium, address) as page:
        page.get_by_role("button", name="Check this net").click()
        rows, codes = page.locator(".verdicts > li"), ".soft > code:first-child"

        def row(name: str) -> Locator:
            return rows.filter(has=page.locator("b", has_text=re.compile(f"^. {name}$")))

        expect(row("deadlock-free")).to_contain_text("= deadlock-freeexpected: in every reachable marking")
        expect(row("deadlock-free")).to_contain_class("good")
        expect(row("home-markings")).to_contain_text("expected: some marking")
        expect(row("contact-free")).to_contain_text("✗ contact-freechanged: no transition is held back")
        expect(row("contact-free")).to_contain_class("bad")
        expect(row("contact-free")).to_contain_text("F3024 the file expects violated, and it is proved; where")
        expect(row("live").locator(codes)).to_have_text(["F3024", "F3014"])
        expect(row("live")).to_contain_text("about: G1, G2, ")
        expect(row("live")).to_contain_text(" and 3 more")
        expect(row("property.restart").locator(codes)).to_have_text(["F3022"])
        expect(row("doomed-markings")).to_contain_class("open")
        expect(row("reversible")).to_have_count(0)  # for information, and nothing is expected of it
        expect(page.locator("#said")).to_have_text("Of what must hold, 4 do not.")
        page.get_by_role("button", name="▶ Play deadlock-free").click()  # also what is expected has its run
        expect(page.get_by_role("slider", name="Steps of deadlock-free")).to_be_focused()


@needs_browser
def test_the_top_view_shows_workpieces_where_commands_take_them(chromium: Browser, late: str) -> None:
    with page_at(chromium, late, reduced_motion="reduce") as page:
        page.get_by_role("switch", name="Gates free").click()
        page.get_by_role("tab", name="The net").focus()
        page.keyboard.press("ArrowRight")
        expect(page.get_by_role("tab", name="Top view", selected=True)).to_be_focused()
        top = page.get_by_role("tabpanel", name="Top view")
        expect(top.locator(".piece")).to_have_count(0)
        expect(top.locator(".station .spot")).to_have_text(
            ["cv1_entry", "cv1_end", "mc_table", "cv2_entry", "cv2_exit"]
        )
        page.locator("[data-transition=G1]").click()
        expect(top.locator("[data-machine=CV1]")).to_contain_class("busy")
        expect(top).to_contain_text("CV1: RUN, with a raw workpiece")
        for name in ("G2", "t1-a", "G3"):
            page.locator(f"[data-transition={name}]").click()
        expect(top).to_contain_text("R: MOVE to=MC, its hand at CV1, with a raw workpiece")
        expect(top.locator(".piece")).to_have_count(1)
        page.get_by_role("button", name="Undo").click()
        expect(top).to_contain_text("R: GRASP at=CV1, its hand at CV1")


@needs_browser
def test_what_is_of_the_picture_of_the_net_is_offered_beside_it_alone(chromium: Browser, late: str) -> None:
    with page_at(chromium, late) as page:
        of_the_net = page.get_by_role("group", name="How the picture is shown")
        expect(of_the_net).to_be_visible()
        page.get_by_role("tab", name="Top view").click()
        expect(of_the_net).to_be_hidden()
        page.get_by_role("tab", name="The net").click()
        expect(of_the_net).to_be_visible()


@needs_browser
def test_all_is_done_by_the_keyboard_alone(chromium: Browser, late: str) -> None:
    with page_at(chromium, late) as page:
        page.get_by_role("switch", name="Gates free").focus()
        page.keyboard.press("Space")
        page.locator('[id="transition:G1"]').focus()
        page.keyboard.press("Enter")
        expect(page.locator("#said")).to_contain_text("G1 has fired")
        page.locator("[data-transition=G2]").focus()
        page.keyboard.press("Enter")
        expect(page.locator("[data-transition=t1-a]")).to_be_focused()
        page.keyboard.press("Enter")
        expect(page.locator("#said")).to_contain_text("t1-a has fired")
        page.keyboard.press("Control+z")
        expect(page.locator("#said")).to_contain_text("Undone")


@needs_browser
def test_every_control_has_a_name_and_nothing_moves_for_who_wants_no_motion(chromium: Browser, late: str) -> None:
    with page_at(chromium, late, reduced_motion="reduce", color_scheme="dark") as page:
        page.get_by_role("switch", name="Gates free").click()
        page.locator("[data-transition=G1]").click()
        assert page.locator(".flying").count() == 0
        expect(page.locator("#said")).to_contain_text("G1 has fired")
        nameless = page.locator("button, input, [role=button], [role=switch]").evaluate_all(
            "all => all.filter(one => !(one.ariaLabel || one.textContent || '').trim()).length"
        )
        assert nameless == 0
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(17, 22, 29)"
        assert page.locator(".place").first.evaluate("one => getComputedStyle(one).fill") == "rgb(15, 20, 27)"


@needs_browser
def test_a_narrow_window_scrolls_down_and_not_sideways(chromium: Browser, late: str) -> None:
    with page_at(chromium, late, viewport={"width": 380, "height": 800}) as page:
        expect(page.locator(".picture")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@needs_browser
def test_a_lost_connection_is_shown(chromium: Browser) -> None:
    with (
        command("view", "catalogue:one_robot", "--no-browser") as (address, process),
        page_at(chromium, address) as page,
    ):
        expect(page.locator("h1")).to_have_text("one-robot")
        process.kill()
        process.wait()
        page.get_by_role("switch", name="Gates free").click()
        expect(page.get_by_role("alert")).to_contain_text("The connection is lost")


@needs_browser
def test_a_command_that_was_started_anew_is_told_to_the_windows_of_the_one_before(chromium: Browser) -> None:
    serve = ("view", "catalogue:one_robot", "--no-browser", "--port", str(free_port()))
    with contextlib.ExitStack() as stack:
        with command(*serve) as (address, _):
            page = stack.enter_context(page_at(chromium, address))
            expect(page.locator("h1")).to_have_text("one-robot")
        with command(*serve):
            page.get_by_role("switch", name="Gates free").click()
            expect(page.get_by_role("alert")).to_contain_text("open the address that it has printed")


@needs_browser
def test_who_has_no_token_is_asked_for_it(chromium: Browser, late: str) -> None:
    base, _, token = late.partition("#token=")
    with page_at(chromium, base) as page:
        expect(page.locator("h1")).to_have_text("Who are you?")
        expect(page.get_by_role("alert")).to_have_count(0)
        page.get_by_label("Token").fill("another")
        page.keyboard.press("Enter")
        expect(page.get_by_role("alert")).to_contain_text("is not that of the command that runs now")
        page.get_by_label("Token").fill(token)
        page.keyboard.press("Enter")
        expect(page.locator("h1")).to_have_text("one-robot-mc-late")


def test_nothing_of_the_net_is_told_without_the_token(late: str) -> None:
    for path in ("api/page", "api/moment", "api/fire", "api/check", "api/run", "no/such/path"):
        for token in ("", "another token of 20 characters"):
            assert asked(late, path, token=token)[0] == 401
    with urllib.request.urlopen(late.partition("#")[0], timeout=60) as answer:
        assert b"one-robot" not in answer.read()
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]


BEGIN: dict[str, object] = {"marking": ["robot.free"], "signals": [], "free": True}


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("api/moment", {}),
        ("api/moment", [1]),
        ("api/moment", {**BEGIN, "marking": ["no.place"]}),
        ("api/moment", {**BEGIN, "marking": [[]]}),
        ("api/moment", {**BEGIN, "signals": ["no.signal"]}),
        ("api/fire", {**BEGIN, "transition": "G1"}),
        ("api/fire", {**BEGIN, "transition": ["G1"]}),
        ("api/run", {"name": "no such run"}),
    ],
)
def test_a_request_that_makes_no_sense_is_refused_with_a_code(late: str, path: str, body: object) -> None:
    status, answer = asked(late, path, body)
    assert status == 422
    assert answer["errors"][0]["code"] == "F5070"


def test_no_request_of_who_may_ask_is_an_error_of_the_server(late: str) -> None:
    scene = asked(late, "api/page")[1]["top"]["scene"]
    assert asked(late, "api/moment", {**BEGIN, "scene": scene, "became": [{}]})[0] == 200
    base, _, token = late.partition("#token=")
    for name, value in (("Content-Type", "text/plain; charset=no-such"), ("Content-Encoding", "gzip")):
        request = urllib.request.Request(f"{base}api/run", b'{"name": "none"}')
        request.add_header("Authorization", f"Bearer {token}")
        request.add_header(name, value)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request, timeout=60)
        with refused.value as answer:
            assert (answer.code, json.loads(answer.read())["errors"][0]["code"]) == (422, "F5070")


def test_a_firing_is_one_of_the_reference_player_and_clears_what_is_stale() -> None:
    net = catalogue_net("one_robot")
    player = Player(net)
    now = Moment(net.marking(["robot.to_cv1"]), frozenset({"robot.at_cv1", "robot.touch"}))
    assert told(player, now)["transitions"]["t1-a"] == {"may": "fire"}
    after, done = fired(player, now, "t1-a")
    assert net.names(after.marking) == ("robot.grasp_cv1",)
    assert after.signals == {"robot.at_cv1"}, "the completion of the grasp is cleared when it is commanded"
    assert done == {"fired": ["t1-a"], "sent": ["R GRASP at=CV1"]}


def test_a_transition_that_never_fires_says_why() -> None:
    net = Net("n", (Place("p", marked=True),), (Transition("t", ("p",), ("p",)),))
    shown = told(Player(net), Moment(net.initial_marking))
    assert shown["transitions"]["t"] == {"may": "not", "why": "t can never fire: p is both its input and its output"}
    assert shown["deadlock"]


def test_a_trace_that_is_none_of_the_net_is_refused_before_anything_is_served(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", "catalogue:one_robot_mc_late", "--trace-dir", str(tmp_path)]) == 1
    trace = tmp_path / "deadlock-free.trace.jsonl"
    assert main(["view", "catalogue:one_robot", "--trace", str(trace), "--no-browser"]) == 2
    assert "error[F5004]" in capsys.readouterr().err


@needs_browser
def test_the_trace_of_a_run_is_played(chromium: Browser, tmp_path: Path) -> None:
    bundle, trace = tmp_path / "cell.bundle", tmp_path / "run.jsonl"
    done("bundle", "catalogue:one_robot", "-o", bundle)
    done("run", bundle, "--workpieces", "1", "--trace", trace)
    with command("view", bundle, "--trace", trace, "--no-browser") as (address, _), page_at(chromium, address) as page:
        page.get_by_role("button", name="▶ Play").click()
        expect(page.get_by_role("slider")).to_be_focused()
        page.keyboard.press("End")
        expect(page.locator(".what")).to_contain_text("G9 fires end of carrying out")
        assert tokens(page) == {"robot.free", "mc.free", "conveyor.cv1", "conveyor.cv2"}
