"""A command is sent when its machine has it: what waits with the driver holds its token, and is given up with it."""

from __future__ import annotations

import asyncio
import io
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import EntryPoint

import pytest
from support.link_rigs import Heard
from support.third_party_driver import MemoryEnd

from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers import kinds
from firable.executor.drivers.bench import Bench, Far
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.driver import Answer, Clock, Listener, withdraw
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.drivers.far_side.machine import ROLES
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting
from firable.executor.links.storages import Memory, Storage
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.dispatch import TAKEN
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import KEY, TRACE, Recorder
from firable.executor.operating.situation import State
from firable.executor.protocol.messages import Effect, Firing, Sending, Stored
from firable.nets.interchange import net_digest
from firable.nets.net import Net, Place
from firable.nets.text import parse_net

NET = parse_net("""\
firable: 1
cell: cell
controllers:
  a: {start: free, places: {free: , lamp: {send: {machine: A, command: OPEN}}, gone: }}
transitions:
  begin: {from: a.free, to: a.lamp}
  end: {from: a.lamp, to: a.gone}
""")
SPLIT = split(NET)


class Queue(DryRunDriver):
    """A driver whose line is down: it takes what it is sent, and its machine has it when the line is up."""

    def __init__(self) -> None:
        super().__init__(SPLIT.subnets, 1.0)
        self.waiting: list[tuple[Place, int]] = []
        self.has: list[tuple[str, int]] = []

    def send(self, place: Place, entry: int) -> None:
        self.waiting.append((place, entry))

    def withdraw(self, place: Place) -> None:
        self.waiting = [one for one in self.waiting if one[0] != place]

    async def ask(self, place: Place, entry: int) -> Answer:
        return Answer.DONE if (place.name, entry) in self.has else Answer.NOT_RECEIVED

    def mend(self) -> None:
        """Let the line be up."""
        for place, entry in self.waiting:
            self.has.append((place.name, entry))
            assert self.listener is not None
            self.listener.taken(place.name, entry)
        self.waiting.clear()


async def present(_: Host) -> None:
    await asyncio.sleep(3600)


def whole(driver: Queue, journal: Journal, *, resume: bool = False) -> Host:
    recorder = Recorder(NET, net_digest(NET), io.StringIO(), journal.kept(TRACE).get(KEY))
    return Host(SPLIT, driver, recorder, Conduct(operator=present, overdue_seconds=30, resume=resume), journal=journal)


def among_others(driver: Queue, journal: Journal, *, resume: bool = False) -> Host:
    exchange = Exchange()
    another = InProcessLink(exchange, Greeting("d", (COORDINATOR,)))
    another.listener = Heard(memory=Memory(Storage("of another host")))  # without another one nothing moves
    exchange.enter(another)
    link, recorder = InProcessLink(exchange, Greeting("d", ("a",))), Recorder(NET, "", None, None, ("a",))
    return Host(
        SPLIT, driver, recorder, Conduct(overdue_seconds=30, resume=resume), machines=("a",), link=link, journal=journal
    )


Make = Callable[..., Host]
RUNS = pytest.mark.parametrize("make", [whole, among_others], ids=["whole", "among others"])


def marking(run: Host) -> tuple[str, ...]:
    return tuple(name for each in run.controllers.values() for name in each.subnet.names(each.marking))


@RUNS
def test_token_without_completion_waits_until_the_machine_has_its_command(make: Make) -> None:
    async def main() -> None:
        driver = Queue()
        run = make(driver, MemoryJournal())
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(20)
        assert driver.waiting == [(NET.place("a.lamp"), 1)]
        assert marking(run) == ("a.lamp",)
        waits = "end waits for the machine to take the command of a.lamp"
        assert [str(each) for each in run.situation().blocked] == [waits]
        driver.mend()
        await asyncio.sleep(20)
        assert marking(run) == ("a.gone",)
        assert not run.fault
        run.stop()
        await ending

    run_in_virtual_time(main())


@RUNS
def test_command_that_no_machine_takes_is_overdue(make: Make) -> None:
    async def main() -> None:
        ended = await make(Queue(), MemoryJournal()).main()
        assert ended.state is State.FAULT
        assert "'A OPEN' of 'a.lamp'" in ended.message
        assert "its machine has not shown that it took it within 30 s" in ended.message

    run_in_virtual_time(main())


@RUNS
@pytest.mark.parametrize("ends", ["stop", "emergency stop", "fault"])
def test_command_that_was_in_the_queue_when_the_run_ended_is_asked_after_and_sent_again(make: Make, ends: str) -> None:
    async def main() -> None:
        journal = MemoryJournal()
        run = make(Queue(), journal)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        if ends == "stop":
            run.stop()
        elif ends == "fault":
            run.driver_fault("A", "failed")
        else:
            run.emergency_stop("a person")
        await ending
        driver = Queue()
        again = make(driver, journal, resume=True)
        ending = asyncio.create_task(again.main())
        await asyncio.sleep(1)
        assert driver.waiting == [(NET.place("a.lamp"), 1)]
        assert marking(again) == ("a.lamp",)
        driver.mend()
        await asyncio.sleep(1)
        assert driver.has == [("a.lamp", 1)]
        assert marking(again) == ("a.gone",)
        again.stop()
        await ending

    run_in_virtual_time(main())


def test_what_a_firing_leaves_behind_is_given_up_also_where_it_has_not_left_the_process() -> None:
    driver = Queue()
    driver.send(NET.place("a.lamp"), 1)
    leaving = deque([Sending("a.lamp", 2), Sending("b.lamp", 1)])
    assert withdraw(driver, [NET.place("a.free")], leaving) == []
    assert withdraw(driver, [NET.place("a.lamp")], leaving) == ["a.lamp"]
    assert (driver.waiting, list(leaving)) == ([], [Sending("b.lamp", 1)])
    others: list[Effect] = [Firing("t"), Sending("a.lamp", 1)]
    assert withdraw(driver, [NET.place("a.lamp")], others) == ["a.lamp"]
    assert others == [Firing("t")]


class Boasting(BoundDriver):
    """A driver that takes what it has queued for what its machine has."""

    def send(self, place: Place, entry: int) -> None:
        super().send(place, entry)
        if self.listener is not None:
            self.listener.taken(place.name, entry)


class Held(DriverConformance):
    """What every driver has to show, of a driver that boasts."""

    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        points = {role: f"the {role}" for role in (*ROLES, "number")}
        yield Far(MemoryEnd("m"), "driver: theirs, memory: m", points)


@pytest.mark.parametrize("boasts", [False, True])
@pytest.mark.parametrize(
    "test",
    [
        DriverConformance.test_a_command_is_taken_when_the_machine_has_it_and_told_so_once,
        DriverConformance.test_a_command_that_a_stop_overtakes_is_never_told_as_taken,
    ],
)
def test_driver_that_tells_of_a_queued_command_that_it_is_taken_does_not_pass(
    test: Callable[[DriverConformance], None], boasts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [theirs])
    if not boasts:
        test(Held())
        return
    begin = Bench.begin

    def boasting(bench: Bench) -> None:
        begin(bench)
        bench.driver.__class__ = Boasting

    monkeypatch.setattr(Bench, "begin", boasting)
    with pytest.raises(AssertionError):
        test(Held())


LASTING = parse_net("""
firable: 1
cell: lasting
controllers:
  a: {start: free, places: {free: , busy: {send: {machine: A, command: WORK}, until: done}, gone: }}
transitions:
  begin: {from: a.free, to: a.busy}
  end: {from: a.busy, to: a.gone}
""")
IN_TIME = parse_net("""
firable: 1
cell: in_time
controllers:
  a:
    start: free
    places:
      free:
      busy: {send: {machine: A, command: WORK}, until: done, within: {time: 2s, to: late}}
      late:
      gone:
transitions:
  begin: {from: a.free, to: a.busy}
  end: {from: a.busy, to: a.gone}
""")


class Forgetting(DryRunDriver):
    """A machine that takes its commands, or not, is never done, and knows nothing of them after a restart."""

    def __init__(self, net: Net, *, takes: bool) -> None:
        super().__init__(split(net).subnets, 1.0)
        self.takes = takes
        self.sent: list[str] = []
        self.last: tuple[str, int] | None = None

    def send(self, place: Place, entry: int) -> None:
        self.sent.append(place.name)
        self.last = place.name, entry
        if self.takes:
            self.take()

    def take(self) -> None:
        assert self.listener is not None
        assert self.last is not None
        self.listener.taken(*self.last)

    async def ask(self, place: Place, entry: int) -> Answer:
        assert (place.name, entry) == ("a.busy", 1)
        return Answer.NOT_RECEIVED


def forgetful(net: Net, driver: Forgetting, journal: Journal, told: list[str]) -> Host:
    recorder = Recorder(net, net_digest(net), io.StringIO(), journal.kept(TRACE).get(KEY))
    tell = partial(lambda told, _, sentence: told.append(sentence), told)
    return Host(split(net), driver, recorder, Conduct(operator=present, resume=True, tell=tell), journal=journal)


@pytest.mark.parametrize("was_taken", [True, False])
def test_a_command_that_its_machine_had_taken_is_not_given_again_because_it_knows_nothing_of_it(
    was_taken: bool,
) -> None:
    """It was switched off and on: it may have done the command by halves, and only somebody who looks can tell."""

    async def main() -> None:
        journal, told = MemoryJournal(), list[str]()
        run = forgetful(LASTING, Forgetting(LASTING, takes=was_taken), journal, told)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(5)
        assert marking(run) == ("a.busy",)
        run.stop()
        await ending
        driver = Forgetting(LASTING, takes=False)
        again = forgetful(LASTING, driver, journal, told)
        ending = asyncio.create_task(again.main())
        await asyncio.sleep(5)
        if was_taken:
            assert driver.sent == []
            assert again.situation().state is State.HELD
            assert "the machine of 'a.busy' had taken its command, and knows nothing of it any more" in told
            assert not again.say("a.busy", Answer.NOT_RECEIVED)
            assert again.resume()
            await asyncio.sleep(1)
        assert driver.sent == ["a.busy"]
        again.stop()
        await ending
        third = forgetful(LASTING, driver := Forgetting(LASTING, takes=True), journal, told)
        ending = asyncio.create_task(third.main())
        await asyncio.sleep(5)
        assert driver.sent == ["a.busy"], "nobody has taken it since somebody said that it was not received"
        third.stop()
        await ending

    run_in_virtual_time(main())


def test_nobody_is_asked_after_a_command_that_was_taken_and_that_its_token_has_left() -> None:
    async def main() -> None:
        journal, told = MemoryJournal(), list[str]()
        run = forgetful(IN_TIME, Forgetting(IN_TIME, takes=True), journal, told)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(5)
        assert marking(run) == ("a.late",)
        run.stop()
        await ending
        again = forgetful(IN_TIME, Forgetting(IN_TIME, takes=True), journal, told)
        ending = asyncio.create_task(again.main())
        await asyncio.sleep(5)
        assert again.situation().state is not State.HELD
        assert not [sentence for sentence in told if "had taken" in sentence]
        again.stop()
        await ending

    run_in_virtual_time(main())


def test_what_a_machine_takes_while_it_is_stopped_is_kept() -> None:
    class Synced(MemoryJournal):
        kept_taken: Stored | None = None

        def sync(self) -> None:
            self.kept_taken = self.kept(TAKEN).get("a.busy")

    class Last(Forgetting):
        async def run(self, clock: Clock, listener: Listener) -> None:
            try:
                await super().run(clock, listener)
            finally:
                self.take()

    async def main() -> None:
        journal = Synced()
        run = forgetful(LASTING, Last(LASTING, takes=False), journal, [])
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(5)
        run.stop()
        await ending
        assert journal.kept_taken == 1

    run_in_virtual_time(main())
