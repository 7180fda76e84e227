"""Changes that cure: a gate, a capacity place, an arbiter; made to a net, and told as what to write in its file.

All three only forbid firings, or choose between them: no marking is added on the places that the net has, so what
could never happen still cannot. What they may break is that something still can happen, which is why every change is
checked before it is offered (`analysis/cures/finding.py`). `nets/editing/edits.py` makes them in a net file.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Final

from firable.nets.net import Arbiter, Net, Place

_CAPACITY: Final = "capacity"


@dataclass(frozen=True, slots=True)
class Gate:
    """One more internal gate at a transition, open while `place` holds a token (`permissive`) or while it is empty."""

    transition: str
    place: str
    permissive: bool

    size = 1

    def made(self, net: Net) -> Net:
        """The net with the gate."""

        def gated(of: str) -> tuple[str, ...]:
            return (*getattr(net.transition(self.transition), of), self.place)

        old = net.transition(self.transition)
        new = (
            replace(old, permissive=gated("permissive"))
            if self.permissive
            else replace(old, inhibitive=gated("inhibitive"))
        )
        return replace(net, transitions=tuple(new if one is old else one for one in net.transitions))

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

    def made(self, net: Net) -> Net:
        """The net with the place."""
        place = Place(self.place, self.owner, marked=True, description=self.description)
        takers, givers = set(self.takers), set(self.givers)
        transitions = tuple(
            replace(
                one,
                inputs=(*one.inputs, self.place) if one.name in takers else one.inputs,
                outputs=(*one.outputs, self.place) if one.name in givers else one.outputs,
            )
            for one in net.transitions
        )
        return replace(net, places=(*net.places, place), transitions=transitions)

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

    def made(self, net: Net) -> Net:
        """The net with the arbiter."""
        return replace(net, arbiters=(*net.arbiters, self.arbiter))

    def __str__(self) -> str:
        among = ", ".join(self.arbiter.among)
        return f"add to `arbiters`: `{self.arbiter.name}: {{among: [{among}], by: {self.arbiter.by}}}`"


Change = Gate | CapacityPlace | Arbitration


def changed(net: Net, changes: Iterable[Change]) -> Net:
    """The net after all changes; raises `InputError` where that is no well-formed net."""
    return reduce(lambda before, change: change.made(before), changes, net)


def capacity(net: Net, takers: Sequence[str], givers: Sequence[str]) -> CapacityPlace:
    """A capacity place under a name that is free, owned by the coordinator, or else by who owns what a taker takes."""
    owner = (
        net.coordinator.name
        if net.coordinator
        else next((net.place(place).owner for place in net.transition(takers[0]).inputs), None)
    )
    name = _CAPACITY if owner is None else f"{owner}.{_CAPACITY}"
    return CapacityPlace(free_name(name, net.place_index), owner, tuple(takers), tuple(givers))


def free_name(wanted: str, taken: Iterable[str]) -> str:
    """The name, or that with the first number from 2 on that nothing has.

    >>> free_name("capacity", {"capacity", "capacity_2"})
    'capacity_3'
    """
    names, number, name = set(taken), 2, wanted
    while name in names:
        name, number = f"{wanted}_{number}", number + 1
    return name
