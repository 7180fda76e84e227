"""`firable io`: what the devices of a binding show now, and forcing it where the binding allows that."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from shutil import get_terminal_size
from typing import TYPE_CHECKING

import click

from firable.cli.choice import OneOf
from firable.cli.files import READ
from firable.cli.finite import FiniteRange
from firable.cli.options import binding_of, load_net

if TYPE_CHECKING:
    import asyncio

    from firable.executor.drivers.binding import Binding
    from firable.executor.drivers.bound import BoundDriver
    from firable.executor.drivers.bound_device import ByHand
    from firable.executor.drivers.driver import Reading
    from firable.nets.net import Net, Place

_REFRESH_SECONDS = 0.25
_ENDED = "the emergency stop has ended the sending"
_TOO_EARLY = "it was asked to end before the devices were there"
_COLOURS = {"good": "green", "uncertain": "yellow", "bad": "red"}


@click.command("io", short_help="Show the live signals of a binding; force them where it allows that.")
@click.argument("bind", metavar="BIND", type=READ)
@click.option("--once", is_flag=True, help="Show everything once, when it has been read, and end.")
@click.option("--for", "seconds", type=FiniteRange(min=0), metavar="SECONDS", help="End by itself after so long.")
@click.option("--force", metavar="SIGNAL=0|1", multiple=True, help="Write a signal on its device.")
@click.option("--send", metavar="PLACE", multiple=True, help="Send the command of a place; needs --net.")
@click.option(
    "--format",
    "format_",
    type=OneOf(["text", "json"]),
    default="text",
    show_default=True,
    help="How to print: as a table, or one JSON document a line; `firable schema io` prints its schema.",
)
@click.option("--net", "of", metavar="NET", type=READ, help="The net, or the bundle, that BIND must be a binding of.")
def live_io(
    bind: str,
    once: bool,
    seconds: float | None,
    force: tuple[str, ...],
    send: tuple[str, ...],
    format_: str,
    of: str | None,
) -> int:
    """Show the signals of BIND as they are: value, quality, age, and how many edges were coalesced.

    Looking disturbs nothing: neither safe outputs nor heartbeats are written, so it may be done beside a running cell.
    Only a serial line is one program's: this ends where another one has it, and nobody has it while this looks at it.

    --force and --send write, each only where the binding says `force: true` of the signal or of the command. What is
    forced is written once, on the first connection; a command is sent where its device is connected, and given up when
    that is lost. Where the device does not take it, that is told at the end.

    With --send this is the master of the devices: it gives them their heartbeats, and drives the safe outputs at both
    ends. An emergency stop ends it. Never do that beside a running cell: where the heartbeat of another program is
    heard on a device, nothing is sent.

    --once waits for all devices at the same time, for each as long as its `start_s` says, and names those that do not
    answer.

    Ctrl-C ends it, as does a request to terminate or the end of its terminal. Exit codes: 0, or 1 where a machine was
    stopped or has failed at what was sent, or something was not forced or not taken; 2 for a binding that cannot be
    used, or where another program has a serial line or commands a device; and 3 where --once cannot read something.
    """
    import asyncio

    from firable.executor.drivers.fitting import misfits
    from firable.executor.drivers.rivals import listen_first
    from firable.executor.operating.uncut import ended_by_signals
    from firable.nets.diagnostics import InputError

    if once and seconds is not None:
        raise click.UsageError("--once ends by itself when everything has been read: leave out --for")
    binding = binding_of(bind)
    if unreadable := tuple(binding.unreadable()):
        raise InputError(unreadable)
    forced = [_forced(binding, text) for text in force]
    if both := [signal for signal, value in forced if (signal, not value) in forced]:
        raise click.UsageError(f"'{both[0]}' is forced to 0 and to 1: name it once")
    net = None if of is None else load_net(of).net
    if net is not None and (problems := misfits(binding, net)):
        raise InputError(problems)
    places = _sent(binding, send, net)
    if places:
        listen_first(binding)
    heard = _Heard() if format_ == "text" else _HeardByPrograms(bind)

    async def ended() -> int:
        with ended_by_signals():
            return await _shown(binding, forced, places, heard, once=once, seconds=seconds)

    code = 0
    with suppress(KeyboardInterrupt, asyncio.CancelledError):
        code = asyncio.run(ended())
    return 1 if heard.tell_undone() and not code else code


def _forced(binding: Binding, text: str) -> tuple[str, bool]:
    """The signal and the value that are asked for, if the binding allows it."""
    from firable.executor.drivers.binding import shown_as
    from firable.nets.diagnostics import did_you_mean

    name, _, value = text.partition("=")
    signals = binding.document.signals
    if name in {shown for contact in binding.document.emergency_stop for shown in (contact, shown_as(contact))}:
        raise click.UsageError(f"'{name}' is a contact of the emergency stop, which is opened and closed by hand alone")
    known = [signal for signal, bound in signals.items() if bound is not None]
    if name in signals and name not in known:
        said = "its machine says when it is done, and no sensor that could be forced has a part in it"
        raise click.UsageError(f"'{name}' is `acknowledged`: {said}")
    if name not in known:
        raise click.UsageError(f"no signal '{name}' is read; {did_you_mean(name, known)}there are {', '.join(known)}")
    if value not in {"0", "1"}:
        raise click.UsageError(f"--force {text}: write {name}=0 or {name}=1")
    bound = signals[name]
    if bound is None or not bound.force:
        raise click.UsageError(f"the binding does not allow '{name}' to be forced: that takes `force: true` in it")
    return name, value == "1"


def _sent(binding: Binding, names: tuple[str, ...], net: Net | None) -> list[Place]:
    """The places whose commands are to be sent, if the binding allows it."""
    if not names:
        return []
    if net is None:
        raise click.UsageError("say with --net whose commands --send is about")
    for name in names:
        if name not in binding.document.commands:
            raise click.UsageError(f"no command of '{name}' is bound")
        if not binding.document.commands[name].force:
            raise click.UsageError(
                f"the binding does not allow the command of '{name}' to be sent by hand: `force: true`"
            )
    return [net.place(name) for name in names]


class _Heard:
    """Who listens: faults and notes are told as they come."""

    def __init__(self) -> None:
        import asyncio

        self.begun = time.monotonic()
        self.failed = False
        """Whether a machine has failed, or was stopped."""
        self.above: list[str] = []
        """The lines of the table that stands above, to be written over."""
        self.by_hand: list[tuple[str, ByHand]] = []
        """What was to be forced and sent, as it was asked for."""
        self.lines_taken: dict[str, str] = {}
        """The devices whose serial line another program has, and how that was told."""
        self.is_to_end = asyncio.Event()
        """Whether there is one."""

    def now_seconds(self) -> float:
        return time.monotonic() - self.begun

    def loop_delay_seconds(self, until_seconds: float) -> float:
        return max(0.0, until_seconds - self.now_seconds())

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        pass  # the table is made of the image

    def taken(self, place: str, entry: int) -> None:
        del entry  # it is no number that the device shows
        self._told(f"{place}: taken")

    def all_told(self) -> None:
        pass

    def moved(self) -> None:
        pass

    def driver_fault(self, machine: str, message: str) -> None:
        self.failed = True
        self._told(f"{click.style('fault', fg='red')}: {machine}: {message}")

    def driver_note(self, machine: str, message: str) -> None:
        if machine not in self.lines_taken:  # which is told at the end
            self._told(f"{machine}: {message}")

    def line_taken(self, machine: str, message: str) -> None:
        """The line of a device is another program's."""
        self.lines_taken[machine] = message
        self.is_to_end.set()

    def emergency_stop(self, reason: str) -> None:
        self.failed = True
        self._told(f"{click.style('emergency stop', fg='red')}: {reason}")

    def sending_ended(self) -> None:
        """The driver has driven its safe outputs, and has ended."""
        self._told(f"{_ENDED}, and nothing is read any more")

    def tell_undone(self) -> bool:
        """Tell at the end what was to be forced or sent and was not; whether there is anything."""
        undone = [(asked, one) for asked, one in self.by_hand if not one.is_done]
        for asked, one in undone:
            done = "taken" if asked.startswith("--send") else "written"
            self._told(f"{click.style('error', fg='red')}: {asked} was not {done}: {one.refused}")
        return bool(undone)

    def _told(self, line: str) -> None:
        self.above = []
        click.echo(line, err=True)

    def show(self, driver: BoundDriver) -> None:
        """The table, over the one before where that stands on a terminal."""
        readings = driver.readings()
        if self.above and sys.stdout.isatty():
            columns = max(1, get_terminal_size().columns)
            broken = sum((len(click.unstyle(row)) - 1) // columns for row in self.above)  # as a narrow terminal does
            click.echo(f"\x1b[{len(self.above) + broken}F\x1b[J", nl=False)
        self.above = list(self.rows(readings))
        for row in self.above:
            click.echo(row)

    def rows(self, readings: Mapping[str, Reading]) -> list[str]:
        """One line for each signal."""
        width = max((len(name) for name in readings), default=6)
        rows = [click.style(f"  {'signal':<{width}}  value  quality    age        coalesced", dim=True)]
        for name, reading in readings.items():
            value = "-" if reading.value is None else str(int(reading.value))
            age = "-" if reading.value is None else f"{self.now_seconds() - reading.at_seconds:.2f} s"
            quality = click.style(f"{reading.quality:<9}", fg=_COLOURS[reading.quality])
            why = f"  {reading.why}" if reading.why else ""
            rows.append(f"  {name:<{width}}  {value:<5}  {quality}  {age:<9}  {reading.coalesced}{why}")
        return rows


class _HeardByPrograms(_Heard):
    """Who listens for a program: one line of JSON at a time."""

    def __init__(self, binding: str) -> None:
        super().__init__()
        self.binding = binding

    def show(self, driver: BoundDriver) -> None:
        """Everything, as one document."""
        now = self.now_seconds()
        document = {
            "firable_io": 1,
            "binding": self.binding,
            "at_seconds": round(now, 3),
            "devices": {name: {"connected": one.is_ready.is_set()} for name, one in driver.devices.items()},
            "signals": {
                name: {
                    "value": reading.value,
                    "quality": reading.quality.value,
                    "age_seconds": None if reading.value is None else round(now - reading.at_seconds, 3),
                    "coalesced": reading.coalesced,
                    "why": reading.why,
                }
                for name, reading in driver.readings().items()
            },
        }
        click.echo(json.dumps(document, ensure_ascii=False))


async def _shown(
    binding: Binding,
    forced: list[tuple[str, bool]],
    places: list[Place],
    heard: _Heard,
    *,
    once: bool,
    seconds: float | None,
) -> int:
    """Show the signals until the end; returns the exit code."""
    import asyncio

    from firable.executor.drivers.bound import BoundDriver
    from firable.executor.drivers.bound_device import ByHand
    from firable.executor.drivers.driver import Quality
    from firable.executor.drivers.sparing import sparing

    driver = BoundDriver(sparing(binding if places else binding.watching(), heard.line_taken), (), frozenset())
    running = asyncio.create_task(_served(driver, heard))
    try:
        for signal, value in forced:
            heard.by_hand.append((f"--force {signal}={value:d}", driver.force(signal, value)))
        forced_alone = len(heard.by_hand)
        heard.by_hand += [(f"--send {place.name}", ByHand(refused=_TOO_EARLY)) for place in places]
        reached = await _connected(driver, running)
        heard.by_hand[forced_alone:] = [(f"--send {place.name}", driver.send_by_hand(place)) for place in places]
        while not running.done() and _is_writing(driver, heard):
            await asyncio.sleep(0.01)
        if once:
            await asyncio.wait([running], timeout=_REFRESH_SECONDS)  # what is told a moment after the first answer
        else:
            await _watched(driver, running, heard, seconds)
        is_ended = await _ended_by_a_stop(driver, running)
        if is_ended:
            heard.sending_ended()
        if once or is_ended:
            heard.show(driver)
        good = all(reading.quality is Quality.GOOD for reading in driver.readings().values())
        if once and not is_ended and not (good and reached):
            return 3
        return 1 if places and heard.failed else 0
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def _is_writing(driver: BoundDriver, heard: _Heard) -> bool:
    """Whether a device that is there has not confirmed what it was to be written; no command is, where one failed.

    One that it has not taken by when it should have is awaited no more.
    """
    there = [device for device in driver.devices.values() if device.is_ready.is_set()]
    return any(
        device.forced or (not heard.failed and not device.untaken and (device.is_writing or device.sent))
        for device in there
    )


async def _served(driver: BoundDriver, heard: _Heard) -> None:
    """Serve the devices until a stop, or until a line is another program's: then nothing is touched any more."""
    import asyncio

    from firable.executor.drivers.cancelling import ended

    serving = asyncio.create_task(driver.run(heard, heard))
    is_to_end = asyncio.create_task(heard.is_to_end.wait())
    try:
        await asyncio.wait([serving, is_to_end], return_when=asyncio.FIRST_COMPLETED)
        for machine in heard.lines_taken:
            driver.devices[machine].left_to_another()
    finally:
        await ended([serving, is_to_end])
    for machine, message in heard.lines_taken.items():
        raise click.ClickException(f"'{machine}' is left to the program that has its line: {message}")
    serving.result()


async def _watched(driver: BoundDriver, running: asyncio.Task[None], heard: _Heard, seconds: float | None) -> None:
    """Show the signals, on a terminal all the time and else whenever one has changed, until the end or a stop."""
    import asyncio

    before: dict[str, Reading] = {}
    while not running.done() and (seconds is None or heard.now_seconds() < seconds):
        now = dict(driver.readings())
        changed = [name for name, one in now.items() if name not in before or _differ(one, before[name])]
        if sys.stdout.isatty() or changed:
            heard.show(driver)
        before = now
        await asyncio.wait([running], timeout=_REFRESH_SECONDS)


async def _ended_by_a_stop(driver: BoundDriver, running: asyncio.Task[None]) -> bool:
    """Whether an emergency stop has ended the driver, or is about to: then nothing that was shown holds any more."""
    import asyncio

    if driver.is_stopped:
        await asyncio.wait([running])
    if not running.done():
        return False
    running.result()
    for device in driver.devices.values():
        device.left(_ENDED)
    return True


def _differ(one: Reading, other: Reading) -> bool:
    return (one.value, one.quality, one.coalesced) != (other.value, other.quality, other.coalesced)


async def _connected(driver: BoundDriver, running: asyncio.Task[None]) -> bool:
    """Wait until every device has been read, as long as its start may take; whether all were."""
    import asyncio

    from firable.executor.drivers.cancelling import ended

    met = asyncio.create_task(driver.met())
    try:
        await asyncio.wait([met, running], return_when=asyncio.FIRST_COMPLETED)
    finally:
        await ended([met])
    if running.done():
        running.result()
    return all(device.is_ready.is_set() for device in driver.devices.values())
