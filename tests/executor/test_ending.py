"""However a run is ended, and whatever fails meanwhile: the machines are stopped, and nothing is commanded after."""

from __future__ import annotations

import asyncio
import io
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress

import pytest
from support.asking import heard
from support.hosts import ended_within

from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.driver import Answer, Clock, Listener
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.ending import with_failed
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.service import terminable
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.uncut import GIVEN_UP, HURRY_SECONDS, STOP_SECONDS
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.interchange import net_digest
from firable.nets.net import Place
from firable.nets.text import parse_net

LAMP = """\
firable: 1
cell: cell
controllers:
  robot:
    start: free
    inputs: key
    places:
      free:
      working: {send: {machine: R, command: WORK}, until: worked}
      waiting:
transitions:
  begin: {from: robot.free, to: robot.working}
  end: {from: robot.working, to: robot.waiting, if: robot.key}
"""
TIMED_LAMP = LAMP.replace(
    "until: worked}",
    "until: worked, within: 500ms}\n      working_fault: {send: {machine: R, command: STOP}, until: at_rest}",
).replace("transitions:", "transitions:\n  again: {from: robot.working_fault, to: robot.working}")


class Machine(DryRunDriver):
    """A machine that never completes anything, and notes what it is sent."""

    sent: list[tuple[str, int]]

    def send(self, place: Place, entry: int) -> None:
        assert not self.is_stopped
        self.sent.append((place.name, entry))

    async def ask(self, place: Place, entry: int) -> Answer:
        await asyncio.sleep(1)
        return Answer.NOT_RECEIVED if place.command is not None and entry else Answer.UNKNOWN


class Filling(MemoryJournal):
    """A journal whose disk is full at some time."""

    is_full = False

    def sync(self) -> None:
        if self.is_full:
            raise InputError([Diagnostic("F5034", "the disk is full", "")])


async def present(_: Host) -> None:
    await asyncio.sleep(60)


def run_of(
    journal: Journal, *, overdue_seconds: float = 120.0, resume: bool = False, text: str = LAMP
) -> tuple[Host, Machine]:
    net = parse_net(text)
    decomposition = split(net)
    machine = Machine(decomposition.subnets, 1.0, {"robot.key": False})
    machine.sent = []
    recorder = Recorder(net, net_digest(net), io.StringIO())
    return (
        Host(
            decomposition,
            machine,
            recorder,
            Conduct(operator=present, overdue_seconds=overdue_seconds, resume=resume),
            journal=journal,
        ),
        machine,
    )


@pytest.mark.parametrize(
    "act",
    [
        Host.stop,
        Host.pause,
        lambda run: run.emergency_stop("a person"),
        lambda run: run.driver_fault("R", "failed"),
        lambda run: run.signal("robot.worked", value=True, entry=1),
    ],
    ids=["stop", "pause", "emergency stop", "fault", "signal"],
)
def test_an_error_ends_the_run_and_stops_the_machines_even_where_its_caller_swallows_it(
    act: Callable[[Host], object],
) -> None:
    async def main() -> None:
        journal = Filling()
        run, machine = run_of(journal)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        journal.is_full = True
        act(run)  # as a timer of a driver, or the server of an operator, calls it
        with pytest.raises(InputError, match="full"):
            await ended_within(ending, 5)
        assert machine.is_stopped

    run_in_virtual_time(main())


async def stepped(run: Host) -> str | None:
    """As the endpoint of an operator does it."""
    run.commanded("step", "an operator")
    return await run.step()


def test_a_disk_that_fails_during_a_step_ends_the_step_with_the_run_and_commands_nothing() -> None:
    async def main() -> None:
        journal = Filling()
        run, machine = run_of(journal)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(0.5)
        run.pause()
        await asyncio.sleep(0.5)
        sent = list(machine.sent)
        journal.is_full = True
        fired = asyncio.create_task(stepped(run))
        with pytest.raises(InputError, match="full"):
            await ended_within(ending, 5)
        assert await asyncio.wait_for(fired, 1) is None
        assert machine.sent == sent
        assert not run.quiet_waiters

    run_in_virtual_time(main())


def test_a_disk_that_fails_while_a_run_is_taken_up_resumes_nothing() -> None:
    journal = Filling()
    journal.of = crashed().of
    run, machine = run_of(journal, resume=True)

    async def main() -> None:
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(0.5)
        journal.is_full = True
        with pytest.raises(InputError, match="full"):
            await ended_within(ending, 5)
        assert run.taking_up is not None
        assert machine.sent == []

    run_in_virtual_time(main())


def crashed(text: str = LAMP) -> MemoryJournal:
    """The journal of a run that has crashed a second after its command was issued."""
    journal = MemoryJournal()

    async def main() -> None:
        run, machine = run_of(journal, text=text)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        given_up = [("robot.working_fault", 1)] if text == TIMED_LAMP else []
        assert machine.sent == [("robot.working", 1), *given_up]
        assert run.outcome is not None
        run.outcome.cancel()
        with pytest.raises(asyncio.CancelledError):
            await ending

    run_in_virtual_time(main())
    return journal


def test_a_resume_after_the_stop_of_a_run_that_is_held_commands_nothing() -> None:
    journal = crashed()

    async def main() -> None:
        run, machine = run_of(journal)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(2)
        assert run.taking_up is not None
        assert run.taking_up.is_final
        run.stop()
        assert not run.resume()
        assert not run.pause()
        assert not run.stop(at_end_of_cycle=True)
        ended = await ending
        assert (ended.state, ended.is_unsettled) == (State.STOPPED, True)
        assert "'R WORK' of 'robot.working' has not reached its machine" in ended.message
        assert machine.sent == []

    run_in_virtual_time(main())


def test_a_command_that_its_time_limit_gave_up_is_not_said_to_be_sent_when_the_run_is_resumed() -> None:
    """Whoever resumes looks at what moves then."""
    journal = crashed(TIMED_LAMP)

    async def main() -> None:
        run, machine = run_of(journal, text=TIMED_LAMP)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(3)
        told = run.situation().message
        assert "'R WORK' of 'robot.working' was given up, its token has gone on" in told
        assert "'R STOP' of 'robot.working_fault' has not reached its machine, and will be sent" in told
        assert run.resume()
        await asyncio.sleep(1)
        assert machine.sent == [("robot.working_fault", 1)]
        run.stop()
        await ending

    run_in_virtual_time(main())


def test_a_pause_while_a_run_is_held_holds_until_the_operator_resumes() -> None:
    journal = crashed()

    async def main() -> None:
        run, machine = run_of(journal, resume=True)
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(0.1)
        run.pause()
        await asyncio.sleep(2)
        assert machine.sent == []
        assert run.situation().state is State.HELD
        run.resume()
        await asyncio.sleep(1)
        assert machine.sent == [("robot.working", 1)]
        assert not run.paused
        run.stop()
        await ending

    run_in_virtual_time(main())


class Slow(Machine):
    """A machine that takes a while to be stopped."""

    is_off = False

    async def run(self, clock: Clock, listener: Listener) -> None:
        try:
            await super().run(clock, listener)
        finally:
            await asyncio.sleep(1)
            self.is_off = True


def slow() -> tuple[Host, Slow]:
    run, machine = run_of(MemoryJournal())
    run.driver = slowly = Slow([split(run.net).subnet("robot")], 1.0)
    slowly.sent = machine.sent
    return run, slowly


def test_whoever_cancels_again_does_not_cut_off_the_safe_outputs() -> None:
    async def main() -> None:
        run, machine = slow()
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        for _ in range(4):
            ending.cancel()
            await asyncio.sleep(0.1)
        assert (await ending).state is State.STOPPED
        assert machine.is_off

    run_in_virtual_time(main())


ASKING = [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT]


@pytest.mark.parametrize("number", ASKING)
def test_a_second_signal_does_not_cut_off_the_safe_outputs(number: signal.Signals) -> None:
    run, machine = slow()

    async def ended() -> State:
        loop = asyncio.get_running_loop()
        for at in (1.0, 1.5, 1.7):
            loop.call_later(at, signal.raise_signal, number)
        return (await terminable(run)).state

    with heard(number):
        assert run_in_virtual_time(ended()) is State.STOPPED
    assert machine.is_off


def test_a_terminal_that_is_closed_does_not_end_a_run_that_was_begun_to_outlive_it() -> None:
    run, machine = slow()
    earlier = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as `nohup` leaves it

    async def ended() -> float:
        loop = asyncio.get_running_loop()
        loop.call_later(1, signal.raise_signal, signal.SIGHUP)
        loop.call_later(5, signal.raise_signal, signal.SIGTERM)
        await terminable(run)
        return loop.time()

    try:
        assert run_in_virtual_time(ended()) >= 5
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, earlier)
    assert machine.is_off


class Hanging(Machine):
    """A machine that never lets go."""

    async def run(self, clock: Clock, listener: Listener) -> None:
        try:
            await super().run(clock, listener)
        finally:
            while True:
                with suppress(asyncio.CancelledError):
                    await asyncio.sleep(1000)


def hanging() -> Host:
    run, machine = run_of(MemoryJournal())
    run.driver = held = Hanging([split(run.net).subnet("robot")], 1.0)
    held.sent = machine.sent
    return run


def test_a_driver_that_hangs_is_given_up_and_the_run_says_so() -> None:
    async def main() -> tuple[State, str, float]:
        run = hanging()
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        run.stop()
        ended = await ending
        return ended.state, ended.message, asyncio.get_running_loop().time()

    state, message, seconds = run_in_virtual_time(main())
    assert state is State.FAULT
    assert "driver did not end in time" in message
    assert seconds == pytest.approx(1 + STOP_SECONDS, abs=0.2)


class Failing(Machine):
    """A machine whose driver fails on its way out."""

    async def run(self, clock: Clock, listener: Listener) -> None:
        try:
            await super().run(clock, listener)
        finally:
            raise RuntimeError("a bug")


def test_a_driver_that_fails_when_it_is_to_stop_the_machines_makes_the_end_a_fault() -> None:
    async def main() -> None:
        run, machine = run_of(MemoryJournal())
        run.driver = failing = Failing([split(run.net).subnet("robot")], 1.0)
        failing.sent = machine.sent
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        run.stop()
        ended = await ending
        assert ended.state is State.FAULT
        assert "the driver failed at the end, RuntimeError: a bug: look at the machines" in ended.message

    run_in_virtual_time(main())


class Unconfirmed(Machine):
    """A machine of which nobody knows whether it is stopped."""

    unconfirmed = ("R",)


@pytest.mark.parametrize("fault", [False, True])
def test_safe_outputs_that_a_device_has_not_confirmed_make_the_end_a_fault(fault: bool) -> None:
    async def main() -> None:
        run, machine = run_of(MemoryJournal())
        run.driver = unsafe = Unconfirmed([split(run.net).subnet("robot")], 1.0)
        unsafe.sent = machine.sent
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        if fault:
            run.driver_fault("R", "failed")
        else:
            run.stop()
        ended = await ending
        assert ended.state is State.FAULT
        assert ended.message.startswith("R: failed; R has not confirmed" if fault else "stopped by the operator; R has")

    run_in_virtual_time(main())


@pytest.mark.parametrize(
    ("act", "state"),
    [
        (lambda run: run.driver_note("R", "lost"), State.STOPPED),
        (lambda run: run.driver_fault("R", "failed"), State.FAULT),
    ],
    ids=["note", "fault"],
)
def test_a_terminal_that_is_gone_ends_nothing_and_the_trace_tells_of_it(
    act: Callable[[Host], object], state: State
) -> None:
    def gone(_kind: str, _sentence: str) -> None:
        raise BrokenPipeError(32, "Broken pipe")

    async def main() -> None:
        run, machine = run_of(MemoryJournal())
        run.tell = gone
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        act(run)
        run.stop()
        assert (await ending).state is state
        assert machine.is_stopped
        assert isinstance(trace := run.recorder.stream, io.StringIO)
        assert '"untold"' in trace.getvalue()

    run_in_virtual_time(main())


def test_a_second_ctrl_c_leaves_a_driver_that_hangs_no_more_than_a_moment() -> None:
    async def ended() -> tuple[State, float]:
        loop = asyncio.get_running_loop()
        for at in (1.0, 3.0):
            loop.call_later(at, signal.raise_signal, signal.SIGINT)
        return (await terminable(hanging())).state, loop.time()

    with heard(signal.SIGINT):
        state, seconds = run_in_virtual_time(ended())
    assert state is State.FAULT
    assert seconds == pytest.approx(3.0 + HURRY_SECONDS, abs=0.2)


BLOCKED = """
import asyncio, signal, sys, threading, time
from firable.executor.operating.uncut import ended_by_signals
signal.signal(signal.SIGINT, signal.SIG_DFL)
async def main():
    with ended_by_signals():
        for after in (0.1, 0.3):
            threading.Timer(after, signal.raise_signal, [signal.SIGINT]).start()
        while True:
            time.sleep(0.01)
asyncio.run(main())
"""


def test_a_program_that_blocks_the_event_loop_is_ended_by_a_second_ctrl_c() -> None:
    done = subprocess.run([sys.executable, "-c", BLOCKED], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == GIVEN_UP
    assert "the run hangs and is given up" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(("known", "named"), [("R: its driver has failed, ValueError: bad", 1), ("stopped", 1)])
def test_an_error_of_a_driver_is_named_once_in_how_the_run_ended(known: str, named: int) -> None:
    async def fails() -> None:
        raise ValueError("bad")

    async def main() -> str:
        task = asyncio.create_task(fails())
        await asyncio.wait((task,))
        return with_failed(Situation(State.FAULT, (), message=known), task).message

    message = run_in_virtual_time(main())
    assert message.count("ValueError: bad") == named
    assert message.endswith("look at the machines, they may not be safe")
