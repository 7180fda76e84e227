"""Conflict: transitions that may not fire together, and the components that one arbiter decides.

Two transitions conflict structurally if they share an input **or** an output place; the paper names inputs only, and
its Eq. (4) alone would merge two tokens on a shared output into one. A conflict component is a class of the closure of
this relation; an arbiter acts on a whole component, because one arbiter for each place loses maximality on chains
and fires nothing on cycles (SEMANTICS, "Arbitration").
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from firable.nets.net import Net


@dataclass(frozen=True, slots=True)
class Conflicts:
    """The conflict relation of a net, by the indexes of transitions.

    `rivals[t]` are the transitions in structural conflict with `t`, `input_rivals[t]` those that share an input;
    `components` are the classes with at least two members, each in the order of the net; `component_of[t]` is the index
    of the component of `t`, or -1 for a transition that conflicts with none.
    """

    rivals: tuple[frozenset[int], ...]
    input_rivals: tuple[frozenset[int], ...]
    components: tuple[tuple[int, ...], ...]
    component_of: tuple[int, ...]

    def free(self, transitions: Iterable[int]) -> bool:
        """Whether no two of the transitions conflict."""
        chosen = set(transitions)
        return all(not self.rivals[t] & chosen for t in chosen)


def conflicts(net: Net) -> Conflicts:
    """The structural conflict relation; time linear in the net plus the number of conflicting pairs."""
    input_rivals = _sharing(net.consumers, len(net.transitions))
    output_rivals = _sharing(net.producers, len(net.transitions))
    rivals = tuple(frozenset(a | b) for a, b in zip(input_rivals, output_rivals, strict=True))
    component_of = [-1] * len(rivals)
    components: list[tuple[int, ...]] = []
    for start in range(len(rivals)):
        if component_of[start] >= 0 or not rivals[start]:
            continue
        members, todo = {start}, [start]
        while todo:
            for t in rivals[todo.pop()] - members:
                members.add(t)
                todo.append(t)
        for t in members:
            component_of[t] = len(components)
        components.append(tuple(sorted(members)))
    return Conflicts(rivals, tuple(map(frozenset, input_rivals)), tuple(components), tuple(component_of))


def _sharing(adjacent: tuple[tuple[int, ...], ...], n_transitions: int) -> list[set[int]]:
    """For each transition, the others that stand with it at one place."""
    found: list[set[int]] = [set() for _ in range(n_transitions)]
    for together in adjacent:
        if len(together) > 1:
            for t in together:
                found[t].update(together)
    for t, others in enumerate(found):
        others.discard(t)
    return found


def structural_conflicts(net: Net) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """The pairs `t < u` that share an input, and the pairs that share an output."""
    pairs = []
    for adjacent in (net.consumers, net.producers):
        sharing = _sharing(adjacent, len(net.transitions))
        pairs.append(tuple((t, u) for t, others in enumerate(sharing) for u in sorted(others) if t < u))
    return pairs[0], pairs[1]


def jointly_openable(net: Net, transitions: Iterable[int]) -> bool:
    """Whether one valuation of the signals opens the external gates of all these transitions."""
    wanted: dict[str, bool] = {}
    for t in transitions:
        for gate in net.transitions[t].external:
            if wanted.setdefault(gate.signal, gate.wanted) != gate.wanted:
                return False
    return True


def gate_races(net: Net) -> Iterator[tuple[int, int]]:
    """The pairs (t, u), t and u different, where firing t closes an internal gate of u.

    That is, I(t) meets Gp(u) or O(t) meets Gi(u). In a step that holds both, u must be replayed before t.
    """
    permissive, inhibitive = _gated(net)
    for t in range(len(net.transitions)):
        transition = net.transitions[t]
        closed = {u for place in transition.inputs for u in permissive.get(place, ())}
        closed |= {u for place in transition.outputs for u in inhibitive.get(place, ())}
        yield from ((t, u) for u in sorted(closed - {t}))


def _gated(net: Net) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
    permissive: dict[str, list[int]] = {}
    inhibitive: dict[str, list[int]] = {}
    for u, transition in enumerate(net.transitions):
        for place in transition.permissive:
            permissive.setdefault(place, []).append(u)
        for place in transition.inhibitive:
            inhibitive.setdefault(place, []).append(u)
    return permissive, inhibitive
