"""Editing the net on the page: what is asked is done to the text of its file, which stays the truth.

Each edit is made in the text (`nets/editing`), the whole text is read again, and only what reads is written, at once:
the file on the disk is always the net that is shown. What does not read comes back as a draft with its errors, to be
mended in the text or thrown away. The page says with each edit which file it means, by the bytes that it had; where
these are others now, because somebody has the file open in an editor, nothing is written (F1019).

Who may edit: whoever may see, on this host, and only the one net file that `firable view` was given, and in the layout
file beside it the names that change. A net of the
catalogue, PNML and bundles are not edited, and with `--read-only` nothing is.

Steps are undone here and not in the page, so that a reload of the window loses none, and another window has them too. A
file that another program has written begins anew when it is read again: that is not undone from here.
"""

from __future__ import annotations

import asyncio
import shlex
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from aiohttp import web

from firable.cli.view.drawing import Look
from firable.cli.view.playing import Playing
from firable.cli.view.site import answering, diagnostic_json, refusal
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.drawing import NODES_MAX, has_overview
from firable.nets.drawing.layout_file import SIZE_BYTES_MAX as LAYOUT_BYTES_MAX
from firable.nets.drawing.layout_file import layout_path, parse_layout, renamed_layout
from firable.nets.editing import edits
from firable.nets.editing.net_file import NetFile
from firable.nets.editing.yaml_text import YamlText
from firable.nets.loading import Loaded
from firable.nets.occurrences import Kind
from firable.nets.source import Source, read_source
from firable.nets.text import parse_positioned
from firable.nets.text_positions import Positions
from firable.nets.writing import write_whole

STEPS_MAX: Final = 200
"""So many edits are undone."""
NO_NAMES: Final[Mapping[str, str]] = {}

Asked = Mapping[str, Any]
Edit = Callable[[Source], Source]
"""An edit of a text."""


@dataclass(frozen=True)
class _Step:
    """An edit that was made: in words, and the text before it, or after it once it is undone."""

    what: str
    text: str
    names: Mapping[str, str] = field(default_factory=dict)
    """What going back to the text makes of names that other files know: the full ones, with those that they get."""


@dataclass
class Editing:
    """The file that is edited; `why_not` says why it is none, and then nothing is written."""

    playing: Playing
    file: NetFile | None
    why_not: str = ""
    is_net: bool = True
    """Whether the file as it was read last is a net; where somebody has made none of it, the one before is shown."""
    done: list[_Step] = field(default_factory=list)
    undone: list[_Step] = field(default_factory=list)
    one_at_a_time: asyncio.Lock = field(default_factory=asyncio.Lock)

    def routes(self) -> Iterable[web.AbstractRouteDef]:
        """What the page asks."""
        yield web.get("/api/edit", answering(self.state))
        yield web.get("/api/edit/version", answering(self.version))
        for name, answer in (
            ("", self.edit),
            ("/text", self.put),
            ("/try", self.tried),
            ("/undo", self.undo),
            ("/redo", self.redo),
            ("/reload", self.reload),
        ):
            yield web.post(f"/api/edit{name}", answering(answer))

    async def state(self, _: Asked) -> dict[str, Any]:
        """The text, and what the page lists of it."""
        if self.file is None:
            return {"why_not": self.why_not}
        return {
            "text": self.file.source.text,
            "version": self.file.version,
            "is_net": self.is_net,
            "shown": self.playing.shown,
            "undo": self.done[-1].what if self.done else None,
            "redo": self.undone[-1].what if self.undone else None,
            "arcs": _arcs(self.file.source) if self.is_net else {},
            "marked": [place.name for place in self.playing.player.net.places if place.marked],
        }

    async def version(self, _: Asked) -> dict[str, Any]:
        """Whether the file is still what was read, which of the nets that it was is shown, and whether it is one."""
        current = self.file is not None and await asyncio.to_thread(self.file.is_current)
        return {"current": current, "shown": self.playing.shown, "is_net": self.is_net}

    async def edit(self, asked: Asked) -> dict[str, Any]:
        """One edit of the net."""
        make, what = self._cure_of(asked) if asked.get("do") == "cure" else _edit_of(asked)
        async with self.one_at_a_time:
            file = self._meant(asked)
            after = make(file.source)
            if after.text == file.source.text:
                return await self._shown()
            return await self._written(after.text, what, _names_of(asked, file.source))

    async def put(self, asked: Asked) -> dict[str, Any]:
        """The whole text, as somebody has typed it."""
        async with self.one_at_a_time:
            self._meant(asked)
            return await self._written(_text(asked), "the text")

    async def tried(self, asked: Asked) -> dict[str, Any]:
        """What the reader says of a text; nothing is written."""
        try:
            await asyncio.to_thread(_read, Source(self.playing.file, _text(asked)))
        except InputError as error:
            return {"errors": [diagnostic_json(one) for one in error.diagnostics]}
        return {"errors": []}

    async def undo(self, asked: Asked) -> dict[str, Any]:
        """The text before the last edit."""
        async with self.one_at_a_time:
            return await self._back(asked, self.done, self.undone)

    async def redo(self, asked: Asked) -> dict[str, Any]:
        """The text after the edit that was undone last."""
        async with self.one_at_a_time:
            return await self._back(asked, self.undone, self.done)

    async def reload(self, _: Asked) -> dict[str, Any]:
        """The file as it is on the disk now; where it is no net, it comes back as a draft."""
        async with self.one_at_a_time:
            before = self._file()
            self.file = file = NetFile.read(before.path)
            is_known = file.version == before.version
            if not is_known:
                self.done.clear()
                self.undone.clear()
            try:
                loaded = await asyncio.to_thread(_read, file.source)
            except InputError as error:
                self.is_net = False
                return _draft(error, file.source.text, version=file.version)
            self._take(loaded, is_another=not is_known or loaded.net != self.playing.loaded.net)
            return await self._shown()

    def _cure_of(self, asked: Asked) -> tuple[Edit, str]:
        """The change that a request names, of those that checking the net as it is has offered."""
        match asked:
            case {"verdict": str(name), "number": int(number)}:
                for verdict in self.playing.verdicts or ():
                    if verdict.name == name and 0 <= number < len(verdict.cures):
                        parts = verdict.cures[number].parts
                        return lambda s, parts=parts: edits.change(s, parts), f"what cures {name}"
        raise refusal("the page asks for a cure that no check of this net has found")

    def _file(self) -> NetFile:
        if self.file is None:
            raise InputError([Diagnostic("F1020", self.why_not, "edit a net file: `firable view cell.firable.yaml`")])
        return self.file

    def _meant(self, asked: Asked) -> NetFile:
        """The file, which must be the one that the page shows."""
        file = self._file()
        if asked.get("version") != file.version:
            message = f"{file.path} has been edited since this window has shown it"
            raise InputError([Diagnostic("F1019", message, "load it again; nothing is written")])
        return file

    async def _back(self, asked: Asked, steps: list[_Step], others: list[_Step]) -> dict[str, Any]:
        file = self._meant(asked)
        if not steps:
            raise refusal("there is nothing to undo, or to do again")
        step = steps[-1]
        loaded = await asyncio.to_thread(_read, Source(file.source.file, step.text))
        self.file = file.written(step.text)
        steps.pop()
        others.append(_Step(step.what, file.source.text, _turned(step.names)))
        self._take(loaded, step.names)
        return await self._shown()

    async def _written(self, text: str, what: str, names: Mapping[str, str] = NO_NAMES) -> dict[str, Any]:
        """A new text, written where it is a net, and the layout file beside it where names are others now."""
        file = self._file()
        try:
            loaded = await asyncio.to_thread(_read, Source(file.source.file, text))
        except InputError as error:
            return _draft(error, text)
        self.file = file.written(text)
        self.done = [*self.done, _Step(what, file.source.text, _turned(names))][-STEPS_MAX:]
        self.undone.clear()
        self._take(loaded, names)
        return await self._shown()

    def _take(self, loaded: Loaded, names: Mapping[str, str] = NO_NAMES, *, is_another: bool = True) -> None:
        """Show another net, arranged by the layout file beside it; what got other names keeps its position there.

        A layout file that cannot be read, or written, is left as it is: the net is what is edited, and it is written.
        """
        self.is_net = True
        path, look = layout_path(self._file().path), self.playing.pictures.look
        given = look.given
        with suppress(InputError):
            if path.is_file():
                source = read_source(path, LAYOUT_BYTES_MAX)
                if (text := renamed_layout(source, names)) != source.text:
                    write_whole(path, text)
                given = parse_layout(text, source.file)
        folded, opened = (tuple(names.get(name, name) for name in some) for some in (look.folded, look.opened))
        look = Look(given, folded, opened)
        self.playing.take(loaded, look, is_another=is_another)

    async def _shown(self) -> dict[str, Any]:
        return {"page": await self.playing.page({}), "edit": await self.state({})}


def editing_of(playing: Playing, argument: str, *, read_only: bool) -> Editing:
    """How the net that a command has named may be edited."""
    if read_only:
        return Editing(playing, None, "the page was opened with --read-only")
    if argument.startswith("catalogue:"):
        name = argument.removeprefix("catalogue:")
        hint = f"`firable convert {argument} -o {name}.firable.yaml` makes a file of it"
        return Editing(playing, None, f"a net of the catalogue is not edited: {hint}")
    if not isinstance(playing.loaded.positions, Positions):
        made = f"{Path(argument).stem}.firable.yaml"
        hint = f"`firable convert {shlex.quote(argument)} -o {shlex.quote(made)}` makes a net file of it"
        return Editing(playing, None, f"only a net file is edited: {hint}")
    file = NetFile.read(argument)
    if not file.may_be_written():
        return Editing(playing, None, f"{argument} may not be written to")
    playing.editable = True
    return Editing(playing, file)


def _read(source: Source) -> Loaded:
    """The net of a text, of which something can be shown."""
    net, positions = parse_positioned(source.text, source.file)
    if (count := len(net.places) + len(net.transitions)) > NODES_MAX and not has_overview(net):
        message = f"{count:,} places and transitions make no picture that anybody can read"
        raise InputError([Diagnostic("F1020", message, f"edit a net of more than {NODES_MAX:,} in an editor of text")])
    return Loaded(net, positions=positions)


def _arcs(source: Source) -> dict[str, dict[str, list[str]]]:
    """The arcs and gates of each transition of a text."""
    text = YamlText(source)
    return {
        name: {part: edits.names_in(text.at(("transitions", name, part))) for part in edits.PARTS}
        for name in text.at(("transitions",)) or {}
    }


def _draft(error: InputError, text: str, version: str | None = None) -> dict[str, Any]:
    """A text that is no net: what is wrong with it, and where; it is not written."""
    return {"errors": [diagnostic_json(one) for one in error.diagnostics], "draft": text, "version": version}


def _text(asked: Asked) -> str:
    if not isinstance(text := asked.get("text"), str):
        raise refusal("a text is wanted")
    return text


def _names_of(asked: Asked, source: Source) -> Mapping[str, str]:
    """The full names that an edit changes, with the new ones."""
    match asked:
        case {"do": "rename", "kind": str(kind), "name": str(name), "new": str(new)}:
            return edits.renames(source, _KINDS[kind], name, new)
        case {"do": "own", "kind": str(kind), "name": str(name), "owner": str() | None as owner}:
            return edits.owned(source, _KINDS[kind], name, owner)
    return NO_NAMES


def _turned(names: Mapping[str, str]) -> Mapping[str, str]:
    return {new: name for name, new in names.items()}


_KINDS: Final = {kind.value: kind for kind in (Kind.CONTROLLER, Kind.PLACE, Kind.SIGNAL, Kind.TRANSITION)}


def _edit_of(asked: Asked) -> tuple[Edit, str]:
    """The edit that a request names, and in words; raises `InputError` F5070 where it names none."""
    match asked:
        case {"do": "add", "kind": "controller", "name": str(name)}:
            return lambda s: edits.add_controller(s, name), f"controller {name} added"
        case {"do": "add", "kind": "transition", "name": str(name)}:
            return lambda s: edits.add_transition(s, name), f"transition {name} added"
        case {"do": "add", "kind": "place", "name": str(name), "owner": str() | None as owner}:
            return lambda s: edits.add_place(s, name, owner), f"place {name} added"
        case {"do": "add", "kind": "signal", "name": str(name), "owner": str() | None as owner}:
            return lambda s: edits.add_sensor(s, name, owner), f"sensor {name} added"
        case {"do": "connect", "transition": str(t), "part": str(part), "name": str(name)}:
            return lambda s: edits.connect(s, t, part, name), f"{t} {part} {name}"
        case {"do": "disconnect", "transition": str(t), "part": str(part), "name": str(name)}:
            return lambda s: edits.disconnect(s, t, part, name), f"{t} no more {part} {name}"
        case {"do": "mark", "name": str(name), "marked": bool(marked)}:
            return lambda s: edits.mark(s, name, marked=marked), f"{'a' if marked else 'no'} token on {name}"
        case {"do": what, "kind": str(kind), "name": str(name)} if kind in _KINDS:
            of = _KINDS[kind]
            match what, asked:
                case "describe", {"words": str(words)}:
                    return lambda s: edits.describe(s, of, name, words), f"{name} described"
                case "rename", {"new": str(new)}:
                    return lambda s: edits.rename(s, of, name, new), f"{name} renamed to {new}"
                case "own", {"owner": str() | None as owner} if of in {Kind.PLACE, Kind.SIGNAL}:
                    return lambda s: edits.own(s, of, name, owner), f"{name} given to {owner or 'nobody'}"
                case "delete", _:
                    return lambda s: edits.delete(s, of, name), f"{name} deleted"
    raise refusal("the page asks for an edit that is not known")
