"""A sensor that was not read is no 0: its gates are closed until it is, also those that want it 0."""

import asyncio
from importlib.metadata import EntryPoint

import pytest
from support.third_party_driver import MemoryEnd

from firable.decompose.splitting.cut import split
from firable.executor.drivers import kinds
from firable.executor.drivers.bench import until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.device import Value
from firable.executor.drivers.driver import Driver
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.situation import Situation
from firable.nets.interchange import net_digest
from firable.nets.net import Net
from firable.nets.text import parse_net

TOGETHER = parse_net("""
firable: 1
cell: arm
controllers:
  line: {coordinator: true, start: order, places: {order: , given: }}
  a:
    start: [locked, home]
    inputs: [someone, key]
    places: {locked: , turned: , home: , away: {send: {machine: A, command: MOVE}, until: there}}
transitions:
  go:   {from: [line.order, a.home], to: [line.given, a.away], unless: a.someone}
  back: {from: a.away, to: a.home}
  turn: {from: a.locked, to: a.turned, if: a.key}
""")
ALONE = parse_net("""
firable: 1
cell: arm
controllers:
  a:
    start: [locked, home]
    inputs: [someone, key]
    places: {locked: , turned: , home: , away: {send: {machine: A, command: MOVE}, until: there}}
transitions:
  go:   {from: a.home, to: a.away, unless: a.someone}
  back: {from: a.away, to: a.home}
  turn: {from: a.locked, to: a.turned, if: a.key}
""")
BINDING = """
firable_bind: 1
cell: arm
devices:
  far: {driver: theirs, memory: far, timeout_s: 0.05, retry_s: 0.01, retry_max_s: 0.01, start_s: START,
        channels: {A: {command: out, taken: in, done: ok}}}
signals:
  a.someone: {device: far, read: someone, on_loss: LOSS}
  a.key: {device: far, read: key, on_loss: '0'}
  a.there: acknowledged
commands: {a.away: {device: far, channel: A}}
"""


@pytest.fixture(autouse=True)
def theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    one = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [one])


def run_of(net: Net, driver: Driver) -> Host:
    conduct = Conduct(operator=lambda _: asyncio.sleep(600))
    return Host(split(net), driver, Recorder(net, net_digest(net), None), conduct)


class Rig:
    """A host, its device at the far end, and what was written there."""

    def __init__(self, net: Net, on_loss: str = "fault", start_s: float = 60.0) -> None:
        self.net = net
        self.binding = parse_binding(BINDING.replace("LOSS", on_loss).replace("START", f"{start_s:g}"))
        self.far = MemoryEnd("far")
        self.written: list[Value] = []

    def host(self) -> Host:
        return run_of(self.net, bound_driver(self.binding, self.net))

    async def connect(self) -> None:
        await self.far.start(lambda _, value: self.written.append(value))

    async def seen(self, host: Host, *, value: bool) -> None:
        await until(lambda: host.driver.readings()["a.someone"].value is value, "the signal was read")
        await asyncio.sleep(0.05)
        await host.quiet()


async def ended(host: Host, ending: asyncio.Task[Situation]) -> None:
    host.stop()
    await ending


@pytest.mark.parametrize("net", [ALONE, TOGETHER], ids=["alone", "voted"])
def test_a_situation_says_which_sensors_are_not_read_yet(net: Net) -> None:
    async def main() -> None:
        rig = Rig(net)
        host = rig.host()
        ending = asyncio.create_task(host.main())
        await host.quiet()
        assert told(host) == ["go waits for a.someone to be read", "turn waits for a.key to be read"]
        rig.far.values["someone"] = 1
        await rig.connect()
        await rig.seen(host, value=True)
        assert told(host) == ["go waits for not a.someone", "turn waits for a.key to be read"]
        await ended(host, ending)

    def told(host: Host) -> list[str]:
        return [str(one) for one in host.situation().blocked]

    asyncio.run(main())


@pytest.mark.parametrize("net", [ALONE, TOGETHER], ids=["alone", "voted"])
def test_nothing_fires_on_a_signal_that_was_not_read(net: Net) -> None:
    async def main() -> None:
        rig = Rig(net)
        host = rig.host()
        ending = asyncio.create_task(host.main())
        await until(lambda: bool(host.driver.unreached), "the device is waited for")
        await host.quiet()
        assert host.recorder.firings["go"] == 0
        rig.far.values["someone"] = 1
        await rig.connect()
        await rig.seen(host, value=True)
        assert (host.recorder.firings["go"], rig.written) == (0, [])
        rig.far.show("someone", 0)
        await until(lambda: bool(rig.written), "the command")
        await ended(host, ending)

    asyncio.run(main())


def test_a_pause_outlasts_the_reading_and_no_step_comes_before_it() -> None:
    async def main() -> None:
        rig = Rig(ALONE)
        host = rig.host()
        ending = asyncio.create_task(host.main())
        assert host.pause()
        assert await host.step() is None
        rig.far.values["someone"] = 0
        await rig.connect()
        await rig.seen(host, value=False)
        assert host.recorder.firings["go"] == 0
        assert await host.step() == "go"
        await ended(host, ending)

    asyncio.run(main())


@pytest.mark.parametrize(("on_loss", "firings"), [("'0'", 1), ("'1'", 0)])
@pytest.mark.parametrize("is_there", [True, False])
def test_a_value_that_a_policy_gives_stands_in_for_one_that_is_not_shown(
    on_loss: str, firings: int, *, is_there: bool
) -> None:
    async def main() -> None:
        rig = Rig(ALONE, on_loss, start_s=0.2)
        if is_there:
            await rig.connect()
        host = rig.host()
        ending = asyncio.create_task(host.main())
        await rig.seen(host, value=on_loss == "'1'")
        assert host.recorder.firings["go"] == firings
        await ended(host, ending)

    asyncio.run(main())


def test_a_gate_of_a_signal_that_is_never_shown_stays_closed_and_others_open() -> None:
    async def main() -> None:
        rig = Rig(ALONE, "hold", start_s=0.2)
        rig.far.values["key"] = 1
        await rig.connect()
        host = rig.host()
        ending = asyncio.create_task(host.main())
        await until(lambda: any("'a.someone' (at someone)" in one for one in host.driver.unreached), "that is told")
        await host.quiet()
        assert (host.recorder.firings["turn"], host.recorder.firings["go"]) == (1, 0)
        await ended(host, ending)

    asyncio.run(main())


@pytest.mark.parametrize("net", [ALONE, TOGETHER], ids=["alone", "voted"])
def test_in_a_dry_run_a_sensor_that_shows_1_is_no_0_at_first(net: Net) -> None:
    async def main() -> None:
        host = run_of(net, DryRunDriver(split(net).subnets, 0.01))
        ending = asyncio.create_task(host.main())
        await until(lambda: host.recorder.firings["turn"] > 0, "the sensors are told")
        await host.quiet()
        assert host.recorder.firings["go"] == 0
        await ended(host, ending)

    asyncio.run(main())
