"""Arbitration: choosing, among enabled transitions, a maximal set without conflict.

One arbiter decides a whole conflict component as one group: it goes through the component in its order of preference
and grants every enabled transition that conflicts with none granted before, so that the granted set is always maximal.
The paper's alternative, an arbiter for each place, loses maximality on chains and fires nothing on cycles;
`per_place_choice` is that design, kept to show it.

Three rules give the order of preference:

- *priority*: always the order of `among`. A live transition can starve under it, which is a verdict of its own.
- *rotation*: the order of `among`, turned so that who has won an input conflict stands last.
- *order*: a specified sequence that may name a transition more than once (`[G6, G6, G2]`: twice G6 for once G2), read
  on from behind the entry that has won an input conflict. Rotation is the case in which each is named once.

A transition wins an input conflict when it is granted while an enabled one that shares an input with it is not, and
that one loses it. Where several win in one step, the sequence goes on behind those of them that stand before the first
who loses, so that nobody who loses is passed over. Going on behind the last of them was rejected: of `[t, u, v]`, where
t beats u whenever v beats another, u would never have its turn.

Transitions of a component that its arbiter does not name come last, in the order of the file, and turn nothing; so does
everything in a component without an arbiter, which is decided by the order of the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cached_property
from typing import Self

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import ArbitrationRule, Net
from firable.semantics.conflict import Conflicts, conflicts
from firable.semantics.player import FiringSet

Turns = tuple[int, ...]
"""For each group, where in its sequence the next preference begins: all that arbitration remembers."""


@dataclass(frozen=True)
class Group:
    """One conflict component and the rule that decides it, by the indexes of transitions."""

    name: str
    sequence: tuple[int, ...]
    rest: tuple[int, ...]
    by: ArbitrationRule

    def preference(self, members: Iterable[int], turn: int) -> list[int]:
        """Some of the members in order of preference; the cost does not depend on how many others there are."""
        length = len(self.sequence)

        def rank(t: int) -> int:
            places = self._places[t]
            return places[0] if places[0] >= length else min((place - turn) % length for place in places)

        return sorted(members, key=rank)

    @cached_property
    def _places(self) -> Mapping[int, tuple[int, ...]]:
        """Where each member stands in the sequence, or behind all of it."""
        places: dict[int, tuple[int, ...]] = {}
        for at, t in enumerate(self.sequence):
            places[t] = (*places.get(t, ()), at)
        for at, t in enumerate(self.rest, start=len(self.sequence)):
            places.setdefault(t, (at,))
        return places

    def turn_after(self, winners: AbstractSet[int], losers: AbstractSet[int], turn: int) -> int:
        """The turn after these won and those lost an input conflict, all in one step."""
        if self.by is ArbitrationRule.PRIORITY:
            return turn
        after, length, served = turn, len(self.sequence), set[int]()
        for place in range(turn, turn + length):
            t = self.sequence[place % length]
            if t in losers or t in served:  # its turn is still to come
                break
            if t in winners:
                served.add(t)
                after = (place + 1) % length
        return after


@dataclass(frozen=True)
class Arbitration:
    """The arbiters of a net: one group for each conflict component."""

    conflicts: Conflicts
    groups: tuple[Group, ...]

    @classmethod
    def of(cls, net: Net) -> Self:
        """The groups of a net, by its `arbiters` and the order of its file.

        Raises `InputError` (F2013) where an arbiter reaches over several components, or two share one.
        """
        relation = conflicts(net)
        index = net.transition_index
        named: dict[int, tuple[str, tuple[int, ...], ArbitrationRule]] = {}
        problems = []
        for arbiter in net.arbiters:
            among = tuple(index[name] for name in arbiter.among)
            reached = sorted({relation.component_of[t] for t in among})
            if len(reached) > 1 or reached == [-1]:
                lonely = [
                    net.transitions[t].name
                    for t in among
                    if relation.component_of[t] != relation.component_of[among[0]]
                ]
                problems.append(
                    Diagnostic(
                        "F2013",
                        f"'{arbiter.name}' decides among transitions that are not in conflict with each other",
                        f"leave out {', '.join(lonely or arbiter.among)}, or check the arcs",
                        ("arbiters", arbiter.name, "among"),
                    )
                )
            elif reached[0] in named:
                problems.append(
                    Diagnostic(
                        "F2013",
                        f"'{arbiter.name}' and '{named[reached[0]][0]}' decide the same conflict component",
                        "write one arbiter for both: conflicts pass on from one to the other",
                        ("arbiters", arbiter.name),
                    )
                )
            else:
                named[reached[0]] = (arbiter.name, among, arbiter.by)
        if problems:
            raise InputError(problems)
        groups = []
        for c, members in enumerate(relation.components):
            name, sequence, by = named.get(c) or (_unnamed(net, c), (), ArbitrationRule.PRIORITY)
            first = set(sequence)
            rest = tuple(t for t in members if t not in first)
            groups.append(Group(name, sequence, rest, by))
        return cls(relation, tuple(groups))

    @property
    def first_turns(self) -> Turns:
        """The turns before anything was decided."""
        return (0,) * len(self.groups)

    @cached_property
    def _group_of(self) -> Mapping[int, int]:
        return {t: g for g, group in enumerate(self.groups) for t in (*group.sequence, *group.rest)}

    def decide(self, enabled: Iterable[int], turns: Turns) -> tuple[FiringSet, Turns]:
        """The granted transitions, a maximal set without conflict of the enabled ones, and the turns after it."""
        competing: dict[int, set[int]] = {}
        granted: set[int] = set()
        for t in enabled:
            if self.conflicts.component_of[t] < 0:
                granted.add(t)
            elif (g := self._group_of.get(t)) is not None:
                competing.setdefault(g, set()).add(t)
        after = list(turns)
        for g, candidates in competing.items():
            won = self.conflicts.maximal(self.groups[g].preference(candidates, turns[g]))
            after[g] = self.turn_after(g, won, candidates, turns[g])
            granted |= won
        return tuple(sorted(granted)), tuple(after)

    def turn_after(self, g: int, fired: AbstractSet[int], enabled: AbstractSet[int], turn: int) -> int:
        """The turn of group `g` after these of its enabled transitions have fired together."""
        group, rivals = self.groups[g], self.conflicts.input_rivals
        passed = enabled - fired
        if not passed or group.by is ArbitrationRule.PRIORITY:
            return turn
        winners, losers = set[int](), set[int]()
        for t in fired:
            if beaten := rivals[t] & passed:
                winners.add(t)
                losers |= beaten
        return group.turn_after(winners, losers, turn)


def per_place_choice(orders: Mapping[str, Sequence[int]], enabled: Iterable[int]) -> FiringSet:
    """What fires where every place has an arbiter of its own: the design that SEMANTICS rejects.

    `orders` gives for each place the priority of the transitions at it. A transition fires if it is first among the
    enabled ones at every place that lists it; on a cycle of preferences none is.
    """
    candidates = frozenset(enabled)
    winners = {place: next((t for t in order if t in candidates), None) for place, order in orders.items()}
    return tuple(
        t for t in sorted(candidates) if all(winners[place] == t for place, order in orders.items() if t in order)
    )


def _unnamed(net: Net, component: int) -> str:
    """What a component without an arbiter is called; no arbiter of the net may be called so."""
    name, taken = f"conflict-{component + 1}", {arbiter.name for arbiter in net.arbiters}
    while name in taken:
        name = f"conflict-{name}"
    return name
