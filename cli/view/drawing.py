"""The picture of a net on the page: that of `firable draw`, by the same layout file, with tasks folded in the same way.

What is seen of a net is what is opened of it: all of its controllers, which is the whole net, some of them, or none,
which is the overview. A net of more than `AT_ONCE_MAX` places and transitions begins with that: a picture of all of
them, made to fit a window, has letters that nobody can read.

A large picture takes a while, so the page asks for it apart from everything else, shows at once that it is being
drawn, and is of use meanwhile. It is drawn beside the event loop, one at a time, and kept: who opens a second window,
or unfolds what they have folded, waits for nothing. The picture shows no token; those come and go on the page.

Rejected: a picture that the page draws from coordinates. What `draw` writes and the page shows would be two pictures.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from firable.cli.pictures import WIDTH_MAX
from firable.cli.view.site import refusal
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.drawing import NODES_MAX, draw_net, draw_overview, has_overview
from firable.nets.drawing.arrangement import Arrangement, Owner
from firable.nets.drawing.folding import ALL, fold, tasks
from firable.nets.drawing.layout import FREE
from firable.nets.drawing.part import everybody, owners_of
from firable.nets.net import Net

AT_ONCE_MAX: Final = 200
"""So many places and transitions are shown whole at first."""
KEPT_MAX: Final = 8
"""So many pictures of a net are kept, those that were asked for last."""


@dataclass(frozen=True)
class Look:
    """How nets are drawn: as a layout file says, at first with these tasks folded, and these controllers opened."""

    given: Arrangement = FREE
    folded: tuple[str, ...] = ()
    opened: tuple[str, ...] = ()
    """Where it names none, the whole of a small net, and of a large one the overview."""


PLAIN: Final = Look()
"""A net that is drawn as it comes."""


class Pictures:
    """The pictures of one net."""

    def __init__(self, net: Net, look: Look) -> None:
        self.net, self.look = net, look
        known = {ALL, *net.place_index, *(controller.name for controller in net.controllers)}
        self.at_first = tuple(fold(net, [name for name in look.folded if name in known]).members)
        self.foldable = [task[0] for task in tasks(net) if len(task) > 1]
        self.owners = owners_of(net)
        self.participants = everybody(net)
        self.has_overview = has_overview(net)
        opened: list[Owner] = [owner for owner in self.owners if owner in look.opened]
        is_small = len(net.places) + len(net.transitions) <= AT_ONCE_MAX
        self.opened_at_first = opened or (self.owners if is_small or not self.has_overview else [])
        self.drawing = asyncio.Lock()
        self.kept: dict[tuple[frozenset[str], tuple[Owner, ...]], str] = {}

    async def picture(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """The picture of the controllers that a request opens, with the tasks folded that it names by first places.

        By default those at first. Raises `InputError` F5070 for a task or a controller that the net has not, and for
        more than can be drawn.
        """
        opened = self._opened(asked)
        names = frozenset(name for name in self._named(asked) if self.net.place(name).owner in opened)
        key = names, tuple(opened)
        async with self.drawing:
            text = self.kept.pop(key, None)
            if text is None:
                text = await asyncio.to_thread(self._drawn, *key)
            self.kept[key] = text
            while len(self.kept) > KEPT_MAX:
                self.kept.pop(next(iter(self.kept)))
        return {
            "picture": text,
            "members": fold(self.net, names).members,
            "foldable": [name for name in self.foldable if self.net.place(name).owner in opened],
            "opened": opened,
            "owners": self.owners if self.has_overview else [],
            "whole": self._size(self.owners) <= NODES_MAX,
        }

    def _named(self, asked: Mapping[str, Any]) -> Collection[str]:
        match asked.get("folded"):
            case None:
                return self.at_first
            case list(names) if all(name in self.foldable for name in names):
                return names
        raise refusal("the page asks for a task that the net has not")

    def _opened(self, asked: Mapping[str, Any]) -> list[Owner]:
        """The controllers that a request opens, in the order of the net; None is what nobody owns."""
        opened: list[Owner]
        match asked.get("opened"):
            case None:
                opened = self.opened_at_first
            case list(names) if all(name in self.owners for name in names):
                opened = [owner for owner in self.owners if owner in names]
            case _:
                raise refusal("the page asks for a controller that the net has not")
        if not opened and self.owners and not self.has_overview:
            raise refusal("the page asks for an overview, and the net has none")
        if (n_nodes := self._size(opened)) > NODES_MAX:
            message = f"{n_nodes:,} places and transitions make no picture that anybody can read"
            hint = f"at most {NODES_MAX:,} are drawn: open fewer controllers, or cut this one in two"
            raise InputError([Diagnostic("F5070", message, hint)])
        return opened

    def _size(self, opened: Collection[Owner]) -> int:
        """How many places and transitions the picture of these controllers has."""
        if opened == self.owners:
            return len(self.net.places) + len(self.net.transitions)
        places = sum(place.owner in opened for place in self.net.places)
        return places + sum(not some.isdisjoint(opened) for some in self.participants.values())

    def _drawn(self, folded: Collection[str], opened: Sequence[Owner]) -> str:
        if not opened and self.has_overview:
            return draw_overview(self.net, marking=0)
        owners = None if opened == tuple(self.owners) else opened
        return draw_net(self.net, marking=0, folded=folded, owners=owners, given=self.look.given, width_max=WIDTH_MAX)
