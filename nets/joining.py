"""Joining subnets into the net that they make together: the inverse of the split.

The parts of a coordinated transition fire as one, so the transition they make has all their inputs, outputs and gates
(Eq. 6). What the joined net *is* comes from the subnets and the table alone; only the order of things, and what the
split leaves with the central net (its name, layers, arbiters and properties), is taken from there. So
`join(split(net))` is `net`, and a subnet that was edited joins into another net.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TypeVar

from firable.nets.decomposition import Coordinated, Decomposition
from firable.nets.net import Net, Transition

Item = TypeVar("Item")


def join(decomposition: Decomposition) -> Net:
    """The net that the subnets make together.

    A transition without a number that the split numbered keeps that number. Raises `InputError` where the
    subnets do not make a well-formed net, and `KeyError` where a part is missing from its subnet.
    """
    net = decomposition.net
    rows = {(part.controller, part.name): row for row in decomposition.coordinated for part in row.parts}
    above = {controller.name: controller.under for controller in net.controllers}
    joined: dict[str, Transition] = {}
    for row in decomposition.coordinated:
        parts = [decomposition.subnet(part.controller).transition(part.name) for part in row.parts]
        joined[row.name] = _joined(row, parts, net)
    for subnet in decomposition.subnets:
        for transition in subnet.transitions:
            if (subnet.name, transition.name) not in rows:
                joined[transition.name] = transition
    return Net(
        net.name,
        _in_order(net.place_index, ((p.name, p) for subnet in decomposition.subnets for p in subnet.places)),
        _in_order(net.transition_index, joined.items()),
        _in_order(net.signal_index, ((s.name, s) for subnet in decomposition.subnets for s in subnet.signals)),
        tuple(
            replace(controller, under=above.get(controller.name))
            for subnet in decomposition.subnets
            for controller in subnet.controllers
        ),
        net.arbiters,
        net.properties,
        net.description,
    )


def _joined(row: Coordinated, parts: Iterable[Transition], net: Net) -> Transition:
    whole = Transition(row.name)
    for part in parts:
        whole = Transition(
            row.name,
            whole.inputs + part.inputs,
            whole.outputs + part.outputs,
            whole.permissive + part.permissive,
            whole.inhibitive + part.inhibitive,
            whole.external + part.external,
            row.number,
            row.description,
        )
    if row.name not in net.transition_index:
        return whole
    like = net.transition(row.name)
    return replace(
        whole,
        inputs=_as_in(like.inputs, whole.inputs),
        outputs=_as_in(like.outputs, whole.outputs),
        permissive=_as_in(like.permissive, whole.permissive),
        inhibitive=_as_in(like.inhibitive, whole.inhibitive),
        external=_as_in(like.external, whole.external),
    )


def _as_in(order: tuple[Item, ...], items: tuple[Item, ...]) -> tuple[Item, ...]:
    """The items, those that `order` knows first and in its order."""
    return (*(item for item in order if item in items), *(item for item in items if item not in order))


def _in_order(index: Mapping[str, int], items: Iterable[tuple[str, Item]]) -> tuple[Item, ...]:
    return tuple(item for _, item in sorted(items, key=lambda pair: index.get(pair[0], len(index))))
