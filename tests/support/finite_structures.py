"""Formulas of the parametric proof evaluated over finite things, and actions played on them.

A structure says of which tuples each relation holds. A formula is evaluated as a join: variables get their values from
the tuples of relations that must hold, and only what is left over runs over all things of its sort. In which order
depends on the formula alone, so each is made an expression of Python once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

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
    free_variables,
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
        return bool(self._evaluated(formula, None, values))

    def tuples(self, formula: Formula, formals: tuple[Variable, ...], values: Values) -> Tuples:
        """All values of the formals that make a formula hold."""
        found: Tuples = self._evaluated(formula, formals, values)
        return found

    def _evaluated(self, formula: Formula, formals: tuple[Variable, ...] | None, values: Values) -> Any:
        if (known := _COMPILED.get((id(formula), formals))) is None:
            known = _COMPILED[id(formula), formals] = _Compiled.of(formula, formals)
        arguments = [values[variable] for variable in known.variables]
        return known.evaluate(self.things, self.functions, self.relations, *arguments)

    def after(self, action: Action, values: Values) -> Structure:
        """The structure after an action, whatever it demands."""
        changed = {up.relation.name: self.tuples(up.formula, up.formals, values) for up in action.updates}
        return replace(self, relations={**self.relations, **changed})

    def may(self, action: Action, values: Values) -> list[str]:
        """The words of the demands that do not hold."""
        return [demand.words for demand in action.demands if not self.holds(demand.formula, values)]


@dataclass(frozen=True, slots=True)
class _Compiled:
    """A formula as a function of what is in a structure, and of the values of its free variables."""

    formula: Formula
    variables: tuple[Variable, ...]
    evaluate: Callable[..., Any]

    @classmethod
    def of(cls, formula: Formula, formals: tuple[Variable, ...] | None) -> _Compiled:
        """Whether it holds, or which tuples of formals make it hold."""
        given = tuple(v for v in free_variables(formula) if v not in (formals or ()))
        names = {variable: _fresh() for variable in given}
        text = _test(formula, names) if formals is None else _set_of(formula, formals, names)
        parameters = ", ".join(("things", "functions", "relations", *names.values()))
        return cls(formula, given, eval(f"lambda {parameters}: {text}"))


_COMPILED: dict[tuple[int, tuple[Variable, ...] | None], _Compiled] = {}
"""By the identity of the formula, which lives as long as this does: to hash a large one takes long."""
_NUMBERS = count()


def _fresh() -> str:
    return f"v{next(_NUMBERS)}"


def _test(formula: Formula, names: Mapping[Variable, str]) -> str:
    """That a formula holds, as Python, of variables with these names."""
    match formula:
        case Atom(relation, terms):
            return f"({_listed(_value(term, names) for term in terms)}) in relations[{relation.name!r}]"
        case Named(definition, terms):
            return _test(
                definition.body, {v: _value(t, names) for v, t in zip(definition.parameters, terms, strict=True)}
            )
        case Same(left, right):
            return f"{_value(left, names)} == {_value(right, names)}"
        case Not(part):
            return f"not ({_test(part, names)})"
        case And(parts):
            return " and ".join(f"({_test(part, names)})" for part in parts) or "True"
        case Or(parts):
            return " or ".join(f"({_test(part, names)})" for part in parts) or "False"
        case Implies(left, right):
            return f"not ({_test(left, names)}) or ({_test(right, names)})"
        case Iff(left, right):
            return f"({_test(left, names)}) == ({_test(right, names)})"
        case Quantified("exists", variables, body):
            return f"any(True {_join(body, variables, names)[0]})"
        case Quantified("forall", variables, body):
            return f"not any(True {_join(Not(body), variables, names)[0]})"
    raise AssertionError(formula)


def _set_of(formula: Formula, formals: tuple[Variable, ...], names: Mapping[Variable, str]) -> str:
    if isinstance(formula, Or):
        return f"frozenset().union({_listed(_set_of(part, formals, names) for part in formula.parts)})"
    clauses, inner = _join(formula, formals, names)
    return f"frozenset(({_listed(inner[v] for v in formals)}) {clauses})"


def _join(
    formula: Formula, unknown: tuple[Variable, ...], outer: Mapping[Variable, str]
) -> tuple[str, Mapping[Variable, str]]:
    """The clauses of a comprehension that go through all values of the unknown variables, and the names of these."""
    names = {variable: name for variable, name in outer.items() if variable not in unknown}
    left, parts, clauses = list(unknown), _conjuncts(formula), ["for _ in (0,)"]
    while True:
        for part in [part for part in parts if not set(left) & {*free_variables(part)}]:
            parts.remove(part)
            clauses.append(f"if {_test(part, names)}")
        if not left:
            return " ".join(clauses), names
        clauses.append(_next(left, parts, names))
        left = [variable for variable in left if variable not in names]


def _next(left: list[Variable], parts: list[Formula], names: dict[Variable, str]) -> str:
    """The clause that goes through values of some variables that are left, and names them."""
    for part in parts:
        if isinstance(part, Atom) and any(term in left for term in part.terms):
            parts.remove(part)
            found, tests = [_fresh() for _ in part.terms], []
            for term, name in zip(part.terms, found, strict=True):
                if isinstance(term, Variable) and term not in names:
                    names[term] = name
                else:
                    assert _variable(term) in names, "a function of an unknown in a relation: write it as an equality"
                    tests.append(f" if {name} == {_value(term, names)}")
            return f"for ({_listed(found)}) in relations[{part.relation.name!r}]{''.join(tests)}"
        if isinstance(part, Same):
            for one, other in ((part.left, part.right), (part.right, part.left)):
                if isinstance(one, Variable) and one in left and _variable(other) in names:
                    parts.remove(part)
                    value, names[one] = _value(other, names), _fresh()
                    return f"for {names[one]} in ({value},)"
    names[left[0]] = _fresh()
    return f"for {names[left[0]]} in things[{left[0].sort.name!r}]"


def _value(term: Term, names: Mapping[Variable, str]) -> str:
    """What a term stands for, as Python."""
    if isinstance(term, Application):
        return f"functions[{term.function.name!r}][{names[term.argument]}]"
    return names[term]


def _listed(texts: Iterable[str]) -> str:
    return "".join(f"{text}, " for text in texts)


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
