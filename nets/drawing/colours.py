"""The colours that tell controllers apart, the same in every picture: the eighth lane has that of the first again.

They are pale, because what stands on them is black; and no meaning hangs on them alone, since each box bears its name.
"""

from __future__ import annotations

from typing import Final

TINTS: Final = ("#eef3fb", "#eef8f1", "#fdf4e7", "#f6effa", "#e9f6f8", "#fbeff0", "#f4f5ea", "#f1f1f5")
EDGES: Final = ("#b9cbe8", "#b5dcc3", "#ecd2a2", "#d8c1e6", "#a9d6de", "#e8bfc4", "#d3d8ab", "#c9c9d6")
UNOWNED: Final = ("#fafafa", "#d0d0d0")


def colours(lane: int, owner: str | None) -> tuple[str, str]:
    """The tint of a lane and the colour of its edge; what nobody owns is grey."""
    return UNOWNED if owner is None else (TINTS[lane % len(TINTS)], EDGES[lane % len(EDGES)])
