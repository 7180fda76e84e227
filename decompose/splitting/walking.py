"""Yes votes that are taken back, met on a long walk and told by short runs: for nets with very many parts.

A line of a thousand machines has thousands of parts that are not persistent, each for a reason of its own machine. To
ask for each of them anew is slow, however quickly it is answered. So one walk at random goes through the net and looks
out for all of them at once: how many conditions of each transition, and of each pair of a vote and a transition that
could falsify it, are not met yet is counted, and a firing changes the counts at the places it changes only. A step
costs what stands at these places, whatever the size of the net.

A walk of a hundred thousand firings is no explanation. From a marking where a vote falls the walk is gone through
backwards, and only those firings are kept that wrote to a place which matters: at first those of the vote and of the
transition that takes it back, then also all places of the firings kept. What is left out touched none of these, so what
is kept can be fired by itself, and ends with the same tokens there (a backward slice, as of programs: Weiser 1981). In
a plant of loosely coupled machines a few firings remain. The reference player replays them before anyone sees them.

What the walk does not meet stays open, for techniques that can also say no.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from heapq import heappop, heappush
from random import Random
from typing import Final

from firable.analysis.deadline import Deadline
from firable.decompose.splitting.votes import Vote, needs
from firable.nets.net import Net

STEPS_MAX: Final = 1_000_000
WITHOUT_NEWS_MAX: Final = 60_000
"""How many steps may go by without a new vote that falls."""
RUN_MAX: Final = 200
"""The longest run that is told; what needs a longer one stays open."""
_TRIES_MAX: Final = 10  # for a run that is short enough
_SEED: Final = 1
_CLOCK_STEPS: Final = 200

Met = dict[str, dict[str, tuple[int, ...]]]
"""For each part that is not persistent, for each transition met that falsifies it, the transitions fired before."""


def fallen(net: Net, votes: Sequence[Vote], deadline: Deadline) -> Met:
    """What a walk meets of the falsifiers of these votes, each with a firing sequence from M0 to where it is firable.

    The same for the same net, but for the deadline.
    """
    walk = _Walk(net, votes, deadline)
    while walk.open and walk.goes_on():
        walk.go(_CLOCK_STEPS)
    return walk.met


class _Walk:
    """A walk at random from M0, again and again, and the pairs that it looks out for.

    Watched are the transitions, by their indexes, and after them the pairs of a vote and a falsifier.
    """

    def __init__(self, net: Net, votes: Sequence[Vote], deadline: Deadline) -> None:
        self.net, self.deadline, self.random = net, deadline, Random(_SEED)
        required = [needs(t) for t in net.transitions]
        self.pairs = [(vote.part, name) for vote in votes for name in vote.falsifiers]
        wanted = list(required)
        for vote in votes:
            for name in vote.falsifiers:
                full, empty = required[net.transition_index[name]]
                wanted.append((vote.full | full, vote.empty | empty))
        index = net.place_index
        self.watchers: list[list[tuple[int, bool]]] = [[] for _ in net.places]
        for i, (full, empty) in enumerate(wanted):
            for places, value in ((full, True), (empty, False)):
                for place in places:
                    self.watchers[index[place]].append((i, value))
        self.places = [[index[place] for place in (*full, *empty)] for full, empty in wanted]
        self.never = {t for t, transition in enumerate(net.transitions) if not transition.openable}
        self.writes = [
            [*((index[p], False) for p in t.inputs), *((index[p], True) for p in t.outputs)] for t in net.transitions
        ]
        self.open = set(range(len(self.pairs)))
        self.met: Met = {}
        self.tries: dict[int, int] = {}
        self.steps = self.news = 0
        self._start()

    def _start(self) -> None:
        """Begin at M0."""
        n = len(self.net.transitions)
        self.holds = [place.marked for place in self.net.places]
        self.missing = [0] * len(self.places)
        for place, watching in enumerate(self.watchers):
            for i, value in watching:
                self.missing[i] += self.holds[place] is not value
        self.firable = [t for t in range(n) if not self.missing[t] and t not in self.never]
        self.at = {t: i for i, t in enumerate(self.firable)}
        self.fired: list[int] = []
        self.writers: dict[int, list[int]] = {}
        self._meet(i for i in range(n, len(self.missing)) if not self.missing[i])

    def goes_on(self) -> bool:
        return not self.deadline.over and self.steps < STEPS_MAX and self.steps - self.news < WITHOUT_NEWS_MAX

    def go(self, steps: int) -> None:
        """Fire so many transitions, and begin anew at each deadlock."""
        for _ in range(steps):
            if not self.firable:
                self._start()
                if not self.firable:
                    self.steps = STEPS_MAX
                    return
            self._fire(self.firable[self.random.randrange(len(self.firable))])
            self.steps += 1

    def _fire(self, t: int) -> None:
        n, met = len(self.net.transitions), []
        for place, value in self.writes[t]:
            self.holds[place] = value
            self.writers.setdefault(place, []).append(len(self.fired))
            for i, wanted in self.watchers[place]:
                if wanted is value:
                    self.missing[i] -= 1
                    if not self.missing[i]:
                        met.append(i)
                else:
                    self.missing[i] += 1
                    if self.missing[i] == 1 and i < n:
                        self._out(i)
        self.fired.append(t)
        for i in met:  # some are missing something again, through a later place of the same firing
            if i < n and not self.missing[i]:
                self._in(i)
        self._meet(i for i in met if i >= n and not self.missing[i])

    def _in(self, t: int) -> None:
        if t not in self.at and t not in self.never:
            self.at[t] = len(self.firable)
            self.firable.append(t)

    def _out(self, t: int) -> None:
        if (i := self.at.pop(t, None)) is not None:
            last = self.firable.pop()
            if last != t:
                self.firable[i] = last
                self.at[last] = i

    def _meet(self, watched: Iterable[int]) -> None:
        """Note pairs that are met here, with the part of the walk that leads to them."""
        n = len(self.net.transitions)
        for i in watched:
            if i - n not in self.open or self.deadline.over:
                continue
            part, name = self.pairs[i - n]
            if (run := self._run_to(i)) is not None:
                self.open.discard(i - n)
                self.met.setdefault(part, {})[name] = run
                self.news = self.steps
            elif self.tries.setdefault(i - n, 1) >= _TRIES_MAX:
                self.open.discard(i - n)
            else:
                self.tries[i - n] += 1

    def _run_to(self, watched: int) -> tuple[int, ...] | None:
        """The firings of the walk that matter for what is watched; None where they are too many."""
        kept: dict[int, None] = {}
        position: dict[int, int] = {}
        heap: list[int] = []

        def need(places: Iterable[int], before: int) -> None:
            """The last writer of each of these places before a step matters."""
            for place in places:
                writers = self.writers.get(place, [])
                i = position.get(place, len(writers) - 1)
                while i >= 0 and writers[i] >= before:
                    i -= 1
                position[place] = i
                if i >= 0:
                    heappush(heap, -writers[i])

        need(self.places[watched], len(self.fired))
        while heap:
            step = -heappop(heap)  # the latest first, so that no place is ever needed later than it was before
            if step not in kept:
                kept[step] = None
                if len(kept) > RUN_MAX:
                    return None
                need(self.places[self.fired[step]], step)
        return tuple(self.fired[step] for step in reversed(kept))
