"""What holds of every configuration of one protocol net, and what brings each of them home: without exploring it.

The theorem for any size (`parametric`) has an invariant. Said of one protocol net it is a list of short sentences about
its places, and since that net is finite, that every step keeps them is a question of propositional logic for each
step: hundreds of small questions, a thousandth of a second each, where exploring needs a diagram that for some nets
nobody finds. So whatever the size of the diagram, the sentences of refinement have evidence that any solver can check.

Beside the invariant stands what is *still to be done*: facts of which each step homeward makes one false and none true.
As long as anything is asked, promised or on its way, such a step can be taken; they are finitely many facts, so every
configuration leads home by steps that fire nothing. The theorem argues in the same way, over sorts instead of places.

That a vote which stands holds in the central net (F2) no step could keep by itself: it is kept because the vote is
persistent, which is a fact on the markings that the central net reaches. So such facts are *given* beside the invariant
(`persistent`), of the marking that the configuration carries; what shows them are the verdicts `persistent.PART`.

A sentence is an OR of ANDs of literals, a place and whether it holds a token: few forms are enough, and that a step
keeps a sentence is seen from the literals that it makes false. Rejected: the diagram itself as evidence, 17,378 nodes
for the cell, and none where no good order of the places is known; it knows nothing of ways home either.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from firable.decompose.protocol.building import ProtocolNet
from firable.decompose.protocol.draft import ASTRAY, at, central, coordinator_down, down
from firable.decompose.protocol.faulty import GO_ON, IGNORED
from firable.decompose.protocol.parts import Part, Parts
from firable.decompose.protocol.rounds import asked, committed, decided, is_open
from firable.nets.net import Transition

Literal = tuple[str, bool]
"""A place, and whether it holds a token."""
Sentence = tuple[tuple[Literal, ...], ...]
"""An OR of ANDs."""

HOMEWARD: Final = frozenset({"give-up", "order", "apply", "release", "note", "close", "ignore", "late", "restart"})
"""The kinds of steps that lead home; of the others that fire nothing, some only repeat."""


_KINDS: Final = (
    *("request", "vote", "heard", "promised", "obeyed"),
    *("commit-order", "abort-order", "acknowledgement", "noted"),
)


def negated(literal: Literal) -> Literal:
    """The opposite literal."""
    return literal[0], not literal[1]


def clause(*literals: Literal) -> Sentence:
    """At least one of these."""
    return tuple((literal,) for literal in literals)


def implied(given: Literal, *then: Literal) -> Sentence:
    """If the first, then one of the others."""
    return clause(negated(given), *then)


def invariant(protocol: ProtocolNet) -> Iterator[Sentence]:
    """The sentences that hold of every configuration: V1 to V5, F1 to F3, S1, S2 and what messages say, of this net."""
    parts = protocol.parts
    yield clause((ASTRAY, False))
    underway: dict[Literal, list[tuple[Literal, ...]]] = {}
    for t, its in parts.coordinated.items():
        yield from _of_rounds(parts, t)
        for part in its:
            yield from _of_free(part) if part.free else _of_part(parts, part)
            here = ((committed(t), True), (at("obeyed", part), False))
            for places, full in ((part.inputs, True), (part.outputs, False)):
                for moved in places:
                    yield clause(*map(negated, here), (central(moved), not full))  # S1
                    underway.setdefault((moved, full), []).append(here)
    for place in parts.net.places:
        for full in (True, False):  # S2: where they differ, something is underway
            yield (*clause((place.name, not full), (central(place.name), full)), *underway.get((place.name, full), ()))


def _of_rounds(parts: Parts, t: str) -> Iterator[Sentence]:
    group = parts.groups[parts.group_of[t]]
    asks, commits, over = (asked(t), True), (committed(t), True), (decided(parts, t), True)
    asked_for = bool(parts.promising(t))
    if asked_for:
        yield implied(commits, asks)
    yield implied(commits, over)
    if len(group) == 1:
        yield implied(over, asks if asked_for else commits)  # else a round stays decided until all its parts are closed
    yield from (implied(commits, (committed(u), False)) for u in group if u != t)  # V5


def _of_part(parts: Parts, part: Part) -> Iterator[Sentence]:
    t = part.whole
    asks, commits, over = (asked(t), True), (committed(t), True), (decided(parts, t), True)
    request, vote, heard, promised, obeyed, commit, abort, acknowledged, noted = (
        (at(kind, part), True) for kind in _KINDS
    )
    yield from (implied(one, asks) for one in (request, vote, promised, obeyed, abort))
    yield from (implied(one, obeyed) for one in (acknowledged, noted))
    yield from (implied(one, over) for one in (obeyed, abort))
    yield implied(vote, promised, obeyed)  # V1
    yield implied(heard, promised)
    yield implied(heard, negated(commits))
    yield implied(promised, negated(obeyed))
    yield implied(commits, promised, obeyed)  # V4
    yield implied(commit, commits)
    yield implied(abort, negated(commits))
    yield implied(abort, negated(heard))
    for place, full in demands(part):  # V2
        yield implied(promised, over, (place, full))
        yield clause(negated(promised), negated(commits), (place, full))
    yield from (implied(promised, (at("promised", other), False)) for other in parts.excluding(part))  # V3


def _of_free(part: Part) -> Iterator[Sentence]:
    t = part.whole
    commits = (committed(t), True)
    vote, heard, stands, obeyed, commit, acknowledged, noted = (
        (at(kind, part), True)
        for kind in ("vote", "heard", "stands", "obeyed", "commit-order", "acknowledgement", "noted")
    )
    yield from (implied(one, obeyed) for one in (acknowledged, noted))
    yield from (implied(one, commits) for one in (obeyed, commit))
    yield implied(vote, stands, obeyed)
    yield implied(heard, stands)
    yield implied(heard, negated(commits))
    yield implied(commits, stands, obeyed)  # F3
    for places, full in ((part.inputs, True), (part.outputs, False)):  # F1
        yield from (implied(stands, (place, full)) for place in places)
    for place, full in demands(part):  # F2
        yield (*clause(negated(stands), (central(place), full)), (commits, negated(obeyed)))


def persistent(protocol: ProtocolNet) -> Iterator[Sentence]:
    """What is given of the central marking: where a part free of promise is firable, nothing else can take that back.

    A sentence for each of them and each other transition that would, where both could be firable at once. Given is what
    the decomposition says of its parts; a wrong variant that takes others for free is given nothing.
    """
    said = set(protocol.parts.decomposition.free)
    every = (part for its in protocol.parts.coordinated.values() for part in its if part.free)
    for part in (part for part in every if (part.whole, part.controller) in said):
        yes = set(demands(part))
        for t in protocol.parts.transitions:
            taken = {*((place, True) for place in t.inputs), *((place, False) for place in t.outputs)}
            both = yes | set(demands(t))
            if t.name != part.whole and taken & yes and both.isdisjoint(map(negated, both)):
                yield clause(*((central(place), not full) for place, full in both))


@dataclass(frozen=True, slots=True)
class Homeward:
    """A step that leads home, where besides what it demands these literals hold."""

    step: Transition
    where: tuple[Literal, ...] = ()


def homeward(protocol: ProtocolNet) -> Iterator[Homeward]:
    """The steps that lead home. An order is one while no acknowledgement is on its way: else it would only repeat.

    So is the arrival of a vote that counts whether asked for or not: it stands, at home, too.
    """
    free = (part for its in protocol.parts.coordinated.values() for part in its if part.free)
    unasked = {at("hear", part) for part in free}
    for t in protocol.net.transitions:
        step = protocol.steps[t.name]
        arrives = step.kind == "hear" and (t.name.endswith("/again") or t.name in unasked)
        if step.kind in HOMEWARD or arrives:
            orders = [place for place in t.outputs if place.startswith(("commit-order/", "abort-order/"))]
            answers = (f"acknowledgement/{place.partition('/')[2]}" for place in orders)
            yield Homeward(t, tuple((place, False) for place in answers))


def still_to_be_done(protocol: ProtocolNet) -> Iterator[Sentence]:
    """The facts that all are false at home: each step homeward makes one of them false, and none true."""
    parts = protocol.parts
    for group in parts.groups:
        over = (decided(parts, group[0]), True)
        yield clause(over, *((is_open(parts, t), True) for t in group))
        for t in group:
            yield clause((is_open(parts, t), True))
            if parts.promising(t):
                yield (((asked(t), True), negated(over)),)
            for part in parts.coordinated[t]:
                yield from _to_be_done(part)
    places = protocol.net.place_index
    downs = (down(subnet.name) for subnet in parts.decomposition.subnets)
    decide = map(coordinator_down, parts.deciders)
    yield from (clause((place, True)) for place in (*downs, *decide, IGNORED) if place in places)


def _to_be_done(part: Part) -> Iterator[Sentence]:
    """Of a part: its order is sent, obeyed, noted; then orders and acknowledgements that are left over arrive.

    One that is free of promise gets an order where its transition is committed, else none.
    """
    if part.free:
        commits = (committed(part.whole), True)
        vote, commit, acknowledged, noted = (
            (at(kind, part), True) for kind in ("vote", "commit-order", "acknowledgement", "noted")
        )
        unnoted, unanswered = (commits, negated(noted)), negated(acknowledged)
        yield clause(vote)
        yield (unnoted,)
        yield ((*unnoted, unanswered),)
        yield ((*unnoted, unanswered, negated(commit)),)
        yield (unnoted, (commits, commit), (commits, acknowledged))
        yield (unnoted, (commits, commit))
        yield (unnoted, (commits, commit, acknowledged))
        return
    asks = (asked(part.whole), True)
    request, vote, commit, abort, acknowledged, noted = (
        (at(kind, part), True)
        for kind in ("request", "vote", "commit-order", "abort-order", "acknowledgement", "noted")
    )
    unnoted, unanswered = (asks, negated(noted)), negated(acknowledged)
    yield clause(request)
    yield clause(vote)
    yield (unnoted,)
    yield ((*unnoted, unanswered),)
    yield ((*unnoted, unanswered, negated(commit), negated(abort)),)
    yield (unnoted, (asks, commit), (asks, abort), (asks, acknowledged))
    yield (unnoted, (asks, commit), (asks, abort))
    yield (unnoted, (asks, commit, acknowledged), (asks, abort, acknowledged))


def may_go_on(protocol: ProtocolNet) -> tuple[Literal, ...]:
    """That faults have ceased, where they can."""
    return ((GO_ON, False),) if GO_ON in protocol.net.place_index else ()


def demands(of: Transition | Part) -> Iterator[Literal]:
    """Eq. (1)."""
    yield from ((place, True) for place in (*of.inputs, *of.permissive))
    yield from ((place, False) for place in (*of.outputs, *of.inhibitive))


def effect(t: Transition) -> dict[str, bool]:
    """What is in the places that a firing changes after it."""
    return {**dict.fromkeys(t.inputs, False), **dict.fromkeys(t.outputs, True)}


def touched(sentences: Iterable[Sentence]) -> Mapping[Literal, Sequence[Sentence]]:
    """The sentences in which each literal stands; none for one that stands in no sentence."""
    found = defaultdict[Literal, list[Sentence]](list)
    for one in sentences:
        for literal in {literal for term in one for literal in term}:
            found[literal].append(one)
    return found
