"""Small nets in one line for each transition, for tests that show a rule at work."""

from __future__ import annotations

from firable.nets.net import Net, Place, Transition


def net_of(marked: str, *transitions: str) -> Net:
    """The net of transitions such as `t: a, b -> c if d unless e`, with the places that they name, some marked."""
    places: dict[str, None] = dict.fromkeys(marked.split())
    found = []
    for line in transitions:
        name, _, text = line.partition(":")
        text, _, unless = text.partition(" unless ")
        text, _, permissive = text.partition(" if ")
        inputs, _, outputs = text.partition("->")
        sides = [tuple(side.replace(",", " ").split()) for side in (inputs, outputs, permissive, unless)]
        for side in sides:
            places.update(dict.fromkeys(side))
        found.append(Transition(name, sides[0], sides[1], sides[2], sides[3]))
    return Net("n", tuple(Place(p, marked=p in marked.split()) for p in places), tuple(found))
