"""Every net of a small scope: all arcs and internal gates over the places, up to the names of all nodes."""

from collections.abc import Iterator
from functools import cache
from itertools import combinations_with_replacement, islice, product

from firable.nets.net import Marking, Net, Place, Transition

PLACES = ("p", "q")
Shape = tuple[int, ...]
"""For each place, the sides of a transition that meet it: bit 0 input, 1 output, 2 permissive, 3 inhibitive gate."""


def shapes(n_places: int) -> list[Shape]:
    """Every way in which one transition can be joined to the places: 16 for each place."""
    return list(product(range(16), repeat=n_places))


@cache
def transition(name: str, shape: Shape) -> Transition:
    """The transition of this shape."""
    inputs, outputs, permissive, inhibitive = (
        tuple(place for place, sides in zip(PLACES, shape, strict=False) if sides >> side & 1) for side in range(4)
    )
    return Transition(name, inputs, outputs, permissive, inhibitive)


def net_with(n_places: int, chosen: tuple[Shape, ...], initial: Marking = 0) -> Net:
    """The net of these transitions and this initial marking."""
    places = tuple(Place(place, marked=bool(initial >> i & 1)) for i, place in enumerate(PLACES[:n_places]))
    return Net("small", places, tuple(transition(f"t{i}", shape) for i, shape in enumerate(chosen)))


def all_nets(n_places: int, n_transitions: int, chunk: int = 0, chunks: int = 1) -> Iterator[tuple[Shape, ...]]:
    """The shapes of every net with this many places and transitions, or of one chunk of them."""
    return islice(_all_of(n_places, n_transitions), chunk, None, chunks)


@cache
def _all_of(n_places: int, n_transitions: int) -> tuple[tuple[Shape, ...], ...]:
    return tuple(filter(_is_first, combinations_with_replacement(shapes(n_places), n_transitions)))


def _is_first(chosen: tuple[Shape, ...]) -> bool:
    """Whether no other order of the places gives a net that is earlier in the order of all."""
    return chosen <= tuple(sorted(shape[::-1] for shape in chosen))
