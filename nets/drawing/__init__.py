"""Drawing a net in the field's conventions, as SVG text: no picture is stored, each is drawn from the net.

`draw_net` is the way in. `rows` orders the transitions, `layout` gives everything its place, `svg` writes it down.
"""

from firable.nets.drawing.svg import draw_net

__all__ = ["draw_net"]
