"""What the page asks when a net is played with: its structure, its picture, a moment, a firing, a check, a run.

The server holds the net and the runs that were found, and nothing of who plays: `moment.py` says why. A check is done
beside the event loop, one at a time, so that somebody plays on while it lasts.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection, Iterable
from typing import Any

from aiohttp import web

from firable.cli.view import moment
from firable.cli.view.drawing import PLAIN, Look, Pictures
from firable.cli.view.moment import Moment
from firable.cli.view.runs import Run, checked, verdict_json
from firable.cli.view.scene import Stage
from firable.cli.view.site import BODY_BYTES_MAX, PUBLIC, Opening, answering, file_routes, refusal
from firable.cli.view.top_view import top_of
from firable.executor.operating.control import Endpoint, admission
from firable.nets.loading import Loaded
from firable.nets.machines.fitting import misfits, of_another_cell
from firable.nets.machines.plant_file import PlantModel
from firable.nets.verdict import Verdict
from firable.semantics.player import Player


class Playing:
    """A net that the page plays with, and the runs of it that are known."""

    def __init__(
        self, loaded: Loaded, file: str, runs: Iterable[Run] = (), plant: PlantModel | str = "", look: Look = PLAIN
    ) -> None:
        self.loaded = loaded
        self.shown = 0
        """How often another net has taken the place of one, by which a window knows that it shows an older one."""
        self.file = file
        self.pictures = Pictures(loaded.net, look)
        self.runs = list(runs)
        self.editable = False
        self.plant = plant
        self.player = Player(loaded.net)
        self.verdicts: tuple[Verdict, ...] | None = None
        self.checking = asyncio.Lock()

    def take(self, loaded: Loaded, look: Look | None = None, *, is_another: bool = True) -> None:
        """Another net, after an edit; nothing that was found of the one before is known of it."""
        self.loaded = loaded
        self.shown += is_another
        self.pictures = Pictures(loaded.net, look or self.pictures.look)
        self.player = Player(loaded.net)
        self.verdicts = None
        self.runs = [run for run in self.runs if run.is_given]

    @property
    def stage(self) -> Stage | None:
        """The net with its machines, if a plant file says what they are and fits the net."""
        return None if isinstance(self.plant, str) or self.misfit else Stage(self.player.net, self.plant)

    @property
    def misfit(self) -> str:
        """Why there is no top view: no plant file, or one of another cell."""
        if isinstance(self.plant, str):
            return self.plant
        problems = of_another_cell(self.plant, self.player.net) or misfits(self.plant, self.player.net)
        return problems[0].message if problems else ""

    @property
    def public(self) -> Collection[str]:
        """The paths that anybody may read."""
        return PUBLIC

    def routes(self) -> Iterable[web.AbstractRouteDef]:
        """All that is served."""
        yield from file_routes()
        yield web.get("/api/page", answering(self.page))
        yield web.post("/api/picture", answering(self.picture))
        yield web.post("/api/moment", answering(self.moment))
        yield web.post("/api/fire", answering(self.fire))
        yield web.post("/api/check", answering(self.check))
        yield web.post("/api/run", answering(self.run))

    async def page(self, _: dict[str, Any]) -> dict[str, Any]:
        """What is shown at first, but for the picture: that is asked for by itself."""
        net, stage = self.loaded.net, self.stage
        return {
            "mode": "play",
            "file": self.file,
            "editable": self.editable,
            "shown": self.shown,
            "net": moment.structure(net),
            "moment": moment.told(self.player, moment.begin(net)),
            "runs": [run.summary() for run in self.runs],
            "verdicts": self._told(),
            "top": top_of(stage, self.misfit),
        }

    async def picture(self, asked: dict[str, Any]) -> dict[str, Any]:
        """The picture, with the tasks folded that the page names."""
        return await self.pictures.picture(asked)

    async def moment(self, asked: dict[str, Any]) -> dict[str, Any]:
        """What may fire at a moment, and how the cell looks once a signal that `became` names has become 1."""
        now, stage = self._now(asked), self.stage
        if stage is None or asked.get("scene") is None:
            return moment.told(self.player, now)
        scene = stage.of_json(asked["scene"])
        became = asked.get("became")
        if isinstance(became, str) and became in now.signals:
            scene = stage.signal(scene, became)
        return {**moment.told(self.player, now), "top": stage.told(scene)}

    async def fire(self, asked: dict[str, Any]) -> dict[str, Any]:
        """The moment after a firing."""
        name, stage = str(asked.get("transition", "")), self.stage
        after, done = moment.fired(self.player, self._now(asked), name)
        shown = {**moment.told(self.player, after), **done}
        if stage is not None and asked.get("scene") is not None:
            shown["top"] = stage.told(stage.fired(stage.of_json(asked["scene"]), (name,), sends=True))
        return shown

    def _now(self, asked: dict[str, Any]) -> Moment:
        """The moment that a request names; raises `InputError` F5070 where it is one of a net that was edited since."""
        if asked.get("shown", self.shown) != self.shown:
            raise refusal("the net has been edited in another window")
        return moment.moment_of(self.player.net, asked)

    async def check(self, _: dict[str, Any]) -> dict[str, Any]:
        """Check the net, once: a net that is not edited gets the same verdicts."""
        async with self.checking:
            if self.verdicts is None:
                loaded = self.loaded
                with loaded.placing():
                    verdicts, runs = await asyncio.to_thread(checked, loaded.net)
                if loaded is not self.loaded:
                    raise refusal("the net has been edited while it was checked")
                self.verdicts = verdicts
                self.runs += runs
        return {"verdicts": self._told(), "runs": [run.summary() for run in self.runs]}

    def _told(self) -> list[dict[str, Any]] | None:
        return None if self.verdicts is None else [verdict_json(verdict) for verdict in self.verdicts]

    async def run(self, asked: dict[str, Any]) -> dict[str, Any]:
        """The frames of a run, by its name."""
        for run in self.runs:
            if run.name == asked.get("name"):
                return run.to_json(self.player.net, self.stage)
        raise refusal("the page asks for a run that is not known")


def application(
    playing: Playing, endpoint: Endpoint, more: Iterable[web.AbstractRouteDef] = (), opening: Opening | None = None
) -> web.Application:
    """A net to play with, as an application; a browser may be led to it by `opening`."""
    first = [] if opening is None else list(opening.routes())
    public = playing.public if opening is None else {*playing.public, opening.path}
    app = web.Application(middlewares=[admission(endpoint, public)], client_max_size=BODY_BYTES_MAX)
    app.router.add_routes([*playing.routes(), *first, *more])
    return app
