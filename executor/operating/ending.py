"""When a run is over, asked at quiescence, and what it is doing until then.

A run of a whole cell ends by itself when its work is done or nothing can go on, unless an operator is there who may
change that. A host among others never does: its machines rest because others work. It ends when it is stopped, and not
before nobody waits for a word of it, as far as that comes in time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from firable.executor.operating import latch, restart
from firable.executor.operating.situation import Blocked, Situation, State, blocked, blocked_here, deadlocked
from firable.executor.operating.uncut import Patience, uncut
from firable.executor.operating.watching import otherwise
from firable.executor.protocol.token_player import TokenPlayer
from firable.nets.net import Marking, Net, SignalKind

if TYPE_CHECKING:
    from firable.executor.operating.host import Host

AT_THE_END: Final = "stopped at the end of the cycle"
ENDS_WITH_THE_CYCLE: Final = "the operator has asked for the end at the end of the cycle"
_LOOKED_AT: Final = 1_000  # markings, for what brings work into a cell
_TOLD_ALREADY: Final = (State.FAULT, State.STOPPED, State.LATCHED)
"""An end says what has become of devices, and a latched host what is against a reset."""


def situation(run: Host) -> Situation:
    """What a host is doing, and what waits for what; exact at quiescence, as far as its machines know.

    First comes what keeps everything waiting, whatever the net says: a disk that hangs; and while the run goes on,
    other hosts and devices that cannot be reached, without which a gate that is awaited may be open by now. Behind that
    comes that machines have done what their model excludes, of which an end has a verdict.
    """
    found = _reached(run)
    if run.divergence is None or run.is_over or found.state in _TOLD_ALREADY:
        return found
    return replace(found, message="; ".join(filter(None, (found.message, otherwise(run.divergence)))))


def _reached(run: Host) -> Situation:
    found = _situation(run)
    away = [] if found.state in _TOLD_ALREADY else [*run.peers.absent(), *run.driver.unreached]
    return replace(found, message="; ".join(filter(None, (run.groups.disk.sentence(), *away, found.message))))


def _situation(run: Host) -> Situation:
    waits = run.peers.waits(is_over=run.stopping)
    others = "; ".join(sentence for sentence in waits if run.taking_up is None or "is held" not in sentence)
    if run.is_whole:
        unread = frozenset(name for controller in run.controllers.values() for name in controller.unread)
        waiting = tuple(blocked(run.recorder.player, run.recorder.word, run.dispatch.untaken, unread))
    else:
        waiting = tuple(_unready(run, one) for one in blocked_here(run.controllers.values(), run.dispatch.untaken))
    barred = beginnings(run.net) if run.ends_at_home else ()
    waiting = tuple(replace(one, is_barred=one.transition in barred) for one in waiting)
    if run.fault:
        return Situation(State.FAULT, run.marking, waiting, run.fault)
    if run.stopping:
        if run.emergency is not None:
            return Situation(State.STOPPED, run.marking, waiting, f"emergency stop: {run.emergency}", is_emergency=True)
        return Situation(State.STOPPED, run.marking, waiting, run.ended_by or others)
    if run.latch is not None:
        return latch.situation(run)
    if run.draining:
        at_home = alone(run) if run.ends_at_home and not run.is_whole else ""
        others = "; ".join(filter(None, (ENDS_WITH_THE_CYCLE, at_home, others)))
    if run.taking_up is not None:
        held = restart.told(run, run.taking_up)
        return Situation(State.HELD, run.marking, (), "; ".join(filter(None, (held, others))), is_held=True)
    if not run.is_quiet and not run.paused:
        return Situation(State.RUNNING, run.marking, (), others)
    if run.is_whole and run.recorder.is_deadlock:
        return Situation(State.DEADLOCK, run.marking, waiting, deadlocked(run.net, run.recorder.marking))
    return Situation(State.PAUSED if run.paused else State.WAITING, run.marking, waiting, others)


def _unready(run: Host, one: Blocked) -> Blocked:
    """Who else is waited for, as far as the coordinator is here and has heard of them."""
    if one.decided_by is None or (decider := run.coordinators.get(one.decided_by)) is None:
        return one
    those = (name for name in decider.participants.get(one.transition, ()) if name not in run.controllers)
    return replace(one, unready=tuple(name for name in those if one.transition not in decider.ready[name]))


def ended(run: Host) -> Situation | None:
    """How the run has ended; None where it goes on."""
    if run.stopping:
        return _stopped(run) if run.is_whole or run.has_waited or _nobody_waits(run) else None
    if not run.is_whole:
        return None
    if run.taking_up is not None:
        if not run.taking_up.is_final or run.operated:
            return None
        if run.was_done and run.is_complete():
            message = "this run was done before, and nothing moved; to run the bundle again, name a new journal"
            return replace(_reached(run), state=State.DONE, message=message)
        return None if run.served else _reached(run)
    # What a pause holds back still has to fire before the cycle, or the work, is at its end.
    if run.draining and run.at_rest and not run.paused:
        return replace(_reached(run), state=State.STOPPED, message=AT_THE_END)
    if run.at_rest and run.is_complete() and not (run.paused and run.operated):
        return replace(_reached(run), state=State.DONE, blocked=())
    # With an operator present, a cell at rest is waited for: it may be paused, or be given work.
    is_stuck = run.at_rest and not run.operated and not (run.paused and run.served)
    return _reached(run) if is_stuck or run.recorder.is_deadlock else None


def _stopped(run: Host) -> Situation:
    """The end of a run that was stopped; of one that was held, with what became of its commands."""
    found = _reached(run)
    if run.taking_up is None or found.is_emergency:
        return found
    told = "; ".join(filter(None, (found.message, restart.told(run, run.taking_up))))
    return replace(found, message=told, is_held=True)


async def close(run: Host, tasks: Collection[asyncio.Task[None]]) -> list[str]:
    """Drive the safe outputs, and end what runs beside the host; returns what had to be given up."""
    if run.taking_up is None or run.stopping:  # to look at a run that is held changes nothing
        run.make_safe()
    hanging = await cancelled(tasks, run.patience)
    run.acts.end()
    run.dispatch.end()
    for timer in run.waiting:
        timer.cancel()
    if run.watching is not None:
        run.watching.end()
    return hanging


async def cancelled(tasks: Collection[asyncio.Task[None]], patience: Patience) -> list[str]:
    """End tasks; returns what had to be given up."""
    for task in tasks:
        task.cancel()
    return await uncut(tasks, patience)


def with_hanging(ended: Situation, hanging: Collection[str]) -> Situation:
    """The end of a run of which that much did not end: a fault, whatever it was before."""
    if not hanging:
        return ended
    return with_fault(ended, f"{' and '.join(hanging)} did not end in time: look at the machines, they may not be safe")


def with_unconfirmed(ended: Situation, devices: Collection[str]) -> Situation:
    """The end of a run after which these devices have not confirmed safe outputs: a fault, whatever it was before."""
    return with_fault(ended, latch.unconfirmed(devices)) if devices else ended


def with_failed(ended: Situation, driver: asyncio.Task[None]) -> Situation:
    """The end of a run whose driver failed when it was to stop the machines: a fault, whatever it was before."""
    if not driver.done() or driver.cancelled() or (error := driver.exception()) is None:
        return ended
    named = f"{type(error).__name__}: {error}"
    failed = "the driver has failed" if named in ended.message else f"the driver failed at the end, {named}"
    return with_fault(ended, f"{failed}: look at the machines, they may not be safe")


def with_fault(ended: Situation, message: str) -> Situation:
    """The end of a run at which this was found besides: a fault, whatever it was before."""
    return replace(ended, state=State.FAULT, message="; ".join(filter(None, (ended.message, message))))


def is_home(run: Host) -> bool:
    """Whether the machines here are as at the beginning, and nothing is awaited, timed or promised.

    The end of a cycle of machines whose driver cannot tell when they rest.
    """
    at_home = all(each.marking == each.subnet.initial_marking for each in run.controllers.values())
    awaits = run.dispatch.timers or run.dispatch.untaken or run.acts.ticks
    return at_home and not awaits and run.acts.is_settled


def alone(run: Host) -> str:
    """What a host among others waits for at the end of the cycle: what is elsewhere in the cell it does not see."""
    names = " and ".join(run.controllers) or "nobody"
    return f"{names} alone {'are' if len(run.controllers) > 1 else 'is'} waited for; the cell may not be empty"


@lru_cache(16)
def beginnings(net: Net) -> tuple[str, ...]:
    """The transitions by which work comes into a cell that is as at the beginning: an operator who ends the cycle bars
    them.

    They are firable in the initial marking, and a sensor opens them, which sees the workpiece that has come; of a net
    in which none is, all that are firable there. One behind which no machine gets a command, as long as the others are
    barred, and which can be taken back, brings no work: a key that holds the cell is obeyed until its end. A part that
    waits for another one cannot go back, and with it the cell would never be as at the beginning.

    >>> from firable.nets.catalogue import catalogue_net
    >>> beginnings(catalogue_net("one_robot")), beginnings(catalogue_net("two_cells"))
    (('G1',), ('enter',))
    """
    player, initial = TokenPlayer.of(net), net.initial_marking
    firable = [c.name for c in player.transitions.values() if c.openable and c.firable(initial, player.places)]
    sensors = {signal.name for signal in net.signals if signal.kind is SignalKind.SENSOR}
    seen = [name for name in firable if any(gate.signal in sensors for gate in net.transition(name).external)]
    unseen = [name for name in firable if name not in seen]
    barred = list(seen)
    for name in seen:
        others = [each for each in barred if each != name]
        if (others or unseen) and _brings_no_work(net, others or unseen):
            barred = others
    return tuple(barred or unseen)


def _brings_no_work(net: Net, barred: Collection[str]) -> bool:
    """Whether no command can follow the initial marking, gates free, while these transitions fire no more, and whatever
    follows it leads back to it.

    Of more markings than are looked at it is believed that one can.
    """
    player = TokenPlayer.of(net)
    commanding = sum(1 << i for i, place in enumerate(net.places) if place.command is not None)
    free = [one for one in player.transitions.values() if one.openable and one.name not in barred]
    before: dict[Marking, list[Marking]] = {net.initial_marking: []}
    open_ = [net.initial_marking]
    while open_:
        marking = open_.pop()
        for one in free:
            if one.firable(marking, player.places):
                after = one.fire(marking) & player.places
                if after & commanding & ~marking:
                    return False
                if after not in before:
                    if len(before) > _LOOKED_AT:
                        return False
                    before[after] = []
                    open_.append(after)
                before[after].append(marking)
    home, open_ = {net.initial_marking}, [net.initial_marking]
    while open_:
        new = set(before[open_.pop()]) - home
        home |= new
        open_ += new
    return len(home) == len(before)


def _nobody_waits(run: Host) -> bool:
    """Whether nothing is open here, all rounds of coordinators here are closed, and none elsewhere has any for it."""
    is_idle = all(each.idle for each in run.coordinators.values())
    return run.acts.is_settled and is_idle and run.peers.have_let_go
