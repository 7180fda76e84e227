"""A net that breaks a rule cannot be built, whoever builds it: the rules that a text never breaks, too."""

from collections.abc import Callable

import pytest

from firable.nets.diagnostics import InputError
from firable.nets.formula import Firable, Holds
from firable.nets.net import (
    Arbiter,
    Command,
    Controller,
    ExternalGate,
    Net,
    Place,
    Property,
    PropertyKind,
    Signal,
    SignalKind,
    Transition,
)
from firable.nets.well_formed import problems

A = Controller("a")
SEND = Command("M", "GO")
DONE = Signal("done", kind=SignalKind.COMPLETION)


GATED = Transition("t", external=(ExternalGate("doen"),))


@pytest.mark.parametrize(
    ("net", "code", "subject", "hint"),
    [
        (
            lambda: Net("n", transitions=(GATED,), signals=(Signal("done"),)),
            *("F2003", ("transitions", "t", "if", "doen"), "did you mean 'done'?"),
        ),
        (
            lambda: Net("n", (Place("p", command=SEND, completion="doen"),), signals=(DONE,)),
            *("F2003", ("places", "p", "until"), "did you mean 'done'?"),
        ),
        (
            lambda: Net("n", (Place("b.p", "b"),), controllers=(Controller("bb"),)),
            *("F2005", ("places", "b.p", "owner"), "did you mean 'bb'?"),
        ),
        (
            lambda: Net("n", signals=(Signal("b.s", "b"),), controllers=(A,)),
            *("F2005", ("signals", "b.s", "owner"), "declare it"),
        ),
        (lambda: Net("n", (Place("p", "a"),), controllers=(A,)), "F2019", ("places", "p", "owner"), "name it 'a.p'"),
        (lambda: Net("n", (Place("a.", "a"),), controllers=(A,)), "F2019", ("places", "a.", "owner"), "name it"),
        (
            lambda: Net("n", signals=(Signal("b.s", "a"),), controllers=(A,)),
            *("F2019", ("signals", "b.s", "owner"), "name it 'a.b.s'"),
        ),
    ],
)
def test_the_broken_rule_is_named_with_its_subject(
    net: Callable[[], Net], code: str, subject: tuple[str, ...], hint: str
) -> None:
    with pytest.raises(InputError) as refusal:
        net()
    (problem,) = refusal.value.diagnostics
    assert (problem.code, problem.subject) == (code, subject)
    assert hint in problem.hint


LONG = "long" * 100_000
UNKNOWN: dict[str, Callable[[], Net]] = {
    "place": lambda: Net("n", transitions=(Transition("t", (LONG,)),)),
    "completion": lambda: Net("n", (Place("p", command=SEND, completion=LONG),)),
    "internal gate": lambda: Net("n", transitions=(Transition("t", permissive=(LONG,)),)),
    "external gate": lambda: Net("n", transitions=(Transition("t", external=(ExternalGate(LONG),)),)),
    "transition": lambda: Net("n", arbiters=(Arbiter("a", (LONG, LONG + "er")),)),
    "place of a formula": lambda: Net("n", properties=(Property("p", PropertyKind.NEVER, Holds(LONG)),)),
    "transition of a formula": lambda: Net("n", properties=(Property("p", PropertyKind.NEVER, Firable(LONG)),)),
    "transition for a place": lambda: Net(
        "n", transitions=(Transition(LONG),), properties=(Property("p", PropertyKind.NEVER, Holds(LONG)),)
    ),
    "place for a transition": lambda: Net(
        "n", (Place(LONG),), properties=(Property("p", PropertyKind.NEVER, Firable(LONG)),)
    ),
    "owner": lambda: Net("n", (Place("p", LONG),), controllers=(A,)),
    "controller above": lambda: Net("n", controllers=(Controller("b", under=LONG),)),
}


@pytest.mark.parametrize("kind", UNKNOWN)
def test_a_name_that_nothing_has_is_told_shortened(kind: str) -> None:
    with pytest.raises(InputError) as refusal:
        UNKNOWN[kind]()
    problem = refusal.value.diagnostics[0]
    assert len(problem.message) < 200
    assert "'longlong" in problem.message


def test_a_completion_that_gates_nothing_is_the_fault_of_a_program() -> None:
    with pytest.raises(ValueError, match="without the gate 'done'"):
        Net("n", (Place("p", command=SEND, completion="done"),), (Transition("t", ("p",)),), (DONE,))


@pytest.mark.parametrize(
    "gated", [Transition("t", ("p",), permissive=("s",)), Transition("t", ("p",), inhibitive=("s",))]
)
def test_a_signal_as_an_internal_gate_is_the_fault_of_a_program(gated: Transition) -> None:
    with pytest.raises(ValueError, match="its gate is external"):
        Net("n", (Place("p"),), (gated,), (Signal("s"),))


def test_a_net_without_a_broken_rule_has_no_problems() -> None:
    assert list(problems(Net("n", (Place("a.p", "a"),), (Transition("t", ("a.p",)),), controllers=(A,)))) == []
