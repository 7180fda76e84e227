"""Boolean terms, the algebra that builds them, SMT-LIB 2 text of them, and z3 to decide them.

The firing rule evaluated in `Terms` gives the terms of every encoding and obligation, so a proof is about the very
rule that is played. Terms are hash-consed: equal terms of one `Terms` are one object, so that a transition relation
is a graph of linear size and every walk over it is a loop with a memory; nothing here recurses, whatever the depth.

The text is written by an own strict writer, and not by z3: what z3 exports holds pseudo-Boolean atoms and one-argument
connectives that other solvers refuse, and its `let`s nest as deeply as the term. Here: `set-logic QF_UF` (without it
cvc5 takes a minute for a tenth of a second's work), constants by their own names in bars, connectives with two
arguments or more, and a `define-fun` for each shared subterm.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any, Final

import z3

from firable.nets.source import printable


class Operator(StrEnum):
    """The head of a term, as SMT-LIB writes it."""

    VARIABLE = "variable"
    TRUE = "true"
    FALSE = "false"
    NOT = "not"
    AND = "and"
    OR = "or"
    EQUAL = "="


@dataclass(frozen=True, slots=True, eq=False)
class Term:
    """A Boolean term; made by `Terms` only, so that within one of them equal terms are one object."""

    operator: Operator
    operands: tuple[Term, ...] = ()
    name: str = ""

    def __repr__(self) -> str:
        return smtlib_term(self)


@dataclass(frozen=True)
class Terms:
    """The Boolean algebra of terms.

    Constants, repeated operands and one-argument connectives are simplified away, no more: what compares two equal
    terms still shows both.

    >>> terms = Terms()
    >>> p, q = terms.variable("p"), terms.variable("q")
    >>> terms.conjunction([p, terms.negation(q)]) is terms.conjunction([p, terms.negation(q)])
    True
    >>> terms.disjunction([p, terms.conjunction([])])
    true
    """

    _known: dict[tuple[Any, ...], Term] = field(default_factory=dict, repr=False, compare=False)

    def _term(self, operator: Operator, operands: tuple[Term, ...] = (), name: str = "") -> Term:
        key = (operator, name, *map(id, operands))
        if (known := self._known.get(key)) is None:
            # The table keeps each term, so that no id is used again while it lives.
            known = self._known[key] = Term(operator, operands, name)
        return known

    @cached_property
    def true(self) -> Term:
        """The constant true."""
        return self._term(Operator.TRUE)

    @cached_property
    def false(self) -> Term:
        """The constant false."""
        return self._term(Operator.FALSE)

    def variable(self, name: str) -> Term:
        """The free Boolean constant of this name."""
        return self._term(Operator.VARIABLE, (), name)

    def conjunction(self, operands: Iterable[Term], /) -> Term:
        """The AND of the operands."""
        return self._connective(Operator.AND, operands, neutral=self.true, dominant=self.false)

    def disjunction(self, operands: Iterable[Term], /) -> Term:
        """The OR of the operands."""
        return self._connective(Operator.OR, operands, neutral=self.false, dominant=self.true)

    def _connective(self, operator: Operator, operands: Iterable[Term], *, neutral: Term, dominant: Term) -> Term:
        kept = tuple(term for term in dict.fromkeys(operands) if term is not neutral)
        if dominant in kept:
            return dominant
        if not kept:
            return neutral
        return kept[0] if len(kept) == 1 else self._term(operator, kept)

    def negation(self, operand: Term, /) -> Term:
        """The NOT of the operand."""
        match operand.operator:
            case Operator.TRUE:
                return self.false
            case Operator.FALSE:
                return self.true
            case Operator.NOT:
                return operand.operands[0]
        return self._term(Operator.NOT, (operand,))

    def equal(self, left: Term, right: Term) -> Term:
        """The two have the same value; never simplified."""
        return self._term(Operator.EQUAL, (left, right))

    def differ(self, left: Term, right: Term) -> Term:
        """The two have different values."""
        return self.negation(self.equal(left, right))

    def implies(self, premise: Term, conclusion: Term) -> Term:
        """The premise does not hold, or the conclusion does."""
        return self.disjunction([self.negation(premise), conclusion])

    def literal(self, name: str, value: bool) -> Term:
        """The variable of this name has this value."""
        variable = self.variable(name)
        return variable if value else self.negation(variable)

    def at_most_one(self, operands: Iterable[Term]) -> Term:
        """At most one operand holds: a balanced tree of linear size, without auxiliary variables."""
        return AtMostOne(self, operands).term


class AtMostOne:
    """That at most one of some operands holds, as a balanced tree, and what it becomes where a few of them change.

    What becomes of it shares all with the tree but the way from each changed operand to the top.

    >>> terms = Terms()
    >>> tree = AtMostOne(terms, map(terms.variable, "pq"))
    >>> tree.term, tree.where({0: terms.true}), tree.where({0: terms.false})
    ((not (and |p| |q|)), (not |q|), true)
    """

    def __init__(self, terms: Terms, operands: Iterable[Term]) -> None:
        self._terms = terms
        # For each subtree: some operand holds, at most one holds.
        self._layers = [[(term, terms.true) for term in operands]]
        while len(below := self._layers[-1]) > 1:
            self._layers.append([self._joined(below[i : i + 2]) for i in range(0, len(below), 2)])

    @property
    def term(self) -> Term:
        """That at most one of the operands holds."""
        return self.where({})

    def where(self, changed: Mapping[int, Term]) -> Term:
        """The same, with other operands in these positions."""
        new = {i: (term, self._terms.true) for i, term in changed.items()}
        for below in self._layers[:-1]:
            ways = ((i // 2, range(i - i % 2, min(i - i % 2 + 2, len(below)))) for i in new)
            new = {above: self._joined([new.get(i, below[i]) for i in pair]) for above, pair in ways}
        top = self._layers[-1]
        return new.get(0, top[0])[1] if top else self._terms.true

    def _joined(self, pair: Sequence[tuple[Term, Term]]) -> tuple[Term, Term]:
        if len(pair) == 1:
            return pair[0]
        (some, one), (other_some, other_one) = pair
        of = self._terms
        not_both = of.negation(of.conjunction([some, other_some]))
        return of.disjunction([some, other_some]), of.conjunction([one, other_one, not_both])


def subterms(roots: Iterable[Term]) -> Iterator[Term]:
    """Every subterm of the roots once, operands before what they are operands of."""
    done: set[Term] = set()
    for root in roots:
        todo = [(root, False)]
        while todo:
            term, expanded = todo.pop()
            if term in done:
                continue
            if expanded or not term.operands:
                done.add(term)
                yield term
            else:
                todo.append((term, True))
                todo.extend((operand, False) for operand in reversed(term.operands))


def variables(roots: Iterable[Term]) -> tuple[str, ...]:
    """The names of the variables, in the order in which they first stand."""
    return tuple(dict.fromkeys(term.name for term in subterms(roots) if term.operator is Operator.VARIABLE))


def value(term: Term, assignment: Mapping[str, bool]) -> bool:
    """The value of a term where each variable has the value assigned to it; `KeyError` where one has none."""
    return values_of(term, assignment)[term]


def values_of(term: Term, assignment: Mapping[str, bool]) -> dict[Term, bool]:
    """The value of a term and of each of its subterms."""
    values: dict[Term, bool] = {}
    for subterm in subterms([term]):
        operands = [values[operand] for operand in subterm.operands]
        match subterm.operator:
            case Operator.VARIABLE:
                values[subterm] = bool(assignment[subterm.name])
            case Operator.NOT:
                values[subterm] = not operands[0]
            case Operator.AND | Operator.TRUE:
                values[subterm] = all(operands)
            case Operator.OR | Operator.FALSE:
                values[subterm] = any(operands)
            case Operator.EQUAL:
                values[subterm] = operands[0] == operands[1]
    return values


# --------------------------------------------------------------------------------------------------------------------
# SMT-LIB 2

_INLINE_DEPTH_MAX: Final = 24  # a deeper subterm is cut out by a definition: parsers of other solvers may recurse
_LINE_MAX: Final = 110
_NOT_QUOTED: Final = re.compile(r"[^ -~]|[|\\%]|\A\.|\A(?=(?:true|false|not|and|or|xor|distinct|ite|as|_|=)\Z).")
"""What may not stand between bars, `%`, which marks it, and how no symbol may begin that somebody declares."""


def symbol(name: str) -> str:
    """A name as a quoted symbol.

    >>> symbol("robot.free"), symbol("a|b"), symbol("é"), symbol("50%"), symbol(chr(92)), symbol(".p"), symbol("true")
    ('|robot.free|', '|a%7c.b|', '|%e9.|', '|50%25.|', '|%5c.|', '|%2e.p|', '|%74.rue|')
    """
    return f"|{in_ascii(name)}|"


def in_ascii(name: str) -> str:
    """A name with what may not stand between bars as `%`, its number in hexadecimal digits, and a point."""
    # `%` is written so itself, and the point says where the number ends: no two names become one symbol.
    return _NOT_QUOTED.sub(lambda found: f"%{ord(found[0]):x}.", name)


def smtlib_term(term: Term) -> str:
    """One term, written out in full: for messages and small terms."""
    texts: dict[Term, str] = {}
    for subterm in subterms([term]):
        texts[subterm] = _spelled(subterm, texts)
    return texts[term]


def _spelled(term: Term, texts: Mapping[Term, str]) -> str:
    if term.operator is Operator.VARIABLE:
        return symbol(term.name)
    if not term.operands:
        return term.operator.value
    parts = [texts[operand] for operand in term.operands]
    line = f"({term.operator.value} {' '.join(parts)})"
    if len(line) <= _LINE_MAX and "\n" not in line:
        return line
    return f"({term.operator.value}\n" + "\n".join("  " + part.replace("\n", "\n  ") for part in parts) + ")"


def smtlib(assertions: Sequence[Term], comments: Iterable[str] = ()) -> str:
    """A whole SMT-LIB 2 file that asserts the terms and asks whether all of them can be true.

    The comments stand at the head, one to a line.

    >>> terms = Terms()
    >>> print(smtlib([terms.literal("p", False)], ["nothing holds"]), end="")
    ; nothing holds
    (set-logic QF_UF)
    (declare-const |p| Bool)
    (assert (not |p|))
    (check-sat)
    """
    lines = [f"; {printable(comment)}".rstrip() for comment in comments]
    return "\n".join([*lines, "(set-logic QF_UF)", *smtlib_lines(assertions), "(check-sat)"]) + "\n"


def smtlib_lines(assertions: Sequence[Term]) -> list[str]:
    """The declarations, definitions and assertions that state the terms: what stands between a logic and a check."""
    names = variables(assertions)
    prefix = "shared"
    while any(name.startswith(prefix) for name in names):
        prefix += "_"
    uses = Counter(operand for term in subterms(assertions) for operand in term.operands)
    lines = [f"(declare-const {symbol(name)} Bool)" for name in names]
    texts: dict[Term, str] = {}
    depths: dict[Term, int] = {}
    definitions = 0
    for term in subterms(assertions):
        texts[term] = _spelled(term, texts)
        depths[term] = 1 + max((depths[operand] for operand in term.operands), default=0)
        is_atom = not term.operands or (term.operator is Operator.NOT and not term.operands[0].operands)
        if not is_atom and (uses[term] > 1 or depths[term] > _INLINE_DEPTH_MAX):
            definitions += 1
            lines.append(f"(define-fun {prefix}{definitions} () Bool {texts[term]})")
            texts[term], depths[term] = f"{prefix}{definitions}", 1
    return [*lines, *(f"(assert {texts[term]})" for term in assertions)]


# --------------------------------------------------------------------------------------------------------------------
# z3


SEED: Final = 0
"""The seed of every solver, so that verdicts and witnesses are the same every time."""


class Answer(StrEnum):
    """Whether all assertions can be true together."""

    SAT = "sat"
    UNSAT = "unsat"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Decision:
    """The answer of a solver; where it is `sat`, a value of every variable."""

    answer: Answer
    assignment: Mapping[str, bool] = field(default_factory=dict)
    reason: str = ""


def to_z3(terms: Sequence[Term]) -> list[z3.BoolRef]:
    """The terms as z3's own, in its default context; what they share is shared."""
    made: dict[Term, z3.BoolRef] = {}
    for term in subterms(terms):
        made[term] = z3_term(term, [made[operand] for operand in term.operands])
    return [made[term] for term in terms]


def z3_term(term: Term, operands: Sequence[z3.BoolRef], context: z3.Context | None = None) -> z3.BoolRef:
    """One term as z3's own, of its operands as z3's own, in a context."""
    match term.operator:
        case Operator.VARIABLE:
            return z3.Bool(term.name, context)
        case Operator.TRUE | Operator.FALSE:
            return z3.BoolVal(term.operator is Operator.TRUE, context)
        case Operator.NOT:
            return z3.Not(operands[0])
        case Operator.AND:
            return _of_all(z3.Z3_mk_and, operands)
        case Operator.OR:
            return _of_all(z3.Z3_mk_or, operands)
        case Operator.EQUAL:
            return operands[0] == operands[1]


def _of_all(make: Callable[..., object], operands: Sequence[z3.BoolRef]) -> z3.BoolRef:
    """One term over some operands of one context: what `z3.And` and `z3.Or` make, without all that these look up."""
    context = operands[0].ctx
    asts = (z3.Ast * len(operands))(*[operand.as_ast() for operand in operands])
    return z3.BoolRef(make(context.ref(), len(operands), asts), context)


def decide(assertions: Sequence[Term], *, timeout_ms: int | None = None) -> Decision:
    """Ask z3 whether all assertions can be true together; UNKNOWN where it gives up or the time is over.

    >>> terms = Terms()
    >>> p = terms.variable("p")
    >>> decide([p, terms.negation(p)]).answer
    <Answer.UNSAT: 'unsat'>
    """
    solver = z3.Solver()
    solver.set("random_seed", SEED)  # the same answer, and the same model, every time
    if timeout_ms is not None:
        solver.set("timeout", timeout_ms)
    solver.add(to_z3(assertions))
    found = solver.check()
    if found == z3.unsat:
        return Decision(Answer.UNSAT)
    if found != z3.sat:
        return Decision(Answer.UNKNOWN, reason=solver.reason_unknown())
    model = solver.model()
    return Decision(
        Answer.SAT,
        {name: z3.is_true(model.eval(z3.Bool(name), model_completion=True)) for name in variables(assertions)},
    )
