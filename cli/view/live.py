"""The page of a running cell, or of one host of it: what it shows, as the run goes on.

The page follows a stream of frames, JSON a line. A frame is what is so *now* (the marking, the signals, what may fire
and what waits for what, the votes) with what has happened since the frame before; so a slow browser gets fewer frames,
and never old ones, and the run waits for nobody. Frames come at most `FRAMES_PER_SECOND` times a second, however fast
the cell is, and at least once in `HEARTBEAT_SECONDS`, by whose absence the page sees that the connection is lost.

A host among others shows what is of its controllers: their places and signals, and their parts of the transitions that
they take part in, under the names that these have in the cell. Nothing is commanded here: stop, pause and the others
are those of the operator's endpoint, by its rules (`executor/operating/control.py`).

What may fire is judged by the executor's own token player, since that is what runs. It looks again only at a
transition that reads something that has changed. A host among others judges its parts alone: a transition whose part
is ready here is shown as one that waits, for whom else it needs, until all that it knows of are ready.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Collection, Iterable
from typing import Any, Final

from aiohttp import web

from firable.cli.view import moment
from firable.cli.view.drawing import PLAIN, Look, Pictures
from firable.cli.view.lanes import Lanes
from firable.cli.view.moment import Moment
from firable.cli.view.scene import Stage
from firable.cli.view.site import PUBLIC, Opening, answering, file_routes
from firable.cli.view.top_view import top_of
from firable.cli.view.votes import awaited, votes
from firable.executor import Host
from firable.executor.operating.latch import may_stay
from firable.executor.operating.restart import asked_of_the_operator
from firable.executor.protocol.token_player import TokenPlayer, Word
from firable.nets.drawing.part import everybody, part_of
from firable.nets.machines.fitting import misfits
from firable.nets.machines.plant_file import PlantModel
from firable.semantics.joining import APPLIED, STANDS, VOTED
from firable.semantics.trace import CommandSent, Event, Fired, Noted, SignalChanged

FRAMES_PER_SECOND: Final = 20.0
HEARTBEAT_SECONDS: Final = 0.5
HAPPENED_MAX: Final = 300
"""So many events a frame tells at most, the newest."""


class LivePage:
    """The page of a host, or of a whole run."""

    def __init__(
        self, host: Host, plant: PlantModel | None = None, look: Look = PLAIN, opening: Opening | None = None
    ) -> None:
        self.host = host
        self.opening = opening
        self.owners = None if host.is_whole else frozenset(host.controllers)
        self.net = host.net if self.owners is None else part_of(host.net, self.owners, everybody(host.net))
        self.player = TokenPlayer.of(self.net)
        self.lanes = Lanes(self.net)
        self.followers: set[_Follower] = set()
        self.pictures = Pictures(self.net, look)
        self.word: Word = -1
        self.states: dict[str, dict[str, Any]] = {}
        self.stage, self.why_no_view = self._stage(plant)
        self.scene = None if self.stage is None else self.stage.begin()
        host.recorder.observers.append(self.seen)

    @property
    def public(self) -> Collection[str]:
        """The paths that anybody may read."""
        return PUBLIC if self.opening is None else {*PUBLIC, self.opening.path}

    def routes(self) -> Iterable[web.AbstractRouteDef]:
        """The files of the page, what it shows at first, and the stream that it follows."""
        yield from file_routes()
        if self.opening is not None:
            yield from self.opening.routes()
        yield web.get("/api/page", answering(self.page))
        yield web.post("/api/picture", answering(self.pictures.picture))
        yield web.get("/api/events", self.stream)

    async def page(self, _: dict[str, Any]) -> dict[str, Any]:
        """What is shown at first, but for the picture: that is asked for by itself."""
        here = "" if self.owners is None else ", ".join(self.host.controllers)
        return {
            "mode": "live",
            "here": here,
            "coordinators": [name or "the coordinator" for name in self.host.coordinators],
            "net": moment.structure(self.net),
            "machines": self.lanes.machines,
            "top": top_of(self.stage, self.why_no_view),
        }

    def _stage(self, plant: PlantModel | None) -> tuple[Stage | None, str]:
        if self.owners is not None:
            return None, "this host knows of its own machines alone"
        if plant is None:
            return None, "no plant file says what the cell is made of: name it with --plant"
        problems = misfits(plant, self.net)
        return (None, problems[0].message) if problems else (Stage(self.net, plant), "")

    def _play(self, event: Event) -> None:
        """Change the scene as an event has changed the cell."""
        stage, scene = self.stage, self.scene
        if stage is None or scene is None:
            return
        match event:
            case CommandSent(_, name) if name in self.net.place_index:
                self.scene = stage.sent(scene, name)
            case SignalChanged(_, signal, True):
                self.scene = stage.signal(scene, signal)
            case Fired(_, names):
                self.scene = stage.fired(scene, names, sends=False)

    def seen(self, event: Event) -> None:
        """An event of the run, for all who follow it."""
        self.lanes.seen(event)
        self._play(event)
        for follower in self.followers:
            follower.take(event)

    async def stream(self, request: web.Request) -> web.StreamResponse:
        """Frames, until the run or the browser is gone."""
        response = web.StreamResponse(headers={"Content-Type": "application/x-ndjson", "Cache-Control": "no-store"})
        await response.prepare(request)
        follower = _Follower()
        self.followers.add(follower)
        try:
            ended = False
            while not ended:
                ended = self.host.is_over and not may_stay(self.host)
                frame = self.frame(follower, ended=ended)
                try:
                    await response.write(json.dumps(frame, separators=(",", ":")).encode() + b"\n")
                except ConnectionError:  # the browser is gone
                    break
                if not ended:
                    await asyncio.sleep(1 / FRAMES_PER_SECOND)
                    await follower.something(HEARTBEAT_SECONDS - 1 / FRAMES_PER_SECOND)
        finally:
            self.followers.discard(follower)
        return response

    def frame(self, follower: _Follower, *, ended: bool = False) -> dict[str, Any]:
        """What is so now, and what has happened since this follower was told."""
        host, net = self.host, self.net
        situation = host.situation()
        if ended and host.outcome is not None and not host.outcome.cancelled() and host.outcome.exception() is None:
            situation = host.outcome.result()
        now, rows = self.now(), votes(host)
        self._judge(now)
        return {
            "at": host.now_seconds(),
            "speed": host.speed,
            "state": situation.state.value,
            "message": situation.message,
            "marking": list(net.names(now.marking)),
            "signals": sorted(now.signals),
            "transitions": follower.news("transition", self._states(rows)),
            "waits": [str(one) for one in situation.blocked],
            "bars": follower.bars(self.lanes),
            "votes": list(follower.news("votes", {row["name"]: row for row in rows}).values()),
            "top": self._top(follower),
            "unreached": sorted(host.peers.names - host.peers.connected_to),
            "asked": {place: str(host.net.place(place).command) for place in asked_of_the_operator(host)},
            "paused": host.paused,
            "ended": ended,
            **follower.happened(),
        }

    def _top(self, follower: _Follower) -> dict[str, Any] | None:
        """How the cell looks, where that is news."""
        if self.stage is None or self.scene is None:
            return None
        return follower.news("top", {"": self.stage.told(self.scene)}).get("")

    def now(self) -> Moment:
        """The marking and the signals, of the whole or of this host."""
        host = self.host
        if self.owners is None:
            word, player = host.recorder.word, host.recorder.player
            on = [name for name in self.net.signal_index if word & player.signal_bit(name)]
            return Moment(word & player.places, frozenset(on))
        on = [
            signal.name
            for controller in host.controllers.values()
            for signal in controller.subnet.signals
            if controller.word & controller.player.signal_bit(signal.name)
        ]
        return Moment(self.net.marking(host.marking), frozenset(on))

    def _states(self, rows: Iterable[dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """Whether each transition may fire, or what it waits for: here, and of a host among others also elsewhere."""
        if self.owners is None:
            return self.states
        ready = (row for row in rows if self.states.get(row["name"]) == {"may": "fire"})
        waiting = {row["name"]: {"may": "wait", "why": why} for row in ready if (why := awaited(self.host, row))}
        return self.states | waiting

    def _judge(self, now: Moment) -> None:
        word = now.marking | sum(self.player.signal_bit(name) for name in now.signals)
        changed = word ^ self.word
        for t, compiled in enumerate(self.player.transitions.values()):
            if compiled.name in self.states and not changed & compiled.reads:
                continue
            if compiled.openable and compiled.enabled(word):
                self.states[compiled.name] = {"may": "fire"}
            else:
                may = "wait" if compiled.openable and compiled.firable(word, self.player.places) else "not"
                self.states[compiled.name] = {"may": may, **moment.waits(self.net, t, now)}
        self.word = word


class _Follower:
    """A browser that follows a run: what it was told, and what happened since."""

    def __init__(self) -> None:
        self.told: dict[str, dict[str, Any]] = {}
        self.lanes_told = 0
        self.events: deque[dict[str, Any]] = deque(maxlen=HAPPENED_MAX)
        self.fired: deque[str] = deque(maxlen=HAPPENED_MAX)
        self.is_new = asyncio.Event()

    def take(self, event: Event) -> None:
        """Something happened."""
        match event:
            case Fired(_, names):
                self.fired.extend(names)
                self.events.append({"at": event.at_seconds, "kind": "fired", "what": f"{', '.join(names)} fired"})
            case CommandSent(_, place):
                self.events.append({"at": event.at_seconds, "kind": "sent", "what": f"{place} sent its command"})
            case Noted(_, note, data) if note not in (VOTED, STANDS):
                if note == APPLIED:
                    self.fired.extend([str(data["transition"])] if "transition" in data else [])
                else:
                    words = data.get("message") or " ".join(map(str, data.values()))
                    self.events.append(
                        {"at": event.at_seconds, "kind": "note", "what": f"{note}: {words}".rstrip(": ")}
                    )
        self.is_new.set()

    def news(self, kind: str, of: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """Those that are others than this follower was told; who made them changes them no more."""
        told = self.told.setdefault(kind, {})
        found = {name: value for name, value in of.items() if told.get(name) != value}
        told.update(found)
        return found

    def bars(self, lanes: Lanes) -> list[dict[str, Any]]:
        """The bars that have changed since this follower was told of them."""
        found = lanes.since(self.lanes_told)
        self.lanes_told = lanes.changes
        return found

    def happened(self) -> dict[str, Any]:
        """What happened since it was asked, and how."""
        events, fired = list(self.events), list(self.fired)
        self.events.clear()
        self.fired.clear()
        self.is_new.clear()
        return {"events": events, "fired": fired}

    async def something(self, seconds: float) -> None:
        """Wait until something happens, or so long."""
        try:
            async with asyncio.timeout(seconds):
                await self.is_new.wait()
        except TimeoutError:
            return
