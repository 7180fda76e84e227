"""The page of a running cell in a browser: tokens move, an operator acts, and a lost connection is told."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect
from support.browser import PATIENCE_MS, browser, command, done, needs_browser, page_at
from support.link_rigs import free_port

from firable.cli.main import main
from firable.cli.view.lanes import Lanes
from firable.cli.view.live import own_part
from firable.nets.catalogue import catalogue_net
from firable.semantics.trace import CommandSent, Fired, SignalChanged, read_trace

expect.set_options(timeout=PATIENCE_MS)


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


def state(page: Page, word: str) -> None:
    expect(page.locator(".state")).to_have_text(word)


@needs_browser
def test_a_run_is_followed_paused_stepped_resumed_and_stopped(chromium: Browser, bundle: Path, tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    # At ten times real time a busy machine is late, which the monitor may tell.
    options = ("--speed", "10", "--workpieces", "100", "--watch", "ignore")
    run = ("run", bundle, "--open", *options, "--trace", trace)
    with command(*run) as (address, process), page_at(chromium, address) as page:
        expect(page.locator(".events .fired").filter(has_text="G1 fired").first).to_be_visible()
        expect(page.locator(".lanes .machine")).to_have_text(["R", "MC", "CV1", "CV2"])
        expect(page.locator(".lanes .bar.done").first).to_be_attached()
        expect(page.locator(".votes tbody th").first).to_contain_text("G1")
        page.get_by_role("tab", name="Top view").click()
        expect(page.locator(".topview .piece").first).to_be_visible()
        page.get_by_role("button", name="Pause").click()
        state(page, "paused")
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
        out, _ = process.communicate(timeout=60)
        assert process.returncode == 3, out
    done("replay", trace, "--net", bundle)


@needs_browser
def test_an_emergency_stop_sends_no_command_any_more(chromium: Browser, bundle: Path, tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    with (
        command("run", bundle, "--open", "--workpieces", "100", "--trace", trace) as (address, process),
        page_at(chromium, address) as page,
    ):
        expect(page.locator(".events .fired").first).to_be_attached()
        page.get_by_role("button", name="Emergency stop").click()
        expect(page.get_by_role("alert").or_(page.locator(".banner"))).to_contain_text("emergency stop: by token")
        state(page, "latched")
        expect(page.get_by_role("button", name="Pause")).to_be_disabled()
        page.get_by_role("button", name="Reset").click()
        state(page, "held")
        expect(page.get_by_role("button", name="Reset")).to_have_count(0)
        expect(page.get_by_role("button", name="Resume")).to_be_enabled()
        page.get_by_role("button", name="Stop", exact=True).click()
        assert process.wait(timeout=60) == 3
    events = read_trace(trace).events
    stopped = next(e.at_seconds for e in events if getattr(e, "note", "") == "emergency stop")
    assert not [e for e in events if isinstance(e, CommandSent) and e.at_seconds > stopped]


@needs_browser
def test_a_lost_connection_is_told_and_what_is_shown_is_marked_as_old(chromium: Browser, bundle: Path) -> None:
    with (
        command("run", bundle, "--open", "--workpieces", "100") as (address, process),
        page_at(chromium, address) as page,
    ):
        state(page, "waiting")
        process.send_signal(signal.SIGSTOP)  # the host hangs: its sockets stay open, and nothing comes
        expect(page.get_by_role("alert")).to_contain_text("The connection is lost since")
        expect(page.get_by_role("button", name="Emergency stop")).to_be_disabled()
        expect(page.locator("body")).to_contain_class("old")
        process.send_signal(signal.SIGCONT)
        expect(page.locator("body")).not_to_contain_class("old")
        expect(page.get_by_role("button", name="Emergency stop")).to_be_enabled()


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


def test_what_is_of_one_controller_is_its_subnet() -> None:
    net = own_part(catalogue_net("one_robot"), {"robot"})
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
    told = {lane["machine"]: [(bar["from"], bar["to"], bar["end"]) for bar in lane["bars"]] for lane in lanes.told()}
    assert told == {
        "R": [(1.0, 3.0, "done"), (3.0, 4.0, "left")],
        "CV1": [(5.0, 5.0, "instant")],
        "MC": [(6.0, None, "working")],
        "CV2": [],
    }


def test_virtual_time_is_refused_with_a_page(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(bundle), "--open", "--speed", "max"]) == 2
    assert "in virtual time a run is over before anybody acts" in capsys.readouterr().err


def test_who_has_no_token_follows_nothing_and_stops_nothing(bundle: Path) -> None:
    with command("run", bundle, "--open", "--workpieces", "100") as (address, process):
        base = address.partition("#")[0]
        for path, method in (("api/page", "GET"), ("api/events", "GET"), ("emergency-stop", "POST"), ("stop", "POST")):
            asked = ["-c", f"import urllib.request as u; u.urlopen(u.Request({base + path!r}, method={method!r}))"]
            said = subprocess.run([sys.executable, *asked], capture_output=True, text=True, check=False)
            assert "401" in said.stderr
        assert process.poll() is None
