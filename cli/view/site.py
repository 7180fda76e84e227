"""The files of the page, and what a browser is told to let it do.

They are served to anybody who reaches this address, which only this host does, and hold nothing of a net. The token
comes to the page in the fragment of its address (`#token=...`), which browsers send to nobody, and is shown with each
request as `executor/operating/control.py` demands; a cookie would be sent by any page that posts here.

The address with which a browser is started stands among the processes of this host, for everybody to read and as long
as the browser runs. So that one holds no token: it leads to the page once, to whoever comes first (`Opening`).

The page may load nothing from elsewhere and be framed by nobody. Rejected: files with the hash of their content in
their names, which live long in a cache. Here they come over loopback, and what is built can be compared by its names.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Awaitable, Callable, Iterable, Mapping
from importlib.resources import files
from typing import Any, Final

from aiohttp import web

from firable.nets.diagnostics import Diagnostic, InputError

_TYPES: Final[Mapping[str, str]] = {
    "index.html": "text/html; charset=utf-8",
    "page.js": "text/javascript; charset=utf-8",
    "page.css": "text/css; charset=utf-8",
    "icon.svg": "image/svg+xml",
}
_HEADERS: Final[Mapping[str, str]] = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self'; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
PUBLIC: Final = frozenset({"/", *(f"/{name}" for name in _TYPES)})
"""The paths that anybody may read."""
BODY_BYTES_MAX: Final = 4_000_000

Answer = Callable[[dict[str, Any]], Any]
"""What answers a request: from its JSON object to JSON data."""


class Opening:
    """An address that leads one browser, once, to the page with its token."""

    def __init__(self, token: str) -> None:
        self.token = token
        self.path = f"/open/{secrets.token_urlsafe(24)}"
        self.is_used = False

    def routes(self) -> Iterable[web.AbstractRouteDef]:
        """The route of that address."""
        yield web.get(self.path, self.lead, allow_head=False)

    async def lead(self, _: web.Request) -> web.Response:
        """Lead on whoever is the first to come; whoever comes then may enter the token."""
        is_first, self.is_used = not self.is_used, True
        where = f"/#token={self.token}" if is_first else "/"
        return web.Response(status=303, headers={**_HEADERS, "Location": where})


def file_routes() -> Iterable[web.AbstractRouteDef]:
    """The routes of the page's own files."""
    for name, content_type in _TYPES.items():
        handler = _serving(name, content_type)
        yield web.get(f"/{name}", handler)
        if name == "index.html":
            yield web.get("/", handler)


def _serving(name: str, content_type: str) -> Callable[[web.Request], Awaitable[web.Response]]:
    async def handler(_: web.Request) -> web.Response:
        body = files("firable.cli.view").joinpath("built", name).read_bytes()
        return web.Response(body=body, headers={**_HEADERS, "Content-Type": content_type})

    return handler


def answering(answer: Callable[[dict[str, Any]], Awaitable[Any]]) -> Callable[[web.Request], Awaitable[web.Response]]:
    """A handler that answers JSON with JSON; what is refused comes back as its diagnostics, with status 422."""

    async def handler(request: web.Request) -> web.Response:
        try:
            asked = await _asked(request)
            return told(await answer(asked))
        except InputError as error:
            return told({"errors": [diagnostic_json(one) for one in error.diagnostics]}, 422)

    return handler


async def _asked(request: web.Request) -> dict[str, Any]:
    if request.method == "GET":
        return {}
    try:
        asked = json.loads(await request.read())  # in UTF-8, whatever the request says of its charset
    except (ValueError, RecursionError, web.RequestPayloadError):
        asked = None
    if not isinstance(asked, dict):
        raise refusal("a request that is no JSON object")
    return asked


def told(data: Any, status: int = 200) -> web.Response:
    """JSON data as an answer."""
    return web.json_response(data, status=status, headers={"Cache-Control": "no-store"})


def refusal(message: str) -> InputError:
    """A request that this server does not understand: the page and the server are of two versions, or it is no page."""
    return InputError([Diagnostic("F5070", message, "load the page again; its server may be another one now")])


def diagnostic_json(one: Diagnostic) -> dict[str, object]:
    """A diagnostic for the page: what is wrong, where, and what to write instead."""
    return {
        "code": one.code,
        "severity": one.severity.value,
        "message": one.message,
        "hint": one.hint,
        "line": None if one.span is None else one.span.line,
        "column": None if one.span is None else one.span.column,
        "length": None if one.span is None else one.span.length,
    }
