"""What stands beside places and transitions: their names, and below them what the net's author says of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from firable.nets.drawing.text import COMMAND, NAME, NOTE, Words, wrapped
from firable.nets.net import Place, Transition
from firable.nets.time_limits import format_time

_NOTE_CHARACTERS: Final = 22
_WIDE_CHARACTERS: Final = 46


def local_name(name: str, owner: str | None) -> str:
    """The name without its owner, as it stands in the box of the owner."""
    return name.removeprefix(f"{owner}.") if owner else name


def place_words(place: Place, inside: Sequence[str] = ()) -> Words:
    """What stands beside a place: its name, and below it the command, or else the description.

    Of a macro place it is the first and the last of the places inside it, and how many they are.
    """
    if inside:
        first, last = (local_name(name, place.owner) for name in (inside[0], inside[-1]))
        return (f"{first} …", NAME), (f"… {last}", NAME), (f"{len(inside)} places", NOTE)
    name = (local_name(place.name, place.owner), NAME)
    if place.command is not None:
        limit = [] if place.within is None else [(f"within {format_time(place.within.milliseconds)}", NOTE)]
        return name, (str(place.command), COMMAND), *limit
    return name, *((line, NOTE) for line in wrapped(place.description, _NOTE_CHARACTERS))


def transition_words(transition: Transition, elsewhere: Sequence[str], *, in_margin: bool) -> Words:
    """What stands beside a transition: its name, its description, and who takes part in it in another panel.

    In the margin there is room for two lines of each; in a lane for one, because a place follows below.
    """
    width, lines_max = (_NOTE_CHARACTERS, 2) if in_margin else (_WIDE_CHARACTERS, 1)
    also = wrapped(f"also {', '.join(elsewhere)}", width, lines_max) if elsewhere else []
    notes = wrapped(transition.description, width, lines_max)
    return (transition.name, NAME), *((line, NOTE) for line in (*notes, *also))
