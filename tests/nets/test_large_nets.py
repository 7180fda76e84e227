"""Large nets are read, printed and refused in time near-linear in their size.

No test here looks at a clock. The sizes are such that a method which compares everything with everything would take
minutes, or more memory than the machine has.
"""

import pytest

from firable.nets.catalogue import family_net
from firable.nets.diagnostics import InputError
from firable.nets.net import Net, Place, Transition
from firable.nets.pnml import parse_pnml, write_pnml
from firable.nets.printing import format_net
from firable.nets.text import parse_net

N_PLACES = 5_000
N_TRANSITIONS = 15_000


def wide_net() -> Net:
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(N_PLACES))
    transitions = tuple(
        Transition(f"t{t}", (f"p{t % N_PLACES}",), (f"p{(t % N_PLACES + 1 + t // N_PLACES) % N_PLACES}",))
        for t in range(N_TRANSITIONS)
    )
    return Net("wide", places, transitions)


def test_a_wide_net_goes_through_both_formats() -> None:
    net = wide_net()
    assert parse_net(format_net(net)) == net
    back = parse_pnml(write_pnml(net)[0]).net
    assert (back.places, back.transitions) == (net.places, net.transitions)


def test_a_net_of_many_controllers_is_printed() -> None:
    net = family_net("machines-10000")
    text = format_net(net)
    assert text.count("send:") == len(net.controllers) == 10_000


def test_all_wrong_names_of_a_large_net_are_reported() -> None:
    net = wide_net()
    wrong = tuple(Transition(t.name, (*t.inputs, f"{t.outputs[0]}x"), t.outputs) for t in net.transitions)
    with pytest.raises(InputError) as refusal:
        Net("wrong", net.places, wrong)
    assert {problem.code for problem in refusal.value.diagnostics} == {"F2002"}
    assert "did you mean 'p1'?" in refusal.value.diagnostics[0].hint
