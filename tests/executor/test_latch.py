"""After an emergency stop the process stays, safe and latched, until it is reset; then it is as after a restart."""

from __future__ import annotations

import asyncio
import copy
import io
import time
from collections.abc import Awaitable, Callable
from functools import partial

import pytest
from support.served_cells import DECOMPOSITION, NET, Served, served

from firable.executor.drivers.bench import until
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import KEY, TRACE, Recorder
from firable.executor.operating.restart import uncertain
from firable.executor.operating.service import patience_with
from firable.executor.operating.situation import Situation, State
from firable.executor.protocol.commands import Answer
from firable.nets.interchange import net_digest
from firable.semantics.replaying import replay
from firable.semantics.trace import Noted, parse_trace


async def executed(one: Served, operator: Callable[[Host], Awaitable[None]], said: list[str]) -> tuple[Situation, str]:
    """Run the net on a served cell with an operator; the trace must be one of the net, whatever happened between."""
    stream = io.StringIO()
    driver = bound_driver(one.binding, NET)
    host = Host(
        DECOMPOSITION,
        driver,
        Recorder(NET, net_digest(NET), stream),
        Conduct(operator=operator, tell=lambda kind, sentence: said.append(f"{kind}: {sentence}")),
        patience=patience_with(driver),
        latched=partial(bound_driver, one.binding, NET, latched=True),
    )
    situation = await host.main()
    assert replay(NET, parse_trace(stream.getvalue())).complete
    return situation, stream.getvalue()


async def reset(host: Host) -> None:
    """Reset it as soon as nothing is against it, and say what became of what no machine can tell."""
    await until(lambda: host.latch is not None and not host.latch.driver.against(), "that nothing is against it")
    assert host.reset() == ()
    if host.taking_up is not None and not host.taking_up.is_final:  # the machines are asked before anybody
        assert "look at the machine" not in host.situation().message
    await until(lambda: host.taking_up is not None and host.taking_up.is_final, "the answers of the machines")
    for place in uncertain(host):
        assert not host.say(place, Answer.NOT_RECEIVED)


def test_button_latches_and_the_cell_goes_on_after_it_is_released_reset_and_resumed() -> None:
    async def main() -> None:
        async with served(1) as one:
            said: list[str] = []

            async def operator(host: Host) -> None:
                await until(lambda: one.cell.at, "a machine at work")
                one.cell.press(pressed=True)
                await until(lambda: host.situation().state is State.LATCHED, "the latch")
                await until(lambda: not one.cell.at, "all machines stand")
                commands = host.recorder.commands
                pressed = "before it can be reset: modbus: 'button' is not closed"
                await until(lambda: host.situation().message.endswith(pressed), "what is against it")
                assert host.reset() == ("modbus: 'button' is not closed",)
                one.cell.press(pressed=False)
                await reset(host)
                assert host.situation().state is State.HELD
                await asyncio.sleep(0.2)
                assert host.recorder.commands == commands, "nothing moves by a reset"
                assert host.resume()
                await until(lambda: len(one.plant.delivered) == 1, "the workpiece")
                host.stop()

            situation, trace = await executed(one, operator, said)
            assert (situation.state, situation.message) == (State.STOPPED, "stopped by the operator")
            assert [workpiece.processed for workpiece in one.plant.delivered] == [1]
            notes = [event.note for event in parse_trace(trace).events if isinstance(event, Noted)]
            order = [note for note in notes if note in {"emergency stop", "not reset", "reset", "taken up"}]
            assert order == ["emergency stop", "not reset", "reset", "taken up"]
            assert any("latched: emergency stop: modbus: 'button' is open" in sentence for sentence in said)
            assert "held: 'robot' is held, until it is resumed" in said
            assert not any("restart" in sentence for sentence in said), "a reset is none"

    asyncio.run(main())


def test_device_that_is_switched_off_while_latched_is_no_fault() -> None:
    async def main() -> None:
        async with served(1) as one:

            async def operator(host: Host) -> None:
                await until(lambda: one.cell.at, "a machine at work")
                host.emergency_stop("a person")
                await until(lambda: host.latch is not None and not host.latch.driver.against(), "the latch")
                modbus = one.cell.devices["modbus"].end
                await modbus.cut()
                await until(lambda: host.reset() == ("modbus is not connected",), "what is against it")
                await modbus.mend()
                await reset(host)
                one.cell.press(pressed=True)  # a latch that was reset is one that can be set
                await until(lambda: host.situation().state is State.LATCHED, "the latch, again")
                host.stop()

            situation, trace = await executed(one, operator, [])
            assert (situation.state, situation.is_emergency) == (State.STOPPED, True)
            assert situation.message == "emergency stop: modbus: 'button' is open"
            assert not [
                event for event in parse_trace(trace).events if isinstance(event, Noted) and event.note == "fault"
            ]

    asyncio.run(main())


def test_device_that_has_not_confirmed_the_safe_outputs_is_named_until_it_has() -> None:
    async def main() -> None:
        async with served(1) as one:
            said: list[str] = []

            async def operator(host: Host) -> None:
                await until(lambda: one.cell.at, "a machine at work")
                modbus = one.cell.devices["modbus"].end
                await modbus.cut()
                host.emergency_stop("a person")
                unsafe = "a person; modbus has not confirmed the safe outputs: look at the machines"
                await until(lambda: any(unsafe in sentence for sentence in said), "that somebody has to look")
                assert not any("held safe" in sentence for sentence in said)
                await modbus.mend()
                await until(lambda: "a person; the machines are held safe" in host.situation().message, "that it has")
                host.stop()

            situation, _ = await executed(one, operator, said)
            assert (situation.state, situation.is_emergency) == (State.STOPPED, True)

    asyncio.run(main())


def test_emergency_stop_ends_a_run_that_nobody_could_reset() -> None:
    async def main() -> None:
        async with served(1) as one:

            async def operator(host: Host) -> None:
                await until(lambda: one.cell.at, "a machine at work")
                host.emergency_stop("a person")  # and goes home

            situation, _ = await executed(one, operator, [])
            assert (situation.state, situation.is_emergency) == (State.STOPPED, True)

    asyncio.run(main())


def test_time_of_a_run_goes_on_while_its_next_life_is_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        stream = io.StringIO()
        subnets = DECOMPOSITION.subnets
        recorder = Recorder(NET, net_digest(NET), stream)
        host = Host(DECOMPOSITION, DryRunDriver(subnets, 0.01), recorder, latched=lambda: DryRunDriver(subnets, 0.01))
        host.served = True
        begin = host.begin

        def begin_slowly(*, resume: bool) -> None:  # on a busy host, or from a slow disk
            time.sleep(0.05)
            host.note("unwatched")
            begin(resume=resume)

        monkeypatch.setattr(host, "begin", begin_slowly)
        run = asyncio.create_task(host.main())
        await until(lambda: sum(recorder.firings.values()) > 5, "firings")
        host.emergency_stop("a person")
        await until(lambda: host.situation().state is State.LATCHED, "the latch")
        assert host.reset() == ()
        await until(host.resume, "the answers of the machines")
        host.stop()
        await run
        assert replay(NET, parse_trace(stream.getvalue())).complete

    asyncio.run(main())


def test_latched_run_is_not_resumed_before_it_is_reset_and_may_be_latched_again() -> None:
    async def main() -> None:
        recorder = Recorder(NET, net_digest(NET), None)
        subnets = DECOMPOSITION.subnets
        host = Host(
            DECOMPOSITION,
            DryRunDriver(subnets, 0.01),
            recorder,
            latched=lambda: DryRunDriver(subnets, 0.01),
            begin_seconds=5.0,
        )
        host.served = True
        run = asyncio.create_task(host.main())

        async def reset_and_resumed(fired: int) -> None:
            host.emergency_stop("a person")
            await until(lambda: host.situation().state is State.LATCHED, "the latch")
            assert not host.resume()
            assert not host.pause()
            assert not host.stop(at_end_of_cycle=True)
            assert not host.draining
            assert all(controller.held for controller in host.controllers.values())
            assert host.reset() == ()
            assert host.reset() == ("there is no emergency stop to be reset",)
            await until(host.resume, "the answers of the machines")
            await until(lambda: sum(recorder.firings.values()) > fired, "that it goes on")

        await until(lambda: sum(recorder.firings.values()) > 5, "firings")
        for _ in range(2):
            await reset_and_resumed(sum(recorder.firings.values()) + 2)
        host.emergency_stop("a person")
        await until(lambda: host.situation().state is State.LATCHED, "the latch")
        assert host.now_seconds() > 5.0
        host.stop()
        situation = await run
        assert (situation.state, situation.message) == (State.STOPPED, "emergency stop: a person")
        assert situation.is_emergency

    asyncio.run(main())


def on(journal: MemoryJournal) -> Host:
    """The net on machines that take all they are given, gone on with from a journal; to be resumed beforehand."""
    subnets, kept = DECOMPOSITION.subnets, journal.kept(TRACE).get(KEY)
    return Host(
        DECOMPOSITION,
        DryRunDriver(subnets, 0.01),
        Recorder(NET, net_digest(NET), None, kept),
        Conduct(resume=True),
        journal=journal,
        latched=lambda: DryRunDriver(subnets, 0.01),
    )


def test_emergency_stop_outlives_a_process_that_is_killed_before_the_reset() -> None:
    async def killed() -> MemoryJournal:
        """What the journal holds at a moment after the emergency stop."""
        host = on(journal := MemoryJournal())
        host.served = True
        run = asyncio.create_task(host.main())
        await until(lambda: sum(host.recorder.firings.values()) > 5, "firings")
        host.emergency_stop("a person")
        await until(lambda: host.situation().state is State.LATCHED, "the latch")
        then = copy.deepcopy(journal)
        host.stop()
        await run
        return then

    async def main() -> None:
        journal = await killed()
        alone = on(copy.deepcopy(journal))
        fired = sum(alone.recorder.firings.values())
        situation = await asyncio.wait_for(alone.main(), 60)
        assert (situation.state, sum(alone.recorder.firings.values())) == (State.HELD, fired)
        host = on(journal)
        host.served = True
        run = asyncio.create_task(host.main())
        await until(lambda: host.situation().state is State.LATCHED, "the latch")
        assert "a person" in host.situation().message
        assert not host.resume()
        assert host.reset() == ()
        await until(lambda: host.taking_up is not None and host.taking_up.is_final, "the answers of the machines")
        assert host.situation().state is State.HELD
        assert sum(host.recorder.firings.values()) == fired
        await until(lambda: host.is_quiet, "that the reset is durable")
        again = on(copy.deepcopy(journal))
        again.served = True
        assert host.resume()
        await until(lambda: sum(host.recorder.firings.values()) > fired, "that it goes on")
        host.stop()
        await run
        run = asyncio.create_task(again.main())
        await until(lambda: sum(again.recorder.firings.values()) > fired, "that one that was reset goes on")
        again.stop()
        await run

    asyncio.run(main())
