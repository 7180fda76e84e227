"""`firable operate`: act on a run from elsewhere; and the options by which a run lets somebody do so."""

from __future__ import annotations

import json
import os
import ssl
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar
from urllib.parse import urlsplit

import click

from firable.cli.choice import OneOf
from firable.cli.files import READ
from firable.cli.options import warn_of_open_key
from firable.nets.source import printable

if TYPE_CHECKING:
    import aiohttp

    from firable.cli.view.site import Opening
    from firable.executor import Host
    from firable.executor.operating.control import Page
    from firable.executor.operating.service import Service
    from firable.nets.diagnostics import InputError
    from firable.nets.machines.plant_file import PlantModel

F = TypeVar("F", bound=Callable[..., Any])

_READING: Final = ("situation", "metrics")
_COMMANDS: Final = (*_READING, "pause", "resume", "step", "stop", "stop-at-end", "emergency-stop", "reset", "say")
_SECONDS: Final = 10.0
_TOLD: Final = {"state": str, "message": str, "marking": list, "blocked": list}
"""What is in every answer of a run, but for its figures."""
_ANSWER_BYTES_MAX: Final = 16 * 1024 * 1024
"""More than the figures of a cell with thousands of places."""
_TOKEN_CHARACTERS_MAX: Final = 4000
"""More than a line of HTTP takes; nothing that never ends is a token."""
NO_BROWSER: Final = "FIRABLE_NO_BROWSER"
"""The variable of the environment by which an address is told and no browser opened."""


@dataclass(frozen=True)
class ServeOptions:
    """Where a run serves its operator, as the options say."""

    serve: str | None = None
    token_file: str | None = None
    serve_tls: tuple[str, str] | None = None
    operators: str | None = None
    open: bool = False
    """Whether the page of the run is opened in a browser."""

    def service(self, bundle: str, plant: PlantModel | None = None) -> Service | None:
        """The endpoint, whose address and token are told when it is there, or None.

        Its page shows `plant`, and the net as the layout file beside `bundle` arranges it.

        Raises `InputError` F5060, F5062, and F1017 for a token that cannot be kept.
        """
        if self.serve is None and not self.open:
            if self.token_file or self.serve_tls or self.operators:
                raise click.UsageError("say with --serve where an operator may act from elsewhere")
            return None
        if self.operators is not None and self.serve_tls is None:
            raise click.UsageError("--operators is of TLS: name --serve-tls, too")
        if self.operators is not None and self.token_file is not None:
            raise click.UsageError(
                "with --operators a certificate says who comes, and no token: leave out --token-file"
            )
        from firable.executor.operating.control import Endpoint, new_token, tls_context
        from firable.executor.operating.service import Service

        serve = self.serve or "127.0.0.1:0"
        host, _, port = serve.rpartition(":")
        if not host or not port.isdecimal() or int(port) > 65535:
            raise click.UsageError(f"--serve {serve}: write ADDRESS:PORT, such as 127.0.0.1:8080")
        tls = None
        if self.serve_tls is not None:
            tls = tls_context(*self.serve_tls, self.operators)
            warn_of_open_key(self.serve_tls[1])
        token = new_token() if self.token_file is None else _token_kept(Path(self.token_file))
        endpoint = Endpoint(host.strip("[]"), int(port), token, tls)
        opening = None
        if self.open:
            from firable.cli.view.site import Opening

            opening = Opening(token)
        page = partial(_page, bundle=bundle, plant=plant, opening=opening)
        return Service(endpoint, partial(self._served, token, opening), page)

    def _served(self, token: str, opening: Opening | None, address: str) -> None:
        who = f"the token {token}" if self.token_file is None else f"the token in {self.token_file}"
        if self.operators is not None:
            who = f"a certificate of the authority in {self.operators}"
        click.echo(f"operate this run at {address} with {who}", err=True)
        if opening is not None:
            from firable.cli.view.command import show

            show(address, opening, open_it=not os.environ.get(NO_BROWSER))


def _page(host: Host, bundle: str, plant: PlantModel | None, opening: Opening | None) -> Page:
    from firable.cli.pictures import kept_layout
    from firable.cli.text import show_diagnostic
    from firable.cli.view.drawing import PLAIN, Look
    from firable.cli.view.live import LivePage
    from firable.nets.diagnostics import InputError, Severity

    try:
        look = Look(kept_layout(host.net, bundle))
    except InputError as error:  # what is wrong with its picture keeps no cell from running
        look = PLAIN
        for one in error.diagnostics:
            show_diagnostic(replace(one, severity=Severity.WARNING))
    return LivePage(host, plant, look, opening)


def serve_options(command: F) -> F:
    """The options of a run that an operator may act on from elsewhere."""
    for option in (
        click.option(
            "--operators",
            metavar="CA",
            type=READ,
            help="Let in whoever has a certificate of this authority instead.",
        ),
        click.option(
            "--serve-tls", metavar="CERT KEY", type=(READ, READ), help="The certificate and key of that endpoint."
        ),
        click.option("--open", "open_", is_flag=True, help="Open the page of the run in a browser; see docs/view.md."),
        click.option(
            "--token-file",
            metavar="FILE",
            type=READ,
            help="Its token; made, for you alone to read, if there is none.",
        ),
        click.option(
            "--serve",
            metavar="ADDRESS:PORT",
            help="Let an operator act from elsewhere, and Prometheus read the figures; see `firable operate`.",
        ),
    ):
        command = option(command)
    return command


@click.command(short_help="Act on a run from elsewhere: situation, pause, resume, step, stop, reset.")
@click.argument("address", metavar="ADDRESS")
@click.argument("command", type=OneOf(_COMMANDS))
@click.argument("what", metavar="[PLACE=ANSWER]", required=False)
@click.option(
    "--token-file", metavar="FILE", type=READ, help="The file with the token that the run was given or has made."
)
@click.option("--ca", metavar="FILE", type=READ, help="The authority of the run's certificate, for https addresses.")
@click.option("--cert", metavar="CERT KEY", type=(READ, READ), help="Your certificate and its key, instead of a token.")
def operate(
    address: str, command: str, what: str | None, token_file: str | None, ca: str | None, cert: tuple[str, str] | None
) -> int:
    """Do COMMAND on the run that serves at ADDRESS, as `firable run --serve` has printed it.

    After an emergency stop, reset has the machines asked what they did, and resume lets them go on. Of a command of
    which no machine can tell, say PLACE=done, =working or =not-received.

    An emergency stop over a network is a convenience beside the one that is wired, and no safety function.
    """
    import asyncio

    if token_file is None and cert is None:
        raise click.UsageError("say who you are: --token-file, or --cert")
    if token_file is not None and cert is not None:
        raise click.UsageError("a run asks for a token or for a certificate: leave out --token-file or --cert")
    if not address.startswith(("http://", "https://")):
        raise click.UsageError(
            f"'{address}' is no address: write it as the run has printed it, with http:// or https://"
        )
    if token_file is not None and not _is_hidden(address):
        raise click.UsageError(
            f"the token would be shown to the network on the way to '{printable(address)}': beyond this host a run is "
            "served by https:// alone; come through a tunnel to 127.0.0.1, or write https://"
        )
    if (cert or ca) and not address.startswith("https://"):
        raise click.UsageError("--cert and --ca are of https:// addresses")
    said = _said(command, what)
    caller = Caller(
        "" if token_file is None else _token_read(Path(token_file)),
        client_tls(ca, cert) if address.startswith("https://") else None,
        has_authority=ca is not None,
        has_certificate=cert is not None,
    )
    answer, is_refused = asyncio.run(ask(address.rstrip("/"), command, said, caller))
    click.echo(answer, nl=command != "metrics")
    return 1 if is_refused else 0


def _is_hidden(address: str) -> bool:
    """Whether nobody on the way to an address reads what is shown there."""
    from firable.executor.loopback import is_loopback

    try:
        host = urlsplit(address).hostname
    except ValueError:  # what is no address is told as such where it is asked
        return True
    return address.startswith("https://") or host is None or is_loopback(host)


def _said(command: str, what: str | None) -> dict[str, str]:
    """What is told with a command; raises `click.UsageError` where it is not what the command takes."""
    from firable.executor.protocol.commands import SAID

    if command != "say":
        if what is not None:
            raise click.UsageError(f"{command} takes nothing after it: leave out '{what}'; PLACE=ANSWER is for say")
        return {}
    place, _, word = (what or "").partition("=")
    if not place or word not in SAID:
        raise click.UsageError("say what became of a command: say PLACE=done, =working or =not-received")
    return {"place": place, "answer": SAID[word].value}


@dataclass(frozen=True)
class Caller:
    """Who asks a run, and whom they believe."""

    token: str = ""
    tls: ssl.SSLContext | None = None
    has_authority: bool = False
    has_certificate: bool = False


async def ask(address: str, command: str, said: dict[str, str], caller: Caller) -> tuple[str, bool]:
    """What the run answers, and whether it has refused to do it; raises `InputError` F5063."""
    import aiohttp

    from firable.cli.unreached import refusal, unreached

    method = "GET" if command in _READING else "POST"
    headers = {"Authorization": f"Bearer {caller.token}"} if caller.token else {}
    timeout = aiohttp.ClientTimeout(total=_SECONDS)
    hint = "is that the address that the run has printed?"
    try:
        async with (
            aiohttp.ClientSession(timeout=timeout) as session,
            session.request(
                method,
                f"{address}/{command}",
                params=said,
                headers=headers,
                ssl=caller.tls or True,
                allow_redirects=False,  # no run sends its operator elsewhere
            ) as answer,
        ):
            if answer.status == 401:
                raise refusal(f"{address} does not let you in", "show the token, or the certificate, of this run")
            if answer.status != 200:
                raise refusal(f"{address} answers {answer.status}", hint)
            body = await _whole(answer)
            if command == "metrics":
                return "".join(f"{printable(line)}\n" for line in body.decode().splitlines()), False
            told = json.loads(body)
            if not isinstance(told, dict) or not all(isinstance(told.get(key), kind) for key, kind in _TOLD.items()):
                raise refusal(f"{address} answers as no run does", hint)
            return _told(told), bool(told.get("refused"))
    except aiohttp.InvalidURL:
        raise click.UsageError(f"'{address}' is no address: write it as the run has printed it") from None
    except (aiohttp.ClientError, OSError, TimeoutError, ValueError, RecursionError) as error:  # no JSON, no text
        raise unreached(
            address, error, has_authority=caller.has_authority, has_certificate=caller.has_certificate
        ) from None


async def _whole(answer: aiohttp.ClientResponse) -> bytes:
    """The body of an answer; raises `ValueError` where it is longer than any run has to tell."""
    body = bytearray()
    async for some in answer.content.iter_any():
        body += some
        if len(body) > _ANSWER_BYTES_MAX:
            raise ValueError("the answer has no end")
    return bytes(body)


def _told(answer: dict[str, Any]) -> str:
    first, *more = str(answer["message"]).split("; ")  # a run that is held has a sentence for each command
    lines = [f"{answer['state']}: {first}" if first else str(answer["state"]), *(f"  {one}" for one in more)]
    if "fired" in answer and not answer.get("refused"):
        lines.insert(0, f"fired {answer['fired']}" if answer["fired"] else "no transition has fired")
    lines[:0] = [f"refused: {why}" for why in answer.get("refused", ())]
    lines.append(f"  tokens on {', '.join(map(str, answer['marking']))}")
    # Whatever answers there, the terminal is the operator's.
    return "\n".join(map(printable, [*lines, *(f"  {blocked}" for blocked in answer["blocked"])]))


def _token_kept(path: Path) -> str:
    """The token in a file, which is made with a new one if there is none."""
    from firable.executor.operating.control import new_token
    from firable.nets.secret_files import is_open_to_all
    from firable.nets.writing import stands, write_secret

    if stands(path):
        token = _token_read(path)
        if is_open_to_all(path):
            raise _open_to_all(path)
        return token
    token = new_token()
    write_secret(path, f"{token}\n".encode("ascii"))
    return token


def _token_read(path: Path) -> str:
    try:
        with path.open(encoding="ascii") as opened:
            token = opened.read(_TOKEN_CHARACTERS_MAX + 1).strip()
    except UnicodeDecodeError:
        reason = "it has a character that is none of ASCII, such as the mark that some editors put at the beginning"
        raise _file_refusal(path, ValueError(reason)) from None
    except (OSError, ValueError) as error:
        raise _file_refusal(path, error) from None
    if not token or not token.isprintable() or " " in token:
        raise _file_refusal(path, ValueError("it is empty" if not token else "it is not one word in one line"))
    if len(token) > _TOKEN_CHARACTERS_MAX:
        raise _file_refusal(path, ValueError(f"it has more than {_TOKEN_CHARACTERS_MAX} characters"))
    return token


def _open_to_all(path: Path) -> InputError:
    from firable.nets.diagnostics import Diagnostic, InputError

    name = printable(str(path))
    hint = f"`chmod o-rw {name}`; where somebody may have done that, remove it: the run makes another"
    return InputError([Diagnostic("F5060", f"{name}: everybody on this host can read this token, or change it", hint)])


def _file_refusal(path: Path, error: Exception) -> InputError:
    from firable.nets.diagnostics import Diagnostic, InputError

    reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
    message = f"{printable(str(path))}: no token: {reason}"
    return InputError([Diagnostic("F1001", message, "name the file of the token")])


def client_tls(ca: str | None, cert: tuple[str, str] | None) -> ssl.SSLContext:
    """The operator's side of TLS: whom he believes, and what he shows. Raises `InputError` F5062."""
    from firable.executor.operating.own_certificate import fault_of, remedy_of, unloaded
    from firable.nets.diagnostics import Diagnostic, InputError

    what, files, hint = "the certificate of the authority", [ca] if ca else [], "name PEM files"
    fault = None
    try:
        context = ssl.create_default_context(cafile=ca)
        # Python demands more from 3.13 on, such as key identifiers; a run is reached from any host, or from none.
        context.verify_flags &= ~ssl.VERIFY_X509_STRICT
        if cert is not None:
            what, files = "your certificate", list(cert)
            context.load_cert_chain(*cert)
            warn_of_open_key(cert[1])
            if fault := fault_of(*cert, is_server=False):
                hint = remedy_of(fault)
    except (OSError, ValueError) as error:
        fault = unloaded(error, *files)
    if fault is not None:
        raise InputError([Diagnostic("F5062", f"{what} cannot be used: {fault}", hint)])
    return context
