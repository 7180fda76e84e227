"""Layout by ELK, the Eclipse Layout Kernel, where it is installed and asked for: boxes and arrows, placed by it.

ELK is JavaScript (elkjs) and runs here in this process, in the V8 engine that the package mini-racer brings: no Node,
no server, no network. Its file comes with the package ipyelk, as the worker that notebooks run; the extra `layout`
installs both. Nothing of ELK is in this repository, whose licence is another one (ELK's is EPL-2.0).

Only places are asked of it, as of Graphviz: sizes go in, coordinates come out, and the picture is written as always.
Cycles are broken depth first, because a search from the marked places cuts where the work comes back to its beginning;
lines are orthogonal. Rejected: a port of ELK to Python, which is another layout under the same name.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any, Final

import click

from firable.nets.drawing.layered import Box, Link, Placed, Point, Route

_SECONDS_MAX: Final = 60
_OPTIONS: Final = {
    "elk.algorithm": "layered",
    "elk.direction": "DOWN",
    "elk.edgeRouting": "ORTHOGONAL",
    "elk.layered.cycleBreaking.strategy": "DEPTH_FIRST",
    "elk.layered.nodePlacement.strategy": "BRANDES_KOEPF",
    "elk.layered.spacing.nodeNodeBetweenLayers": "28",
    "elk.spacing.nodeNode": "20",
    "elk.padding": "[top=0,left=0,bottom=0,right=0]",
}
_BESIDE: Final = {"elk.nodeLabels.placement": "OUTSIDE H_RIGHT V_CENTER"}
_WORKER: Final = """
var self = globalThis;
var answers = [];
self.location = "file:///";
self.importScripts = function () {};
self.postMessage = function (message) { answers.push(message); };
self.console = {log: function () {}, warn: function () {}, error: function () {}};
1
"""
"""What the worker expects of a browser; each script ends in a number, because results cross over to Python."""


def elk(boxes: Sequence[Box], links: Sequence[Link]) -> Placed:
    """Lay a graph out by ELK.

    Raises `click.UsageError` where it is not installed, fails or takes longer than a minute.
    """
    source = _worker()
    graph = {
        "id": "graph",
        "layoutOptions": _OPTIONS,
        "children": [_node(i, box) for i, box in enumerate(boxes)],
        "edges": [
            {
                "id": f"e{i}",
                "sources": [str(link.tail)],
                "targets": [str(link.head)],
                "labels": [{"text": "-", "width": link.width, "height": link.height}],
            }
            for i, link in enumerate(links)
        ],
    }
    return _read(_asked(source, graph), links)


def _node(i: int, box: Box) -> dict[str, Any]:
    """A box for ELK: its core as the node, where there is one, and the words as a label beside it."""
    if not box.core:
        return {"id": str(i), "width": box.width, "height": box.height}
    beside = {"text": "-", "width": (box.width - box.core) / 2, "height": box.height}
    return {"id": str(i), "width": box.core, "height": box.height, "labels": [beside], "layoutOptions": _BESIDE}


def _worker() -> str:
    """The text of ELK's worker, from the package that brings it."""
    with suppress(PackageNotFoundError, ImportError):
        import_module("py_mini_racer")
        for file in distribution("ipyelk").files or ():
            if file.name.startswith("elk-worker.") and file.name.endswith(".worker.js"):
                return Path(str(file.locate())).read_text(encoding="utf-8")
    raise click.UsageError("ELK is not installed: `pip install 'firable[layout]'` brings it. Or leave out --layout elk")


def _asked(source: str, graph: dict[str, Any]) -> dict[str, Any]:
    """The answer of ELK, in an engine of its own that is closed in any case."""
    racer = import_module("py_mini_racer")
    engine = racer.MiniRacer()
    try:
        engine.eval(_WORKER)
        engine.eval(f"{source}\n;1", timeout_sec=_SECONDS_MAX)
        register = {"id": 0, "cmd": "register", "algorithms": ["layered"]}
        asked = {"id": 1, "cmd": "layout", "graph": graph, "layoutOptions": {}, "options": {}}
        for message in (register, asked):
            engine.eval(f"self.onmessage({{data: {json.dumps(message)}}});1", timeout_sec=_SECONDS_MAX)
        answer = json.loads(engine.eval("JSON.stringify(answers[answers.length - 1])"))
    except racer.JSTimeoutException:
        said = f"ELK has not laid out the graph after {_SECONDS_MAX} seconds: draw less, or leave out --layout elk"
        raise click.UsageError(said) from None
    except racer.MiniRacerBaseException as error:
        raise click.UsageError(f"ELK fails: {str(error).splitlines()[0]}. Leave out --layout elk") from None
    finally:
        engine.close()
    if "data" not in answer:
        raise click.UsageError(f"ELK fails: {answer.get('error', answer)}. Leave out --layout elk")
    laid: dict[str, Any] = answer["data"]
    return laid


def _read(laid: dict[str, Any], links: Sequence[Link]) -> Placed:
    centres = tuple((n["x"] + n["width"] / 2, n["y"] + n["height"] / 2) for n in laid.get("children", ()))
    routes: list[Route] = []
    for edge, link in zip(laid.get("edges", ()), links, strict=True):
        section, label = edge["sections"][0], edge["labels"][0]
        corners: list[Point] = [
            (corner["x"], corner["y"])
            for corner in (section["startPoint"], *section.get("bendPoints", ()), section["endPoint"])
        ]
        points = corners[:1]
        for corner in corners[1:]:
            points += [points[-1], corner, corner]
        routes.append(Route(tuple(points), (label["x"] + link.width / 2, label["y"] + link.height / 2)))
    return Placed(centres, tuple(routes), laid["width"], laid["height"])
