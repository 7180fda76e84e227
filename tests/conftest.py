"""How Hypothesis draws in every test: without a clock, and where `CI` is set the same examples each time.

A shared machine is slow now and then, which is no failure. In CI a failure must be that of the change and come again;
new examples are drawn on the engineers' own machines, and many in a campaign, which goes by the seed it prints. The
cache of `firable check` is off, so that no test is answered by an earlier one.
"""

import os

from hypothesis import settings
from support.examples import FACTOR, FIRST_SEED

IN_CAMPAIGN = FACTOR > 1

settings.register_profile("firable", deadline=None, derandomize=bool(os.environ.get("CI")) and not IN_CAMPAIGN)
settings.load_profile("firable")
os.environ["FIRABLE_CACHE"] = ""


def pytest_report_header() -> list[str]:
    """The seed of a campaign, by which it comes again."""
    return [f"campaign: {FACTOR} times the examples, seed {FIRST_SEED}"] if IN_CAMPAIGN else []
