"""Changes that cure a violated verdict: the smallest that is found, and shown by checking the changed net."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Final

import pytest
from support.examples import seeds
from support.lively_nets import lively_net

from firable.analysis.check import check
from firable.analysis.cures.finding import explained, with_circle
from firable.analysis.deadline import Deadline
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph
from firable.analysis.spaces.space import StateSpace
from firable.analysis.temporal.queries import answer
from firable.nets.catalogue import catalogue_net
from firable.nets.changes import Arbitration, CapacityPlace, Change, Gate, capacity, changed, free_name
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.editing import edits
from firable.nets.net import Arbiter, ArbitrationRule, Net, Place, Transition
from firable.nets.printing import format_net, in_file_order
from firable.nets.queries import Query, parse_query
from firable.nets.rules import hints_of
from firable.nets.source import Source
from firable.nets.text import parse_net
from firable.nets.verdict import Cure, Status, Verdict, Weight, Witness

_CAPACITY_PLACE: Final = r"add the place `(\S+)`, marked at the start, to `from` of (.+) and to `to` of (.+)"


def _explained(net: Net) -> dict[str, Verdict]:
    return {verdict.name: verdict for verdict in explained(check(net))}


def test_the_late_machine_is_cured_by_a_gate_or_by_the_capacity_place_of_the_paper() -> None:
    late = _explained(catalogue_net("one_robot_mc_late"))["deadlock-free"]
    proves = ("doomed-markings", "live", "property.no_deadlock", "property.restart")
    loses = ("property.robot_held_at_a_full_mc",)
    markings = check(catalogue_net("one_robot_mc_late_capacity")).figures.markings
    capacity_place = "add the place `system.capacity`, marked at the start, to `from` of G2 and to `to` of G6"
    assert late.cures == (
        Cure(("give G2 the gate `unless: system.processing`",), proves, loses, 40),
        Cure((capacity_place,), proves, loses, markings),
    )


def test_one_cure_is_told_of_all_verdicts_that_it_cures() -> None:
    found = _explained(catalogue_net("one_robot_mc_late"))
    changes = [cure.changes for cure in found["deadlock-free"].cures]
    for name in ("property.no_deadlock", "property.restart"):
        assert [cure.changes for cure in found[name].cures] == changes
        assert all("deadlock-free" in cure.proves and name not in cure.proves for cure in found[name].cures)


def test_a_cure_that_is_found_for_a_later_verdict_is_told_of_an_earlier_one() -> None:
    """Of contact by itself none is found; the gate that cures the deadlock keeps the net from it as well."""
    arcs = (("ec", "d"), ("b", "e"), ("c", "ad"), ("e", "b"), ("d", "b"), ("f", "a"))
    transitions = tuple(Transition(f"t{t}", tuple(of), tuple(to)) for t, (of, to) in enumerate(arcs))
    told = _explained(Net("late", tuple(Place(name, marked=name in "bc") for name in "abcdef"), transitions))
    (cure,) = told["deadlock-free"].cures
    assert cure.changes == ("give t4 the gate `unless: a`",)
    assert "contact-free" in cure.proves
    (same,) = told["contact-free"].cures
    assert same.changes == cure.changes


def test_a_cure_tells_what_becomes_of_the_queries_and_is_none_the_less_offered() -> None:
    texts = {"again": "EF deadlock", "ends": "AF deadlock", "never": "AG not deadlock"}
    net = catalogue_net("one_robot_mc_late")
    queries = [parse_query(text, name) for name, text in texts.items()]
    before = check(net, queries=queries)
    cures = {verdict.name: verdict.cures for verdict in explained(before, queries)}
    assert [cure.changes for cure in cures["deadlock-free"]] == [
        cure.changes for cure in _explained(net)["deadlock-free"].cures
    ]
    for cure in cures["deadlock-free"]:
        after = check(changed(net, cure.parts), queries=queries)
        for name in (f"query.{name}" for name in texts):
            held, holds = (report.verdict(name).holds for report in (before, after))
            assert (name in cure.loses) is (held and not holds)
            assert (name in cure.proves) is (holds and not held)
        assert "query.again" in cure.loses
    assert [cure.changes for cure in cures["query.never"]] == [cure.changes for cure in cures["deadlock-free"]]


def test_queries_are_asked_again_in_the_time_of_the_report_and_what_stays_open_is_no_loss(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[str, Deadline]] = []

    def unknown(space: StateSpace[Any], query: Query) -> Verdict:
        asked.append((query.name, space.deadline))
        return replace(answer(space, query), status=Status.UNKNOWN)

    monkeypatch.setattr("firable.analysis.cures.finding.answer", unknown)
    queries = [parse_query("EF deadlock", name) for name in ("known", "open")]
    report = check(catalogue_net("one_robot_mc_late"), budget=Budget(seconds=600.0), queries=queries)
    verdicts = [replace(one, status=Status.UNKNOWN) if one.name == "query.open" else one for one in report.verdicts]
    told = explained(replace(report, verdicts=tuple(verdicts)), queries)
    cures = next(verdict.cures for verdict in told if verdict.name == "deadlock-free")
    assert cures
    assert not any(name.startswith("query.") for cure in cures for name in (*cure.loses, *cure.proves))
    assert {name for name, _ in asked} == {"known"}
    assert {deadline for _, deadline in asked} == {report.space.deadline}


def test_cures_are_looked_for_in_the_time_of_the_report() -> None:
    report = check(catalogue_net("one_robot_mc_late"), budget=Budget(seconds=600.0))
    over = report.space.until(Deadline.after(0.0))
    assert not any(verdict.cures for verdict in explained(replace(report, space=over)))
    assert any(verdict.cures for verdict in explained(report))


def test_a_changed_net_that_has_no_room_is_no_cure_and_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any, **__: Any) -> ReachabilityGraph:
        raise InputError([Diagnostic("F3006", "no room", "")])

    monkeypatch.setattr("firable.analysis.cures.finding.explore", full)
    assert not _explained(catalogue_net("one_robot_mc_late"))["deadlock-free"].cures


DEAD: Final = Transition("dead", ("robot.free", "conveyor.cv1"), permissive=("conveyor.cv1_wait",))
"""Fires in no marking of the late cell."""


def test_it_is_said_where_there_are_too_many_markings_for_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    def told() -> dict[str, Verdict]:
        return {verdict.name: verdict for verdict in explained(check(catalogue_net("one_robot_mc_late")))}

    before = told()
    monkeypatch.setattr("firable.analysis.cures.finding.MARKINGS_MAX", 76)
    assert told() == before, "the net has so many"
    monkeypatch.setattr("firable.analysis.cures.finding.MARKINGS_MAX", 75)
    after = told()
    none = "no cure was looked for, as 76 markings are more than 75"
    for name in ("deadlock-free", "property.restart"):
        ((_, hint),) = hints_of(before[name])
        assert before[name].cures
        assert (after[name].hint, after[name].cures) == (f"{hint}; {none}", ())
    assert after["live"].hint == before["live"].hint, "a warning, which no cure is looked for"
    assert not any(none in verdict.hint for verdict in after.values() if verdict.holds)
    late = catalogue_net("one_robot_mc_late")
    dead = replace(late, transitions=(*late.transitions, DEAD))
    (found,) = (verdict for verdict in explained(check(dead)) if verdict.name == "quasi-live")
    assert none not in found.hint, "no change of ours would bring it to life"


def test_all_changes_of_a_cure_make_one_net(monkeypatch: pytest.MonkeyPatch) -> None:
    net = catalogue_net("philosophers-4")
    (cure,) = _explained(net)["effective-conflicts"].cures
    made: list[Net] = []
    monkeypatch.setattr(Net, "__post_init__", lambda self: made.append(self))
    after = changed(net, cure.parts)
    assert (made, len(after.arbiters)) == ([after], len(cure.parts))


def test_competitors_without_an_arbiter_are_offered_one() -> None:
    (cure,) = _explained(catalogue_net("philosophers-4"))["effective-conflicts"].cures
    assert len(cure.changes) == 4
    assert cure.changes[0] == (
        "add to `arbiters`: `p1_takes_left_or_p4_takes_right: {among: [p1_takes_left, p4_takes_right], by: rotation}`"
    )


@pytest.mark.parametrize("name", ["one_robot_mc_late", "conceptual_one_robot_mc_late", "philosophers-4"])
def test_a_cure_written_into_the_net_file_makes_the_net_that_was_checked(name: str) -> None:
    net = catalogue_net(name)
    text = format_net(net)
    cures = [cure for verdict in _explained(net).values() for cure in verdict.cures]
    assert len(cures) >= 2
    for cure in cures:
        written = parse_net(edits.change(Source("cell.firable.yaml", text), cure.parts).text)
        assert in_file_order(written) == in_file_order(changed(net, cure.parts))


@pytest.mark.seeds
def test_cures_of_drawn_nets_are_written_as_they_were_checked() -> None:
    seen: set[type[Change]] = set()
    for seed in sorted({*range(60), *seeds(60)}):  # one in a hundred has a cure by a place, and of those one
        net = lively_net(random.Random(seed))
        source = Source("cell.firable.yaml", format_net(net))
        for cure in (cure for verdict in _explained(net).values() for cure in verdict.cures):
            written = parse_net(edits.change(source, cure.parts).text)
            assert in_file_order(written) == in_file_order(changed(net, cure.parts)), seed
            seen |= {type(part) for part in cure.parts}
    assert seen == {Gate, CapacityPlace, Arbitration}


def test_what_the_file_wants_reachable_is_told_where_it_is_the_price() -> None:
    late = catalogue_net("one_robot_mc_late")
    held = tuple(of for of in late.properties if of.name == "robot_held_at_a_full_mc")
    for properties, loses in (((), ()), (held, ("property.robot_held_at_a_full_mc",))):
        cures = _explained(replace(late, properties=properties))["deadlock-free"].cures
        assert [cure.loses for cure in cures] == [loses, loses]


def test_a_change_by_which_somebody_starves_comes_last() -> None:
    by_place, by_gates = _explained(catalogue_net("philosophers-3"))["deadlock-free"].cures
    assert "capacity" in by_place.changes[0]
    assert by_place.loses == ("effective-conflicts",)
    assert by_gates.loses == ("starvation",)


def test_nothing_is_offered_where_the_start_is_lost_already() -> None:
    net = Net("end", (Place("a", marked=True), Place("b")), (Transition("t", ("a",), ("b",)),))
    assert _explained(net)["deadlock-free"].cures == ()


@pytest.mark.seeds
def test_each_change_that_is_offered_does_what_is_said_of_it() -> None:
    offered = 0
    for seed in seeds(300):
        net = lively_net(random.Random(seed), 8)
        before = check(net)
        for verdict in explained(before):
            for cure in verdict.cures:
                offered += 1
                _does_what_it_says(net, before.verdicts, verdict.name, cure)
    assert offered > 30


def _does_what_it_says(net: Net, before: Iterable[Verdict], name: str, cure: Cure) -> None:
    after = check(_by_hand(net, cure))
    ended = {one.name: one for one in after.verdicts}
    assert after.figures.markings == cure.markings
    assert not any(_fails(ended[of]) for of in (name, *cure.proves))
    for one in before:
        if one.name not in cure.loses and one.weight is not Weight.INFORMATION and not _fails(one):
            assert not _fails(ended[one.name]), one.name


def _fails(verdict: Verdict) -> bool:
    return verdict.status is not Status.PROVED and verdict.weight is not Weight.INFORMATION


def _by_hand(net: Net, cure: Cure) -> Net:
    """The net changed as the sentences say, read as an engineer reads them."""
    for change in cure.changes:
        if gate := re.fullmatch(r"give (\S+) the gate `(if|unless): (\S+)`", change):
            net = changed(net, [Gate(gate[1], gate[3], gate[2] == "if")])
        elif place := re.fullmatch(_CAPACITY_PLACE, change):
            takers, givers = place[2].split(" and "), place[3].split(" and ")
            net = changed(net, [CapacityPlace(place[1], None, tuple(takers), tuple(givers))])
        else:
            arbiter = re.fullmatch(r"add to `arbiters`: `(\S+): \{among: \[(.+)\], by: (\w+)\}`", change)
            assert arbiter is not None, change
            written = Arbiter(arbiter[1], tuple(arbiter[2].split(", ")), ArbitrationRule(arbiter[3]))
            net = replace(net, arbiters=(*net.arbiters, written))
    return net


@pytest.mark.parametrize("permissive", [True, False])
def test_a_gate_is_open_by_its_kind(permissive: bool) -> None:
    net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ()),))
    gated = changed(net, [Gate("t", "q", permissive)]).transition("t")
    assert (gated.permissive, gated.inhibitive) == ((("q",), ()) if permissive else ((), ("q",)))


def test_a_capacity_place_belongs_to_the_coordinator_and_has_a_free_name() -> None:
    net = catalogue_net("one_robot_mc_late_capacity")
    assert capacity(net, ["G1"], ["G9"]).place == "system.capacity_2"
    assert capacity(net, ["G1"], ["G9"]).owner == "system"
    assert free_name("a", {"b"}) == "a"


def test_an_arbiter_counts_by_what_it_names() -> None:
    assert Arbitration(Arbiter("a", ("t", "u", "v"))).size == 3
    assert CapacityPlace("c", None, ("t",), ("u", "v")).size == 4


def test_tokens_that_a_gate_may_still_free_are_told_to_wait_in_no_circle() -> None:
    text = """
firable: 1
cell: c
start: [a, b]
inputs: [s]
places: {a: , b: , fa: , fb: }
transitions:
  take_a: {from: [a, fb], to: fa}
  take_b: {from: [b, fa], to: fb}
"""
    stuck = Verdict(
        "loop.deadlock-free", Status.VIOLATED, "...", "explicit", witness=Witness(marking=("a", "b", "R.idle"))
    )
    told = with_circle(parse_net(text.replace("inputs: [s]\n", "")), stuck).witness
    assert told is not None
    assert [(wait.place, wait.holder) for wait in told.waits] == [("a", "b"), ("b", "a")]
    assert with_circle(parse_net(f"{text}  open_b: {{from: b, to: fb, if: s}}\n"), stuck) == stuck
