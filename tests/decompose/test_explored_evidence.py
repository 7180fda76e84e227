"""The evidence for the verdicts on the protocol of one net: what shows them, and that nothing else is taken for it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import pytest
from support.bundle_mutants import evidence_mutants, line_mutants, net_mutants, verdict_mutants
from support.free_parts import freed
from support.layered_nets import cells_in_a_line
from support.owned_nets import owned_net
from support.remembered import UNORDERED, Answers, answered

from firable.analysis.check import check
from firable.decompose.bundling import make_bundle
from firable.decompose.protocol.building import ProtocolNet, protocol_net
from firable.decompose.protocol.exploring import explore_protocol
from firable.decompose.protocol.inductive_script import INVARIANT, Obligations, Proof, prove_inductively
from firable.decompose.protocol.shown import with_proof
from firable.decompose.protocol.variant import ANY_FAULTS, NO_FAULTS, PROTOCOL, Faults, Variant
from firable.decompose.protocol.wrong import WRONG, WrongProtocol, example
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import freed as freed_as_bundled
from firable.decompose.verification import explored
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.explored import TITLES, check_explored
from firable.decompose.verification.recut import Cut, check_cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import by_cvc5, by_z3
from firable.decompose.verification.voting import Voting
from firable.decompose.verification.voting_obligations import Obligations as StatedAnew
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, family_net
from firable.nets.diagnostics import InputError
from firable.nets.net import Controller, Net, Place, Transition
from firable.nets.text import parse_net
from firable.nets.verdict import Status, Verdict

FAULTS = pytest.mark.parametrize("faults", [NO_FAULTS, ANY_FAULTS], ids=["explored", "faults"])
TIMEOUT_MS = 10_000


def built(net: Net, faults: Faults, variant: Variant = PROTOCOL) -> ProtocolNet:
    return protocol_net(split(net), variant, faults)


def written(protocol: ProtocolNet) -> str:
    of = Obligations(protocol)
    return "".join((of.beginning(), of.starts(), f"\n(assert {INVARIANT})\n", *of.blocks()))


def stated_anew(net: Net, faults: Faults) -> str:
    return StatedAnew(Voting(Cut(net), bool(faults))).text


@cache
def bundled(name: str) -> Bundle:
    return make_bundle(check(example(name)), protocol=True, faults=True)


def of_the_living(name: str) -> Bundle:
    """The bundle without what stands still while somebody is dead, which rests on other evidence."""
    bundle = bundled(name)
    return replace(
        bundle,
        verdicts=tuple(verdict for verdict in bundle.verdicts if not verdict.name.startswith("faults.dead")),
        evidence={
            file: data for file, data in bundle.evidence.items() if not file.startswith(("faults.dead", "dead.smt2"))
        },
    )


# --------------------------------------------------------------------------------------------------------------------
# What is shown


@FAULTS
@pytest.mark.parametrize("name", ["one_robot", "conceptual_one_robot"])
def test_every_verdict_on_the_protocol_of_a_cell_has_evidence_that_the_checker_states_anew(
    name: str, faults: Faults
) -> None:
    net = catalogue_net(name)
    proof = prove_inductively(built(net, faults), TIMEOUT_MS)
    assert not proof.open_
    assert proof.text == stated_anew(net, faults)


@FAULTS
def test_protocol_of_layers_is_proved_and_stated_anew(faults: Faults) -> None:
    net = cells_in_a_line()
    proof = prove_inductively(built(net, faults), TIMEOUT_MS)
    assert not proof.open_
    assert proof.text == stated_anew(net, faults)


@FAULTS
@pytest.mark.parametrize("seed", range(5))
def test_random_protocols_are_proved_and_stated_anew(seed: int, faults: Faults) -> None:
    net = owned_net(seed)
    proof = prove_inductively(built(net, faults), TIMEOUT_MS)
    assert not proof.open_
    assert proof.text == stated_anew(net, faults)


@FAULTS
@pytest.mark.parametrize("net", [catalogue_net("one_robot"), cells_in_a_line(), *map(owned_net, range(8))])
def test_protocols_with_free_parts_are_proved_and_stated_anew(net: Net, faults: Faults) -> None:
    decomposition = freed(split(net))
    proof = prove_inductively(protocol_net(decomposition, PROTOCOL, faults), TIMEOUT_MS)
    assert not proof.open_
    assert proof.text == StatedAnew(Voting(Cut(net), bool(faults), frozenset(decomposition.free))).text


TWICE = """\
firable: 1
cell: twice
controllers:
  a: {start: p, places: {p: , q: }}
  b: {start: p, places: {p: , q: }}
  c: {start: p, places: {p: , q: }}
transitions:
  t: {from: [a.p, b.p], to: [a.q, b.q]}
  u: {from: [a.p, c.p], to: [a.q, c.q]}
  t-back: {from: [a.q, b.q], to: [a.p, b.p]}
  u-back: {from: [a.q, c.q], to: [a.p, c.p]}
arbiters:
  next: {among: [t, u, t], by: order}
"""


def test_who_has_two_turns_of_an_order_takes_part_once() -> None:
    bundle = make_bundle(check(parse_net(TWICE)), protocol=True, faults=True)
    assert all(one.shown for one in check_bundle(bundle))


def test_that_votes_stand_is_given_and_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """`l` closes the gate of the free part of `G` when the token is on `a.x`, which no local invariant tells."""
    marked = {"a.i", "a.g", "b.p"}
    names = ("a.i", "a.j", "a.x", "a.g", "a.h", "b.p", "b.q")
    transitions = (
        Transition("G", ("a.i", "b.p"), ("a.j", "b.q"), ("a.g",)),
        Transition("m", ("a.j",), ("a.x",)),
        Transition("l", ("a.x", "a.g"), ("a.h",)),
    )
    places = tuple(Place(name, name[0], name in marked) for name in names)
    decomposition = freed(split(Net("given", places, transitions, (), (Controller("a"), Controller("b")))))
    assert decomposition.free == (("G", "a"), ("G", "b"))
    protocol = protocol_net(decomposition)
    assert "(assert |votes stand|)" in prove_inductively(protocol, TIMEOUT_MS).text
    assert not prove_inductively(protocol, TIMEOUT_MS).open_
    monkeypatch.setattr("firable.decompose.protocol.inductive_script.persistent", lambda _: iter(()))
    assert prove_inductively(protocol, TIMEOUT_MS).open_ >= {"keeps"}


@pytest.mark.parametrize("name", ["philosophers-2", "workshop-1"])
def test_families_are_stated_anew_as_they_are_proved(name: str) -> None:
    net = family_net(name)
    assert written(built(net, NO_FAULTS)) == stated_anew(net, NO_FAULTS)


def test_both_solvers_answer_the_whole_file() -> None:
    text = stated_anew(example("shuttle"), ANY_FAULTS)
    answers = by_cvc5(text, TIMEOUT_MS)
    assert answers == by_z3(text, TIMEOUT_MS)
    assert set(answers[1::2]) == {"unsat"}


@pytest.mark.usefixtures("remembering")
def test_bundles_with_the_protocol_are_shown() -> None:
    bundle = bundled("shuttle")
    checked = {one.verdict.name: one for one in check_bundle(bundle)}
    names = [name for name in checked if name.partition(".")[0] in TITLES]
    assert [name.removeprefix("explored.") for name in names[:6]] == [
        *("follows", "agrees", "orders-fit", "complete", "one-token", "divergence")
    ]
    assert [name.removeprefix("faults.") for name in names[6:10]] == ["follows", "agrees", "orders-fit", "resumes"]
    assert all(name.startswith("faults.dead") for name in names[10:])
    assert len(names) > 10
    assert all(checked[name].shown for name in names)


def test_what_a_bundle_says_of_the_protocol_is_what_exploring_says() -> None:
    found = {verdict.name: verdict for verdict in explore_protocol(example("shuttle")).verdicts}
    said = {verdict.name: verdict for verdict in bundled("shuttle").verdicts if verdict.name.startswith("explored.")}
    assert {name: (v.status, v.statement) for name, v in said.items()} == {
        name: (v.status, v.statement) for name, v in found.items()
    }


def test_what_fires_never_takes_no_part_in_the_protocol() -> None:
    """A gate that wants full what the transition fills: Eq. (1) cannot hold."""
    places = (Place("a.p", "a", marked=True), Place("b.q", "b"))
    never = Transition("never", ("a.p",), ("b.q",), permissive=("b.q",))
    transitions = (never, Transition("t", ("a.p",), ("b.q",)), Transition("u", ("b.q",), ("a.p",)))
    net = Net("gated", places, transitions, controllers=(Controller("a"), Controller("b")))
    proof = prove_inductively(built(net, NO_FAULTS), TIMEOUT_MS)
    assert not proof.open_
    assert "never" not in proof.text
    assert proof.text == stated_anew(net, NO_FAULTS)


# --------------------------------------------------------------------------------------------------------------------
# What is not


@pytest.mark.parametrize(
    "wrong", [wrong for wrong in WRONG if wrong.variant.acknowledged], ids=lambda wrong: wrong.name
)
def test_wrong_protocols_are_not_proved_and_their_files_are_refused(wrong: WrongProtocol) -> None:
    decomposition = split(example(wrong.example))
    if wrong.variant.of_free:
        decomposition = freed_as_bundled(decomposition)
    proof = prove_inductively(protocol_net(decomposition, wrong.variant, wrong.faults), TIMEOUT_MS)
    assert not any(proof.shows(name) for name in ("follows", "agrees", "complete")), sorted(proof.open_)
    for family in TITLES:
        forged = Examination(Bundle(decomposition, (), {f"{family}.smt2": proof.text}))
        stated = StatedAnew(Voting(Cut(decomposition.net), family == "faults", frozenset(decomposition.free)))
        with pytest.raises(NotShownError, match="is not what must be proved of the protocol of this net"):
            explored.same_text(forged, stated)


def test_the_protocols_without_rounds_have_no_such_invariant() -> None:
    with pytest.raises(ValueError, match="protocol with rounds"):
        Obligations(built(example("shuttle"), NO_FAULTS, Variant.named("naive")))


def refused(bundle: Bundle) -> bool:
    """Whether what the bundle says of the protocol is refused, or what it brings for that is of no use."""
    try:
        examination = Examination(bundle)
        check_explored(examination, check_cut(bundle.decomposition), "cvc5", answered, TIMEOUT_MS)
    except NotShownError:
        return True
    known = set(examination.checked)
    others = {v.name for v in bundle.verdicts if v.name.partition(".")[0] in TITLES} - known
    return bool(others) or not all(one.shown for one in examination.checked.values())


@pytest.fixture
def stated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What must be proved depends on the net alone, which is not changed here."""
    stated: dict[bool, StatedAnew] = {}

    def once(voting: Voting) -> StatedAnew:
        return stated.setdefault(voting.faults, StatedAnew(voting))

    monkeypatch.setattr(explored, "Obligations", once)


@pytest.mark.usefixtures("stated_once")
def test_every_single_change_of_a_verdict_on_the_protocol_is_refused() -> None:
    bundle = of_the_living("shuttle")
    assert not refused(bundle)
    mutants = [
        (how, make) for how, make in verdict_mutants(bundle) if how.startswith(("verdict explored", "verdict f"))
    ]
    assert len(mutants) > 150
    for how, make in mutants:
        try:
            mutant = make()
        except (InputError, ValueError):
            continue
        assert refused(mutant), how


@pytest.mark.parametrize("family", TITLES)
def test_every_single_change_of_a_line_of_the_evidence_is_refused(family: str) -> None:
    bundle, file = bundled("shuttle"), f"{family}.smt2"
    free = frozenset(bundle.decomposition.free)
    stated = StatedAnew(Voting(check_cut(bundle.decomposition), family == "faults", free))
    explored.same_text(Examination(bundle), stated)
    for how, changed in line_mutants(bundle.evidence[file]):
        if changed != bundle.evidence[file]:
            examination = Examination(replace(bundle, evidence={file: changed}))
            with pytest.raises(NotShownError):
                pytest.fail(how) if explored.same_text(examination, stated) else None


@pytest.mark.usefixtures("stated_once")
def test_evidence_on_the_protocol_that_is_missing_or_exchanged_is_refused() -> None:
    bundle = of_the_living("shuttle")
    assert not refused(bundle)
    mutants = [
        (how, make) for how, make in evidence_mutants(bundle) if how.startswith(("explored.smt2", "faults.smt2"))
    ]
    assert len(mutants) > 20
    for how, make in mutants:
        assert refused(make()), how


@pytest.mark.usefixtures("remembering")
def test_evidence_on_the_protocol_that_no_verdict_names_is_refused() -> None:
    bundle = of_the_living("shuttle")
    verdicts = tuple(verdict for verdict in bundle.verdicts if not verdict.name.startswith("faults."))
    with pytest.raises(InputError, match=r"no verdict rests on 'faults\.smt2'"):
        check_bundle(replace(bundle, verdicts=verdicts))


def edits(net: Net) -> Iterator[tuple[str, Net]]:
    """Every other net that is one change away and can be split."""
    for how, make in net_mutants(net):
        try:
            edited = make()
            split(edited)
        except (InputError, ValueError):
            continue
        yield how, edited


IRRELEVANT = (
    "in another order",
    "number",
    "words",
    "moved",
    "signal",
    "gate ",
    "command",
    "machine",
    "parameters",
    "completion",
    "rule",
)
"""Of these the protocol net knows nothing: others prove them."""


def doing(net: Net) -> tuple[set[tuple[str, ...]], set[tuple[str, tuple[frozenset[str], ...]]]]:
    """What a net does, whatever the order of its arcs, and whether a gate repeats one of them."""
    moves = {
        (t.name, tuple(map(frozenset, (t.inputs, t.outputs, t.inputs + t.permissive, t.outputs + t.inhibitive))))
        for t in net.transitions
    }
    return {(net.name, *((p.name + " holds a token" * p.marked) for p in net.places))}, moves


def test_the_evidence_on_the_protocol_of_one_net_is_that_of_no_other() -> None:
    net, count = example("hood"), 0
    text = stated_anew(net, NO_FAULTS)
    for how, edited in edits(net):
        if not any(word in how for word in IRRELEVANT) and doing(edited) != doing(net):
            count += 1
            assert stated_anew(edited, NO_FAULTS) != text, how
    assert count > 80


@pytest.mark.usefixtures("remembering")
def test_verdicts_on_the_protocol_that_were_left_out_are_missed() -> None:
    bundle = of_the_living("shuttle")
    for family in TITLES:
        for kept in [v for v in bundle.verdicts if v.name.startswith(f"{family}.")][:2]:
            verdicts = tuple(v for v in bundle.verdicts if v is kept or not v.name.startswith(f"{family}."))
            with pytest.raises(InputError, match=f"there is no verdict on '{family}."):
                check_bundle(replace(bundle, verdicts=verdicts))


@pytest.mark.usefixtures("remembering")
def test_a_family_that_was_left_out_with_its_evidence_claims_nothing() -> None:
    bundle = of_the_living("shuttle")
    verdicts = tuple(v for v in bundle.verdicts if v.name.partition(".")[0] not in TITLES)
    evidence = {name: text for name, text in bundle.evidence.items() if name not in {"explored.smt2", "faults.smt2"}}
    assert all(one.shown for one in check_bundle(replace(bundle, verdicts=verdicts, evidence=evidence)))


@pytest.mark.parametrize(
    ("kind", "of"),
    [
        ("starts", 5),
        ("keeps.decide/hand_over", 5),
        ("follows", 2),
        ("agrees", 1),
        ("home", 1),
        ("homeward.close/hand_over", 1),
        ("way.fetch", 1),
        ("one-token.fire/unload", 1),
        ("divergence", 1),
    ],
)
def test_an_answer_that_refutes_is_refused_and_a_missing_one_only_claims(kind: str, of: int) -> None:
    bundle = bundled("shuttle")

    def saying(answer: str) -> Callable[[str, int], tuple[str, ...]]:
        def solver(text: str, ms: int) -> tuple[str, ...]:
            said = list(answered(text, ms))
            if kind in said:
                said[said.index(kind) + 1] = answer
            return tuple(said)

        return solver

    cut = check_cut(bundle.decomposition)
    with pytest.raises(NotShownError, match=f"'{kind}' of 'explored.smt2' is refuted: the solver says sat"):
        check_explored(Examination(bundle), cut, "cvc5", saying("sat"), TIMEOUT_MS)
    examination = Examination(bundle)
    check_explored(examination, cut, "cvc5", saying("unknown"), TIMEOUT_MS)
    late = {one.verdict.name for one in examination.checked.values() if one.only_claimed == "cvc5 gave up"}
    assert late == {one.verdict.name for one in examination.checked.values() if not one.shown}
    assert len([name for name in late if name.startswith("explored.")]) == of


@pytest.mark.parametrize("change", UNORDERED)
def test_answers_that_are_not_to_one_obligation_after_the_other_show_nothing(
    change: Callable[[Answers], Answers],
) -> None:
    bundle = bundled("shuttle")
    examination = Examination(bundle)
    with pytest.raises(NotShownError, match=r"does not answer one obligation of 'explored\.smt2' after the other"):
        check_explored(
            examination, check_cut(bundle.decomposition), "cvc5", lambda *of: change(answered(*of)), TIMEOUT_MS
        )
    assert examination.checked == {}


@pytest.mark.parametrize("solver", [by_cvc5, by_z3])
def test_a_defined_name_says_within_a_let_what_it_said_before(solver: Callable[[str, int], tuple[str, ...]]) -> None:
    """That less is to be done than before is asked by such names; a solver that read them anew would ask nothing."""
    text = "(set-logic QF_LIA)\n(declare-const |p| Bool)\n(define-fun |to do 1| () Bool |p|)\n(assert |p|)\n"
    for name, claim in (("before", "|to do 1|"), ("after", "(not |p|)"), ("both", "(and |to do 1| (not |p|))")):
        text += f'(push 1)\n(echo "{name}")\n(assert (not (let ((|p| false)) {claim})))\n(check-sat)\n(pop 1)\n'
    assert solver(text, TIMEOUT_MS) == ("before", "unsat", "after", "unsat", "both", "unsat")


def test_the_invariant_refuses_a_start_that_it_does_not_hold_of() -> None:
    """The first obligation is asked before the invariant is assumed: of a contradiction it would follow."""
    text = stated_anew(example("shuttle"), NO_FAULTS)
    contradiction = text.replace(
        "(define-fun |the invariant| () Bool ", "(define-fun |the invariant| () Bool (and false "
    )
    contradiction = contradiction.replace("\n(define-fun |something is open|", ")\n(define-fun |something is open|")
    assert by_cvc5(contradiction, TIMEOUT_MS)[:2] == ("starts", "sat")


# --------------------------------------------------------------------------------------------------------------------
# Beside an exploration


def test_the_invariant_decides_what_exploring_leaves_open() -> None:
    net = example("shuttle")
    proof = prove_inductively(built(net, NO_FAULTS), TIMEOUT_MS)
    found = explore_protocol(net).complete
    unknown = replace(found, status=Status.UNKNOWN, bound="14 markings", hint="more time")
    (decided,) = with_proof([unknown], proof)
    assert (decided.status, decided.bound, decided.hint) == (Status.PROVED, "", "")
    assert decided.evidence == ("explored.smt2",)
    assert decided.method == "z3, of an inductive invariant of the protocol's net"


def test_an_invariant_that_is_not_shown_decides_nothing() -> None:
    verdict = Verdict("explored.complete", Status.UNKNOWN, "", "exploring", bound="2 markings")
    assert list(with_proof([verdict], Proof("", frozenset({"home"})))) == [verdict]


def test_a_violation_that_the_invariant_excludes_is_a_fault_of_ours() -> None:
    verdict = Verdict("explored.follows", Status.VIOLATED, "", "exploring")
    with pytest.raises(RuntimeError, match="proved by the invariant, and exploring finds it violated"):
        list(with_proof([verdict], Proof("", frozenset())))


# --------------------------------------------------------------------------------------------------------------------
# Names


def test_names_that_make_one_place_of_two_are_refused() -> None:
    """The part of `x/a` at `b` and that of `x` at `a/b` would have one promise."""
    places = (
        *(Place("b.p", "b", marked=True), Place("b.q", "b")),
        *(Place("a/b.p", "a/b", marked=True), Place("a/b.q", "a/b")),
        *(Place("c.p", "c", marked=True), Place("c.q", "c")),
    )
    transitions = (
        Transition("x/a", ("b.p", "c.p"), ("b.q", "c.q")),
        Transition("x", ("a/b.p", "c.q"), ("a/b.q", "c.p")),
    )
    net = Net("strokes", places, transitions, controllers=(Controller("b"), Controller("a/b"), Controller("c")))
    with pytest.raises(InputError, match="'x/a' has a '/' in its name"):
        built(net, NO_FAULTS)
    with pytest.raises(NotShownError, match="two names of the net make one place"):
        stated_anew(net, NO_FAULTS)


def test_a_name_that_is_that_of_a_group_is_refused() -> None:
    """Of `g` and `h`, which compete, and of `g+h` it would be decided in one place."""
    marked = tuple(Place(f"{owner}.p", owner, marked=True) for owner in "bc")
    places = (*marked, *(Place(f"{owner}.{name}", owner) for owner in "bc" for name in "qr"))
    transitions = (
        Transition("g", ("b.p", "c.p"), ("b.q", "c.q")),
        Transition("h", ("b.p", "c.p"), ("b.r", "c.r")),
        Transition("g+h", ("b.q", "c.q"), ("b.p", "c.p")),
    )
    net = Net("strokes", places, transitions, controllers=(Controller("b"), Controller("c")))
    with pytest.raises(InputError, match="two names of the net make one place of the net of its protocol"):
        built(net, NO_FAULTS)
    with pytest.raises(NotShownError, match="two names of the net make one place"):
        stated_anew(net, NO_FAULTS)


def test_names_in_any_script_are_stated_anew() -> None:
    places = (Place("a.weiß", "a", marked=True), Place("b.größe", "b"))
    transitions = (Transition("füllt", ("a.weiß",), ("b.größe",)), Transition("leert", ("b.größe",), ("a.weiß",)))
    net = Net("größe", places, transitions, controllers=(Controller("a"), Controller("b")))
    proof = prove_inductively(built(net, ANY_FAULTS), TIMEOUT_MS)
    assert not proof.open_
    assert proof.text == stated_anew(net, ANY_FAULTS)
    assert set(by_cvc5(proof.text, TIMEOUT_MS)[1::2]) == {"unsat"}
