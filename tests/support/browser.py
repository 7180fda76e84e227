"""A real browser for the tests of the page: Chromium of the system, without a window; without it they are skipped.

The part of it that needs no window, which Debian packages by itself, asks a fifth less of a processor.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, sync_playwright
from support.waiting import heard_in_time

PROGRAMS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, PROGRAMS)), None)
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed here")
PATIENCE_MS = 60_000.0
"""So long a browser may take for what it does in milliseconds: the machine of the tests may be busy."""


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser, for as long as the context lasts."""
    with sync_playwright() as playwright:
        # A container has no user name spaces, which the sandbox needs; only pages of this host are opened.
        made = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            yield made
        finally:
            made.close()


@contextmanager
def page_at(made: Browser, address: str, **look: object) -> Iterator[Page]:
    """A page of a new window; whatever it complains of on its console, but for a lost connection, fails the test."""
    context = made.new_context(**look)  # type: ignore[arg-type]  # the keywords of the browser
    complaints: list[str] = []

    def heard(message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"} and "Failed to load resource" not in message.text:
            complaints.append(message.text)

    try:
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", heard)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(address)
        yield page
    finally:
        context.close()
    assert not complaints


@contextmanager
def command(*arguments: str | Path, cwd: Path | None = None) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A command that serves a page, and the address that it tells."""
    process = subprocess.Popen(
        [sys.executable, "-m", "firable.cli", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
    )
    try:
        assert process.stderr is not None
        said = ""
        with heard_in_time(process):
            while (told := re.search(r"see it at (http\S+)", said)) is None:
                line = process.stderr.readline()
                assert line, said
                said += line
        yield told.group(1), process
    finally:
        process.kill()
        process.communicate()


def done(*arguments: str | Path) -> None:
    """A command, to its end: in a process of its own, for a browser is driven from an event loop in this one."""
    subprocess.run([sys.executable, "-m", "firable.cli", *map(str, arguments)], check=True, capture_output=True)
