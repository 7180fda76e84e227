"""How many examples a property is tried on: few in every test run, many or all in a campaign (`make campaign`).

A campaign is the same properties on more and on other nets, so there is no second harness whose sentences could differ
from those of the tests. What fails is shrunk by Hypothesis and printed with the line that reproduces it; what is drawn
by seeds names its seed. What could be gone through to its end, such as all single changes of a bundle, each of which
is checked as a whole, is drawn from in a test run (`some`), and gone through in a campaign.
"""

import os
import random
from collections.abc import Iterable
from typing import TypeVar

from hypothesis import settings

T = TypeVar("T")

FACTOR = int(os.environ.get("FIRABLE_CAMPAIGN", "1"))
"""How many times more examples are tried than in a test run."""
FIRST_SEED = int(os.environ.get("FIRABLE_SEED", "0"))
"""Where the seeds of a campaign begin."""


IN_CAMPAIGN = FACTOR > 1
IS_REPEATED = bool(os.environ.get("CI")) and not IN_CAMPAIGN
"""Whether the examples of a property are the same each time, so that fewer of them will do."""


def examples(count: int) -> settings:
    """So many examples of a property in a test run, a third where `CI` is set, many times more in a campaign."""
    return settings(max_examples=-(-count * FACTOR // (3 if IS_REPEATED else 1)), deadline=None)


def seeds(count: int, part: int = 0) -> range:
    """So many seeds in a test run, `FACTOR` times as many in a campaign; the first part from `FIRST_SEED` on."""
    first = FIRST_SEED + part * count * FACTOR
    return range(first, first + count * FACTOR)


def some(everything: Iterable[T], one_in: int) -> list[T]:
    """One in so many of a list, drawn, in the order of the list; half as many where `CI` is set, all in a campaign."""
    listed = list(everything)
    if IN_CAMPAIGN:
        return listed
    many = -(-len(listed) // (2 * one_in if IS_REPEATED else one_in))
    drawn = random.Random(FIRST_SEED).sample(range(len(listed)), many)
    return [listed[i] for i in sorted(drawn)]
