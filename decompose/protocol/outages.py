"""What a fault does to the cell: blocked safely or not, which machines stand still, what goes on, what resumes.

Two explorations answer for all faults that pass: with messages lost and doubled and everybody crashing and restarting,
again and again, the protocol stays safe (the sentences of refinement); and when faults have ceased, nothing is lost:
whatever the central net may fire next can be fired next, so what stood still resumes. One fault of each kind is a case
of that.

Whoever is *dead* never restarts. That is safe too, by the same exploration, since nobody has to restart in it. What the
others can still do is asked of a net in which one of them may crash, of its configurations after the crash, which
nothing leads out of. A transition

- stands still *at once*, if none of them fires it: it is local to who is dead, or nobody is left to decide it;
- stands still *at last*, if from some of them it never fires again: as soon as it waits for something that nobody does
  any more. It may still finish what was begun, such as a firing that was decided before the crash;
- *goes on*, if from all of them it can fire again.

A machine stands still if no transition goes on that sends it a command.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.goal import Limits
from firable.analysis.question import listed
from firable.decompose.protocol.draft import COORDINATOR_DOWN, down
from firable.decompose.protocol.exploring import Exploration, explore_protocol
from firable.decompose.protocol.variant import ANY_FAULTS, PROTOCOL, Faults, Often
from firable.nets.decomposition import Decomposition
from firable.nets.formula import Holds
from firable.nets.net import Net
from firable.nets.verdict import Status, Verdict, Weight

COORDINATOR = "coordinator"


@dataclass(frozen=True, slots=True)
class Outage:
    """What goes on while somebody is dead: `who` is a controller, or nobody (empty) for the coordinator.

    `at_once`, `at_last` and `goes_on` divide the transitions of the central net that can fire at all; `still` and
    `running` its machines that are sent commands. `bound` says why this is not known, where it is not.
    """

    who: str
    at_once: tuple[str, ...] = ()
    at_last: tuple[str, ...] = ()
    goes_on: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    running: tuple[str, ...] = ()
    bound: str = ""

    @property
    def name(self) -> str:
        """Who is dead, in words."""
        return self.who or "the coordinator"


def fault_exploration(decomposition: Decomposition, limits: Limits | None = None) -> Exploration:
    """All runs of the protocol under any number of faults of each kind, which includes one of each."""
    return explore_protocol(decomposition, PROTOCOL, ANY_FAULTS, limits=limits)


def fault_verdicts(found: Exploration) -> tuple[Verdict, ...]:
    """The verdicts on faults that pass: safe while they last, and nothing lost when they have ceased."""
    faults = "while messages are lost and doubled, and controllers and the coordinator crash and restart"
    safe = [
        replace(
            verdict, name=f"faults.{verdict.name.removeprefix('explored.')}", statement=f"{verdict.statement}, {faults}"
        )
        for verdict in found.safety
    ]
    resumes = "when faults have ceased, whatever the central net may fire next, the protocol can fire next"
    return (*safe, replace(found.complete, name="faults.resumes", statement=resumes))


def outages(decomposition: Decomposition, limits: Callable[[], Limits] = Limits) -> Iterator[Outage]:
    """What stands still and what goes on while each controller is dead, and while the coordinator is.

    The limits are made anew for each.
    """
    for subnet in decomposition.subnets:
        yield _outage(decomposition, subnet.name, limits())
    if decomposition.coordinated:
        yield _outage(decomposition, "", limits())


def _outage(decomposition: Decomposition, who: str, limits: Limits) -> Outage:
    faults = Faults(restart=False, doomed=who)
    faults = replace(faults, crash=Often.ONCE) if who else replace(faults, coordinator=Often.ONCE)
    found = explore_protocol(decomposition, PROTOCOL, faults, limits=limits)
    try:
        found.space.require_complete()
        kinds = _divided(found, Holds(down(who) if who else COORDINATOR_DOWN))
    except (IncompleteGraph, BudgetExceeded) as error:
        return Outage(who, bound=found.space.bound or str(error))
    still, running = _machines(decomposition.net, kinds["goes on"])
    return Outage(who, kinds["at once"], kinds["at last"], kinds["goes on"], still, running)


def _divided(found: Exploration, dead: Holds) -> dict[str, tuple[str, ...]]:
    space, algebra = found.space, found.space.algebra
    after = space.satisfying(dead)
    n_after = space.count(after)
    kinds: dict[str, list[str]] = {"at once": [], "at last": [], "goes on": []}
    for t, by in found.protocol.firing.items():
        if not by:
            continue
        where = algebra.disjunction(space.may_fire(i) for i in by)
        if not space.count(where):
            continue  # the central net does not fire it either
        firing: Any = algebra.conjunction([after, where])
        if not space.count(firing):
            kinds["at once"].append(t)
        else:
            goes_on = space.count(space.backward(firing, after)) == n_after
            kinds["goes on" if goes_on else "at last"].append(t)
    return {kind: tuple(some) for kind, some in kinds.items()}


def _machines(net: Net, goes_on: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The machines that are sent commands, by whether some transition that goes on sends one."""
    entered = {place for t in goes_on for place in net.transition(t).outputs}
    machines = {place.command.machine: False for place in net.places if place.command is not None}
    for place in net.places:
        if place.command is not None and place.name in entered:
            machines[place.command.machine] = True
    still = tuple(machine for machine, runs in machines.items() if not runs)
    return still, tuple(machine for machine, runs in machines.items() if runs)


def outage_verdict(outage: Outage) -> Verdict:
    """As a verdict, for information: what stands still are its subjects."""
    told = f"machines: {listed(outage.still) or 'none'} stand still, {listed(outage.running) or 'none'} go on"
    return Verdict(
        f"faults.dead.{outage.who or COORDINATOR}",
        Status.UNKNOWN if outage.bound else Status.PROVED,
        f"while {outage.name} is dead, these transitions stand still, at once or at last, and no others",
        "protocol net, configurations after the crash",
        Weight.INFORMATION,
        hint="" if outage.bound else told,
        bound=outage.bound,
        subjects=(*outage.at_once, *outage.at_last),
    )


def outage_text(found: Sequence[Outage]) -> str:
    """The outages as a text: a paragraph for each, a line for each kind; `goes on` is what a person looks for.

    >>> print(outage_text([Outage("robot", ("move",), ("load",), ("mill",), ("arm",), ("mill",))]), end="")
    robot dead
      stands still at once   move
      stands still at last   load
      goes on                mill
      machines still         arm
      machines running       mill
    """
    lines = []
    for outage in found:
        lines.append(f"{outage.name} dead")
        if outage.bound:
            lines.append(f"  not known: {outage.bound}")
            continue
        rows = (
            ("stands still at once", outage.at_once),
            ("stands still at last", outage.at_last),
            ("goes on", outage.goes_on),
            ("machines still", outage.still),
            ("machines running", outage.running),
        )
        lines += [f"  {title:<22} {', '.join(names) or '-'}" for title, names in rows]
    return "".join(f"{line}\n" for line in lines)
