"""The steps of a simulated run: which small thing happens next, drawn, so that every order is possible.

Messages arrive, controllers have their turns, machines and sensors show something, disks sync; now and then something
goes wrong (`happenings`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from firable.executor.simulation.happenings import happen
from firable.executor.simulation.letting_out import reach

if TYPE_CHECKING:
    from firable.executor.simulation.world import World


def something(world: World) -> None:
    """One step."""
    choice = world.draw.random()
    if choice < 0.60:
        _network(world)
    elif choice < 0.65:
        world.turn(world.any_controller())
    elif choice < 0.84:
        _machines(world)
    elif choice < 0.92:
        waiting = [process for process in world.processes if process.outbox]
        if waiting:
            world.sync(waiting[int(world.draw.random() * len(waiting))])
        else:
            _resend(world)
    else:
        happen(world)


def _network(world: World) -> None:
    faults, draw = world.faults, world.draw
    if world.late and draw.random() < (0.05 if world.in_flight else 0.3):
        world.in_flight.append(world.late.pop(int(draw.random() * len(world.late))))
    if not world.in_flight:  # what was lost is sent again, or the cell goes on
        if draw.random() < 0.3:
            _resend(world)
        else:
            _machines(world)
        return
    index = int(draw.random() * len(world.in_flight)) if faults["reordering"] else 0
    message = world.in_flight.pop(index)
    if faults["duplication"] and draw.random() < 0.4 * faults["duplication"]:
        world.counts["doubled"] += 1
        world.late.append(message)
    if faults["loss"] and draw.random() < 0.5 * faults["loss"]:
        world.note("lost", message)
        world.counts["lost"] += 1
    else:
        world.deliver(message)


def _resend(world: World) -> None:
    process = world.any_process()
    if process.machine is not None:
        world.act(process, process.machine.resend())


def _machines(world: World) -> None:
    waiting = [process for process in world.controllers.values() if process.queue]
    if waiting and world.draw.random() < 0.3:
        reach(world, waiting[int(world.draw.random() * len(waiting))])
        return
    draw = world.draw.random()
    if draw < 0.4 and world.telling:
        world.tell(*world.telling.pop(0))
    elif draw < 0.8 and world.cell.working and world.draw.random() >= 0.9 * world.faults["late"]:
        job = world.cell.complete()
        if job is not None:
            world.completed(job)
    elif world.values:
        _sense(world)


def _sense(world: World) -> None:
    """A sensor changes: mostly to what a transition waits for, as in a cell that is at work, else at random."""
    sensors, draw = world.subject.sensors, world.draw
    if draw.random() < 0.75:
        wanted = [
            gate.signal
            for t in world.judge.player.firable(world.judge.marking)
            for gate in world.net.transitions[t].external
            if world.values.get(gate.signal, gate.wanted) != gate.wanted
        ]
        if not wanted:
            return
        signal = wanted[int(draw.random() * len(wanted))]
    else:
        signal = sensors[int(draw.random() * len(sensors))]
    world.values[signal] = not world.values[signal]
    world.telling.append((signal, world.values[signal], None))
