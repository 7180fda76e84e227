"""Several names, or a condition, written as one name: the hint says the same in the format, and never the opposite."""

from __future__ import annotations

from itertools import product

import pytest

from firable.nets.diagnostics import InputError, did_you_mean
from firable.nets.formula import And, Formula, Holds, Not, Or, format_formula
from firable.nets.text import parse_net
from firable.nets.written_as_one import written_as_one

CELL = """firable: 1
cell: demo
controllers:
  a:
    start: {start}
    inputs: {inputs}
    places: {{free: , busy: , other: }}
transitions:
  go: {{from: {source}, to: a.busy, {gate}}}
  back: {{from: a.busy, to: a.free}}
arbiters: {{one: {{among: {among}}}}}
"""
WRITTEN = {
    "start": "free",
    "inputs": "[s, t]",
    "source": "a.free",
    "gate": "if: a.s",
    "among": "[go, back]",
}


def hints(**written: str) -> list[str]:
    """The hints on a cell in which one thing is written otherwise."""
    with pytest.raises(InputError) as refused:
        parse_net(CELL.format(**{**WRITTEN, **written}))
    return [problem.hint for problem in refused.value.diagnostics]


def test_the_cell_of_these_tests_is_well_formed_as_it_stands() -> None:
    assert parse_net(CELL.format(**WRITTEN)).name == "demo"


@pytest.mark.parametrize(
    ("gate", "meant"),
    [
        ("if: not a.s", "unless: a.s"),
        ("if: NOT a.s", "unless: a.s"),
        ("if: not(a.s)", "unless: a.s"),
        ("if: not s", "unless: a.s"),
        ('if: "!a.s"', "unless: a.s"),
        ("if: ~a.s", "unless: a.s"),
        ("if: -a.s", "unless: a.s"),
        ("if: ¬a.s", "unless: a.s"),
        ("if: a.t ∧ ¬a.s", "if: a.t, unless: a.s"),
        ("if: ¬(a.s ∨ a.t)", "unless: [a.s, a.t]"),
        ("if: /s", "unless: a.s"),
        ("if: [a.t, not a.s]", "unless: a.s"),
        ("if: a.s = 0", "unless: a.s"),
        ("if: a.s=0", "unless: a.s"),
        ("if: a.s != 1", "unless: a.s"),
        ("if: a.s is false", "unless: a.s"),
        ("if: a.s is not off", "if: a.s"),
        ("if: a.s == 1", "if: a.s"),
        ("if: not a.s = 0", "if: a.s"),
        ("unless: a.s = 1", "unless: a.s"),
        ("unless: a.s == 0", "if: a.s"),
        ("unless: not a.s", "if: a.s"),
        ("if: a.s and a.t", "if: [a.s, a.t]"),
        ("if: a.s && a.t", "if: [a.s, a.t]"),
        ("if: a.s a.t", "if: [a.s, a.t]"),
        ('if: "a.s, a.t"', "if: [a.s, a.t]"),
        ("if: a.s and not a.t", "if: a.s, unless: a.t"),
        ("if: not (a.s or a.t)", "unless: [a.s, a.t]"),
        ("unless: a.s or a.t", "unless: [a.s, a.t]"),
        ('unless: "a.s, a.t"', "unless: [a.s, a.t]"),
    ],
)
def test_a_condition_is_told_as_gates(gate: str, meant: str) -> None:
    assert hints(gate=gate) == [f"a gate is one name, and no condition: write `{meant}`"]


@pytest.mark.parametrize(
    ("gate", "meant"),
    [
        ("if: a.s or a.t", "`if: a.s`, one with `if: a.t`"),
        ("if: a.s || a.t", "`if: a.s`, one with `if: a.t`"),
        ("unless: a.s and a.t", "`unless: a.s`, one with `unless: a.t`"),
        ("if: a.free and (a.s or not a.t)", "`if: [a.free, a.s]`, one with `if: a.free, unless: a.t`"),
    ],
)
def test_what_may_be_in_several_ways_is_told_as_several_transitions(gate: str, meant: str) -> None:
    assert hints(gate=gate) == [f"all gates of a transition must be open: write one transition with {meant}"]


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ({"source": '"a.free, a.other"'}, "from: [a.free, a.other]"),
        ({"source": "a.free and a.other"}, "from: [a.free, a.other]"),
        ({"source": "a.free a.other"}, "from: [a.free, a.other]"),
        ({"start": "free, other"}, "start: [free, other]"),
        ({"start": "free other"}, "start: [free, other]"),
        ({"inputs": "s, t", "gate": "number: 1"}, "inputs: [s, t]"),
    ],
)
def test_names_with_commas_between_them_are_told_as_a_list(written: dict[str, str], meant: str) -> None:
    assert hints(**written) == [f"a list stands in brackets: write `{meant}`"]


@pytest.mark.parametrize("text", ["transitions: {go: {if: !a.s}}", "transitions:\n  go:\n    if: !a.s"])
def test_an_exclamation_mark_is_sent_to_unless(text: str) -> None:
    with pytest.raises(InputError, match="where a gate was to be negated, write `unless` for `if`"):
        parse_net(f"firable: 1\ncell: demo\n{text}\n")


def test_transitions_that_compete_are_told_as_a_list() -> None:
    assert "a list stands in brackets: write `among: [go, back]`" in hints(among='"go, back"')


@pytest.mark.parametrize("source", ["not a.free", "a.free or a.other"])
def test_an_arc_with_a_condition_is_sent_to_the_gates(source: str) -> None:
    (hint,) = hints(source=source)
    assert hint.startswith("an arc has no condition, gates have: write `if` or `unless`")


@pytest.mark.parametrize(
    "gate",
    [
        "if: no a.s",
        "if: a.s xor",
        "if: /part/there",
        "if: -a.tt",
        "if: –a.s",
        "if: ^a.s",
        "if: not_a.s",
        "if: a.not_s",
        "if: not.a.s",
        "if: a.s_n",
        "if: a.s_not",
        "if: a.s.not",
        "if: a.s'",
        "if: a.s:0",
        "if: a.s=low?",
    ],
)
def test_what_is_not_understood_gets_no_name_that_may_be_its_opposite(gate: str) -> None:
    assert hints(gate=gate) == ["declare it first, or correct the name"]


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("cell.unlocked", "cell.locked"),
        ("cell.locked", "cell.unlocked"),
        ("camera.nok", "camera.ok"),
        ("cell.no_part_there", "cell.part_there"),
        ("not_cell.part_there", "cell.part_there"),
        ("unlocked", "cell.locked"),
        ("cell.estop_n", "cell.estop"),
        ("cell.estop", "cell.estop_n"),
    ],
)
def test_the_opposite_of_a_name_is_no_slip_of_it(name: str, known: str) -> None:
    assert did_you_mean(name, [known]) == ""


def test_a_name_that_is_one_letter_longer_is_still_meant() -> None:
    assert did_you_mean("camera.okk", ["camera.ok"]) == "did you mean 'camera.ok'? "


def formulas(depth: int) -> list[Formula]:
    """All formulas of two names up to a depth, those that say nothing by themselves included."""
    names: list[Formula] = [Holds("p"), Holds("q")]
    if depth == 0:
        return names
    inner = formulas(depth - 1)
    return [
        *names,
        *map(Not, inner),
        *(join(pair) for join in (And, Or) for pair in product(inner, repeat=2)),
    ]


def holds(formula: Formula, marked: set[str]) -> bool:
    """Whether a formula of names holds."""
    match formula:
        case Holds(name):
            return name in marked
        case Not(operand):
            return not holds(operand, marked)
        case And(operands):
            return all(holds(one, marked) for one in operands)
        case Or(operands):
            return any(holds(one, marked) for one in operands)
        case _:
            raise AssertionError(formula)


def is_open(way: str, marked: set[str]) -> bool:
    """Whether the gates of a hint are open, read from its text."""
    key, is_so = "", True
    for word in way.replace("[", " ").replace("]", " ").replace(",", " ").split():
        if word in {"if:", "unless:"}:
            key = word
        else:
            is_so = is_so and (word in marked) is (key == "if:")
    return is_so


def test_what_a_hint_says_is_what_was_written() -> None:
    said = 0
    for formula, key in product(formulas(2), ("if", "unless")):
        hint = written_as_one(format_formula(formula), ["p", "q"], key)
        if "`" not in hint:
            continue
        said += 1
        ways = hint.split("`")[1::2]
        for marked in (set[str](), {"p"}, {"q"}, {"p", "q"}):
            wanted = holds(formula, marked) is (key == "if")
            assert any(is_open(way, marked) for way in ways) is wanted, (format_formula(formula), key, hint)
    assert said > 300
