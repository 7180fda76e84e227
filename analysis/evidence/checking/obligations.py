"""What a certificate has to show, as formulas that must have no model: derived from the net and its firing rule alone.

The obligations of an inductive invariant, with E for its equations and inequalities, C for its clauses and R for the
transition relation of the discipline:

    sums      in M0 the sums are as stated, no firing changes an equation, none lowers an inequality
    initial   M0 and not C
    step      E and C and R and not C', of the marking after
    goal      E and C and the goal; with a depth d: a run of d firings whose markings satisfy E and C, and of which
              only the last is in the goal
    base-j    M0, j firings, and the goal, for each j below the depth

A set of markings is an invariant too, "it is one of these" or "the diagram leads to its end", and has the same
obligations where it is small enough to be written as a formula; a diagram's is linear in its nodes. Of a continuation
they are those of the net that starts where its firings end. That every siphon contains a marked trap is one question
(`firable.analysis.evidence.checking.siphons`). Of a reduction they are those of the net that is left, and one more:

    weaker    the goal of the net, with what the steps say of its places, and not the goal of what is left

Nothing here is taken from the technique that found the certificate; the relation is an evaluation
of the firing rule. An obligation is SMT-LIB 2 text for any solver, so that nobody needs to trust ours. The sums are
integers and only multiplied out: their file is in linear arithmetic without a variable.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import (
    Certificate,
    Clause,
    Continuation,
    Diagram,
    Equation,
    InductiveInvariant,
    Inequality,
    Labelling,
    Markings,
    Reduction,
    Theorem,
)
from firable.analysis.evidence.checking.obligation import Evidence, Obligation, TimedTerms, comments
from firable.analysis.evidence.checking.reduced import left_of
from firable.analysis.evidence.checking.siphons import of_siphons
from firable.analysis.evidence.claims import Claim, ClaimKind, without_start
from firable.analysis.evidence.meaning import contact
from firable.analysis.evidence.refusal import TimeIsOverError, refuse, ticking
from firable.analysis.induction.encoding import Relation, interleaving_relation, marking_term, step_relation
from firable.analysis.induction.smt import Operator, Term, Terms, subterms
from firable.nets.net import Marking, Net, holding
from firable.semantics.counting import TableTooLargeError, at_most
from firable.semantics.firing import Valuation
from firable.semantics.formulas import evaluate
from firable.semantics.player import NotFirableError, Player
from firable.semantics.trace import Discipline

LITERALS_MAX: Final = 20_000  # of a set of markings that is written as a formula
ENTRIES_MAX: Final = 200_000  # of the table of a sum


def obligations(evidence: Evidence, deadline: Deadline = NEVER, *, closed: bool = False) -> tuple[Obligation, ...]:
    """All obligations in propositional logic; none for what is played, and for a large set.

    Where it is known that the set of markings that the evidence rests on is `closed`, because another claim rests on it
    as well, those that say so are left out.

    Raises `TimeIsOverError` where writing them takes too long, or a sum has too many values to be written at all.
    """
    match evidence.certificate:
        case InductiveInvariant() as invariant:
            return tuple(_of_invariant(evidence, invariant, TimedTerms(deadline=deadline)))
        case Labelling(space) if _size(evidence.net, space) <= LITERALS_MAX:
            return tuple(_of_set(evidence, space, TimedTerms(deadline=deadline), closed=closed))
        case Reduction():
            left = left_of(evidence, deadline)
            rest = () if left.rest is None else obligations(left.rest, deadline)
            return (*left.obligations, *rest)
        case Continuation():
            return obligations(continued(evidence, deadline), deadline, closed=closed)
        case Theorem() as theorem:
            siphons = of_siphons(evidence.net, theorem, TimedTerms(deadline=deadline))
            return (*obligations(contact_free(evidence), deadline), *siphons)
        case _:
            return ()


def continued(evidence: Evidence, deadline: Deadline = NEVER) -> Evidence:
    """What a continuation shows of the net that starts where its firings end; refused where they cannot be fired."""
    certificate, net = evidence.certificate, evidence.net
    if not isinstance(certificate, Continuation):
        raise TypeError("the evidence is no continuation")
    marking = played(net, evidence.discipline, certificate.firings, deadline)[-1]
    claim = Claim(ClaimKind.NEVER, without_start(net, evidence.claim.state_goal))
    there = replace(net, places=holding(net.places, marking), properties=())
    return Evidence(there, evidence.discipline, claim, certificate.then)


def played(
    net: Net, discipline: Discipline, firings: Iterable[Iterable[str]], deadline: Deadline = NEVER
) -> list[Marking]:
    """The markings of a firing sequence, M0 first; refused where the reference player cannot fire it.

    Raises `TimeIsOverError` at the deadline: whether a set is a step may be a hard question.
    """
    player, markings = Player(net, ticking(deadline)), [net.initial_marking]
    for number, names in enumerate(firings, start=1):
        fired = tuple(net.transition_index[name] for name in names)
        if discipline is Discipline.INTERLEAVING:
            allowed = len(fired) == 1 and net.transitions[fired[0]].openable
        else:
            allowed = player.is_step(markings[-1], fired)
        if not allowed or len(set(fired)) != len(fired):
            refuse(f"firing {number}, {' + '.join(names) or 'of nothing'}, is none of this discipline")
        try:
            markings.append(player.fire(markings[-1], fired))
        except NotFirableError as error:
            refuse(f"firing {number}: {error}")
    return markings


def contact_free(evidence: Evidence) -> Evidence:
    """The premise of a theorem, that the net is contact-free."""
    if not isinstance(evidence.certificate, Theorem):
        raise TypeError("the evidence is no theorem")
    claim = Claim(ClaimKind.NEVER, contact(evidence.net))
    return Evidence(evidence.net, Discipline.INTERLEAVING, claim, evidence.certificate.contact)


def _size(net: Net, space: Markings | Diagram) -> int:
    return len(space.markings) * len(net.places) if isinstance(space, Markings) else 3 * len(space.rows)


def _relation(evidence: Evidence, terms: Terms) -> Relation:
    encode = interleaving_relation if evidence.discipline is Discipline.INTERLEAVING else step_relation
    return encode(evidence.net, terms)


def _of_invariant(evidence: Evidence, invariant: InductiveInvariant, terms: Terms) -> Iterator[Obligation]:
    net, relation = evidence.net, _relation(evidence, terms)

    def known(holds: Valuation[Term]) -> list[Term]:
        sums = (sum_term(terms, net, one, holds) for one in stated_sums(invariant))
        return [*sums, *(_clause(terms, net, clause, holds) for clause in invariant.clauses)]

    def kept(holds: Valuation[Term]) -> Term:
        return terms.conjunction(_clause(terms, net, clause, holds) for clause in invariant.clauses)

    before, after = relation.before.__getitem__, relation.after.__getitem__
    if invariant.clauses:
        claim = terms.negation(kept(before))
        yield Obligation("initial", "the clauses hold in the initial marking", (relation.initial(), claim))
        claim = terms.negation(kept(after))
        yield Obligation("step", "every firing keeps the clauses", (*known(before), relation.term, claim))

    runs = _Runs(relation)
    run: list[Term] = []
    for k in range(invariant.depth):
        goal = runs.at(k, evaluate(terms, net, evidence.claim.state_goal, before))
        base = (runs.at(0, relation.initial()), *(runs.step(j) for j in range(k)), goal)
        yield Obligation(f"base-{k}", f"the goal is not reached by {k} firings", base)
        run += [terms.negation(goal), runs.step(k), *(runs.at(k, term) for term in known(before))]
    last = [
        runs.at(invariant.depth, term)
        for term in (*known(before), evaluate(terms, net, evidence.claim.state_goal, before))
    ]
    after_so_many = f" and {invariant.depth} markings without the goal before it" if invariant.depth else ""
    yield Obligation("goal", f"the invariant{after_so_many} excludes the goal", (*run, *last))


def _of_set(evidence: Evidence, space: Markings | Diagram, terms: Terms, *, closed: bool) -> Iterator[Obligation]:
    net = evidence.net
    before, after = (tuple(terms.variable(f"{place.name}{mark}") for place in net.places) for mark in ("", "'"))

    def within(holds: tuple[Term, ...]) -> Term:
        if isinstance(space, Diagram):
            return diagram_term(terms, net, space, holds.__getitem__)
        return terms.disjunction(marking_term(terms, marking, holds) for marking in space.markings)

    among = within(before)
    if not closed:
        relation = _relation(evidence, terms)
        yield Obligation("initial", "the initial marking is in the set", (relation.initial(), terms.negation(among)))
        outside = terms.negation(within(after))
        yield Obligation("step", "no firing leads out of the set", (among, relation.term, outside))
    if evidence.claim.kind is ClaimKind.NEVER:
        goal = evaluate(terms, net, evidence.claim.state_goal, before.__getitem__)
        yield Obligation("goal", "the goal holds in no marking of the set", (among, goal))


def diagram_term(terms: Terms, net: Net, of: Diagram, holds: Valuation[Term]) -> Term:
    """The marking is in the first set of a diagram; linear in its rows, and in the levels that they pass over."""
    places = [net.place_index[name] for name in of.order]
    values, levels = [terms.false, terms.true], [0, 0]

    def below(row: int, level: int) -> Term:
        """The row, as it is seen from a level: what is passed over is empty."""
        if row == 0:
            return terms.false  # and nothing of what is passed over, which is everything
        passed = (terms.negation(holds(places[k - 1])) for k in range(levels[row] + 1, level))
        return terms.conjunction([values[row], *passed])

    for level, lo, hi in of.rows:
        full = holds(places[level - 1])
        without = terms.conjunction([terms.negation(full), below(lo, level)])
        values.append(terms.disjunction([without, terms.conjunction([full, below(hi, level)])]))
        levels.append(level)
    return below(of.roots[0], len(places) + 1)


def _clause(terms: Terms, net: Net, clause: Clause, holds: Valuation[Term]) -> Term:
    index = net.place_index
    literals = [holds(index[name]) for name in clause.marked]
    return terms.disjunction([*literals, *(terms.negation(holds(index[name])) for name in clause.empty)])


def sum_term(terms: Terms, net: Net, of: Equation | Inequality, holds: Valuation[Term]) -> Term:
    """The equation or inequality as a Boolean term over the places.

    Raises `TimeIsOverError` for one whose weights make so many different sums that nobody could write it.
    """

    def at_least(weights: list[tuple[str, int]], tokens: int) -> Term:
        # sum w p >= c, with q for "not p": sum over positive w of w q + sum over negative w of -w p <= sum w+ - c
        counted = [
            (terms.negation(holds(net.place_index[name])) if weight > 0 else holds(net.place_index[name]), abs(weight))
            for name, weight in weights
            if weight
        ]
        bound = sum(weight for _, weight in weights if weight > 0) - tokens
        try:
            return at_most(terms, counted, bound, ENTRIES_MAX)
        except TableTooLargeError:
            raise TimeIsOverError("only claimed: the weights of a sum make too many different values") from None

    weights = list(of.weights)
    lower = at_least(weights, of.tokens)
    if isinstance(of, Inequality):
        return lower
    return terms.conjunction([lower, at_least([(name, -weight) for name, weight in weights], -of.tokens)])


def stated_sums(invariant: InductiveInvariant) -> list[Equation | Inequality]:
    """The equations and inequalities."""
    return [*invariant.equations, *invariant.inequalities]


class _Runs:
    """Copies of the relation one after the other; `@k` behind a name is no part of any name of a net's."""

    def __init__(self, relation: Relation) -> None:
        self.relation = relation
        self._names: dict[int, dict[str, str]] = {}

    def at(self, k: int, term: Term) -> Term:
        """A term over the marking before, of the marking after k firings."""
        if k not in self._names:
            self._names[k] = {p.name: f"{p.name}@{k}" for p in self.relation.before}
        return _renamed(self.relation.terms, term, self._names[k])

    def step(self, k: int) -> Term:
        """The firing from marking k to marking k + 1."""
        relation = self.relation
        names = {variable.name: f"{variable.name}@{k}" for variable in (*relation.fires, *relation.signals)}
        for before, after in zip(relation.before, relation.after, strict=True):
            names |= {before.name: f"{before.name}@{k}", after.name: f"{before.name}@{k + 1}"}
        return _renamed(relation.terms, relation.term, names)


def _renamed(terms: Terms, term: Term, names: Mapping[str, str]) -> Term:
    made: dict[Term, Term] = {}
    for subterm in subterms([term]):
        operands = [made[operand] for operand in subterm.operands]
        match subterm.operator:
            case Operator.VARIABLE:
                made[subterm] = terms.variable(names[subterm.name])
            case Operator.TRUE | Operator.FALSE:
                made[subterm] = subterm
            case Operator.NOT:
                made[subterm] = terms.negation(operands[0])
            case Operator.AND:
                made[subterm] = terms.conjunction(operands)
            case Operator.OR:
                made[subterm] = terms.disjunction(operands)
            case Operator.EQUAL:
                made[subterm] = terms.equal(operands[0], operands[1])
    return made[term]


@dataclass(frozen=True, slots=True)
class Violation:
    """A sum that is not as stated: in M0, or by the firing of a transition."""

    of: Equation | Inequality
    by: str

    def __str__(self) -> str:
        total = " + ".join(f"{weight} {name}" for name, weight in self.of.weights)
        return f"the sum {total} {self.by}"


def wrong_sums(net: Net, certificate: Certificate) -> Iterator[Violation]:
    """The obligation `sums`, multiplied out in integers: what is wrong with the equations and inequalities.

    M' = (M minus I) plus O, and a transition with a place in both never fires. What holds of each firing holds of a
    step, in which a place has one consumer and one producer at most.
    """
    if not isinstance(certificate, InductiveInvariant):
        return
    for of, initial, changes in _sums(net, certificate):
        exact = isinstance(of, Equation)
        if initial != of.tokens if exact else initial < of.tokens:
            yield Violation(of, f"is {initial} in the initial marking")
        for name, change in changes:
            if change if exact else change < 0:
                yield Violation(of, f"is changed by {change} when {name} fires")


def sums_text(evidence: Evidence) -> str | None:
    """The same obligation as SMT-LIB 2 text; None where there are no sums."""
    certificate = evidence.certificate
    if not isinstance(certificate, InductiveInvariant) or not (certificate.equations or certificate.inequalities):
        return None
    statement = "in the initial marking the sums are as stated, no firing changes or lowers them"
    lines = [*(f"; {line}" for line in comments(evidence, statement)), "(set-logic QF_LIA)", "(assert (or false"]
    for of, initial, changes in _sums(evidence.net, certificate):
        wrong = "distinct" if isinstance(of, Equation) else "<"
        lines.append(f"  ({wrong} {_number(initial)} {_number(of.tokens)})")
        lines += [f"  ({wrong} {_number(change)} 0)" for _, change in changes]
    return "\n".join([*lines, "))", "(check-sat)"]) + "\n"


def _number(number: int) -> str:
    return str(number) if number >= 0 else f"(- {-number})"


def _sums(
    net: Net, certificate: InductiveInvariant
) -> Iterator[tuple[Equation | Inequality, int, list[tuple[str, int]]]]:
    """Each sum with its value in M0, and by how much each transition that touches it changes it."""
    for of in stated_sums(certificate):
        weights: dict[int, int] = {}
        for name, weight in of.weights:
            weights[net.place_index[name]] = weights.get(net.place_index[name], 0) + weight
        initial = sum(weight for place, weight in weights.items() if net.initial_marking >> place & 1)
        touching = sorted({t for place in weights for t in (*net.consumers[place], *net.producers[place])})
        changes = []
        for t in touching:
            transition = net.transitions[t]
            if not transition.self_loops:
                put = sum(weights.get(net.place_index[name], 0) for name in transition.outputs)
                taken = sum(weights.get(net.place_index[name], 0) for name in transition.inputs)
                changes.append((transition.name, put - taken))
        yield of, initial, changes
