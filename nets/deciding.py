"""Who decides what: the transitions that coordinators decide, and the arbitration groups of a net.

Both follow from the net alone. A conflict component, the closure over what competes for a place, is decided as one
group: by the coordinator where a global transition is in it, else by the controller that has all of it. Its order and
rule are those of its arbiter, and of a component without one the order of the file. So a table that says otherwise is
not one that anything was proved of, and who runs a bundle can tell without a solver.

So it is written here, for those who may import no more than nets, and `firable.decompose.splitting` makes tables of it.
The checker of bundles cuts nets by a text of its own (`firable.decompose.verification.recut`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from firable.nets.contention import decided_together
from firable.nets.decomposition import ArbitrationGroup
from firable.nets.layers import Layers
from firable.nets.net import ArbitrationRule, Net, Transition


def owners(net: Net, transition: Transition) -> set[str | None]:
    """The owners of everything that a transition touches."""
    places = (*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive)
    return {net.place(name).owner for name in places} | {net.signal(g.signal).owner for g in transition.external}


def deciders(net: Net) -> Mapping[str, str | None]:
    """The coordinator of each transition that is not its controller's own, in the order of the net; None is the root.

    >>> from firable.nets.catalogue import catalogue_net
    >>> deciders(catalogue_net("two_cells"))["put_a"]
    'cell_a'
    """
    layers, names = Layers(net), [t.name for t in net.transitions]
    taking_part = {t.name: [one for one in owners(net, t) if one is not None] for t in net.transitions}
    components = [[names[t] for t in members] for members in _components(net)]
    in_conflict = {name for members in components for name in members}
    alone = [[name] for name in names if name not in in_conflict]
    groups = [some for some in (*components, *alone) if any(len(taking_part[name]) > 1 for name in some)]
    decided: dict[str, str | None] = {}
    for some in decided_together(net, groups) if layers.several else groups:
        at = layers.common(owner for name in some for owner in taking_part[name])
        decided |= dict.fromkeys(some, None if at == layers.root else at)
    return {name: decided[name] for name in names if name in decided}


def groups(net: Net, at: Mapping[str, str | None]) -> Iterator[ArbitrationGroup]:
    """The arbitration group of each conflict component; `at` are the `deciders`."""
    taken = {arbiter.name for arbiter in net.arbiters}
    for number, members in enumerate(_components(net), 1):
        names = [net.transitions[t].name for t in members]
        name, sequence, by = f"conflict-{number}", tuple[str, ...](), ArbitrationRule.PRIORITY
        while name in taken:
            name = f"conflict-{name}"
        for arbiter in net.arbiters:
            if not set(names).isdisjoint(arbiter.among):
                name, sequence, by = arbiter.name, arbiter.among, arbiter.by
        rest = tuple(one for one in names if one not in set(sequence))
        if names[0] in at:
            yield ArbitrationGroup(name, sequence, rest, by, None, at[names[0]])
        else:
            owned = (one for one in owners(net, net.transition(names[0])) if one is not None)
            yield ArbitrationGroup(name, sequence, rest, by, next(owned, None))  # they share a place, so of its owner


def _components(net: Net) -> Sequence[Sequence[int]]:
    """The conflict components, each in the order of the net, in that of their first transitions."""
    at: dict[int, list[tuple[int, ...]]] = {}
    for together in (*net.competitors, *net.producers):
        if len(together) > 1:
            for t in together:
                at.setdefault(t, []).append(together)
    done, found = set[int](), []
    for first in sorted(at):
        if first in done:
            continue
        members, todo = {first}, [first]
        reached = set[int]()
        while todo:
            for together in at[todo.pop()]:
                if id(together) not in reached:
                    reached.add(id(together))
                    todo += [t for t in together if t not in members]
                    members.update(together)
        done |= members
        found.append(sorted(members))
    return found
