"""The rule of a verdict: the code under which code-scanning sites and `firable explain` know it."""

import pytest

from firable.nets.diagnostics import CODES
from firable.nets.rules import rule_of
from firable.nets.verdict import Status, Verdict

RULES = {
    "contact-free": "F3010",
    "deadlock-free": "F3011",
    "doomed-markings": "F3012",
    "quasi-live": "F3013",
    "live": "F3014",
    "reversible": "F3015",
    "home-markings": "F3016",
    "structural-conflicts": "F3017",
    "effective-conflicts": "F3018",
    "gate-races": "F3019",
    "steps-serialisable": "F3020",
    "starvation": "F3021",
    "property.no_crash": "F3022",
    "query.query-1": "F3023",
    "self-loops": "F2009",
    "loop.busy-machines": "F3030",
    "loop.accidents": "F3031",
    "loop.completions": "F3032",
    "loop.gates-open": "F3033",
    "loop.live": "F3014",
    "loop.property.no_crash": "F3022",
    "fault.R.repaired": "F3034",
    "persistent.t0-1": "F4005",
    "protocol.starts": "F4006",
    "explored.follows": "F4006",
    "faults.resumes": "F4006",
    "wrong.eager": "F4006",
    "rehearsal": "F4006",
    "bisimilar.weak": "F3010",
    "workpieces-carried-through": "F5007",
    "workpieces-intact": "F5007",
    "ran-until-stopped": "F5007",
    "host-ended-in-order": "F5007",
    "machines": "F5008",
    "machines-as-modelled": "F5008",
    "eq7.G1": "F4002",
    "ownership": "F4002",
}


def verdict(name: str, status: Status = Status.VIOLATED, code: str = "") -> Verdict:
    return Verdict(name, status, "", "", code=code)


@pytest.mark.parametrize(("name", "code"), RULES.items())
def test_a_verdict_has_the_rule_of_its_kind(name: str, code: str) -> None:
    assert rule_of(verdict(name)) == code
    assert code in CODES


def test_what_is_not_decided_has_the_rule_of_the_budget() -> None:
    assert rule_of(verdict("live", Status.UNKNOWN)) == "F3004"
    assert rule_of(verdict("ran-until-stopped", Status.UNKNOWN)) == "F5007"  # somebody stopped it


def test_a_verdict_that_says_its_code_keeps_it() -> None:
    assert rule_of(verdict("machine-never-stopped", code="F3001")) == "F3001"
    assert rule_of(verdict("contact-free", Status.UNKNOWN, "F3006")) == "F3006"
