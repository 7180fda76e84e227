"""Drawing a net in the field's conventions, as SVG text: no picture is stored, each is drawn from the net.

`draw_net` is the way in. `rows` orders the transitions, `layout` gives everything its place, `svg` writes it down.
`draw_markings` draws a `MarkingGraph` of markings and `Step`s, placed by `layered` or another layouter.
`draw_overview` draws the controllers of a net and what they share, however large it is.
`draw_coordinator` draws a `Decomposition`: who decides what over whom; `draw_strip` a run by its `Frame`s.
"""

from firable.nets.drawing.coordinator_diagram import draw_coordinator
from firable.nets.drawing.free import draw_free
from firable.nets.drawing.layered import layered
from firable.nets.drawing.marking_graph import MarkingGraph, Step, draw_markings
from firable.nets.drawing.overview import draw_overview, has_overview
from firable.nets.drawing.sheet import NODES_MAX
from firable.nets.drawing.strip import Frame, draw_strip
from firable.nets.drawing.svg import draw_net

__all__ = [
    "NODES_MAX",
    "Frame",
    "MarkingGraph",
    "Step",
    "draw_coordinator",
    "draw_free",
    "draw_markings",
    "draw_net",
    "draw_overview",
    "draw_strip",
    "has_overview",
    "layered",
]
