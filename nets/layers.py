"""Layers: which coordinator each controller is under, and which one decides what several take part in.

A controller stands under the one that it names (`under: cell_a`), or else under the coordinator of the whole net; so
controllers are a tree, and one with others under it coordinates these. A transition is decided by the lowest
coordinator above all its participants (their lowest common ancestor; a coordinator that takes part itself stands above
itself), and a conflict component, wherever its transitions would be decided, by the lowest one above all participants
of all of them (O8): two deciders of one conflict would each choose a winner.

To the layer above, a coordinator is a participant like any other: asked for its vote it asks its children, its yes is
the AND of theirs, and its promise is theirs, kept until the order from above has been passed on. A conjunction does not
care how it is bracketed, so the verdict is that of Eq. (7) and (8); that is proved for each transition (O8).

Rejected: controllers nested in controllers in the file. The places' names would change with every move of a controller
to another cell, and a tree six levels deep would begin at column 24.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from typing import Final

from firable.nets.net import Net

COORDINATOR: Final = "the coordinator"
"""The name of the coordinator of the whole net where none of the controllers is marked as it."""


class Layers:
    """The tree of the controllers of a net.

    >>> from firable.nets.net import Controller
    >>> line, cell, robot = Controller("line", coordinator=True), Controller("cell"), Controller("robot", under="cell")
    >>> layers = Layers(Net("n", controllers=(line, cell, robot)))
    >>> layers.up("robot"), layers.common(["robot", "cell"]), layers.common(["robot", "line"])
    (('robot', 'cell', 'line'), 'cell', 'line')
    """

    def __init__(self, net: Net) -> None:
        self.root = net.coordinator.name if net.coordinator else COORDINATOR
        self.parent: Mapping[str, str] = {
            controller.name: controller.under or self.root
            for controller in net.controllers
            if controller.name != self.root
        }
        """The coordinator that each controller is under; the root is under none."""
        self.children: dict[str, list[str]] = {}
        for name, above in self.parent.items():
            self.children.setdefault(above, []).append(name)

    @property
    def several(self) -> bool:
        """Whether there is a coordinator under another one."""
        return len(self.children) > 1

    def up(self, controller: str) -> tuple[str, ...]:
        """The controller and all that it is under, the root last."""
        found = [controller]
        while (above := self.parent.get(found[-1])) is not None:
            found.append(above)
        return tuple(found)

    def common(self, controllers: Iterable[str]) -> str:
        """The lowest controller that all of these are, or are under; the root of none."""
        names = list(dict.fromkeys(controllers))
        return reduce(self._common, names) if names else self.root

    def _common(self, one: str, other: str) -> str:
        above = set(self.up(one))
        return next((name for name in self.up(other) if name in above), self.root)

    def coordinators(self) -> Iterator[str]:
        """Those that have others under them, from the root down."""
        waiting = [self.root]
        for name in waiting:
            if name in self.children:
                yield name
                waiting += self.children[name]
