"""Conflict: transitions that may not fire together, and the components that one arbiter decides.

Two transitions conflict structurally if they share an input **or** an output place; the paper names inputs only, and
its Eq. (4) alone would merge two tokens on a shared output into one. A conflict component is a class of the closure of
this relation; an arbiter acts on a whole component, because one arbiter for each place loses maximality on chains
and fires nothing on cycles (SEMANTICS, "Arbitration").

A fault transition (`firable.nets.time_limits`) wants a completion 0 that all others at its place want 1. It shares the
place with them, and no valuation opens it beside one of them: so it is their rival, but not of their component, for
there is nothing to decide. (Of other transitions with complementary gates that is not said: their signals may belong
to several controllers, and be read at several instants.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from itertools import islice
from typing import Final, overload

from firable.nets.net import Net

PAIRS_MAX: Final = 20_000
"""How many conflicting pairs are listed: a place with 10,000 consumers has 50 million, which nobody reads."""


_KEPT_MAX: Final = 64  # sets up to this size are kept: players ask for the same ones at every firing


class Sharing(Sequence[frozenset[int]]):
    """For each transition, the others that stand with it at one place; worked out when asked for, not held.

    A place with n consumers makes n (n - 1) pairs, so that all the sets together may be quadratic in the net.
    """

    def __init__(self, n_transitions: int, *tables: tuple[tuple[int, ...], ...]) -> None:
        self._together: list[list[tuple[int, ...]]] = [[] for _ in range(n_transitions)]
        self._small: dict[int, frozenset[int]] = {}
        for table in tables:
            for together in table:
                if len(together) > 1:
                    for t in together:
                        self._together[t].append(together)

    def __len__(self) -> int:
        return len(self._together)

    @overload
    def __getitem__(self, t: int) -> frozenset[int]: ...

    @overload
    def __getitem__(self, t: slice) -> list[frozenset[int]]: ...

    def __getitem__(self, t: int | slice) -> frozenset[int] | list[frozenset[int]]:
        if isinstance(t, slice):
            return [self[u] for u in range(*t.indices(len(self)))]
        if (known := self._small.get(t)) is not None:
            return known
        together = self._together[t]
        others = frozenset[int]().union(*together) - {t}
        if len(others) <= _KEPT_MAX:
            self._small[t] = others
        return others

    def groups(self, t: int) -> Sequence[tuple[int, ...]]:
        """The transitions at each shared place of `t`, itself among them."""
        return self._together[t]

    def pairs(self) -> Iterator[tuple[int, int]]:
        """The pairs `t < u` that share a place, in order, found as they are asked for."""
        for t, groups in enumerate(self._together):
            if groups:
                yield from ((t, u) for u in sorted({u for group in groups for u in group if u > t}))


@dataclass(frozen=True, slots=True)
class Conflicts:
    """The conflict relation of a net, by the indexes of transitions.

    `rivals[t]` are the transitions in structural conflict with `t`, `input_rivals[t]` those that share an input;
    `components` are the classes of those who compete, with at least two members, each in the order of the net;
    `component_of[t]` is the index of the component of `t`, or -1 for a transition that competes with none.
    """

    rivals: Sharing
    input_rivals: Sharing
    components: tuple[tuple[int, ...], ...]
    component_of: tuple[int, ...]

    def free(self, transitions: Iterable[int]) -> bool:
        """Whether no two of the transitions conflict."""
        chosen = set(transitions)
        return len(self.maximal(chosen)) == len(chosen)

    def maximal(self, preference: Iterable[int]) -> AbstractSet[int]:
        """The transitions granted in this order, each that conflicts with none before; in time linear in their arcs."""
        granted: set[int] = set()
        taken: set[int] = set()
        for t in preference:
            # A shared place is known by the tuple of those who stand at it, one tuple for all of them.
            groups = [id(group) for group in self.rivals.groups(t)]
            if taken.isdisjoint(groups):
                granted.add(t)
                taken.update(groups)
        return granted


def conflicts(net: Net) -> Conflicts:
    """The structural conflict relation; time linear in the net."""
    n_transitions = len(net.transitions)
    rivals = Sharing(n_transitions, net.consumers, net.producers)
    competing = Sharing(n_transitions, net.competitors, net.producers)
    component_of = [-1] * n_transitions
    components: list[tuple[int, ...]] = []
    reached: set[int] = set()
    for start in range(n_transitions):
        if component_of[start] >= 0 or not competing.groups(start):
            continue
        members, todo = {start}, [start]
        while todo:
            for group in competing.groups(todo.pop()):
                if id(group) not in reached:  # each shared place is gone through once
                    reached.add(id(group))
                    todo += [t for t in group if t not in members]
                    members.update(group)
        for t in members:
            component_of[t] = len(components)
        components.append(tuple(sorted(members)))
    return Conflicts(rivals, Sharing(n_transitions, net.consumers), tuple(components), tuple(component_of))


@dataclass(frozen=True, slots=True)
class Listed:
    """Pairs of transitions in order; where `more`, only the first `PAIRS_MAX` of them."""

    pairs: tuple[tuple[int, int], ...]
    more: bool


def _listed(pairs: Iterator[tuple[int, int]]) -> Listed:
    first = tuple(islice(pairs, PAIRS_MAX))
    return Listed(first, next(pairs, None) is not None)


def structural_conflicts(net: Net) -> tuple[Listed, Listed]:
    """The pairs `t < u` that share an input, and the pairs that share an output."""
    n_transitions = len(net.transitions)
    by_input, by_output = (Sharing(n_transitions, table).pairs() for table in (net.consumers, net.producers))
    return _listed(by_input), _listed(by_output)


def jointly_openable(net: Net, transitions: Iterable[int]) -> bool:
    """Whether one valuation of the signals opens the external gates of all these transitions."""
    return at_odds(net, transitions) is None


def at_odds(net: Net, transitions: Iterable[int]) -> tuple[int, int, str] | None:
    """Two of these transitions and a signal that the first wants 1 and the second 0; None where all agree."""
    wanted: dict[str, tuple[bool, int]] = {}
    for t in transitions:
        for gate in net.transitions[t].external:
            value, by = wanted.setdefault(gate.signal, (gate.wanted, t))
            if value != gate.wanted:
                return (by, t, gate.signal) if value else (t, by, gate.signal)
    return None


def gate_races(net: Net, among: Iterable[int] | None = None) -> Iterator[tuple[int, int]]:
    """The pairs (t, u), t and u different, where firing t closes an internal gate of u; with `among`, of these only.

    That is, I(t) meets Gp(u) or O(t) meets Gi(u). In a step that holds both, u must be replayed before t.
    """
    considered = range(len(net.transitions)) if among is None else sorted(set(among))
    permissive, inhibitive = _gated(net, considered)
    for t in considered:
        transition = net.transitions[t]
        closed = {u for place in transition.inputs for u in permissive.get(place, ())}
        closed |= {u for place in transition.outputs for u in inhibitive.get(place, ())}
        yield from ((t, u) for u in sorted(closed - {t}))


def listed_races(net: Net) -> Listed:
    """The gate races, as many as are listed."""
    return _listed(gate_races(net))


def _gated(net: Net, considered: Iterable[int]) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
    permissive: dict[str, list[int]] = {}
    inhibitive: dict[str, list[int]] = {}
    for u in considered:
        transition = net.transitions[u]
        for place in transition.permissive:
            permissive.setdefault(place, []).append(u)
        for place in transition.inhibitive:
            inhibitive.setdefault(place, []).append(u)
    return permissive, inhibitive
