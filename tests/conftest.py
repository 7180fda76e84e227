"""How Hypothesis draws in every test: without a clock, and where `CI` is set the same examples each time.

A shared machine is slow now and then, which is no failure. In CI a failure must be that of the change and come again;
new examples are drawn on the engineers' own machines. The cache of `firable check` is off, so that no test is answered
by an earlier one.
"""

import os

from hypothesis import settings

settings.register_profile("firable", deadline=None, derandomize=bool(os.environ.get("CI")))
settings.load_profile("firable")
os.environ["FIRABLE_CACHE"] = ""
