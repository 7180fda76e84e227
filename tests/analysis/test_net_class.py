"""The class of a net: each class has a net inside and one just outside."""

from __future__ import annotations

import networkx as nx
import pytest
from hypothesis import given
from support.dense_nets import dense_nets
from support.examples import examples
from support.reference import load_net

from firable.analysis.structure.net_class import net_class
from firable.nets.net import ExternalGate, Net, Place, Signal, Transition


def built(*transitions: tuple[str, str]) -> Net:
    """Transitions as (inputs, outputs), one letter for each place."""
    names = sorted({letter for pair in transitions for letter in "".join(pair)})
    return Net(
        "n",
        tuple(Place(name) for name in names),
        tuple(Transition(f"t{i}", tuple(a), tuple(b)) for i, (a, b) in enumerate(transitions)),
    )


@pytest.mark.parametrize(
    ("net", "name"),
    [
        (built(("p", "q"), ("q", "p")), "state machine and marked graph"),
        (built(("p", "q"), ("p", "q"), ("q", "p")), "state machine"),
        (built(("p", "qr"), ("qr", "p")), "marked graph"),
        (built(("p", "qr"), ("p", "qr"), ("qr", "p")), "free choice"),
        (built(("pq", "r"), ("pq", "r"), ("r", "pq")), "extended free choice"),
        (built(("pq", "r"), ("p", "r"), ("r", "pq")), "asymmetric choice"),
        (built(("pq", "r"), ("p", "r"), ("q", "r"), ("r", "pq")), "general"),
    ],
)
def test_each_class_is_recognised(net: Net, name: str) -> None:
    assert net_class(net, contact_free=True).name == name
    assert net_class(net, contact_free=True).outside == ()


@examples(100)
@given(dense_nets())
def test_each_class_is_contained_in_the_wider_ones(net: Net) -> None:
    found = net_class(net)
    assert found.free_choice or not (found.state_machine or found.marked_graph)
    assert found.extended_free_choice or not found.free_choice
    assert found.asymmetric_choice or not found.extended_free_choice
    assert found.connected or not found.strongly_connected


def test_gates_contact_and_self_loops_keep_the_theorems_away() -> None:
    places, signals = (Place("p"), Place("q")), (Signal("s"),)
    bare = net_class(Net("n", places, (Transition("t", ("p",), ("q",)),)), contact_free=True)
    assert bare.outside == ()
    for transition in (
        Transition("t", ("p",), ("q",), permissive=("q",)),
        Transition("t", ("p",), ("q",), inhibitive=("p",)),
        Transition("t", ("p",), ("q",), external=(ExternalGate("s"),)),
        Transition("t", ("p",), ("p",)),
    ):
        assert len(net_class(Net("n", places, (transition,), signals), contact_free=True).outside) == 1
    assert len(net_class(Net("n", places), contact_free=False).outside) == 1
    assert len(net_class(Net("n", places)).outside) == 1


def test_the_cell_is_strongly_connected_and_of_asymmetric_choice() -> None:
    found = net_class(load_net("cell1"), contact_free=True)
    assert found.strongly_connected
    assert found.name == "asymmetric choice"  # the robot is shared by G2 and G6, each with resources of its own
    assert found.outside == ("it has external gates, on which choices depend",)


def test_gates_are_no_arcs_of_the_graph() -> None:
    net = Net("n", (Place("p"), Place("q")), (Transition("t", ("p",), permissive=("q",)),))
    assert not net_class(net).connected
    read = Net("n", (Place("p"), Place("q")), (Transition("t", ("p",), ("q",)),))
    assert net_class(read).connected
    assert not net_class(read).strongly_connected


@examples(50)
@given(dense_nets())
def test_the_graph_of_arcs_is_connected_as_networkx_says(net: Net) -> None:
    graph: nx.DiGraph[str] = nx.DiGraph()
    graph.add_nodes_from(place.name for place in net.places)
    graph.add_nodes_from(transition.name for transition in net.transitions)
    graph.add_edges_from((place, t.name) for t in net.transitions for place in t.inputs)
    graph.add_edges_from((t.name, place) for t in net.transitions for place in t.outputs)
    found = net_class(net)
    assert (found.connected, found.strongly_connected) == (
        nx.is_weakly_connected(graph),
        nx.is_strongly_connected(graph),
    )


def test_the_empty_net_is_connected() -> None:
    assert net_class(Net("empty")).strongly_connected
