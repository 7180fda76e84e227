"""Why a run cannot be operated, in the words of who stands before it: each refusal by a server that gives it."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path

import pytest
from aiohttp import web
from cryptography.x509.oid import ExtendedKeyUsageOID
from support.certificates import Site

from firable.cli.main import main
from firable.cli.operate import Caller, ask, client_tls
from firable.executor.links.zenoh_link import Certificates
from firable.executor.operating.control import tls_context
from firable.nets.diagnostics import InputError


def refused(
    caller: Caller,
    tls: ssl.SSLContext | None = None,
    *,
    answer: object = None,
    scheme: str = "",
    serve: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None] | None] | None = None,
) -> str:
    """What an operator is told who asks a server for the situation."""

    async def situation(_: web.Request) -> web.Response:
        return web.json_response(answer)

    async def main() -> str:
        app = web.Application()
        app.router.add_get("/situation", situation)
        runner = web.AppRunner(app)
        await runner.setup()
        if serve is not None:
            server = await asyncio.start_server(serve, "127.0.0.1", 0)
            port = server.sockets[0].getsockname()[1]
        else:
            await web.TCPSite(runner, "127.0.0.1", 0, ssl_context=tls).start()
            port = runner.addresses[0][1]
        spoken = scheme or ("http" if tls is None else "https")
        try:
            with pytest.raises(InputError) as caught:
                await ask(f"{spoken}://127.0.0.1:{port}", "situation", {}, caller)
        finally:
            await runner.cleanup()
        (problem,) = caught.value.diagnostics
        assert problem.code == "F5063"
        return f"{problem.message.split(str(port))[1].removeprefix(' ')}; {problem.hint}"

    return asyncio.run(main())


def caller(authority: str | None = None, own: Certificates | None = None) -> Caller:
    tls = client_tls(authority, None if own is None else (own.certificate, own.key))
    return Caller("", tls, has_authority=authority is not None, has_certificate=own is not None)


def test_certificates_that_are_not_believed_are_told_apart(tmp_path: Path) -> None:
    site, other = Site(tmp_path / "site"), Site(tmp_path / "other")
    authority, good, anna = str(site.authority), site.host("run"), site.host("anna")

    def server(files: Certificates) -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(files.certificate, files.key)
        return context

    expired, early = site.host("old", valid_days=(-2, -1)), site.host("new", valid_days=(1, 2))
    elsewhere = site.host("elsewhere", address="10.9.8.7")
    shows = "cannot be reached: the certificate that it shows"
    assert refused(caller(authority), server(expired)).startswith(f"{shows} has expired; renew it")
    assert refused(caller(authority), server(early)).startswith(f"{shows} is not valid yet; ")
    assert refused(caller(authority), server(elsewhere)).startswith(f"{shows} is for another address; write the")
    assert refused(caller(str(other.authority)), server(good)).startswith(f"{shows} is of another authority than --ca")
    assert refused(caller(), server(good)) == f"{shows} is of no authority known here; name its authority with --ca"
    of_a_client = site.host("of a client", purpose=ExtendedKeyUsageOID.CLIENT_AUTH)
    assert refused(caller(authority), server(of_a_client)).startswith(f"{shows} is not believed: ")
    demanding = tls_context(good.certificate, good.key, authority)
    closed = "cannot be reached: the connection is closed without an answer; "
    assert refused(caller(authority), demanding).startswith(f"{closed}the run may ask for a certificate")
    assert refused(caller(authority, other.host("eve")), demanding).startswith(f"{closed}the run may not know you")
    assert refused(Caller("x"), demanding, scheme="http").startswith(f"{closed}is it https://")
    assert refused(caller(authority, anna), scheme="https").startswith("cannot be reached: no TLS is spoken there; ")


def test_what_answers_and_is_no_run_is_told_so() -> None:
    assert refused(Caller("x"), answer=[1]).startswith("answers as no run does")
    assert refused(Caller("x"), answer={"state": "well"}).startswith("answers as no run does")
    unlike = {"state": "well", "message": "", "marking": 7, "blocked": []}
    assert refused(Caller("x"), answer=unlike).startswith("answers as no run does")

    def babble(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 3\r\n\r\n{{{")

    assert refused(Caller("x"), serve=babble).startswith("cannot be reached: what answers there is no run")

    def elsewhere(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 307 Gone\r\nLocation: http://127.0.0.1:9/\r\nContent-Length: 0\r\n\r\n")

    assert refused(Caller("x"), serve=elsewhere).startswith("answers 307")

    def greet(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"SSH-2.0-sshd\r\n")

    assert refused(Caller("x"), serve=greet).startswith("cannot be reached: what answers there is no run")


def test_an_answer_without_an_end_is_not_taken_to_its_end() -> None:
    sent = list[int]()

    async def flood(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n\r\n")
        with suppress(ConnectionError):
            while len(sent) < 1024:
                writer.write(b" " * 2**20)
                await writer.drain()
                sent.append(2**20)

    assert refused(Caller("x"), serve=flood).startswith("cannot be reached: what answers there is no run")
    assert 16 * 2**20 < sum(sent) < 64 * 2**20


def test_what_answers_does_not_command_the_terminal_of_who_asks() -> None:
    escape = "\x1b]0;owned\x07\n"
    said = {"state": f"well{escape}", "message": escape, "marking": [escape], "blocked": [escape], "refused": [escape]}

    async def pause(_: web.Request) -> web.Response:
        return web.json_response(said)

    async def metrics(_: web.Request) -> web.Response:
        return web.Response(text=f"a 1\n{escape}")

    async def main() -> None:
        app = web.Application()
        app.router.add_post("/pause", pause)
        app.router.add_get("/metrics", metrics)
        runner = web.AppRunner(app)
        await runner.setup()
        try:
            await web.TCPSite(runner, "127.0.0.1", 0).start()
            for command in ("pause", "metrics"):
                told, _ = await ask(f"http://127.0.0.1:{runner.addresses[0][1]}", command, {}, Caller("x"))
                assert all(line.isprintable() for line in told.split("\n"))
        finally:
            await runner.cleanup()

    asyncio.run(main())


@pytest.mark.parametrize("asks", [True, False])
def test_ones_own_certificate_that_has_expired_is_told_before_it_is_shown(
    asks: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site = Site(tmp_path / "site")
    for days, why in (((-2, -1), "certificate has expired"), ((1, 2), "certificate is not yet valid")):
        own = site.host("anna", valid_days=days)
        if asks:
            address = "https://127.0.0.1:9"
            assert main(["operate", address, "stop", "--ca", own.authority, "--cert", own.certificate, own.key]) == 2
            assert f"error[F5062]: your certificate cannot be used: {why}" in capsys.readouterr().err
        else:
            with pytest.raises(InputError) as caught:
                tls_context(own.certificate, own.key, None)
            assert str(caught.value).endswith(why) or f"cannot be used: {why}" in str(caught.value)
    good, other = site.host("good"), site.host("other")
    tls_context(good.certificate, good.key, str(site.authority))
    with pytest.raises(InputError, match="the key is that of another certificate"):
        tls_context(good.certificate, other.key, None)
    with pytest.raises(InputError, match=r"none\.key: No such file"):
        tls_context(good.certificate, str(tmp_path / "none.key"), None)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["https://nowhere.invalid:1"], "https://nowhere.invalid:1 cannot be reached: no host of that name is known"),
        (["http://127.0.0.1:9"], "http://127.0.0.1:9 cannot be reached: nobody serves there"),
        (["http://127.0.0.1:99999"], "'http://127.0.0.1:99999' is no address"),
        (["http://10.0.0.5:8080"], "the token would be shown to the network on the way to 'http://10.0.0.5:8080'"),
        (["http://127.0.0.1.cell.example"], "the token would be shown to the network"),
        (["http://127.0.0.1@10.0.0.5:8080"], "the token would be shown to the network"),
        (["http://127.0.0.1:9", "--ca", "ca.pem"], "--cert and --ca are of https:// addresses"),
    ],
)
def test_addresses_at_which_no_run_is_are_told(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "token").write_text("0123456789abcdef")
    address, *more = arguments
    assert main(["operate", address, "stop", "--token-file", str(tmp_path / "token"), *more]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "\n", "0123456789abcdef\nfedcba9876543210\n", "of two words"])
def test_a_file_that_holds_no_token_is_told(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "token").write_text(text)
    assert main(["operate", "http://127.0.0.1:9", "stop", "--token-file", str(tmp_path / "token")]) == 2
    assert "error[F1001]" in capsys.readouterr().err


@pytest.mark.parametrize("asks", [True, False])
def test_ones_own_certificate_for_the_other_side_is_no_matter_of_its_date(
    asks: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    side = ExtendedKeyUsageOID.SERVER_AUTH if asks else ExtendedKeyUsageOID.CLIENT_AUTH
    own = Site(tmp_path / "site").host("anna", purpose=side)
    if asks:
        address = "https://127.0.0.1:9"
        assert main(["operate", address, "stop", "--ca", own.authority, "--cert", own.certificate, own.key]) == 2
        said = capsys.readouterr().err
    else:
        with pytest.raises(InputError) as caught:
            tls_context(own.certificate, own.key, None)
        said = f"{caught.value}{caught.value.diagnostics[0].hint}"
    assert "purpose" in said
    assert "clientAuth for who joins or operates" in said
    assert "renew" not in said
