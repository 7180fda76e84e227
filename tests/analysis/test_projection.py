"""Projections exclude nothing that is reached, and reach nothing that is not: compared with all markings of the net."""

from __future__ import annotations

from dataclasses import replace
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.evidence import document, evidence_of_finding
from support.examples import examples
from support.lively_nets import lively_nets
from support.ring_nets import ring_nets
from support.searched import goals, played, satisfies

from firable.analysis import stubborn
from firable.analysis._engine import BudgetExceeded
from firable.analysis.compiled import nodes_of
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Diagram, Labelling
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import document_from_text
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.goal import Limits
from firable.analysis.projection import refining
from firable.analysis.projection.projected import Explored, Projection, Room, explored, from_above, projection
from firable.analysis.projection.refining import Projections, decide_by_projection, known_by_projection
from firable.analysis.spaces.space import WitnessError
from firable.analysis.spaces.symbolic import SymbolicSpace
from firable.analysis.stubborn import find_firings
from firable.nets.bits import bits
from firable.nets.catalogue.families import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import Deadlock, Firable, parse_formula
from firable.nets.net import ExternalGate, Marking, Net, Place, Signal, Transition
from firable.semantics.algebra import BOOL
from firable.semantics.player import Player, holds_in
from firable.semantics.trace import Discipline

NETS = st.one_of(lively_nets(), ring_nets(signals=True), dense_nets(signals=True))
ON_ITSELF = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p", "q"), ("q",)),))
TORN = Net(
    "n",
    (Place("p", marked=True), Place("q")),
    (Transition("t", ("p",), ("q",), external=(ExternalGate("s"), ExternalGate("s", wanted=False))),),
    (Signal("s"),),
)


def kept_of(draw: st.DataObject, net: Net) -> Marking:
    return draw.draw(st.integers(0, (1 << len(net.places)) - 1))


def on(net: Net, marking: Marking, kept: Marking) -> Marking:
    """What a marking is in a projection."""
    return sum(1 << i for i, p in enumerate(bits(kept)) if marking >> p & 1)


def markings_of(of: Explored) -> set[Marking]:
    n = len(of.of.small.places)
    return {m for m in range(1 << n) if of.space.contains(of.space.algebra.conjunction([]), m)}


@examples(75)
@given(net=NETS, data=st.data())
def test_a_projection_has_all_markings_of_the_net_on_its_places(net: Net, data: st.DataObject) -> None:
    kept = kept_of(data, net)
    for room in (Room(2**20, 0), Room(1, 2**28)):
        found = explored(projection(net, kept), Limits(), room)
        assert isinstance(found.space, SymbolicSpace) is (room.markings == 1 < found.space.n_markings)
        assert {on(net, marking, kept) for marking in Player(net).reachable()} <= markings_of(found)


@examples(75)
@given(net=NETS, data=st.data())
def test_a_projection_to_all_places_has_the_markings_of_the_net(net: Net, data: st.DataObject) -> None:
    found = explored(projection(net, (1 << len(net.places)) - 1), Limits())
    assert markings_of(found) == set(Player(net).reachable())


@examples(75)
@given(net=NETS, data=st.data())
def test_what_fires_in_no_marking_of_a_projection_is_dead(net: Net, data: st.DataObject) -> None:
    found = explored(projection(net, kept_of(data, net)), Limits())
    player = Player(net)
    fires = {t for marking in player.reachable() for t in player.may_fire(marking)}
    assert fires.isdisjoint(found.dead())


@examples(75)
@given(net=NETS, data=st.data())
def test_a_goal_that_holds_holds_from_above(net: Net, data: st.DataObject) -> None:
    goal, kept = data.draw(goals(net)), kept_of(data, net)
    at = {p: i for i, p in enumerate(bits(kept))}
    for marking in range(1 << len(net.places)):
        above = from_above(nodes_of(net, goal), BOOL, holds_in(on(net, marking, kept)), at)
        assert above or not satisfies(net, marking, goal)
        if kept == (1 << len(net.places)) - 1:
            assert above is satisfies(net, marking, goal)


@pytest.mark.parametrize("between", [1, 3, 2**8])
@examples(75)
@given(net=NETS, data=st.data())
def test_a_goal_is_decided_as_all_markings_decide_it(between: int, net: Net, data: st.DataObject) -> None:
    """With few markings between the firings of a run, or small nets would be searched whole at once."""
    reachable = set(Player(net).reachable())
    for goal in (data.draw(goals(net)), Deadlock(), *(Firable(t.name) for t in net.transitions)):
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(refining, "_BETWEEN_MAX", between)
            found = decide_by_projection(net, goal, Limits())
        assert found.reachable is any(satisfies(net, marking, goal) for marking in reachable)
        assert (found.witness is not None) is found.reachable
        assert (found.certificate is not None) is not found.reachable
        if found.witness is not None:
            assert satisfies(net, played(net, found.witness), goal)


@examples(50)
@given(net=NETS, data=st.data())
def test_what_excludes_a_goal_is_shown_to_the_checker_and_survives_being_written(net: Net, data: st.DataObject) -> None:
    for goal in (data.draw(goals(net)), Deadlock(), *(Firable(t.name) for t in net.transitions)):
        found = decide_by_projection(net, goal, Limits())
        if found.reachable:
            continue
        evidence = evidence_of_finding(net, goal, found)
        assert evidence is not None
        assert check_evidence(evidence).shown
        text = document(evidence).to_text()
        assert document_from_text(text).records[0].shown[0][1] == found.certificate


@examples(50)
@given(net=NETS)
def test_the_transitions_that_fire_are_known(net: Net) -> None:
    player = Player(net)
    fires = {t for marking in player.reachable() for t in player.may_fire(marking)}
    answer = known_by_projection(net, Limits())["quasi-live"].answer
    dead = [t.name for i, t in enumerate(net.transitions) if i not in fires]
    assert answer.holds is (not dead)
    assert dead[:1] == list(answer.subjects[:1])
    assert set(answer.subjects) <= set(dead)


@pytest.mark.parametrize("net", [ON_ITSELF, TORN])
def test_what_contradicts_itself_outside_of_a_projection_does_not_fire_in_it(net: Net) -> None:
    assert projection(net, 0b01).small.transitions == ()
    assert decide_by_projection(net, parse_formula("not p"), Limits()).reachable is False


def test_gates_to_dropped_places_are_open() -> None:
    net = Net(
        "n",
        (Place("p", marked=True), Place("q"), Place("r"), Place("s", marked=True)),
        (Transition("t", ("p",), ("q",), permissive=("r",), inhibitive=("s",)),),
    )
    assert markings_of(explored(projection(net, 0b0011), Limits())) == {0b01, 0b10}
    assert markings_of(explored(projection(net, 0b0111), Limits())) == {0b001}
    assert markings_of(explored(projection(net, 0b1011), Limits())) == {0b101}


def excluding(places: int, goal: str) -> tuple[int, Projections]:
    """How many places of a table of philosophers exclude a goal."""
    net = family_net(f"philosophers_either-{places}")
    search = Projections(net, Limits())
    assert isinstance(search.decide(nodes_of(net, parse_formula(goal))), Explored)
    return search.kept.bit_count(), search


def test_as_few_places_exclude_a_goal_in_a_large_net_as_in_a_small_one() -> None:
    assert excluding(10, "p3.eating and p4.eating")[0] == excluding(1_000, "p3.eating and p4.eating")[0] == 9


def test_one_projection_excludes_all_transitions_that_want_what_it_excludes() -> None:
    net = family_net("philosophers_either-20")
    both = [Transition(f"both_{i}", ("p3.eating", "p4.eating"), (f"p{i}.left",)) for i in range(6, 9)]
    net = replace(net, transitions=(*net.transitions, *both))
    search = Projections(net, Limits())
    assert isinstance(search.firing(len(net.transitions) - 1), Explored)
    assert search.dead == {len(net.transitions) - 3 + i for i in range(3)}


def test_what_must_fire_between_the_firings_of_a_projection_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """No place of the line is kept, whose three firings let the other go on."""
    line = [Transition(f"on_{i}", (f"line_{i}",), (f"line_{i + 1}",)) for i in range(3)]
    places = (Place("idle", marked=True), Place("busy"), *(Place(f"line_{i}", marked=i == 0) for i in range(4)))
    net = Net("n", places, (Transition("go", ("idle",), ("busy",), permissive=("line_3",)), *line))
    goal = nodes_of(net, parse_formula("busy"))
    monkeypatch.setattr(refining, "_BETWEEN_MAX", 4)  # markings: too few for the whole run
    search = Projections(net, Limits())
    assert search.decide(goal) == (1, 2, 3, 0)
    assert search.kept == 0b11
    monkeypatch.setattr(refining, "_TRIED_MAX", 0)
    search = Projections(net, Limits())
    assert search.decide(goal) == (1, 2, 3, 0)
    assert search.kept == 0b111111


def test_a_projection_without_room_is_not_explored_again_until_there_is_more(monkeypatch: pytest.MonkeyPatch) -> None:
    net = family_net("philosophers_either-10")
    goal = nodes_of(net, parse_formula("p3.eating and p4.eating"))
    asked: list[Room] = []

    def counted(of: object, limits: Limits, room: Room) -> Explored:
        asked.append(room)
        raise BudgetExceeded("no room")

    monkeypatch.setattr(refining, "explored", counted)
    search = Projections(net, Limits(), Room(3, 0))
    for room in (Room(3, 0), Room(3, 0), Room(4, 0)):
        search.room = room
        with pytest.raises(BudgetExceeded):
            search.decide(goal)
    assert asked == [Room(3, 0), Room(4, 0)]
    search.room, search.limits = Room(5, 0), Limits(Deadline.after(0))
    for limits in (search.limits, Limits()):  # what had no time may have room
        search.limits = limits
        with pytest.raises(BudgetExceeded):
            search.decide(goal)
    assert asked[2:] == 2 * [Room(5, 0)]


def test_nothing_more_is_projected_once_the_time_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    net, over, asked = family_net("philosophers_either-10"), Event(), list[Projection]()
    goal = nodes_of(net, Deadlock())

    def counted(of: Projection, limits: Limits, room: Room) -> Explored:
        asked.append(of)
        over.set()
        return explored(of, replace(limits, deadline=NEVER), room)

    monkeypatch.setattr(refining, "explored", counted)
    assert Projections(net, Limits()).decide(goal)
    assert len(asked) > 1
    asked.clear()
    over.clear()
    limits = Limits(Deadline(cancelled=over))
    with pytest.raises(BudgetExceeded):
        Projections(net, limits).decide(goal)
    assert len(asked) == 1
    monkeypatch.setattr(Projections, "firing", lambda *_: pytest.fail("the time is over"))
    assert known_by_projection(net, limits) == {}


def test_what_is_too_large_is_left_undecided_and_says_how_many_places_were_kept() -> None:
    net = family_net("philosophers_either-10")
    found = decide_by_projection(net, parse_formula("p3.eating and p4.eating"), Limits(), room=Room(3, 0))
    assert (found.reachable, found.certificate) == (None, None)
    assert found.bound.startswith("kept 8 of 50 places: 3 markings found")
    over = decide_by_projection(net, Deadlock(), Limits(Deadline.after(0)))
    assert over.reachable is None
    assert known_by_projection(net, Limits(Deadline.after(0))) == {}


def test_a_run_that_lacks_nothing_and_is_none_is_an_error_of_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Projections, "_tried", lambda *_: 0)
    with pytest.raises(WitnessError):
        decide_by_projection(family_net("philosophers-3"), Deadlock(), Limits())


def test_only_so_many_projections_are_held(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refining, "_EXPLORED_MAX", 2)
    net = family_net("philosophers_either-10")
    search = Projections(net, Limits())
    for i in range(2, 8):
        assert isinstance(search.decide(nodes_of(net, parse_formula(f"p{i}.eating and p{i + 1}.eating"))), Explored)
        assert len(search._explored) <= 2


def test_transitions_are_found_dead_and_firing_by_projections_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    net = family_net("philosophers_either-10")
    dead = (
        Transition("both", ("p3.eating", "p4.eating"), ("p7.left",)),
        Transition("read", permissive=("p3.eating", "p4.eating")),
        Transition("loop", ("p3.eating",), ("p3.eating",)),
    )
    net = replace(net, transitions=(*net.transitions, *dead))
    monkeypatch.setattr(stubborn.FiringSearch, "_walk", lambda *_: None)
    monkeypatch.setattr(stubborn.FiringSearch, "_round", lambda *_, **__: "")
    search = stubborn.FiringSearch(net)
    found = search.found(Limits())
    assert not search.projections._explored, "what is only kept for another time takes no memory"
    assert (found.dead, found.undecided) == (("both", "read", "loop"), ())
    for transition in net.transitions[: -len(dead)]:
        assert found.witness(transition.name) is not None
    known = found.known()["quasi-live"]
    assert (known.answer.subjects, known.method) == (found.dead, "projections")


@pytest.mark.parametrize("stage", ["_project", "_refute"])
@examples(75)
@given(net=NETS)
def test_what_a_stage_closes_is_so(stage: str, net: Net) -> None:
    player = Player(net)
    fires = {t for marking in player.reachable() for t in player.may_fire(marking)}
    search = stubborn.FiringSearch(net)
    for turn in range(1, 1 + len(net.transitions)):
        if search.open:
            getattr(search, stage)(turn)
    assert search.dead.isdisjoint(fires)
    assert set(search.fires) <= fires
    assert search.open == set(range(len(net.transitions))) - search.dead - set(search.fires)
    if stage == "_project":
        assert not search.open


def test_the_methods_are_told_that_closed_transitions(monkeypatch: pytest.MonkeyPatch) -> None:
    net = family_net("philosophers_either-10")
    assert find_firings(net, Limits()).known()["quasi-live"].method == "random walks"
    monkeypatch.setattr(stubborn.FiringSearch, "_walk", lambda *_: None)
    monkeypatch.setattr(stubborn.FiringSearch, "_round", lambda *_, **__: "")
    assert find_firings(net, Limits()).known()["quasi-live"].method == "projections"


def test_what_few_tokens_make_dead_is_found_by_the_state_equation_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    net = family_net("philosophers_either-10")
    eating = tuple(f"p{i}.eating" for i in (3, 4))
    net = replace(
        net, transitions=(*net.transitions, *(Transition(f"t{i}", eating, (f"p{i}.left",)) for i in range(6, 9)))
    )
    monkeypatch.setattr(stubborn.FiringSearch, "_project", lambda *_: False)
    monkeypatch.setattr(stubborn.FiringSearch, "_ask", lambda *_, **__: "")
    found = find_firings(net, Limits())
    assert (found.dead, found.undecided) == (("t6", "t7", "t8"), ())
    assert found.known()["quasi-live"].method == "state equation and traps"


def test_few_places_show_what_is_never_in_a_net_of_many() -> None:
    net = family_net("philosophers_either-40")
    claim = Claim(ClaimKind.NEVER, parse_formula("p3.eating and p4.eating"))
    certificate = Certifier(net, Discipline.INTERLEAVING, Limits(Deadline.after(60))).certify(claim)
    assert isinstance(certificate, Labelling)
    assert isinstance(certificate.space, Diagram)
    assert len(certificate.space.rows) < 250


def test_a_diagram_with_a_marking_left_out_is_refused() -> None:
    net = family_net("philosophers_either-10")
    goal = parse_formula("p3.eating and p4.eating")
    found = decide_by_projection(net, goal, Limits())
    evidence = evidence_of_finding(net, goal, found)
    assert evidence is not None
    assert isinstance(found.certificate, Labelling)
    assert isinstance(found.certificate.space, Diagram)
    diagram = found.certificate.space
    level, _, high = diagram.rows[-1]
    for rows in ((*diagram.rows[:-1], (level, 0, high)), (*diagram.rows[:-1], (level, high, high))):
        forged = replace(found.certificate, space=replace(diagram, rows=rows))
        with pytest.raises(InputError):
            check_evidence(replace(evidence, certificate=forged))
