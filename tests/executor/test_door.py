"""However many come to an endpoint and say nothing, the operator gets in, and the process keeps its descriptors."""

from __future__ import annotations

import asyncio
import errno
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientSession, TCPConnector
from support.certificates import Site

from firable.executor.operating import door
from firable.executor.operating.control import Endpoint, serving, tls_context
from firable.executor.operating.door import COMING_MIN, CONNECTIONS_MAX
from firable.executor.operating.situation import Situation, State

TOKEN = "a-token-of-some-length"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
ASKING = f"GET /situation HTTP/1.1\r\nHost: cell\r\nAuthorization: Bearer {TOKEN}\r\n\r\n".encode()
GOOD = b"HTTP/1.1 200 OK\r\n"
PATIENCE_SECONDS = 20.0

Stranger = tuple[asyncio.StreamReader, asyncio.StreamWriter]


class Run:
    """A run that can tell its situation, and who was turned away."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def situation(self) -> Situation:
        return Situation(State.WAITING, ())

    def nothing(self, *_: object) -> bool:
        return False

    pause = resume = step = stop = emergency_stop = reset = say = commanded = not_obeyed = nothing

    def turned_away(self, command: str, by: str) -> None:
        self.told.append(f"{by}: {command}")


@asynccontextmanager
async def served(run: Any, tls: ssl.SSLContext | None = None) -> AsyncIterator[str]:
    async with asyncio.timeout(PATIENCE_SECONDS), serving(run, Endpoint("127.0.0.1", 0, TOKEN, tls), bytes) as url:
        yield url


async def come(url: str, number: int, saying: bytes = b"") -> list[Stranger]:
    """So many connections, on which this is said."""
    found = [await asyncio.open_connection("127.0.0.1", int(url.rpartition(":")[2])) for _ in range(number)]
    for _, writer in found:
        writer.write(saying)
    return found


async def asked(session: ClientSession, url: str) -> int:
    async with session.get(f"{url}/situation", headers=BEARER) as answer:
        return answer.status


@pytest.mark.parametrize(
    "saying",
    [b"", b"GET /situation HTTP/1.1\r\nHost: cell\r\nX-Slow: ", b"POST /stop HTTP/1.1\r\nContent-Length: 9\r\n\r\n"],
    ids=["nothing", "half a head", "half a body"],
)
def test_those_who_do_not_say_who_they_are_make_room(saying: bytes) -> None:
    async def main() -> None:
        run = Run()
        async with served(run) as url:
            strangers = await come(url, 3 * CONNECTIONS_MAX, saying)
            async with ClientSession() as session:
                assert await asked(session, url) == 200
            assert f"127.0.0.1: more than {CONNECTIONS_MAX} connections at once" in run.told
            for reader, writer in strangers[:CONNECTIONS_MAX]:  # the oldest are gone
                try:
                    while await reader.read(1000):
                        pass
                except ConnectionError:
                    pass
                writer.close()

    asyncio.run(main())


def test_who_was_let_in_stays() -> None:
    async def main() -> None:
        async with served(Run()) as url:
            ((reader, writer),) = await come(url, 1, ASKING)
            assert await reader.readline() == GOOD
            head = await reader.readuntil(b"\r\n\r\n")
            await reader.readexactly(int(head.lower().partition(b"content-length: ")[2].split()[0]))
            strangers = await come(url, 2 * CONNECTIONS_MAX)
            await asyncio.sleep(0.1)
            writer.write(ASKING)  # on the same connection
            assert await reader.readline() == GOOD
            assert strangers

    asyncio.run(main())


def test_who_comes_fast_from_one_address_closes_his_own_and_not_that_of_an_operator_who_is_slow() -> None:
    async def main() -> None:
        async with served(Run()) as url:
            port = int(url.rpartition(":")[2])
            reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=("127.0.0.2", 0))
            strangers = await come(url, 3 * CONNECTIONS_MAX)
            writer.write(ASKING)
            assert await reader.readline() == GOOD
            assert strangers

    asyncio.run(main())


def test_operators_get_in_where_all_who_are_there_were_let_in_and_more_than_one_comes() -> None:
    async def main() -> None:
        async with served(Run()) as url:
            for reader, _ in (there := await come(url, CONNECTIONS_MAX, ASKING)):
                assert await reader.readline() == GOOD
            late = await come(url, COMING_MIN)
            await asyncio.sleep(0.1)
            for reader, writer in late:
                writer.write(ASKING)
                assert await reader.readline() == GOOD
            assert there

    asyncio.run(main())


def test_a_handshake_that_does_not_go_on_makes_room(tmp_path: Path) -> None:
    async def main() -> None:
        host = Site(tmp_path / "site").host("cell")
        trusting = ssl.create_default_context(cafile=host.authority)
        async with served(Run(), tls_context(host.certificate, host.key, None)) as url:
            strangers = await come(url, 2 * CONNECTIONS_MAX)
            async with ClientSession(connector=TCPConnector(ssl=trusting)) as session:
                assert await asked(session, url) == 200
            assert strangers

    asyncio.run(main())


def test_a_process_without_a_descriptor_takes_who_comes_later_and_says_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    left: list[object] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, context: left.append(context))
        taken = loop.sock_accept
        tries = iter([OSError(errno.EMFILE, "too many"), ConnectionAbortedError()])

        async def accept(listening: Any) -> Any:
            for error in tries:
                raise error
            return await taken(listening)

        monkeypatch.setattr(door, "_AGAIN_SECONDS", 0.01)
        monkeypatch.setattr(loop, "sock_accept", accept)
        async with served(Run()) as url, ClientSession() as session:
            assert await asked(session, url) == 200

    asyncio.run(main())
    assert not left


def test_addresses_that_this_system_has_not_are_left_out() -> None:
    async def main() -> None:
        for one in await door.listening_at("localhost", 0):
            with one:
                assert one.getsockname()[0] in {"127.0.0.1", "::1"}
        with pytest.raises(OSError, match="assign"):
            await door.listening_at("192.0.2.1", 0)

    asyncio.run(main())


def test_a_door_knows_who_is_there_no_more() -> None:
    """Or those who have come and gone would leave no room."""

    async def main() -> None:
        run = Run()
        async with served(run) as url:
            for _ in range(2 * CONNECTIONS_MAX):
                for _, writer in await come(url, 1):
                    writer.close()
                    await writer.wait_closed()
                await asyncio.sleep(0)
            assert not run.told

    asyncio.run(main())
