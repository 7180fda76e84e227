"""The complement of a place keeps the reachability graph, with one bit of every marking inverted."""

import pytest
from hypothesis import given
from support.dense_nets import dense_nets

from firable.nets.diagnostics import InputError
from firable.nets.formula import Not, parse_formula
from firable.nets.net import Command, Net, Place, Property, PropertyKind, TemporalProperty, Transition
from firable.nets.temporal import Globally, Logic, Next, TemporalAnd
from firable.semantics.algebra import BOOL
from firable.semantics.complement import complement
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in


@given(dense_nets())
def test_the_graph_of_the_complement_is_the_graph_with_one_bit_inverted(net: Net) -> None:
    other = complement(net, "c")
    bit = net.marking(["c"])
    inverted = {
        marking ^ bit: [(label, successor ^ bit) for label, successor in edges]
        for marking, edges in Player(net).reachable().items()
    }
    assert Player(other).reachable() == inverted


@given(dense_nets())
def test_the_complement_of_the_complement_is_the_net(net: Net) -> None:
    twice = complement(complement(net, "c"), "not_c", new_name="c")
    assert Player(twice).reachable() == Player(net).reachable()
    assert twice.places == net.places


def test_a_property_says_of_the_complement_what_it_said_of_the_place() -> None:
    formula = parse_formula("(p -> q) and tokens(p, q) + 1 <= tokens(r, p, p) and not tokens(q, p) < 1")
    places = tuple(map(Place, "pqr"))
    asked = Property("x", PropertyKind.NEVER, formula)
    temporal = TemporalProperty("y", Logic.LTL, Globally(TemporalAnd((formula, Next(Not(formula))))))
    net = Net("n", places, (Transition("t"),), properties=(asked, temporal))
    other = complement(net, "p")
    changed, changed_too = other.properties
    assert isinstance(changed, Property)
    for marking in range(8):
        value = evaluate(BOOL, other, changed.formula, holds_in(marking ^ 1))
        assert value is evaluate(BOOL, net, formula, holds_in(marking))
    new = changed.formula
    assert changed_too.formula == Globally(TemporalAnd((new, Next(Not(new)))))


def test_a_place_that_sends_a_command_has_no_complement() -> None:
    net = Net("n", (Place("p", command=Command("M", "RUN")),), (Transition("t", (), ("p",)),))
    with pytest.raises(InputError, match="F2020"):
        complement(net, "p")


def test_an_unknown_place_has_no_complement() -> None:
    with pytest.raises(InputError, match="F2002"):
        complement(Net("n"), "p")
