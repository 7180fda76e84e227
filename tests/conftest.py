"""How Hypothesis draws in every test: without a clock, and where `CI` is set the same examples each time.

A shared machine is slow now and then, which is no failure. In CI a failure must be that of the change and come again;
new examples are drawn on the engineers' own machines, and many in a campaign, which goes by the seed it prints. The
cache of `firable check` is off, so that no test is answered by an earlier one.

A solver says the same of the same text, so it is asked once in a process: most bundles of the tests differ in one line.

Whoever runs the tests in the background has Ctrl-C ignored, and so would all processes that the tests start.

Ten thousand collected tests live to the end. The garbage collector is told so, or it looks at them all again and again.
It looks less often than Python has it do, because most tests build what they need and drop it, with few cycles; and not
at all while they are collected.
"""

import gc
import os
import signal
from collections.abc import Iterator
from functools import lru_cache

import pytest
from hypothesis import settings
from support.examples import FACTOR, FIRST_SEED, IN_CAMPAIGN, IS_REPEATED, examples

settings.register_profile("firable", examples(100), derandomize=IS_REPEATED)
settings.load_profile("firable")
os.environ["FIRABLE_CACHE"] = ""
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def asked_once() -> Iterator[None]:
    """The solvers of the checker of bundles, each with what it said of the last texts."""
    from support.remembered import answered

    from firable.decompose.verification import checking
    from firable.decompose.verification.solvers import by_z3

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checking, "SOLVERS", {"cvc5": answered, "z3": lru_cache(512)(by_z3)})
        yield


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Nothing of Python's own is called at a collection of garbage, where the exception of a Ctrl-C would be ignored.

    Hypothesis, once it has run, notes there how long collections take.
    """
    called, gc.callbacks[:] = list(gc.callbacks), []
    yield
    gc.callbacks[:] = called


def pytest_collectstart() -> None:
    gc.disable()


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()
    gc.enable()
    gc.set_threshold(20_000, 20, 50)


def pytest_report_header() -> list[str]:
    """The seed of a campaign, by which it comes again."""
    return [f"campaign: {FACTOR} times the examples, seed {FIRST_SEED}"] if IN_CAMPAIGN else []
