"""The lives of a host: each from a start to an end, with its driver and its link; after an emergency stop the next.

Whatever ends a life, an error most of all, ends it in order: the driver stops the machines, what runs beside it is
ended, and what waits for the disk is waited for. Which ends are followed by another life, `latch.py` says. The operator
is of all lives: at the terminal one person is asked, whatever happens to the cell.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Final

from firable.executor.drivers.driver import Latched
from firable.executor.operating import ending, latch, restart
from firable.executor.operating.clock import RunClock
from firable.executor.operating.latch import Latch
from firable.executor.operating.situation import Situation
from firable.executor.operating.uncut import uncut
from firable.nets.diagnostics import InputError
from firable.nets.source import printable

if TYPE_CHECKING:
    from firable.executor.operating.host import Host

BEGINS: Final = "begins"
"""The kind of what is told of a run that no journal holds yet."""


async def to_the_end(run: Host) -> Situation:
    """Live until the end of the last life; returns how it ended."""
    _tell_the_beginning(run)
    acts = run.conduct.operator
    operator = [] if acts is None else [asyncio.create_task(run.operate(acts), name="operator")]
    for task in operator:
        task.add_done_callback(run.task_ended)
    latch.go_on(run)
    try:
        while (ended := await _live(run)) is None:
            for task in operator:
                if task.done():
                    task.result()  # it may have failed when no life was there to be ended by that
    finally:
        hanging = await ending.cancelled(operator, run.patience)
    ended = ending.with_hanging(ended, hanging)
    if run.left_nothing_open:
        run.recorder.end(run.now_seconds(), run.marking, ended.state.value)
    is_let_go = latch.keep(run, None)
    try:
        if unwritten := await run.groups.write_last(run.patience, has_news=is_let_go):
            run.tell_operator("fault", unwritten)  # before anybody waits for its thread
            ended = ending.with_fault(ended, unwritten)
    except InputError as error:
        if run.log is not None:
            run.log.broke(error)
        raise
    if run.log is not None:
        run.log.ended(ended)
    return ended


def _tell_the_beginning(run: Host) -> None:
    """Tell that the run begins; and that it does so at M0 where the journal is new, as one with a wrong name is."""
    path = run.conduct.journal_path
    is_new = path is not None and not any(map(run.journal.kept, run.machines))
    if run.log is not None:
        known = {} if path is None else {"journal": "new" if is_new else "taken up"}
        run.log.began(run.net.name, [*run.coordinators, *run.controllers], **known)
    if is_new:
        where = "the run begins at the initial marking, and so must its machines"
        run.tell_operator(BEGINS, f"the journal {printable(str(path))} is new: {where}")


async def _live(run: Host) -> Situation | None:
    """One life, to its end; None where the next has begun."""
    clock = run.clock = run.acts.clock = RunClock.going_on(run.now_seconds(), run.speed)
    run.outcome = clock.loop.create_future()
    if run.watching is not None:
        run.watching.begin(clock)
    works = {"driver": run.driver.run(clock, run), "link": run.peers.run()}
    if run.taking_up is not None:
        works["restart"] = latch.take_up(run, run.taking_up)
    tasks = [asyncio.create_task(work, name=name) for name, work in works.items()]
    for task in tasks:
        task.add_done_callback(run.task_ended)
    try:
        run.acts.start()
        if run.taking_up is None:
            restart.tell_unasked(run, ())
        ended = await _outcome(run, run.outcome)
    finally:
        hanging = await ending.close(run, tasks)
        hanging += await run.groups.end(run.patience)
    ended = ending.with_unconfirmed(ending.with_hanging(ended, hanging), run.driver.unconfirmed)
    if run.latched is not None and not hanging and latch.stays(run, tasks[0]):
        _stay(run, run.latched())
        return None
    return ending.with_failed(ended, tasks[0])


async def _outcome(run: Host, outcome: asyncio.Future[Situation]) -> Situation:
    try:
        return await asyncio.shield(outcome)
    except asyncio.CancelledError:
        run.stop()  # Ctrl-C, or a request to terminate, is the operator's stop: the run ends in order
        await uncut([outcome])
        return outcome.result()


def _stay(run: Host, driver: Latched) -> None:
    """Begin the next life, latched by the emergency stop that has ended this one; what it has noted the next writes."""
    unconfirmed = tuple(run.driver.unconfirmed)
    run.driver, run.latch, run.said = driver, Latch(run.emergency or "", driver, unconfirmed), {}
    run.unwatch()
    met, is_due = run.peers.met, run.peers.is_due
    run.begin(resume=False)
    run.peers.met, run.peers.is_due = met, is_due  # who was never reached before still was not
