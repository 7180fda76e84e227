"""What controllers meet among all machines, told so that it can be looked for in what they meet alone."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import cache

from support.free_parts import freed
from support.gated_nets import GATE_READ_AGAIN, SENSOR, SHOWN
from support.layered_nets import shared_robot
from support.reference import load_net

from firable.decompose.splitting.cut import split
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import EPOCH_BITS, Message, ToController
from firable.executor.simulation.alone import Alone
from firable.executor.simulation.exploring import Explorer, explore
from firable.executor.simulation.likeness import forget, idle, liken
from firable.executor.simulation.numbering import Collecting, Ranking, apply, apply_message
from firable.executor.simulation.repertoire import Budget, Configuration, Step
from firable.executor.simulation.snapshots import clone, frozen
from firable.executor.simulation.surroundings import Reach
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition

CELLS = ("one_robot", "two_robots_shared", "two_robots_separate", "two_cells")


@cache
def decomposition_of(name: str) -> Decomposition:
    family, _, net = name.rpartition(" ")
    if net in CELLS:
        found = split(catalogue_net(net))
    else:
        known = {"gate_read_again": GATE_READ_AGAIN, "sensor": SENSOR, "shown": SHOWN}
        found = split(shared_robot() if net == "shared_robot" else known.get(net) or load_net(net))
    return freed(found) if family else found


def group_of(decomposition: Decomposition, t: str) -> int:
    return Coordinator(decomposition).group_of[t]


def told(explorer: Explorer, number: int, message: Message | None, reach: Reach) -> Hashable | None:
    """A controller and what it meets, by what an exploration alone tells apart; None beyond what it reaches."""
    stored = explorer.machines[number]
    machine, kept = clone(stored.machine), dict(stored.kept)
    assert isinstance(machine, LocalController)
    known = {*machine.promises, *machine.closed}
    if isinstance(message, ToController):
        over = machine.above[message.coordinator]
        known = {n for n in known if machine.above_of(n) is not over or n >= message.closed_below}
        if (n := getattr(message, "round", -1)) >= max(over.closed_below, message.closed_below):
            known.add(n)
    if reach.rounds is not None and len(known) > reach.rounds:
        return None
    if any(above.epoch > reach.restarts for above in machine.above.values()):
        return None
    liken(machine, kept)
    its = idle(machine, kept)
    met_with = {n for n in its if n == getattr(message, "round", -1)} or set(sorted(its)[-1:])
    forget(machine, kept, its - met_with, frozenset(machine.above))
    if isinstance(message, ToController):
        above = machine.above[message.coordinator]
        seen = above.told if message.seen == above.told else -1
        if (above.seen == above.told and message.epoch == above.epoch) or message.epoch < above.epoch:
            seen = above.seen
        below = message.closed_below
        if below <= above.closed_below:
            below = above.closed_below if above.closed_below >> EPOCH_BITS <= message.epoch else 0
        if message.epoch > reach.restarts:
            return None
        message = replace(message, seen=seen, closed_below=below)
    collecting = Collecting()
    apply(clone(machine), kept, collecting)
    if message is not None:
        apply_message(message, collecting)
    ranking = Ranking(collecting.found.items(), explorer.coordinators)
    kept = apply(machine, kept, ranking)
    met = None if message is None else apply_message(message, ranking)
    return frozen(machine), frozen(sorted(kept.items())), met


class Acts:
    """A watcher that notes what each controller meets."""

    def __init__(self, reach: Reach, crashes: int) -> None:
        self.reach, self.crashes = reach, crashes
        self.found: dict[str, set[Hashable]] = {}
        self.beyond = 0
        self.known: set[Hashable] = set()

    def __call__(self, explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        del at, after
        key = (step.machine, step.before, step.about, step.kind)
        if step.machine < len(explorer.coordinators) or key in self.known:
            return
        self.known.add(key)
        machine = explorer.machine(step.before)
        assert isinstance(machine, LocalController)
        message = step.about if isinstance(step.about, Message) else None
        act = told(explorer, step.before, message, self.reach)
        if act is None or (machine.epoch and not self.crashes):
            self.beyond += 1
        else:
            self.found.setdefault(machine.name, set()).add((step.kind, act))


def alone(decomposition: Decomposition, reach: Reach, budget: Budget) -> Acts:
    acts = Acts(reach, budget.crashes)
    for subnet in decomposition.subnets:
        assert explore(Alone(decomposition, subnet.name, reach), budget, watch=acts).complete
    return acts


def contained(among_all: Acts, by_itself: Acts) -> None:
    assert among_all.found
    for name, acts in among_all.found.items():
        assert acts <= by_itself.found[name], next(iter(acts - by_itself.found[name]))
