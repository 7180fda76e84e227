"""A host that is started beside the one that has its machines leaves them alone: they would stop in their work."""

import asyncio
from importlib.metadata import EntryPoint

import pytest
from support.third_party_driver import MemoryEnd
from support.two_hosts import SPLIT, Hosts, refusal

from firable.executor.drivers import kinds
from firable.executor.drivers.bench import until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver, bound_driver
from firable.executor.drivers.device import Point, Value
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.links.link import COORDINATOR, Refusal, run_by_two
from firable.executor.operating import peers
from firable.executor.operating.host import Host
from firable.executor.operating.situation import Situation
from firable.nets.diagnostics import Diagnostic

A, CENTRE = ("a",), ("b", COORDINATOR)
ALONE = "this one leaves its machines alone, and does not read their emergency stops, until it is let in"
BINDING = """
firable_bind: 1
cell: cell
devices: {box: {driver: theirs, memory: box, safe: {out: false}, channels: {A: {number: n, taken: t}}}}
commands: {a.lamp: {device: box, channel: A}}
"""


class Cell:
    """The hosts of a cell, that of a with a device, and what the device is written."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        entry = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
        monkeypatch.setattr(kinds, "entry_points", lambda **_: [entry])
        self.hosts, self.written = Hosts(), list[str]()
        self.end = MemoryEnd("box")
        self.told: list[str] = []
        self.tasks: list[asyncio.Task[Situation]] = []

    async def begin(self) -> None:
        await self.end.start(self._written)
        self.end.show("t", value=0)

    def _written(self, point: Point, value: Value) -> None:
        self.written.append(point)
        if point == "n":
            self.end.show("t", value)

    def start(self, machines: tuple[str, ...], journal: Journal | None = None, digest: str = "d") -> Host:
        host = self.hosts.host(machines, journal or MemoryJournal(), digest)
        if machines == A:
            host.driver = bound_driver(parse_binding(BINDING), SPLIT.net, SPLIT.subnet("a"))
            host.tell = lambda _, sentence: self.told.append(sentence)
        self.tasks.append(asyncio.create_task(host.main()))
        return host

    async def end_all(self) -> None:
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)


def left_alone(host: Host) -> list[str]:
    """What the situation says of machines that are left alone, and of what is to be done about it."""
    return [why for why in host.situation().message.split("; ") if "machines alone" in why or "start it again" in why]


def test_a_host_beside_the_one_that_has_its_machines_writes_them_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.3)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        for machines in (CENTRE, A):
            cell.start(machines)
        await until(lambda: "n" in cell.written, "the command of the host that has the machine")
        cell.written.clear()
        mistaken = cell.start(A)
        assert (await refusal(cell.tasks[-1])).code == "F5025"  # the coordinator knows another journal
        assert mistaken.peers.claimed == ("a",)
        assert cell.written == []
        await cell.end_all()

    asyncio.run(main())


def test_a_host_whose_coordinator_has_another_bundle_writes_nothing_for_that_may_have_let_another_host_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.3)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        cell.start(CENTRE)
        mistaken = cell.start(A, digest="of the release before")
        await until(lambda: mistaken.peers.of_other_release, "the coordinator's refusal")
        assert left_alone(mistaken) == [
            f"the coordinator may have let another host in with 'a': {ALONE}, or that has been gone for 30 s"
        ]
        assert (await refusal(cell.tasks[-1])).code == "F5020"
        assert cell.written == []
        await cell.end_all()

    asyncio.run(main())


def test_a_host_drives_its_machines_when_a_coordinator_of_another_bundle_has_been_gone_for_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(peers, "PARTED_SECONDS", 5.0)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        cell.start(CENTRE)
        alone = cell.start(A, digest="of the release before")
        await until(lambda: alone.peers.of_other_release, "the coordinator's refusal")
        cell.tasks[0].cancel()
        await until(lambda: alone.peers.left_by_unlike, "the end of that one")
        gone_at = asyncio.get_running_loop().time()
        assert left_alone(alone) == [
            "the coordinator, which may have let another host in, is gone, or a line to it is broken: "
            f"{ALONE}, or that has been gone for 5 s"
        ]
        await until(lambda: cell.written, "the safe outputs of its start")
        assert asyncio.get_running_loop().time() - gone_at > 4.5, "a plug parts two for less"
        assert set(cell.written) == {"out"}
        assert not cell.tasks[-1].done()
        await cell.end_all()

    asyncio.run(main())


def test_a_host_whose_machines_another_one_has_leaves_them_alone_until_it_is_stopped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.1)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        mistaken = cell.start(A)
        await asyncio.sleep(0)
        mistaken.peers.refused(A, run_by_two(A))
        await asyncio.sleep(0.4)
        driver = mistaken.driver
        assert isinstance(driver, BoundDriver)
        assert not driver.has_begun
        assert left_alone(mistaken) == [f"another host has 'a': {ALONE}, or that has been gone for 30 s"]
        mistaken.stop()
        ended = await cell.tasks[-1]
        assert cell.written == []
        assert "not confirmed" not in str(ended)
        assert "this one has left its machines alone, and has driven no safe outputs" in str(ended)
        assert "until it is let in" not in str(ended)

    asyncio.run(main())


def test_a_host_that_a_third_one_refuses_for_another_leaves_its_machines_alone_though_that_is_gone_for_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the link leads to the coordinator alone, its end says nothing of the host that has them."""
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.1)
    monkeypatch.setattr(peers, "PARTED_SECONDS", 0.1)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        mistaken = cell.start(A)
        await asyncio.sleep(0)
        mistaken.peers.refused(CENTRE, run_by_two(A))
        mistaken.peers.gone(CENTRE)
        await asyncio.sleep(0.6)
        assert mistaken.peers.claimed == ("a",)
        assert cell.written == []
        await cell.end_all()

    asyncio.run(main())


def test_who_has_said_that_another_host_is_let_in_is_told_and_what_a_person_does_when_that_has_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        mistaken = cell.start(A)
        await until(lambda: mistaken.peers.is_hands_off, "the driver")
        mistaken.peers.refused(CENTRE, run_by_two(A))
        mistaken.peers.refused(A, run_by_two(A))  # and the other one says so itself
        assert cell.told[0] == (
            "this host is refused by the host of 'b', the coordinator: 'a' is run by two hosts; "
            "each machine has one host: end one of the two"
        )
        assert cell.told[1].startswith("the host of 'a' is refused: 'a' is run by two hosts; ")
        for gone in (A, CENTRE):
            mistaken.peers.gone(gone)
            assert left_alone(mistaken) == [
                f"the host of 'b', the coordinator has let another one in with 'a': {ALONE} itself",
                "if somebody has seen that no other host runs 'a' any more, stop this one and start it again: "
                "it drives the safe outputs 3 s later, unless that is said again",
            ]
        await cell.end_all()

    asyncio.run(main())


@pytest.mark.parametrize("is_said_again", [True, False])
def test_a_host_that_is_started_again_after_a_third_ones_word_drives_the_safe_outputs_unless_that_is_said_again(
    is_said_again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.2)

    async def main() -> None:
        cell, journal = Cell(monkeypatch), MemoryJournal()
        await cell.begin()
        for is_said in (True, is_said_again):
            host = cell.start(A, journal)
            await asyncio.sleep(0)
            if is_said:
                host.peers.refused(CENTRE, run_by_two(A))
                await asyncio.sleep(0.5)
                assert cell.written == []
                await cell.end_all()
                assert cell.written == []
        if not is_said_again:
            await until(lambda: cell.written == ["out"], "the safe outputs")
            assert not left_alone(host)
            await cell.end_all()

    asyncio.run(main())


def test_a_coordinator_that_two_hosts_have_keeps_neither_from_its_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.1)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        host = cell.hosts.host((*A, COORDINATOR), MemoryJournal())
        host.driver = bound_driver(parse_binding(BINDING), SPLIT.net, SPLIT.subnet("a"))
        cell.tasks.append(asyncio.create_task(host.main()))
        await asyncio.sleep(0)
        host.peers.refused(("x", COORDINATOR), run_by_two((COORDINATOR,)))
        assert host.peers.claimed == ()
        await until(lambda: cell.written == ["out"], "the safe outputs")
        await cell.end_all()

    asyncio.run(main())


def test_of_two_refused_hosts_the_end_of_one_says_nothing_of_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        alone = cell.start(A)
        await asyncio.sleep(0)
        for names in (("a",), ("a", "b")):
            alone.peers.refused(names, run_by_two(("a",)))
        alone.peers.gone(("a", "b"))
        assert list(alone.peers.claimed) == ["a"]
        assert alone.peers.turned_away.keys() == {"a"}
        alone.peers.gone(("a",))
        assert list(alone.peers.claimed) == []
        assert not alone.peers.turned_away
        await cell.end_all()

    asyncio.run(main())


def test_machines_of_another_host_are_driven_some_time_after_that_has_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.1)
    monkeypatch.setattr(peers, "PARTED_SECONDS", 0.4)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        alone = cell.start(A)
        cell.start(A)
        await until(lambda: alone.peers.claimed == ("a",), "the other one")
        await asyncio.sleep(0.6)
        assert cell.written == []
        cell.tasks.pop().cancel()
        await until(lambda: not alone.peers.claimed, "its end")
        assert cell.written == []
        assert alone.peers.is_hands_off
        gone = "the host that had 'a' is gone, or a line to it is broken"
        assert left_alone(alone) == [f"{gone}: {ALONE}, or that has been gone for 0.4 s"]
        await until(lambda: cell.written == ["out"], "the safe outputs")
        assert not left_alone(alone)
        await cell.end_all()

    asyncio.run(main())


def test_machines_of_a_host_that_is_gone_as_soon_as_it_has_come_are_left_alone_as_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.1)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        alone = cell.start(A)
        await asyncio.sleep(0.05)
        alone.peers.refused(A, run_by_two(A))
        alone.peers.gone(A)  # in the same turn of the loop
        await asyncio.sleep(0.4)
        assert cell.written == []
        assert len(left_alone(alone)) == 1
        await cell.end_all()

    asyncio.run(main())


def test_the_end_of_a_host_with_other_machines_puts_nothing_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.2)
    monkeypatch.setattr(peers, "PARTED_SECONDS", 600.0)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        alone = cell.start(A)
        await asyncio.sleep(0)
        alone.peers.refused(("b",), Refusal(Diagnostic("F5020", "it holds another bundle", "give it this one")))
        alone.peers.gone(("b",))
        await until(lambda: cell.written == ["out"], "the safe outputs")
        await cell.end_all()

    asyncio.run(main())


def test_a_host_that_hears_of_nobody_drives_the_safe_outputs_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 0.2)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        alone = cell.start(A)
        await until(lambda: alone.peers.is_hands_off, "the driver")
        assert cell.written == []
        assert left_alone(alone) == [f"another host may have 'a': {ALONE}, or nobody says so within 0.2 s of its start"]
        await until(lambda: cell.written == ["out"], "the safe outputs")
        assert alone.peers.is_unmet
        assert not left_alone(alone)
        await cell.end_all()

    asyncio.run(main())


def test_a_host_that_was_let_in_before_drives_them_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 600.0)

    async def main() -> None:
        cell, journal = Cell(monkeypatch), MemoryJournal()
        await cell.begin()
        cell.start(CENTRE)
        cell.start(A, journal)
        await until(lambda: "n" in cell.written, "the command: it was let in")
        await cell.end_all()
        cell.tasks.clear()
        cell.written.clear()
        again = cell.start(A, journal)
        await until(lambda: cell.written[:1] == ["out"], "the safe outputs")
        assert again.peers.nobody_met
        await cell.end_all()

    asyncio.run(main())


def test_an_emergency_stop_is_driven_by_a_host_that_nobody_has_let_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MEET_SECONDS", 600.0)

    async def main() -> None:
        cell = Cell(monkeypatch)
        await cell.begin()
        host = cell.start(A)
        await asyncio.sleep(0.05)
        assert cell.written == []
        host.emergency_stop("a person")
        await cell.tasks[0]
        assert cell.written == ["out"]

    asyncio.run(main())
