"""What the yes of a part rests on and who can take it back, read off the arcs anew.

The yes of a part needs some places full and some empty (Eq. 1), and some signals at 1 (Eq. 2). Another transition
*touches* it if it takes a token from one of the first, puts one on one of the second, or enters a place whose
completion or timer is one of the third. It is *accused* if it can be firable while the yes stands, and needs none of
the third to be 0. What machines do to a gate is no transition.
Where none is accused, or the units that a bundle lists exclude all, the vote is an obligation (`restating_votes`).
Otherwise the question is whether a marking can be reached in which the yes stands and one of the accused is firable;
the claim of a document must be exactly that. Of a part with more than so many arcs at its places nobody asks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from firable.decompose.verification.formulas import Formula, Formulas
from firable.decompose.verification.refusal import NotShownError
from firable.nets.decomposition import Decomposition
from firable.nets.formula import And, Firable, Holds, Not, Or
from firable.nets.formula import Formula as StateFormula
from firable.nets.net import Net, SignalKind, Transition

PREFIX: Final = "persistent."
ARCS_MAX: Final = 500
"""With more arcs than this at the places of a part, nobody looks at its vote."""


@dataclass(frozen=True, slots=True)
class Vote:
    """The yes of a part: the places that it needs `full` and `empty`, and the completions and timers that it awaits.

    Of those who touch it, in the order of the net, the accused can be enabled beside it. `asked` is whether anybody
    looks at this vote.
    """

    whole: str
    part: Transition
    full: frozenset[str]
    empty: frozenset[str]
    levels: tuple[str, ...]
    touching: tuple[str, ...]
    accused: tuple[str, ...]
    asked: bool = True

    @property
    def name(self) -> str:
        """The name of the verdict on it."""
        return f"{PREFIX}{self.part.name}"

    @property
    def sentence(self) -> str:
        """What that says."""
        return f"once '{self.part.name}' votes yes, no transition but '{self.whole}' takes the yes back"

    def question(self, formulas: Formulas) -> Formula:
        """Whether the yes can stand while one of the accused is firable."""
        stands = [
            *(formulas.literal(place, value=True) for place in sorted(self.full)),
            *(formulas.literal(place, value=False) for place in sorted(self.empty)),
        ]
        return formulas.all_of([*stands, formulas.any_of(formulas.variable(f"firable({u})") for u in self.accused)])


def votes(decomposition: Decomposition) -> Iterator[Vote]:
    """The vote of each part of a transition that the coordinator decides, in the order of the table."""
    net = decomposition.net
    subnet = {subnet.name: {t.name: t for t in subnet.transitions} for subnet in decomposition.subnets}
    takers, givers, clearers = _at_places(net, "inputs"), _at_places(net, "outputs"), _clearers(net)
    senders: dict[str, int] = {}
    for place in net.places:
        for signal in place.cleared:
            senders[signal] = senders.get(signal, 0) + len(givers.get(place.name, ()))
    for row in decomposition.coordinated:
        for part in row.parts:
            voted = subnet[part.controller][part.name]
            full, empty = needs(voted)
            awaited = dict.fromkeys(gate.signal for gate in voted.external if gate.wanted)
            levels = tuple(name for name in awaited if net.signal(name).kind is not SignalKind.SENSOR)
            near = [*(takers.get(place, ()) for place in full), *(givers.get(place, ()) for place in empty)]
            arcs = sum(map(len, near)) + sum(senders.get(signal, 0) for signal in awaited)
            if arcs > ARCS_MAX:
                yield Vote(row.name, voted, full, empty, levels, (), (), asked=False)
                continue
            near += [clearers.get(signal, ()) for signal in awaited]
            others = {name for some in near for name in some} - {row.name}
            touching = sorted(others, key=net.transition_index.__getitem__)
            stands = full.isdisjoint(empty)
            accused = [t for t in touching if stands and _can_take_back(net.transition(t), full, empty, levels)]
            yield Vote(row.name, voted, full, empty, levels, tuple(touching), tuple(accused))


def _at_places(net: Net, kind: str) -> dict[str, list[str]]:
    """The transitions at each place by their inputs, or by their outputs."""
    found: dict[str, list[str]] = {}
    for t in net.transitions:
        for place in getattr(t, kind):
            found.setdefault(place, []).append(t.name)
    return found


def _clearers(net: Net) -> dict[str, list[str]]:
    """The transitions that clear each completion signal and timer, and do not need it cleared."""
    cleared = {place.name: place.cleared for place in net.places if place.cleared}
    found: dict[str, list[str]] = {}
    for t in net.transitions:
        for signal in {signal for place in t.outputs for signal in cleared.get(place, ())}:
            if not any(gate.signal == signal and not gate.wanted for gate in t.external):
                found.setdefault(signal, []).append(t.name)
    return found


def needs(t: Transition) -> tuple[frozenset[str], frozenset[str]]:
    """The places that a transition needs full, and empty."""
    return frozenset((*t.inputs, *t.permissive)), frozenset((*t.outputs, *t.inhibitive))


def _can_take_back(t: Transition, full: frozenset[str], empty: frozenset[str], levels: tuple[str, ...]) -> bool:
    """Whether a transition can be firable, and open, while these places are full and empty and these levels 1."""
    needs_full, needs_empty = needs(t)
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
