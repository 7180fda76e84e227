"""First-order formulas over several sorts, as little of them as a protocol needs, and their SMT-LIB 2 text.

A protocol for any number of places, transitions, controllers and rounds is stated over sorts without a size. A
formula is built by calling relations on variables and joining what comes out with `&`, `|`, `~`, `implies`:

>>> Place, Round = Sort("Place"), Sort("Round")
>>> p, r = Variable("p", Place), Variable("r", Round)
>>> marked, asked = Relation("marked", (Place,)), Relation("asked", (Round,))
>>> print(text_of(forall(p, r)((asked(r) & ~marked(p)).implies(asked(r) | marked(p)))))
(forall ((p Place) (r Round)) (=> (and (asked r) (not (marked p))) (or (asked r) (marked p))))

A relation that steps change has one symbol for each *version* of it, as in static single assignment: what a step leaves
alone keeps its symbol, and what it changes is a new one, defined by the old. So there are no frame conditions, and a
solver never reasons about what did not change. A `Definition` is a name for a formula; it is written once for each
version of the relations in it.

The text is the obligation: z3 is given the file and not another translation of the formula, so what is decided is
what another solver reads. Rejected: z3's own terms and its printer, for the reasons that `analysis.induction.smt`
gives; and that module's terms, which have no quantifiers, for the finite obligations of a net need none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

_WIDTH_MAX = 110


@dataclass(frozen=True, slots=True)
class Sort:
    """A kind of thing, of which there are any number, but at least one."""

    name: str


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of a sort; where nothing quantifies it, a constant."""

    name: str
    sort: Sort


@dataclass(frozen=True, slots=True)
class Function:
    """A function from one sort into another."""

    name: str
    argument: Sort
    sort: Sort

    def __call__(self, term: Variable) -> Application:
        """Its value at a variable."""
        assert term.sort == self.argument, f"{self.name} of a {term.sort.name}"
        return Application(self, term)


@dataclass(frozen=True, slots=True)
class Application:
    """The value of a function."""

    function: Function
    argument: Variable

    @property
    def sort(self) -> Sort:
        """The sort of the value."""
        return self.function.sort


Term = Variable | Application


class Formula:
    """A formula; its kinds are below."""

    __slots__ = ()

    def __and__(self, other: Formula) -> Formula:
        return And((*_parts(self, And), *_parts(other, And)))

    def __or__(self, other: Formula) -> Formula:
        return Or((*_parts(self, Or), *_parts(other, Or)))

    def __invert__(self) -> Formula:
        return Not(self)

    def implies(self, other: Formula) -> Formula:
        """That the other holds where this one does."""
        return Implies(self, other)

    def iff(self, other: Formula) -> Formula:
        """That both hold or none."""
        return Iff(self, other)


def _parts(formula: Formula, kind: type[And] | type[Or]) -> tuple[Formula, ...]:
    return formula.parts if isinstance(formula, kind) else (formula,)


@dataclass(frozen=True)
class Relation:
    """A relation between things of these sorts; `moves` where steps change it."""

    name: str
    sorts: tuple[Sort, ...]
    moves: bool = False

    def __call__(self, *terms: Term) -> Formula:
        """That it holds of these."""
        assert tuple(term.sort for term in terms) == self.sorts, f"{self.name} of other sorts"
        return Atom(self, terms)


@dataclass(frozen=True)
class Definition:
    """A name for a formula with free variables, the parameters."""

    name: str
    parameters: tuple[Variable, ...]
    body: Formula

    def __hash__(self) -> int:
        return hash(self.name)  # the body is large, and is hashed wherever a script speaks of it

    def __call__(self, *terms: Term) -> Formula:
        """What it says of these."""
        assert [term.sort for term in terms] == [v.sort for v in self.parameters], f"{self.name} of other sorts"
        return Named(self, terms)

    @cached_property
    def moving(self) -> tuple[Relation, ...]:
        """The relations in it that steps change."""
        found = {part.relation: None for part in subformulas(self.body) if isinstance(part, Atom)}
        return tuple(relation for relation in found if relation.moves)


@dataclass(frozen=True, slots=True)
class Atom(Formula):
    """A relation holds between these."""

    relation: Relation
    terms: tuple[Term, ...]


@dataclass(frozen=True, slots=True)
class Named(Formula):
    """What a definition says of these."""

    definition: Definition
    terms: tuple[Term, ...]


@dataclass(frozen=True, slots=True)
class Same(Formula):
    """Both are one thing."""

    left: Term
    right: Term


@dataclass(frozen=True, slots=True)
class Not(Formula):
    """It does not hold."""

    part: Formula


@dataclass(frozen=True, slots=True)
class And(Formula):
    """All parts hold; of none, truth."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Or(Formula):
    """Some part holds; of none, falsehood."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Implies(Formula):
    """The right holds where the left does."""

    left: Formula
    right: Formula


@dataclass(frozen=True, slots=True)
class Iff(Formula):
    """Both hold or none."""

    left: Formula
    right: Formula


@dataclass(frozen=True, slots=True)
class Quantified(Formula):
    """For all (`forall`) or for some (`exists`) values of the variables the body holds."""

    quantifier: str
    variables: tuple[Variable, ...]
    body: Formula


def same(left: Term, right: Term) -> Formula:
    """Both are one thing."""
    assert left.sort == right.sort, "things of different sorts are never one"
    return Same(left, right)


def forall(*variables: Variable) -> Callable[[Formula], Formula]:
    """For all values of the variables: to be called on what then holds."""
    return lambda body: Quantified("forall", variables, body) if variables else body


def exists(*variables: Variable) -> Callable[[Formula], Formula]:
    """For some values of the variables."""
    return lambda body: Quantified("exists", variables, body) if variables else body


def both(formulas: Iterator[Formula] | list[Formula] | tuple[Formula, ...]) -> Formula:
    """All of these."""
    return And(tuple(part for formula in formulas for part in _parts(formula, And)))


def any_of(formulas: Iterator[Formula] | list[Formula] | tuple[Formula, ...]) -> Formula:
    """Some of these."""
    return Or(tuple(part for formula in formulas for part in _parts(formula, Or)))


def children(formula: Formula) -> tuple[Formula, ...]:
    """The formulas it is joined of, with the body of what it names."""
    match formula:
        case Not(part):
            return (part,)
        case And(parts) | Or(parts):
            return parts
        case Implies(left, right) | Iff(left, right):
            return left, right
        case Quantified(_, _, body):
            return (body,)
        case Named(definition, _):
            return (definition.body,)
    return ()


def subformulas(formula: Formula) -> Iterator[Formula]:
    """Itself and all within it, and within the definitions that it uses."""
    yield formula
    for child in children(formula):
        yield from subformulas(child)


def terms_of(formula: Formula) -> tuple[Term, ...]:
    """The terms that stand in it at once."""
    match formula:
        case Atom(_, terms) | Named(_, terms):
            return terms
        case Same(left, right):
            return left, right
    return ()


def variable_of(term: Term) -> Variable:
    """The variable that the term is, or whose function it is."""
    return term.argument if isinstance(term, Application) else term


def free_variables(formula: Formula) -> tuple[Variable, ...]:
    """The variables that nothing quantifies, in the order in which they first stand."""
    found = list(map(variable_of, terms_of(formula)))
    bound = formula.variables if isinstance(formula, Quantified) else ()
    if not isinstance(formula, Named):  # the variables of its body are parameters
        found += [variable for child in children(formula) for variable in free_variables(child)]
    return tuple(dict.fromkeys(variable for variable in found if variable not in bound))


def closed(formula: Formula) -> Formula:
    """The formula for all values of its free variables."""
    return forall(*free_variables(formula))(formula)


def earlier(formula: Formula) -> Formula:
    """The formula of the moment before the first step, wherever it stands."""
    match formula:
        case Atom(relation, terms):
            return Atom(replace(relation, moves=False), terms)
        case Named(definition, terms):
            return Named(replace(definition, body=earlier(definition.body)), terms)
        case Not(part):
            return Not(earlier(part))
        case And(parts):
            return And(tuple(map(earlier, parts)))
        case Or(parts):
            return Or(tuple(map(earlier, parts)))
        case Implies(left, right):
            return Implies(earlier(left), earlier(right))
        case Iff(left, right):
            return Iff(earlier(left), earlier(right))
        case Quantified(quantifier, variables, body):
            return Quantified(quantifier, variables, earlier(body))
    return formula


# --------------------------------------------------------------------------------------------------------------------
# SMT-LIB 2

Names = Mapping[Variable, str]
"""How constants are written, where not by the names of their variables."""

Spelling = Callable[[Relation | Definition], str]
"""The symbol of a relation, in its version, or of a definition."""


def text_of(formula: Formula, names: Names | None = None, spelling: Spelling = lambda item: item.name) -> str:
    """The formula as SMT-LIB 2 writes it, on as many lines as it needs."""
    constants = names or {}

    def term(of: Term, bound: frozenset[Variable]) -> str:
        if isinstance(of, Application):
            return f"({of.function.name} {term(of.argument, bound)})"
        return of.name if of in bound else constants.get(of, of.name)

    def applied(head: str, terms: tuple[Term, ...], bound: frozenset[Variable]) -> str:
        return f"({head} {' '.join(term(of, bound) for of in terms)})" if terms else head

    def spelled(part: Formula, bound: frozenset[Variable]) -> str:
        match part:
            case Atom(relation, terms):
                return applied(spelling(relation), terms, bound)
            case Named(definition, terms):
                return applied(spelling(definition), terms, bound)
            case Same(left, right):
                return applied("=", (left, right), bound)
            case Not(inner):
                return _joined("not", [spelled(inner, bound)])
            case And(parts) | Or(parts):
                head, empty = ("and", "true") if isinstance(part, And) else ("or", "false")
                texts = [spelled(inner, bound) for inner in parts]
                return _joined(head, texts) if len(texts) > 1 else (texts or [empty])[0]
            case Implies(left, right):
                return _joined("=>", [spelled(left, bound), spelled(right, bound)])
            case Iff(left, right):
                return _joined("=", [spelled(left, bound), spelled(right, bound)])
            case Quantified(quantifier, variables, body):
                typed = " ".join(f"({variable.name} {variable.sort.name})" for variable in variables)
                return _joined(f"{quantifier} ({typed})", [spelled(body, bound | set(variables))])
        raise AssertionError(part)

    return spelled(formula, frozenset())


def _joined(head: str, texts: list[str]) -> str:
    line = f"({head} {' '.join(texts)})"
    if len(line) <= _WIDTH_MAX and "\n" not in line:
        return line
    return f"({head}\n" + "\n".join("  " + text.replace("\n", "\n  ") for text in texts) + ")"
