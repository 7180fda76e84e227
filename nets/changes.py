"""Changes that cure: a gate, a capacity place, an arbiter; made to a net, and told as what to write in its file.

All three only forbid firings, or choose between them: no marking is added on the places that the net has, so what
could never happen still cannot. What they may break is that something still can happen, which is why every change is
checked before it is offered (`analysis/cures/finding.py`). `nets/editing/edits.py` makes them in a net file.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from firable.nets.net import Arbiter, ArbitrationRule, Net, Place, Transition

_CAPACITY: Final = "capacity"


@dataclass(frozen=True, slots=True)
class _Draft:
    """What of a net changes, while it is no net yet: a change for each conflict of a large net makes one net."""

    places: list[Place]
    transitions: dict[str, Transition]
    arbiters: list[Arbiter]


@dataclass(frozen=True, slots=True)
class Gate:
    """One more internal gate at a transition, open while `place` holds a token (`permissive`) or while it is empty."""

    transition: str
    place: str
    permissive: bool

    size = 1

    def make(self, draft: _Draft) -> None:
        """Add the gate."""
        old = draft.transitions[self.transition]
        draft.transitions[self.transition] = (
            replace(old, permissive=(*old.permissive, self.place))
            if self.permissive
            else replace(old, inhibitive=(*old.inhibitive, self.place))
        )

    def __str__(self) -> str:
        return f"give {self.transition} the gate `{'if' if self.permissive else 'unless'}: {self.place}`"


@dataclass(frozen=True, slots=True)
class CapacityPlace:
    """One more place, marked in M0, that `takers` take and `givers` give back: one of what is between them at a time.

    It is the capacity control condition of the paper's nets, and the monitor of supervisory control.
    """

    place: str
    owner: str | None
    takers: tuple[str, ...]
    givers: tuple[str, ...]

    description = "capacity control condition"

    @property
    def size(self) -> int:
        """The place and its arcs."""
        return 1 + len(self.takers) + len(self.givers)

    def make(self, draft: _Draft) -> None:
        """Add the place."""
        draft.places.append(Place(self.place, self.owner, marked=True, description=self.description))
        for name in self.takers:
            taker = draft.transitions[name]
            draft.transitions[name] = replace(taker, inputs=(*taker.inputs, self.place))
        for name in self.givers:
            giver = draft.transitions[name]
            draft.transitions[name] = replace(giver, outputs=(*giver.outputs, self.place))

    def __str__(self) -> str:
        return (
            f"add the place `{self.place}`, marked at the start, to `from` of {' and '.join(self.takers)} "
            f"and to `to` of {' and '.join(self.givers)}"
        )


@dataclass(frozen=True, slots=True)
class Arbitration:
    """One more arbiter, by priority in the order of the file, which decides already as long as nobody says so."""

    arbiter: Arbiter

    @property
    def size(self) -> int:
        """How many transitions it names."""
        return len(self.arbiter.among)

    def make(self, draft: _Draft) -> None:
        """Add the arbiter."""
        draft.arbiters.append(self.arbiter)

    def __str__(self) -> str:
        among = ", ".join(self.arbiter.among)
        return f"add to `arbiters`: `{self.arbiter.name}: {{among: [{among}], by: {self.arbiter.by}}}`"


Change = Gate | CapacityPlace | Arbitration


def changed(net: Net, changes: Iterable[Change]) -> Net:
    """The net after all changes; raises `InputError` where that is no well-formed net."""
    draft = _Draft([*net.places], {one.name: one for one in net.transitions}, [*net.arbiters])
    for change in changes:
        change.make(draft)
    return replace(
        net,
        places=tuple(draft.places),
        transitions=tuple(draft.transitions.values()),
        arbiters=tuple(draft.arbiters),
    )


def capacity(net: Net, takers: Sequence[str], givers: Sequence[str]) -> CapacityPlace:
    """A capacity place under a name that is free, owned by the coordinator, or else by who owns what a taker takes."""
    owner = (
        net.coordinator.name
        if net.coordinator
        else next((net.place(place).owner for place in net.transition(takers[0]).inputs), None)
    )
    name = _CAPACITY if owner is None else f"{owner}.{_CAPACITY}"
    return CapacityPlace(free_name(name, net.place_index), owner, tuple(takers), tuple(givers))


def arbitration(among: Sequence[str], taken: Iterable[str]) -> Arbitration:
    """An arbiter of these transitions under a name that none of `taken` is.

    It goes by rotation: by priority this warning would mostly be exchanged for that of a transition that starves.

    >>> print(arbitration(["left", "right"], ()))
    add to `arbiters`: `left_or_right: {among: [left, right], by: rotation}`
    """
    return Arbitration(Arbiter(free_name("_or_".join(among[:2]), taken), tuple(among), ArbitrationRule.ROTATION))


def free_name(wanted: str, taken: Iterable[str]) -> str:
    """The name, or that with the first number from 2 on that nothing has.

    >>> free_name("capacity", {"capacity", "capacity_2"})
    'capacity_3'
    """
    names, number, name = set(taken), 2, wanted
    while name in names:
        name, number = f"{wanted}_{number}", number + 1
    return name
