"""Nets like cells, for what works on sequences: rings of steps that take and give back shared places, and gates.

`cell_nets` is for properties, whose failures are shrunk; `cell_net` is for a search over seeds.
"""

from __future__ import annotations

import random

from hypothesis import strategies as st

from firable.nets.net import Net, Place, Transition

Sides = list[set[str]]
"""Inputs, outputs, permissive and inhibitive gates."""


def cell_nets() -> st.SearchStrategy[Net]:
    """The nets of `cell_net`, with every choice left to hypothesis."""
    return st.randoms(use_true_random=False).map(cell_net)


def cell_net(draw: random.Random) -> Net:
    """One to three rings of steps, up to two shared places, buffers, side steps, gates, joint steps and gaps."""
    shared = [f"r{i}" for i in range(draw.randint(0, 2))]
    names, marked = list(shared), {place for place in shared if draw.random() < 0.85}
    steps: list[Sides] = []
    for number in range(draw.randint(1, 3)):
        size = draw.randint(2, 6 if len(names) < 6 else 4)
        ring = [f"m{number}_{i}" for i in range(size)]
        names += ring
        marked.add(ring[0])
        steps += _ring(draw, ring, shared, names)
    for step in steps:
        if draw.random() < 0.12 and (gate := draw.choice(names)) not in step[0] | step[1]:
            step[draw.choice([2, 3])].add(gate)
    if draw.random() < 0.25 and len(steps) > 2:
        first, second = draw.sample(steps, 2)
        joint = [a | b for a, b in zip(first, second, strict=True)]
        if not joint[0] & joint[1]:
            steps = [step for step in steps if step is not first and step is not second] + [joint]
    draw.shuffle(names)
    places = tuple(Place(name, marked=name in marked) for name in names)
    return Net("cell", places, tuple(_transition(f"t{i}", step) for i, step in enumerate(steps)))


def _ring(draw: random.Random, ring: list[str], shared: list[str], names: list[str]) -> list[Sides]:
    size = len(ring)
    steps: list[Sides] = [[{ring[i]}, {ring[(i + 1) % size]}, set(), set()] for i in range(size)]
    if draw.random() < 0.3 and size > 3:
        i = draw.randrange(size)
        steps.append([{ring[i]}, {ring[(i + draw.randint(2, size - 1)) % size]}, set(), set()])
    if draw.random() < 0.25:
        names.append(f"b{ring[0]}")
        i, j = draw.sample(range(size), 2)
        steps[i][1].add(names[-1])
        steps[j][0].add(names[-1])
    if draw.random() < 0.15:
        steps.pop(draw.randrange(len(steps)))
    for place in shared:
        if draw.random() < 0.6 and len(steps) > 1:
            take, give = draw.sample(steps, 2)
            take[0].add(place)
            give[1].add(place)
    return steps


def _transition(name: str, step: Sides) -> Transition:
    inputs, outputs, permissive, inhibitive = (tuple(sorted(names)) for names in step)
    return Transition(name, inputs, outputs, permissive, inhibitive)
