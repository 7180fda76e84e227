"""Persistence: the yes of a part stands until its transition fires, as far as arcs and units show it.

While a yes stands, each transition that would take it back must not be enabled. The transitions are those that touch
it (`firable.decompose.splitting.votes`): they take from a place that it needs full, put on one that it needs empty, or
clear a completion that it awaits. One obligation for each part says that none of them is enabled beside the yes: with
Eq. (1) of the part in its subnet, the completions and timers that it awaits (nobody but who fires takes these back; a
sensor may drop, O4), and Eq. (1) and (2) of the other in the central net. Where that alone does not exclude it, two
places of a unit would both have to be full. The obligation then assumes of these units that one at most of those
places holds a token that it speaks of, not of all their places, so that it grows with its own arcs alone.

What is assumed of a unit is an obligation of its own, by induction over firings: M0 has one token there at most, and
each transition that puts one there leaves at most one. What it leaves is Eq. (3)-(4) where it fires alone, hence by
interleaving: its outputs are full, its other inputs empty, and all else is as it was. The places that it changes are
few, and "at most one" is a tree, so the text grows with the arcs at the unit, times the logarithm of its size.

Parts that are left are not claimed here: whether their votes are persistent is a question on markings
(`firable.decompose.splitting.persistence`). No net needs a persistent vote to run, so these verdicts inform; a part
that is free of promise rests on them. Rejected: a copy of the whole invariant for each part, which for a robot with
hundreds of tasks grows with its square.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from firable.analysis.induction.smt import AtMostOne, Terms
from firable.decompose.proofs.obligation import Obligation, claimed
from firable.decompose.proofs.sides import Sides, holds, signals
from firable.decompose.splitting.votes import Unit, Vote, needs, units_in_use
from firable.nets.net import Net, SignalKind
from firable.nets.verdict import Weight
from firable.semantics.firing import enabled, firable
from firable.semantics.trace import Discipline


def persistent(sides: Sides) -> Iterator[Obligation]:
    """The units in use, and each vote that arcs and units settle."""
    settled = [vote for vote in sides.votes if vote.settled]
    names = {unit: f"unit.{k}" for k, unit in enumerate(units_in_use(sides.net, settled), 1)}
    for unit, name in names.items():
        yield _for_information(_unit(sides.net, name, unit))
    for vote in settled:
        rests_on = tuple(names[unit] for unit in vote.units)
        yield replace(_for_information(_stands(sides, vote)), rests_on=rests_on)


def _for_information(obligation: Obligation) -> Obligation:
    return replace(obligation, weight=Weight.INFORMATION, discipline=Discipline.INTERLEAVING.value)


def _unit(net: Net, name: str, unit: Unit) -> Obligation:
    terms, position = Terms(), {place: i for i, place in enumerate(unit)}
    before = AtMostOne(terms, map(terms.variable, unit))
    start = terms.conjunction(terms.literal(place, net.place(place).marked) for place in unit)
    claims = [terms.implies(start, before.term)]
    for t in sorted({t for place in unit for t in net.producers[net.place_index[place]]}):
        transition = net.transitions[t]
        after = {position[place]: terms.false for place in transition.inputs if place in position}
        after |= {position[place]: terms.true for place in transition.outputs if place in position}
        fires = terms.conjunction([before.term, firable(terms, net, t, holds(terms, net))])
        claims.append(terms.implies(fires, before.where(after)))
    statement = f"of the {len(unit)} places of '{name}' one at most holds a token, in M0 and whatever fires"
    return claimed(terms, name, statement, terms.conjunction(claims), subjects=unit)


def _stands(sides: Sides, vote: Vote) -> Obligation:
    terms, net = Terms(), sides.net
    found = sides.part((vote.controller, vote.part))
    if found is None:
        raise AssertionError(f"there is a vote of '{vote.part}', and no such part")
    subnet, t = found
    levels = (
        terms.variable(gate.signal)
        for gate in subnet.transitions[t].external
        if gate.wanted and subnet.signal(gate.signal).kind is not SignalKind.SENSOR
    )
    by = [net.transition_index[name] for name in vote.touching]
    taken_back = terms.disjunction(enabled(terms, net, u, holds(terms, net), signals(terms, net)) for u in by)
    yes = (firable(terms, subnet, t, holds(terms, subnet)), *levels)
    full = vote.full.union(*(needs(net.transitions[u])[0] for u in by))
    return claimed(
        terms,
        f"persistent.{vote.part}",
        f"once '{vote.part}' votes yes, no transition but '{vote.transition}' takes the yes back",
        terms.negation(terms.conjunction([*yes, taken_back])),
        assumptions=[
            terms.at_most_one(terms.variable(place) for place in unit if place in full) for unit in vote.units
        ],
    )
