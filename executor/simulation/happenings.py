"""What goes wrong in a simulated run by itself, and what the operator does.

Each happening is one row of the table below, and belongs to a kind of fault; it is drawn about as often as the run
suffers that kind. What goes wrong within an act (a message lost, a write that fails) stands where the act is, in
`world`. Whatever is allowed, somebody looks after the cell all the time: what is down is restarted in the end, what is
held after a restart is resumed, and a machine that is stuck is mended.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from firable.executor.protocol.commands import Answer
from firable.executor.protocol.controller import LocalController
from firable.executor.simulation.hosts import emergency_stop, ends, latch, reset
from firable.executor.simulation.process import Process

if TYPE_CHECKING:
    from firable.executor.simulation.world import World


def happen(world: World) -> None:
    """Let something of what the run suffers happen, and somebody look after the cell."""
    for kind, amount in world.faults.intensities.items():
        if kind in _HAPPENINGS and world.draw.random() < 0.5 * amount:
            _HAPPENINGS[kind](world)
    needy = [process for process in world.processes if process.machine is None or process.is_held or process.is_safe]
    if needy and world.draw.random() < 0.4:
        tend(needy[int(world.draw.random() * len(needy))], world)
    for job in world.cell.working:
        job.stuck = job.stuck and world.draw.random() < 0.9


def tend(process: Process[Any], world: World) -> None:
    """Restart a process that is down; latch one that is stopped, reset one that is latched; resume one that is held."""
    if process.machine is None:
        world.restart(process)
    elif process.is_latched:
        reset(world, process)
    elif process.is_safe:
        latch(world, process)
    elif process.is_held:
        release(process, world)


def release(process: Process[LocalController], world: World) -> None:
    """The operator resumes a controller after a restart, and says what became of each command that nobody knows of."""
    for place, entry in process.machine.commands.questions if process.machine else ():
        answer = world.cell.ask(place, entry)
        if answer is Answer.UNKNOWN:
            answer = world.cell.settle(place, done=world.draw.random() < 0.5)
        world.answer(process, place, entry, answer)
    if process.machine is not None and not process.machine.commands.questions:
        world.note("the operator resumes", process.name)
        process.is_held = False
        world.act(process, process.machine.resume())
        world.turn(process)


def pause(world: World) -> None:
    """The operator pauses: nothing fires any more."""
    world.note("the operator pauses")
    world.paused, world.steps_allowed = True, 0
    world.permit(0)


def resume(world: World) -> None:
    """The operator lets transitions fire again."""
    world.note("the operator lets go on")
    world.paused = False
    world.permit(None)


def _pause(world: World) -> None:
    if world.paused:
        resume(world)
    elif world.draw.random() < 0.3:
        pause(world)


def _step(world: World) -> None:
    if not world.paused:
        if world.draw.random() < 0.2:
            pause(world)
        return
    if world.draw.random() < 0.2:
        resume(world)
        return
    world.note("the operator steps")
    world.counts["steps"] += 1
    world.permit(0)
    world.steps_allowed = 1
    process = world.any_process()
    if world.coordinating(process) is not None:
        if process.machine is not None:
            world.act(process, process.machine.permit(1))
    elif process.machine is not None:
        world.act(process, process.machine.fire())


def _stop(world: World) -> None:
    if world.draw.random() < 0.1 and all(process.machine is not None for process in world.processes):
        world.note("the operator stops everything")
        world.counts["stops"] += 1
        for job in list(world.cell.working):
            if world.draw.random() < 0.5:
                world.cell.halt(job)
        for process in world.processes:
            world.sync_all(process)
            world.kill(process)


def _leave(world: World) -> None:
    process = world.any_controller()
    if (machine := process.machine) is None or process.is_safe:
        return
    if not machine.leaving:
        if world.draw.random() < 0.3:
            world.note("takes its votes back", process.name)
            world.act(process, machine.leave())
    elif world.draw.random() < 0.1:
        stay(world, process)
    elif not machine.awaited and not any(promise.promised for promise in machine.promises.values()):
        ends(world, process)


def stay(world: World, process: Process[LocalController]) -> None:
    """The operator lets a host that is about to end go on."""
    world.note("stays after all", process.name)
    if process.machine is not None:
        process.machine.stay()
        world.turn(process)


def _emergency(world: World) -> None:
    process = world.any_controller()
    if world.cell.working and world.draw.random() < 0.5:  # the hard moment: a machine is at work
        process = world.controllers[world.subject.sender_of[world.cell.working[0].place]]
    if world.draw.random() < 0.3:
        emergency_stop(world, process)


def _crash(world: World) -> None:
    process = world.any_process()
    if world.cell.working and world.draw.random() < 0.5:  # the hard moment: somebody waits for a machine
        job = world.cell.working[0]
        process = world.controllers[world.subject.sender_of[job.place]]
    if process.machine is None:
        world.restart(process)
    elif world.draw.random() < 0.5:
        world.kill(process)


def _partition(world: World) -> None:
    process = world.any_controller()
    if process.cut_off or world.draw.random() < 0.3:
        process.cut_off = not process.cut_off
        world.note("is cut off" if process.cut_off else "is reached again", process.name)
        world.counts["partitions"] += process.cut_off


def _jump(world: World) -> None:
    process = world.any_process()
    process.clock.jump(world.draw.expovariate(1.0) * world.limit_seconds)
    world.note("its clock jumps", process.name)


def _standstill(world: World) -> None:
    process = world.any_process()
    process.clock.stands_still = not process.clock.stands_still
    world.note("its clock stands still" if process.clock.stands_still else "its clock goes on", process.name)


def _flapping(world: World) -> None:
    if world.values:
        signal = world.draw.choice(world.subject.sensors)
        for _ in range(world.draw.randint(2, 6)):
            world.values[signal] = not world.values[signal]
            world.telling.append((signal, world.values[signal], None))


def _stale(world: World) -> None:
    jobs = list(world.cell.newest.values())
    at_work = [job for job in jobs if not job.done]
    if jobs:
        job = world.draw.choice(at_work or jobs)
        world.telling.append((str(job.signal), True, job.entry - (not job.done or world.draw.random() < 0.5)))


_HAPPENINGS: Final[Mapping[str, Callable[[World], None]]] = MappingProxyType(
    {
        "partition": _partition,
        "crash": _crash,
        "jump": _jump,
        "standstill": _standstill,
        "flapping": _flapping,
        "stale": _stale,
        "pause": _pause,
        "step": _step,
        "stop": _stop,
        "leave": _leave,
        "emergency": _emergency,
    }
)
