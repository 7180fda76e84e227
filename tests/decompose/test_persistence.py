"""Persistent parts: against all markings by the reference player, with evidence that the checker accepts."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import pytest
from hypothesis import given
from support.examples import examples
from support.owned_nets import owned_nets
from support.reference import load_net

from firable.analysis.check import check
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.checking.checker import check_document
from firable.analysis.evidence.document import document_from_text
from firable.analysis.goal import Limits
from firable.analysis.spaces.symbolic import SymbolicSpace
from firable.decompose.bundling import make_bundle
from firable.decompose.splitting import persistence as module
from firable.decompose.splitting import walking
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import WALK_VOTES, Persistence, persistence
from firable.decompose.splitting.votes import FALSIFIERS_MAX, votes
from firable.decompose.splitting.walking import RUN_MAX, fallen
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.formulas import Formulas
from firable.decompose.verification.free_parts import check_free_parts
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.votes import question_of
from firable.decompose.verification.votes import votes as restated
from firable.nets import knowledge
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, family_net
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.formula import Formula
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition
from firable.nets.text import parse_net
from firable.nets.verdict import Status, Verdict
from firable.semantics.algebra import BOOL
from firable.semantics.firing import firable
from firable.semantics.player import Player, holds_in

A, B = Controller("a"), Controller("b")


def falsified(decomposition: Decomposition) -> dict[str, tuple[str, ...]]:
    """Each part with all that takes its yes back, by looking at every firing in every reachable marking."""
    net = decomposition.net
    graph = Player(net).reachable()
    found = {}
    for row in decomposition.coordinated:
        for part in row.parts:
            subnet = decomposition.subnet(part.controller)
            index = [net.place_index[place.name] for place in subnet.places]

            def yes(marking: int, subnet: Net = subnet, name: str = part.name, index: list[int] = index) -> bool:
                holds = holds_in(marking)
                return firable(BOOL, subnet, subnet.transition_index[name], lambda p: holds(index[p]))

            by = {
                fired[0]
                for marking, edges in graph.items()
                for fired, after in edges
                if net.transitions[fired[0]].name != row.name
                and yes(marking)
                and not closed_while_it_waits(net, fired[0], subnet.transition(part.name))
                and (not yes(after) or sends_anew(net, fired[0], subnet.transition(part.name)))
            }
            found[part.name] = tuple(net.transitions[t].name for t in sorted(by))
    return found


def closed_while_it_waits(net: Net, fired: int, part: Transition) -> bool:
    """Whether a firing wants a completion 0 that stands at 1 as long as the part's yes does; sensors may drop (O4)."""
    awaited = {gate.signal for gate in part.external if gate.wanted}
    levels = {name for name in awaited if net.signal(name).kind is not SignalKind.SENSOR}
    return any(gate.signal in levels and not gate.wanted for gate in net.transitions[fired].external)


def sends_anew(net: Net, fired: int, part: Transition) -> bool:
    """Whether a firing clears a completion that the part waits for, and does not itself wait for it to be cleared."""
    sends = {net.place(place).completion for place in net.transitions[fired].outputs}
    return any(
        gate.wanted and gate.signal in sends and replace(gate, wanted=False) not in net.transitions[fired].external
        for gate in part.external
    )


def agree(decomposition: Decomposition, found: Persistence) -> None:
    expected = falsified(decomposition)
    assert {verdict.name.removeprefix("persistent.") for verdict in found.verdicts} == expected.keys()
    for part, by in expected.items():
        verdict = found.of(part)
        assert verdict.status is (Status.VIOLATED if by else Status.PROVED)
        assert verdict.subjects == by


def agree_as_far_as_is_told(decomposition: Decomposition, found: Persistence) -> None:
    """Each vote is decided, as all markings show it; of what takes it back some is named."""
    for part, by in falsified(decomposition).items():
        verdict = found.of(part)
        assert verdict.status is (Status.VIOLATED if by else Status.PROVED)
        assert bool(verdict.subjects) is bool(by)
        assert set(verdict.subjects) <= set(by)


@given(owned_nets())
@examples(30)
def test_persistent_are_the_parts_whose_yes_no_firing_of_another_takes_back(net: Net) -> None:
    try:
        decomposition = split(net)
    except InputError:
        return
    found = persistence(decomposition)
    agree(decomposition, found)
    document = found.evidence()
    checked = list(check_document(document_from_text(document.to_text())))
    assert all(one.shown for one in checked)
    decided = [vote for vote in found.votes if not vote.settled]
    assert [claim for record in document.records for claim, _ in record.shown] == [
        module.claim_of(vote, persistent=found.of(vote.part).holds) for vote in decided
    ]


@given(owned_nets())
@examples(12)
def test_a_race_of_techniques_finds_the_same_where_no_space_is_held(net: Net) -> None:
    try:
        decomposition = split(net)
    except InputError:
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module._Deciding, "_held", lambda _: None)
        found = persistence(decomposition)
    agree_as_far_as_is_told(decomposition, found)
    assert all(one.shown for one in check_document(found.evidence()))


def asked_anew(decomposition: Decomposition) -> None:
    """The questions that the checker makes of the votes are those of the claims, whatever order a set goes in."""
    formulas = Formulas()
    for vote, anew in zip(votes(decomposition), restated(decomposition), strict=True):
        assert anew.name == f"persistent.{vote.part}"
        assert (anew.touching, anew.accused, anew.asked) == (vote.touching, vote.accused, not vote.others)
        goal = cast(Formula, module.claim_of(vote, persistent=True).goal)
        assert not vote.accused or anew.question(formulas) == question_of(goal, formulas)


@given(owned_nets())
@examples(30)
def test_the_checker_asks_of_each_vote_what_the_producer_answers(net: Net) -> None:
    try:
        decomposition = split(net)
    except InputError:
        return
    asked_anew(decomposition)


def test_the_checker_asks_in_the_order_of_the_net_of_a_vote_on_many_places() -> None:
    names = [f"p{i}" for i in range(12)]
    full, empty = [f"a.{name}" for name in names], [f"a.not_{name}" for name in names]
    places = (*(Place(p, "a", marked=True) for p in full), *(Place(p, "a") for p in empty), Place("b.q", "b"))
    local = [Transition(f"u{i}", (p,), (q,)) for i, (p, q) in enumerate(zip(full, empty, strict=True))]
    crossing = Transition("G", tuple(full), ("b.q",), (), tuple(empty))
    asked_anew(split(Net("n", places, (crossing, *local), controllers=(A, B))))


def test_arcs_and_units_of_the_cell_leave_two_parts_to_its_markings() -> None:
    ballots = votes(split(load_net("cell1")))
    # What fills an input place of the part, or needs an output place of it full, is not even accused.
    accused = {"t1-21": ("G6",), "t1-31": ("G8",), "t1-41": ("G2",), "t1-51": ("G5",)}
    assert {vote.part: vote.accused for vote in ballots if vote.accused} == accused
    left = {vote.part: vote.falsifiers for vote in ballots if vote.falsifiers}
    assert left == {"t1-21": ("G6",), "t1-41": ("G2",)}


def test_a_transition_that_needs_empty_what_the_yes_needs_full_is_not_accused() -> None:
    places = (Place("a.p", "a", marked=True), Place("a.r", "a", marked=True), Place("b.q", "b"))
    other = Transition("u", ("a.r",), (), (), ("a.p",))  # takes a.r, which G reads, but never while a.p is full
    crossing = Transition("G", ("a.p",), ("b.q",), ("a.r",))
    (vote, _) = votes(split(Net("n", places, (crossing, other), controllers=(A, B))))
    assert (vote.part, vote.accused) == ("t1-11", ())


def test_firing_sequence_of_a_part_that_is_not_persistent_ends_with_the_firing_that_takes_its_yes_back() -> None:
    decomposition = split(catalogue_net("one_robot"))
    verdict = persistence(decomposition).of("t1-41")
    assert verdict.witness is not None
    assert verdict.witness.firings == (("G1",), ("G2",))
    assert verdict.subjects == ("G2",)
    assert verdict.discipline == "interleaving"


def test_parts_of_a_large_line_are_decided_by_its_arcs_and_units_alone() -> None:
    ballots = votes(split(family_net("manufacturing_cells-200")))
    left = [vote for vote in ballots if vote.falsifiers]
    # A robot is free for two stations: the start of one task takes the yes of the other back, and nothing else does.
    assert len(left) == 200
    assert {len(vote.falsifiers) for vote in left} == {1}


def test_without_time_nothing_is_decided_that_needs_a_marking() -> None:
    found = persistence(split(catalogue_net("one_robot")), limits=Limits(Deadline.after(0)))
    unknown = {verdict.name: verdict for verdict in found.verdicts if verdict.status is Status.UNKNOWN}
    assert {"persistent.t1-21", "persistent.t1-41"} <= unknown.keys()
    assert unknown["persistent.t1-21"].subjects == ("G6",)
    assert unknown["persistent.t1-21"].code == "F3004"
    assert not any("t1-21" in record.lacking for record in found.evidence().records)


def test_a_place_that_very_many_share_is_not_looked_at_pair_by_pair() -> None:
    n = FALSIFIERS_MAX + 2
    places = (Place("a.p", "a", marked=True), *(Place(f"b.q{i}", "b") for i in range(n)))
    crossing = tuple(Transition(f"t{i}", ("a.p",), (f"b.q{i}",)) for i in range(n))
    found = persistence(split(Net("n", places, crossing, controllers=(A, B))))
    assert found.of("t1-11").status is Status.UNKNOWN
    assert f"{n:,}" in found.of("t1-11").bound
    assert found.of("t2-12").status is Status.PROVED  # its own place is shared by nobody


def crossing_net() -> Net:
    """One transition from `a` to `b`, at a place where a command waits for its completion."""
    command = Command("A", "GO")
    places = (
        Place("a.p", "a", marked=True, command=command, completion="a.done"),
        Place("a.r", "a"),
        Place("b.q", "b"),
    )
    transition = Transition("t", ("a.p",), ("b.q",), external=(ExternalGate("a.done"),))
    back = Transition("back", ("a.r",), ("a.p",))
    signals = (Signal("a.done", "a", SignalKind.COMPLETION), Signal("a.s", "a"))
    return Net("n", places, (transition, back), signals, (A, B))


def undisturbing(decomposition: Decomposition) -> tuple[str, ...]:
    """By the arcs, as both texts say: that of whoever makes a bundle, and that of its checker, who demands just these.

    The checker is told that every vote is persistent.
    """
    found = knowledge.undisturbing(decomposition)
    parts = [(row.name, part) for row in decomposition.coordinated for part in row.parts]
    free = tuple((name, part.controller) for name, part in parts if part.name in found)
    verdicts = tuple(Verdict(f"persistent.{part.name}", Status.PROVED, "it is", "a premise") for _, part in parts)
    examination = Examination(Bundle(replace(decomposition, free=free), verdicts))
    for verdict in verdicts:
        examination.judge(verdict, shown=True, method="a premise")
    check_free_parts(examination, Cut(decomposition.net))
    return found


def test_part_is_free_of_the_promise_where_it_takes_no_yes_back_and_its_gate_stays_open() -> None:
    net = crossing_net()
    assert undisturbing(split(net)) == ("t1-11", "t2-12")
    assert persistence(split(net)).free_of_promise == ("t1-11", "t2-12")


@pytest.mark.parametrize(
    "other",
    [
        Transition("u", ("a.p",), ("a.r",), external=(ExternalGate("a.done"),)),  # takes from the same place
        Transition("u", ("a.r",), (), permissive=("a.p",)),  # reads it, and sees it too late
    ],
)
def test_part_that_takes_another_yes_back_must_promise(other: Transition) -> None:
    net = crossing_net()
    assert undisturbing(split(replace(net, transitions=(*net.transitions, other)))) == ("t2-12",)


@pytest.mark.parametrize("other", [Transition("u", ("a.p",), ("b.q",)), Transition("u", ("a.r",), (), (), ("b.q",))])
def test_part_whose_output_another_fills_or_reads_as_empty_must_promise(other: Transition) -> None:
    net = crossing_net()
    places = tuple(replace(place, completion=None) for place in net.places)
    bare = tuple(replace(transition, external=()) for transition in net.transitions)
    net = Net("n", places, (*bare, other), controllers=(A, B))
    assert "t2-12" not in undisturbing(split(net))


@pytest.mark.parametrize("gate", [ExternalGate("a.s"), ExternalGate("a.done", wanted=False)])
def test_part_with_a_gate_that_may_close_must_promise(gate: ExternalGate) -> None:
    net = crossing_net()
    p, r, q = net.places
    places = (replace(p, completion=None), replace(r, command=p.command, completion=p.completion), q)
    crossing = replace(net.transitions[0], external=(gate,))
    assert undisturbing(split(replace(net, places=places, transitions=(crossing,)))) == ("t2-12",)


def test_part_whose_completion_another_command_clears_must_promise() -> None:
    net = crossing_net()
    again = Place("a.r", "a", command=Command("A", "STOP"), completion="a.done")
    places = (net.places[0], again, net.places[2])
    back = replace(net.transitions[1], external=(ExternalGate("a.done"),))
    assert undisturbing(split(replace(net, places=places, transitions=(net.transitions[0], back)))) == ("t2-12",)


@pytest.mark.parametrize(
    ("needs", "free"),
    [(("a.r",), ("t2-12",)), (("a.p",), ("t1-11", "t2-12"))],
    ids=["whatever it fills", "what it fills"],
)
def test_part_that_clears_what_another_reads_must_promise_unless_that_needs_what_it_fills(
    needs: tuple[str, ...], free: tuple[str, ...]
) -> None:
    net = crossing_net()
    crossing = Transition("t", ("b.q",), ("a.p",))
    reading = Transition("u", needs, ("a.r",) * (needs == ("a.p",)), external=(ExternalGate("a.done"),))
    assert undisturbing(split(replace(net, transitions=(crossing, reading)))) == free


@pytest.mark.parametrize(
    ("read", "free"),
    [
        (ExternalGate("a.done", wanted=False), ("t2-12",)),
        (ExternalGate("a.done"), ("t1-11", "t2-12")),
        (ExternalGate("a.s", wanted=False), ("t1-11", "t2-12")),
    ],
)
@pytest.mark.parametrize("reads_full", [True, False])
def test_part_whose_gate_a_completion_alone_keeps_another_from_closing_must_promise(
    reads_full: bool, read: ExternalGate, free: tuple[str, ...]
) -> None:
    net, gate = crossing_net(), ("a.k",)
    other = Transition("u", gate * reads_full, gate * (not reads_full), external=(read,))
    crossing = replace(net.transitions[0], permissive=gate * reads_full, inhibitive=gate * (not reads_full))
    places = (*net.places, Place("a.k", "a", marked=reads_full))
    assert undisturbing(split(replace(net, places=places, transitions=(crossing, other)))) == free


TAKEN_BY_COMPLETION = """\
firable: 1
cell: taken
controllers:
  sys:
    coordinator: true
    start: [s]
    places: {s: , s2: }
  a:
    start: [p, y]
    places: {p: , x: {send: {machine: R, command: MOVE}, until: at}, y: , z: }
transitions:
  u: {from: a.p, to: a.x}
  w: {from: a.x, to: a.p}
  g: {from: [a.y, sys.s], to: [a.z, sys.s2], if: a.at}
  h: {from: [a.z, sys.s2], to: [a.y, sys.s]}
"""


def test_a_command_sent_anew_takes_back_the_yes_of_a_part_that_waits_for_its_completion() -> None:
    decomposition = split(parse_net(TAKEN_BY_COMPLETION))
    found = persistence(decomposition)
    verdict = found.of("t1-11")
    assert verdict.status is Status.VIOLATED
    assert verdict.subjects == ("u",)
    assert verdict.witness is not None
    assert verdict.witness.firings == (("u",),)
    assert all(one.shown for one in check_document(found.evidence()))
    asked_anew(decomposition)


def test_a_command_that_waits_for_the_completion_to_be_cleared_takes_no_yes_back() -> None:
    text = TAKEN_BY_COMPLETION.replace("{from: a.p, to: a.x}", "{from: a.p, to: a.x, unless: a.at}")
    decomposition = split(parse_net(text))
    assert persistence(decomposition).of("t1-11").holds
    asked_anew(decomposition)


def test_part_that_clears_a_completion_which_another_reads_meanwhile_must_promise() -> None:
    """Between decision and order `v` would fire on the completion of the command before."""
    stale = (
        TAKEN_BY_COMPLETION[: TAKEN_BY_COMPLETION.index("transitions:")]
        + """\
transitions:
  g: {from: [a.p, sys.s], to: [a.x, sys.s2]}
  h: {from: [a.x, sys.s2], to: [a.p, sys.s]}
  v: {from: a.y, to: a.z, if: a.at}
"""
    )
    assert "t1-11" not in undisturbing(split(parse_net(stale)))
    for gates in ("a.x", "[a.at, a.x]"):  # who needs the place that is entered full reads nothing before it is
        assert "t1-11" in undisturbing(split(parse_net(stale.replace("if: a.at", f"if: {gates}"))))


def test_bundle_holds_the_verdicts_on_votes_with_a_document_that_shows_them() -> None:
    bundle = make_bundle(check(catalogue_net("one_robot")))
    verdicts = {verdict.name: verdict for verdict in bundle.verdicts if verdict.name.startswith("persistent.")}
    assert len(verdicts) == 24
    document = document_from_text(bundle.evidence["persistence.evidence.json"])
    assert document.net == bundle.net
    assert [one.shown for one in check_document(document)] == [True] * 2
    by = {name: verdict.evidence for name, verdict in verdicts.items()}
    assert [name for name, files in by.items() if files == ("persistence.evidence.json",)] == [
        "persistent.t1-21",
        "persistent.t1-41",
    ]
    assert sum(files == ("persistence.smt2",) for files in by.values()) == 22
    # The moves of the robot share a completion: each clears what the next part waits for, if not for its places.
    (unit,) = (verdict for verdict in bundle.verdicts if verdict.name.startswith("unit."))
    assert unit.subjects == tuple(p.name for p in bundle.net.places if p.owner == "robot")
    assert Bundle.from_bytes(bundle.to_bytes()) == bundle


@given(owned_nets())
@examples(15)
def test_what_a_walk_meets_is_what_takes_a_yes_back_and_its_run_leads_there(net: Net) -> None:
    try:
        decomposition = split(net)
    except InputError:
        return
    expected, player = falsified(decomposition), Player(net)
    ballots = votes(decomposition)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(walking, "WITHOUT_NEWS_MAX", 2000)
        met = fallen(net, ballots, Deadline())
    for vote in ballots:
        assert met.get(vote.part, {}).keys() <= set(expected[vote.part])
        for name, run in met.get(vote.part, {}).items():
            marking = net.initial_marking
            for t in run:
                marking = player.fire(marking, [t])
            full, empty = net.marking(vote.full), net.marking(vote.empty)
            assert marking & full == full
            assert not marking & empty
            assert net.transition_index[name] in player.firable(marking)


def test_a_walk_through_a_large_plant_finds_each_vote_that_falls_with_a_short_run() -> None:
    net = family_net("workshop-40")
    ballots = votes(split(net))
    met = fallen(net, ballots, Deadline())
    open_ = [vote for vote in ballots if vote.falsifiers]
    assert len(open_) > WALK_VOTES
    assert met.keys() == {vote.part for vote in open_}
    assert max(len(run) for by in met.values() for run in by.values()) <= RUN_MAX
    assert fallen(net, ballots, Deadline()) == met


def test_a_walk_begins_anew_where_nothing_can_fire() -> None:
    """`G` is dead after `l`, and after `G` nothing is left: either is met from M0 only."""
    places = (Place("a.p", "a", marked=True), Place("a.r", "a"), Place("b.q", "b"))
    transitions = (Transition("G", ("a.p",), ("b.q",)), Transition("l", ("a.p",), ("a.r",)))
    net = Net("n", places, transitions, controllers=(A, B))
    ballots = votes(split(net))
    assert fallen(net, ballots, Deadline()) == {"t1-11": {"l": ()}, "l": {"G": ()}}


def test_many_open_votes_are_looked_out_for_by_one_walk() -> None:
    found = persistence(split(family_net("workshop-40")))
    assert {verdict.method for verdict in found.verdicts if not verdict.holds} == {"walk at random, sliced"}
    assert not any(verdict.status is Status.UNKNOWN for verdict in found.verdicts)


DROPPING = """\
firable: 1
cell: dropping
controllers:
  a:
    start: lies
    inputs: seen
    places: {lies: , gone: }
  b:
    start: free
    places: {free: , full: }
transitions:
  hand_over: {from: [a.lies, b.free], to: b.full, if: a.seen}
  leave: {from: a.lies, to: a.gone, unless: a.seen}
  again: {from: a.gone, to: a.lies}
  empty: {from: b.full, to: b.free}
"""
STAYING = """\
firable: 1
cell: staying
controllers:
  a:
    start: lies
    places:
      lies: {send: {machine: M, command: HOLD}, until: done, within: 5s}
      lies_fault:
  b:
    start: free
    places: {free: , full: }
transitions:
  hand_over: {from: [a.lies, b.free], to: b.full}
  again: {from: a.lies_fault, to: a.lies}
  empty: {from: b.full, to: b.free}
"""


@pytest.mark.parametrize(("text", "stands"), [(DROPPING, False), (STAYING, True)])
def test_a_sensor_that_may_drop_excludes_nothing_and_a_completion_that_stays_does(text: str, stands: bool) -> None:
    decomposition = split(parse_net(text))
    found = persistence(decomposition)
    (part,) = (
        part.name
        for row in decomposition.coordinated
        for part in row.parts
        if (row.name, part.controller) == ("hand_over", "a")
    )
    assert found.of(part).holds == stands
    agree(decomposition, found)


def test_votes_of_a_net_that_the_explicit_engine_has_no_room_for_are_decided_all_the_same() -> None:
    decomposition = split(catalogue_net("one_robot_mc_late"))
    found = persistence(decomposition, limits=Limits(memory_bytes=1))
    assert found.space is None
    assert any(falsified(decomposition).values()), "arcs and units do not settle all"
    agree_as_far_as_is_told(decomposition, found)


def test_votes_are_decided_by_a_diagram_where_a_table_does_not_hold_all_markings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def never_raced(*_: object) -> None:
        raise AssertionError("the diagram leaves nothing to a race")

    monkeypatch.setattr(module, "FIRST_MARKINGS", 10)
    monkeypatch.setattr(module._Deciding, "_race", never_raced)
    decomposition = split(catalogue_net("one_robot_mc_late"))
    found = persistence(decomposition)
    assert isinstance(found.space, SymbolicSpace)
    agree(decomposition, found)
