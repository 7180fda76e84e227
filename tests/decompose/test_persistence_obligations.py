"""Votes that arcs and units settle: obligations that are true, stated anew, and refused in every other form."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import pytest
from hypothesis import given
from support.bundle_mutants import line_mutants, verdict_mutants
from support.examples import examples
from support.free_parts import BY_A_UNIT
from support.owned_nets import owned_nets

from firable.analysis.check import check
from firable.analysis.induction.smt import Answer
from firable.decompose.bundling import make_bundle
from firable.decompose.proofs.families import FAMILIES
from firable.decompose.proofs.family import Task, proved_of
from firable.decompose.proofs.script import Reader
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import Persistence, persistence
from firable.decompose.splitting.votes import FALSIFIERS_MAX, Unit, Vote, units_in_use, votes
from firable.decompose.verification.checked import CheckedVerdict, Examination
from firable.decompose.verification.obligations import check_obligations
from firable.decompose.verification.recut import check_cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import SOLVERS, Answers
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, family_net
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition
from firable.nets.verdict import Status, Verdict, Weight
from firable.semantics.player import Player

FILE = "persistence.smt2"
(FAMILY,) = (family for family in FAMILIES if family.name == "persistence")


def proved(decomposition: Decomposition, cast: Sequence[Vote] | None = None) -> Bundle:
    """A bundle with this family alone."""
    found = FAMILY.prove(Task(decomposition, 10_000, cast))
    return Bundle(decomposition, tuple(found.verdicts), found.files)


def judged(bundle: Bundle, answers: Answers = SOLVERS["z3"]) -> dict[str, CheckedVerdict]:
    """What `firable verify` says of this family; raises `NotShownError`."""
    examination = Examination(bundle)
    check_obligations(examination, check_cut(bundle.decomposition), "it", answers, 10_000, ["persistence"])
    if list(examination.unjudged()):
        raise NotShownError("nobody knows what a verdict is on")
    return examination.checked


@cache
def by_a_unit() -> Bundle:
    return proved(split(BY_A_UNIT))


# --------------------------------------------------------------------------------------------------------------------
# What is claimed, and that it is so


def units_hold_one_token_at_most(net: Net, units: Sequence[Unit]) -> None:
    markings = Player(net).reachable()
    for unit in units:
        among = net.marking(unit)
        assert len(unit) > 1
        assert all((marking & among).bit_count() <= 1 for marking in markings)


@given(owned_nets())
@examples(30)
def test_each_vote_that_arcs_and_units_settle_is_proved_shown_anew_and_true(net: Net) -> None:
    try:
        decomposition = split(net)
    except InputError:
        return
    cast, found = votes(decomposition), persistence(decomposition)
    units = units_in_use(net, cast)
    units_hold_one_token_at_most(net, units)
    bundle = proved(decomposition)
    names = [f"unit.{k + 1}" for k in range(len(units))]
    assert [v.name for v in bundle.verdicts] == [*names, *(f"persistent.{v.part}" for v in cast if v.settled)]
    assert all(v.holds and v.weight is Weight.INFORMATION for v in bundle.verdicts)
    assert all(one.shown for one in judged(bundle).values())
    without_units = Persistence(decomposition, *answered_by_markings(decomposition, cast))
    for vote in cast:
        assert not vote.settled or (found.of(vote.part).holds and without_units.of(vote.part).holds)


def answered_by_markings(
    decomposition: Decomposition, cast: Sequence[Vote]
) -> tuple[tuple[Vote, ...], tuple[Verdict, ...]]:
    """The votes as if there were no unit, so that markings decide all that are accused."""
    bare = tuple(replace(vote, falsifiers=vote.accused, units=()) for vote in cast)
    return bare, persistence(decomposition, cast=bare).verdicts


@pytest.mark.parametrize("name", ["one_robot", "one_robot_timed", "two_cells", "workshop-10", "philosophers-4"])
def test_obligations_of_cells_are_shown_by_cvc5(name: str) -> None:
    net = family_net(name) if "-" in name else catalogue_net(name)
    decomposition = split(net)
    checked = judged(proved(decomposition), SOLVERS["cvc5"])
    settled = [vote for vote in votes(decomposition) if vote.settled]
    assert sum(one.shown for one in checked.values()) == len(settled) + len(units_in_use(net, settled))


def test_a_part_that_nobody_touches_has_an_obligation_too() -> None:
    places = (Place("a.p", "a", marked=True), Place("b.q", "b"))
    net = Net("n", places, (Transition("G", ("a.p",), ("b.q",)),), controllers=(Controller("a"), Controller("b")))
    bundle = proved(split(net))
    assert [v.name for v in bundle.verdicts] == ["persistent.t1-11", "persistent.t2-12"]
    assert all(one.shown for one in judged(bundle).values())


def net_of(marked: str, *transitions: Transition) -> Net:
    names = dict.fromkeys(n for t in transitions for n in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive))
    places = tuple(Place(name, name[0], marked=name in marked.split()) for name in names)
    return Net("n", places, transitions, controllers=(Controller("a"), Controller("b")))


def test_of_two_units_that_exclude_a_transition_the_first_one_counts() -> None:
    net = net_of(
        "a.p a.q a.g a.g2 b.r",
        Transition("both", ("b.r",), ("b.s",), ("a.p", "a.q", "a.g"), ("a.z",)),
        Transition("one", ("b.s",), ("b.r",), ("a.q", "a.g2"), ("a.z",)),
        Transition("m", ("a.p", "a.q"), ("a.x",), ("a.z",)),
        Transition("l", ("a.g",), ("a.h",), ("a.x",)),
        Transition("l2", ("a.g2",), ("a.h2",), ("a.x",)),
    )
    bundle = proved(split(net))
    assert [v.subjects for v in bundle.verdicts if v.name.startswith("unit.")] == [("a.p", "a.x"), ("a.q", "a.x")]
    assert bundle.evidence[FILE].count("(assert (not (and |a.p| |a.x|)))") == 1
    assert bundle.evidence[FILE].count("(assert (not (and |a.q| |a.x|)))") == 1
    assert all(one.shown for one in judged(bundle).values())


def test_a_part_that_needs_a_place_full_and_empty_never_votes_yes_and_has_an_obligation() -> None:
    net = net_of(
        "a.p a.g b.r", Transition("G", ("b.r",), ("a.p", "b.s"), ("a.p", "a.g")), Transition("l", ("a.g",), ("a.h",))
    )
    bundle = proved(split(net))
    assert "persistent.t1-11" in {v.name for v in bundle.verdicts}
    assert all(one.shown for one in judged(bundle).values())


def test_a_part_at_a_place_that_very_many_share_has_no_obligation() -> None:
    net = net_of("a.p", *(Transition(f"t{i}", ("a.p",), (f"b.q{i}",)) for i in range(FALSIFIERS_MAX + 1)))
    bundle = proved(split(net))
    assert len(bundle.verdicts) == FALSIFIERS_MAX + 1  # of the parts at b, each alone at its place
    assert len(judged(bundle)) == FALSIFIERS_MAX + 1


def test_an_open_vote_has_no_obligation_and_its_verdict_is_none_of_the_family() -> None:
    bundle = make_bundle(check(catalogue_net("one_robot")))
    by_markings = [v.name for v in bundle.verdicts if v.evidence == ("persistence.evidence.json",)]
    assert by_markings == ["persistent.t1-21", "persistent.t1-41"]
    assert not any(name in bundle.evidence[FILE] for name in by_markings)
    assert len(proved_of(FAMILY, bundle.verdicts)) == 23


def test_the_text_grows_with_the_cell_and_no_faster() -> None:
    small, large = (proved(split(family_net(f"workshop-{n}"))) for n in (10, 40))
    assert len(large.evidence[FILE]) < 4.4 * len(small.evidence[FILE])


# --------------------------------------------------------------------------------------------------------------------
# What rests on a unit that is none


def forged(unit: Unit) -> tuple[Vote, ...]:
    """The votes on `BY_A_UNIT`, resting on another unit than the right one."""
    return tuple(replace(v, falsifiers=(), units=(unit,)) if v.accused else v for v in votes(split(BY_A_UNIT)))


def test_a_unit_that_firings_do_not_keep_is_refuted_and_no_vote_is_proved_by_it() -> None:
    bundle = proved(split(BY_A_UNIT), forged(("a.i", "a.x")))  # whoever fires `m` need not have waited for `a.i`
    of = {v.name: v for v in bundle.verdicts}
    assert of["unit.1"].status is Status.VIOLATED
    assert of["persistent.t1-11"].status is Status.UNKNOWN
    assert of["persistent.t1-11"].bound == "it rests on 'unit.1', which is not proved"
    said = tuple(replace(by_a_unit().verdicts[i], subjects=v.subjects) for i, v in enumerate(bundle.verdicts))
    said = (replace(said[0], statement=of["unit.1"].statement), *said[1:])
    with pytest.raises(NotShownError, match=r"'unit\.1' is refuted"):
        judged(replace(bundle, verdicts=said))


def test_a_unit_that_m0_does_not_keep_is_refuted() -> None:
    places = tuple(replace(p, marked=p.marked or p.name == "a.x") for p in BY_A_UNIT.places)
    decomposition = split(replace(BY_A_UNIT, places=places))
    (unit,) = units_in_use(BY_A_UNIT, votes(split(BY_A_UNIT)))
    assert unit not in units_in_use(decomposition.net, votes(decomposition))
    bundle = proved(decomposition, forged(unit))
    assert bundle.verdicts[0].status is Status.VIOLATED


def taken_while_it_is_0(kind: SignalKind, *, wanted: bool) -> Net:
    """`G` waits for a signal of `a`, and `l` takes its token of `a` while that signal is 0."""
    command, completion = Command("M", "RUN"), "a.s" if kind is SignalKind.COMPLETION else None
    places = (
        *(Place("a.p", "a", marked=True), Place("a.x", "a")),
        *(Place("a.run", "a", command=command, completion=completion), Place("b.q", "b", marked=True)),
    )
    transitions = (
        Transition("G", ("a.p", "b.q"), external=(ExternalGate("a.s", wanted),)),
        Transition("l", ("a.p",), ("a.x",), external=(ExternalGate("a.s", wanted=False),)),
        Transition("run", ("a.x",), ("a.run",), inhibitive=("a.p",)),
        Transition("ran", ("a.run",), ("a.p",), external=(ExternalGate("a.s"),)),
    )
    return Net("n", places, transitions, (Signal("a.s", "a", kind),), (Controller("a"), Controller("b")))


@pytest.mark.parametrize(
    ("kind", "wanted", "status"),
    [
        (SignalKind.COMPLETION, True, Status.PROVED),
        (SignalKind.COMPLETION, False, Status.VIOLATED),
        (SignalKind.SENSOR, True, Status.VIOLATED),
    ],
)
def test_only_what_a_command_alone_clears_and_a_part_awaits_keeps_off_who_waits_for_its_end(
    kind: SignalKind, wanted: bool, status: Status
) -> None:
    decomposition = split(taken_while_it_is_0(kind, wanted=wanted))
    cast = votes(decomposition)
    assert {vote.part: vote.settled for vote in cast}["t1-11"] is (status is Status.PROVED)
    claimed = tuple(replace(vote, falsifiers=()) for vote in cast)
    assert {v.name: v.status for v in proved(decomposition, claimed).verdicts}["persistent.t1-11"] is status


def test_what_rests_on_a_unit_that_the_solver_gave_up_is_only_claimed() -> None:
    def giving_up(text: str, timeout_ms: int) -> tuple[str, ...]:
        said = SOLVERS["z3"](text, timeout_ms)
        return tuple("unknown" if name == "unit.1" else answer for name, answer in zip(("", *said), said, strict=False))

    judging = judged(by_a_unit(), giving_up)
    assert {name for name, one in judging.items() if not one.shown} == {"unit.1", "persistent.t1-11"}


def test_no_bundle_is_made_where_an_obligation_on_a_vote_was_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = Reader.answer
    monkeypatch.setattr(
        Reader, "answer", lambda self, text: Answer.UNKNOWN if '(echo "unit.1")' in text else answer(self, text)
    )
    with pytest.raises(InputError, match=r"F3004.*'unit.1' is unknown, not proved"):
        make_bundle(check(BY_A_UNIT))


# --------------------------------------------------------------------------------------------------------------------
# Mutants


def with_units(*units: Unit) -> Bundle:
    """The right bundle with other units listed, and an obligation on each."""
    first, *others = by_a_unit().verdicts
    listed = (replace(first, name=f"unit.{k}", subjects=unit) for k, unit in enumerate(units, 1))
    return replace(by_a_unit(), verdicts=(*listed, *others))


RIGHT: Unit = ("a.i", "a.j", "a.w", "a.x")


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ((RIGHT, ("b.p", "b.q")), "no vote needs 'unit.2'"),
        ((("a.g", "a.h"), RIGHT), "no vote needs 'unit.1'"),
        ((RIGHT, RIGHT), "wrong order"),
        ((RIGHT, ("a.g", "a.h")), "wrong order"),
        ((RIGHT[::-1],), "wrong order"),
        (((*RIGHT, "a.x"),), "wrong order"),
        ((("a.i",),), "no unit"),
        ((("a.i", "nowhere"),), "places that the net has not"),
        (((),), "no unit"),
        ((), "has 'unit.1' where"),
    ],
    ids=repr,
)
def test_units_of_no_use_or_of_another_form_are_refused(units: tuple[Unit, ...], message: str) -> None:
    with pytest.raises(NotShownError, match=message):
        judged(with_units(*units))


def test_the_right_units_pass() -> None:
    assert with_units(RIGHT) == by_a_unit()
    judged(by_a_unit())


def mutants(bundle: Bundle) -> Iterator[tuple[str, Bundle]]:
    """Every single change of a verdict, of a line of the file, of two blocks of it, or of a word."""
    yield from ((how, make()) for how, make in verdict_mutants(bundle) if not how.startswith("another verdict"))
    text = bundle.evidence[FILE]
    blocks = text.split("\n\n")
    texts = list(line_mutants(text))
    texts += [(f"block {i} deleted", "\n\n".join(blocks[:i] + blocks[i + 1 :])) for i in range(1, len(blocks))]
    for i in range(1, len(blocks) - 1):
        swapped = [*blocks[:i], blocks[i + 1], blocks[i], *blocks[i + 2 :]]
        texts.append((f"block {i} moved", "\n\n".join(swapped)))
    for word, other in (("(and", "(or"), ("(or", "(and"), ("(not |", "(or |"), ("|a.g|", "|a.h|"), ("|a.x|", "|a.w|")):
        at = -1
        while (at := text.find(word, at + 1)) >= 0:
            texts.append((f"{word} at {at}", text[:at] + other + text[at + len(word) :]))
    yield from ((how, replace(bundle, evidence={FILE: new})) for how, new in texts if new != text)


def test_every_single_change_of_the_family_is_refused() -> None:
    bundle = replace(by_a_unit(), evidence={**by_a_unit().evidence, "eq7.smt2": ""})  # a file that a verdict may name
    made = list(mutants(bundle))
    assert len(made) > 250
    assert [how for how, mutant in made if not is_refused(mutant)] == []


def is_refused(bundle: Bundle) -> bool:
    try:
        judged(bundle)
    except NotShownError:
        return True
    return False
