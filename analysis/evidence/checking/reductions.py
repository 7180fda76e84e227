"""Reductions as evidence: a net is made smaller step by step, and what reaches its goal reaches that of what is left.

The net is a *draft*: of each transition the values of places that it needs, and which of these it flips (a move), by
Eq. (1) and (3)-(4) as `cubes` reads them; the contact rule is then a need like any other. Of each step two things hold
between the draft before it and the draft after it:

    no more    each marking that is reachable after it is one that was reachable before it, places that are gone left
               out; so facts about reachable markings stay facts
    enough     where the goal was reachable before it, it is after it

From "enough", step by step: if the goal is never met in what is left, it is never met in the net. Nothing is asked of
the way back, since a net that meets its goal shows this by a run. The rules are those of Berthelot (1986, "Checking
properties of nets using transformations"), Haddad and Pradat-Peyre (2006, "New efficient Petri nets reductions for
parallel programs verification"), Rakow (2012, "Safety slicing Petri nets") and Thierry-Mieg (2020, "Structural
reductions revisited"). They assume that places have room, so each is proved here for moves. A goal *wants* a literal
that it may become true by; it *speaks* of a place of which it wants a literal. A goal that asks for a deadlock does so
beside a formula; "wants" and "speaks" are of this formula.

- *Constant*: what needs another value than a place has in M0 is taken out, and nothing else flips one of these
  places. By induction over the firings none of them changes.
- *Irrelevant*, not for deadlocks: the moves taken out make true nothing that the goal wants or a move kept needs. Of
  a run to the goal leave them out: by induction each literal that is wanted or needed and held in the run holds.
- *Unneeded*: no move needs the place, the goal does not speak of it.
- *Copy*: the same moves flip p and q, so each firing changes both or none, and who needs p may need q instead. A move
  that needs what they never are together never fires.
- *Subsumed*: u flips what t flips, and needs all that t needs. Where u fires t may, with the same effect.
- *Early*: t can be made in M0, nothing else needs, and the goal does not want, a literal that t makes false. Until t
  is made none of these is changed, for who flips it needs it. So t can come first in a run in which it fires, and be
  put before one in which it does not: the end differs in what the goal does not want. For a deadlock t reads nothing:
  then it can be made until it is made.
- *Dead*, *gate*: two needs of a move are never true together, or one never is; or a need follows from another one.
  The graph of markings stays as it is.
- *Implied*: each need of the place follows from another need of the same move, and the goal does not speak of it. By
  induction a run of the draft after is one of the draft before.
- *Always*: what can always be made is in no deadlock.

The last two are about a place p of which the goal does not speak, and which whoever needs it flips: the *openers* from
its value in M0, the *closers* back to it; there are some of both. Between an opener and the next closer p is *away*.
Of a run to the goal each opener is to be followed by its closer at once; then the composed moves do. `Others` are the
moves that need a literal, are neither opener nor closer, and are not dead while p is away.

- *Closers early*: away implies what each closer needs elsewhere. No other needs, and the goal does not want, a literal
  that a closer makes false. What stands between an opener and its closer f then has nothing to do with what f
  flips: it does not need the value before, and the value after does not hold. Nor does it flip what f reads, since
  away implies that. So f may come directly after the opener, and where there is none one is put in: the end differs in
  what the goal does not want. In a deadlock p is not away, since a closer could be made; so its run is put in order
  and ends in the same marking, where no composed move can be made, for its opener cannot.
- *Openers late*: for a literal (x, v) that an opener h makes false: no other needs its contrary, nor does the goal want
  that. And no other flips what h reads. What stands between h and its closer then has nothing to do with x: the
  contrary it does not need, and v does not hold. So h may come directly before its closer; without one it is left
  out, and the end differs in what the goal does not want. For a deadlock D with p away, let D' be D without its last
  opener h, and ask besides that no move but h, closers apart, needs (x, v), that the goal does not speak of x, and
  that where there are several openers no closer needs a place that one of them flips. Then nothing can be made in D'.
  Not h with a closer: h would lead to D, and the closer could be made there. Not another opener with a closer: what
  the closer needs is in D' as it is in D, where it could be made. Not another move: it could not be made in D, so it
  needs some (x, v).

What the steps leave may fall apart: no move has to do with places of the part and with others. A run of the whole is
one of each part, a deadlock of the whole one of each part. So it is enough that one part does not meet what the goal
asks of it; that it does ask for this is one obligation for a solver. Interleaving only.

Rejected: to state the invariant of the small net for the given one. What a place that is gone may hold while others
move is a formula for each composed move, and these multiply where the rules compose and compose again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Rule, Step
from firable.analysis.evidence.checking.cubes import Cube, firings
from firable.analysis.evidence.checking.facts import Facts, Literal, Move, facts_of
from firable.analysis.evidence.checking.obligation import TimedTerms
from firable.analysis.evidence.refusal import TimeIsOverError, in_time, refuse, ticking
from firable.analysis.induction.smt import Operator, Term
from firable.nets.formula import And, Deadlock, Formula, conjuncts
from firable.nets.net import Net
from firable.semantics.formulas import evaluate


@dataclass(frozen=True)
class _Goals(TimedTerms):
    """Terms in which a conjunction of contradictory terms is false, and a disjunction of them true.

    Of either the goal wants nothing, however places stand for each other by now.
    """

    def conjunction(self, operands: Iterable[Term], /) -> Term:
        """The AND of the operands, flat."""
        flat = _flat(Operator.AND, operands)
        return self.false if _contradict(flat) else super().conjunction(flat)

    def disjunction(self, operands: Iterable[Term], /) -> Term:
        """The OR of the operands, flat."""
        flat = _flat(Operator.OR, operands)
        return self.true if _contradict(flat) else super().disjunction(flat)


def _flat(operator: Operator, operands: Iterable[Term]) -> dict[Term, None]:
    flat: dict[Term, None] = {}
    for one in operands:
        flat.update(dict.fromkeys(one.operands if one.operator is operator else (one,)))
    return flat


def _contradict(terms: Mapping[Term, None]) -> bool:
    return any(one.operator is Operator.NOT and one.operands[0] in terms for one in terms)


class Draft:
    """The net while it is reduced: moves by number, and the values of its places in M0."""

    def __init__(self, net: Net, goal: Formula, deadline: Deadline) -> None:
        self.net, self.deadline = net, deadline
        operands = tuple(conjuncts(goal))
        self.deadlock = Deadlock() in operands
        self.formula = And(tuple(one for one in operands if one != Deadlock()))
        self.never_dead = False
        self.moves: dict[int, Move] = {}
        self.at: dict[Literal, set[int]] = {(p, v): set() for p in range(len(net.places)) for v in (False, True)}
        self.values = {p: place.marked for p, place in enumerate(net.places)}
        self.stands_for: dict[int, bool | Literal] = {}
        self.next = len(net.transitions)
        self.facts: Facts | None = None
        self.terms = _Goals(deadline=deadline)
        for t, move in firings(net).items():
            self._put(t, move)

    def apply(self, step: Step) -> None:
        """Apply a rule; refused where it cannot be, raises `TimeIsOverError`."""
        if self.deadline.over:
            raise TimeIsOverError
        moves, places = step.moves, tuple(self.net.place_index[name] for name in step.places)
        if not self.moves.keys() >= {*moves} or not self.values.keys() >= {*places}:
            self._refuse(step, "what it names is not there")
        if len({*moves}) < len(moves) or len({*places}) < len(places):
            self._refuse(step, "it names something twice")
        match step.rule, moves, places:
            case Rule.CONSTANT, (), _:
                self._constant(step, frozenset(places))
            case Rule.IRRELEVANT, _, ():
                self._irrelevant(step, frozenset(moves))
            case Rule.UNNEEDED, (), _:
                for p in places:
                    self._require(step, not self._needing(p) and not self._spoken(p))
                    self._drop(p)
            case Rule.COPY, (), (p, q):
                self._copy(step, p, q)
            case Rule.SUBSUMED, (u, t), ():
                (needs, flips), (more, flipped) = self.moves[t], self.moves[u]
                self._require(step, flips == flipped and needs.items() <= more.items())
                self._take(u)
            case Rule.EARLY, (t,), ():
                self._early(step, t)
            case Rule.FACTS, (), ():
                self.facts = facts_of(self.values, self.moves.values(), self.facts, self.deadline)
            case Rule.DEAD, _, ():
                for t in moves:
                    literals = list(self.moves[t][0].items())
                    self._require(step, any(self._exclude(one, other) for one in literals for other in literals))
                    self._take(t)
            case Rule.GATE, (t,), _:
                for p in places:
                    self._require(step, p not in self.moves[t][1] and self._implied(t, p))
                    self._put(t, _without(self._take(t), p))
            case Rule.IMPLIED, (), (p,):
                self._require(step, not self._spoken(p) and all(self._implied(t, p) for t in self._needing(p)))
                self._drop(p)
            case ((Rule.CLOSERS_EARLY | Rule.OPENERS_LATE), (), (p,)):
                _Around(self, step, p).compose()
            case Rule.ALWAYS, (t,), ():
                self._require(step, not self.moves[t][0])
                self.never_dead = True
            case _:
                self._refuse(step, "it names too many things, or too few")

    @cached_property
    def goal(self) -> Term:
        """The formula of the goal over the places that are left; a variable is named by its place."""
        return evaluate(self.terms, self.net, self.formula, self._value)

    @cached_property
    def wanted(self) -> frozenset[Literal]:
        """The literals that the goal may become true by."""
        found, todo = set[tuple[Term, bool]](), [(self.goal, True)]
        while todo:
            one, value = todo.pop()
            if (one, value) not in found:
                found.add((one, value))
                todo += [(operand, value is not (one.operator is Operator.NOT)) for operand in one.operands]
        index = self.net.place_index
        return frozenset((index[one.name], value) for one, value in found if one.operator is Operator.VARIABLE)

    def _value(self, place: int) -> Term:
        equal = True
        while place in self.stands_for:
            match self.stands_for[place]:
                case bool(value):
                    return self.terms.true if value is equal else self.terms.false
                case (place, same):
                    equal = equal is same
        return self.terms.literal(self.net.places[place].name, equal)

    def _stand(self, values: dict[int, bool | Literal]) -> None:
        self.stands_for |= values
        self.__dict__.pop("goal", None)
        self.__dict__.pop("wanted", None)

    def _needing(self, place: int) -> set[int]:
        return self.at[place, False] | self.at[place, True]

    def _spoken(self, place: int) -> bool:
        return (place, False) in self.wanted or (place, True) in self.wanted

    def _exclude(self, one: Literal, other: Literal) -> bool:
        """Whether two literals are never true together in a reachable marking; of one literal twice, never true."""
        if one[0] == other[0] and one[1] is not other[1]:
            return True
        return self.facts is not None and self.facts.exclude(one, other)

    def _implied(self, t: int, place: int) -> bool:
        """Whether what a move needs of a place follows from what it needs of another."""
        needs = self.moves[t][0]
        return place in needs and any(
            self._exclude(one, (place, not needs[place])) for one in needs.items() if one[0] != place
        )

    def _put(self, t: int, move: Move) -> None:
        self.moves[t] = move
        for literal in move[0].items():
            self.at[literal].add(t)

    def _take(self, t: int) -> Move:
        move = self.moves.pop(t)
        for literal in move[0].items():
            self.at[literal].discard(t)
        return move

    def _drop(self, place: int) -> None:
        for t in self._needing(place):
            self._put(t, _without(self._take(t), place))
        del self.values[place]

    def _require(self, step: Step, holds: bool) -> None:
        if not holds:
            self._refuse(step, "what it asks for does not hold")

    def _refuse(self, step: Step, reason: str) -> None:
        named = [*map(str, step.moves[:8]), *step.places[:8]]
        refuse(f"the rule '{step.rule}' cannot be applied to {', '.join(named) or 'nothing'}: {reason}")

    def _constant(self, step: Step, places: frozenset[int]) -> None:
        for p in places:
            for t in list(self.at[p, not self.values[p]]):
                self._take(t)
        self._require(step, all(p not in self.moves[t][1] for p in places for t in self._needing(p)))
        self._stand({p: self.values[p] for p in places})
        for p in places:
            self._drop(p)

    def _irrelevant(self, step: Step, moves: frozenset[int]) -> None:
        self._require(step, not self.deadlock)
        for t in moves:
            for literal in _made(self.moves[t]):
                self._require(step, literal not in self.wanted and self.at[literal] <= moves)
        for t in moves:
            self._take(t)

    def _copy(self, step: Step, p: int, q: int) -> None:
        around = ((p in self.moves[t][1]) is (q in self.moves[t][1]) for t in self._needing(p) | self._needing(q))
        self._require(step, all(around))
        equal = self.values[p] is self.values[q]
        self._stand({p: (q, equal)})
        for t in self._needing(p):
            needs, flips = self._take(t)
            wanted = needs[p] is equal
            if needs.get(q, wanted) is wanted:
                self._put(t, _without((needs | {q: wanted}, flips), p))
        self._drop(p)

    def _early(self, step: Step, t: int) -> None:
        needs, flips = self.moves[t]
        self._require(step, all(self.values[p] is value for p, value in needs.items()))
        self._require(step, not self.deadlock or (bool(flips) and needs.keys() == flips))
        for literal in ((p, needs[p]) for p in flips):
            self._require(step, self.at[literal] == {t} and literal not in self.wanted)
        self.values |= {p: not needs[p] for p in flips}


class _Around:
    """A place with its openers and closers; refused where they cannot be composed."""

    def __init__(self, draft: Draft, step: Step, place: int) -> None:
        self.draft, self.place, rest = draft, place, draft.values[place]
        self.tick = ticking(draft.deadline)
        self.away = place, not rest
        self.openers, self.closers = sorted(draft.at[place, rest]), sorted(draft.at[self.away])
        both = [*self.openers, *self.closers]
        fits = self.openers and self.closers and all(place in draft.moves[t][1] for t in both)
        if not fits or draft._spoken(place):
            draft._refuse(step, "it is read, not needed, or the goal speaks of it")
        draft._require(step, self._closers_early() if step.rule is Rule.CLOSERS_EARLY else self._openers_late())

    def _others(self, one: Literal) -> Iterator[int]:
        self.tick()
        for t in self.draft.at[one].difference(self.openers, self.closers):
            if not any(self.draft._exclude(self.away, need) for need in self.draft.moves[t][0].items()):
                yield t

    def _lost(self, t: int) -> Iterator[Literal]:
        """The literals of other places that a move makes false."""
        needs, flips = self.draft.moves[t]
        return ((p, needs[p]) for p in flips if p != self.place)

    def _unwanted(self, one: Literal) -> bool:
        return self.draft.deadlock or one not in self.draft.wanted

    def _closers_early(self) -> bool:
        for t in self.closers:
            for p, value in self.draft.moves[t][0].items():
                if p != self.place and not self.draft._exclude(self.away, (p, not value)):
                    return False
        lost = (one for t in self.closers for one in self._lost(t))
        return all(self._unwanted(one) and not any(True for _ in self._others(one)) for one in lost)

    def _openers_late(self) -> bool:
        for t in self.openers:
            needs, flips = self.draft.moves[t]
            for p, value in self._lost(t):
                if not self._unwanted((p, not value)) or any(True for _ in self._others((p, not value))):
                    return False
            for read in needs.items() - {(p, needs[p]) for p in flips}:
                if any(read[0] in self.draft.moves[u][1] for u in self._others(read)):
                    return False
        return not self.draft.deadlock or all(self._without_competition(t) for t in self.openers)

    def _without_competition(self, t: int) -> bool:
        self.tick()
        for one in self._lost(t):
            if self.draft.at[one].difference(self.closers) != {t} or self.draft._spoken(one[0]):
                return False
            if len(self.openers) > 1 and any(one[0] in self.draft.moves[f][0] for f in self.closers):
                return False
        return True

    def compose(self) -> None:
        """Put in the place of openers and closers what they are in one."""
        draft = self.draft
        openers, closers = ([draft._take(t) for t in numbers] for numbers in (self.openers, self.closers))
        for first, then in in_time(product(openers, closers), draft.deadline):
            if (move := _composed(first, then)) is not None:
                draft._put(draft.next, _without(move, self.place))
                draft.next += 1
        draft._drop(self.place)


def _made(move: Move) -> Iterator[Literal]:
    needs, flips = move
    return ((p, not needs[p]) for p in flips)


def _without(move: Move, place: int) -> Move:
    needs, flips = move
    return {p: value for p, value in needs.items() if p != place}, flips - {place}


def _composed(first: Move, then: Move) -> Move | None:
    """The two, one directly after the other; None where the first makes the second impossible."""
    needs: Cube = dict(first[0])
    for p, value in then[0].items():
        if p not in first[0]:
            needs[p] = value
        elif (first[0][p] ^ (p in first[1])) is not value:
            return None
    return needs, first[1] ^ then[1]
