"""How many examples a property is tried on: few in every test run, many in a campaign (`make campaign`).

A campaign is the same properties on more and on other nets, so there is no second harness whose sentences could differ
from those of the tests. What fails is shrunk by Hypothesis and printed with the line that reproduces it; what is drawn
by seeds names its seed.
"""

import os

from hypothesis import settings

FACTOR = int(os.environ.get("FIRABLE_CAMPAIGN", "1"))
"""How many times more examples are tried than in a test run."""
FIRST_SEED = int(os.environ.get("FIRABLE_SEED", "0"))
"""Where the seeds of a campaign begin."""


def examples(count: int) -> settings:
    """So many examples of a property in a test run, `FACTOR` times as many in a campaign."""
    return settings(max_examples=count * FACTOR, deadline=None)


def seeds(count: int, part: int = 0) -> range:
    """So many seeds in a test run, `FACTOR` times as many in a campaign; the first part from `FIRST_SEED` on."""
    first = FIRST_SEED + part * count * FACTOR
    return range(first, first + count * FACTOR)
