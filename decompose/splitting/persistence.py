"""Non-persistent parts: yes votes that another firing can falsify.

The vote of a part is *persistent* if, once true, it stays true until its own transition fires. A vote that is
persistent may be as old as it likes; a stale yes of any other is how the paper's own cell gives its robot a second
task while it carries a part. The test is on the reachable markings of the central net, for structure alone would accuse
parts whose places other transitions touch only when the part is not firable anyway.
"""

from __future__ import annotations

from collections.abc import Sequence

from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking, Net
from firable.semantics.algebra import BOOL
from firable.semantics.firing import firable
from firable.semantics.player import Player


def nonpersistent(decomposition: Decomposition) -> dict[str, list[str]]:
    """The parts of global transitions whose yes can be falsified, each with the transitions that do so.

    External gates are free. Explores the reachable markings of the central net by the reference player: for nets of the
    size of a cell.
    """
    net = decomposition.net
    graph = Player(net).reachable()
    found: dict[str, list[str]] = {}
    for row in decomposition.table:
        own = net.transition_index[row.name]
        for part in row.parts:
            subnet = decomposition.subnet(part.controller)
            t = subnet.transition_index[part.name]
            places = [net.place_index[place.name] for place in subnet.places]
            yes = {marking: _votes_yes(subnet, t, places, marking) for marking in graph}
            against = {
                fired[0]
                for marking, edges in graph.items()
                if yes[marking]
                for fired, after in edges
                if fired[0] != own and not yes[after]
            }
            if against:
                found[part.name] = [net.transitions[u].name for u in sorted(against)]
    return found


def _votes_yes(subnet: Net, t: int, places: Sequence[int], marking: Marking) -> bool:
    """Whether the part is firable in a marking of the central net, where `places` are those of the subnet."""
    return firable(BOOL, subnet, t, lambda p: bool(marking >> places[p] & 1))
