"""Proposing owners: so many controllers, few global transitions between them, and why it came out like this.

A proposal is a partition of what can be divided (`hypergraph`, `partitioning`) with names: a controller is named after
the machines that it commands, since that is how an engineer knows it. What was found is told beside what bounds it: no
partition cuts fewer than the net needs to hang together, and giving each block its own controller cuts every transition
that can be cut; and beside the owners that the file gives, where it gives them.

A few global transitions are not all that ownership is for: a controller is also where it stands, who maintains it and
what still moves when another one is off. So it proposes, and decides nothing.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from firable.analysis.deadline import Deadline
from firable.decompose.splitting.hypergraph import Hypergraph, hypergraph
from firable.decompose.splitting.partitioning import partition
from firable.nets.net import Controller, Net
from firable.nets.owning import with_owners, with_those_named

SLACK: Final = 0.6
_MACHINES_MAX: Final = 3  # in the name of a controller
_NAME: Final = re.compile(r"[a-z][a-z0-9_-]*")


@dataclass(frozen=True, slots=True)
class Ownership:
    """How an ownership cuts a net: the transitions that become global, the votes on them, and how much each owns."""

    n_cut: int
    votes: int
    sizes: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A net with proposed owners, and what the proposal is to be compared with.

    `cut` names each transition that becomes global, with the controllers that it joins. No ownership by so many cuts
    fewer than `fewest`, none at all more than `most`; `given` is that of the file, None where it is not complete. Sizes
    are places and signals; each lies within `bounds`. `optimal`: within them no ownership cuts fewer transitions.
    """

    net: Net
    method: str
    optimal: bool
    cut: tuple[tuple[str, tuple[str, ...]], ...]
    proposed: Ownership
    given: Ownership | None
    bounds: tuple[int, int]
    fewest: int
    most: int

    def to_json(self) -> dict[str, Any]:
        """The suggestion without its net, as JSON data."""
        return {
            "method": self.method,
            "optimal": self.optimal,
            "cut": [{"transition": name, "controllers": list(joined)} for name, joined in self.cut],
            "proposed": _ownership_json(self.proposed),
            "given": None if self.given is None else _ownership_json(self.given),
            "smallest_allowed": self.bounds[0],
            "largest_allowed": self.bounds[1],
            "fewest": self.fewest,
            "most": self.most,
        }


def _ownership_json(of: Ownership) -> dict[str, Any]:
    return {"cut": of.n_cut, "votes": of.votes, "sizes": dict(of.sizes)}


def suggest(net: Net, n_controllers: int, *, slack: float = SLACK, deadline: Deadline | None = None) -> Suggestion:
    """Propose owners for a net: so many controllers, whose sizes differ from the average by `slack` at most.

    Raises `InputError` F4004 where none are found; `ModuleNotFoundError` for a large net without the extra `split`.

    >>> from firable.nets.catalogue import catalogue_net
    >>> found = suggest(catalogue_net("one_robot"), 4)
    >>> found.proposed.n_cut, found.given.n_cut, found.optimal
    (7, 9, True)
    """
    graph = hypergraph(net)
    found = partition(graph, n_controllers, slack, deadline or Deadline.after(20))
    names = _named(net, graph, found.partition, n_controllers)
    owner_of = {name: names[part] for block, part in zip(graph.blocks, found.partition, strict=True) for name in block}
    cut = set(graph.cut(found.partition))
    return Suggestion(
        with_owners(net, owner_of, with_those_named(net, map(Controller, names))),
        found.method,
        found.optimal,
        tuple(
            (name, tuple(names[part] for part in sorted({found.partition[block] for block in edge})))
            for name, edge in zip(graph.transitions, graph.edges, strict=True)
            if name in cut
        ),
        _ownership(graph, found.partition, names),
        _given(net, graph),
        graph.bounds(n_controllers, slack),
        graph.fewest(n_controllers),
        len(graph.edges),
    )


def _ownership(graph: Hypergraph, of: Sequence[int], names: Sequence[str]) -> Ownership:
    sizes = zip(names, graph.sizes(of, len(names)), strict=True)
    return Ownership(len(graph.cut(of)), graph.votes(of), tuple(sizes))


def _given(net: Net, graph: Hypergraph) -> Ownership | None:
    """The ownership of the file, in the same measure; None where something has no owner, or a block has two."""
    owner: dict[str, str | None] = {place.name: place.owner for place in net.places}
    owner |= {signal.name: signal.owner for signal in net.signals}
    names = [controller.name for controller in net.controllers]
    of = []
    for block in graph.blocks:
        owners = {owner[name] for name in block}
        first = next(iter(owners))
        if len(owners) > 1 or first is None:
            return None
        of.append(names.index(first))
    return _ownership(graph, of, names)


def _named(net: Net, graph: Hypergraph, of: Sequence[int], n_parts: int) -> list[str]:
    """The names of the parts: after the few machines they command, else by their number."""
    machine = {place.name: place.command.machine.lower() for place in net.places if place.command is not None}
    machines: list[dict[str, None]] = [{} for _ in range(n_parts)]
    for block, part in zip(graph.blocks, of, strict=True):
        machines[part].update(dict.fromkeys(machine[name] for name in block if name in machine))
    names: list[str] = []
    for number, commanded in enumerate(machines, start=1):
        name = "_".join(commanded)
        usable = 0 < len(commanded) <= _MACHINES_MAX and _NAME.fullmatch(name) and name not in names
        names.append(name if usable else f"controller{number}")
    return names
