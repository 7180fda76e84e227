"""Parts of a net that share no place, each with its part of the goal.

What a reduction leaves is often several nets side by side. A marking of the whole is any combination of markings of the
parts, because no transition sees more than one part. So a conjunction, each operand of which speaks of one part, is
reachable if and only if each part reaches its operands; and the whole is in a deadlock if and only if each part is. The
parts have as many markings as their sum, the whole as their product.

Operands that speak of several parts hold them together. A transition without any place belongs to no part; with one the
net is not taken apart.

Cost: almost linear in the arcs and the goal (union-find).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from firable.nets.formula import And, Constant, Deadlock, Firable, Formula, Start, names_in
from firable.nets.net import Net, Place, Transition


def parts(net: Net, goal: Formula) -> tuple[tuple[Net, Formula], ...]:
    """The parts with their goals, the smallest first; a goal over places, and perhaps `deadlock` in conjunction.

    >>> from firable.nets.formula import format_formula, parse_formula
    >>> from firable.nets.net import Place
    >>> net = Net("n", (Place("p", marked=True), Place("q", marked=True)), (Transition("t", ("p",)),))
    >>> [(part.places[0].name, format_formula(of)) for part, of in parts(net, parse_formula("deadlock and q"))]
    [('p', 'deadlock'), ('q', 'deadlock and q')]
    """
    operands = list(_operands(goal))
    spoken = [_places(operand) for operand in operands]
    around = [_around(transition) for transition in net.transitions]
    whole = ((net, goal),)
    deadlock = Deadlock() in operands
    known = all(names is not None for names, operand in zip(spoken, operands, strict=True) if operand != Deadlock())
    if not known or not all(around) or not net.places:
        return whole
    leader = {place.name: place.name for place in net.places}
    for names in (*spoken, *around):
        _join(leader, names or ())
    part_of = {place.name: _leader(leader, place.name) for place in net.places}
    heads = dict.fromkeys(part_of.values())
    if len(heads) < 2:
        return whole
    places: dict[str, list[Place]] = {head: [] for head in heads}
    for place in net.places:
        places[part_of[place.name]].append(place)
    transitions: dict[str, list[Transition]] = {head: [] for head in heads}
    for transition, names in zip(net.transitions, around, strict=True):
        transitions[part_of[names[0]]].append(transition)
    goals: dict[str, list[Formula]] = {head: [Deadlock()] if deadlock else [] for head in heads}
    for operand, spoken_of in zip(operands, spoken, strict=True):
        if spoken_of is not None:
            goals[part_of[spoken_of[0]]].append(operand)
    found = [
        (Net(net.name, tuple(places[head]), tuple(transitions[head]), net.signals), _conjunction(goals[head]))
        for head in heads
        if goals[head]
    ]
    return tuple(sorted(found, key=lambda part: len(part[0].places)))


def _operands(goal: Formula) -> Iterator[Formula]:
    if isinstance(goal, And):
        for operand in goal.operands:
            yield from _operands(operand)
    else:
        yield goal


def _places(operand: Formula) -> list[str] | None:
    """The places that an operand speaks of; None where it may speak of others, or of none."""
    if _mentions_all(operand):
        return None
    return [atom.place for atom in names_in(operand) if not isinstance(atom, Firable)] or None


def _mentions_all(formula: Formula) -> bool:
    match formula:
        case Deadlock() | Start() | Firable() | Constant():
            return True
        case _:
            inner = getattr(formula, "operands", None) or (getattr(formula, "operand", None),)
            return any(_mentions_all(one) for one in inner if one is not None)


def _around(transition: Transition) -> list[str]:
    return [*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive]


def _join(leader: dict[str, str], names: Iterable[str]) -> None:
    heads = [_leader(leader, name) for name in names]
    for head in heads[1:]:
        leader[_leader(leader, head)] = _leader(leader, heads[0])


def _leader(leader: dict[str, str], name: str) -> str:
    while leader[name] != name:
        leader[name] = name = leader[leader[name]]
    return name


def _conjunction(operands: list[Formula]) -> Formula:
    return operands[0] if len(operands) == 1 else And(tuple(operands))
