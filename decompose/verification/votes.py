"""Which votes are persistent, judged anew: by the arcs, or by what a document shows of the accused.

The yes of a part needs some places full and some empty (Eq. 1), and some signals at 1 (Eq. 2). Another transition can
take it back only by taking a token from one of the first, by putting one on one of the second, or by entering a place
whose completion or timer is one of the third; and only if it can be firable while the yes stands, and needs none of
the third to be 0. What machines do to a gate is no transition.
Where there is no such transition the verdict is shown by the arcs. Otherwise the question is whether a marking can be
reached in which the yes stands and one of the accused is firable; the claim of a document must be exactly that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from firable.decompose.verification.formulas import Formula, Formulas
from firable.decompose.verification.refusal import NotShownError
from firable.nets.decomposition import Decomposition
from firable.nets.formula import And, Firable, Holds, Not, Or
from firable.nets.formula import Formula as StateFormula
from firable.nets.net import Net, SignalKind, Transition

PREFIX: Final = "persistent."


@dataclass(frozen=True, slots=True)
class Vote:
    """The verdict on a part in words, and the question on markings that it comes down to; None where arcs settle it.

    The yes needs some places `full` and some `empty`; each of the `accused` takes it back when it fires then.
    """

    sentence: str
    question: Formula | None
    full: frozenset[str]
    empty: frozenset[str]
    accused: frozenset[str]


def votes(decomposition: Decomposition, formulas: Formulas) -> dict[str, Vote]:
    """The vote of each part of a transition that the coordinator decides, by the name of its verdict."""
    net = decomposition.net
    subnet = {subnet.name: subnet for subnet in decomposition.subnets}
    takers, givers = _at_places(net, "inputs"), _at_places(net, "outputs")
    clearers = _clearers(net)
    found = {}
    for row in decomposition.coordinated:
        for part in row.parts:
            voted = subnet[part.controller].transition(part.name)
            full, empty = _needs(voted)
            touching = {name for place in full for name in takers.get(place, ())}
            touching |= {name for place in empty for name in givers.get(place, ())}
            for gate in voted.external:
                if gate.wanted:
                    touching |= clearers.get(gate.signal, set())
            others = sorted(touching - {row.name}, key=net.transition_index.__getitem__)
            awaited = {gate.signal for gate in voted.external if gate.wanted}
            levels = {name for name in awaited if net.signal(name).kind is not SignalKind.SENSOR}
            accused = [name for name in others if _can_take_back(net.transition(name), full, empty, levels)]
            stands = [formulas.literal(place, place in full) for place in (*sorted(full), *sorted(empty))]
            goal = formulas.all_of([*stands, formulas.any_of(formulas.variable(f"firable({u})") for u in accused)])
            sentence = f"once '{part.name}' votes yes, no transition but '{row.name}' takes the yes back"
            question = goal if accused and full.isdisjoint(empty) else None
            asked = Vote(sentence, question, frozenset(full), frozenset(empty), frozenset(accused))
            found[f"{PREFIX}{part.name}"] = asked
    return found


def _at_places(net: Net, kind: str) -> dict[str, list[str]]:
    """The transitions at each place by their inputs, or by their outputs."""
    found: dict[str, list[str]] = {}
    for t in net.transitions:
        for place in getattr(t, kind):
            found.setdefault(place, []).append(t.name)
    return found


def _clearers(net: Net) -> dict[str, set[str]]:
    """The transitions that clear each completion signal and timer, and do not need it cleared."""
    cleared = {place.name: place.cleared for place in net.places if place.cleared}
    found: dict[str, set[str]] = {}
    for t in net.transitions:
        for signal in {signal for place in t.outputs for signal in cleared.get(place, ())}:
            if not any(gate.signal == signal and not gate.wanted for gate in t.external):
                found.setdefault(signal, set()).add(t.name)
    return found


def _needs(t: Transition) -> tuple[set[str], set[str]]:
    """The places that a transition needs full, and empty."""
    return {*t.inputs, *t.permissive}, {*t.outputs, *t.inhibitive}


def _can_take_back(t: Transition, full: set[str], empty: set[str], levels: set[str]) -> bool:
    """Whether a transition can be firable, and open, while these places are full and empty and these levels 1."""
    needs_full, needs_empty = _needs(t)
    if any(gate.signal in levels and not gate.wanted for gate in t.external):
        return False
    return t.openable and needs_full.isdisjoint(needs_empty | empty) and needs_empty.isdisjoint(full)


def question_of(goal: StateFormula, formulas: Formulas) -> Formula:
    """The goal of a claim in normal form; `NotShownError` for one that is no question of this kind."""
    match goal:
        case Holds(place):
            return formulas.variable(place)
        case Firable(name):
            return formulas.variable(f"firable({name})")
        case Not(operand):
            return formulas.negation(question_of(operand, formulas))
        case And(operands):
            return formulas.all_of(question_of(operand, formulas) for operand in operands)
        case Or(operands):
            return formulas.any_of(question_of(operand, formulas) for operand in operands)
    raise NotShownError(f"a claim without a verdict is none on a vote: {goal}")
