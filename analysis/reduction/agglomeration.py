"""Rules: two transitions that may as well fire as one, with nothing in between.

Let p be a place that the goal does not speak of, that no move only reads, with the value r in M0. The moves that need
r flip p away from it: the *openers* H. The moves that need the other value flip it back: the *closers* F. If every
run can be put in order so that each opener is followed by its closer at once, p is at r before and after, and the
composed moves "h, then f" replace H and F. With r = 0 this is the agglomeration of transitions around a place; with r
= 1 the place is a resource that is taken and given back. Each opener is followed by at most one closer before the
next opener, since p has room for one token: between them, p has the value that is not r, the literal *away*.

Two conditions under which the order can be changed. In both, moves that cannot be made while p is away (a fact of
`pairs`) need no further look, and H and F themselves neither: h needs r, and f ends the time between.

**Closers early** (post-agglomeration). While p is away each closer can be made at any time: away implies all that it
needs; and nobody misses what it changes: for each other place x that it flips, from v, no move needs v while p is
away, and the goal does not want v. Then f can be moved to the left, directly after h: what is between neither needs v
(by the condition) nor the other value of x (away implies v), so it does not see f. An opener left without closer gets
one. For a deadlock: away is none, since a closer can be made; and where p is at r, h can be made iff it can with any
f. So the deadlocks are the same, and what the goal wants does not matter.

**Openers late** (pre-agglomeration). Nobody needs while p is away what h brought about: for each other place x that h
flips, from v, no move needs the other value while p is away; nobody flips what h only reads while p is away; and the
goal wants none of those other values. Then h can be moved to the right, directly before f: what is between does not
touch x and keeps what h reads. An opener left without closer is left out, and the goal holds all the same. For a
deadlock D with p away, let D' be D without its last opener h. No closer can be made after h, so no composed move of h
can be made in D'. So that the others cannot be made either: no other move needs a v of an opener, where there are
several openers no closer speaks of places they flip, and the goal does not speak of them. Conversely a deadlock of
the draft may have an opener h that can be made, and leads to a deadlock: no closer can be made after it, no other
opener while p is away, and of the others those that need what h brought about are never made then, the rest have not
gained by h. So h is fired as a *tail*.

**Where it matters what can still happen** (`Labels.branching`), the marking at which a choice is made must not move.
Then one opener or closer u may go by itself only as far as it makes no difference at all: wherever u can be made, it
stays possible until it is made, it takes nothing from anybody, and no label sees it. So a marking s in which it can
be made and the one after it, u(s), satisfy the same formulas of CTL without X: what can be made in u(s) can be made in
s after u; what can be made in s can be made in u(s), and leads to a pair of the same kind; and u is not made again and
again, as p is at rest or away between (branching bisimilarity that is sensitive to divergence: De Nicola and Vaandrager
1995; steps of this kind are the confluent ones of Groote and Sellink 1996). The conditions come to this:

- *closers early*, and there is one closer: which one of two is made is a choice that the opener does not make.
- *openers late*, as for a deadlock, and there is one opener, as two keep each other away. What h flips nobody else
  needs. Who flips what h only reads cannot be made while p is away; wherever h can be made he cannot either, since he
  could be made after it as well.

Sources: Berthelot 1986, "Checking properties of nets using transformations"; Haddad and Pradat-Peyre 2006, "New
efficient Petri nets reductions for parallel programs verification"; Thierry-Mieg 2020, "Structural reductions
revisited" (openers with competitors, if only reachability is asked). All of them assume that places have room. Under
the contact rule a full output place blocks, which here is a need like another, met by a fact or not at all: a buffer
between two machines that may both be occupied is two places and stays so.

The contract: composed moves are runs of two. Moves multiply, so a place is taken only where their number does not
grow.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import heappop, heappush
from itertools import product
from typing import Final

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Rule
from firable.analysis.reduction.draft import Draft, Literal, Move, Tail, composed, literal
from firable.analysis.reduction.goals import Labels
from firable.analysis.reduction.pairs import Facts

_AROUND_MAX: Final = 2_000  # moves looked at for one place, so that places that all share cost no square
LENGTH_MAX: Final = 1_000
"""Firings of the original net that one of two composed moves may stand for: a counter's double with each place."""


def agglomerate(draft: Draft, facts: Facts, deadline: Deadline) -> bool:
    """Apply both rules where something has changed, until there are no such places; whether any was taken.

    Places with few transitions come first, so that the many that leave a choice are composed once, with the whole
    sequence that leads to it, and not with each of its steps.
    """
    changed = False
    heap: list[tuple[int, int]] = []
    queued: set[int] = set()
    while not deadline.over:
        for place in draft.touched:
            if place not in queued:
                queued.add(place)
                heappush(heap, (_pairs_at(draft, place), place))
        draft.touched.clear()
        if not heap:
            break
        expected, place = heappop(heap)
        if (now := _pairs_at(draft, place)) > expected:
            heappush(heap, (now, place))
            continue
        queued.remove(place)
        if rule := agglomerate_at(draft, facts, place):
            draft.count(rule)
            changed = True
    return changed


def _pairs_at(draft: Draft, place: int) -> int:
    """How many pairs of an opener and a closer there are."""
    return len(draft.at[2 * place]) * len(draft.at[2 * place + 1])


def agglomerate_at(draft: Draft, facts: Facts, place: int) -> str:
    """Apply the rules to one place; the name of the rule that was, empty where the place stays."""
    around = _Around.of(draft, facts, place)
    if around is None:
        return ""
    if around.closers_early():
        draft.note(Rule.CLOSERS_EARLY, places=(place,))
        around.compose()
        return "closers early"
    if around.openers_late():
        if draft.deadlock:
            draft.tails.append(Tail(tuple(around.openers.values())))
        draft.note(Rule.OPENERS_LATE, places=(place,))
        around.compose()
        return "openers late"
    return ""


class _Around:
    """A place with its openers and closers."""

    def __init__(self, draft: Draft, facts: Facts, place: int, openers: set[int], closers: set[int]) -> None:
        self.draft, self.place = draft, place
        self.openers = {number: draft.moves[number] for number in sorted(openers)}
        self.closers = {number: draft.moves[number] for number in sorted(closers)}
        away = literal(place, not draft.values[place])
        self.excluded = facts.excluded_by(away)
        self.left = _AROUND_MAX
        self.branching = isinstance(draft.goal, Labels) and draft.goal.branching

    @classmethod
    def of(cls, draft: Draft, facts: Facts, place: int) -> _Around | None:
        """The place with its moves, if it can be taken at all."""
        rest = draft.values[place]
        openers, closers = draft.at[literal(place, rest)], draft.at[literal(place, not rest)]
        n_openers, n_closers = len(openers), len(closers)
        if draft.goal is None or not n_openers or not n_closers or n_openers * n_closers > n_openers + n_closers:
            return None
        if draft.protected(place) or not all(place in draft.moves[n].flips for n in (*openers, *closers)):
            return None
        around = cls(draft, facts, place, openers, closers)
        longest = max(m.length for m in around.openers.values()) + max(m.length for m in around.closers.values())
        return around if longest <= LENGTH_MAX else None

    def others(self, one: Literal) -> Iterator[Move]:
        """The moves, neither openers nor closers, that need a literal and may be made while the place is away."""
        for number in self.draft.at[one]:
            self.left -= 1
            if number in self.openers or number in self.closers:
                continue
            move = self.draft.moves[number]
            if self.left < 0 or not any(map(self.excluded, move.literals)):
                yield move

    def flipped(self, moves: Iterable[Move]) -> Iterator[Literal]:
        """The literals of other places that these moves make false."""
        return (one ^ 1 for move in moves for one in move.made if one // 2 != self.place)

    def wanted(self, one: Literal) -> bool:
        """Whether a goal that is no deadlock, or a label along a run, may become true by a literal."""
        matters = isinstance(self.draft.goal, Labels) or not self.draft.deadlock
        return matters and one in self.draft.goal_literals

    def closers_early(self) -> bool:
        """Whether each closer can be made as soon as the place is away, and is missed by nobody."""
        if self.branching and len(self.closers) > 1:
            return False
        for move in self.closers.values():
            for one in move.literals:
                if one // 2 != self.place and not self.excluded(one ^ 1):
                    return False
        return not any(
            self.wanted(lost) or any(True for _ in self.others(lost)) for lost in self.flipped(self.closers.values())
        )

    def openers_late(self) -> bool:
        """Whether each opener can be made as late as just before a closer."""
        if self.branching and len(self.openers) > 1:
            return False
        for lost in self.flipped(self.openers.values()):
            if self.wanted(lost ^ 1) or any(True for _ in self.others(lost ^ 1)):
                return False
        for move in self.openers.values():
            for place in move.reads:
                if any(place in other.flips for other in self.others(literal(place, move.needs[place]))):
                    return False
        return not self.draft.deadlock or self._without_competition()

    def _without_competition(self) -> bool:
        """What late openers must fulfil for deadlocks besides."""
        for number, move in self.openers.items():
            for lost in self.flipped((move,)):
                if self.draft.at[lost] - self.closers.keys() != {number} or self.draft.protected(lost // 2):
                    return False
                if len(self.openers) > 1 and any(lost // 2 in closer.needs for closer in self.closers.values()):
                    return False
        return True

    def compose(self) -> None:
        """Replace openers and closers by what they compose to, and drop the place."""
        for number in (*self.openers, *self.closers):
            self.draft.remove(number)
        for first, then in product(self.openers.values(), self.closers.values()):
            if (move := composed(first, then)) is not None:
                self.draft.add(move.without((self.place,)))
        self.draft.drop(self.place)
