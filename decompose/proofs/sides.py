"""The two sides of every obligation: the central net, and what the subnets and the table make.

All that is looked up for one obligation is found in time that its own arcs take, so that all of them together are
linear in the net: which part belongs to which transition, which subnet is whose, who competes for a place.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

from firable.analysis.deadline import Deadline
from firable.analysis.induction.smt import Term, Terms
from firable.decompose.splitting.votes import SECONDS, Vote, votes
from firable.nets.decomposition import ArbitrationGroup, Decomposition
from firable.nets.net import Net
from firable.semantics.arbitration import Arbitration, Group

Key = tuple[str, str]
"""A part: its controller, and its name in the subnet of that one."""


class Sides:
    """A decomposition, looked at from both sides."""

    def __init__(self, decomposition: Decomposition, cast: Sequence[Vote] | None = None) -> None:
        self.decomposition = decomposition
        self._cast = cast
        self.net = decomposition.net
        self.subnets = decomposition.subnets
        self.by_name = {subnet.name: subnet for subnet in decomposition.subnets}
        self.parts: dict[str, tuple[Key, ...]] = {
            row.name: tuple((part.controller, part.name) for part in row.parts) for row in decomposition.coordinated
        }
        self.whole: dict[Key, str] = {part: name for name, parts in self.parts.items() for part in parts}
        local: dict[str, list[Key]] = {}
        for subnet in self.subnets:
            for transition in subnet.transitions:
                local.setdefault(transition.name, []).append((subnet.name, transition.name))
        for transition in self.net.transitions:
            if transition.name not in self.parts:  # local, under its own name, wherever it stands
                self.parts[transition.name] = tuple(local.get(transition.name, ()))

    def part(self, key: Key) -> tuple[Net, int] | None:
        """The subnet of a part and its index there, or None where there is no such part."""
        subnet = self.by_name.get(key[0])
        if subnet is None or key[1] not in subnet.transition_index:
            return None
        return subnet, subnet.transition_index[key[1]]

    def whole_of(self, subnet: Net, t: int) -> str:
        """The transition of the central net that a transition of a subnet is a part of, or its own name."""
        name = subnet.transitions[t].name
        return self.whole.get((subnet.name, name), name)

    def of_parts(self, terms: Terms, name: str, value: Callable[[Net, int], Term]) -> Term:
        """The AND over the parts of a transition; a part that is not there, or a transition without any, is false."""
        found = [self.part(key) for key in self.parts[name]]
        return terms.conjunction(value(*part) if part else terms.false for part in found) if found else terms.false

    @cached_property
    def votes(self) -> Sequence[Vote]:
        """The votes on what the coordinator decides, as arcs and units have them; at most so many seconds."""
        return self._cast if self._cast is not None else votes(self.decomposition, Deadline.after(SECONDS))

    @cached_property
    def arbitration(self) -> Arbitration:
        """The arbiters of the central net."""
        return Arbitration.of(self.net)

    @cached_property
    def central_groups(self) -> Mapping[str, Group]:
        """The groups of the central net by name, in order."""
        return {group.name: group for group in self.arbitration.groups}

    @cached_property
    def groups(self) -> Mapping[str, ArbitrationGroup]:
        """The groups of the decomposition by name, in order."""
        return {group.name: group for group in self.decomposition.groups}


def holds(terms: Terms, net: Net) -> Callable[[int], Term]:
    """Each place of a net as the variable of its name: the same in the central net and in the subnets."""
    return lambda p: terms.variable(net.places[p].name)


def signals(terms: Terms, net: Net) -> Callable[[int], Term]:
    """Each signal of a net as the variable of its name."""
    return lambda s: terms.variable(net.signals[s].name)
