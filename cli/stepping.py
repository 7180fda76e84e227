"""The operator at the terminal of `firable run --step`: one transition at a time, on, or to an end.

In virtual time the cell stands still while the person thinks, so the prompt waits and everything with it; Ctrl-C there
is handed to the prompt, for the event loop that usually obeys it does not turn. In real time the machines go on: a
thread reads what is typed. It reads the file descriptor and is waited for by nobody, because a thread that waits for a
line in `input` keeps the program from ending, as does one that holds the lock of `sys.stdin`.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Collection
from contextlib import suppress
from typing import Protocol

import click

from firable.executor import Answer, Host, Operator
from firable.executor.operating.restart import uncertain

_PROMPT = "  [Enter] next, [r] run on, [e] stop at the end of the cycle, [s] stop now: "
_TAKE_UP = "  [r] take the run up, [s] stop now: "
_RESET = "  type reset when nobody is in the way any more, [s] end the run: "
_SAY = "  what did the machine do? PLACE=done, =working or =not-received, [s] stop now: "
_POLL_SECONDS = 0.05


class _Typed(Protocol):
    """What the operator types."""

    async def asked(self, prompt: str) -> str | None:
        """The next line, after a prompt; None where there are no more."""
        ...

    def unasked(self) -> bool:
        """Whether a line has been typed before it was asked for; it is taken."""
        ...


class _TypedAtPrompt:
    """Lines that everything waits for."""

    def __init__(self, *, to_stderr: bool) -> None:
        self.to_stderr = to_stderr

    async def asked(self, prompt: str) -> str | None:
        """The next line, after a prompt; None at the end of the input and at Ctrl-C."""
        handler = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            click.echo(prompt, nl=False, err=self.to_stderr)
            return input()
        except (EOFError, KeyboardInterrupt):
            return None
        finally:
            signal.signal(signal.SIGINT, handler)

    def unasked(self) -> bool:
        """Never: in virtual time a run that runs on is over before anything is typed."""
        return False


class _TypedMeanwhile:
    """Lines that are read beside the run."""

    def __init__(self, *, to_stderr: bool) -> None:
        self.to_stderr = to_stderr
        self.lines: deque[str] = deque()
        self.ended = threading.Event()
        threading.Thread(target=self._read, daemon=True).start()

    async def asked(self, prompt: str) -> str | None:
        """The next line, after a prompt; None at the end of the input."""
        click.echo(prompt, nl=False, err=self.to_stderr)
        while not self.lines:
            if self.ended.is_set() and not self.lines:  # the last lines come before the end
                return None
            await asyncio.sleep(_POLL_SECONDS)
        return self.lines.popleft()

    def unasked(self) -> bool:
        """Whether a line has been typed before it was asked for; it is taken."""
        if self.lines:
            self.lines.popleft()
            return True
        return False

    def _read(self) -> None:
        unfinished = b""
        while some := os.read(sys.stdin.fileno(), 4096):
            *lines, unfinished = (unfinished + some).split(b"\n")
            self.lines.extend(line.decode(errors="replace") for line in lines)
        self.ended.set()


def stepping(speed: float | None, *, to_stderr: bool) -> Operator:
    """The operator of a run at a speed (None: virtual time), who talks on standard output or on standard error."""

    async def key(typed: _Typed, prompt: str = _PROMPT, keys: Collection[str] = ("", "r", "e", "s")) -> str:
        while True:
            line = await typed.asked(prompt)
            if line is None:
                click.echo(err=to_stderr)
                return "s"
            if line.strip().lower() in keys:
                return line.strip().lower()

    async def stepped(host: Host) -> bool:
        """Fire one transition, waiting until one is enabled or the cell is stopped; False where none ever will be."""
        while (fired := await host.step()) is None:
            if host.emergency is not None:
                return True
            if host.at_rest:
                return False
            await asyncio.sleep(_POLL_SECONDS)
        description = host.net.transition(fired).description
        click.echo(f"{host.now_seconds():8.1f} s  {fired}  {description}", err=to_stderr)
        return True

    async def paused_again(host: Host, typed: _Typed) -> bool:
        """Let the run go on until something is typed, which pauses it; False where it goes on to its end."""
        host.resume()
        if speed is None:
            return False
        click.echo("  running on; Enter pauses", err=to_stderr)
        while not host.at_rest:
            if host.emergency is not None:
                return True
            if typed.unasked():
                host.pause()
                return True
            await asyncio.sleep(_POLL_SECONDS)
        return False

    async def taken_up(host: Host, typed: _Typed) -> bool:
        """After a restart, or an emergency stop and its reset: say what became of the commands, and go on if wanted."""
        while (found := host.taking_up) is not None or host.emergency is not None:
            if host.latch is not None:
                while typed.unasked():  # what was typed before it was asked for resets nothing
                    pass
                if await key(typed, _RESET, {"reset", "s"}) == "s":
                    return False
                for why in host.reset():
                    click.echo(f"  not reset: {why}", err=to_stderr)
                continue
            if found is None or not found.is_final:
                await asyncio.sleep(_POLL_SECONDS)
                continue
            for line in host.situation().message.split("; "):
                click.echo(f"  {line}", err=to_stderr)
            if uncertain(host):
                if not await said(host, typed):
                    return False
            elif await key(typed, _TAKE_UP) == "s":
                return False
            else:
                host.resume()
        return True

    async def said(host: Host, typed: _Typed) -> bool:
        """Say what became of a command that no machine can tell of; False where the operator wants an end instead."""
        line = await typed.asked(_SAY)
        if line is None or line.strip().lower() == "s":
            return False
        place, _, word = line.strip().partition("=")
        with suppress(ValueError):  # no answer: then it is asked again
            host.say(place, Answer(word.replace("-", " ")))
        return True

    async def operate(host: Host) -> None:
        typed: _Typed = (_TypedAtPrompt if speed is None else _TypedMeanwhile)(to_stderr=to_stderr)
        if not await taken_up(host, typed):
            host.stop()
            return
        host.pause()
        while await stepped(host):
            typed_now = await key(typed) if host.emergency is None else ""
            if host.emergency is not None and typed_now != "s":
                if not await taken_up(host, typed):
                    host.stop()
                    return
                host.pause()
                continue
            match typed_now:
                case "s":
                    host.stop()
                    return
                case "e":
                    host.stop(at_end_of_cycle=True)
                    break
                case "r" if not await paused_again(host, typed):
                    return
        host.resume()

    return operate
