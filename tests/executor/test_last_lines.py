"""The last lines of a trace are written beside the event loop, and one that hangs is waited for only so long."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from support.hosts import ended_within
from support.slow_disks import Machines, Rig, Waiting, turns

from firable.executor.drivers.bench import PATIENCE_S, until
from firable.executor.drivers.driver import Clock, Listener
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.uncut import Patience
from firable.nets.diagnostics import InputError


class HangsAtTheEnd(Waiting):
    """A trace whose disk takes everything but the last line."""

    fails = False

    def write(self, lines: str, /) -> None:
        if '"end"' in lines:
            self.disk.is_slow = not self.fails
            if self.fails:
                self.disk.close()
        super().write(lines)


@asynccontextmanager
async def stopped(rig: Rig, trace: HangsAtTheEnd) -> AsyncIterator[asyncio.Task[Situation]]:
    """A run that somebody has stopped, and whose last line is being written."""
    try:
        async with rig.running() as ending:
            rig.host.signal("a.s", value=True, entry=None)
            await turns()
            rig.host.stop()
            await until(lambda: trace.is_writing and trace.disk.is_slow, "the last line")
            yield ending
            trace.disk.answers.release(1000)
    finally:
        trace.disk.answers.release(1000)


def test_a_run_waits_for_its_last_line_and_the_event_loop_does_not(tmp_path: Path) -> None:
    async def main() -> None:
        trace = HangsAtTheEnd(tmp_path / "trace.jsonl")
        async with stopped(Rig(trace=trace), trace) as ending:
            await asyncio.sleep(0.2)
            assert not ending.done()
            trace.disk.answers.release()
            situation = await ended_within(ending, PATIENCE_S)
            assert (situation.state, situation.message) == (State.STOPPED, "stopped by the operator")
        assert json.loads((tmp_path / "trace.jsonl").read_text("utf-8").splitlines()[-1])["end"] == "stopped"

    asyncio.run(main())


def test_a_last_line_that_is_never_written_is_given_up_and_told(tmp_path: Path) -> None:
    async def main() -> None:
        trace, told = HangsAtTheEnd(tmp_path / "trace.jsonl"), list[tuple[str, str]]()
        rig = Rig(trace=trace)
        rig.host.patience = Patience(0.1)
        rig.host.tell = lambda kind, sentence: told.append((kind, sentence))
        async with stopped(rig, trace) as ending:
            situation = await ended_within(ending, PATIENCE_S)
            unwritten = "the last lines of the trace are not written: the disk does not answer"
            assert situation.state is State.FAULT
            assert situation.message == f"stopped by the operator; {unwritten}"
            assert told == [("fault", unwritten)]
            assert rig.machines.is_stopped

    asyncio.run(main())


def test_a_last_line_that_cannot_be_written_ends_the_run_as_an_error(tmp_path: Path) -> None:
    async def main() -> None:
        trace = HangsAtTheEnd(tmp_path / "trace.jsonl")
        trace.fails = True
        rig = Rig(trace=trace)
        async with rig.running() as ending:
            rig.host.stop()
            with pytest.raises(InputError, match=r"F1017.*the trace cannot be written"):
                await ended_within(ending, PATIENCE_S)

    asyncio.run(main())


class Noting(Machines):
    """Machines whose driver has something to say on its way out, when the disk of the trace stands still."""

    trace: Waiting

    async def run(self, clock: Clock, listener: Listener) -> None:
        try:
            await super().run(clock, listener)
        finally:
            self.trace.disk.is_slow = True
            listener.driver_note("A", "stands")


def test_a_host_is_latched_while_the_disk_of_its_trace_stands_still_and_the_trace_goes_on_when_it_answers(
    tmp_path: Path,
) -> None:
    async def main() -> None:
        rig = Rig(trace=(trace := Waiting(tmp_path / "trace.jsonl")))
        subnets = rig.host.decomposition.subnets
        rig.host.driver = noting = Noting(subnets, 1.0)
        noting.sent, noting.trace = [], trace
        rig.host.latched = lambda: Machines(subnets, 1.0)
        async with rig.running() as ending:
            rig.host.emergency_stop("a person")
            await until(lambda: trace.is_writing and trace.disk.is_slow, "the next life")
            assert rig.host.situation().state is State.LATCHED
            assert not ending.done()
            trace.disk.answers.release(1000)
            await until(lambda: rig.host.groups.storing is None, "the disk")
            notes = [json.loads(line).get("message") for line in (tmp_path / "trace.jsonl").read_text().splitlines()]
            assert "A: stands" in notes
            assert notes.count("A: stands") == 1

    asyncio.run(main())
