"""The page of a running cell in a browser: tokens move, an operator acts, and a lost connection is told."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from playwright.sync_api import Browser, Page, Route, expect
from support.browser import PATIENCE_MS, browser, command, done, needs_browser, page_at
from support.waiting import PATIENCE_SECONDS

from firable.cli.main import main
from firable.cli.view.lanes import Lanes
from firable.cli.view.votes import awaited
from firable.executor import Host
from firable.executor.drivers.far_side.ports import free_port
from firable.nets.catalogue import catalogue_net
from firable.nets.drawing.part import everybody, part_of
from firable.semantics.trace import CommandSent, Fired, SignalChanged, read_trace

expect.set_options(timeout=PATIENCE_MS)

LATE = ("--workpieces", "100", "--watch", "ignore")
"""A run that goes on; on a busy machine the simulated cell is late, which the monitor may tell."""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("live") / "cell.bundle"
    done("bundle", "catalogue:one_robot", "-o", path)
    return path


@pytest.fixture(scope="module")
def chromium(bundle: Path) -> Iterator[Browser]:
    with browser() as made:
        yield made


@pytest.fixture(autouse=True)
def no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FIRABLE_NO_BROWSER", "1")


def fulfilled(body: str, route: Route) -> None:
    route.fulfill(body=body)


def state(page: Page, word: str) -> None:
    expect(page.locator(".state")).to_have_text(word)


@needs_browser
def test_a_run_is_followed_paused_stepped_resumed_and_stopped(chromium: Browser, bundle: Path, tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    run = ("run", bundle, "--open", "--speed", "10", *LATE, "--trace", trace)
    with command(*run) as (address, process), page_at(chromium, address) as page:
        expect(page.locator(".events .fired").filter(has_text="G1 fired").first).to_be_visible()
        expect(page.locator(".lanes .machine")).to_have_text(["R", "MC", "CV1", "CV2"])
        expect(page.locator(".lanes .bar.done").first).to_be_attached()
        expect(page.locator(".votes tbody th").first).to_contain_text("G1")
        page.get_by_role("tab", name="Top view").click()
        expect(page.locator(".topview .piece").first).to_be_visible()
        page.get_by_role("button", name="Pause").click()
        state(page, "paused")
        # The list is drawn less often than the state: once it tells of the pause, it tells of all that fired before.
        expect(page.locator(".events .note").filter(has_text="paused")).to_be_visible()
        fired = page.locator(".events .fired").count()
        for _ in range(500):  # the machines end what they are at, and then something is enabled
            with page.expect_response("**/step") as answered:
                page.get_by_role("button", name="Step", exact=True).click()
            if answered.value.json()["fired"]:
                break
        expect(page.locator(".events .fired")).to_have_count(fired + 1)
        state(page, "paused")
        page.get_by_role("button", name="Resume").click()
        expect(page.get_by_role("button", name="Pause")).to_be_visible()
        page.get_by_role("button", name="Stop", exact=True).click()
        expect(page.locator(".banner")).to_contain_text("The run has ended")
        expect(page.locator(".banner")).to_contain_text("stopped by the operator")
        expect(page.locator(".tools button:enabled")).to_have_count(0)
        out, _ = process.communicate(timeout=PATIENCE_SECONDS)
        assert process.returncode == 3, out
    done("replay", trace, "--net", bundle)


@needs_browser
def test_an_emergency_stop_sends_no_command_any_more(chromium: Browser, bundle: Path, tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    with (
        command("run", bundle, "--open", *LATE, "--trace", trace) as (address, process),
        page_at(chromium, address) as page,
    ):
        expect(page.locator(".events .fired").first).to_be_attached()
        page.get_by_role("button", name="Emergency stop").click()
        expect(page.get_by_role("alert").or_(page.locator(".banner"))).to_contain_text("emergency stop: by an operator")
        state(page, "latched")
        expect(page.get_by_role("button", name="Pause")).to_be_disabled()
        page.get_by_role("button", name="Reset").click()
        state(page, "held")
        expect(page.get_by_role("button", name="Reset")).to_have_count(0)
        expect(page.get_by_role("button", name="Resume")).to_be_enabled()
        asked = page.locator(".asked")
        expect(asked.first).to_contain_text("look at the machine. What became of ")
        expect(page.get_by_text("Nothing.", exact=True)).to_have_count(0)
        while (left := asked.count()) > 0:  # how many machines were at work depends on when it was stopped
            asked.first.get_by_role("button", name="Working: ").click()
            expect(asked).to_have_count(left - 1)
        expect(page.locator(".banner")).not_to_contain_text("look at the machine")
        state(page, "held")  # nothing moves before Resume
        page.get_by_role("button", name="Stop", exact=True).click()
        assert process.wait(timeout=PATIENCE_SECONDS) == 3
    events = read_trace(trace).events
    stopped = next(e.at_seconds for e in events if getattr(e, "note", "") == "emergency stop")
    assert not [e for e in events if isinstance(e, CommandSent) and e.at_seconds > stopped]


@needs_browser
def test_a_lost_connection_is_told_and_what_is_shown_is_marked_as_old(chromium: Browser, bundle: Path) -> None:
    with (
        command("run", bundle, "--open", *LATE) as (address, process),
        page_at(chromium, address) as page,
    ):
        state(page, "waiting")
        page.get_by_role("button", name="Emergency stop").click()
        expect(page.locator(".banner")).to_contain_text("emergency stop: by an operator")
        process.send_signal(signal.SIGSTOP)  # the host hangs: its sockets stay open, and nothing comes
        expect(page.get_by_role("alert")).to_contain_text("The connection is lost since")
        expect(page.get_by_role("button", name="Emergency stop")).to_be_disabled()
        expect(page.locator("body")).to_contain_class("old")
        process.send_signal(signal.SIGCONT)
        expect(page.locator("body")).not_to_contain_class("old")
        expect(page.get_by_role("button", name="Emergency stop")).to_be_enabled()
        expect(page.locator(".banner")).to_contain_text("emergency stop: by an operator")


@needs_browser
def test_on_a_telephone_the_emergency_stop_and_a_lost_connection_stay_in_view(chromium: Browser, bundle: Path) -> None:
    with (
        command("run", bundle, "--open", "--workpieces", "100") as (address, process),
        page_at(chromium, address, viewport={"width": 390, "height": 844}) as page,
    ):
        state(page, "waiting")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        page.locator(".events").scroll_into_view_if_needed()
        page.evaluate("scrollTo(0, document.body.scrollHeight)")
        expect(page.get_by_role("heading", name="What happened")).to_be_in_viewport()
        expect(page.get_by_role("button", name="Emergency stop")).to_be_in_viewport(ratio=1)
        assert page.locator(".events").evaluate("one => one.getBoundingClientRect().bottom") < page.locator(
            ".tools"
        ).evaluate("one => one.getBoundingClientRect().top"), "the buttons cover nothing"
        process.send_signal(signal.SIGSTOP)
        expect(page.get_by_role("alert")).to_contain_text("The connection is lost since")
        expect(page.get_by_role("alert")).to_be_in_viewport(ratio=1)
        process.send_signal(signal.SIGCONT)


@needs_browser
def test_who_listens_to_the_page_hears_tokens_machines_and_what_is_missing(chromium: Browser, bundle: Path) -> None:
    with (
        command("run", bundle, "--open", "--workpieces", "100", "--watch", "ignore") as (address, _),
        page_at(chromium, address) as page,
    ):
        state(page, "waiting")
        page.get_by_role("button", name="Pause").click()
        state(page, "paused")
        picture = page.get_by_role("group", name="the net one-robot")
        expect(picture.get_by_role("button")).to_have_count(0)  # nothing here is fired by hand
        expect(page.locator(".live.there").first).to_be_attached()
        told = picture.get_by_role("img").evaluate_all("all => all.map(one => one.ariaLabel)")
        held = page.locator(".live.there").evaluate_all("all => all.map(one => one.parentElement.ariaLabel)")
        assert held
        assert {one for one in told if one.endswith(", with a token")} == set(held)
        assert all(
            " waits for " in one or one.endswith("may fire") for one in told if one.startswith(("G", "t1", "t2"))
        )
        page.locator(".picture").focus()
        page.keyboard.press("Tab")  # past all of the picture
        expect(page.get_by_role("group", name="Lanes of the machines; scrolls")).to_be_focused()
        page.keyboard.press("Tab")
        expect(page.locator("summary").first).to_be_focused()
        machines = page.get_by_role("list", name="What each machine does")
        expect(machines.get_by_role("listitem").filter(has_text="CV2")).to_have_text("CV2 rests")


def answers(machines: list[str], bars: list[dict[str, object]], **now: object) -> dict[str, object]:
    """What a server tells of a run with these machines and bars, by the path that is asked."""
    net: dict[str, object] = {"name": "many", "description": "", "controllers": [], "places": [], "signals": []}
    net["transitions"] = [{"name": "t", "says": ""}]
    start = {"mode": "live", "here": "", "coordinators": [], "net": net, "machines": machines, "top": {"why_not": "no"}}
    told: dict[str, object] = {
        "at": 10.0,
        "speed": 1.0,
        "state": "running",
        "message": "",
        "marking": [],
        "signals": [],
        "transitions": {},
        "waits": [],
        "bars": bars,
        "votes": [],
        "top": None,
        "unreached": [],
        "asked": {},
        "paused": False,
        "ended": True,
        "events": [],
        "fired": [],
        **now,
    }
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="99"><path id="input:t:p" d="M0 0h9"/></svg>'
    return {"page": start, "picture": {"picture": svg, "members": {}, "foldable": []}, "events": told}


@needs_browser
def test_of_many_machines_those_in_view_have_bars_and_of_many_firings_no_token_flies(chromium: Browser) -> None:
    machines = [f"M{k}" for k in range(100)]
    bars: list[dict[str, object]] = [
        {"number": k, "machine": name, "command": f"{name} GO", "from": 5.0, "to": 8.0, "end": "done"}
        for k, name in enumerate(machines)
    ]
    with command("view", "catalogue:one_robot", "--no-browser") as (address, _), page_at(chromium, address) as page:
        for path, answer in answers(machines, bars, fired=["t"] * 20).items():
            page.route(f"**/api/{path}", partial(fulfilled, json.dumps(answer) + "\n"))
        page.reload()
        shown = page.locator(".lanes g > title")
        expect(shown.filter(has_text="M0 GO: 3.0 s")).to_have_count(1)
        assert page.locator(".lanes .bar").count() < 40
        expect(page.locator(".picture")).to_contain_class("brisk")
        expect(page.locator(".flying")).to_have_count(0)
        page.locator(".lanes").evaluate("one => one.scrollTop = one.scrollHeight")
        expect(shown.filter(has_text="M99 GO: 3.0 s")).to_have_count(1)
        expect(shown.filter(has_text="M0 GO: 3.0 s")).to_have_count(0)
        expect(page.get_by_role("listitem").filter(has_text="M50")).to_have_text("M50 rests")


@needs_browser
@pytest.mark.parametrize("columns", [("robot", "mc"), ("infeed_conveyor", "stacking_robot", "rework_robot", "door")])
def test_the_votes_of_controllers_fit_their_panel_whatever_their_names(
    chromium: Browser, columns: tuple[str, ...]
) -> None:
    parts = [{"controller": name, "vote": "ready"} for name in columns]
    row = {"name": "takes_crate", "says": "", "round": "", "parts": parts}
    with command("view", "catalogue:one_robot", "--no-browser") as (address, _), page_at(chromium, address) as page:
        for path, answer in answers(["M"], [], votes=[row]).items():
            page.route(f"**/api/{path}", partial(fulfilled, json.dumps(answer) + "\n"))
        page.reload()
        votes = page.locator(".votes")
        expect(votes.locator("tbody tr")).to_have_count(1)
        for name in columns:
            expect(votes).to_contain_text(name)
        expect(votes.locator("thead th")).to_have_text(["", *columns] if len(columns) == 2 else ["", "controllers"])
        room, seen = page.locator("aside").bounding_box(), votes.bounding_box()
        assert room is not None
        assert seen is not None
        assert seen["x"] + seen["width"] <= room["x"] + room["width"]


@needs_browser
def test_what_stands_on_a_bar_that_began_a_minute_ago_is_seen_whole(chromium: Browser) -> None:
    long = {"number": 0, "machine": "M", "command": "M MILL", "from": 11.0, "to": 60.0, "end": "done"}
    short = {"number": 1, "machine": "M", "command": "M GO", "from": 61.0, "to": 69.0, "end": "done"}
    told = answers(["M"], [long, short], at=70.0, ended=False)
    later = answers(["M"], [], at=74.0)["events"]
    events = iter([told["events"], later])
    with command("view", "catalogue:one_robot", "--no-browser") as (address, _), page_at(chromium, address) as page:
        for path in ("page", "picture"):
            page.route(f"**/api/{path}", partial(fulfilled, json.dumps(told[path]) + "\n"))
        page.route("**/api/events", lambda route: fulfilled(json.dumps(next(events)) + "\n", route))
        page.reload()
        expect(page.get_by_text("The run has ended after 74 seconds")).to_be_visible()
        window = page.locator(".lane-window").bounding_box()
        label = page.locator(".lanes .command").filter(has_text="MILL").bounding_box()
        assert window is not None
        assert label is not None
        assert window["x"] <= label["x"] < window["x"] + 40


@needs_browser
def test_the_page_of_one_controller_shows_what_is_its_own(chromium: Browser, bundle: Path) -> None:
    listen = ("--listen", f"tcp/127.0.0.1:{free_port()}")
    host = ("run", bundle, "--controller", "robot", "--dry-run", "0", "--open", *listen)
    with command(*host) as (shown, _), page_at(chromium, shown) as page:
        expect(page.locator("header")).to_contain_text("on this host: robot")
        expect(page.locator('[id="place:robot.free"] .live')).to_contain_class("there")
        assert page.locator('[id="place:mc.free"]').count() == 0
        expect(page.locator('[id="transition:G2"]')).to_be_visible()
        robot = page.locator(".votes tr").filter(has_text="G2")
        expect(robot.locator(".vote.ready")).to_have_count(1)
        expect(robot.locator(".vote.lost")).to_have_count(3)
        expect(page.locator(".list .lost").first).to_contain_text("is not connected")
        never = page.locator(".banner").filter(has_text="the coordinator was never reached")
        expect(never).to_contain_class("open")
        ready = page.locator('[id="transition:G2"]')
        expect(ready).to_contain_class("may-wait")
        away = "the coordinator, system, mc, conveyor to be connected"
        expect(ready).to_have_attribute(
            "aria-label", f"G2, start of loading from CV1, G2 is ready here, and waits for {away}"
        )
        expect(page.locator('[id="transition:G3"]')).to_contain_class("may-not")


@pytest.mark.parametrize(
    ("of_mc", "of_conveyor", "told"),
    [
        ("ready", "yes", ""),
        ("no", "promised", "G2 is ready here, and waits for mc to be ready"),
        ("unknown", "unknown", "G2 is ready here, and waits for the coordinator to ask mc, conveyor"),
        ("lost", "no", "G2 is ready here, and waits for mc to be connected; conveyor to be ready"),
    ],
)
def test_a_part_that_is_ready_waits_for_those_of_others_as_far_as_they_are_known(
    of_mc: str, of_conveyor: str, told: str
) -> None:
    peers = SimpleNamespace(names={"", "mc", "conveyor"}, connected_to={"", "conveyor"})
    host = cast(Host, SimpleNamespace(peers=peers, controllers={"robot": None}))
    votes = {"robot": "ready", "mc": of_mc, "conveyor": of_conveyor}
    parts = [{"controller": name, "vote": vote} for name, vote in votes.items()]
    assert awaited(host, {"name": "G2", "decider": "", "parts": parts}) == told


def test_what_is_of_one_controller_is_its_subnet() -> None:
    net = catalogue_net("one_robot")
    net = part_of(net, {"robot"}, everybody(net))
    assert {place.owner for place in net.places} == {"robot"}
    assert net.transition("G3").inputs == ("robot.grasp_cv1",)
    assert "G1" not in net.transition_index
    assert [gate.signal for gate in net.transition("t1-a").external] == ["robot.at_cv1"]


def test_a_bar_goes_from_the_command_to_its_completion() -> None:
    lanes = Lanes(catalogue_net("one_robot"))
    for event in (
        CommandSent(1.0, "robot.to_cv1"),
        SignalChanged(3.0, "robot.at_cv1", True),
        Fired(3.0, ("t1-a",)),
        CommandSent(3.0, "robot.grasp_cv1"),
        Fired(4.0, ("G3",)),
        CommandSent(5.0, "conveyor.cv1_wait"),
        CommandSent(6.0, "mc.fix"),
    ):
        lanes.seen(event)
    told = [(bar["machine"], bar["from"], bar["to"], bar["end"]) for bar in lanes.since(0)]
    assert told == [
        ("R", 1.0, 3.0, "done"),
        ("R", 3.0, 4.0, "left"),
        ("CV1", 5.0, 5.0, "instant"),
        ("MC", 6.0, None, "working"),
    ]
    assert lanes.machines == ["R", "MC", "CV1", "CV2"]


def test_who_follows_is_told_the_bars_that_have_changed_and_no_others() -> None:
    lanes = Lanes(catalogue_net("one_robot"))
    lanes.seen(CommandSent(1.0, "robot.to_cv1"))
    lanes.seen(CommandSent(2.0, "mc.fix"))
    seen = lanes.changes
    assert lanes.since(seen) == []
    lanes.seen(SignalChanged(3.0, "robot.at_cv1", True))
    assert [(bar["number"], bar["end"]) for bar in lanes.since(seen)] == [(1, "done")]
    assert lanes.since(lanes.changes) == []


def test_virtual_time_is_refused_with_a_page(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(bundle), "--open", "--speed", "max"]) == 2
    assert "in virtual time a run is over before anybody acts" in capsys.readouterr().err


def test_who_has_no_token_follows_nothing_and_stops_nothing(bundle: Path) -> None:
    with command("run", bundle, "--open", *LATE) as (address, process):
        base = address.partition("#")[0]
        for path, method in (("api/page", "GET"), ("api/events", "GET"), ("emergency-stop", "POST"), ("stop", "POST")):
            asked = ["-c", f"import urllib.request as u; u.urlopen(u.Request({base + path!r}, method={method!r}))"]
            said = subprocess.run([sys.executable, *asked], capture_output=True, text=True, check=False)
            assert "401" in said.stderr
        assert process.poll() is None
