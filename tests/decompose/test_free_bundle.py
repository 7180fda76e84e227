"""A bundle says which parts are free of promise; who says so of another part, or without showing it, is refused."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from support.free_parts import BY_A_UNIT
from support.reference import load_net

from firable.analysis.check import check
from firable.decompose.bundling import make_bundle
from firable.decompose.splitting import cut
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import persistence
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.documents import check_verdicts_on_the_net
from firable.decompose.verification.free_parts import check_free_parts
from firable.decompose.verification.obligations import check_obligations
from firable.decompose.verification.recut import check_cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import SOLVERS, Answers
from firable.nets.bundle import Bundle, read_bundle, write_bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.right_to_run import unproved
from firable.nets.text import parse_net
from firable.nets.verdict import Status, Verdict

Free = tuple[tuple[str, str], ...]


@cache
def cell() -> Bundle:
    return make_bundle(check(catalogue_net("one_robot")))


def saying(free: Free) -> Bundle:
    return replace(cell(), decomposition=replace(cell().decomposition, free=free))


def judged(bundle: Bundle, answers: Answers = SOLVERS["z3"]) -> None:
    """What `firable verify` does of free parts, without the other obligations on the split; raises `NotShownError`."""
    examination, cut = Examination(bundle), check_cut(bundle.decomposition)
    examination.used |= {file for file in bundle.evidence if file.endswith(".smt2")}
    check_obligations(examination, cut, "z3", answers, 10_000, ["persistence"])
    check_verdicts_on_the_net(examination, SOLVERS["z3"], 10_000)
    check_free_parts(examination, cut)


def test_bundle_says_which_parts_are_free_and_shows_it(tmp_path: Path) -> None:
    found = persistence(split(catalogue_net("one_robot")))
    names = {(vote.transition, vote.controller): vote.part for vote in found.votes}
    assert tuple(names[pair] for pair in cell().decomposition.free) == found.free_of_promise
    assert len(cell().decomposition.free) == 15
    write_bundle(tmp_path / "cell.bundle", cell())
    assert read_bundle(tmp_path / "cell.bundle").decomposition == cell().decomposition
    judged(cell())


def test_verdicts_on_the_protocol_of_a_net_are_on_the_one_with_the_free_parts_of_its_bundle() -> None:
    bundle = make_bundle(check(load_net("no_trouble")), protocol=True, faults=True)
    every = tuple((row.name, part.controller) for row in bundle.decomposition.coordinated for part in row.parts)
    assert bundle.decomposition.free == every
    assert "|stands/G/c1|" in bundle.evidence["explored.smt2"]
    assert "|promised/" not in bundle.evidence["explored.smt2"]
    checked = check_bundle(bundle, solver="z3")
    assert all(one.shown for one in checked)
    for free in ((), every[:2]):
        other = replace(bundle, decomposition=replace(bundle.decomposition, free=free))
        with pytest.raises(InputError, match="is not what must be proved of the protocol of this net"):
            check_bundle(other, solver="z3")


def test_a_bundle_that_takes_the_freedom_of_all_parts_away_is_refused() -> None:
    with pytest.raises(InputError, match="is free of promise, and the table does not say so"):
        check_bundle(saying(()))


def others() -> list[tuple[str, str]]:
    """The parts that are not free."""
    rows = cell().decomposition.coordinated
    every = [(row.name, part.controller) for row in rows for part in row.parts]
    return [pair for pair in every if pair not in cell().decomposition.free]


@pytest.mark.parametrize("which", range(9))
def test_each_part_that_may_not_be_free_is_refused_as_free(which: int) -> None:
    rows = cell().decomposition.coordinated
    every = [(row.name, part.controller) for row in rows for part in row.parts]
    bundle = saying(tuple(pair for pair in every if pair in {*cell().decomposition.free, others()[which]}))
    assert len(unproved(bundle)) == 1
    with pytest.raises(NotShownError, match="not free of promise"):
        judged(bundle)


def test_there_are_nine_parts_that_may_not_be_free() -> None:
    assert len(others()) == 9


@pytest.mark.parametrize(
    "change",
    [
        lambda free: (*free, free[0]),
        lambda free: free[::-1],
        lambda free: (*free, ("G1", "nobody")),
        lambda free: (("nothing", "robot"), *free),
    ],
    ids=["twice", "another order", "nobody", "nothing"],
)
def test_free_parts_that_are_no_parts_in_the_order_of_the_table_are_refused(change: Callable[[Free], Free]) -> None:
    bundle = saying(change(cell().decomposition.free))
    assert unproved(bundle)
    with pytest.raises(NotShownError, match="in its order"):
        judged(bundle)


@pytest.mark.parametrize("which", range(15))
def test_a_free_part_that_was_taken_out_is_missed(which: int) -> None:
    free = cell().decomposition.free
    with pytest.raises(NotShownError, match="the table does not say so"):
        judged(saying(free[:which] + free[which + 1 :]))


def changed(name: str, change: Callable[[Verdict], list[Verdict]]) -> Bundle:
    return replace(
        cell(), verdicts=tuple(new for v in cell().verdicts for new in (change(v) if v.name == name else [v]))
    )


@pytest.mark.parametrize("part", ["t0-1", "t2-22", "t3-23"])
def test_free_part_needs_a_verdict_that_its_vote_is_persistent(part: str) -> None:
    name = f"persistent.{part}"
    assert unproved(cell()) == ()
    assert unproved(changed(name, lambda _: []))
    assert unproved(changed(name, lambda v: [replace(v, status=Status.UNKNOWN)]))
    assert unproved(changed(name, lambda v: [v, replace(v, status=Status.VIOLATED)]))


def test_vote_that_arcs_and_units_show_needs_their_evidence() -> None:
    bundle = make_bundle(check(BY_A_UNIT))
    assert bundle.decomposition.free == (("G", "a"), ("G", "b"))
    verdict = next(v for v in bundle.verdicts if v.name == "persistent.t1-11")
    assert verdict.evidence == ("persistence.smt2",)
    assert [v.subjects for v in bundle.verdicts if v.name.startswith("unit.")] == [("a.i", "a.j", "a.w", "a.x")]
    judged(bundle)
    bare = tuple(replace(v, evidence=()) if v is verdict else v for v in bundle.verdicts)
    assert [problem.message for problem in unproved(replace(bundle, verdicts=bare))] == [
        "the vote on 't1-11' is said to be persistent without evidence"
    ]


FALLS = """
firable: 1
cell: falls
controllers:
  sys: {coordinator: true}
  a: {start: [p, r], places: {p: , q: , r: , s: }}
  b: {start: x, places: {x: , y: }}
transitions:
  G: {number: 1, from: [a.p, b.x], to: [a.q, b.y], if: a.r}
  H: {number: 2, from: [a.q, b.y], to: [a.p, b.x]}
  u: {from: a.r, to: a.s}
  v: {from: a.s, to: a.r}
"""
"""By its arcs the part of G at a disturbs nobody, and its vote falls when u fires."""


def test_a_part_that_disturbs_nobody_is_not_free_where_its_vote_is_shown_to_fall() -> None:
    bundle = make_bundle(check(parse_net(FALLS)))
    assert bundle.decomposition.free == (("G", "b"), ("H", "a"), ("H", "b"))
    judged(bundle)
    saying_so = replace(bundle.decomposition, free=(("G", "a"), *bundle.decomposition.free))
    with pytest.raises(NotShownError, match="'t1-11' is not free of promise: it is not shown that its vote is"):
        judged(replace(bundle, decomposition=saying_so))


def test_a_part_is_not_free_where_the_solver_gave_up_that_its_vote_is_persistent() -> None:
    bundle = make_bundle(check(BY_A_UNIT))
    with pytest.raises(NotShownError, match="'t1-11' is not free of promise: it is not shown that its vote is"):
        judged(bundle, lambda *of: tuple("unknown" if one == "unsat" else one for one in SOLVERS["z3"](*of)))


CLASH = """
firable: 1
cell: clash
controllers:
  sys: {coordinator: true}
  a: {start: [p, r], places: {p: , q: , r: , s: }}
  b: {start: [x, wo], places: {x: , y: , z: , w: , wo: }}
transitions:
  G: {number: 1, from: [a.p, b.x], to: [a.q, b.y], if: a.r, unless: b.w}
  H: {number: 2, from: [a.q, b.y], to: [a.p, b.x]}
  u: {from: a.r, to: a.s}
  v: {from: a.s, to: a.r}
  t1-11: {from: b.x, to: b.z, if: b.w}
  M: {from: b.z, to: b.x}
  W1: {from: b.w, to: b.wo, if: b.z}
  W2: {from: b.wo, to: b.w}
"""
"""The vote of G's part at a, t1-11, falls when u fires; that of the transition t1-11 at b, were it one, stands."""


def test_a_transition_with_the_name_of_a_part_lends_its_verdict_to_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    net = parse_net(CLASH)
    with pytest.raises(InputError, match="'t1-11' is also the name of a part of 'G'"):
        split(net)
    monkeypatch.setattr(cut, "_clashes", lambda _: iter(()))
    clashing = split(net)
    found = unproved(Bundle(clashing, ()))
    assert "'t1-11' names two parts" in " ".join(problem.message for problem in found)
    with pytest.raises(NotShownError, match="two parts are named 't1-11'"):
        check_cut(clashing)
    assert not cell().decomposition.doubled
