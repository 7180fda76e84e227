"""The door of an endpoint: so many connections at once, and who has not said who he is makes room for the next.

Whoever reaches the address of an endpoint can open connections, and say nothing on them. Each takes a descriptor of the
process that runs a cell, of which there are few: without one it reaches no device again, and no operator gets in with
his stop. So there are `CONNECTIONS_MAX`, and the one more has the place of one of those on which nobody was let in, be
it in the middle of its handshake: of the oldest from where most of them come, so that whoever comes fast from one
address closes his own, and not that of an operator whose line is slow. Whoever may come shows that with the first that
he says. Where nearly all were let in, the oldest of these leaves: a page that was forgotten, and comes again if not.

Connections are taken one in a turn of the event loop, which is that of the run. The servers of asyncio take a hundred,
and where the process has no descriptor left they tell that so often, and for ever. Rejected: a time within which one
has to say who he is. It would have to be as long as the worst line takes, and a thousand idle connections fit in it.
"""

from __future__ import annotations

import asyncio
import errno
import socket
import ssl
from collections import Counter
from collections.abc import Callable, Container
from typing import Final

CONNECTIONS_MAX: Final = 64
"""Operators, their browsers and Prometheus have a dozen."""
COMING_MIN: Final = 16
"""So many may be about to say who they are, or the few who come last would close each other's connections."""
_BACKLOG: Final = 128
"""So many wait at the system until they are taken, and take no descriptor."""
_AGAIN_SECONDS: Final = 1.0
"""When it is tried again to take a connection, where the system has given none."""

_Coming = asyncio.Task[tuple[asyncio.Transport, asyncio.BaseProtocol]]
"""A connection: the task that makes it, handshake included."""


class Door:
    """Where connections come in, each to a protocol that `made` makes; `too_many` is told whence one too many comes."""

    def __init__(
        self,
        made: Callable[[], asyncio.BaseProtocol],
        tls: ssl.SSLContext | None,
        let_in: Container[asyncio.BaseTransport],
        too_many: Callable[[str], None],
    ) -> None:
        self.made = made
        self.tls = tls
        self.let_in = let_in
        self.too_many = too_many
        self.there: dict[_Coming, str] = {}
        """The connections that are there, in the order in which they came, and the address that each came from."""

    async def keep(self, listening: socket.socket) -> None:
        """Take who comes, until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                accepted, address = await loop.sock_accept(listening)
            except ConnectionError:  # it is gone already
                continue
            except OSError:  # the process has no descriptor left, or the system no memory
                await asyncio.sleep(_AGAIN_SECONDS)
                continue
            whence = str(address[0])
            self.there = {one: its for one, its in self.there.items() if _is_there(one)}
            if len(self.there) >= CONNECTIONS_MAX:
                self.too_many(whence)
                self._make_room()
            coming = loop.create_task(loop.connect_accepted_socket(self.made, accepted, ssl=self.tls))
            coming.add_done_callback(_transport)  # a handshake that fails is nobody's to tell
            self.there[coming] = whence
            await asyncio.sleep(0)

    async def close(self) -> None:
        """End the handshakes; who speaks already is let finish by who speaks with him."""
        left = [one for one in self.there if not one.done()]
        for one in left:
            one.cancel()
        await asyncio.gather(*left, return_exceptions=True)

    def _make_room(self) -> None:
        strangers = {one: its for one, its in self.there.items() if _transport(one) not in self.let_in}
        if len(strangers) < COMING_MIN:
            leaving = next(one for one in self.there if one not in strangers)
        else:
            crowd = Counter(strangers.values())
            leaving = max(strangers, key=lambda one: crowd[strangers[one]])  # the oldest: `max` gives the first
        del self.there[leaving]
        leaving.cancel()
        if (transport := _transport(leaving)) is not None:
            transport.abort()


def _transport(coming: _Coming) -> asyncio.Transport | None:
    """The transport of a connection, if it has come that far."""
    if not coming.done() or coming.cancelled() or coming.exception() is not None:
        return None
    return coming.result()[0]


def _is_there(coming: _Coming) -> bool:
    if not coming.done():
        return True
    transport = _transport(coming)
    return transport is not None and not transport.is_closing()


async def listening_at(host: str, port: int) -> list[socket.socket]:
    """Sockets that listen at all addresses of a host; raises `OSError` where there is none."""
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    made: list[socket.socket] = []
    missing: OSError | None = None
    try:
        for family, address in dict.fromkeys((family, address) for family, _, _, _, address in found):
            try:
                made.append(opened := socket.create_server(address, family=family, backlog=_BACKLOG))
                opened.settimeout(0)
            except OSError as error:
                if error.errno not in (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT):
                    raise
                missing = error  # `localhost` may have an address of a kind that this system has not
        if not made and missing is not None:
            raise missing
    except OSError:
        for one in made:
            one.close()
        raise
    return made
