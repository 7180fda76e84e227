"""`driver: simulated`: machines that are not there yet, beside those that are."""

import asyncio
from importlib.metadata import EntryPoint

import pytest
from support.third_party_driver import MemoryEnd

from firable.executor.drivers import kinds
from firable.executor.drivers.bench import Heard, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver, bound_driver
from firable.executor.drivers.driver import Answer
from firable.nets.text import parse_net

NET = parse_net("""
firable: 1
cell: mixed
controllers:
  r: {start: free, places: {free: , move: {send: {machine: R, command: MOVE, to: A}, until: moved}}}
  m:
    start: open
    inputs: part
    places: {open: , clamp: {send: {machine: M, command: CLAMP}, until: closed}, halt: {send: {machine: M, command: X}}}
transitions:
  go: {from: r.free, to: r.move}
  goes: {from: r.move, to: r.free}
  shut: {from: m.open, to: m.clamp, if: m.part}
  stay: {from: m.clamp, to: m.halt}
  out: {from: m.halt, to: m.open}
""")
BINDING = """
firable_bind: 1
cell: mixed
devices:
  real:
    driver: theirs
    memory: mixed
    channels: {R: {command: R, taken: R.taken, done: R.done}}
  twin:
    driver: simulated
    seconds: 0.02
    jitter: 0.5
    shows: {part: 1, shut: 0}
    effects: {M CLAMP: {seconds: 0.01, then: {shut: 1}}}
    safe: {stop: true}
    channels: {M: {command: M, taken: M.taken, done: M.done, failed: M.failed}}
signals:
  m.part: {device: twin, read: part}
  m.closed: {device: twin, read: shut}
  r.moved: acknowledged
commands:
  r.move: {device: real, channel: R}
  m.clamp: {device: twin, channel: M}
  m.halt: {device: twin, channel: M}
"""


@pytest.fixture(autouse=True)
def _installed(monkeypatch: pytest.MonkeyPatch) -> None:
    theirs = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [theirs])


def driver(text: str = BINDING) -> BoundDriver:
    return bound_driver(parse_binding(text), NET)


def test_some_machines_are_real_and_some_are_simulated() -> None:
    async def main() -> None:
        end, heard, mixed = MemoryEnd("mixed"), Heard(), driver()
        await end.start(lambda point, value: end.show(f"{point}.taken", str(value).partition(" ")[0]))
        task = asyncio.create_task(mixed.run(heard, heard))
        mixed.send(NET.place("r.move"), 1)
        mixed.send(NET.place("m.clamp"), 1)
        mixed.send(NET.place("m.halt"), 1)
        await until(lambda: len(heard.takings) == 3, "all commands are taken")
        # The second command to M has broken off the first, as a channel is for one machine.
        mixed.send(NET.place("m.clamp"), 2)
        await until(lambda: heard.signals[-1:] == [("m.closed", True, 2)], "the sensor and the completion")
        assert ("m.part", True, None) in heard.signals
        assert not mixed.at_rest
        assert heard.faults == []
        task.cancel()
        await asyncio.wait([task])

    asyncio.run(main())


def test_a_stop_breaks_off_what_a_simulated_machine_is_at() -> None:
    async def main() -> None:
        end, heard, mixed = MemoryEnd("mixed"), Heard(), driver(BINDING.replace("seconds: 0.01", "seconds: 60"))
        await end.start(lambda _point, _value: None)
        task = asyncio.create_task(mixed.run(heard, heard))
        mixed.send(NET.place("m.clamp"), 1)
        await until(lambda: heard.takings, "the command is taken")
        mixed.stop()
        await until(mixed.devices["twin"].kept.stopped.is_set, "the stop")
        task.cancel()
        await asyncio.wait([task])
        assert mixed.devices["twin"].kept.is_safe
        assert [signal for signal, _, _ in heard.signals] == ["m.part"]

    asyncio.run(main())


def test_after_a_restart_a_simulated_machine_knows_nothing_of_its_commands() -> None:
    async def main() -> None:
        heard, mixed = Heard(), driver()
        await MemoryEnd("mixed").start(lambda _point, _value: None)
        task = asyncio.create_task(mixed.run(heard, heard))
        assert await mixed.ask(NET.place("m.clamp"), 1) is Answer.UNKNOWN
        task.cancel()
        await asyncio.wait([task])

    asyncio.run(main())


def test_what_no_command_has_changed_yet_is_shown_from_the_start() -> None:
    async def main() -> None:
        text = BINDING.replace("shows: {part: 1, shut: 0}", "shows: {part: 1}\n    start_s: 0.05")
        heard, mixed = Heard(), driver(text)
        await MemoryEnd("mixed").start(lambda _point, _value: None)
        task = asyncio.create_task(mixed.run(heard, heard))
        await until(lambda: mixed.devices["twin"].is_overdue, "the time to show all")
        assert mixed.devices["twin"].unshown == ""
        assert [note for note in heard.notes if note.startswith("twin")] == ["twin: connected"]
        task.cancel()
        await asyncio.wait([task])

    asyncio.run(main())


def test_a_point_that_no_channel_of_a_simulated_device_has_is_told() -> None:
    async def main() -> None:
        text = BINDING.replace("failed: M.failed", "failed: N.failed").replace(
            "    jitter", "    start_s: 0.05\n    jitter"
        )
        heard, mixed = Heard(), driver(text)
        await MemoryEnd("mixed").start(lambda _point, _value: None)
        task = asyncio.create_task(mixed.run(heard, heard))
        await until(lambda: mixed.devices["twin"].is_overdue, "the time to show all")
        assert mixed.devices["twin"].unshown == "twin has never shown what 'M' has failed (at N.failed)"
        task.cancel()
        await asyncio.wait([task])

    asyncio.run(main())
