"""Progress: what shows that an answer comes in every fair run, from ranks that need no run to be looked at.

Each marking in which the answer is still due has a rank, a sequence of numbers compared from the left. No firing raises
it, the answer ends the wait, and the wait never stands in a deadlock. A beginning of a rank may name a *helpful*
transition (Manna and Pnueli 1984, "Adequate proof principles for invariance and liveness properties"; Lehmann, Pnueli,
Stavi 1981 for strong fairness):

    a firing that keeps the first number of the rank is no firing of its helpful transition t, and
    weak      t is enabled in every marking of this rank
    strong    t is enabled before or after the firing, or the rest of the rank says the same of it, number by number

A run that waits for ever comes to a first number that stays. Then t does not fire any more. Under weak fairness it
would have to, since it stays enabled. Under strong fairness it may only be enabled so often, and once it is not any
more, the rest of the rank decides, which is shorter. Without fairness there is nothing helpful, and every firing
lowers the rank. Enabled means firable and openable, as in the verdict: external gates do open.

Many ranks would show the same. So that no edit of one goes unnoticed, they have to be *tight*: only what waits has one,
the numbers that follow a beginning are 0, 1, 2 without a gap, they go on only where strong fairness needs more, and the
helpful transition is the first that will do, named only where a firing keeps the rank.
"""

from __future__ import annotations

from firable.analysis.evidence.certificate import Progress
from firable.analysis.evidence.checking.listed import Listed
from firable.analysis.evidence.claims import Claim
from firable.analysis.evidence.refusal import refuse, shown
from firable.nets.net import Fairness
from firable.semantics.player import FiringSet

Rank = tuple[int, ...]


def check_progress(space: Listed, claim: Claim, of: Progress) -> None:
    """Refuse ranks that do not show the response."""
    if len(of.ranks) != len(space.markings):
        refuse("there are not as many ranks as markings")
    if of.helpful and claim.fairness is Fairness.NONE:
        refuse("without fairness no transition helps")
    waiting = _Waiting(space, claim, of)
    waiting.check()
    waiting.check_tight()


class _Waiting:
    """The markings that wait for an answer."""

    def __init__(self, space: Listed, claim: Claim, of: Progress) -> None:
        self.space, self.fairness, self.ranks = space, claim.fairness, of.ranks
        self.asked, self.answered = space.where(claim.state_goal), space.where(claim.then)
        self.helpful = {prefix: space.net.transition_index[name] for prefix, name in of.helpful}
        self.enabled = [frozenset(t for fired, _ in firings for t in fired) for firings in space.edges]
        if [prefix for prefix, _ in of.helpful] != sorted(self.helpful):
            refuse("the ranks that a transition helps are not in order")

    def check(self) -> None:
        """Refuse ranks that break a condition."""
        for i, rank in enumerate(self.ranks):
            if self.answered[i]:
                continue
            here = self._shown(i)
            if not rank:
                if self.asked[i]:
                    refuse(f"an answer is due in {here}, which has no rank")
                continue
            if not self.space.edges[i]:
                refuse(f"the wait ends in the deadlock {here}")
            t = self.helpful.get(rank[:1])
            if self.fairness is Fairness.WEAK and t is not None and t not in self.enabled[i]:
                refuse(f"{self.space.net.transitions[t].name} is to help in {here}, where it is not enabled")
            for fired, after in self.space.edges[i]:
                if not self.answered[after] and not self._nearer(i, fired, after):
                    refuse(f"a firing comes no nearer to the answer in {here}")

    def _nearer(self, i: int, fired: FiringSet, after: int) -> bool:
        before, then = self.ranks[i], self.ranks[after]
        for k, (high, low) in enumerate(zip(before, then, strict=False)):
            if low != high:
                return low < high
            t = self.helpful.get(before[: k + 1])
            if t is None or t in fired:
                return False
            if t in self.enabled[i] or t in self.enabled[after]:
                return True
        return False

    def check_tight(self) -> None:
        """Refuse ranks that say more than they must."""
        reached, members = self._reached(), dict[Rank, list[int]]()
        for i, rank in enumerate(self.ranks):
            if rank and (self.answered[i] or not (self.asked[i] or i in reached)):
                refuse(f"no answer is due in {self._shown(i)}, which has a rank")
            for k in range(len(rank)):
                members.setdefault(rank[: k + 1], []).append(i)
                if (k + 1 < len(rank)) is not self._goes_on(i, rank[: k + 1]):
                    refuse(f"the rank of {self._shown(i)} is longer or shorter than it has to be")
        for rank in members:
            if rank[-1] and (*rank[:-1], rank[-1] - 1) not in members:
                refuse(f"there is a gap in the ranks before {', '.join(map(str, rank))}")
        for rank in self.helpful.keys() | members.keys():
            if self.helpful.get(rank) != self._first_that_helps(rank, members.get(rank, [])):
                refuse(f"another transition is the first to help in the rank {', '.join(map(str, rank))}, or none does")

    def _shown(self, i: int) -> str:
        return shown(self.space.net, self.space.markings[i])

    def _reached(self) -> frozenset[int]:
        """The markings that another one with a rank leads to."""
        ranked = (i for i, rank in enumerate(self.ranks) if rank)
        return frozenset(after for i in ranked for _, after in self.space.edges[i] if after != i)

    def _goes_on(self, i: int, rank: Rank) -> bool:
        t = self.helpful.get(rank)
        return self.fairness is Fairness.STRONG and t is not None and t not in self.enabled[i]

    def _first_that_helps(self, rank: Rank, members: list[int]) -> int | None:
        """Of the transitions that fairness makes fire among these markings, and that never do, the first of the net."""
        k = len(rank)
        kept = [fired for i in members for fired, after in self.space.edges[i] if self.ranks[after][:k] == rank]
        if not kept:
            return None
        enabled = [self.enabled[i] for i in members]
        owed = frozenset.intersection(*enabled) if self.fairness is Fairness.WEAK else frozenset.union(*enabled)
        return min(owed.difference(*kept), default=None)
