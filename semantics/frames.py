"""A run as frames, for pictures: what each step fires, and the marking before and after it.

The reference player fires every step once more, so no picture shows a run that the net cannot make. Rejected: markings
handed over by who found the run. A wrong run would be drawn as it is told.
"""

from __future__ import annotations

from collections.abc import Iterable

from firable.nets.drawing.strip import Frame
from firable.nets.net import Marking, Net
from firable.semantics.player import Player


def frames(net: Net, firings: Iterable[Iterable[str]], start: Marking | None = None) -> list[Frame]:
    """The steps of a run from M0 or, where one is given, from another `start`.

    Raises `NotFirableError`, or `KeyError` for a name that the net does not know.

    >>> from firable.nets.catalogue import catalogue_net
    >>> [frame.fired for frame in frames(catalogue_net("conceptual_one_robot"), [["t1"], ["t2"]])]
    [('t1',), ('t2',)]
    """
    player, marking = Player(net), net.initial_marking if start is None else start
    found: list[Frame] = []
    for number, fired in enumerate(firings, start=1):
        names = tuple(fired)
        after = player.fire(marking, [net.transition_index[name] for name in names])
        found.append(Frame(number, names, marking, after))
        marking = after
    return found
