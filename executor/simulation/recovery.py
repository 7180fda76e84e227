"""Recovery: everything is mended, the operator resumes, and then nothing may be lost for ever.

After the random part of a run the network delivers, disks write, machines end what they were at, whatever is down is
restarted and whatever is held is resumed. Then, with nothing allowed to fire, it must fall quiet:

- every round closes, and no promise is left;
- who was about to end has been told that no order is open;
- where machines stay at work while time passes, the timer of every time limit is set;
- every sensor is in the image of its controller as it shows, and so is every completion of a command that is done;
- the controllers hold the marking that the central net is in.

And if anything is enabled then, something fires when it is allowed to; this a few times over, since what is lost may
show only later. A system that merely does nothing wrong passes every check of a trace; that it goes on is seen here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from firable.executor.protocol.messages import Message, Report
from firable.executor.protocol.token_player import Word
from firable.executor.simulation.faults import Faults
from firable.executor.simulation.happenings import pause, resume, stay, tend
from firable.executor.simulation.letting_out import reach
from firable.executor.simulation.world import World
from firable.semantics.trace import End

_ROUNDS_MAX: Final = 60
_FIRINGS: Final = 2


class ProgressLostError(AssertionError):
    """Everything is mended, and what should go on does not."""


def recover(world: World) -> None:
    """Mend everything and check that the run goes on; raises `ProgressLostError`, or what the run itself raises."""
    mend(world)
    check_leaving(world)
    if world.timekeepers and world.draw.random() < 0.5:
        check_timers(world)
    for _ in range(_FIRINGS):
        pause(world)
        quieten(world)
        check_at_rest(world)
        enabled = tuple(_enabled(world))
        if not enabled:
            break
        before = world.counts["firings"]
        resume(world)
        for _ in range(_ROUNDS_MAX):
            _round(world)
            if world.counts["firings"] > before:
                break
        else:
            raise ProgressLostError(f"{', '.join(enabled)} enabled in {_marking(world)}, and nothing fires")
    pause(world)
    quieten(world)
    world.judge.end(End(float(len(world.events)), world.net.names(world.marking), "simulated"))


def mend(world: World) -> None:
    """End all faults, restart what is down and resume what is held."""
    world.note("everything is mended")
    world.faults = Faults.none()
    world.in_flight += world.late
    world.late.clear()
    for job in world.cell.jobs.values():
        job.stuck = False
    for process in world.processes:
        process.cut_off, process.disk.failing = False, 0.0
        process.clock.rate, process.clock.stands_still = 1.0, False
        world.sync_all(process)
        tend(process, world)
    for process in world.processes:
        for _ in range(3):  # one that is stopped is latched, reset and resumed
            tend(process, world)


def check_leaving(world: World) -> None:
    """Let who is leaving be told that no order is open, and stay then."""
    leaving = [each for each in world.controllers.values() if each.machine is not None and each.machine.leaving]
    if leaving:
        pause(world)
        quieten(world)
        for process in leaving:
            if process.machine is not None and (awaited := process.machine.awaited):
                who = ", ".join(name or "the coordinator" for name in awaited)
                raise ProgressLostError(f"{process.name} leaves, and {who} does not say that no order is open")
            stay(world, process)
        resume(world)


def check_timers(world: World) -> None:
    """Let all machines be late: each time limit that runs is over then, and must be known to be."""
    pause(world)
    quieten(world, at_work=True)
    for _ in range(3):  # one time begins when its controller is told the time, and another is over then
        world.let_pass(2 * world.limit_seconds)
        for process in world.controllers.values():
            machine, now = process.machine, process.clock.shown_seconds
            if machine is not None and (due := machine.deadline()) is not None and due <= now:
                world.tick(process)
    for name, timekeeper in world.timekeepers.items():
        if unset := timekeeper.unset():
            raise ProgressLostError(f"the time of {name} is over, and '{unset[0]}' is not set")
    resume(world)


def quieten(world: World, *, at_work: bool = False) -> None:
    """Let everything arrive that is under way, and repeat what is unanswered, until all is quiet.

    Machines end what they are at, unless they are to stay `at_work`.
    """
    before = None
    for _ in range(_ROUNDS_MAX):
        # Reports are repeated until the coordinator has something to say: the same ones again are no news.
        arrived = _round(world, at_work=at_work)
        if _is_quiet(world) and arrived == before and all(isinstance(each, Report) for each in arrived):
            return
        before = arrived
    machines = [process.machine for process in world.coordinators.values() if process.machine]
    open_rounds = [number for machine in machines for number in machine.rounds]
    raise ProgressLostError(f"it does not fall quiet: rounds {open_rounds} are open")


def check_at_rest(world: World) -> None:
    """Check what must hold when nothing is under way."""
    for process in world.controllers.values():
        machine = process.machine
        if machine is None or process.is_held or machine.held:
            raise ProgressLostError(f"{process.name} is held, although the operator has resumed it")
        for number, promise in machine.promises.items():
            if promise.promised:
                raise ProgressLostError(f"{process.name} still promises {sorted(promise.promised)} of round {number}")
        for signal in machine.subnet.signals:
            shown = bool(machine.word & machine.player.signal_bit(signal.name))
            job = world.cell.newest.get(signal.name)
            due = world.values.get(signal.name)
            if job is not None and job.done and job.place in machine.subnet.names(machine.marking):
                due = True
            if due is not None and shown != due:
                raise ProgressLostError(f"'{signal.name}' is {int(due)}, and {process.name} has not taken it in")
    if world.marking != world.judge.marking:
        central = ", ".join(world.net.names(world.judge.marking))
        raise ProgressLostError(f"the controllers are in {_marking(world)}, the central net in {central}")


def _round(world: World, *, at_work: bool = False) -> list[Message | str]:
    """Give everybody a turn, and let everything arrive in order; returns what did."""
    for process in world.controllers.values():
        reach(world, process)
        world.turn(process)
        if process.machine is not None:
            world.act(process, process.machine.resend())
    for process in world.coordinators.values():
        if process.machine is not None:
            world.act(process, process.machine.resend())
    arrived: list[Message | str] = [*world.in_flight, *(signal for signal, _, _ in world.telling)]
    for _ in range(len(world.in_flight)):
        world.deliver(world.in_flight.pop(0))
    while not at_work and (job := world.cell.complete(mended=True)) is not None:
        arrived.append(job.place)
        world.completed(job)
    for _ in range(len(world.telling)):
        world.tell(*world.telling.pop(0))
    return arrived


def _is_quiet(world: World) -> bool:
    machines = [process.machine for process in world.coordinators.values()]
    return all(machine is not None and machine.idle for machine in machines)


def _enabled(world: World) -> Iterator[str]:
    """The transitions of the central net that are enabled under the joint marking and process image."""
    player, word = world.subject.central, Word(world.marking)
    for process in world.controllers.values():
        if (machine := process.machine) is not None:
            shown = (s.name for s in machine.subnet.signals if machine.word & machine.player.signal_bit(s.name))
            word |= sum(map(player.signal_bit, shown))
    return (compiled.name for compiled in player.transitions.values() if compiled.enabled(word))


def _marking(world: World) -> str:
    return ", ".join(world.net.names(world.marking)) or "the empty marking"
