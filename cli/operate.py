"""`firable operate`: act on a run from elsewhere; and the options by which a run lets somebody do so."""

from __future__ import annotations

import os
import ssl
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from firable.cli.choice import OneOf

if TYPE_CHECKING:
    from firable.executor import Host
    from firable.executor.operating.control import Page
    from firable.executor.operating.service import Service
    from firable.nets.diagnostics import InputError
    from firable.nets.machines.plant_file import PlantModel

F = TypeVar("F", bound=Callable[..., Any])

_READING: Final = ("situation", "metrics")
_COMMANDS: Final = (*_READING, "pause", "resume", "step", "stop", "stop-at-end", "emergency-stop", "reset", "say")
_SECONDS: Final = 10.0
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
        from firable.executor.operating.control import Endpoint, new_token, tls_context
        from firable.executor.operating.service import Service

        serve = self.serve or "127.0.0.1:0"
        host, _, port = serve.rpartition(":")
        if not host or not port.isdecimal() or int(port) > 65535:
            raise click.UsageError(f"--serve {serve}: write ADDRESS:PORT, such as 127.0.0.1:8080")
        tls = None if self.serve_tls is None else tls_context(*self.serve_tls, self.operators)
        token = new_token() if self.token_file is None else _token_kept(Path(self.token_file))
        endpoint = Endpoint(host.strip("[]"), int(port), token, tls)
        return Service(endpoint, partial(self._served, token), partial(_page, bundle=bundle, plant=plant))

    def _served(self, token: str, address: str) -> None:
        _tell_served(token, self.token_file, address)
        if self.open:
            from firable.cli.view.command import show

            show(f"{address}/#token={token}", open_it=not os.environ.get(NO_BROWSER))


def _page(host: Host, bundle: str, plant: PlantModel | None) -> Page:
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
    return LivePage(host, plant, look)


def serve_options(command: F) -> F:
    """The options of a run that an operator may act on from elsewhere."""
    for option in (
        click.option("--operators", metavar="CA", help="Let in whoever has a certificate of this authority instead."),
        click.option("--serve-tls", metavar="CERT KEY", nargs=2, help="The certificate and key of that endpoint."),
        click.option("--open", "open_", is_flag=True, help="Open the page of the run in a browser; see docs/view.md."),
        click.option("--token-file", metavar="FILE", help="Its token; made, for you alone to read, if there is none."),
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
@click.option("--token-file", metavar="FILE", help="The file with the token that the run was given or has made.")
@click.option("--ca", metavar="FILE", help="The authority of the run's certificate, for https addresses.")
@click.option("--cert", metavar="CERT KEY", nargs=2, help="Your certificate and its key, instead of a token.")
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
    if not address.startswith(("http://", "https://")):
        raise click.UsageError(
            f"'{address}' is no address: write it as the run has printed it, with http:// or https://"
        )
    token = "" if token_file is None else _token_read(Path(token_file))
    context = _client_tls(ca, cert) if address.startswith("https://") else None
    place, is_said, word = (what or "").partition("=")
    if (command == "say") != bool(is_said and place and word) or (what is not None and command != "say"):
        raise click.UsageError("say what became of a command: say PLACE=done, =working or =not-received")
    said = {"place": place, "answer": word.replace("-", " ")} if command == "say" else {}
    answer, is_refused = asyncio.run(_asked(address.rstrip("/"), command, said, token, context))
    click.echo(answer, nl=command != "metrics")
    return 1 if is_refused else 0


async def _asked(
    address: str, command: str, said: dict[str, str], token: str, context: ssl.SSLContext | None
) -> tuple[str, bool]:
    """What the run answers, and whether it has refused to do it."""
    import aiohttp

    method = "GET" if command in _READING else "POST"
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    timeout = aiohttp.ClientTimeout(total=_SECONDS)
    try:
        async with (
            aiohttp.ClientSession(timeout=timeout) as session,
            session.request(
                method, f"{address}/{command}", params=said, headers=headers, ssl=context or True
            ) as answer,
        ):
            if answer.status == 401:
                raise _refusal(f"{address} does not let you in", "show the token, or the certificate, of this run")
            if answer.status != 200:
                raise _refusal(f"{address} answers {answer.status}", "is that the address that the run has printed?")
            if command == "metrics":
                return await answer.text(), False
            told = await answer.json()
            return _told(told), bool(told.get("refused"))
    except (aiohttp.ClientError, ssl.SSLError, OSError, TimeoutError) as error:
        reason = str(error) or "it does not answer"
        hint = "has the run ended? is the address, or the certificate, another one?"
        raise _refusal(f"{address} cannot be reached: {reason}", hint) from None


def _told(answer: dict[str, Any]) -> str:
    lines = [f"{answer['state']}: {answer['message']}" if answer["message"] else str(answer["state"])]
    if "fired" in answer and not answer.get("refused"):
        lines.insert(0, f"fired {answer['fired']}" if answer["fired"] else "nothing is enabled")
    lines[:0] = [f"refused: {why}" for why in answer.get("refused", ())]
    lines.append(f"  tokens on {', '.join(answer['marking'])}")
    return "\n".join([*lines, *(f"  {blocked}" for blocked in answer["blocked"])])


def _tell_served(token: str, token_file: str | None, address: str) -> None:
    who = f"the token in {token_file}" if token_file is not None else f"the token {token}"
    click.echo(f"operate this run at {address} with {who}", err=True)


def _token_kept(path: Path) -> str:
    """The token in a file, which is made with a new one if there is none."""
    from firable.executor.operating.control import new_token

    if path.exists():
        return _token_read(path)
    token = new_token()
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except (OSError, ValueError) as error:
        raise _file_refusal("F1017", path, error) from None
    with os.fdopen(descriptor, "w", encoding="ascii") as stream:
        stream.write(f"{token}\n")
    return token


def _token_read(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        raise _file_refusal("F1001", path, error) from None


def _file_refusal(code: str, path: Path, error: Exception) -> InputError:
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
    return InputError([Diagnostic(code, f"{printable(str(path))}: no token: {reason}", "name the file of the token")])


def _client_tls(ca: str | None, cert: tuple[str, str] | None) -> ssl.SSLContext:
    from firable.nets.diagnostics import Diagnostic, InputError

    try:
        context = ssl.create_default_context(cafile=ca)
        if cert is not None:
            context.load_cert_chain(*cert)
    except (OSError, ssl.SSLError) as error:
        message = f"the certificate, or that of the authority, cannot be used: {error.strerror or error}"
        raise InputError([Diagnostic("F5062", message, "name PEM files")]) from None
    return context


def _refusal(message: str, hint: str) -> InputError:
    from firable.nets.diagnostics import Diagnostic, InputError

    return InputError([Diagnostic("F5063", message, hint)])
