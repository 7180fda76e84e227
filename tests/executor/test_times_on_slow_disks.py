"""Time limits while the disk takes its time: each time begins when its own command has left, and waits for no other."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from math import inf

from support.hosts import ended_within
from support.slow_disks import Rig, turns

from firable.executor.drivers.bench import PATIENCE_S, until
from firable.executor.operating.situation import State
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.messages import Stored
from firable.nets.text import parse_net
from firable.semantics.replaying import replay
from firable.semantics.trace import parse_trace

LIMIT_SECONDS = 0.1
CELL = """\
firable: 1
cell: cell
controllers:
  a:
    start: low
    inputs: s
    places: {low: {send: {machine: A, command: LOW}}, high: {send: {machine: A, command: HIGH}}}
  b:
    start: [free, still]
    inputs: [key, knob]
    places:
      free:
      working: {send: {machine: B, command: WORK}, until: worked, within: 100ms}
      still:
      turning: {send: {machine: C, command: TURN}, until: turned, within: 100ms}
transitions:
  up: {from: a.low, to: a.high, if: a.s}
  down: {from: a.high, to: a.low, unless: a.s}
  begin: {from: b.free, to: b.working, if: b.key}
  leave: {from: b.working, to: b.free, unless: b.key}
  again: {from: b.working_fault, to: b.free, unless: b.key}
  turn: {from: b.still, to: b.turning, if: b.knob}
  rest: {from: b.turning, to: b.still, unless: b.knob}
  anew: {from: b.turning_fault, to: b.still, unless: b.knob}
"""


def running(rig: Rig) -> dict[str, float]:
    """When the times are over."""
    return rig.host.acts.controllers["b"].timers.running


async def sensed(rig: Rig, *signals: str) -> None:
    for signal in signals:
        rig.host.signal(signal, value=True, entry=None)
    await turns()


def is_kept(rig: Rig) -> bool:
    """Whether the trace is one of the net, to the end."""
    return replay(parse_net(CELL), parse_trace(rig.stream.getvalue())).complete


def noted(rig: Rig, note: str) -> list[str]:
    return [line["place"] for line in rig.lines if line.get("note") == note]


def test_a_time_begins_when_its_command_has_left_and_not_while_that_waits_for_the_disk() -> None:
    async def main() -> None:
        rig = Rig(CELL)
        async with rig.running():
            await rig.slow_from_now_on()
            await sensed(rig, "b.key")
            assert running(rig) == {"b.working": -inf}
            await rig.answer()  # to what was done before
            assert running(rig) == {"b.working": -inf}
            assert "b.working" not in rig.machines.sent
            await rig.answer()
            assert "b.working" in rig.machines.sent
            await until(lambda: not running(rig), "the end of the time")
            await rig.answer_all()
            assert "b.working_timeout" in rig.fired

    asyncio.run(main())


def test_a_time_is_over_while_another_command_of_its_controller_waits_for_the_disk() -> None:
    async def main() -> None:
        rig = Rig(CELL)
        async with rig.running():
            await sensed(rig, "b.key")
            assert rig.machines.sent == ["b.working"]
            await rig.slow_from_now_on()
            await sensed(rig, "b.knob")
            assert "b.turning" in rig.host.marking
            await until(lambda: "b.working_fault" in rig.host.marking, "the end of the time")
            assert "b.turning" not in rig.machines.sent
            assert running(rig) == {"b.turning": -inf}, "accused of a command that it has not had"
            await rig.answer_all()
            assert "b.turning" in rig.machines.sent
            await until(lambda: not running(rig), "the end of the other time")
            await rig.answer_all()
            assert rig.fired == ["begin", "up", "turn", "b.working_timeout", "b.turning_timeout"]
        assert is_kept(rig)

    asyncio.run(main())


def test_a_time_that_is_over_in_a_pause_on_a_slow_disk_is_taken_when_the_run_is_resumed() -> None:
    async def main() -> None:
        rig = Rig(CELL)
        async with rig.running():
            await sensed(rig, "b.key")
            await rig.slow_from_now_on()
            await sensed(rig, "b.knob")
            rig.host.pause()
            await until(lambda: list(running(rig)) == ["b.turning"], "the end of the time")
            await rig.answer_all()
            assert "b.turning" in rig.machines.sent, "it was decided before the pause"
            await until(lambda: not running(rig), "the end of the other time")
            await rig.answer_all()
            assert {"b.working", "b.turning"} <= set(rig.host.marking)
            rig.host.resume()
            await turns()
            assert {"b.working_fault", "b.turning_fault"} <= set(rig.host.marking)
            await rig.answer_all()
        assert is_kept(rig)

    asyncio.run(main())


def test_a_stop_on_a_slow_disk_ends_in_order_whatever_time_is_over_meanwhile() -> None:
    async def main() -> None:
        rig = Rig(CELL)
        async with rig.running() as ending:
            await sensed(rig, "b.key")
            await rig.slow_from_now_on()
            await sensed(rig, "b.knob")
            rig.host.stop()
            await until(lambda: list(running(rig)) == ["b.turning"], "the end of the time")
            await asyncio.sleep(2 * LIMIT_SECONDS)
            assert running(rig) == {"b.turning": -inf}
            await rig.answer_all()
            assert (await ended_within(ending, PATIENCE_S)).state is State.STOPPED
            assert rig.machines.sent == ["b.working"]
            assert noted(rig, "kept back") == ["a.high", "b.turning"]
            assert rig.fired == ["begin", "up", "turn"]
        assert is_kept(rig)

    asyncio.run(main())


async def left_by_a_stop(signals: Iterable[str]) -> dict[str, dict[str, Stored]]:
    """What the disk of a run has that was stopped after it had given a command for each of these."""
    rig = Rig(CELL)
    async with rig.running() as ending:
        await sensed(rig, *signals)
        rig.host.stop()
        await ended_within(ending, PATIENCE_S)
    return {machine: dict(kept) for machine, kept in rig.journal.durable.items()}


def test_after_a_restart_on_a_slow_disk_the_time_of_a_command_that_is_sent_again_begins_when_it_has_left() -> None:
    async def main() -> None:
        rig = Rig(CELL, durable=await left_by_a_stop(("b.key", "b.knob")))
        rig.machines.says = {"b.working": Answer.WORKING, "b.turning": Answer.NOT_RECEIVED}
        host = rig.host
        async with rig.running():
            await until(lambda: host.taking_up is not None and host.taking_up.is_final, "the answers")
            await sensed(rig, "b.key", "b.knob")
            await asyncio.sleep(2 * LIMIT_SECONDS)
            assert running(rig) == {}, "a controller that is held times nothing"
            rig.journal.is_slow = True
            assert host.resume()
            await turns()
            assert running(rig)["b.turning"] == -inf < running(rig)["b.working"]
            await until(lambda: "b.working_fault" in host.marking, "the end of the time")
            assert (running(rig), rig.machines.sent) == ({"b.turning": -inf}, [])
            await rig.answer_all()
            assert rig.machines.sent == ["b.turning"]
            await until(lambda: "b.turning_fault" in host.marking, "the end of the other time")
            await rig.answer_all()
            assert rig.fired == ["b.working_timeout", "b.turning_timeout"]

    asyncio.run(main())
