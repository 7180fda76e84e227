"""What becomes of what a simulated process lets out, once it is durable: of firings, signals, commands and messages.

The judge is told of each firing, each signal and each command, in this moment, for it is certain now. Messages go on
their way. A command goes to the driver, and from there to its machine, at once or when its line is up; unless its token
has left meanwhile, or an emergency stop keeps it. Whatever no machine may be given ends the run.

A process that is killed lets nothing out any more. What of it was durable has happened all the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Hello,
    Report,
    Sending,
    Taken,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.judge import RunFailedError
from firable.executor.simulation.process import Process
from firable.semantics.trace import CommandSent, Event, Fired, SignalChanged

if TYPE_CHECKING:
    from firable.executor.simulation.world import World


def let_out(world: World, process: Process[Any], effect: Effect) -> None:
    """One effect leaves a process: the judge is told, the network or a machine is given it."""
    match effect:
        case Firing(transition):
            _fired(world, transition)
        case Taken(signal, value):
            _changed(world, signal, value)
        case Sending(place, entry, again):
            world.note("command", (process.name, place, entry))
            world.counts["sent again"] += again
            if process.is_held:
                raise RunFailedError(f"{process.name} commands '{place}' before the operator has resumed it")
            # One that was given before a stop, and is to be given again, is in the trace already.
            if not again or place in world.judge.owed:
                _event(world, CommandSent(float(len(world.events)), place))
            if (place, entry) in process.void:
                process.void.remove((place, entry))
                world.note("given up", (process.name, place, entry))
            elif process.is_safe:
                world.note("kept back", (process.name, place, entry))
            elif world.faults["queued"] and world.draw.random() < 0.7 * world.faults["queued"]:
                world.counts["queued"] += 1
                world.note("waits for its line", (process.name, place, entry))
                if process.hand(effect):
                    _sent(world, process, effect)
            else:
                _given(world, process, effect)
        case VoteRequest() | Decision() | Report() | Vote() | Acknowledgement() | Hello():
            world.send(effect)


def reach(world: World, process: Process[Any]) -> None:
    """Let the lines of a process be up: its machines are given what its driver has kept."""
    while process.queue:
        _given(world, process, process.queue.pop(0))


def _given(world: World, process: Process[Any], sending: Sending) -> None:
    machine = process.machine
    if process.is_safe:
        raise RunFailedError(f"a machine is given the command of '{sending.place}' after an emergency stop")
    if machine is not None and sending.place not in machine.subnet.names(machine.marking):
        raise RunFailedError(f"a machine is given the command of '{sending.place}', which its token has left")
    world.note("is given", (sending.place, sending.entry))
    stuck = world.draw.random() < 0.3 * world.faults["stuck"]
    world.cell.send(sending.place, sending.entry, stuck=stuck)
    _sent(world, process, sending)


def _sent(world: World, process: Process[Any], sending: Sending) -> None:
    if process.machine is not None:
        world.act(process, process.machine.sent(sending.place, sending.entry))


def give_up(world: World, process: Process[Any], transition: str) -> None:
    """Let a process give up the commands that a firing leaves behind."""
    for sending in process.give_up(world.net.transition(transition).inputs):
        world.note("given up", (process.name, sending.place, sending.entry))
        if world.net.place(sending.place).completion is None:
            raise RunFailedError(f"'{transition}' fires before a machine has the command of '{sending.place}'")


def happened(world: World, effects: Iterable[Effect]) -> None:
    """Tell the judge what is durable, though the process that did it was killed before it could say so."""
    for effect in effects:
        match effect:
            case Firing(transition):
                _fired(world, transition)
            case Taken(signal, value):
                _changed(world, signal, value)


def _fired(world: World, transition: str) -> None:
    world.note("fires", transition)
    world.counts["firings"] += 1
    world.fired.add(transition)
    _event(world, Fired(float(len(world.events)), (transition,)))


def _changed(world: World, signal: str, value: bool) -> None:
    world.note("taken in", (signal, value))
    _event(world, SignalChanged(float(len(world.events)), signal, value))


def _event(world: World, event: Event) -> None:
    world.events.append(event)
    world.judge.take(event)
