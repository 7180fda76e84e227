"""One SMT-LIB 2 file: a theory, some steps of a protocol one after the other, and what is asserted of it.

Sorts, functions and relations are declared when they are first met; so a file holds what its obligation speaks of, and
no more. `Script.step` plays an action: it asserts what the action demands of the present moment, and defines the
relations that it changes anew; from then on formulas speak of the moment after it. The logic is UF: equality,
uninterpreted sorts, functions and relations, quantifiers, nothing else.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from firable.decompose.protocol.parametric.logic import (
    Application,
    Atom,
    Definition,
    Formula,
    Function,
    Named,
    Quantified,
    Relation,
    Sort,
    Term,
    Variable,
    children,
    free_variables,
    subformulas,
    terms_of,
    text_of,
)

LOGIC: Final = "(set-logic UF)"


@dataclass(frozen=True, slots=True)
class Update:
    """What a relation is after a step: it holds of `formals` iff `formula` held before it."""

    relation: Relation
    formals: tuple[Variable, ...]
    formula: Formula


@dataclass(frozen=True, slots=True)
class Demand:
    """A part of the guard of an action, with the words for it."""

    words: str
    formula: Formula


@dataclass(frozen=True, slots=True)
class Action:
    """One thing that may happen at one place, for any values of its parameters.

    All demands must hold; then the relations of `updates` change at once, and all others stay. `fires` says that the
    central net fires at this step. `words` tell a run, with the names of the parameters in braces.
    """

    name: str
    parameters: tuple[Variable, ...]
    demands: tuple[Demand, ...]
    updates: tuple[Update, ...]
    words: str
    fires: bool = False

    @property
    def guard(self) -> tuple[Formula, ...]:
        """The formulas of the demands."""
        return tuple(demand.formula for demand in self.demands)


class Script:
    """The lines of a file, as they are added."""

    def __init__(self) -> None:
        self.formulas: list[Formula] = []
        """Every formula that was asserted or defines a change, for `fragment`."""
        self._sorts: dict[Sort, None] = {}
        self._declared: dict[str, str] = {}
        self._body: list[str] = []
        self._versions: dict[Relation, int] = {}
        self._moments: dict[Definition, list[tuple[int, ...]]] = {}
        """For each definition, the versions of its relations of which it was spoken so far."""
        self._written: dict[str, str] = {}
        """The text of each definition, by its symbol: two of one name would be taken for one."""
        self._defined: dict[str, Definition] = {}
        """The definition itself, by its symbol: it is met very often, and spelled once."""
        self._shared = (0, 0)
        """How many declarations and lines of the body stand in what this one continues."""

    def continued(self) -> Script:
        """A copy, to go on with by itself."""
        copy = Script()
        copy.formulas = list(self.formulas)
        copy._sorts, copy._declared, copy._body = dict(self._sorts), dict(self._declared), list(self._body)
        copy._versions, copy._written = dict(self._versions), dict(self._written)
        copy._defined = dict(self._defined)
        copy._moments = {definition: list(versions) for definition, versions in self._moments.items()}
        copy._shared = len(self._declared), len(self._body)
        return copy

    def remark(self, words: str) -> None:
        """Add a comment."""
        self._body.append(f"; {words}")

    def speak_of(self, *items: Relation | Function | Definition) -> None:
        """Declare relations and functions and write definitions before anything is said with them."""
        for item in items:
            if isinstance(item, Relation):
                self._declare(item)
            elif isinstance(item, Function):
                self._declare_function(item)
            else:
                self._define_once(item)

    def add(self, formula: Formula, words: str, names: Mapping[Variable, str] | None = None) -> None:
        """Assert a formula of the present moment; what nothing quantifies in it is a constant."""
        self._define(formula)
        for variable in free_variables(formula):
            self._declare_constant((names or {}).get(variable, variable.name), variable.sort)
        self.formulas.append(formula)
        self.remark(words)
        self._body.append(f"(assert {text_of(formula, names, self._symbol)})")

    def observe(self, formula: Formula, name: str) -> None:
        """Give a formula of the present moment a name, by which a model says whether it holds."""
        self._define(formula)
        self._declared[name] = f"(declare-const {name} Bool)"
        self._body.append(f"(assert (= {name} {text_of(formula, None, self._symbol)}))")

    def step(self, action: Action, names: Mapping[Variable, str] | None = None) -> None:
        """Play an action: assert its demands, and go on to the moment after it."""
        for demand in action.demands:
            self.add(demand.formula, f"{action.name}: {demand.words}", names)
        self.change(action, names)

    def change(self, action: Action, names: Mapping[Variable, str] | None = None) -> None:
        """Go on to the moment after an action, whose demands are asserted elsewhere or to be shown."""
        texts = []
        constants = dict(names or {})
        for variable in action.parameters:
            self._declare_constant(constants.get(variable, variable.name), variable.sort)
        for update in action.updates:
            assert not any(isinstance(part, Quantified) for part in subformulas(update.formula)), "a change chooses"
            self.formulas.append(update.formula)
            self._define(update.formula)
            formals = {variable: variable.name for variable in update.formals}
            texts.append(text_of(update.formula, constants | formals, self._symbol))
        for update, text in zip(action.updates, texts, strict=True):
            self._declare_sorts(update.relation.sorts)
            version = self._versions[update.relation] = self._versions.get(update.relation, 0) + 1
            typed = " ".join(f"({v.name} {v.sort.name})" for v in update.formals)
            self.remark(f"{update.relation.name} after '{action.name}'")
            self._body.append(_defined(f"{update.relation.name}.{version}", typed, text))

    def lines(self) -> list[str]:
        """The whole theory: the logic, what is declared, and the body."""
        sorts = [f"(declare-sort {sort.name} 0)" for sort in self._sorts]
        return [LOGIC, *sorts, *self._declared.values(), *self._body]

    def text(self) -> str:
        """The whole theory as a file, which ends by asking whether all of it can be true."""
        return "\n".join([*self.lines(), "(check-sat)"]) + "\n"

    def more(self) -> list[str]:
        """The lines that were added to what this one continues; no sort is among them."""
        declared, body = self._shared
        return [*list(self._declared.values())[declared:], *self._body[body:]]

    def _symbol(self, item: Relation | Definition) -> str:
        if isinstance(item, Relation):
            version = self._versions.get(item, 0)
        else:
            moments = self._moments.setdefault(item, [(0,) * len(item.moving)])
            versions = tuple(self._versions.get(relation, 0) for relation in item.moving)
            if versions not in moments:
                moments.append(versions)
            version = moments.index(versions)
        return f"{item.name}.{version}" if version else item.name

    def _define(self, formula: Formula) -> None:
        """Declare and define, at the present moment, all that a formula speaks of and that is not yet there."""
        if isinstance(formula, Named):
            self._define_once(formula.definition)
        else:
            if isinstance(formula, Atom):
                self._declare(formula.relation)
            for child in children(formula):
                self._define(child)
        if isinstance(formula, Quantified):
            self._declare_sorts(variable.sort for variable in formula.variables)
        for term in terms_of(formula):
            self._declare_term(term)

    def _define_once(self, definition: Definition) -> None:
        symbol = self._symbol(definition)
        if self._defined.get(symbol) is definition:
            return
        self._defined[symbol] = definition
        self._define(definition.body)
        self._declare_sorts(v.sort for v in definition.parameters)
        typed = " ".join(f"({v.name} {v.sort.name})" for v in definition.parameters)
        text = _defined(symbol, typed, text_of(definition.body, None, self._symbol))
        assert self._written.get(symbol, text) == text, f"two definitions are named '{symbol}'"
        if symbol not in self._written:
            self._written[symbol] = text
            self._body.append(text)

    def _declare(self, relation: Relation) -> None:
        self._declare_sorts(relation.sorts)
        if relation.name not in self._declared and not self._versions.get(relation):
            of = " ".join(sort.name for sort in relation.sorts)
            self._declared[relation.name] = f"(declare-fun {relation.name} ({of}) Bool)"

    def _declare_term(self, term: Term) -> None:
        if isinstance(term, Application):
            self._declare_function(term.function)

    def _declare_function(self, function: Function) -> None:
        self._declare_sorts((function.argument, function.sort))
        text = f"(declare-fun {function.name} ({function.argument.name}) {function.sort.name})"
        self._declared.setdefault(function.name, text)

    def _declare_constant(self, name: str, sort: Sort) -> None:
        self._declare_sorts((sort,))
        self._declared.setdefault(name, f"(declare-const {name} {sort.name})")

    def _declare_sorts(self, sorts: Iterable[Sort]) -> None:
        self._sorts.update(dict.fromkeys(sorts))


def _defined(symbol: str, typed: str, text: str) -> str:
    return f"(define-fun {symbol} ({typed}) Bool\n  " + text.replace("\n", "\n  ") + ")"
