"""What is said of one fault rests on verdicts, and is no better than the worst of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest
from support.layered_nets import cells_in_a_line

from firable.decompose.protocol.faulty import KINDS
from firable.decompose.protocol.outages import outage_verdict, outages
from firable.decompose.protocol.shown import FAMILIES
from firable.decompose.protocol.single_faults import CRASHES, DEATHS, MESSAGES, Finding, OneFault, single_faults
from firable.decompose.protocol.variant import Often
from firable.decompose.protocol.verdicts import protocol_verdicts
from firable.decompose.splitting.cut import split
from firable.nets import parse_net
from firable.nets.catalogue import family_net
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Status, Verdict

SHUTTLE = """\
firable: 1
cell: shuttle
controllers:
  robot:
    start: [part]
    places: {part: {}, free: {}}
  lathe:
    start: [empty]
    places: {empty: {}, full: {}}
transitions:
  hand_over: {from: [robot.part, lathe.empty], to: [robot.free, lathe.full]}
  fetch: {from: robot.free, to: robot.part}
  unload: {from: lathe.full, to: lathe.empty}
"""
RESTS_ON = {
    "explored.follows", "explored.agrees", "explored.orders-fit", "explored.complete",
    "faults.follows", "faults.agrees", "faults.orders-fit", "faults.resumes",
    "faults.dead.robot", "faults.dead.lathe", "faults.dead-coordinator",
}  # fmt: skip


@pytest.fixture(scope="module")
def shuttle() -> Decomposition:
    return split(parse_net(SHUTTLE))


def proved(names: Iterable[str]) -> dict[str, Verdict]:
    return {name: Verdict(name, Status.PROVED, "", "") for name in names}


def findings(told: Iterable[OneFault]) -> dict[tuple[str, int], Finding]:
    return {(one.fault, i): finding for one in told for i, finding in enumerate(one.findings)}


def test_every_kind_of_fault_is_told_and_happens_any_number_of_times_in_the_runs_that_are_asked(
    shuttle: Decomposition,
) -> None:
    told = [one.kind for one in single_faults(shuttle, ())]
    assert set(told) == {*KINDS, ""}
    assert told == [*MESSAGES, *CRASHES, *DEATHS]
    assert all(getattr(FAMILIES["faults"], kind) is Often.ALWAYS for kind in KINDS)
    assert not FAMILIES["explored"]


def test_what_the_findings_rest_on_are_the_verdicts_of_prove_and_all_are_proved_of_a_small_cell(
    shuttle: Decomposition,
) -> None:
    verdicts = [*protocol_verdicts(shuttle, faults=True).verdicts, *map(outage_verdict, outages(shuttle))]
    told = findings(single_faults(shuttle, verdicts))
    assert {name for finding in told.values() for name in finding.by} == RESTS_ON
    assert {verdict.name for verdict in verdicts} >= RESTS_ON
    assert all(finding.status is Status.PROVED for finding in told.values() if finding.by)
    assert {finding.lacking for finding in told.values()} == {""}


@pytest.mark.parametrize("name", sorted(RESTS_ON))
def test_a_finding_is_as_bad_as_the_worst_verdict_behind_it_and_others_stay(shuttle: Decomposition, name: str) -> None:
    good = proved(RESTS_ON)
    before = findings(single_faults(shuttle, good.values()))
    without = {key: verdict for key, verdict in good.items() if key != name}
    for changed, status, why in (
        ({name: replace(good[name], status=Status.UNKNOWN, bound="time is over")}, Status.UNKNOWN, "(time is over)"),
        ({name: replace(good[name], status=Status.VIOLATED)}, Status.VIOLATED, f"{name} is violated"),
        ({}, Status.UNKNOWN, f"{name} is not there"),
    ):
        after = findings(single_faults(shuttle, {**without, **changed}.values()))
        assert after.keys() == before.keys()
        assert any(name in finding.by for finding in after.values())
        for key, finding in after.items():
            if name in finding.by:
                assert finding.status is status
                assert why in finding.lacking
            else:
                assert finding == before[key]


def test_nothing_is_said_to_be_proved_where_nothing_was_asked(shuttle: Decomposition) -> None:
    told = findings(single_faults(shuttle, ()))
    assert {finding.status for finding in told.values()} == {None, Status.UNKNOWN}
    assert all(bool(finding.by) is (finding.status is not None) for finding in told.values())


def test_a_violated_verdict_outweighs_one_that_is_unknown(shuttle: Decomposition) -> None:
    verdicts = proved(RESTS_ON)
    verdicts["faults.follows"] = replace(verdicts["faults.follows"], status=Status.UNKNOWN)
    verdicts["faults.agrees"] = replace(verdicts["faults.agrees"], status=Status.VIOLATED)
    assert findings(single_faults(shuttle, verdicts.values()))["a message is lost", 0].status is Status.VIOLATED


def test_of_many_verdicts_that_are_missing_the_first_are_named_and_the_others_counted() -> None:
    told = findings(single_faults(split(family_net("workshop-10")), ()))[CRASHES["crash"], 1]
    assert len(told.by) > 5
    assert told.lacking.endswith(f"; and {len(told.by) - 4} more")


def test_where_nothing_is_coordinated_no_message_can_be_lost_and_no_coordinator_crash() -> None:
    lonely = split(
        parse_net(SHUTTLE.replace("  hand_over: {from: [robot.part, lathe.empty], to: [robot.free, lathe.full]}\n", ""))
    )
    assert [one.fault for one in single_faults(lonely, ())] == [CRASHES["crash"], DEATHS["crash"]]
    assert findings(single_faults(lonely, ()))[CRASHES["crash"], 0].by == ("faults.follows", "faults.agrees")


def test_each_coordinator_of_layers_is_among_those_that_crash() -> None:
    decomposition = split(cells_in_a_line())
    names = [outage_verdict(one).name for one in outages(decomposition)]
    told = findings(single_faults(decomposition, ()))
    assert [*told[CRASHES["crash"], 1].by, *told[DEATHS["coordinator"], 1].by] == names
