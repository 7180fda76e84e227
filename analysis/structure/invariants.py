"""P- and T-invariants: the solutions of y C = 0 and of C x = 0, all of them by a basis, and the semi-positive ones.

C is the incidence matrix: the entry of a place and a transition is 1 if the transition puts a token on the place, -1
if it takes one. Under a P-invariant y the weighted number of tokens is the same in every reachable marking, whatever
the gates and the contact rule do: they only forbid firings, and every firing changes the marking by its column of C. A
T-invariant x counts firings that, if they can be fired at all, bring the marking back. A self-loop cancels, and reads
are gates.

A basis always exists and is cheap (`firable.analysis.structure.linear`), but it has negative entries, which no engineer
reads as "these places share one token". So what is listed are the minimal semi-positive solutions, by the algorithm of
Farkas (`firable.analysis.structure.semiflows`), as far as a budget lets it. Their number can be exponential. Where it
ends early, the *units* that cover the places greedily (`firable.analysis.structure.cover`) are listed too: they are
minimal, and few of them often cover everything.

Every vector is multiplied out against C before it is handed out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.structure.cover import cover
from firable.analysis.structure.linear import Sparse, eliminate, solutions
from firable.analysis.structure.semiflows import minimal_semiflows
from firable.nets.net import Marking, Net

ROWS_MAX: Final = 5_000


@dataclass(frozen=True, slots=True)
class Invariant:
    """One solution without a common divisor: the names in its support, with their weights, in the order of the net."""

    weights: tuple[tuple[str, int], ...]

    @property
    def support(self) -> tuple[str, ...]:
        """The places (or transitions) with a weight that is not 0."""
        return tuple(name for name, _ in self.weights)

    def tokens(self, net: Net, marking: Marking) -> int:
        """The weighted number of tokens of a P-invariant, the same in every reachable marking."""
        return sum(weight for name, weight in self.weights if marking >> net.place_index[name] & 1)

    def __str__(self) -> str:
        first, *others = (_term(name, weight) for name, weight in self.weights)
        return first + "".join(f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in others)


def _term(name: str, weight: int) -> str:
    return {1: name, -1: f"-{name}"}.get(weight, f"{weight} {name}")


@dataclass(frozen=True, slots=True)
class Invariants:
    """The minimal semi-positive invariants of a net, and the dimension of the space of all rational ones.

    Where not `complete`, the bound on rows or the deadline was reached: all listed are minimal invariants, and there
    may be more. The dimension is None where the deadline came before it was computed.
    """

    minimal: tuple[Invariant, ...]
    dimension: int | None
    complete: bool

    def uncovered(self, names: Sequence[str]) -> tuple[str, ...]:
        """The names in no listed invariant; where not `complete` another one may still cover them."""
        covered = {name for invariant in self.minimal for name in invariant.support}
        return tuple(name for name in names if name not in covered)


def columns(net: Net) -> list[dict[int, int]]:
    """The incidence matrix C by its columns: for each transition what a firing adds to each place; a self-loop 0.

    >>> from firable.nets.net import Net, Place, Transition
    >>> columns(Net("n", (Place("p"), Place("q"), Place("r")), (Transition("t", ("p", "r"), ("q", "r")),)))
    [{0: -1, 1: 1}]
    """
    index, found = net.place_index, []
    for transition in net.transitions:
        inputs, outputs = set(transition.inputs), set(transition.outputs)
        column = {index[name]: -1 for name in transition.inputs if name not in outputs}
        column |= {index[name]: 1 for name in transition.outputs if name not in inputs}
        found.append(column)
    return found


def rows(net: Net) -> list[dict[int, int]]:
    """The incidence matrix C by its rows: for each place what each transition adds to it."""
    found: list[dict[int, int]] = [{} for _ in net.places]
    for t, column in enumerate(columns(net)):
        for p, change in column.items():
            found[p][t] = change
    return found


def p_invariants(net: Net, *, rows_max: int = ROWS_MAX, deadline: Deadline = NEVER) -> Invariants:
    """The minimal semi-positive P-invariants.

    >>> from firable.nets.catalogue import catalogue_net
    >>> found = p_invariants(catalogue_net("one_robot"))
    >>> len(found.minimal), found.dimension, found.complete
    (68, 14, True)
    """
    return _invariants(columns(net), [place.name for place in net.places], rows_max, deadline)


def t_invariants(net: Net, *, rows_max: int = ROWS_MAX, deadline: Deadline = NEVER) -> Invariants:
    """The minimal semi-positive T-invariants."""
    return _invariants(rows(net), [transition.name for transition in net.transitions], rows_max, deadline)


def p_basis(net: Net, *, deadline: Deadline = NEVER) -> tuple[Invariant, ...] | None:
    """A basis of all P-invariants, with integer weights of either sign; None where the deadline came first.

    >>> from firable.nets.catalogue import catalogue_net
    >>> len(p_basis(catalogue_net("one_robot")) or ())
    14
    """
    return _basis(columns(net), [place.name for place in net.places], deadline)


def t_basis(net: Net, *, deadline: Deadline = NEVER) -> tuple[Invariant, ...] | None:
    """A basis of all T-invariants, with integer weights of either sign; None where the deadline came first."""
    return _basis(rows(net), [transition.name for transition in net.transitions], deadline)


def _basis(equations: Sequence[Sparse], names: Sequence[str], deadline: Deadline) -> tuple[Invariant, ...] | None:
    eliminated = eliminate(equations, deadline=deadline)
    if eliminated is None:
        return None
    found = solutions(eliminated, range(len(names)), deadline=deadline)
    return None if found is None else tuple(_checked(found, equations, names))


def _invariants(equations: Sequence[Sparse], names: Sequence[str], rows_max: int, deadline: Deadline) -> Invariants:
    """The minimal y >= 0 that solve the equations, whose variables are the indexes of the names."""
    eliminated = eliminate(equations, deadline=deadline)
    listed = minimal_semiflows(equations, len(names), rows_max=rows_max, deadline=deadline)
    vectors = {tuple(sorted(vector.items())) for vector in listed.vectors}
    if not listed.complete:
        vectors |= {tuple((v, 1) for v in unit) for unit in cover(equations, len(names), deadline=deadline).units}
    ordered = sorted(vectors, key=lambda vector: [(v, -weight) for v, weight in vector])
    found = tuple(_checked(map(dict, ordered), equations, names))
    return Invariants(found, None if eliminated is None else len(names) - eliminated.rank, listed.complete)


def _checked(vectors: Iterable[Sparse], equations: Sequence[Sparse], names: Sequence[str]) -> Iterable[Invariant]:
    standing: list[list[tuple[int, int]]] = [[] for _ in names]
    for number, equation in enumerate(equations):
        for variable, coefficient in equation.items():
            standing[variable].append((number, coefficient))
    for vector in vectors:
        sums: dict[int, int] = {}
        for variable, weight in vector.items():
            for number, coefficient in standing[variable]:
                sums[number] = sums.get(number, 0) + weight * coefficient
        if any(sums.values()):
            raise AssertionError("a vector that is no invariant came out of the elimination")
        yield Invariant(tuple((names[v], vector[v]) for v in sorted(vector)))
