"""Which vertices of a graph satisfy the same formulas of CTL without X, by partition refinement.

Two do if they are stutter equivalent, and sensitive to divergence (Browne, Clarke and Grumberg 1988; De Nicola and
Vaandrager 1995). A block is split until any two in it can go to the same other blocks by ways through their own, and
both or neither can stay in it for good, which one without successors does as well.
"""

from collections.abc import Hashable, Sequence


def stutter_blocks(successors: Sequence[Sequence[int]], labels: Sequence[Hashable]) -> list[int]:
    """The number of the block of each vertex.

    >>> stutter_blocks([[1], [2], [2]], "aab")  # the first is not told from the second
    [0, 0, 1]
    >>> stutter_blocks([[0, 1], [2], [2]], "aab")  # but where it can stay
    [0, 1, 2]
    """
    blocks = _numbered(labels)
    while True:
        split = _numbered([(blocks[v], _leads(v, successors, blocks)) for v in range(len(successors))])
        if max(split, default=0) == max(blocks, default=0):
            return blocks
        blocks = split


def _leads(vertex: int, successors: Sequence[Sequence[int]], blocks: Sequence[int]) -> Hashable:
    """The other blocks that it can go to by its own, and whether it can stay in that for good."""
    own, todo, others = {vertex}, [vertex], set[int]()
    while todo:
        for after in successors[todo.pop()]:
            if blocks[after] != blocks[vertex]:
                others.add(blocks[after])
            elif after not in own:
                own.add(after)
                todo.append(after)
    left = set(own)  # less those from which no way within goes on
    while gone := {v for v in left if successors[v] and left.isdisjoint(successors[v])}:
        left -= gone
    return frozenset(others), bool(left)


def _numbered(values: Sequence[Hashable]) -> list[int]:
    numbers: dict[Hashable, int] = {}
    return [numbers.setdefault(value, len(numbers)) for value in values]
