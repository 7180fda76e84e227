"""O8: with coordinators above coordinators, votes still add up to Eq. (7) and (8), and conflicts meet in one decider.

A coordinator that is asked from above answers with the AND of its children's votes, so what the decider of a transition
computes is a conjunction bracketed along the tree, from its participants up to it. For each global transition that is
compared with the flat conjunction of Eq. (7) and (8), whose factors are the same terms. A part that hangs under another
coordinator than the decider is in no branch, so its factor is missing, and the two differ in the marking where only
that part is not firable. That the tree is one, each controller under one coordinator and none under itself, is a rule
of the net.

Who decides is a fact for each row and group: the lowest common ancestor of all participants, of the whole conflict
component where there is one. Here it is found by its definition, the deepest of those that are above everyone, and not
by the search from below that the split uses.

Nothing is to be shown of a net in one layer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise

from firable.analysis.induction.smt import Term, Terms
from firable.decompose.proofs.obligation import Obligation, equation, facts
from firable.decompose.proofs.sides import Sides, holds, signals
from firable.nets.layers import Layers
from firable.nets.net import Net
from firable.semantics.firing import enabled


def layers(sides: Sides) -> Iterator[Obligation]:
    """O8 for each row of the table, and the deciders of all; nothing where there is one layer."""
    tree = Layers(sides.net)
    if not tree.several:
        return
    yield _deciders(sides, tree)
    for row in sides.decomposition.coordinated:
        if row.is_global:
            yield _votes(sides, tree, row.name, row.at or tree.root, [part.controller for part in row.parts])


def _votes(sides: Sides, tree: Layers, name: str, at: str, owners: Sequence[str]) -> Obligation:
    terms = Terms()
    votes: dict[str, list[Term]] = {}
    for key in sides.parts[name]:
        found = sides.part(key)
        votes.setdefault(key[0], []).append(_yes(terms, *found) if found else terms.false)
    below: dict[str, dict[str, None]] = {}
    for owner in owners:
        way = tree.up(owner)
        for child, above in pairwise(way):
            below.setdefault(above, {})[child] = None
    return equation(
        terms,
        f"o8.{name}",
        f"'{name}': the votes added up layer by layer at '{at}' are those of all parts together",
        name,
        sides.of_parts(terms, name, partial(_yes, terms)),
        _added_up(terms, at, votes, below),
        words=("the votes of all parts", f"the vote at '{at}'"),
    )


def _yes(terms: Terms, subnet: Net, part: int) -> Term:
    """Eq. (1) and (2) of a part in its subnet."""
    return enabled(terms, subnet, part, holds(terms, subnet), signals(terms, subnet))


def _added_up(terms: Terms, at: str, votes: Mapping[str, list[Term]], below: Mapping[str, Iterable[str]]) -> Term:
    """The vote of a controller: its own part, and the votes of those under it that take part."""
    under = (_added_up(terms, child, votes, below) for child in below.get(at, ()))
    return terms.conjunction([*votes.get(at, ()), *under])


def _deciders(sides: Sides, tree: Layers) -> Obligation:
    net, arbitration = sides.net, sides.arbitration
    participants: dict[str, set[str]] = {}
    for transition in net.transitions:
        names = (*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive)
        owners = {net.place(place).owner for place in names}
        owners |= {net.signal(gate.signal).owner for gate in transition.external}
        participants[transition.name] = {owner for owner in owners if owner is not None}
    central = {name: _lowest(tree, owners) for name, owners in participants.items() if len(owners) > 1}
    of_group: list[str] = []
    for group in arbitration.groups:
        members = [net.transitions[t].name for t in dict.fromkeys((*group.sequence, *group.rest))]
        if any(name in central for name in members):
            at = _lowest(tree, set().union(*(participants[name] for name in members)))
            central.update(dict.fromkeys(members, at))
            of_group.append(f"'{at}' decides the group {group.name}")
    made = [f"'{row.at or tree.root}' decides {row.name}" for row in sides.decomposition.coordinated]
    made += [
        f"'{group.at or tree.root}' decides the group {group.name}"
        for group in sides.decomposition.groups
        if group.controller is None
    ]
    return facts(
        "o8",
        "each transition, with all that it conflicts with, is decided by the lowest coordinator above all participants",
        [*(f"'{at}' decides {name}" for name, at in central.items()), *of_group],
        made,
    )


def _lowest(tree: Layers, owners: set[str]) -> str:
    """Of those that are above everyone, the one with most others above it."""
    above = set.intersection(*(set(tree.up(owner)) for owner in owners))
    return max(above, key=lambda name: len(tree.up(name)))
