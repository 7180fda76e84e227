"""Steps of reductions drawn at random, to be held against all markings of the draft before and after each.

A forger who knows the rules would try what keeps all conditions of one but one. Here anything is tried that has the
shape of a step, on many small nets, so that whatever the checker lets pass is met: what a technique would do, what no
technique would, and what is wrong if the checker is.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from copy import copy

from support.lively_nets import lively_net

from firable.analysis.evidence.certificate import Rule, Step
from firable.analysis.evidence.checking.reductions import Draft
from firable.analysis.induction.smt import value
from firable.nets.diagnostics import InputError
from firable.nets.net import Net, Place, Transition

Full = frozenset[int]
"""The places of a draft that hold a token."""


def sparse_net(draw: random.Random, most_places: int = 8) -> Net:
    """Transitions of one or two arcs on each side and few gates, around which much can be composed."""
    names = [f"p{i}" for i in range(draw.randint(most_places // 2, most_places))]
    start = set(draw.sample(names, draw.randint(1, len(names) // 2)))
    transitions = []
    for t in range(draw.randint(len(names) // 2, len(names) + 1)):
        some = draw.sample(names, min(len(names), 5))
        inputs, outputs = some[: draw.choice((0, 1, 1, 1, 2))], some[2 : 2 + draw.choice((0, 1, 1, 1, 2))]
        gate = (some[4:5], []) if draw.random() < 0.2 else ([], some[4:5] if draw.random() < 0.2 else [])
        transitions.append(Transition(f"t{t}", tuple(inputs), tuple(outputs), tuple(gate[0]), tuple(gate[1])))
    return Net("sparse", tuple(Place(name, marked=name in start) for name in names), tuple(transitions))


def drawn_net(draw: random.Random) -> Net:
    """A sparse net or a lively one."""
    return sparse_net(draw) if draw.random() < 0.7 else lively_net(draw, 7)


def taken(draft: Draft, step: Step) -> Draft | None:
    """The draft after one more step; None where the checker refuses it."""
    then = copy(draft)
    then.moves, then.values, then.stands_for = dict(draft.moves), dict(draft.values), dict(draft.stands_for)
    then.at = {literal: set(moves) for literal, moves in draft.at.items()}
    try:
        then.apply(step)
    except InputError:
        return None
    return then


def drawn_steps(draw: random.Random, draft: Draft) -> Iterator[Step]:
    """Steps of all rules, in any order, most of which cannot be taken."""
    places = [draft.net.places[p].name for p in draft.values]
    moves = list(draft.moves)
    tries = [Step(Rule.FACTS)] if draw.random() < 0.4 else []
    for p in places:
        tries += [Step(rule, places=(p,)) for rule in _AROUND]
        tries += [Step(Rule.COPY, places=(p, q)) for q in places if q != p]
        tries += [Step(Rule.GATE, (t,), (p,)) for t in moves]
    for t in moves:
        tries += [Step(rule, (t,)) for rule in (Rule.EARLY, Rule.DEAD, Rule.ALWAYS)]
        tries += [Step(Rule.SUBSUMED, (t, u)) for u in moves if u != t]
        tries += [Step(Rule.IRRELEVANT, tuple(draw.sample(moves, draw.randint(1, len(moves)))))]
    tries += [Step(Rule.CONSTANT, places=tuple(draw.sample(places, draw.randint(1, len(places))))) for _ in places]
    draw.shuffle(tries)
    # The rules that are drawn first are those that few others keep possible.
    return iter(sorted(tries, key=lambda step: draw.random() * _WEIGHTS.get(step.rule, 1.0)))


_AROUND = (Rule.CONSTANT, Rule.UNNEEDED, Rule.IMPLIED, Rule.CLOSERS_EARLY, Rule.OPENERS_LATE)
_WEIGHTS = {Rule.FACTS: 0.1, Rule.CLOSERS_EARLY: 0.3, Rule.OPENERS_LATE: 0.3, Rule.IRRELEVANT: 3.0, Rule.CONSTANT: 2.0}


def reached(draft: Draft) -> set[Full]:
    """All markings of a draft, by its moves."""
    start = frozenset(p for p, full in draft.values.items() if full)
    found, todo = {start}, [start]
    while todo:
        marking = todo.pop()
        for needs, flips in draft.moves.values():
            if all((p in marking) is full for p, full in needs.items()):
                then = marking ^ flips
                if then not in found:
                    found.add(then)
                    todo.append(then)
    return found


def met(draft: Draft, markings: set[Full]) -> bool:
    """Whether the goal of a draft holds in one of these markings."""
    if draft.deadlock and draft.never_dead:
        return False
    return any(_met(draft, marking) for marking in markings)


def _met(draft: Draft, marking: Full) -> bool:
    dead = not any(all((p in marking) is full for p, full in needs.items()) for needs, _ in draft.moves.values())
    names = {place.name: p in marking for p, place in enumerate(draft.net.places)}
    return (dead or not draft.deadlock) and value(draft.goal, names)
