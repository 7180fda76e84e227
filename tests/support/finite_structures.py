"""Formulas of the parametric proof evaluated over finite things, and actions played on them.

A structure says of which tuples each relation holds. A formula is evaluated as a join: variables get their values from
the tuples of relations that must hold, and only what is left over runs over all things of its sort.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from firable.decompose.protocol.parametric.logic import (
    And,
    Application,
    Atom,
    Formula,
    Iff,
    Implies,
    Named,
    Not,
    Or,
    Quantified,
    Same,
    Term,
    Variable,
)
from firable.decompose.protocol.parametric.script import Action

Thing = str | int
Values = dict[Variable, Thing]
Tuples = frozenset[tuple[Thing, ...]]


@dataclass(frozen=True)
class Structure:
    """Things by sort, functions and relations by name; `relations` has every relation that is asked of."""

    things: Mapping[str, tuple[Thing, ...]]
    functions: Mapping[str, Mapping[Thing, Thing]]
    relations: Mapping[str, Tuples]

    def holds(self, formula: Formula, values: Values) -> bool:
        """Whether a formula holds of these values of its free variables."""
        match formula:
            case Atom(relation, terms):
                return tuple(self.value(term, values) for term in terms) in self.relations[relation.name]
            case Named(definition, terms):
                arguments = [self.value(term, values) for term in terms]
                return self.holds(definition.body, dict(zip(definition.parameters, arguments, strict=True)))
            case Same(left, right):
                return self.value(left, values) == self.value(right, values)
            case Not(part):
                return not self.holds(part, values)
            case And(parts):
                return all(self.holds(part, values) for part in parts)
            case Or(parts):
                return any(self.holds(part, values) for part in parts)
            case Implies(left, right):
                return not self.holds(left, values) or self.holds(right, values)
            case Iff(left, right):
                return self.holds(left, values) == self.holds(right, values)
            case Quantified("exists", variables, body):
                return next(self.solutions(body, variables, values), None) is not None
            case Quantified("forall", variables, body):
                return next(self.solutions(Not(body), variables, values), None) is None
        raise AssertionError(formula)

    def value(self, term: Term, values: Values) -> Thing:
        """What a term stands for."""
        if isinstance(term, Application):
            return self.functions[term.function.name][values[term.argument]]
        return values[term]

    def solutions(self, formula: Formula, unknown: tuple[Variable, ...], values: Values) -> Iterator[Values]:
        """Values of the unknown variables that make a formula hold, beside the values that are given."""
        known = {variable: value for variable, value in values.items() if variable not in unknown}
        yield from self._join(_conjuncts(formula), unknown, known)

    def tuples(self, formula: Formula, formals: tuple[Variable, ...], values: Values) -> Tuples:
        """All values of the formals that make a formula hold."""
        if isinstance(formula, Or):
            return frozenset[tuple[Thing, ...]]().union(*(self.tuples(part, formals, values) for part in formula.parts))
        return frozenset(tuple(found[v] for v in formals) for found in self.solutions(formula, formals, values))

    def after(self, action: Action, values: Values) -> Structure:
        """The structure after an action, whatever it demands."""
        changed = {up.relation.name: self.tuples(up.formula, up.formals, values) for up in action.updates}
        return replace(self, relations={**self.relations, **changed})

    def may(self, action: Action, values: Values) -> list[str]:
        """The words of the demands that do not hold."""
        return [demand.words for demand in action.demands if not self.holds(demand.formula, values)]

    def _join(self, conjuncts: list[Formula], unknown: tuple[Variable, ...], values: Values) -> Iterator[Values]:
        if not unknown:
            if all(self.holds(part, values) for part in conjuncts):
                yield values
            return
        for i, part in enumerate(conjuncts):
            if isinstance(part, Atom) and any(term in unknown for term in part.terms):
                rest = conjuncts[:i] + conjuncts[i + 1 :]
                for found in self.relations[part.relation.name]:
                    bound = self._bind(part.terms, found, values)
                    if bound is not None:
                        yield from self._join(rest, tuple(v for v in unknown if v not in bound), bound)
                return
            if isinstance(part, Same):
                for one, other in ((part.left, part.right), (part.right, part.left)):
                    if one in unknown and _variable(other) not in unknown:
                        assert isinstance(one, Variable)
                        bound = {**values, one: self.value(other, values)}
                        rest = conjuncts[:i] + conjuncts[i + 1 :]
                        yield from self._join(rest, tuple(v for v in unknown if v != one), bound)
                        return
        first, *others = unknown
        for thing in self.things[first.sort.name]:
            yield from self._join(conjuncts, tuple(others), {**values, first: thing})

    def _bind(self, terms: tuple[Term, ...], found: tuple[Thing, ...], values: Values) -> Values | None:
        bound = dict(values)
        for term, thing in zip(terms, found, strict=True):
            if isinstance(term, Variable) and term not in bound:
                bound[term] = thing
            elif _variable(term) in bound:
                if self.value(term, bound) != thing:
                    return None
            else:
                assert isinstance(term, Application)
                raise AssertionError("a function of an unknown in a relation: write it as an equality")
        return bound


def _variable(term: Term) -> Variable:
    return term.argument if isinstance(term, Application) else term


def _conjuncts(formula: Formula) -> list[Formula]:
    """Formulas that hold together iff this one does, with negations brought inwards as far as they show relations."""
    match formula:
        case And(parts):
            return [inner for part in parts for inner in _conjuncts(part)]
        case Not(Not(part)):
            return _conjuncts(part)
        case Not(Implies(left, right)):
            return [*_conjuncts(left), *_conjuncts(Not(right))]
        case Not(Or(parts)):
            return [inner for part in parts for inner in _conjuncts(Not(part))]
    return [formula]
