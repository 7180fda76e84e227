"""Hosts in one process: a link that hands messages over on the event loop, as objects.

Messages are frozen, so handing one over is as good as copying it. Each is delivered by an act of its own, never inside
`send`: a machine is not asked anything while it is in the middle of an act. In virtual time that makes a run with
several hosts a function of its seed, like one with a single host.

`cut` and `mend` part hosts and join them again, for tests of what a cell does while a line is down. Messages under way
are lost then, as they would be on a line.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

from firable.executor.links.link import QUESTION, Greeting, LinkListener, come_back_without, objection
from firable.executor.links.standing import Standing
from firable.executor.protocol.messages import Message


class Exchange:
    """Where the links of one process meet."""

    def __init__(self) -> None:
        self.present: list[InProcessLink] = []
        self.parted: set[InProcessLink] = set()

    def reached(self, link: InProcessLink) -> list[InProcessLink]:
        """The links that `link` is joined to."""
        if link in self.parted or link not in self.present:
            return []
        return [other for other in self.present if other is not link and other not in self.parted]

    def cut(self, link: InProcessLink) -> None:
        """Part a host from all others."""
        for other in self.reached(link):
            link.lose(other)
            other.lose(link)
        self.parted.add(link)

    def mend(self, link: InProcessLink) -> None:
        """Join a host to the others again."""
        self.parted.discard(link)
        self._meet(link)

    def enter(self, link: InProcessLink) -> None:
        """A host has come."""
        self.present.append(link)
        self._meet(link)

    def leave(self, link: InProcessLink) -> None:
        """A host has gone."""
        for other in self.reached(link):
            other.lose(link)
        self.present.remove(link)

    def _meet(self, link: InProcessLink) -> None:
        for other in self.reached(link):
            link.meet(other)
            other.meet(link)


class InProcessLink:
    """The link of one host of a process."""

    def __init__(self, exchange: Exchange, greeting: Greeting) -> None:
        self.exchange = exchange
        self.greeting = greeting
        self.listener: LinkListener | None = None
        self.peers: dict[str, InProcessLink] = {}
        self.objected: list[InProcessLink] = []
        """Those that were refused for what their greeting says."""
        self.standing = Standing.GOING

    @property
    def question(self) -> str:
        """What there is to ask, of a host that was never reached."""
        return QUESTION

    @property
    def damaged(self) -> int:
        """Nothing: a message is handed over as it is."""
        return 0

    async def run(self, listener: LinkListener) -> None:
        """Be reached until cancelled."""
        self.listener = listener
        self.exchange.enter(self)
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            self.exchange.leave(self)
            self.peers.clear()
            self.objected.clear()
            self.listener = None

    def send(self, sender: str, receiver: str, message: Message) -> None:
        """Hand over a message; without a host for its receiver it is lost."""
        peer = self.peers.get(receiver)
        if peer is not None:
            asyncio.get_running_loop().call_soon(self._deliver, peer, sender, receiver, message, self._tell().age)

    def stand(self, standing: Standing) -> None:
        """Tell all others."""
        self.standing = standing
        for other in set(self.peers.values()):
            asyncio.get_running_loop().call_soon(other.stands, self)

    def stands(self, other: InProcessLink) -> None:
        """Take how another host stands, if it is still reached."""
        for name in _names_of(self.peers, other):
            self._tell().stands(name, other.standing)

    def meet(self, other: InProcessLink) -> None:
        """Greet another host."""
        here, there = self._tell(), other._tell()
        ours, theirs = here.memory, there.memory
        why = objection(self.greeting, other.greeting)
        if why is not None:
            self.objected.append(other)
        come_back = ours.estranged(other.greeting.names, theirs.storage)
        forgotten = theirs.estranged(self.greeting.names, ours.storage)
        if why is None and come_back is not None:
            why = come_back_without(come_back)
        if why is not None:
            here.refused(other.greeting.names, why)
        if forgotten is not None and (why is None or forgotten.is_older):
            here.disowned(other.greeting.names, forgotten)
        for name in other.greeting.names if why is None and forgotten is None else ():
            self.peers[name] = other
            here.connected(name, theirs.storage)
            if other.standing is not Standing.GOING:
                here.stands(name, other.standing)

    def lose(self, other: InProcessLink) -> None:
        """Another host is no longer reached."""
        for name in _names_of(self.peers, other):
            del self.peers[name]
            self._tell().lost(name)
        if other in self.objected:
            self.objected.remove(other)
            if all(one.greeting.names != other.greeting.names for one in self.objected):
                self._tell().gone(other.greeting.names)

    def _deliver(self, peer: InProcessLink, sender: str, receiver: str, message: Message, age: int) -> None:
        # What was under way when the line was cut, or the receiver ended, is lost.
        if self.peers.get(receiver) is peer and peer.listener is not None:
            peer.listener.arrived(sender, receiver, message, age)

    def _tell(self) -> LinkListener:
        if self.listener is None:
            raise RuntimeError("the link does not run")
        return self.listener


def _names_of(peers: dict[str, InProcessLink], link: InProcessLink) -> Iterable[str]:
    return [name for name, peer in peers.items() if peer is link]
