"""What is read off the net needs no claim: races in some order, and what fires for ever in the arbitrated run."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import pytest
from support.evidence_examples import ENDING, LOOP, net

from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.meaning import suffices
from firable.analysis.evidence.read_off import eager_cycle, read_off
from firable.nets.formula import Firable
from firable.nets.net import Arbiter, ArbitrationRule, ExternalGate, Net, Place, Signal, Transition, holding
from firable.nets.text import parse_net
from firable.semantics.trace import Discipline


def racing(*closed: str, rivals: Iterable[str] = (), apart: Iterable[str] = ()) -> Net:
    """Of each pair of letters the first closes a gate of the second; of those apart no valuation opens two."""
    letters, apart = sorted(set("".join(closed))), list(apart)
    transitions = [
        Transition(
            name,
            (name.upper(), *(("SHARED",) if name in rivals else ())),
            permissive=tuple(pair[0].upper() for pair in closed if pair[1] == name),
            external=(ExternalGate("open", wanted=name == apart[0]),) if name in apart else (),
        )
        for name in letters
    ]
    places = tuple(Place(name, marked=True) for name in (*map(str.upper, letters), "SHARED"))
    return Net("racing", places, tuple(transitions), (Signal("open"),))


@pytest.mark.parametrize(
    ("of", "ordered"),
    [
        (racing("tu"), True),
        (racing("tu", "uv"), True),
        (racing("tu", "tv", "uw", "vw"), True),
        (racing("tu", "ut"), False),
        (racing("tu", "uv", "vt"), False),
        (racing("st", "tu", "ut"), False),
        (racing("tu", "ut", "us"), False),
        (racing("st", "tu", "us", "vw"), False),
        (racing("tu", "ut", rivals="tu"), True),  # which never fire together
        (racing("tu", "ut", rivals="t"), False),
        (racing("tu", "ut", apart="tu"), True),
        (racing("tu", "ut", apart="t"), False),
    ],
)
def test_steps_have_an_order_where_the_races_in_them_have_one(of: Net, ordered: bool) -> None:
    name = "steps-serialisable"
    assert suffices(of, Discipline.STEP, name, proved=True, claims=[], query=None) is ordered
    assert not suffices(of, Discipline.STEP, name, proved=False, claims=[], query=None)
    assert read_off(of, Discipline.INTERLEAVING, name) is None


CELL = """\
firable: 1
cell: c
controllers:
  robot:
    start: [free, keep, before]
    places:
      free:
      keep:
      before:
      after:
      go: {send: {machine: R, command: MOVE}, until: there, within: 5s}
transitions:
  start: {from: robot.free, to: robot.go}
  end: {from: robot.go, to: robot.free}
  again: {from: robot.go_fault, to: robot.go}
  kept: {from: robot.free, unless: robot.keep}
  once: {from: robot.before, to: robot.after}
  held: {from: robot.after, unless: robot.keep}
"""


def test_what_waits_until_a_time_is_over_need_not_fire_for_ever_and_what_is_held_up_starves() -> None:
    of = parse_net(CELL)
    assert eager_cycle(of) == frozenset({"start", "end", "again", "robot.go_timeout"})
    asked = partial(suffices, of, Discipline.INTERLEAVING, "starvation", query=None)
    assert not asked(proved=True, claims=[])
    stopped = [Claim(ClaimKind.LOST, Firable(name)) for name in ("kept", "once", "held")]
    assert asked(proved=True, claims=stopped)
    assert not asked(proved=True, claims=stopped[:2])
    assert not asked(proved=False, claims=[Claim(ClaimKind.ALWAYS_POSSIBLE, Firable("again"))])
    assert asked(proved=False, claims=[Claim(ClaimKind.ALWAYS_POSSIBLE, Firable("kept"))])


def test_who_reads_what_comes_late_is_late_and_who_may_fire_before_the_time_is_over_is_not() -> None:
    of, before = parse_net(CELL), ExternalGate("robot.go_overdue", wanted=False)
    early = tuple(replace(t, external=(before,)) if t.name in {"start", "kept"} else t for t in of.transitions)
    asking = Transition("asking", ("robot.keep",), permissive=("robot.go_fault",))
    late = {"again", "robot.go_timeout", "asking"}
    assert eager_cycle(replace(of, transitions=(*early, asking))) == frozenset({"start", "end", *late})


def test_in_rotation_each_fires_for_ever_and_by_priority_the_first() -> None:
    of = net("taking turns", "a", ("a", "b"), ("a", "c"), ("b", "a"), ("c", "a"))
    for by, fired in ((ArbitrationRule.ROTATION, {"t0", "t1", "t2", "t3"}), (ArbitrationRule.PRIORITY, {"t0", "t2"})):
        assert eager_cycle(replace(of, arbiters=(Arbiter("first", ("t0", "t1"), by),))) == frozenset(fired)


def test_in_an_arbitrated_run_that_ends_nothing_fires_for_ever() -> None:
    assert eager_cycle(ENDING) == frozenset()
    assert suffices(ENDING, Discipline.INTERLEAVING, "starvation", True, [Claim(ClaimKind.NEVER, Firable("end"))], None)
    assert not suffices(ENDING, Discipline.INTERLEAVING, "starvation", True, [], None)


def test_what_is_never_opened_does_not_fire_in_the_arbitrated_run() -> None:
    both = (ExternalGate("s", wanted=True), ExternalGate("s", wanted=False))
    shut = Transition("shut", ("z",), external=both)
    of = replace(LOOP, transitions=(*LOOP.transitions, shut), signals=(Signal("s"),), places=holding(LOOP.places, 5))
    assert eager_cycle(of) == frozenset({"t0", "t1"})
