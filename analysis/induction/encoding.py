"""The transition relation of a net as Boolean terms, under both disciplines.

Each relation is an evaluation of `firable.semantics.firing` in the algebra of terms: Eq. (1) and (2) say what is
enabled, Eq. (3)-(4) what follows, and only *which* enabled transitions fire together is written here. The names of the
variables are the net's own; the characters that no name may contain keep the others apart:

    p          the place p holds a token before
    p'         ... and after
    s          the signal s is 1 (free: whoever solves chooses a valuation)
    fires(t)   the transition t fires

A model of a relation is one edge of the reachability graph's underlying relation: a marking, reachable or not, a firing
set, the marking after, and one valuation that allows it. The rejected alternative, an integer that selects the
transition, is smaller for interleaving but cannot say a step, and leaves Boolean logic.

A third relation is no discipline but a shortcut: many firings of interleaving at once, as far as they can be serialised
(Heljanko 2001, "Bounded reachability checking with process semantics"). It reaches the same markings in fewer steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from firable.analysis.induction.smt import Term, Terms
from firable.nets.net import Marking, Net
from firable.semantics.conflict import conflicts
from firable.semantics.firing import Valuation, enabled, firable, next_token
from firable.semantics.player import FiringSet


@dataclass(frozen=True)
class Relation:
    """A transition relation: `term` over variables for the marking before, after, the signals and what fires.

    The tuples hold the variables in the order of the net's places, signals and transitions.
    """

    net: Net
    terms: Terms
    before: tuple[Term, ...]
    after: tuple[Term, ...]
    signals: tuple[Term, ...]
    fires: tuple[Term, ...]
    term: Term

    def initial(self) -> Term:
        """The marking before is M0."""
        return self.is_marking(self.net.initial_marking)

    def is_marking(self, marking: Marking, *, after: bool = False) -> Term:
        """The marking before (or after) is this one."""
        return marking_term(self.terms, marking, self.after if after else self.before)

    def is_firing(self, fired: FiringSet) -> Term:
        """Exactly these transitions fire."""
        chosen = frozenset(fired)
        literals = (f if t in chosen else self.terms.negation(f) for t, f in enumerate(self.fires))
        return self.terms.conjunction(literals)

    def edge(self, assignment: Mapping[str, bool]) -> tuple[Marking, FiringSet, Marking]:
        """The marking before, the firing set and the marking after that a model of the relation says."""
        before = sum(1 << i for i, p in enumerate(self.before) if assignment[p.name])
        after = sum(1 << i for i, p in enumerate(self.after) if assignment[p.name])
        return before, tuple(t for t, f in enumerate(self.fires) if assignment[f.name]), after


def marking_term(terms: Terms, marking: Marking, holds: tuple[Term, ...]) -> Term:
    """The places hold the tokens of this marking; `holds` says of each place, in their order, that it holds one."""
    return terms.conjunction(p if marking >> i & 1 else terms.negation(p) for i, p in enumerate(holds))


def interleaving_relation(net: Net, terms: Terms | None = None) -> Relation:
    """One transition fires that is firable and that the valuation opens.

    Size: linear in the net. Since signals are free variables, a transition may fire iff *some* valuation opens it.
    """
    return _relation(net, terms, lambda algebra, _, fires: algebra.at_most_one(fires))


def parallel_relation(net: Net, terms: Terms | None = None) -> Relation:
    """Some firable transitions fire that can also fire one by one, in the order of the net.

    No place has two consumers or two producers among them, and none closes an internal gate of one that comes after it.
    Each is opened by a valuation of its own, since they fire at different moments. A single transition is such a set,
    so the markings that can be reached are those of interleaving. Size: linear in the net.
    """

    def chosen(algebra: Terms, _: tuple[Term, ...], fires: tuple[Term, ...]) -> Term:
        sharing = (adjacent for adjacent in (*net.consumers, *net.producers) if len(adjacent) > 1)
        conflict_free = [algebra.at_most_one(fires[t] for t in adjacent) for adjacent in sharing]
        return algebra.conjunction([*conflict_free, *_no_gate_closed_before(net, algebra, fires)])

    return _relation(net, terms, chosen, _may_fire)


def step_relation(net: Net, terms: Terms | None = None) -> Relation:
    """A maximal set of the enabled transitions fires in which every place has one consumer and one producer at most.

    Maximal: an enabled transition stays out only for a rival that fires. The empty step is left out. Size: linear in
    the net, plus the pairs of transitions in conflict.
    """
    rivals = conflicts(net).rivals

    def chosen(algebra: Terms, is_enabled: tuple[Term, ...], fires: tuple[Term, ...]) -> Term:
        sharing = (adjacent for adjacent in (*net.consumers, *net.producers) if len(adjacent) > 1)
        conflict_free = [algebra.at_most_one(fires[t] for t in adjacent) for adjacent in sharing]
        maximal = [
            algebra.implies(is_enabled[t], algebra.disjunction([fires[t], *(fires[u] for u in sorted(rivals[t]))]))
            for t in range(len(fires))
        ]
        return algebra.conjunction([*conflict_free, *maximal])

    return _relation(net, terms, chosen)


def _no_gate_closed_before(net: Net, terms: Terms, fires: tuple[Term, ...]) -> Iterator[Term]:
    """No transition fires after one that closes its internal gate; in the order of the net."""
    permissive: dict[str, set[int]] = {}
    inhibitive: dict[str, set[int]] = {}
    for t, transition in enumerate(net.transitions):
        for gates, reading in ((transition.permissive, permissive), (transition.inhibitive, inhibitive)):
            for place in gates:
                reading.setdefault(place, set()).add(t)
    for closing, reading in ((net.consumers, permissive), (net.producers, inhibitive)):
        for place, readers in reading.items():
            closers = set(closing[net.place_index[place]])
            closed = terms.false  # by one of the transitions passed
            for t in sorted(closers.union(readers)):
                if t in readers:
                    yield terms.negation(terms.conjunction([fires[t], closed]))
                if t in closers:
                    closed = terms.disjunction([closed, fires[t]])


def _may_fire(terms: Terms, net: Net, t: int, before: Valuation[Term], _: Valuation[Term]) -> Term:
    return firable(terms, net, t, before) if net.transitions[t].openable else terms.false


def _relation(
    net: Net,
    terms: Terms | None,
    chosen: Callable[[Terms, tuple[Term, ...], tuple[Term, ...]], Term],
    allowed: Callable[[Terms, Net, int, Valuation[Term], Valuation[Term]], Term] = enabled,
) -> Relation:
    """Some allowed transitions fire, `chosen(terms, allowed, fires)` holds, and Eq. (3)-(4) give what follows."""
    terms = terms or Terms()
    before = tuple(terms.variable(place.name) for place in net.places)
    after = tuple(terms.variable(f"{place.name}'") for place in net.places)
    signals = tuple(terms.variable(signal.name) for signal in net.signals)
    fires = tuple(terms.variable(f"fires({transition.name})") for transition in net.transitions)
    is_enabled = tuple(
        allowed(terms, net, t, before.__getitem__, signals.__getitem__) for t in range(len(net.transitions))
    )
    frame = [
        terms.equal(after[p], next_token(terms, net, p, before.__getitem__, fires.__getitem__))
        for p in range(len(net.places))
    ]
    term = terms.conjunction(
        [
            *(terms.implies(f, e) for f, e in zip(fires, is_enabled, strict=True)),
            terms.disjunction(fires),
            chosen(terms, is_enabled, fires),
            *frame,
        ]
    )
    return Relation(net, terms, before, after, signals, fires, term)
