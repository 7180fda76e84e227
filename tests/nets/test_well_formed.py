"""A net that breaks a rule cannot be built, whoever builds it: the rules that a text never breaks, too."""

from collections.abc import Callable

import pytest

from firable.nets.diagnostics import InputError
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition
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
