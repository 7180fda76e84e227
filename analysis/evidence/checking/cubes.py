"""A firing as literals: what Eq. (1) asks for, and what Eq. (3)-(4) change, by the one text of the rule.

`firable.semantics.firing` is evaluated in an algebra whose values are conjunctions of literals, so a check that reasons
about places one by one has no copy of the rule of its own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from firable.nets.net import Net
from firable.semantics.algebra import BOOL
from firable.semantics.firing import firable, next_token

Cube = dict[int, bool]
"""Literals by place; the conjunction of them."""


@dataclass(frozen=True, slots=True)
class _Cubes:
    """The algebra in which Eq. (1) is a conjunction of literals; None is false."""

    def conjunction(self, operands: Iterable[Cube | None], /) -> Cube | None:
        found: Cube = {}
        for operand in operands:
            if operand is None:
                return None
            for place, value in operand.items():
                if found.setdefault(place, value) is not value:
                    return None
        return found

    def disjunction(self, operands: Iterable[Cube | None], /) -> Cube | None:
        raise TypeError(f"Eq. (1) is a conjunction, and no disjunction of {len(list(operands))}")

    def negation(self, operand: Cube | None, /) -> Cube | None:
        if operand is None or len(operand) != 1:
            raise TypeError("only a literal is negated")
        return {place: not value for place, value in operand.items()}


def firable_cube(net: Net, t: int) -> Cube | None:
    """Eq. (1) of a transition; None where it contradicts itself."""
    return firable(_Cubes(), net, t, lambda place: {place: True})


def firings(net: Net) -> dict[int, tuple[Cube, frozenset[int]]]:
    """Of each transition that can fire at all, by index: the values that it needs, and the places that it flips.

    >>> from firable.nets.net import Place, Transition
    >>> looping = Transition("u", ("p",), ("p",))
    >>> firings(Net("n", (Place("p"), Place("q")), (Transition("t", ("p",), permissive=("q",)), looping)))
    {0: ({0: True, 1: True}, frozenset({0}))}
    """
    found = {}
    for t, transition in enumerate(net.transitions):
        cube = firable_cube(net, t)
        if cube is not None and transition.openable:
            after = {p: next_token(BOOL, net, p, cube.__getitem__, t.__eq__) for p in cube}
            found[t] = cube, frozenset(p for p, value in cube.items() if after[p] is not value)
    return found
