"""Why the obligations can be decided: no thing of a sort ever asks for another of its own sort.

Bring the formulas into prenex form and put functions for what exists. A function then takes arguments of the sorts on
which its value depends. If the sorts can be ordered so that every function goes strictly downwards, only finitely many
terms can be built from the constants; so the formulas have a model iff their instances by these terms have one, which
is a question of propositional logic. A solver that instantiates long enough answers every such file, with `unsat`
or with a finite model. (Abadi, Rabinovich, Sagiv, "Decidable fragments of many-sorted logic", J. Symb. Comp. 45, 2010;
without functions this is the class of Bernays, Schönfinkel and Ramsey.)

A variable that exists depends on those in whose reach it stands and that occur in its formula; this is what
`dependencies` collects, through definitions, negations and equivalences. Rejected: trusting that a solver which came to
an end on these very files will do so on the next version of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter

from firable.decompose.protocol.parametric.logic import (
    And,
    Application,
    Formula,
    Iff,
    Implies,
    Named,
    Not,
    Or,
    Quantified,
    Sort,
    Variable,
    free_variables,
    subformulas,
    terms_of,
    variable_of,
)

Edge = tuple[Sort, Sort]


def dependencies(formulas: Iterable[Formula]) -> frozenset[Edge]:
    """The pairs of sorts (of an argument, of the value) of all functions that stand in formulas or stand for them.

    A formula that stands there many times, as those that all obligations begin with, is looked at once.
    """
    found: set[Edge] = set()
    for formula in {id(formula): formula for formula in formulas}.values():
        found.update(_choices(formula, {}, holds=True))
        for part in subformulas(formula):
            for term in terms_of(part):
                if isinstance(term, Application):
                    found.add((term.function.argument, term.sort))
    return frozenset(found)


def order(edges: Iterable[Edge]) -> tuple[Sort, ...] | None:
    """The sorts in an order in which every function goes from left to right; None where there is none.

    >>> Place, Round = Sort("Place"), Sort("Round")
    >>> [sort.name for sort in order([(Place, Round)])]
    ['Place', 'Round']
    >>> order([(Place, Round), (Round, Place)]) is order([(Place, Place)]) is None
    True
    """
    sorter: TopologicalSorter[Sort] = TopologicalSorter()
    for argument, value in sorted(edges, key=lambda edge: (edge[0].name, edge[1].name)):
        sorter.add(value, argument)
    try:
        return tuple(sorter.static_order())
    except CycleError:
        return None


Reach = Mapping[Variable, frozenset[Sort]]
"""For each variable, the sorts of the universal ones on which its value may depend; a constant has none."""


def _choices(formula: Formula, reach: Reach, *, holds: bool) -> Iterator[Edge]:
    """The functions for what exists in a formula that is asserted to hold, or not to."""
    match formula:
        case Not(part):
            yield from _choices(part, reach, holds=not holds)
        case And(parts) | Or(parts):
            for part in parts:
                yield from _choices(part, reach, holds=holds)
        case Implies(left, right):
            yield from _choices(left, reach, holds=not holds)
            yield from _choices(right, reach, holds=holds)
        case Iff(left, right):
            for part in (left, right):
                yield from _choices(part, reach, holds=True)
                yield from _choices(part, reach, holds=False)
        case Named(definition, terms):
            values = [reach.get(variable_of(term), frozenset()) for term in terms]
            yield from _choices(definition.body, dict(zip(definition.parameters, values, strict=True)), holds=holds)
        case Quantified(quantifier, variables, body):
            if (quantifier == "forall") == holds:
                inner = {variable: frozenset({variable.sort}) for variable in variables}
            else:
                depends = frozenset[Sort]().union(*(reach.get(v, frozenset()) for v in free_variables(formula)))
                yield from ((sort, variable.sort) for sort in depends for variable in variables)
                inner = dict.fromkeys(variables, depends)
            yield from _choices(body, {**reach, **inner}, holds=holds)
