"""The firing rule: Eq. (1)-(4) of the paper, with the corrections of SEMANTICS, over any Boolean algebra.

This is the reference. The player, the analyses' columns, the SMT encodings and the obligations of the decomposition
are evaluations of these functions; the Rust engine and the executor's token player are fast copies, tested against
them.

Places and signals are read through functions from an index to a value of the algebra, so that a caller decides what
a marking is: a bit mask, a row of columns, a list of solver variables.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from typing import TypeVar

from firable.nets.net import Net
from firable.semantics.algebra import BooleanAlgebra

B = TypeVar("B")
Valuation = Callable[[int], B]
"""A value for each index: of a place (does it hold a token), a signal (is it 1), a transition (does it fire)."""


def firable(algebra: BooleanAlgebra[B], net: Net, t: int, holds: Valuation[B]) -> B:
    """Eq. (1): every input and permissive gate place of `t` holds, no output and inhibitive gate place does.

    >>> from firable.nets.net import Net, Place, Transition
    >>> from firable.semantics.algebra import BOOL
    >>> net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
    >>> firable(BOOL, net, 0, lambda place: net.places[place].marked)
    True
    """
    return algebra.conjunction([gates_and_inputs(algebra, net, t, holds), outputs_empty(algebra, net, t, holds)])


def gates_and_inputs(algebra: BooleanAlgebra[B], net: Net, t: int, holds: Valuation[B]) -> B:
    """The part of Eq. (1) that the ordinary net with read and inhibitor arcs has: all but the output places."""
    # `map`, and no generator, here and below: all that is played in Python comes by here for each transition.
    transition, index = net.transitions[t], net.place_index.__getitem__
    return algebra.conjunction(
        chain(
            map(holds, map(index, transition.inputs)),
            map(holds, map(index, transition.permissive)),
            map(algebra.negation, map(holds, map(index, transition.inhibitive))),
        )
    )


def outputs_empty(algebra: BooleanAlgebra[B], net: Net, t: int, holds: Valuation[B]) -> B:
    """The part of Eq. (1) that the contact rule adds: no output place of `t` holds a token."""
    index = net.place_index.__getitem__
    return algebra.conjunction(map(algebra.negation, map(holds, map(index, net.transitions[t].outputs))))


def in_contact(algebra: BooleanAlgebra[B], net: Net, t: int, holds: Valuation[B]) -> B:
    """Contact: inputs and internal gates of `t` are satisfied, and an output place outside I(t) is full."""
    transition = net.transitions[t]
    outside = [place for place in transition.outputs if place not in transition.inputs]
    full = algebra.disjunction(holds(net.place_index[place]) for place in outside)
    return algebra.conjunction([gates_and_inputs(algebra, net, t, holds), full])


def external_gates(algebra: BooleanAlgebra[B], net: Net, t: int, signals: Valuation[B]) -> B:
    """Eq. (2): every literal of X(t) is true under the present valuation of the signals."""
    literals = []
    for gate in net.transitions[t].external:
        value = signals(net.signal_index[gate.signal])
        literals.append(value if gate.wanted else algebra.negation(value))
    return algebra.conjunction(literals)


def enabled(algebra: BooleanAlgebra[B], net: Net, t: int, holds: Valuation[B], signals: Valuation[B]) -> B:
    """Enabled = firable (Eq. 1) and external gate condition (Eq. 2)."""
    return algebra.conjunction([firable(algebra, net, t, holds), external_gates(algebra, net, t, signals)])


def next_token(algebra: BooleanAlgebra[B], net: Net, p: int, holds: Valuation[B], fires: Valuation[B]) -> B:
    """Eq. (3)-(4) as corrected: p' = (p and no consumer of p fires) or some producer of p fires.

    `fires` must be the arbitrated firing: at most one consumer and one producer of `p`.
    """
    taken = algebra.disjunction(map(fires, net.consumers[p]))
    put = algebra.disjunction(map(fires, net.producers[p]))
    return algebra.disjunction([algebra.conjunction([holds(p), algebra.negation(taken)]), put])
