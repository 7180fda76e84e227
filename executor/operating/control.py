"""The operator from elsewhere: what a person at the cell can do, over HTTP, for those who may.

    GET  /situation                  what the run is doing, and what waits for what
    GET  /metrics                    its figures, for Prometheus
    POST /pause  /resume  /step      let nothing fire; let fire; fire one transition
    POST /stop                       stop every machine where it is, and end the run
    POST /stop-at-end                let no new work in, and end when the cell, or what of it is here, is empty
    POST /emergency-stop             drive the safe outputs at once
    POST /reset                      after an emergency stop: have the machines asked what they did; nothing moves
    POST /say?place=P&answer=A       of a command of which no machine can tell: done, working, not received

With a `Page` the endpoint serves that to a browser as well: its files, in which nothing of the run stands, to anybody,
for a browser shows no token when it opens an address; and what it asks then, to those who may.

*Who may* is asked of every request, reading ones too: a bearer token, compared in constant time, or, where a client
authority is named, a certificate that it signed. Nothing is trusted for coming from this host, because a page in a
browser here can post to it. Beyond loopback nothing is served without TLS: a token in the clear is everybody's.
Each command is a line of the trace, with the name of who gave it.

This is no safety function: an emergency stop over a network is a convenience beside the one that is wired.

`aiohttp` serves inside the event loop of the run, so a command is one act like any other and needs no lock, but for a
step. Rejected: a server process of its own (uvicorn), which takes the signals of the process, Ctrl-C first.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import socket
import ssl
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Collection, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from typing import Final, Protocol
from weakref import WeakSet

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError
from aiohttp.typedefs import Handler, Middleware

from firable.executor.loopback import is_loopback
from firable.executor.operating.door import CONNECTIONS_MAX, Door, listening_at
from firable.executor.operating.own_certificate import fault_of, fault_of_authority, remedy_of, unloaded
from firable.executor.operating.situation import Situation, State
from firable.executor.protocol.commands import SAID, Answer
from firable.executor.reasons import reason
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import printable

METRICS_CONTENT_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"
_SAID: Final = tuple(answer.value for answer in SAID.values())
STRANGERS_MAX: Final = 100
"""So many lines of a trace tell of those who were not let in."""
_LET_IN: Final = web.AppKey("let_in", WeakSet[asyncio.BaseTransport])
"""The connections on which somebody was let in."""
SHUTDOWN_SECONDS: Final = 1.0
"""So long what is being answered may take once the run is over; then the process ends, whatever a client does."""


class Operated(Protocol):
    """A run that an operator may act on."""

    def situation(self) -> Situation:
        """What the run is doing."""
        ...

    def pause(self) -> bool:
        """Let nothing fire any more; whether it can be paused."""
        ...

    def resume(self) -> bool:
        """Let transitions fire again; whether they may."""
        ...

    async def step(self) -> str | None:
        """While paused, fire one transition; its name, or None."""
        ...

    def stop(self, *, at_end_of_cycle: bool = False) -> bool:
        """End the run; whether it can be ended so."""
        ...

    def emergency_stop(self, reason: str) -> None:
        """Drive the safe outputs at once."""
        ...

    def reset(self) -> Collection[str]:
        """End the latch after an emergency stop; what is against it."""
        ...

    def say(self, place: str, answer: Answer) -> tuple[str, ...]:
        """Say what became of a command; why that does not count, where nobody asks after it."""
        ...

    def commanded(self, command: str, by: str) -> None:
        """Keep in the trace who commanded what."""
        ...

    def not_obeyed(self, command: str, by: str, why: str) -> None:
        """Keep in the trace which of these was refused, and why."""
        ...

    def turned_away(self, command: str, by: str) -> None:
        """Keep in the trace who has asked for what and was not let in."""
        ...


class Page(Protocol):
    """What an endpoint serves to a browser, beside its commands."""

    @property
    def public(self) -> Collection[str]:
        """The paths that are served to anybody."""
        ...

    def routes(self) -> Iterable[web.AbstractRouteDef]:
        """All that it serves."""
        ...


@dataclass(frozen=True)
class Endpoint:
    """Where to serve, and for whom; raises `InputError` F5060 where that is open to everybody.

    `token` is what a bearer shows; with `tls` whose context demands client certificates, one of those suffices too.
    """

    host: str
    port: int
    token: str
    tls: ssl.SSLContext | None = None

    def __post_init__(self) -> None:
        if self.tls is None and not is_loopback(self.host):
            message = f"the operator's endpoint would be open on {self.host}, without TLS"
            hint = "give --serve-tls CERT KEY, or serve on 127.0.0.1 and come through a tunnel"
            raise InputError([Diagnostic("F5060", message, hint)])
        if len(self.token) < 16:
            message = "the token of the operator's endpoint has fewer than 16 characters"
            raise InputError([Diagnostic("F5060", message, "let `firable run` make one, or draw one at random")])

    @property
    def demands_certificates(self) -> bool:
        """Whether the connection itself says who comes."""
        return self.tls is not None and self.tls.verify_mode is ssl.CERT_REQUIRED


class Strangers:
    """Those who were not let in: told of once for each address and path, and `STRANGERS_MAX` at most.

    No trace is theirs to fill.
    """

    def __init__(self, tell: Callable[[str, str], None] = lambda _what, _by: None) -> None:
        self.tell = tell
        self.told: set[tuple[str, str]] = set()

    def turned_away(self, what: str, by: str | None) -> None:
        """Somebody has asked for what, and was not let in."""
        stranger = printable(what[:100]), by or "somebody"
        if stranger not in self.told and len(self.told) < STRANGERS_MAX:
            self.told.add(stranger)
            self.tell(*stranger)


class _Complaints(logging.Handler):
    """What aiohttp has to say of requests, which it would write to the terminal with all its calls.

    What is no request, in head or body, comes from a stranger; an error in answering one is the event loop's to tell.
    """

    def __init__(self, strangers: Strangers) -> None:
        super().__init__()
        self.strangers = strangers

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, HttpProcessingError | web.RequestPayloadError):
            by = record.args[0] if isinstance(record.args, tuple) and record.args else None
            self.strangers.turned_away("what is no request", None if by is None else str(by))
        elif record.levelno >= logging.ERROR:
            asyncio.get_running_loop().call_exception_handler({"message": record.getMessage(), "exception": error})


@asynccontextmanager
async def serving(
    run: Operated, endpoint: Endpoint, figures: Callable[[], bytes], page: Page | None = None
) -> AsyncIterator[str]:
    """Serve a run for as long as the context lasts; gives the address that is served.

    Raises `InputError` F5061 where the address cannot be had.
    """
    strangers = Strangers(run.turned_away)
    async with listening(application(run, endpoint, figures, page, strangers), endpoint, strangers) as address:
        yield address


async def sockets_of(endpoint: Endpoint) -> list[socket.socket]:
    """The sockets that listen at the address of an endpoint; raises `InputError` F5061."""
    try:
        return await listening_at(endpoint.host, endpoint.port)
    except OSError as error:
        message = f"nothing can be served at {endpoint.host}:{endpoint.port}: {reason(error)}"
        raise InputError([Diagnostic("F5061", message, "name another port; 0 takes a free one")]) from None


@asynccontextmanager
async def listening(app: web.Application, endpoint: Endpoint, strangers: Strangers | None = None) -> AsyncIterator[str]:
    """Serve an application for as long as the context lasts; gives the address, and raises `InputError` F5061."""
    complaints = logging.Logger("firable.endpoint")  # of its own: several in one process tell different runs
    strangers = strangers or Strangers()
    complaints.addHandler(_Complaints(strangers))
    let_in = WeakSet[asyncio.BaseTransport]()
    app[_LET_IN] = let_in
    runner = web.AppRunner(app, access_log=None, logger=complaints, shutdown_timeout=SHUTDOWN_SECONDS)
    await runner.setup()
    made = runner.server
    if made is None:
        raise AssertionError("a runner that is set up has a server")
    too_many = f"more than {CONNECTIONS_MAX} connections at once"
    door = Door(made, endpoint.tls, let_in, partial(strangers.turned_away, too_many))
    keepers: list[asyncio.Task[None]] = []
    sockets = []
    try:
        sockets = await sockets_of(endpoint)
        keepers += [asyncio.create_task(door.keep(one)) for one in sockets]
        host, port = sockets[0].getsockname()[:2]
        shown = f"[{host}]" if ":" in host else host
        yield f"{'http' if endpoint.tls is None else 'https'}://{shown}:{port}"
    finally:
        for keeper in keepers:
            keeper.cancel()
        await asyncio.gather(*keepers, return_exceptions=True)
        for one in sockets:
            one.close()
        await door.close()
        await runner.cleanup()


def admission(endpoint: Endpoint, public: Collection[str], strangers: Strangers | None = None) -> Middleware:
    """Let only those reach a handler who may, but for the paths that are public."""
    strangers = strangers or Strangers()

    @web.middleware
    async def who_may(request: web.Request, handler: Handler) -> web.StreamResponse:
        if request.path not in public and _name_of(request, endpoint) is None:
            strangers.turned_away(request.path, request.remote)
            return web.json_response(
                {"error": "who are you? show the token"}, status=401, headers={"WWW-Authenticate": "Bearer"}
            )
        if request.path not in public and _LET_IN in request.app and request.transport is not None:
            request.app[_LET_IN].add(request.transport)
        return await handler(request)

    return who_may


def application(
    run: Operated,
    endpoint: Endpoint,
    figures: Callable[[], bytes],
    page: Page | None = None,
    strangers: Strangers | None = None,
) -> web.Application:
    """The endpoint as an application; every handler runs only for who may, but for those of a page's own files."""

    def who(request: web.Request) -> str:
        return _name_of(request, endpoint) or ""

    async def situation(_: web.Request) -> web.Response:
        return web.json_response(_situation(run))

    async def metrics(_: web.Request) -> web.Response:
        return web.Response(body=figures(), headers={"Content-Type": METRICS_CONTENT_TYPE})

    def commanding(
        command: str, act: Callable[[], bool], unable: str
    ) -> Callable[[web.Request], Awaitable[web.Response]]:
        async def handler(request: web.Request) -> web.Response:
            run.commanded(command, who(request))
            refused = [] if act() else [f"the run is {run.situation().state}, and cannot be {unable} now"]
            return answered(request, command, refused)

        return handler

    def answered(request: web.Request, command: str, refused: Collection[str], **more: object) -> web.Response:
        """The answer to a command that may have been refused, which stands in the trace, too."""
        now = _situation(run)  # as it was refused in; to note that is something that the run does
        if refused:
            run.not_obeyed(command, who(request), "; ".join(refused))
        return web.json_response({**more, "refused": list(refused), **now})

    async def step(request: web.Request) -> web.Response:
        run.commanded("step", who(request))
        fired = await run.step()
        now = run.situation().state
        refused = [] if fired or now is State.PAUSED else [f"the run is {now}, and only one that is paused is stepped"]
        return answered(request, "step", refused, fired=fired)

    async def emergency_stop(request: web.Request) -> web.Response:
        by = who(request)
        run.emergency_stop(f"by {by}")  # before anything else, a line of the trace included
        run.commanded("emergency-stop", by)
        return web.json_response(_situation(run))

    async def reset(request: web.Request) -> web.Response:
        run.commanded("reset", who(request))
        return answered(request, "reset", run.reset())

    async def say(request: web.Request) -> web.Response:
        place, word = request.query.get("place", ""), request.query.get("answer", "")
        command = f"say {place}={word}"
        run.commanded(command, who(request))
        refused = run.say(place, Answer(word)) if word in _SAID else (f"say {', '.join(_SAID)}",)
        return answered(request, command, refused)

    who_may = admission(endpoint, () if page is None else page.public, strangers)
    app = web.Application(middlewares=[who_may], client_max_size=1024)
    app.router.add_get("/situation", situation)
    app.router.add_get("/metrics", metrics)
    app.router.add_post("/pause", commanding("pause", run.pause, "paused"))
    app.router.add_post("/resume", commanding("resume", run.resume, "resumed"))
    app.router.add_post("/step", step)
    app.router.add_post("/stop", commanding("stop", run.stop, "stopped"))
    at_end = partial(run.stop, at_end_of_cycle=True)
    app.router.add_post("/stop-at-end", commanding("stop-at-end", at_end, "stopped at the end of the cycle"))
    app.router.add_post("/emergency-stop", emergency_stop)
    app.router.add_post("/reset", reset)
    app.router.add_post("/say", say)
    if page is not None:
        app.router.add_routes(page.routes())
    return app


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(24)


def tls_context(certificate: str, key: str, client_authority: str | None) -> ssl.SSLContext:
    """The server's side of TLS; with an authority, of clients that it has signed only. Raises `InputError` F5062."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    whose, hint = "the certificate of the operator's endpoint", ""
    try:
        context.load_cert_chain(certificate, key)
        if fault := fault_of(certificate, key, is_server=True):
            hint = remedy_of(fault)
    except (OSError, ValueError) as error:
        fault = unloaded(error, certificate, key)
        hint = "name PEM files of a certificate and its key"
    if fault is None and client_authority is not None:
        whose = f"the authority of the operators in {printable(client_authority)}"
        hint = "name the certificate that has signed those of the operators, and look at the clock of this host"
        try:
            context.load_verify_locations(client_authority)
            context.verify_mode = ssl.CERT_REQUIRED
            fault = fault_of_authority(client_authority, time.time())
        except (OSError, ValueError) as error:
            fault = unloaded(error, client_authority)
    if fault is not None:
        message = f"{whose} cannot be used: {fault}"
        raise InputError([Diagnostic("F5062", message, hint)])
    return context


def _name_of(request: web.Request, endpoint: Endpoint) -> str | None:
    """Who comes: the common name of the certificate, or "an operator" by the token; None where neither is shown."""
    if endpoint.demands_certificates and request.transport is not None:
        certificate = request.transport.get_extra_info("peercert") or {}
        names = [value for rdn in certificate.get("subject", ()) for key, value in rdn if key == "commonName"]
        return names[0] if names else "a certificate without a name"
    scheme, _, shown = request.headers.get("Authorization", "").partition(" ")
    if scheme == "Bearer" and secrets.compare_digest(shown.encode(errors="surrogateescape"), endpoint.token.encode()):
        return "an operator"
    return None


def _situation(run: Operated) -> dict[str, object]:
    now = run.situation()
    return {
        "state": now.state.value,
        "message": now.message,
        "marking": list(now.marking),
        "blocked": [str(blocked) for blocked in now.blocked],
    }
