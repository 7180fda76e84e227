"""A run listens before it begins whether another program sends the heartbeat of one of its devices."""

import asyncio
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from threading import Event

import pytest
from support.takeovers import OLD, bundle

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.binding import Binding, parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.device import Connection, LinkError, Point, Value, Wanted, Writes
from firable.executor.drivers.kinds import OWN, kind_named
from firable.executor.drivers.mqtt import Mqtt, MqttOptions
from firable.executor.drivers.rivals import SECONDS_MAX, SECONDS_MIN, demand_alone, listen_first, shows
from firable.executor.journal.sqlite_journal import mark_of, mark_text
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import Greeting
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.hosting import own_net, run_host
from firable.executor.operating.running import run_bound
from firable.nets.bundle import read_bundle
from firable.nets.diagnostics import Diagnostic, InputError

BINDING = """firable_bind: 1
cell: c
devices:
  D: {driver: mqtt, host: 127.0.0.1, timeout_s: 1, heartbeat: {write: beat, every_s: EVERY}}
  E: {driver: mqtt, host: 127.0.0.2, timeout_s: 1}
"""


class Shows:
    """A connection that shows these batches of values of the heartbeat, one each tenth of a second, and then none."""

    def __init__(self, batches: Sequence[Sequence[Value]], point: Point = "beat") -> None:
        self.batches = [*batches]
        self.point = point
        self.closed = 0

    async def read(self) -> Sequence[tuple[Point, Value]]:
        await asyncio.sleep(0.1)
        if not self.batches:
            await asyncio.get_running_loop().create_future()
        return [(self.point, value) for value in self.batches.pop(0)]

    async def write(self, writes: Writes) -> None:
        raise AssertionError(f"{writes} must not be written")

    async def close(self) -> None:
        self.closed += 1


def listened(monkeypatch: pytest.MonkeyPatch, connection: Connection | Exception, every_s: float = 0.1) -> float:
    """How long it was listened to a device with this connection."""

    async def connect(_self: object, _options: object, wanted: Wanted) -> Connection:
        assert wanted.read == ("beat",), "who sends no heartbeat there is not connected"
        if isinstance(connection, Exception):
            raise connection
        return connection

    async def main() -> float:
        before = asyncio.get_running_loop().time()
        await demand_alone(parse_binding(BINDING.replace("EVERY", str(every_s))))
        return asyncio.get_running_loop().time() - before

    monkeypatch.setattr(Mqtt, "connect", connect)
    seconds: float = run_in_virtual_time(main())
    return seconds


@pytest.mark.parametrize(
    "shown",
    [[[7], [8], [9]], [[7, 8, 9]], [[True], [False], [True]], [["7"], ["8"], ["8"], ["9"]], [[65535], [0], [1]]],
)
def test_a_heartbeat_that_changes_twice_is_another_programs(
    shown: list[list[Value]], monkeypatch: pytest.MonkeyPatch
) -> None:
    connection = Shows(shown)
    with pytest.raises(InputError, match=r"F5106.*sends the heartbeat of 'D', at 'beat'"):
        listened(monkeypatch, connection)
    assert connection.closed == 1


@pytest.mark.parametrize(
    "shown",
    [
        [],
        [[7], [7], [7], [7]],
        [[7], [8], [8], [8]],
        [["BadWaitingForInitialData"], ["BadCommunicationError"], [41]],
    ],
    ids=["nothing", "no change", "the last beat of a process that was killed", "a server that begins"],
)
def test_what_changes_once_or_is_no_beat_is_nobodys(shown: list[list[Value]], monkeypatch: pytest.MonkeyPatch) -> None:
    connection = Shows(shown)
    assert listened(monkeypatch, connection) == pytest.approx(SECONDS_MIN)
    assert connection.closed == 1


def test_each_kind_says_whether_what_others_write_is_shown() -> None:
    assert {name for name in OWN if shows(kind_named(name))} == {"modbus-tcp", "opcua", "mqtt"}


def test_another_point_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    listened(monkeypatch, Shows([[7], [8], [9]], "other"))


@pytest.mark.parametrize(("every_s", "seconds"), [(0.05, SECONDS_MIN), (0.5, 2.0), (60.0, SECONDS_MAX)])
def test_it_is_listened_for_four_beats_but_not_for_ever(
    every_s: float, seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert listened(monkeypatch, Shows([]), every_s) == pytest.approx(seconds)


def test_a_device_that_is_polled_more_seldom_than_it_beats_is_listened_to_for_four_polls(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(MqttOptions, "polled_s", 0.75)
    assert listened(monkeypatch, Shows([])) == pytest.approx(3.0)


def test_what_was_heard_is_heard_though_the_connection_is_not_closed_well(monkeypatch: pytest.MonkeyPatch) -> None:
    class Bad(Shows):
        async def close(self) -> None:
            raise OSError("reset")

    with pytest.raises(InputError, match="F5106"):
        listened(monkeypatch, Bad([[7], [8], [9]]))


def test_a_name_server_that_does_not_answer_holds_up_nothing_for_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    answered, asked = Event(), list[bool]()

    async def connect(_self: object, _options: object, _wanted: Wanted) -> Connection:
        await asyncio.to_thread(lambda: asked.append(answered.wait(20)))
        raise LinkError("no such name")

    monkeypatch.setattr(Mqtt, "connect", connect)
    listen_first(parse_binding(BINDING.replace("EVERY", "0.1").replace("timeout_s: 1", "timeout_s: 0.05")))
    assert asked == [], "it is still waited for by its thread"
    answered.set()


HANGING = """
import asyncio, time
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.mqtt import Mqtt
from firable.executor.drivers.rivals import listen_first

async def connect(self, options, wanted):
    await asyncio.to_thread(time.sleep, 600)

Mqtt.connect = connect
listen_first(parse_binding({binding!r}))
print("listened", flush=True)
"""


def test_the_end_of_the_process_does_not_wait_for_a_name_server_either() -> None:
    binding = BINDING.replace("EVERY", "0.1").replace("timeout_s: 1", "timeout_s: 0.05")
    program = [sys.executable, "-c", HANGING.format(binding=binding)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout == "listened\n"


@pytest.mark.parametrize("error", [LinkError("cut"), OSError("no route"), KeyError("a mistake of the library")])
def test_what_goes_wrong_says_nothing_and_is_met_again_in_the_run(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert listened(monkeypatch, error) == 0.0


BOUND = """firable_bind: 1
cell: cell
devices:
  plc: {driver: modbus-tcp, host: 127.0.0.1, port: 9, channels: {R: {number: holding 1, done: input 1}}}
signals:
  robot.worked: acknowledged
commands:
  robot.working: {device: plc, channel: R, write: {holding 2: 1}}
"""


def test_a_run_that_is_not_alone_leaves_no_journal_and_no_trace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = read_bundle(bundle(tmp_path, "cell", OLD))
    binding, conduct = parse_binding(BOUND), Conduct(journal_path=tmp_path / "journal", trace=tmp_path / "trace")
    here = ("robot",)
    drivers = partial(bound_driver, binding, read.net, own_net(read.decomposition, here))

    def not_alone(bound: Binding) -> None:
        assert set(bound.document.devices) == {"plc"}
        raise InputError([Diagnostic("F5106", "another program sends the heartbeat", "")])

    for module in ("running", "hosting"):
        monkeypatch.setattr(f"firable.executor.operating.{module}.listen_first", not_alone)
    link = InProcessLink(Exchange(), Greeting(read.digest, here))
    runs = (lambda: run_bound(read, binding, conduct), lambda: run_host(read, here, drivers, link, conduct))

    async def within_a_loop() -> None:
        for run in runs:
            with pytest.raises(RuntimeError, match="a run has an event loop of its own"):
                run()

    asyncio.run(within_a_loop())
    for run in runs:
        with pytest.raises(InputError, match="F5106"):
            run()
    assert not list(tmp_path.glob("journal*"))
    assert not (tmp_path / "trace").exists()
    mark_of(tmp_path / "journal").write_text(mark_text("cell", tmp_path / "new", ()))
    for run in runs:  # whoever beats there is the one that goes on
        with pytest.raises(InputError, match="F5036"):
            run()
