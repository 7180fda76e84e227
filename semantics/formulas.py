"""Evaluating state formulas over any Boolean algebra: one marking, or a column for every reachable one."""

from __future__ import annotations

from typing import TypeVar

from firable.nets.formula import And, Compare, Constant, Deadlock, Firable, Formula, Holds, Not, Or, Start
from firable.nets.net import Net
from firable.semantics.algebra import BooleanAlgebra
from firable.semantics.counting import compared
from firable.semantics.firing import Valuation, firable

B = TypeVar("B")


def evaluate(algebra: BooleanAlgebra[B], net: Net, formula: Formula, holds: Valuation[B]) -> B:
    """The value of the formula in the marking that `holds` reads.

    >>> from firable.nets.formula import parse_formula
    >>> from firable.nets.net import Net, Place
    >>> from firable.semantics.algebra import BOOL
    >>> net = Net("n", (Place("p", marked=True), Place("q")))
    >>> evaluate(BOOL, net, parse_formula("start and not q"), lambda place: net.places[place].marked)
    True
    """
    match formula:
        case Constant(value):
            return algebra.conjunction([]) if value else algebra.disjunction([])
        case Holds(place):
            return holds(net.place_index[place])
        case Firable(name):
            t = net.transition_index[name]
            return firable(algebra, net, t, holds) if net.transitions[t].openable else algebra.disjunction([])
        case Start():
            marked = [holds(i) for i, place in enumerate(net.places) if place.marked]
            empty = [algebra.negation(holds(i)) for i, place in enumerate(net.places) if not place.marked]
            return algebra.conjunction([*marked, *empty])
        case Deadlock():
            return algebra.conjunction(
                algebra.negation(firable(algebra, net, t, holds))
                for t, transition in enumerate(net.transitions)
                if transition.openable
            )
        case Compare():
            return compared(algebra, net, formula, holds)
        case Not(operand):
            return algebra.negation(evaluate(algebra, net, operand, holds))
        case And(operands):
            return algebra.conjunction(evaluate(algebra, net, operand, holds) for operand in operands)
        case Or(operands):
            return algebra.disjunction(evaluate(algebra, net, operand, holds) for operand in operands)
