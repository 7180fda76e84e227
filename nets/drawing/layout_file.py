"""The layout file: how the picture of a net is arranged, kept beside the net so that it stays as one knows it.

`cell.firable.yaml` has its layout in `cell.layout.yaml`: the lanes from left to right, the places in each of their
tracks, and the transitions row by row. The net file says what the net is and holds no positions; a change of the
picture changes no proof. What the net has lost since is said, and what is new in it finds its place by itself. The file
is written by `firable draw --keep-layout`, and may be edited: a line moved up is a row moved up.

    firable_layout: 1
    lanes:
    - owner: robot
      tracks:
      - [robot.to_cv1, robot.grasp_cv1]
      - [robot.free]
    rows:
    - [G1]
    - [G2, t1-a]

Rejected: coordinates in pixels, for which there would have to be an editor; and positions inside the net file, where
each of them would be a changed line in the review of a net that has not changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from firable.nets.diagnostics import Diagnostic, InputError, Severity
from firable.nets.document_errors import Shape, document_problems, keys_of, version_problem
from firable.nets.drawing.arrangement import Arrangement
from firable.nets.net import Net
from firable.nets.source import Source, quoted, read_source
from firable.nets.yaml_tree import Node, data, node_span, nodes_along, parse_tree, scalars_of, value_of
from firable.nets.yaml_tree import Path as TreePath
from firable.nets.yaml_writing import scalar

SIZE_BYTES_MAX: Final = 1024 * 1024
_NAMES_SAID: Final = 8
_HINT: Final = (
    "mend it, or delete it and have `firable draw NET --keep-layout` write it anew; docs/pictures.md shows one"
)

Name = Annotated[str, Field(min_length=1)]


def _version(value: object) -> object:
    return 1 if value == "1" else value


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid", strict=True, frozen=True)


class LaneModel(_Model):
    """A lane: whose it is (nobody's where that is left out), and its places, track by track from the left."""

    owner: Name | None = None
    tracks: list[list[Name]] = []


class LayoutModel(_Model):
    """A whole layout file: the lanes from the left, and the transitions row by row from above."""

    firable_layout: Annotated[Literal[1], BeforeValidator(_version)]
    lanes: list[LaneModel] = []
    rows: list[list[Name]] = []


SHAPE: Final = Shape(
    "firable_layout", "layout file", {(): keys_of(LayoutModel), ("lanes", "*"): keys_of(LaneModel)}, {}
)


def layout_path(net_file: Path | str) -> Path:
    """Where the layout of a net file is kept.

    >>> layout_path("cells/cell.firable.yaml").as_posix(), layout_path("net.pnml").as_posix()
    ('cells/cell.layout.yaml', 'net.layout.yaml')
    """
    path = Path(net_file)
    stem = path.name.removesuffix(path.suffix).removesuffix(".firable")
    return path.with_name(f"{stem}.layout.yaml")


def read_layout(path: Path | str) -> Arrangement:
    """Read a layout file; raises `InputError` F1001-F1011 for the text, F1021 for a name that stands twice."""
    return _parse(read_source(path, SIZE_BYTES_MAX))


def parse_layout(text: str, file: str = "<layout>") -> Arrangement:
    """Read a layout from text, as `read_layout` does."""
    return _parse(Source(file, text))


def _parse(source: Source) -> Arrangement:
    tree = parse_tree(source, SHAPE.file, f"`{SHAPE.version}: 1`; {_HINT}")
    if problem := version_problem(source, tree, SHAPE):
        raise InputError([problem])
    try:
        model = LayoutModel.model_validate(data(tree))
    except ValidationError as error:
        raise InputError(document_problems(source, tree, error, SHAPE)) from None
    if twice := list(_twice(model)):
        raise InputError([_second(source, tree, path, name) for path, name in twice])
    rows = {name: float(row) for row, names in enumerate(model.rows, start=1) for name in names}
    tracks = {lane.owner: tuple(map(tuple, lane.tracks)) for lane in model.lanes if lane.tracks}
    return Arrangement(tuple(lane.owner for lane in model.lanes), rows, tracks)


def _twice(model: LayoutModel) -> Iterator[tuple[TreePath, str]]:
    """What stands in a file more than once, with its path."""
    groups: list[Iterator[tuple[TreePath, str]]] = [
        ((("lanes", i), lane.owner or "nobody's lane") for i, lane in enumerate(model.lanes)),
        ((("rows", i, k), name) for i, row in enumerate(model.rows) for k, name in enumerate(row)),
        (
            (("lanes", i, "tracks", j, k), name)
            for i, lane in enumerate(model.lanes)
            for j, track in enumerate(lane.tracks)
            for k, name in enumerate(track)
        ),
    ]
    for group in groups:
        seen = set[str]()
        for path, name in group:
            if name in seen:
                yield path, name
            seen.add(name)


def _second(source: Source, tree: Node, path: TreePath, name: str) -> Diagnostic:
    key, node = list(nodes_along(tree, path))[-1]
    message = f"{quoted('.'.join(map(str, path)))}: '{name}' stands here a second time"
    return Diagnostic("F1021", message, _HINT, tuple(map(str, path)), node_span(source, key or node))


def vanished(given: Arrangement, net: Net, file: str) -> tuple[Diagnostic, ...]:
    """A note on what a layout names and the net does not have, if there is any such thing."""
    owners = {controller.name for controller in net.controllers}
    lanes = [owner for owner in given.lanes if owner is not None and owner not in owners]
    places = [name for tracks in given.tracks.values() for track in tracks for name in track]
    gone = [
        *(("controller", name) for name in lanes),
        *(("place", name) for name in places if name not in net.place_index),
        *(("transition", name) for name in given.rows if name not in net.transition_index),
    ]
    if not gone:
        return ()
    said = ", ".join(f"the {kind} '{name}'" for kind, name in gone[:_NAMES_SAID])
    more = f" and {len(gone) - _NAMES_SAID:,} more" if len(gone) > _NAMES_SAID else ""
    message = f"{file} arranges what the net does not have: {said}{more}"
    hint = "`firable draw NET --keep-layout` keeps the layout without it"
    return (Diagnostic("F1021", message, hint, severity=Severity.WARNING),)


def format_layout(given: Arrangement) -> str:
    """A layout as the text of its file."""
    lines = ["firable_layout: 1", "lanes:" if given.lanes else "lanes: []"]
    for owner in given.lanes:
        tracks = given.tracks.get(owner, ())
        first = f"owner: {scalar(owner)}" if owner is not None else ""
        lines.append(f"- {first or ('tracks:' if tracks else '{}')}")
        lines += ["  tracks:"] if tracks and first else []
        lines += [f"  - {_listed(track)}" for track in tracks]
    rows: dict[float, list[str]] = {}
    for name, row in given.rows.items():
        rows.setdefault(row, []).append(name)
    lines.append("rows:" if rows else "rows: []")
    lines += [f"- {_listed(rows[row])}" for row in sorted(rows)]
    return "\n".join(lines) + "\n"


def renamed_layout(source: Source, names: Mapping[str, str]) -> str:
    """The text of a layout file with other names in it; comments, order and columns stay as they are.

    Raises `InputError` as `read_layout` does where it is not YAML. A place that goes to another controller is found in
    a track of the old one then, which the layout passes over: it finds a track for it by itself.

    >>> text = "firable_layout: 1\\nrows:\\n- [G1, a.p]   # first\\n"
    >>> renamed_layout(Source("cell.layout.yaml", text), {"G1": "start"}).splitlines()[2]
    '- [start, a.p]   # first'
    """
    tree = parse_tree(source)
    tables = [node for key in ("lanes", "rows") if (node := value_of(tree, key)) is not None]
    return source.with_parts(
        (one.line, one.column, one.length, scalar(names[one.text]))
        for table in tables
        for one in scalars_of(table)
        if one.text in names
    )


def _listed(names: tuple[str, ...] | list[str]) -> str:
    return f"[{', '.join(map(scalar, names))}]"
