"""What follows from verdicts that are known is what the whole state space says."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from support.lively_nets import lively_net
from support.small_text import net_of

from firable.analysis.check import check
from firable.analysis.report import CheckReport
from firable.analysis.verdicts.consequences import consequences
from firable.nets.net import Net
from firable.nets.verdict import Status

NAMES = (
    "deadlock-free",
    "doomed-markings",
    "quasi-live",
    "live",
    "reversible",
    "home-markings",
    "starvation",
)


def consistent(net: Net, report: CheckReport) -> int:
    """Whatever is left out of the report of a whole space, what follows from the rest agrees; how much followed."""
    followed = 0
    for known in (*[(name,) for name in NAMES], ("reversible", "quasi-live"), ("reversible", "deadlock-free")):
        for name, found in consequences(net, {name: report.verdict(name) for name in known}).items():
            expected = report.verdict(name).status
            assert found.answer.holds is (expected is Status.PROVED), (known, name)
            assert expected is not Status.UNKNOWN
            followed += 1
    return followed


@pytest.mark.parametrize("chunk", range(4))
def test_what_follows_from_a_part_of_the_verdicts_is_what_the_others_say(chunk: int) -> None:
    followed = 0
    for seed in range(60 * chunk, 60 * (chunk + 1)):
        net = lively_net(random.Random(seed), 8)
        followed += consistent(net, check(net))
    assert followed > 300


def test_a_deadlock_in_the_initial_marking_leaves_the_net_reversible() -> None:
    net = net_of("p", "t: q -> p")
    found = consequences(net, {"deadlock-free": check(net).verdict("deadlock-free")})
    assert "reversible" not in found
    assert found["live"].answer.holds is False


def test_a_net_without_transitions_is_live_whatever_its_deadlock() -> None:
    net = net_of("p")
    report = check(net)
    assert report.verdict("live").holds
    assert "live" not in consequences(net, {"deadlock-free": report.verdict("deadlock-free")})
    assert "deadlock-free" not in consequences(net, {"live": report.verdict("live")})


def test_an_undecided_verdict_has_no_consequences() -> None:
    net = net_of("p", "t: p -> q")
    verdict = replace(check(net).verdict("deadlock-free"), status=Status.UNKNOWN)
    assert consequences(net, {"deadlock-free": verdict}) == {}


def test_a_violation_that_follows_shows_the_same_firing_sequence() -> None:
    net = net_of("p", "t: p -> q")
    deadlock = check(net).verdict("deadlock-free")
    found = consequences(net, {"deadlock-free": deadlock})
    assert deadlock.witness is not None
    for name in ("live", "reversible", "doomed-markings"):
        witness = found[name].answer.witness
        assert witness is not None
        assert witness.firings == deadlock.witness.firings
    assert found["live"].method == f"follows from deadlock-free: {deadlock.method}"
