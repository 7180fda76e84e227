"""Copies of a transition relation one after the other: the runs of a net as Boolean terms.

The variables of frame k are the net's own with `@k` behind; no name holds an `@`-number made so, because all are made
here. The relation is translated once and each further copy is a substitution inside z3, which is ten times faster than
building it again. Frames are added when they are asked for, so that a search of growing depth pays for each once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property

import z3

from firable.analysis.evidence.certificate import Clause, Equation
from firable.analysis.induction.encoding import Relation
from firable.analysis.induction.session import Session
from firable.analysis.induction.smt import Answer, Term, Terms
from firable.nets.net import Marking, Net
from firable.semantics.player import FiringSet


class Unrolling:
    """A solver that holds a run of growing length, and facts about each of its markings.

    Frame 0 is free; `add` what is known of it.
    """

    def __init__(self, session: Session, net: Net, encode: Callable[[Net, Terms], Relation]) -> None:
        self.session = session
        self.net = net
        self.terms = Terms()
        self.places = tuple(self.terms.variable(place.name) for place in net.places)
        self.solver = session.solver()
        self._encode = encode
        self._places = [self._copies(self.places, 0)]
        self._fires: list[list[z3.BoolRef]] = []
        self._facts: list[Clause | Equation] = []

    @cached_property
    def _relation(self) -> tuple[Relation, z3.BoolRef]:
        """The relation and z3's copy of it, made when a firing is wanted."""
        relation = self._encode(self.net, self.terms)
        return relation, self.session.translated([relation.term])[0]

    @property
    def depth(self) -> int:
        """The number of the last frame."""
        return len(self._fires)

    def extend(self) -> None:
        """Add a firing and the marking after it, with all facts about markings."""
        self.session.check_time()
        k, (relation, template) = self.depth, self._relation
        before, after = self._places[-1], self._copies(relation.before, k + 1)
        fires, signals = self._copies(relation.fires, k), self._copies(relation.signals, k)
        pairs = [
            *zip(self.session.translated(relation.before), before, strict=True),
            *zip(self.session.translated(relation.after), after, strict=True),
            *zip(self.session.translated(relation.fires), fires, strict=True),
            *zip(self.session.translated(relation.signals), signals, strict=True),
        ]
        self.solver.add(z3.substitute(template, *pairs) if pairs else template)
        self._places.append(after)
        self._fires.append(fires)
        for fact in self._facts:
            self.solver.add(self._fact(fact, k + 1))

    def _copies(self, variables: Iterable[Term], k: int) -> list[z3.BoolRef]:
        return [self.session.variable(f"{variable.name}@{k}") for variable in variables]

    def at(self, k: int, term: Term) -> z3.BoolRef:
        """A term over the places, of the marking of frame k."""
        (template,) = self.session.translated([term])
        pairs = list(zip(self.session.translated(self.places), self._places[k], strict=True))
        return z3.substitute(template, *pairs) if pairs else template

    def learn_marking(self, k: int, marking: Marking) -> None:
        """Fix the marking of frame k."""
        literals = (p if marking >> i & 1 else z3.Not(p) for i, p in enumerate(self._places[k]))
        self.solver.add(*literals)

    def ask_at(self, k: int, term: Term) -> bool:
        """Whether a run, as far as it is made, satisfies a term over the places in frame k."""
        # A name for the question: it is asked as an assumption, which is a literal, and is no fact afterwards.
        here = self.session.variable(f"asked@{k} ")
        self.solver.add(self.session.some([z3.Not(here), self.at(k, term)]))
        return self.session.ask(self.solver, here) is Answer.SAT

    def learn(self, facts: Iterable[Clause | Equation]) -> None:
        """Add facts that hold in every marking, to all frames, also those that come."""
        for fact in facts:
            self._facts.append(fact)
            for k in range(self.depth + 1):
                self.solver.add(self._fact(fact, k))

    def _fact(self, fact: Clause | Equation, k: int) -> z3.BoolRef:
        index, places = self.net.place_index, self._places[k]
        match fact:
            case Equation(weights, tokens):
                return z3.PbEq([(places[index[name]], weight) for name, weight in weights], tokens)
            case Clause(marked, empty):
                literals = [places[index[name]] for name in marked]
                return self.session.some([*literals, *(z3.Not(places[index[name]]) for name in empty)])

    def marking(self, model: z3.ModelRef, k: int) -> Marking:
        """The marking of frame k in a model; a place that the model leaves open holds none."""
        return sum(1 << i for i, place in enumerate(self._places[k]) if z3.is_true(model[place]))

    def firings(self, model: z3.ModelRef, end: int) -> Sequence[FiringSet]:
        """What fires in a model between the frames up to frame `end`."""
        return [tuple(t for t, f in enumerate(fires) if z3.is_true(model[f])) for fires in self._fires[:end]]
