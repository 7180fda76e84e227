"""Owners by rule and proposed owners: complete, exact, and compared honestly."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.owned_nets import owned_nets
from support.timed_nets import timed_nets

from firable.analysis.deadline import Deadline
from firable.analysis.spaces.equivalence import isomorphic
from firable.analysis.spaces.reachability import explore
from firable.decompose.splitting import partitioning
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.hypergraph import Hypergraph, hypergraph
from firable.decompose.splitting.partitioning import partition
from firable.decompose.splitting.rules import Rules, owned_by_rules, read_rules, rules_of_options
from firable.decompose.splitting.suggesting import suggest
from firable.nets.catalogue import catalogue_names, catalogue_net, family_net
from firable.nets.diagnostics import InputError
from firable.nets.joining import join
from firable.nets.net import (
    Command,
    Controller,
    ExternalGate,
    Net,
    Place,
    Signal,
    SignalKind,
    TimeLimit,
    Transition,
)
from firable.nets.owning import with_owners
from firable.nets.printing import format_net, in_file_order
from firable.nets.text import parse_net


def bare(net: Net) -> Net:
    """The net without owners: names as they were, and nobody's."""
    return replace(
        net,
        places=tuple(replace(place, owner=None) for place in net.places),
        signals=tuple(replace(signal, owner=None) for signal in net.signals),
        controllers=(),
    )


def patterns(**rules: str) -> Rules:
    return rules_of_options(f"{controller}={spelled}" for controller, spelled in rules.items())


def problems(net: Net, rules: Rules) -> list[tuple[str, tuple[str, ...]]]:
    with pytest.raises(InputError) as refusal:
        owned_by_rules(net, rules)
    assert all(diagnostic.hint for diagnostic in refusal.value.diagnostics)
    return [(diagnostic.code, diagnostic.subject) for diagnostic in refusal.value.diagnostics]


SMALL = Net(
    "n",
    (
        Place("r_go", marked=True, command=Command("R", "GO"), completion="done"),
        Place("r_free"),
        Place("m_full"),
    ),
    (
        Transition("t", ("r_go",), ("r_free",), external=(ExternalGate("done"),)),
        Transition("u", ("r_free",), ("m_full",), external=(ExternalGate("door"),)),
        Transition("v", ("m_full",), external=(ExternalGate("full"),)),
    ),
    (Signal("done", kind=SignalKind.COMPLETION), Signal("door"), Signal("full")),
)


def test_rules_own_what_they_match_and_what_is_joined_follows() -> None:
    owned = owned_by_rules(SMALL, patterns(robot="r_*,door", mc="m_*"))
    assert [place.name for place in owned.places] == ["robot.r_go", "robot.r_free", "mc.m_full"]
    assert [signal.name for signal in owned.signals] == ["robot.done", "robot.door", "mc.full"]
    assert owned.place("robot.r_go").completion == "robot.done"
    assert [row.name for row in split(owned).table] == ["u"]


def test_a_sensor_that_gates_transitions_of_several_controllers_needs_a_rule() -> None:
    assert problems(SMALL, patterns(robot="r_*", mc="m_*")) == [("F2011", ("signals", "door"))]


def test_a_place_of_no_rule_and_one_of_two_are_refused_together() -> None:
    found = problems(SMALL, patterns(robot="r_*,door", other="*_free"))
    assert found == [("F2023", ("places", "r_free")), ("F2011", ("places", "m_full")), ("F2011", ("signals", "full"))]


def test_a_pattern_that_matches_nothing_is_refused() -> None:
    assert ("F2002", ()) in problems(SMALL, patterns(robot="r_*,door,x_*", mc="m_*"))


def test_rules_give_the_cell_back_the_owners_that_its_names_tell() -> None:
    net = catalogue_net("one_robot")
    rules = patterns(**{controller.name: f"{controller.name}.*" for controller in net.controllers})
    owned = owned_by_rules(net, rules)
    assert owned == net
    assert [row.name for row in split(owned_by_rules(bare(net), rules)).table] == [f"G{n}" for n in range(1, 10)]


LAYERED = """\
firable: 1
cell: layered
controllers:
  line: {coordinator: true}
  cell: {under: line}
  robot: {under: cell, start: free, places: {free: , busy: }}
  table: {under: cell, start: empty, places: {empty: , full: }}
transitions:
  load: {from: [robot.free, table.empty], to: [robot.busy, table.full]}
"""


def test_rules_keep_who_stands_above_those_that_they_name() -> None:
    """They own nothing, and decide what those below them do together."""
    net = parse_net(LAYERED)
    owned = owned_by_rules(net, patterns(robot="robot.*", table="table.*"))
    assert set(owned.controllers) == set(net.controllers)
    assert parse_net(format_net(owned)) == in_file_order(owned)


@pytest.mark.parametrize("by_rule", [True, False])
def test_whom_a_resource_opens_to_stays_a_controller(by_rule: bool) -> None:
    """Or the net that is written could not be refined any more."""
    net = catalogue_net("conceptual_one_robot")
    owned = owned_by_rules(net, patterns(tasks="*")) if by_rule else suggest(net, 2, slack=1.0).net
    kept = {controller.name for controller in owned.controllers}
    assert {place.resource.idle.partition(".")[0] for place in net.places if place.resource} < kept


def test_rules_are_read_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "owners.yaml"
    path.write_text("robot: [r_*, door]\nmc: m_*\n", encoding="utf-8")
    assert read_rules(path) == patterns(robot="r_*,door", mc="m_*")


def test_a_pattern_of_a_file_that_matches_nothing_is_refused_where_it_stands(tmp_path: Path) -> None:
    path = tmp_path / "owners.yaml"
    path.write_text("robot: [r_*, door]\nmc:\n  - m_*\n  - x_*\n", encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        owned_by_rules(SMALL, read_rules(path))
    (problem,) = refusal.value.diagnostics
    assert (problem.code, str(problem.span)) == ("F2002", f"{path}:4:5")


@pytest.mark.parametrize("text", ["robot: true\n", "robot: [r_*, true]\n", "robot: []\n", "robot: [[r_*]]\n"])
def test_what_is_no_pattern_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "owners.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="F1010"):
        read_rules(path)


@pytest.mark.parametrize(("text", "line"), [("robot:\nmc: m_*\n", 1), ("mc: m_*\nrobot: {a: b}\n", 2), ("[a]\n", 1)])
def test_a_file_that_holds_no_rules_is_refused_where_it_stands(tmp_path: Path, text: str, line: int) -> None:
    path = tmp_path / "owners.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        read_rules(path)
    (problem,) = refusal.value.diagnostics
    assert (problem.code, problem.span and problem.span.line) == ("F1010", line)


@pytest.mark.parametrize("option", ["robot", "=r_*", "robot=", "robot=a,,b"])
def test_an_option_that_is_no_rule_is_refused(option: str) -> None:
    with pytest.raises(InputError, match="F1010"):
        rules_of_options([option])


def test_two_things_of_one_name_keep_their_former_owners_in_a_common_controller() -> None:
    net = Net(
        "n", (Place("a.p", "a"), Place("b.p", "b"), Place("b.q", "b")), (), (), (Controller("a"), Controller("b"))
    )
    owned = with_owners(net, dict.fromkeys(("a.p", "b.p", "b.q"), "c"), (Controller("c"),))
    assert [place.name for place in owned.places] == ["c.a_p", "c.b_p", "c.q"]


@given(owned_nets(), st.integers(1, 3))
@examples(10)
def test_a_proposal_owns_everything_once_and_changes_nothing_else(net: Net, n: int) -> None:
    net = bare(net)
    if best_by_force(hypergraph(net), n, *hypergraph(net).bounds(n, 2.0)) is None:
        return
    found = suggest(net, n, slack=2.0)
    assert len(found.net.controllers) == n
    decomposition = split(found.net)
    numbers = {row.name: row.number for row in decomposition.coordinated}
    numbered = tuple(replace(t, number=numbers.get(t.name, t.number)) for t in found.net.transitions)
    assert join(decomposition) == replace(found.net, transitions=numbered)
    # The count of the hypergraph is that of the split.
    assert [row.name for row in decomposition.table] == [name for name, _ in found.cut]
    assert sum(len(row.parts) for row in decomposition.table) == found.proposed.votes
    assert found.fewest <= found.proposed.n_cut <= found.most
    assert isomorphic(explore(net), explore(found.net))
    machines = {(p.command.machine, p.owner) for p in found.net.places if p.command is not None}
    assert len(dict(machines)) == len(machines)


def best_by_force(graph: Hypergraph, n: int, low: int, high: int) -> int | None:
    """The fewest cut transitions of all partitions, tried one by one."""
    found = []
    for of in product(range(n), repeat=len(graph.blocks)):
        sizes = graph.sizes(of, n)
        if min(sizes) >= low and max(sizes) <= high:
            found.append(len(graph.cut(of)))
    return min(found, default=None)


@given(owned_nets(), st.integers(2, 3), st.sampled_from([0.3, 0.6, 1.5]))
@examples(10)
def test_what_is_called_optimal_is_what_trying_all_partitions_gives(net: Net, n: int, slack: float) -> None:
    graph = hypergraph(net)
    if len(graph.blocks) > 8:
        return
    fewest = best_by_force(graph, n, *graph.bounds(n, slack))
    if fewest is None:
        with pytest.raises(InputError, match="F4004"):
            partition(graph, n, slack, Deadline.after(20))
        return
    found = partition(graph, n, slack, Deadline.after(20))
    assert found.optimal
    assert len(graph.cut(found.partition)) == fewest
    assert graph.fewest(n) <= fewest


def test_four_controllers_proposed_for_the_cell_are_its_machines() -> None:
    found = suggest(bare(catalogue_net("one_robot")), 4)
    assert {controller.name for controller in found.net.controllers} == {"r", "mc", "cv1", "cv2"}
    assert (found.proposed.n_cut, found.proposed.votes, found.optimal, found.given) == (7, 16, True, None)
    owner = {place.name.partition(".")[2]: place.owner for place in found.net.places}
    assert (owner["conveyor.cv1"], owner["mc.free"], owner["robot.free"]) == ("cv1", "mc", "r")


def test_owners_of_the_file_are_compared_with() -> None:
    given = suggest(catalogue_net("one_robot"), 4).given
    assert given is not None
    assert (given.n_cut, given.votes) == (9, 24)
    assert dict(given.sizes) == {"system": 5, "robot": 16, "mc": 11, "conveyor": 9}


def test_proposed_owners_are_written_as_a_net_file() -> None:
    net = suggest(catalogue_net("one_robot"), 4).net
    assert parse_net(format_net(net)) == in_file_order(net)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("name", [name for name in catalogue_names() if catalogue_net(name).fault_transitions])
def test_proposed_owners_of_a_timed_net_are_written_as_a_net_file(name: str, n: int) -> None:
    net = suggest(catalogue_net(name), n, slack=2.0).net
    assert parse_net(format_net(net)) == in_file_order(net)


@given(timed_nets(), st.lists(st.sampled_from("cd"), min_size=3, max_size=3))
@examples(25)
def test_a_timed_net_whose_controllers_are_joined_is_written_as_a_net_file(net: Net, joined: list[str]) -> None:
    new = dict(zip((controller.name for controller in net.controllers), joined, strict=False))
    items: list[Place | Signal] = [*net.places, *net.signals]
    owners = {item.name: new[item.owner] for item in items if item.owner}
    owned = with_owners(net, owners, [Controller(name) for name in "cd"])
    assert parse_net(format_net(owned)) == in_file_order(owned)


def test_time_limits_of_one_name_keep_the_former_owners_of_their_places() -> None:
    net = parse_net("""firable: 1
cell: two
controllers:
  a: {start: free, places: {free: , go: {send: {machine: A, command: GO}, until: there, within: 1s}}}
  b: {start: free, places: {free: , go: {send: {machine: B, command: GO}, until: there, within: 2s}}}
  c: {start: go, places: {go: }}
transitions:
  a: {from: a.free, to: a.go}
  b: {from: b.free, to: b.go}
""")
    both = owned_by_rules(net, patterns(m="a.*,b.*", n="c.*"))
    assert [place.within and place.within.timer for place in both.places] == [
        None, "m.a_go_overdue", None, None, "m.b_go_overdue", None, None
    ]  # fmt: skip
    one = owned_by_rules(net, patterns(m="a.*,c.*", n="b.*"))
    assert one.place("m.a_go").within == TimeLimit(1000, "m.go_overdue")
    assert one.transition("a.go_timeout").description == "m.there has not come within 1s"
    for owned in (both, one):
        assert parse_net(format_net(owned)) == in_file_order(owned)


def test_without_time_nothing_is_called_optimal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(partitioning, "find_spec", lambda _: None)
    with pytest.raises(InputError, match="F4004"):
        suggest(catalogue_net("one_robot"), 4, deadline=Deadline.after(0))


def test_more_controllers_than_there_are_blocks_are_refused() -> None:
    with pytest.raises(InputError, match="19 blocks"):
        suggest(catalogue_net("one_robot"), 20)


def test_a_large_net_is_partitioned_into_its_lines() -> None:
    pytest.importorskip("mtkahypar")
    found = suggest(family_net("manufacturing_cells-200"), 5)
    assert (found.proposed.n_cut, found.optimal) == (4, False)  # a line cut into five pieces
    assert suggest(family_net("manufacturing_cells-200"), 5) == found


def test_one_transition_may_tie_many_parts_together() -> None:
    graph = Hypergraph((("p",), ("q",), ("r",), ("s",), ("x",)), (1,) * 5, ((0, 1, 2, 3), (3, 4)), ("t", "u"))
    assert [graph.fewest(n) for n in (1, 2, 3, 4, 5)] == [0, 1, 1, 1, 2]
    apart = Hypergraph((("p",), ("q",)), (1, 1), (), ())
    assert apart.fewest(2) == 0
