"""Coordinators under coordinators: who decides what, that the votes add up, and that a run needs no more than one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.owned_nets import owned_nets

from firable.analysis.check import check
from firable.cli.main import main
from firable.decompose.bundling import make_bundle
from firable.decompose.proofs.proving import prove
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.table import table_text
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Part
from firable.nets.diagnostics import InputError
from firable.nets.interchange import net_digest, net_from_json, net_to_json
from firable.nets.joining import join
from firable.nets.knowledge import knowledge, reasons
from firable.nets.layers import COORDINATOR, Layers
from firable.nets.net import Arbiter, Controller, ExternalGate, Net, Place, Signal, Transition
from firable.nets.printing import format_net
from firable.nets.right_to_run import required_verdicts, unproved
from firable.nets.text import parse_net
from firable.nets.verdict import Status

TWO_CELLS = catalogue_net("two_cells")


def layered(net: Net, under: dict[str, str]) -> Net:
    """The net with some of its controllers under others."""
    return replace(net, controllers=tuple(replace(c, under=under.get(c.name)) for c in net.controllers))


def crossing(name: str, *owners: str) -> Transition:
    return Transition(name, (f"{owners[0]}.{name}",), tuple(f"{owner}.{name}" for owner in owners[1:]))


def three_deep() -> Net:
    """A plant over two lines, with a cell under each."""
    joined = {
        "all": ("c1", "c2"),
        "within": ("c1", "m1"),
        "line": ("m1", "k1"),
        "own": ("line1", "m1"),
    }
    places = tuple(Place(f"{owner}.{name}", owner, i == 0) for name, of in joined.items() for i, owner in enumerate(of))
    under = {"c1": "line1", "m1": "c1", "k1": "line1", "c2": "line2", "line1": None, "line2": None}
    controllers = tuple(Controller(name, under=above) for name, above in under.items())
    return Net("deep", places, tuple(crossing(name, *of) for name, of in joined.items()), controllers=controllers)


def test_a_transition_is_decided_by_the_lowest_coordinator_above_all_who_take_part() -> None:
    assert {row.name: row.at for row in split(three_deep()).coordinated} == {
        "all": None,
        "within": "c1",  # a coordinator that takes part itself stands above itself
        "line": "line1",
        "own": "line1",
    }


@pytest.mark.parametrize(
    "gate",
    [{"permissive": ("k1.x",)}, {"inhibitive": ("k1.x",)}, {"external": (ExternalGate("k1.s"),)}],
    ids=lambda gate: str(*gate),
)
def test_who_takes_part_by_a_gate_alone_is_under_who_decides(gate: dict[str, Any]) -> None:
    net = three_deep()
    transitions = tuple(replace(t, **gate) if t.name == "within" else t for t in net.transitions)
    places, signals = (*net.places, Place("k1.x", "k1")), (Signal("k1.s", "k1"),)
    decomposition = split(replace(net, places=places, transitions=transitions, signals=signals))
    rows = {row.name: row for row in decomposition.coordinated}
    assert rows["within"].at == "line1"
    assert prove(decomposition).holds
    too_low = tuple((rows | {"within": replace(rows["within"], at="c1")}).values())
    refuted = {v.name for v in prove(replace(decomposition, coordinated=too_low)).verdicts if not v.holds}
    assert refuted == {"o8", "o8.within"}


def test_a_conflict_across_coordinators_goes_to_their_common_ancestor() -> None:
    decomposition = split(TWO_CELLS)
    assert {row.name: row.at for row in decomposition.table if row.at} == {
        **dict.fromkeys(("put_a", "taken_a"), "cell_a"),
        **dict.fromkeys(("put_b", "taken_b"), "cell_b"),
    }
    (lifted, _) = [reason for reason in reasons(decomposition) if reason.lifted_from]
    assert (lifted.transition, lifted.lifted_from) == ("unload_a", "cell_a")
    assert (lifted.rival, lifted.place) == ("load_a", "robot_a.free")
    assert {group.name: (group.at, group.controller) for group in decomposition.groups} == {
        "conflict-1": (None, None),
        "conflict-2": (None, "robot_a"),
        "conflict-3": (None, None),
        "conflict-4": (None, "robot_b"),
    }


@pytest.mark.parametrize("first", [True, False], ids=["the local one first", "the local one last"])
def test_a_conflict_within_a_cell_is_decided_there(first: bool) -> None:
    net, rival = three_deep(), Transition("rival", ("c1.within",), ("c1.x",))
    transitions = (rival, *net.transitions) if first else (*net.transitions, rival)
    decomposition = split(replace(net, transitions=transitions, places=(*net.places, Place("c1.x", "c1"))))
    (group,) = decomposition.groups
    assert (group.at, group.controller) == ("c1", None)
    assert {row.name: row.at for row in decomposition.coordinated if not row.is_global} == {"rival": "c1"}
    proof = prove(decomposition)
    assert proof.holds
    names = {verdict.name for verdict in proof.verdicts if verdict.name.startswith("o8")}
    assert names == {name for name in required_verdicts(decomposition) if name.startswith("o8")}
    assert "o8.rival" not in names, "one vote is not added up"


def test_two_cells_have_the_figures_that_they_are_shown_with() -> None:
    report = check(TWO_CELLS)
    assert (report.figures.markings, report.figures.edges) == (1568, 5346)
    assert report.status is Status.PROVED
    assert report.figures.live
    decomposition = split(TWO_CELLS)
    assert len(decomposition.table) == 12
    assert join(decomposition) == TWO_CELLS


def test_each_coordinator_has_a_table_of_its_own() -> None:
    told = table_text(split(TWO_CELLS).table)
    first, a, b = told.split("decided by ")
    assert first.count("\n") == 8
    assert a.splitlines()[0] == "cell_a:"
    assert "put_a:" in a
    assert b.count("\n") == 3


def test_a_coordinator_stands_between_those_under_it_and_what_is_decided_above_it() -> None:
    known = {one.controller: one for one in knowledge(split(TWO_CELLS))}
    assert known["line"].talks_to == (
        *("conveyors", "cell_a", "robot_a", "machine_a", "cell_b", "robot_b", "machine_b"),
    )
    assert known["cell_a"].coordinates == ("put_a", "taken_a")
    assert known["cell_a"].relays == ("load_a", "fetched_a", "unload_a", "placed_a")
    assert known["robot_a"].talks_to == ("cell_a", "line")
    assert known["robot_a"].relays == ()


def test_layers_are_proved_and_required() -> None:
    decomposition = split(TWO_CELLS)
    proof = prove(decomposition)
    assert proof.holds
    names = {verdict.name for verdict in proof.verdicts}
    required = {name for name in required_verdicts(decomposition) if name.startswith("o8")}
    assert required == {"o8", "o8-apart", *(f"o8.{row.name}" for row in decomposition.table)}
    assert required <= names
    assert not any(verdict.name.startswith("o8") for verdict in prove(split(catalogue_net("one_robot"))).verdicts)


@pytest.mark.parametrize("at", ["cell_a", "cell_b", "robot_a", "nobody"])
def test_a_row_that_another_coordinator_would_decide_is_refuted(at: str) -> None:
    decomposition = split(TWO_CELLS)
    rows = tuple(replace(row, at=at) if row.name == "load_a" else row for row in decomposition.coordinated)
    refuted = [v for v in prove(replace(decomposition, coordinated=rows)).verdicts if not v.holds]
    assert [v.name for v in refuted] == ["o8", "o8.load_a", "o8-apart"]  # the line decides what it conflicts with
    votes = refuted[1]
    assert votes.subjects == ("load_a",)
    assert votes.witness is not None
    assert votes.witness.note == f"the votes of all parts: 0, the vote at '{at}': 1"


def test_a_part_that_nobody_has_gives_no_vote_in_layers_either() -> None:
    decomposition = split(TWO_CELLS)
    rows = tuple(
        replace(row, parts=(*row.parts, Part("robot_a", "nothing"))) if row.name == "put_a" else row
        for row in decomposition.coordinated
    )
    refuted = {v.name for v in prove(replace(decomposition, coordinated=rows)).verdicts if not v.holds}
    assert {"eq7.put_a", "o3.put_a"} <= refuted


def test_a_row_decided_too_high_up_and_a_group_in_another_layer_are_refuted() -> None:
    decomposition = split(TWO_CELLS)
    rows = tuple(replace(row, at=None) if row.name == "put_a" else row for row in decomposition.coordinated)
    groups = tuple(
        replace(group, at="cell_a") if group.name == "conflict-1" else group for group in decomposition.groups
    )
    own = tuple(replace(group, at="cell_a") if group.controller else group for group in decomposition.groups)
    changed = [replace(decomposition, groups=its) for its in (groups, own)]
    for edited in (replace(decomposition, coordinated=rows), *changed):
        assert [verdict.name for verdict in prove(edited).verdicts if not verdict.holds] == ["o8"]


def test_a_row_that_stands_twice_in_layers_is_refuted() -> None:
    decomposition = split(TWO_CELLS)
    twice = replace(decomposition, coordinated=(*decomposition.coordinated, decomposition.coordinated[0]))
    assert "o8" in {verdict.name for verdict in prove(twice).verdicts if not verdict.holds}


@given(owned_nets(), st.data())
@examples(13)
def test_every_net_in_layers_is_proved_and_joined_back(net: Net, data: st.DataObject) -> None:
    names = [controller.name for controller in net.controllers]
    under = {name: data.draw(st.sampled_from([None, *names[:i]])) for i, name in enumerate(names)}
    net = layered(net, {name: above for name, above in under.items() if above})
    try:
        decomposition = split(net)
    except InputError:
        return
    flat = split(layered(net, {}))
    bare = [replace(row, at=None) for row in decomposition.coordinated]
    assert tuple(bare) == flat.coordinated
    assert decomposition.subnets == flat.subnets
    assert prove(decomposition).holds
    assert join(decomposition).controllers == net.controllers


def test_layers_are_written_and_read_in_every_form() -> None:
    assert parse_net(format_net(TWO_CELLS)) == TWO_CELLS
    assert net_from_json(net_to_json(TWO_CELLS)) == TWO_CELLS
    assert net_digest(layered(TWO_CELLS, {})) != net_digest(TWO_CELLS)
    bundle = Bundle(split(TWO_CELLS), ())
    assert Bundle.from_bytes(bundle.to_bytes()).decomposition == bundle.decomposition


CONTROLLERS = "firable: 1\ncell: n\ncontrollers:\n"


@pytest.mark.parametrize(
    ("text", "code", "line"),
    [
        ("  a:\n    under: c\n", "F2005", 5),
        ("  a:\n    coordinator: true\n    under: b\n  b:\n", "F2027", 6),
        ("  a:\n    under: b\n  b:\n    under: a\n", "F2027", 5),
        ("  a:\n    under: a\n", "F2027", 5),
    ],
)
def test_controllers_that_are_no_tree_are_refused(text: str, code: str, line: int) -> None:
    with pytest.raises(InputError) as refusal:
        parse_net(CONTROLLERS + text)
    first = refusal.value.diagnostics[0]
    assert (first.code, first.span and first.span.line, bool(first.hint)) == (code, line, True)


def test_what_stands_above_a_cycle_is_not_called_one() -> None:
    with pytest.raises(InputError) as refusal:
        parse_net(CONTROLLERS + "  a:\n    under: b\n  b:\n    under: c\n  c:\n    under: b\n")
    assert [problem.subject[1] for problem in refusal.value.diagnostics] == ["b", "c"]


def test_controllers_without_a_coordinator_stand_under_the_one_of_the_whole_net() -> None:
    layers = Layers(three_deep())
    assert layers.root == COORDINATOR
    assert layers.up("m1") == ("m1", "c1", "line1", COORDINATOR)
    assert list(layers.coordinators()) == [COORDINATOR, "line1", "line2", "c1"]
    assert not Layers(catalogue_net("one_robot")).several


def test_arbiters_over_layers_decide_as_in_one_layer() -> None:
    net = replace(TWO_CELLS, arbiters=(Arbiter("robot", ("unload_a", "load_a")),))
    decomposition = split(net)
    group = next(group for group in decomposition.groups if group.name == "robot")
    assert (group.sequence, group.at, group.controller) == (("unload_a", "load_a"), None, None)
    assert prove(decomposition).holds


def test_a_run_of_layers_says_what_each_has_decided(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net = layered(catalogue_net("one_robot"), {"mc": "robot"})
    assert {row.at for row in split(net).table} == {None, "robot"}
    path = tmp_path / "layered.firable.yaml"
    path.write_text(format_net(net), encoding="utf-8")
    bundle = str(tmp_path / "layered.bundle")
    assert main(["bundle", str(path), "-o", bundle]) == 0
    capsys.readouterr()
    assert main(["run", bundle, "--plant", "catalogue:one_robot", "--workpieces", "3"]) == 0
    said = capsys.readouterr()
    assert not said.err
    assert "  decided: 21 by system, 6 by robot" in said.out
    assert "3 workpieces carried through" in said.out


def test_a_bundle_of_layers_without_their_proof_may_not_run() -> None:
    bundle = make_bundle(check(layered(catalogue_net("one_robot"), {"mc": "robot"})))
    without = replace(bundle, verdicts=tuple(verdict for verdict in bundle.verdicts if verdict.name != "o8"))
    assert not unproved(bundle)
    assert [problem.message for problem in unproved(without)] == ["there is no verdict on 'o8'"]
