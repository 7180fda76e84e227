"""Stubborn sets, looked through: no marking of a goal is reachable, though only some of the firings are followed.

The evidence is a set of markings and, for each, a set of transitions. The markings hold M0; wherever a member is
firable, the marking after it is among them; and in none of them does the goal hold. That the firings left out
lead to no goal either is what makes a set *stubborn* at a marking M (Valmari 1990, "Stubborn sets for reduced state
space generation"; for goals Kristensen, Schmidt and Valmari 2006, "Question-guided stubborn set methods for state
properties"), here for the extended net under interleaving, external gates free:

    goal       every firing sequence from M into the goal fires a member
    disabled   of a member that is not firable, all transitions that make some false condition of it true are members
    firable    of a member that is firable, all transitions that have its own condition on a place that it flips, are
               members

By Eq. (1) the conditions of a transition are that inputs and permissive gates are full, and outputs, by the contact
rule, and inhibitive gates empty. It flips its inputs and outputs, from what it wants there to the contrary.
So a transition that makes a condition false has that condition itself. (Ordinary nets lack this, and their rules
speak of tokens that are enough for both.) A transition that contradicts itself, or that no valuation opens, never
fires, and is no member whatever is written.

*Lemma.* If u1 ... un t is fired from M, t is a member and no ui is one, then t u1 ... un can be fired too, and ends in
the same marking. For t is firable in M: else, by "disabled", no ui makes the condition true that t lacks. And no ui
has a condition on a place that t flips: not the one that t has, by "firable"; so none flips it, it stays true while
they fire, and none has the contrary one. So t takes nothing from them, and the flips commute.

*Theorem.* If a goal is n firings away from M, then n > 0, and it is n - 1 firings away from the marking after some
firable member: by "goal" some member fires, and the first that does can come first. So from M0 the goal is not
reachable at all: its distance would fall for ever within the set.

The distance is why no proviso on cycles is asked for. It is a theorem on goals, deadlock among them: of what
holds on the way, or again and again, such a set says nothing. To preserve that, every cycle of the reduced graph
would have to fire all that it leaves out somewhere (the ignoring problem: Valmari 1990, Evangelista and Pajault
2010), and for what is said with "until" members would have to change nothing that is spoken of; so this
evidence shows "never", and no other claim.

"Goal" is judged by evaluating the goal in an algebra of triples: where it holds; where it does not, and cannot before a
member fires; where it does, and cannot fail before one fires. Of "p is full" the second is where p is empty and all
that fill it are members; a conjunction waits for a false operand, which one is free, a disjunction for all. So the
rule for deadlocks, that some firable transition loses a condition by members alone, is no rule of its own.

All of this is one look at columns, one bit for each marking (`columns`). Rejected: to let the checker compute the
sets from what is fired, which is a search for the greatest such set in each marking, and a hundred times the work.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import StubbornSets
from firable.analysis.evidence.checking.columns import columns, numbers
from firable.analysis.evidence.checking.cubes import firings
from firable.analysis.evidence.refusal import in_time, refuse, shown
from firable.nets.formula import Formula, format_formula
from firable.nets.net import Net
from firable.semantics.formulas import evaluate

Literal = tuple[int, bool]
"""A place, and whether it is full."""
Guarded = tuple[int, int, int]
"""Where it holds; where not, until a member fires at least; where it does, until one fires at least."""


@dataclass(frozen=True, slots=True)
class _Waiting:
    """The algebra of formulas that wait for a member to fire, over so many markings."""

    everywhere: int

    def conjunction(self, operands: Iterable[Guarded], /) -> Guarded:
        """It fails where some operand does; it cannot begin before any false one does, nor fail before all may."""
        holds, begins, ends = self.everywhere, 0, self.everywhere
        for value, begin, end in operands:
            holds, begins, ends = holds & value, begins | begin, ends & end
        return holds, begins, ends

    def disjunction(self, operands: Iterable[Guarded], /) -> Guarded:
        """The dual."""
        return self.negation(self.conjunction(map(self.negation, operands)))

    def negation(self, operand: Guarded, /) -> Guarded:
        """What begins ends."""
        holds, begins, ends = operand
        return holds ^ self.everywhere, ends, begins


class Stubborn:
    """The markings and their sets as columns; refused where they do not fit each other or the net."""

    def __init__(self, net: Net, of: StubbornSets, deadline: Deadline = NEVER) -> None:
        self.net, self.markings, self.deadline = net, of.space.markings, deadline
        if len(of.chosen) != len(self.markings) or not all(0 <= number < len(of.sets) for number in of.chosen):
            refuse("not each marking has a set of transitions")
        self.place_of = {marking: i for i, marking in enumerate(self.markings)}
        self.everywhere = (1 << len(self.markings)) - 1
        self.full = columns(self.markings, len(net.places))
        self.member = columns([of.sets[number] for number in of.chosen], len(net.transitions))
        self.firings = firings(net)
        self.needers: dict[Literal, list[int]] = {}
        self.makers: dict[Literal, list[int]] = {}
        for t, (conditions, flips) in self.firings.items():
            for place, value in conditions.items():
                self.needers.setdefault((place, value), []).append(t)
                if place in flips:
                    self.makers.setdefault((place, not value), []).append(t)
        self._makers_in: dict[Literal, int] = {}
        self._needers_in: dict[Literal, int] = {}

    def check(self, goal: Formula) -> None:
        """Refuse where the goal may be reachable; raises `TimeIsOverError`."""
        self._require_goal(goal)
        for t in in_time(self.firings, self.deadline):
            self._require_rules(t)
        self._require_closed()

    @cached_property
    def n_firings(self) -> int:
        """How many firings were gone through."""
        return sum((self.member[t] & self._firable(t)).bit_count() for t in self.firings)

    def _true(self, of: Literal) -> int:
        place, value = of
        return self.full[place] if value else self.full[place] ^ self.everywhere

    def _all_in(self, transitions: Iterable[int]) -> int:
        found = self.everywhere
        for t in transitions:
            found &= self.member[t]
        return found

    def _made_by_members(self, of: Literal) -> int:
        """Where all that make a literal true are members."""
        if of not in self._makers_in:
            self._makers_in[of] = self._all_in(self.makers.get(of, ()))
        return self._makers_in[of]

    def _needed_by_members(self, of: Literal) -> int:
        """Where all that have this condition are members."""
        if of not in self._needers_in:
            self._needers_in[of] = self._all_in(self.needers.get(of, ()))
        return self._needers_in[of]

    def _firable(self, t: int) -> int:
        found = self.everywhere
        for condition in self.firings[t][0].items():
            found &= self._true(condition)
        return found

    def _require_goal(self, goal: Formula) -> None:
        def holds(place: int) -> Guarded:
            full = self.full[place]
            begins, ends = self._made_by_members((place, True)), self._made_by_members((place, False))
            return full, begins & ~full, ends & full

        met, waits, _ = evaluate(_Waiting(self.everywhere), self.net, goal, holds)
        self._refuse_in(met, f"the goal ({format_formula(goal)}) holds in")
        self._refuse_in(self.everywhere ^ waits, "the goal may be met without a member of the set of")

    def _require_rules(self, t: int) -> None:
        conditions, flips = self.firings[t]
        firable, served = self._firable(t), 0
        name = self.net.transitions[t].name
        for place in flips:
            missing = self.member[t] & firable & ~self._needed_by_members((place, conditions[place]))
            self._refuse_in(missing, f"what {name} is in conflict with is left out in")
        for condition in conditions.items():
            served |= self._made_by_members(condition) & ~self._true(condition)
        self._refuse_in(self.member[t] & ~firable & ~served, f"what may enable {name} is left out in")

    def _require_closed(self) -> None:
        if self.net.initial_marking not in self.place_of:
            refuse("the initial marking is not in the set")
        for t, (_, flips) in self.firings.items():
            flipped = sum(1 << place for place in flips)
            for i in in_time(numbers(self.member[t] & self._firable(t)), self.deadline):
                after = self.markings[i] ^ flipped
                if after not in self.place_of:
                    refuse(f"a firing of {self.net.transitions[t].name} leads out of the set, to {self._shown(after)}")

    def _refuse_in(self, wrong: int, reason: str) -> None:
        for i in numbers(wrong):
            refuse(f"{reason} {self._shown(self.markings[i])}")

    def _shown(self, marking: int) -> str:
        return shown(self.net, marking)
