"""The picture of a net on the page: that of `firable draw`, by the same layout file, with tasks folded in the same way.

A large picture takes a while, so the page asks for it apart from everything else, shows at once that it is being
drawn, and is of use meanwhile. It is drawn beside the event loop, one at a time, and kept: who opens a second window,
or unfolds what they have folded, waits for nothing. The picture shows no token; those come and go on the page.

Rejected: a picture that the page draws from coordinates. What `draw` writes and the page shows would be two pictures.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from firable.cli.pictures import WIDTH_MAX
from firable.cli.view.site import refusal
from firable.nets.drawing import draw_net
from firable.nets.drawing.arrangement import Arrangement
from firable.nets.drawing.folding import ALL, fold, tasks
from firable.nets.drawing.layout import FREE
from firable.nets.net import Net

KEPT_MAX: Final = 8
"""So many pictures of a net are kept, those that were asked for last."""


@dataclass(frozen=True)
class Look:
    """How nets are drawn: arranged as a layout file says, with the tasks folded at first that these names name."""

    given: Arrangement = FREE
    folded: tuple[str, ...] = ()


PLAIN: Final = Look()
"""A net that is drawn as it comes."""


class Pictures:
    """The pictures of one net."""

    def __init__(self, net: Net, look: Look) -> None:
        self.net, self.look = net, look
        known = {ALL, *net.place_index, *(controller.name for controller in net.controllers)}
        self.at_first = tuple(fold(net, [name for name in look.folded if name in known]).members)
        self.foldable = [task[0] for task in tasks(net) if len(task) > 1]
        self.drawing = asyncio.Lock()
        self.kept: dict[frozenset[str], str] = {}

    async def picture(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """The picture with the tasks folded that a request names by their first places; by default those at first.

        Raises `InputError` F5070 for a task that the net has not.
        """
        names = frozenset(self._named(asked))
        async with self.drawing:
            text = self.kept.pop(names, None)
            if text is None:
                text = await asyncio.to_thread(self._drawn, names)
            self.kept[names] = text
            while len(self.kept) > KEPT_MAX:
                self.kept.pop(next(iter(self.kept)))
        return {"picture": text, "members": fold(self.net, names).members, "foldable": self.foldable}

    def _named(self, asked: Mapping[str, Any]) -> Collection[str]:
        match asked.get("folded"):
            case None:
                return self.at_first
            case list(names) if all(name in self.foldable for name in names):
                return names
        raise refusal("the page asks for a task that the net has not")

    def _drawn(self, folded: Collection[str]) -> str:
        return draw_net(self.net, marking=0, folded=folded, given=self.look.given, width_max=WIDTH_MAX)
