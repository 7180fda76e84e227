"""What no promise can hold is named as an assumption (O4)."""

from firable.decompose.proofs.assumptions import Assumption, assumptions
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition


def test_the_sensors_of_the_cell_that_gate_global_transitions_are_assumed_to_hold() -> None:
    assert assumptions(split(catalogue_net("one_robot"))) == (
        Assumption("G1", "conveyor.part_at_entry", wanted=True),
        Assumption("G4", "mc.part_present", wanted=True),
    )


def test_a_gate_of_a_controller_by_itself_and_a_permissive_completion_assume_nothing_and_an_inhibitive_one_does() -> (
    None
):
    drill = Place("a.drill", "a", command=Command("D", "RUN"), completion="a.done")
    places = (Place("a.idle", "a", marked=True), drill, Place("b.p", "b", marked=True))
    done = ExternalGate("a.done")
    transitions = (
        Transition("local", ("a.idle",), ("a.drill",), external=(ExternalGate("a.door"),)),
        Transition("take", ("a.drill", "b.p"), ("a.idle",), external=(done,)),
        Transition("early", ("b.p",), external=(ExternalGate("a.done", wanted=False),)),
    )
    signals = (Signal("a.door", "a"), Signal("a.done", "a", SignalKind.COMPLETION))
    net = Net("n", places, transitions, signals, (Controller("a"), Controller("b")))
    assert assumptions(split(net)) == (Assumption("early", "a.done", wanted=False),)


def test_a_local_transition_that_competes_with_a_global_one_is_decided_later_and_assumes_its_gates() -> None:
    places = (*(Place(f"a.{name}", "a", name == "p") for name in "pqr"), Place("b.s", "b", marked=True))
    transitions = (
        Transition("local", ("a.p",), ("a.r",), external=(ExternalGate("a.door"),)),
        Transition("global", ("a.p", "b.s"), ("a.q",)),
        Transition("alone", ("a.r",), (), external=(ExternalGate("a.door"),)),
    )
    net = Net("n", places, transitions, (Signal("a.door", "a"),), (Controller("a"), Controller("b")))
    decomposition = split(net)
    assert [row.name for row in decomposition.coordinated if not row.is_global] == ["local"]
    assert assumptions(decomposition) == (Assumption("local", "a.door", wanted=True),)
