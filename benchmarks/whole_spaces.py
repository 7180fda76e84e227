"""The techniques that hold all markings without listing them, on nets whose markings no memory holds.

The yardstick is the net itself: the time as a multiple of that of building the `Net`, which is linear, in the same
run. The counts must be those of the formulas of the catalogue. In a *shuffled* net places and transitions stand in a
random order, so that the technique has to find a good one by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from random import Random
from typing import Any, Final

from measuring import Table, spread, timed

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.methods import SPACES
from firable.analysis.spaces.space import StateSpace
from firable.nets.catalogue import FAMILIES, family_net
from firable.nets.net import Net

SECONDS_MAX: Final = 60.0
MEMORY_BYTES_MAX: Final = 6 << 30


@dataclass(frozen=True)
class Subject:
    """A net of a family, and how quickly its markings should be found; None where no goal was set."""

    family: str
    goal_seconds: float | None = None
    shuffled: bool = False

    def net(self) -> Net:
        """The net."""
        net = family_net(self.family)
        return shuffled(net) if self.shuffled else net

    def __str__(self) -> str:
        return f"{self.family}, shuffled" if self.shuffled else self.family


SUBJECTS: Final = (
    Subject("philosophers_either-5000", 0.2, shuffled=True),
    Subject("philosophers_either-100000", 5.0),
    Subject("philosophers-1000", 3.3),
    Subject("philosophers-2000", 9.3),
    Subject("slotted_ring-200", 15.0),
    Subject("vehicles-8-32", 7.0),
    Subject("vehicles-10-32", 60.0),
    Subject("manufacturing_cells-1000"),
    Subject("token_ring-500"),
)


def shuffled(net: Net, seed: int = 1) -> Net:
    """The net with its places and transitions in a random order, the same for the same seed."""
    random = Random(seed)
    places, transitions = list(net.places), list(net.transitions)
    random.shuffle(places)
    random.shuffle(transitions)
    return replace(net, places=tuple(places), transitions=tuple(transitions))


def expected(family: str) -> int | None:
    """The number of markings by the formula of the family."""
    name, *parameters = family.split("-")
    formula = FAMILIES[name].markings
    return None if formula is None else formula(*map(int, parameters))


def tables(repeat: int) -> list[Table]:
    """One table for each technique that holds all markings."""
    return [_table(of.words, of.load(), repeat) for of in SPACES.values()]


def _table(words: str, make: Callable[[Net, Limits], StateSpace[Any]], repeat: int) -> Table:
    rows = []
    for subject in SUBJECTS:
        net, building = timed(subject.net)
        seconds: list[float] = []
        told = ""
        for _ in range(repeat):
            limits = Limits(Deadline.after(SECONDS_MAX), MEMORY_BYTES_MAX, threads=2)
            try:
                space, took = timed(partial(make, net, limits))
            except BudgetExceeded as error:
                told = f"not in {SECONDS_MAX:.0f} s by the clock: {error}"
                break
            if not space.complete:
                told = f"not in {SECONDS_MAX:.0f} s by the clock: {space.bound}"
                break
            seconds.append(took)
            told = _counted(space.until(Deadline.after(SECONDS_MAX)), subject, words)
            del space  # beside which the next one would have to find room
        goal = ""
        if (wanted_seconds := subject.goal_seconds) is not None:
            met = bool(seconds) and min(seconds) <= wanted_seconds
            goal = f"<= {wanted_seconds:g} s: {'met' if met else 'missed'}"
        rows.append(
            (
                str(subject), told, f"{len(net.places):,}", spread(seconds, scale=1) if seconds else "-", goal,
                f"{min(seconds) / building:.2f}" if seconds else "-",
            )
        )  # fmt: skip
    return Table(
        f"All markings by {words}",
        "Seconds (smallest / median / largest of the runs) beside the goal, and as a multiple of building the net.",
        ("net", "markings", "places", "seconds", "goal", "x building"),
        tuple(rows),
    )


def _counted(space: StateSpace[Any], subject: Subject, words: str) -> str:
    """How many markings there are, which must be what the formula says."""
    try:
        found = space.n_markings
    except BudgetExceeded:
        return f"all, and not counted in {SECONDS_MAX:.0f} s"
    wanted = expected(subject.family)
    if wanted is not None and found != wanted:
        raise SystemExit(f"{subject}: {words} finds another number of markings than the formula")
    return _power_of_ten(found)


def _power_of_ten(number: int) -> str:
    if number < 10**15:
        return f"{number:,}"
    exponent, leading = 0, number
    while leading >= 10**6:  # a number of 30,000 digits is too long to be printed, by default
        shift = max(1, (leading.bit_length() - 20) * 3 // 10)
        leading //= 10**shift
        exponent += shift
    return f"{leading:.2e}".partition("e")[0] + f"e{exponent + len(str(leading)) - 1}"
