"""Wrapping: lanes that are wider than the sheet stand in panels below each other, like words in lines.

A transition that has a part in two panels is drawn in both. So the lanes are cut into the fewest panels that fit, and
of those cuts the one that draws the fewest transitions twice is taken, then the one with the most even panels. That is
line breaking by dynamic programming (Knuth and Plass, 1981), with other demerits. Rejected: to fill each panel before
the next one is begun, which leaves one lane to the last, and parts a robot from its machine.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence


def panels(widths: Sequence[float], room: float, gap: float, users: Sequence[Collection[int]]) -> list[range]:
    """The lanes of each panel, at most `room` wide; a lane that is wider than that has a panel to itself.

    `users[t]` are the lanes in which transition t takes part. The cost is that of n² sets, for n lanes.

    >>> panels([4, 4, 4], 9, 1, [{0, 1}, {1, 2}, {0, 1}])
    [range(0, 2), range(2, 3)]
    """
    of_lane: list[set[int]] = [set() for _ in widths]
    for t, lanes in enumerate(users):
        for lane in lanes:
            of_lane[lane].add(t)
    best: list[tuple[int, int, float, int]] = [(0, 0, 0.0, 0)]
    for end in range(1, len(widths) + 1):
        choices = []
        drawn: set[int] = set()
        width = -gap
        for start in range(end - 1, -1, -1):
            width += widths[start] + gap
            if width > room and start < end - 1:
                break
            drawn |= of_lane[start]
            count, twice, uneven, _ = best[start]
            choices.append((count + 1, twice + len(drawn), uneven + width * width, start))
        best.append(min(choices))
    found: list[range] = []
    end = len(widths)
    while end:
        start = best[end][3]
        found.append(range(start, end))
        end = start
    return found[::-1]
