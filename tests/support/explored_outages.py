"""What the dead keep back, found by exploring the protocol's net with somebody dead in it: the oracle of `outages`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget, explore
from firable.decompose.protocol.completeness import CENTRAL_MARKINGS_MAX, carrying
from firable.decompose.protocol.draft import coordinator_down, down
from firable.decompose.protocol.exploring import Exploration, explore_protocol, space_of
from firable.decompose.protocol.outages import Outage, commanding, outages
from firable.decompose.protocol.parts import Parts
from firable.decompose.protocol.variant import PROTOCOL, Faults, Often
from firable.decompose.splitting.cut import split
from firable.nets.decomposition import Decomposition
from firable.nets.formula import Holds
from firable.nets.net import Marking, Net
from firable.semantics.player import Player


def explored_outages(decomposition: Decomposition) -> Iterator[Outage]:
    """What stands still and what goes on while each controller is dead, and while each coordinator is."""
    for subnet in decomposition.subnets:
        yield _outage(decomposition, Outage(subnet.name))
    for coordinator in Parts(decomposition, PROTOCOL).deciders:
        yield _outage(decomposition, Outage("", coordinator=coordinator))


def _outage(decomposition: Decomposition, dead: Outage) -> Outage:
    faults = Faults(restart=False, doomed=dead.name)
    faults = replace(faults, crash=Often.ONCE) if dead.who else replace(faults, coordinator=Often.ONCE)
    found = explore_protocol(decomposition, PROTOCOL, faults, limits=Limits())
    found.space.require_complete()
    return _divided(found, dead)


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
    sending = commanding(found.protocol.parts.net, tuple(firable))
    from_start = _firing_from_start(found, is_down)
    kept_back, groups = set[tuple[str, ...]](), dict[tuple[str, ...], Any]()
    stuck = cache(lambda t: algebra.conjunction([after, algebra.negation(space.backward(firable[t], after))]))
    for some in dict.fromkeys([*((t,) for t in firable), *sending.values()]):
        if from_start.isdisjoint(some):
            kept_back.add(some)
        else:  # EF of one of them is the union of the EF of each
            groups[some] = algebra.conjunction(stuck(t) for t in some)
    kept_back |= _kept_back(found, groups)
    at_last = tuple(t for t in firable if (t,) in kept_back and t not in at_once)
    goes_on = tuple(t for t in firable if (t,) not in kept_back)
    still = tuple(machine for machine, some in sending.items() if some in kept_back)
    running = tuple(machine for machine in sending if machine not in still)
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


def is_as_explored(net: Net, decomposed: Callable[[Net], Decomposition] = split) -> bool:
    """Of coordinators the same is found; of controllers no more goes on, since rounds are given up where explored."""
    decomposition = decomposed(net)
    for one, other in zip(outages(decomposition), explored_outages(decomposition), strict=True):
        if one != other and (
            not one.who
            or (one.who, one.at_once) != (other.who, other.at_once)
            or not set(one.goes_on) <= set(other.goes_on)
            or not set(one.running) <= set(other.running)
        ):
            return False
    return True
