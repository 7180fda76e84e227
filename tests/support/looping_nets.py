"""Random nets of loops: what a promise leaves undone when the coordinator that it was given to dies."""

from __future__ import annotations

import random

from firable.nets.net import Command, Controller, Net, Place, Transition


def looping_net(seed: int) -> Net:
    """Controllers that go round by themselves, and round together where gates on these loops let them.

    Each controller has one or two loops of its own and one token that it moves with others; what is moved together
    reads the loops of those who take part, so a promise of it keeps a loop from turning. Some are in two layers.
    """
    draw = random.Random(seed)
    names = ["a", "b", "c"][: draw.randint(2, 3)]
    places, transitions = list[Place](), list[Transition]()
    loops = dict[str, list[str]]()
    for name in names:
        loops[name] = []
        places += [
            Place(f"{name}.in", name, marked=True),
            Place(f"{name}.out", name, command=Command(f"M{name}", "GO")),
        ]
        for i in range(draw.randint(1, 2)):
            up, down = f"{name}.up{i}", f"{name}.down{i}"
            places += [Place(up, name, marked=True), Place(down, name, command=Command(f"L{name}", f"GO{i}"))]
            gate = tuple(draw.sample([f"{name}.in", f"{name}.out"], draw.randint(0, 1)))
            transitions += [Transition(f"{name}.turn{i}", (up,), (down,), gate)]
            if draw.random() < 0.8:
                transitions += [Transition(f"{name}.back{i}", (down,), (up,))]
            loops[name] += [up, down]
    for i in range(draw.randint(1, 3)):
        among = draw.sample(names, 2)
        gates = [draw.choice(loops[name]) for name in among if draw.random() < 0.7]
        full, empty = (gates, []) if draw.random() < 0.7 else ([], gates)
        there = draw.random() < 0.5
        for back in (False, True) if draw.random() < 0.8 else (there,):
            one, other = ("out", "in") if back else ("in", "out")
            inputs, outputs = (tuple(f"{name}.{place}" for name in among) for place in (one, other))
            transitions.append(Transition(f"G{i}{'back' if back else ''}", inputs, outputs, tuple(full), tuple(empty)))
    above = (Controller("line", coordinator=True), Controller("cell")) if draw.random() < 0.5 else ()
    under = {name: draw.choice([None, "cell"]) if above else None for name in names}
    controllers = (*above, *(Controller(name, under=under[name]) for name in names))
    return Net(f"loops-{seed}", tuple(places), tuple(transitions), controllers=controllers)
