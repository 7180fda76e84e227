"""What a host of a simulated run does around its machine: it ends in order, or stops in an emergency and is reset.

An emergency stop goes on through three moments, as in the executor (`operating/latch.py`). The machines stand, what the
driver keeps is dropped, and no command leaves any more, while what was decided is still obeyed. Then all that was done
is durable, and the machine of the protocol is made anew of what the disk holds, held, in the same process. And a person
resets it, and resumes it: machines are asked only then, for until then somebody may have been at them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import Decision
from firable.executor.simulation.judge import RunFailedError
from firable.executor.simulation.process import Process

if TYPE_CHECKING:
    from firable.executor.simulation.world import World


def ends(world: World, process: Process[LocalController]) -> None:
    """Let the host of a controller end in order, which leaves nothing open."""
    world.note("ends in order", process.name)
    world.sync(process)
    if process.machine is None:
        return
    for coordinator in (each.machine for each in world.coordinators.values() if each.machine is not None):
        for opened in coordinator.rounds.values():
            is_waited_for = process.name in coordinator.ordered(opened)
            if opened.committed is None or not is_waited_for or process.name in opened.acknowledged:
                continue
            # Who has restarted since it gave its word has forgotten what was acknowledged, and will hear it again.
            is_anew = coordinator.epoch > process.machine.above[coordinator.name].epoch
            order = Decision(process.name, opened.number, opened.committed, 0, -1, 0, coordinator.name)
            if not is_anew or process.machine.applies(order):
                raise RunFailedError(f"{process.name} ends in order, and its order of '{opened.committed}' is open")
        if votes := coordinator.ready[process.name] & coordinator.of_free.get(process.name, frozenset()):
            raise RunFailedError(f"{process.name} ends in order, and its votes for {sorted(votes)} still count")
    world.counts["ends"] += 1
    world.kill(process)


def emergency_stop(world: World, process: Process[LocalController]) -> None:
    """Stop the machines of a controller; its host begins to end, and will stay."""
    if process.machine is None or process.is_safe:
        return
    world.note("emergency stop", process.name)
    world.counts["emergency stops"] += 1
    process.make_safe()
    for job in [job for job in world.cell.working if world.subject.sender_of[job.place] == process.name]:
        world.cell.halt(job)
    if not process.machine.leaving:
        world.act(process, process.machine.leave())


def latch(world: World, process: Process[LocalController]) -> None:
    """The host has ended, and stays: its machine is made anew of what the disk holds."""
    world.sync_all(process)
    if process.machine is None:  # the disk has failed
        return
    world.note("is latched", process.name)
    process.machine = world.machines.controller.restored(world.subject.decomposition, process.name, process.disk.kept())
    process.is_held = process.is_latched = True
    world.act(process, process.machine.start(), at_once=True)
    world.show_sensors(process)


def reset(world: World, process: Process[LocalController]) -> None:
    """A person resets the emergency stop: the machines may be commanded again, once it is resumed."""
    world.note("is reset", process.name)
    process.is_safe = process.is_latched = False
