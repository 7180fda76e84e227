"""A machine that fails is one that takes longer: what the loop without faults says of the loops in which machines fail.

The net of a loop in which machines fail, F, has all that the net of the loop without faults has, W, and more:

1. Its places are those of W, marked as there, and one more for each machine that may fail, which is empty at first.
2. Each transition of W is in F, with the same arcs and gates, and inhibitive gates of such places besides.
3. All others of F move tokens of such places alone.

Of a run of F, what is left without the transitions of (3) is a run of W, into the same marking but for the places of
(1): their firings change nothing that W has, and the others need no less in F than in W. So what no run of W reaches,
none of F does. An accident that no machine causes that goes on, none causes that has failed.

Where machines are repaired, F has for each place of (1)

4. a transition that takes its token, and needs nothing else but that the run has not ended in an accident.

Then from each marking of F without an accident, once all is repaired, F goes on as W does from there: nothing is left
that (2) could inhibit. So where something can come to happen in W from each marking that it reaches, it can in F.

All four are seen of the nets themselves (`difference`), whatever they were made from.

Rejected: exploring the loops in which machines fail, which have several times the markings and answer the same.
"""

from __future__ import annotations

from firable.nets.machines.loop import ACCIDENT, OVERRUN, ClosedLoop
from firable.nets.net import Net


def difference(well: Net, failing: ClosedLoop, *, repaired: bool) -> str:
    """Where a loop in which machines fail is not as (1) to (3) say of the net without, or (4); else empty.

    >>> from firable.nets.catalogue import catalogue_net, catalogue_plant
    >>> from firable.nets.machines.closing import close
    >>> from firable.nets.machines.loop import Faults
    >>> cell = catalogue_net("one_robot"), catalogue_plant("one_robot")
    >>> difference(close(*cell).net, close(*cell, Faults.REPAIRED), repaired=True)
    ''
    >>> difference(close(*cell).net, close(*cell, Faults.FOR_GOOD), repaired=True)
    "'plant.CV1.failed' is not emptied by a repair"
    """
    failed = frozenset(failing.failed.values())
    places, more = ({place.name: place.marked for place in net.places} for net in (well, failing.net))
    if not failed.isdisjoint(places) or more != places | dict.fromkeys(failed, False):
        return "its places are others, or marked otherwise"
    if well.signals or failing.net.signals:
        return "it waits for signals"
    own, emptied = {t.name: t for t in well.transitions}, set[str]()
    for t in failing.net.transitions:
        if (same := own.pop(t.name, None)) is not None:
            gates = tuple(place for place in t.inhibitive if place not in failed)
            found, wanted = ((one.inputs, one.outputs, one.permissive) for one in (t, same))
            if (found, gates) != (wanted, same.inhibitive):
                return f"'{t.name}' does something else, or needs less"
        elif not failed.issuperset((*t.inputs, *t.outputs)):
            return f"'{t.name}' happens only where a machine fails"
        elif len(t.inputs) == 1 and not (t.outputs or t.permissive) and {*t.inhibitive} <= {ACCIDENT, OVERRUN}:
            emptied.update(t.inputs)
    if own:
        return f"'{next(iter(own))}' cannot happen"
    if left := sorted(failed - emptied) if repaired else []:
        return f"'{left[0]}' is not emptied by a repair"
    return ""
