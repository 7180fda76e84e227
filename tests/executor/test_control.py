"""The operator's endpoint obeys those who may, and nobody else."""

from __future__ import annotations

import asyncio
import re
import ssl
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path

import pytest
from aiohttp import ClientConnectorError, ClientSession
from aiohttp.client_exceptions import ClientError
from support.certificates import Site

from firable.cli.operate import client_tls
from firable.cli.run import run
from firable.executor.drivers.bench import PATIENCE_S, until
from firable.executor.links.zenoh_link import Certificates
from firable.executor.operating.control import STRANGERS_MAX, Endpoint, new_token, serving, tls_context
from firable.executor.operating.service import unhandled
from firable.executor.operating.situation import Situation, State
from firable.executor.protocol.commands import Answer
from firable.nets.diagnostics import InputError

TOKEN = "a-token-of-some-length"
BEARER = {"Authorization": f"Bearer {TOKEN}"}


class Told:
    """A run that writes down what it is told."""

    def __init__(self, *, obeys: bool = True) -> None:
        self.log: list[str] = []
        self.obeys = obeys

    def situation(self) -> Situation:
        is_at_work = bool(self.log) and "refused" in self.log[-1]  # by writing that down
        return Situation(State.RUNNING if is_at_work else State.WAITING, ("robot.free",))

    def pause(self) -> bool:
        self.log.append("pause")
        return self.obeys

    def resume(self) -> bool:
        self.log.append("resume")
        return self.obeys

    async def step(self) -> str | None:
        self.log.append("step")
        return "G1" if self.obeys else None

    def stop(self, *, at_end_of_cycle: bool = False) -> bool:
        self.log.append("stop at end" if at_end_of_cycle else "stop")
        return self.obeys or not at_end_of_cycle

    def emergency_stop(self, reason: str) -> None:
        self.log.append(f"emergency stop {reason}")

    def reset(self) -> tuple[str, ...]:
        self.log.append("reset")
        return ("D: 'button' is not closed",)

    def say(self, place: str, answer: Answer) -> tuple[str, ...]:
        self.log.append(f"say {place} {answer.name}")
        return () if place == "robot.grasp" else (f"nobody asks after {place}",)

    def commanded(self, command: str, by: str) -> None:
        self.log.append(f"{by}: {command}")

    def not_obeyed(self, command: str, by: str, why: str) -> None:
        self.log.append(f"{by}: {command} refused: {why}")

    def turned_away(self, command: str, by: str) -> None:
        self.log.append(f"{by}: {command} not let in")


def with_endpoint(
    endpoint: Endpoint, ask: Callable[[ClientSession, str], Awaitable[None]], ssl_context: ssl.SSLContext | None = None
) -> list[str]:
    run = Told()

    async def main() -> None:
        async with serving(run, endpoint, lambda: b"firable_firings_total 1.0\n") as url, ClientSession() as session:
            await ask(session, url)

    assert (ssl_context is None) == (endpoint.tls is None)
    asyncio.run(main())
    return run.log


def test_every_command_reaches_the_run_with_the_name_of_who_gave_it() -> None:
    async def ask(session: ClientSession, url: str) -> None:
        for command in ("pause", "step", "resume", "stop-at-end", "stop", "emergency-stop"):
            async with session.post(f"{url}/{command}", headers=BEARER) as answer:
                assert answer.status == 200
                told = await answer.json()
                assert told["state"] == "waiting"
                assert told["marking"] == ["robot.free"]
                assert told.get("fired") == ("G1" if command == "step" else None)

    assert with_endpoint(Endpoint("127.0.0.1", 0, TOKEN), ask) == [
        "an operator: pause",
        "pause",
        "an operator: step",
        "step",
        "an operator: resume",
        "resume",
        "an operator: stop-at-end",
        "stop at end",
        "an operator: stop",
        "stop",
        "emergency stop by an operator",
        "an operator: emergency-stop",
    ]


@pytest.mark.parametrize(
    ("command", "written", "why"),
    [
        ("pause", "pause", "cannot be paused now"),
        ("resume", "resume", "cannot be resumed now"),
        ("step", "step", "only one that is paused is stepped"),
        ("stop-at-end", "stop at end", "cannot be stopped at the end of the cycle now"),
    ],
)
def test_a_command_that_does_nothing_is_refused_in_the_words_of_the_situation(
    command: str, written: str, why: str
) -> None:
    async def main() -> None:
        run = Told(obeys=False)
        async with (
            serving(run, Endpoint("127.0.0.1", 0, TOKEN), lambda: b"") as url,
            ClientSession() as session,
            session.post(f"{url}/{command}", headers=BEARER) as answer,
        ):
            told = await answer.json()
            assert told["refused"] == [f"the run is waiting, and {why}"]
            assert told["state"] == "waiting"
            assert told.get("fired") is None
        assert run.log == [
            f"an operator: {command}",
            written,
            f"an operator: {command} refused: the run is waiting, and {why}",
        ]

    asyncio.run(main())


def test_a_reset_and_what_is_said_of_a_command_are_answered_by_what_is_against_them() -> None:
    async def ask(session: ClientSession, url: str) -> None:
        for path, refused in [
            ("reset", ["D: 'button' is not closed"]),
            ("say?place=robot.grasp&answer=not received", []),
            ("say?place=robot.free&answer=done", ["nobody asks after robot.free"]),
            ("say?place=robot.grasp&answer=unknown", ["say done, working, not received"]),
        ]:
            async with session.post(f"{url}/{path}", headers=BEARER) as answer:
                assert (await answer.json())["refused"] == refused

    log = with_endpoint(Endpoint("127.0.0.1", 0, TOKEN), ask)
    assert [line for line in log if "an operator" not in line] == [
        "reset",
        "say robot.grasp NOT_RECEIVED",
        "say robot.free DONE",
    ]
    assert log[0] == "an operator: reset"
    assert [line for line in log if "refused" in line] == [
        "an operator: reset refused: D: 'button' is not closed",
        "an operator: say robot.free=done refused: nobody asks after robot.free",
        "an operator: say robot.grasp=unknown refused: say done, working, not received",
    ]


@pytest.mark.parametrize("headers", [{}, {"Authorization": "Bearer wrong"}, {"Authorization": f"Basic {TOKEN}"}])
def test_who_shows_no_token_learns_nothing_and_moves_nothing(headers: dict[str, str]) -> None:
    async def ask(session: ClientSession, url: str) -> None:
        for method, path in [
            ("POST", "/stop"),
            ("POST", "/resume"),
            ("POST", "/reset"),
            ("GET", "/situation"),
            ("GET", "/metrics"),
        ]:
            async with session.request(method, url + path, headers=headers) as answer:
                assert answer.status == 401
                assert "robot" not in await answer.text()

    paths = ("/stop", "/resume", "/reset", "/situation", "/metrics")
    assert with_endpoint(Endpoint("127.0.0.1", 0, TOKEN), ask) == [f"127.0.0.1: {one} not let in" for one in paths]


def test_a_stranger_fills_no_trace() -> None:
    async def ask(session: ClientSession, url: str) -> None:
        for number in (*range(STRANGERS_MAX + 20), 0, 1):
            async with session.get(f"{url}/{number % 110}\x1b[31m") as answer:
                assert answer.status == 401

    told = with_endpoint(Endpoint("127.0.0.1", 0, TOKEN), ask)
    assert len(told) == STRANGERS_MAX
    assert told[0] == "127.0.0.1: /0·[31m not let in"


async def sent_raw(url: str, request: bytes) -> bytes:
    """The status of the answer to these bytes."""
    reader, writer = await asyncio.open_connection("127.0.0.1", int(url.rpartition(":")[2]))
    writer.write(request)
    try:
        said = (await reader.readline()).split()
        await reader.read()  # until the other side has dealt with all of it
        return said[1]
    finally:
        writer.close()


HEAD = b"POST /stop HTTP/1.1\r\nHost: cell\r\nConnection: close\r\n"


@pytest.mark.parametrize(
    ("request_", "status", "told"),
    [
        (HEAD + b"Authorization: Bearer \xff\xfe\r\n\r\n", b"401", ["/stop"]),
        (HEAD.replace(b"/stop", b"/st\xff") + b"\r\n", b"400", ["what is no request"]),
        (b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n", b"400", ["what is no request"]),
        (b"SSH-2.0-scanner\r\n\r\n", b"400", ["what is no request"]),
        (
            HEAD + b"Content-Encoding: deflate\r\nContent-Length: 8\r\n\r\nno flate",
            b"401",
            ["/stop", "what is no request"],
        ),
    ],
    ids=["token", "address", "tls", "ssh", "body"],
)
def test_what_is_no_request_or_no_text_lets_nobody_in_and_is_told_of_once(
    request_: bytes, status: bytes, told: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    left: list[object] = []

    async def ask(_session: ClientSession, url: str) -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: left.append(context))
        for _ in range(3):
            assert await sent_raw(url, request_) == status

    lines = with_endpoint(Endpoint("127.0.0.1", 0, TOKEN), ask)
    assert [line.partition(": ")[2] for line in lines] == [f"{one} not let in" for one in told]
    assert left == []
    assert capsys.readouterr() == ("", "")


def test_an_error_in_answering_is_told_by_the_loop(capsys: pytest.CaptureFixture[str]) -> None:
    def figures() -> bytes:
        raise ValueError("no figures")

    told: list[str] = []

    async def main() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: told.append(unhandled(context)))
        endpoint = Endpoint("127.0.0.1", 0, TOKEN)
        async with (
            serving(Told(), endpoint, figures) as url,
            ClientSession(headers=BEARER) as session,
            session.get(f"{url}/metrics") as answer,
        ):
            assert answer.status == 500

    asyncio.run(main())
    (one,) = told
    assert one.startswith(
        "an error that nobody has handled: Error handling request from 127.0.0.1: ValueError: no figures"
    )
    assert capsys.readouterr() == ("", "")


def test_figures_are_served_as_text_for_prometheus() -> None:
    async def ask(session: ClientSession, url: str) -> None:
        async with session.get(f"{url}/metrics", headers=BEARER) as answer:
            assert answer.headers["Content-Type"].startswith("text/plain; version=0.0.4")
            assert await answer.text() == "firable_firings_total 1.0\n"

    with_endpoint(Endpoint("127.0.0.1", 0, TOKEN), ask)


def test_commands_are_not_given_by_looking() -> None:
    async def ask(session: ClientSession, url: str) -> None:
        async with session.get(f"{url}/stop", headers=BEARER) as answer:
            assert answer.status == 405

    assert with_endpoint(Endpoint("127.0.0.1", 0, TOKEN), ask) == []


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "cell.example"])
def test_nothing_is_served_beyond_loopback_without_tls(host: str) -> None:
    with pytest.raises(InputError) as caught:
        Endpoint(host, 0, TOKEN)
    assert caught.value.diagnostics[0].code == "F5060"
    options = {option for parameter in run.params for option in parameter.opts}
    named = set(re.findall(r"--[a-z-]+", caught.value.diagnostics[0].hint))
    assert named
    assert named <= options


def test_a_token_that_can_be_guessed_is_refused() -> None:
    with pytest.raises(InputError) as caught:
        Endpoint("127.0.0.1", 0, "secret")
    assert caught.value.diagnostics[0].code == "F5060"
    assert len(new_token()) >= 32
    assert new_token() != new_token()


def test_an_address_that_is_taken_is_one_clear_error() -> None:
    async def main() -> None:
        async with serving(Told(), Endpoint("127.0.0.1", 0, TOKEN), bytes) as url:
            port = int(url.rpartition(":")[2])
            async with serving(Told(), Endpoint("127.0.0.1", port, TOKEN), bytes):
                pass

    with pytest.raises(InputError) as caught:
        asyncio.run(main())
    assert caught.value.diagnostics[0].code == "F5061"


def test_a_certificate_of_the_authority_names_the_operator_and_no_other_gets_in(tmp_path: Path) -> None:
    site = Site(tmp_path / "site")
    server, anna = site.host("server"), site.host("anna")
    stranger = Site(tmp_path / "elsewhere").host("stranger")

    def client(own: Certificates | None) -> ssl.SSLContext:
        return client_tls(str(site.authority), None if own is None else (own.certificate, own.key))

    async def ask(session: ClientSession, url: str) -> None:
        async with session.post(f"{url}/pause", ssl=client(anna)) as answer:
            assert answer.status == 200
        for own in (stranger, None):
            with pytest.raises((ClientError, ConnectionError, ssl.SSLError)):
                async with session.post(f"{url}/resume", ssl=client(own), headers=BEARER) as answer:
                    await answer.read()

    tls = tls_context(server.certificate, server.key, server.authority)
    assert with_endpoint(Endpoint("127.0.0.1", 0, TOKEN, tls), ask, tls) == ["anna: pause", "pause"]


def test_files_that_are_no_certificate_are_one_clear_error(tmp_path: Path) -> None:
    broken = tmp_path / "broken.pem"
    broken.write_text("no certificate")
    with pytest.raises(InputError) as caught:
        tls_context(str(broken), str(broken), None)
    assert caught.value.diagnostics[0].code == "F5062"


@pytest.mark.parametrize(
    ("valid_days", "why"),
    [
        ((-2, -1), "certificate has expired"),
        ((1, 2), "certificate is not yet valid"),
        (None, "no certificate of an"),
    ],
)
def test_an_authority_by_which_nobody_is_believed_is_refused_before_anybody_comes(
    valid_days: tuple[float, float] | None, why: str, tmp_path: Path
) -> None:
    good, other = Site(tmp_path / "good"), Site(tmp_path / "other", valid_days=valid_days or (-1, 1))
    own, authority = good.host("run"), str(other.authority)
    if valid_days is None:
        authority = good.host("anna").certificate
    tls_context(own.certificate, own.key, own.authority)
    with pytest.raises(InputError, match=why) as caught:
        tls_context(own.certificate, own.key, authority)
    (problem,) = caught.value.diagnostics
    assert problem.code == "F5062"
    assert authority in problem.message
    both = tmp_path / "both.pem"  # one that is good is enough
    both.write_text(Path(authority).read_text() + Path(own.authority).read_text())
    tls_context(own.certificate, own.key, str(both))


@pytest.mark.parametrize("what", ["missing", "empty", "garbage", "folder"])
def test_a_file_that_is_no_authority_is_named_and_not_the_certificate_of_the_endpoint(
    what: str, tmp_path: Path
) -> None:
    own, authority = Site(tmp_path / "site").host("run"), tmp_path / "ca.pem"
    if what == "folder":
        authority.mkdir()
    elif what != "missing":
        authority.write_text("" if what == "empty" else "garbage")
    with pytest.raises(InputError) as caught:
        tls_context(own.certificate, own.key, str(authority))
    (problem,) = caught.value.diagnostics
    assert problem.code == "F5062"
    assert problem.message.startswith(f"the authority of the operators in {authority} cannot be used: ")


def test_an_answer_that_takes_for_ever_does_not_keep_the_process_when_the_run_is_over() -> None:
    class Stepping(Told):
        async def step(self) -> str | None:
            self.log.append("step")
            await asyncio.Event().wait()
            return None

    async def main() -> None:
        run = Stepping()
        async with serving(run, Endpoint("127.0.0.1", 0, TOKEN), bytes) as url, ClientSession() as session:
            asked = asyncio.create_task(session.post(f"{url}/step", headers=BEARER).__aenter__())
            await until(lambda: "step" in run.log, "the request")
        with suppress(ClientError, asyncio.CancelledError):
            await asked

    asyncio.run(asyncio.wait_for(main(), PATIENCE_S))


def test_when_the_run_is_over_nobody_answers() -> None:
    async def main() -> None:
        async with serving(Told(), Endpoint("127.0.0.1", 0, TOKEN), bytes) as url:
            pass
        async with ClientSession() as session:
            with pytest.raises(ClientConnectorError):
                await session.get(f"{url}/situation", headers=BEARER)

    asyncio.run(main())
