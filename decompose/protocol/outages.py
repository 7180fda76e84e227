"""What a fault does to the cell: blocked safely or not, which machines stand still, what goes on, what resumes.

Two explorations answer for all faults that pass: with messages lost and doubled and everybody crashing and restarting,
again and again, the protocol stays safe (the sentences of refinement); and when faults have ceased, nothing is lost:
whatever the central net may fire next can be fired next, so what stood still resumes. One fault of each kind is a case
of that.

Whoever is *dead* never restarts. That is safe too, by the same exploration, since nobody has to restart in it. What the
others can still do is asked of a net in which one of them may crash, of its configurations after the crash, which
nothing leads out of. Each carries a marking of the central net, and the dead keep back only what the central net could
still fire from there: a transition that fires once, at start-up, and has fired would not fire again anyway, nor what
another choice has ruled out. A transition

- stands still *at once*, if none of these configurations fires it: it is local to who is dead, or nobody is left to
  decide it;
- stands still *at last*, if from some of them it never fires again, though from the central marking that this one
  carries the central net could: as soon as it waits for something that nobody does any more. It may still finish what
  was begun, such as a firing that was decided before the crash;
- *goes on*, if it can fire again from each of them from where the central net could.

The same is asked of the transitions that send commands to a machine, taken together, which is not the division of each:
a machine that is switched on once and then used stands still if its use does, though nothing keeps back the switching
on. It stands still if from some configuration none of them ever fires again, though the central net could fire one.

What is looked at first is M0. Whoever crashes may do so at once, and whatever can fire at all can fire from there; so
what does not fire where they are dead from the start is kept back, which a small exploration finds. Only for the others
are configurations sought from which they never fire again, and the central net is explored only for those that are
stuck from other markings than M0 alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.goal import Limits
from firable.analysis.question import listed
from firable.analysis.spaces.reachability import Budget, explore
from firable.decompose.protocol.completeness import CENTRAL_MARKINGS_MAX, carrying
from firable.decompose.protocol.draft import coordinator_down, down
from firable.decompose.protocol.exploring import Exploration, explore_protocol, space_of
from firable.decompose.protocol.parts import Parts
from firable.decompose.protocol.variant import ANY_FAULTS, PROTOCOL, Faults, Often
from firable.nets.decomposition import Decomposition
from firable.nets.formula import Holds
from firable.nets.net import Marking, Net
from firable.nets.verdict import Status, Verdict, Weight
from firable.semantics.player import Player

WHILE_FAULTS: Final = "while messages are lost and doubled, and controllers and coordinators crash and restart"
RESUMES: Final = "when faults have ceased, whatever the central net may fire next, the protocol can fire next"


@dataclass(frozen=True, slots=True)
class Outage:
    """What goes on while somebody is dead: `who` is a controller, or empty, and then the `coordinator` that is.

    A coordinator bears the name of a controller too, which does not die with it. `at_once`, `at_last` and `goes_on`
    divide the transitions of the central net that can fire at all, `still` and `running` the machines that these send
    commands. What goes on is what is not kept back: it may have fired for the
    last time for other reasons. `bound` says why this is not known, where it is not.
    """

    who: str
    at_once: tuple[str, ...] = ()
    at_last: tuple[str, ...] = ()
    goes_on: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    running: tuple[str, ...] = ()
    bound: str = ""
    coordinator: str = ""

    @property
    def name(self) -> str:
        """Who is dead, in words."""
        return self.who or self.coordinator


def fault_exploration(decomposition: Decomposition, limits: Limits | None = None) -> Exploration:
    """All runs of the protocol under any number of faults of each kind, which includes one of each."""
    return explore_protocol(decomposition, PROTOCOL, ANY_FAULTS, limits=limits)


def fault_verdicts(found: Exploration) -> tuple[Verdict, ...]:
    """The verdicts on faults that pass: safe while they last, and nothing lost when they have ceased."""
    safe = [
        replace(
            verdict,
            name=f"faults.{verdict.name.removeprefix('explored.')}",
            statement=f"{verdict.statement}, {WHILE_FAULTS}",
        )
        for verdict in found.safety
    ]
    return (*safe, replace(found.complete, name="faults.resumes", statement=RESUMES))


def outages(decomposition: Decomposition, limits: Callable[[], Limits] = Limits) -> Iterator[Outage]:
    """What stands still and what goes on while each controller is dead, and while each coordinator is.

    The limits are made anew for each.
    """
    for subnet in decomposition.subnets:
        yield _outage(decomposition, Outage(subnet.name), limits())
    for coordinator in Parts(decomposition, PROTOCOL).deciders:
        yield _outage(decomposition, Outage("", coordinator=coordinator), limits())


def _outage(decomposition: Decomposition, dead: Outage, limits: Limits) -> Outage:
    faults = Faults(restart=False, doomed=dead.name)
    faults = replace(faults, crash=Often.ONCE) if dead.who else replace(faults, coordinator=Often.ONCE)
    found = explore_protocol(decomposition, PROTOCOL, faults, limits=limits)
    try:
        found.space.require_complete()
        return _divided(found, dead)
    except (IncompleteGraph, BudgetExceeded) as error:
        return replace(dead, bound=found.space.bound or str(error))


def _divided(found: Exploration, dead: Outage) -> Outage:
    space, algebra = found.space, found.space.algebra
    is_down = down(dead.who) if dead.who else coordinator_down(dead.coordinator)
    after = space.satisfying(Holds(is_down))
    at_once, firable = list[str](), dict[str, Any]()
    for t, by in found.protocol.firing.items():
        where = algebra.disjunction(space.may_fire(i) for i in by)
        if not space.count(where):
            continue  # the central net does not fire it either
        firable[t] = algebra.conjunction([after, where])
        if not space.count(firable[t]):
            at_once.append(t)
    commanding = _commanding(found.protocol.parts.net, firable)
    from_start = _firing_from_start(found, is_down)
    kept_back, groups = set[tuple[str, ...]](), dict[tuple[str, ...], Any]()
    stuck = cache(lambda t: algebra.conjunction([after, algebra.negation(space.backward(firable[t], after))]))
    for some in dict.fromkeys([*((t,) for t in firable), *commanding.values()]):
        if from_start.isdisjoint(some):
            kept_back.add(some)
        else:  # EF of one of them is the union of the EF of each
            groups[some] = algebra.conjunction(stuck(t) for t in some)
    kept_back |= _kept_back(found, groups)
    at_last = tuple(t for t in firable if (t,) in kept_back and t not in at_once)
    goes_on = tuple(t for t in firable if (t,) not in kept_back)
    still = tuple(machine for machine, some in commanding.items() if some in kept_back)
    running = tuple(machine for machine in commanding if machine not in still)
    return replace(dead, at_once=tuple(at_once), at_last=at_last, goes_on=goes_on, still=still, running=running)


def _firing_from_start(found: Exploration, is_down: str) -> set[str]:
    """The transitions that can fire where somebody crashes before anything else happens."""
    net = found.protocol.net
    (crash,) = net.producers[net.place_index[is_down]]
    start = Player(net).fire(net.initial_marking, (crash,))
    places = tuple(replace(place, marked=bool(start >> i & 1)) for i, place in enumerate(net.places))
    space = space_of(replace(found.protocol, net=replace(net, places=places)), found.limits)
    space.require_complete()
    fired = space.fired()
    return {t for t, by in found.protocol.firing.items() if any(fired[i] for i in by)}


def _commanding(net: Net, firing: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """For each machine that is sent commands, the transitions that can fire and send it one."""
    found: dict[str, tuple[str, ...]] = {}
    for machine in dict.fromkeys(place.command.machine for place in net.places if place.command is not None):
        entered = {place.name for place in net.places if place.command and place.command.machine == machine}
        some = tuple(t for t in firing if not entered.isdisjoint(net.transition(t).outputs))
        if some:
            found[machine] = some
    return found


def _kept_back(found: Exploration, stuck: Mapping[tuple[str, ...], Any]) -> set[tuple[str, ...]]:
    """The groups of transitions that the dead keep back: stuck, all of a group, where the central net could fire one.

    `stuck` gives for each group the configurations after the crash from which none of it ever fires again. Raises
    `IncompleteGraph` where the central net has to be explored and is too large.
    """
    net, space, algebra = found.protocol.parts.net, found.space, found.space.algebra
    open_ = {some: configurations for some, configurations in stuck.items() if space.count(configurations)}
    kept_back = set[tuple[str, ...]]()

    def look(marking: Marking, among: Sequence[tuple[str, ...]]) -> None:
        inside = carrying(space, net, marking)
        for some in among:
            if space.count(algebra.conjunction([open_[some], inside])):
                kept_back.add(some)
                del open_[some]

    look(net.initial_marking, tuple(open_))
    if not open_:
        return kept_back
    central = explore(
        net, budget=Budget(CENTRAL_MARKINGS_MAX, found.limits.memory_bytes), deadline=found.limits.deadline
    )
    central.require_complete()
    fires = {t: central.may_fire(net.transition_index[t]) for some in open_ for t in some}
    could = {some: central.backward(central.algebra.disjunction(fires[t] for t in some)) for some in open_}
    for i in range(central.n_markings):
        among = tuple(some for some in open_ if could[some][i])
        if among:
            look(central.marking(i), among)
    return kept_back


def outage_verdict(outage: Outage) -> Verdict:
    """As a verdict, for information: what stands still are its subjects."""
    told = f"machines: {listed(outage.still) or 'none'} stand still, {listed(outage.running) or 'none'} go on"
    return Verdict(
        f"faults.dead.{outage.who or outage.coordinator.removeprefix('the ').replace(' ', '.')}",
        Status.UNKNOWN if outage.bound else Status.PROVED,
        f"while {outage.name} is dead, these transitions stand still, at once or at last, where the central net could "
        "fire them again, and no others",
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
