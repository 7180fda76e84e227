"""What a browser is started with: an address that leads to the page once, and holds no token for others to read."""

from __future__ import annotations

import http.client
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import expect
from support.browser import PATIENCE_MS, browser, command, needs_browser, page_at
from support.waiting import until

from firable.cli.main import main

expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture
def started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a browser that only says what it was started with says it."""
    said, program = tmp_path / "said", tmp_path / "browser.py"
    program.write_text(f"import sys, pathlib; pathlib.Path({str(said)!r}).write_text(sys.argv[1])")
    monkeypatch.setenv("BROWSER", f"{sys.executable} {program} %s")
    return said


def opened(said: Path) -> str:
    until(lambda: said.is_file() and said.read_text(), "a browser is started")
    return said.read_text()


def asked(address: str, method: str = "GET") -> tuple[int, str | None]:
    """The status of an answer, and where it leads."""
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(str(parts.hostname), parts.port, timeout=30)
    connection.request(method, parts.path)
    answer = connection.getresponse()
    return answer.status, answer.headers["Location"]


def leads_once(address: str, said: Path) -> None:
    token = address.partition("#token=")[2]
    opening = opened(said)
    assert token not in opening
    assert asked(opening, "HEAD")[0] == 405, "who only looks uses nothing up"
    assert asked(f"{opening}x")[0] == 401
    assert asked(opening) == (303, f"/#token={token}")
    assert asked(opening) == (303, "/"), "who comes later does not get it"


def test_the_address_of_a_net_leads_to_it_once(started: Path) -> None:
    with command("view", "catalogue:one_robot") as (address, _):
        leads_once(address, started)


def test_the_address_of_a_run_leads_to_it_once(started: Path, tmp_path: Path) -> None:
    path = tmp_path / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    with command("run", path, "--open", "--speed", "1", "--workpieces", "100") as (address, _):
        leads_once(address, started)


@needs_browser
def test_a_browser_that_is_led_there_shows_the_net(started: Path) -> None:
    with command("view", "catalogue:one_robot") as (_, _), browser() as chromium:
        with page_at(chromium, opened(started)) as page:
            expect(page.locator("h1")).to_have_text("one-robot")
            assert "token" not in page.url
        with page_at(chromium, opened(started)) as page:
            expect(page.locator("h1")).to_have_text("Who are you?")
