"""The operator at the terminal of `firable run --step`: one transition at a time, on, or to an end.

In virtual time the cell stands still while the person thinks, so the prompt waits and everything with it; Ctrl-C there
is handed to the prompt, for the event loop that usually obeys it does not turn. In real time the machines go on: a
thread reads what is typed. It reads the file descriptor and is waited for by nobody, because a thread that waits for a
line in `input` keeps the program from ending, as does one that holds the lock of `sys.stdin`.

The terminal may not be the only one who acts: a contact opens, somebody else resets or resumes (`--serve`). Then what
was asked here is no question any more, and whatever is typed as its answer would be taken for that to another one: an
Enter for the next step would set a run going that is held. So each question is withdrawn as soon as it is moot.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Protocol, TypeAlias

import click

from firable.executor import Host, Operator
from firable.executor.operating.aside import UntoldError, aside
from firable.executor.operating.restart import uncertain
from firable.executor.protocol.commands import SAID
from firable.nets.source import one_line

_PROMPT = "  [Enter] next, [r] run on, [e] stop at the end of the cycle, [s] stop now: "
_THESE = "  [r] these are the machines of this journal, [s] stop now: "
_TAKE_UP = "  [r] take the run up, [s] stop now: "
_RESET = "  type reset when nobody is in the way any more, [s] end the run: "
_SAY = "  what did the machine do? PLACE=done, =working or =not-received, [s] stop now: "
_POLL_SECONDS = 0.05
Say: TypeAlias = Callable[..., object]
"""Says a line as `click.echo` does."""


class _MootError(Exception):
    """What was asked is no question any more."""


class _Typed(Protocol):
    """What the operator types."""

    async def asked(self, prompt: str, is_moot: Callable[[], bool]) -> str | None:
        """The next line, after a prompt; None where there are no more. Raises `_MootError` as soon as it is moot."""
        ...

    def unasked(self) -> bool:
        """Whether a line has been typed before it was asked for; it is taken."""
        ...

    @property
    def wants(self) -> bool:
        """Whether a person wants to say something, who is not asked: the input has a line, or is at its end."""
        ...


class _TypedAtPrompt:
    """Lines that everything waits for."""

    def __init__(self, say: Say) -> None:
        self.say = say

    async def asked(self, prompt: str, is_moot: Callable[[], bool]) -> str | None:
        """The next line, after a prompt; None at the end of the input and at Ctrl-C. Nothing becomes moot meanwhile."""
        del is_moot
        handler = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            self.say(prompt, nl=False)
            return input()
        except (EOFError, KeyboardInterrupt):
            return None
        finally:
            signal.signal(signal.SIGINT, handler)

    def unasked(self) -> bool:
        """Never: in virtual time a run that runs on is over before anything is typed."""
        return False

    @property
    def wants(self) -> bool:
        """Never: everything waits for what is typed."""
        return False


class _TypedMeanwhile:
    """Lines that are read beside the run."""

    def __init__(self, say: Say) -> None:
        self.say = say
        self.lines: deque[str] = deque()
        self.ended = threading.Event()
        self.is_terminal = sys.stdin.isatty()
        threading.Thread(target=self._read, daemon=True).start()

    async def asked(self, prompt: str, is_moot: Callable[[], bool]) -> str | None:
        """The next line, after a prompt; None at the end of the input."""
        if is_moot():
            raise _MootError
        self.say(prompt, nl=False)
        while not is_moot():
            if self.lines:
                return self.lines.popleft()
            if self.ended.is_set() and not self.lines:  # the last lines come before the end
                return None
            await asyncio.sleep(_POLL_SECONDS)
        self.say()
        raise _MootError

    def unasked(self) -> bool:
        """Whether a line has been typed before it was asked for; it is taken."""
        if self.lines:
            self.lines.popleft()
            return True
        return False

    @property
    def wants(self) -> bool:
        """Whether a person wants to say something; the lines of a script are answers, each to its question."""
        return self.is_terminal and (bool(self.lines) or self.ended.is_set())

    def _read(self) -> None:
        unfinished = b""
        while some := os.read(sys.stdin.fileno(), 4096):
            *lines, unfinished = (unfinished + some).split(b"\n")
            self.lines.extend(line.decode(errors="replace") for line in lines)
        self.ended.set()


@contextmanager
def stepping(speed: float | None, *, to_stderr: bool) -> Iterator[Operator]:
    """The operator of a run at a speed (None: virtual time), who is talked to on standard output or on standard error.

    Beside a run that goes on nobody waits for the terminal to take what is said.
    """
    echo = partial(click.echo, err=to_stderr)
    if speed is None:
        yield lambda host: _Person(host, echo, is_virtual=True).operate()
        return
    with aside(echo) as say:

        def said(*words: str, nl: bool = True) -> None:
            try:
                say(*words, nl=nl)
            except UntoldError as error:  # a terminal that slept for so long ends no run, but one that is gone does
                if error.errors:
                    raise error.errors[0] from None

        yield lambda host: _Person(host, said, is_virtual=False).operate()


class _Person:
    """Who steps a run at the terminal."""

    def __init__(self, host: Host, say: Say, *, is_virtual: bool) -> None:
        self.host = host
        self.say = say
        self.is_virtual = is_virtual
        self.typed: _Typed = (_TypedAtPrompt if is_virtual else _TypedMeanwhile)(say)

    async def operate(self) -> None:
        """Step, until the run goes on to its end."""
        host = self.host
        if not await self._taken_up():
            return
        host.pause()
        while await self._stepped():
            match await self._key(_PROMPT, {"", "r", "e", "s"}, self._is_elsewhere):
                case "s":
                    host.stop()
                    return
                case "e":
                    host.stop(at_end_of_cycle=True)
                    break
                case "r" if not await self._paused_again():
                    return
                case None if self._is_held():
                    if not await self._taken_up(was_stopped=True):
                        return
                    host.pause()
                case None if not await self._paused_again():  # somebody else has resumed it
                    return
        host.resume()

    async def _key(self, prompt: str, keys: Collection[str], is_moot: Callable[[], bool]) -> str | None:
        """One of the keys; None where the question is moot."""
        while True:
            try:
                line = await self.typed.asked(prompt, is_moot)
            except _MootError:
                return None
            if line is None:
                self.say()
                return "s"
            if line.strip().lower() in keys:
                return line.strip().lower()

    def _is_held(self) -> bool:
        """Whether there was an emergency stop, or a restart, and nobody has taken the run up since."""
        return self.host.emergency is not None or self.host.taking_up is not None

    def _is_elsewhere(self) -> bool:
        """Whether a run that was paused here is so no more."""
        return self._is_held() or not self.host.paused

    async def _stepped(self) -> bool:
        """Fire one transition, waiting until one is enabled or the cell is stopped; False where none ever will be.

        Whatever is typed while nothing is enabled is heard at once: a stop must not wait until a machine has moved.
        """
        host = self.host
        while (fired := await host.step()) is None:
            if self._is_elsewhere() or self.typed.wants:
                return True
            if host.at_rest:
                return False
            await asyncio.sleep(_POLL_SECONDS)
        description = one_line(host.net.transition(fired).description)
        self.say(f"{host.now_seconds():8.1f} s  {fired}  {description}")
        return True

    async def _paused_again(self) -> bool:
        """Let the run go on until it is paused, by something that is typed; False where it goes on to its end."""
        host = self.host
        host.resume()
        if self.is_virtual:
            return False
        self.say("  running on; Enter pauses")
        while not self._is_held() and not host.paused:
            if host.at_rest:
                return False
            if self.typed.unasked():
                host.pause()
            await asyncio.sleep(_POLL_SECONDS)
        return True

    async def _taken_up(self, *, was_stopped: bool = False) -> bool:
        """After a restart, or an emergency stop and its reset: say what became of the commands, and go on if wanted."""
        host = self.host
        while self._is_held():
            if host.latch is not None:
                was_stopped = True
                await self._reset()
            elif (found := host.taking_up) is None or not (found.is_final or host.elsewhere is not None):
                await asyncio.sleep(_POLL_SECONDS)
            else:
                # Nothing that was typed before this stands there takes the run up.
                if was_stopped or host.elsewhere is not None:
                    self._forget()
                    was_stopped = False
                for line in host.situation().message.split("; "):
                    self.say(f"  {line}")
                if host.elsewhere is not None:
                    await self._found_again()
                else:
                    await (self._said() if uncertain(host) else self._resumed())
            if host.is_to_end:
                return False
        return True

    def _forget(self) -> None:
        """Take what was typed before it was asked for as said to nothing."""
        while self.typed.unasked():
            pass

    async def _reset(self) -> None:
        """Reset an emergency stop, or end the run."""
        host, latch = self.host, self.host.latch
        self._forget()
        match await self._key(_RESET, {"reset", "s"}, lambda: host.latch is not latch):
            case "s":
                host.stop()
            case "reset":
                for why in host.reset():
                    self.say(f"  not reset: {why}")

    async def _found_again(self) -> None:
        """Say that machines that are elsewhere are those of the journal, or end the run."""
        host = self.host
        match await self._key(_THESE, {"r", "s"}, lambda: host.elsewhere is None or host.latch is not None):
            case "s":
                host.stop()
            case "r":
                host.resume()
                host.pause()  # so that what they answer is seen before the run is taken up

    async def _resumed(self) -> None:
        """Take a run up that is held, or end it."""
        host, found = self.host, self.host.taking_up
        match await self._key(_TAKE_UP, {"r", "s"}, lambda: host.taking_up is not found):
            case "s":
                host.stop()
            case "r":
                host.resume()

    async def _said(self) -> None:
        """Say what became of a command that no machine can tell of, or end the run."""
        host, found = self.host, self.host.taking_up
        try:
            line = await self.typed.asked(_SAY, lambda: host.taking_up is not found or not uncertain(host))
        except _MootError:
            return
        if line is None or line.strip().lower() == "s":
            host.stop()
            return
        place, _, word = line.strip().partition("=")
        if word in SAID:  # or it is asked again
            host.say(place, SAID[word])
