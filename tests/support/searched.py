"""Hypothesis strategy for goals of a net, and what full exploration says of them, to compare searches with."""

from hypothesis import strategies as st
from support.whole_nets import formulas

from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import Witness
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in


def goals(net: Net) -> st.SearchStrategy[Formula]:
    """State formulas over the places and transitions of a net."""
    return formulas([place.name for place in net.places], [t.name for t in net.transitions])


def distance_to(graph: ReachabilityGraph, goal: Formula) -> int | None:
    """How many firings a nearest marking of the goal is away; None where there is none."""
    found = graph.satisfying(goal)
    nearest = int(found.argmax())
    return len(graph.engine.path_to(nearest)) if found[nearest] else None


def played(net: Net, witness: Witness | None) -> Marking:
    """The marking after a witness, by the reference player; every firing must be allowed, and the end as stated."""
    assert witness is not None
    player, marking = Player(net), net.initial_marking
    for (name,) in witness.firings:
        t = net.transition_index[name]
        assert t in player.may_fire(marking)
        marking = player.fire(marking, [t])
    assert net.names(marking) == witness.marking
    return marking


def satisfies(net: Net, marking: Marking, goal: Formula) -> bool:
    """Whether a marking satisfies a goal, by the reference."""
    return evaluate(BOOL, net, goal, holds_in(marking))
