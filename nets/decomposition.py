"""The decomposition of a net: subnets, coordinator table and arbitration groups, as data.

`decompose` makes and proves it, bundles carry it, the executor plays it; so the record lies here and decides nothing.

A subnet is itself a `Net` of one controller: the places and signals that it owns, its local transitions under their own
names, and for each global transition its *part*: a transition with those inputs, outputs and gates that the controller
owns. So Eq. (1) of a part is the factor of Eq. (7), and Eq. (2) the factor of Eq. (8), with no second firing rule.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from firable.nets.net import ArbitrationRule, Net


@dataclass(frozen=True, slots=True)
class Part:
    """What one participant contributes to a transition: the transition `name` of the subnet of `controller`."""

    controller: str
    name: str


@dataclass(frozen=True, slots=True)
class Coordinated:
    """A transition that the coordinator decides: its name in the central net and its parts, by controller number.

    With more than one part it is global, a row of the coordinator table. With one part it is a local transition in the
    conflict component of a global one (O2). `at` is the coordinator below the highest that decides it; None is the
    highest.
    """

    name: str
    number: int | None
    parts: tuple[Part, ...]
    description: str = ""
    at: str | None = None

    @property
    def is_global(self) -> bool:
        """Whether more than one controller takes part."""
        return len(self.parts) > 1


@dataclass(frozen=True, slots=True)
class ArbitrationGroup:
    """A conflict component in the order of its arbiter, decided as one group.

    `controller` is the local controller that decides a component that no global transition belongs to; None is the
    coordinator, of the layer that `at` names as in `Coordinated`. The order is that of
    `firable.semantics.arbitration.Group`: `sequence`, then `rest`.
    """

    name: str
    sequence: tuple[str, ...]
    rest: tuple[str, ...]
    by: ArbitrationRule
    controller: str | None = None
    at: str | None = None


@dataclass(frozen=True)
class Decomposition:
    """A net split over its controllers; `subnets` follow the order of the net's controllers."""

    net: Net
    subnets: tuple[Net, ...]
    coordinated: tuple[Coordinated, ...]
    groups: tuple[ArbitrationGroup, ...]
    free: tuple[tuple[str, str], ...] = ()
    """The parts that are free of promise, as pairs of a transition and a controller: their yes stands until the firing.

    A split names none. Who has proved the votes persistent may name those of which `firable.nets.knowledge` says that
    they disturb nobody; who reads them demands both (`firable.nets.right_to_run`)."""

    @property
    def table(self) -> tuple[Coordinated, ...]:
        """The coordinator table: the global transitions, in the order of the net."""
        return tuple(row for row in self.coordinated if row.is_global)

    @property
    def doubled(self) -> tuple[str, ...]:
        """The names that two transitions of subnets bear, or two parts of the table: a split makes none.

        A verdict on a part is known by its name alone, so with two of one name it would be a verdict on either.
        """
        borne = Counter(transition.name for subnet in self.subnets for transition in subnet.transitions)
        borne |= Counter(part.name for row in self.coordinated for part in row.parts)
        return tuple(name for name, times in borne.items() if times > 1)

    def _repr_svg_(self) -> str | None:
        """The coordinator diagram in a notebook; nothing of a net that is too large for a picture."""
        from firable.nets.drawing import NODES_MAX, draw_coordinator

        net = self.net
        return draw_coordinator(self) if len(net.places) + len(net.transitions) <= NODES_MAX else None

    def subnet(self, controller: str) -> Net:
        """The subnet of a controller; `KeyError` where there is none."""
        return self._subnet_of[controller]

    @cached_property
    def _subnet_of(self) -> Mapping[str, Net]:
        # Of two with the same name, which no split makes, the first.
        return {subnet.name: subnet for subnet in reversed(self.subnets)}
