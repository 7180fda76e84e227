"""What the dead keep back is shown by evidence, and nothing else passes for it.

That it is right is tested in `test_outages_as_explored.py`.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import pytest
from support import remembered
from support.bundle_mutants import evidence_mutants, line_mutants, verdict_mutants
from support.examples import some
from support.explored_outages import is_as_explored
from support.free_parts import freed, with_free_parts
from support.layered_nets import cells_in_a_line
from support.looping_nets import looping_net
from support.outage_nets import gated, overtaken
from support.owned_nets import owned_net
from support.remembered import answered

from firable.analysis.evidence.document import Document, document_from_text
from firable.decompose.protocol.bereft import Bereft, deaths
from firable.decompose.protocol.dead_script import DeadObligations, DeadProof, prove_of_the_dead
from firable.decompose.protocol.outages import inquests, outages, sealed_outages
from firable.decompose.protocol.parts import Part, Parts
from firable.decompose.protocol.shown import proved_without_exploring
from firable.decompose.protocol.variant import PROTOCOL
from firable.decompose.protocol.wrong import example
from firable.decompose.splitting.cut import split
from firable.decompose.verification import documents
from firable.decompose.verification import outages as checked_outages
from firable.decompose.verification.bereft import PREFIX, Wake, wakes
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.documents import UNDECIDED
from firable.decompose.verification.explored import check_explored
from firable.decompose.verification.outage_obligations import OutageObligations
from firable.decompose.verification.outages import check_outages
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import Answers
from firable.decompose.verification.voting import Voting
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.interchange import net_digest
from firable.nets.net import Controller, Net, Place, Transition
from firable.nets.verdict import Status, Verdict, Weight

TIMEOUT_MS = 10_000


@cache
def bundled(make: Callable[[], Net]) -> Bundle:
    """What a bundle holds of faults, and nothing else."""
    decomposition = split(make())
    run, proofs = proved_without_exploring(decomposition, ["faults"], TIMEOUT_MS)
    verdicts, files = sealed_outages(decomposition)
    return Bundle(decomposition, (*run, *verdicts), {**proofs, **files})


@pytest.fixture(autouse=True)
def remembering(monkeypatch: pytest.MonkeyPatch) -> None:
    """A document is read once, what the checker says of it is found once, and the solver is not asked again."""
    monkeypatch.setattr(documents, "document_from_text", remembered.read)
    monkeypatch.setattr(documents, "check_document", remembered.examined)
    monkeypatch.setattr(documents, "obligations", lambda *_, **__: ())


def examined(bundle: Bundle) -> Examination:
    examination, cut = Examination(bundle), Cut(bundle.net)
    check_explored(examination, cut, "cvc5", answered, TIMEOUT_MS)
    check_outages(examination, cut, answered, TIMEOUT_MS)
    return examination


def refused(make: Callable[[], Bundle]) -> bool:
    """Whether a bundle is refused, or not all of it is shown, or something in it is left to nobody."""
    try:
        bundle = make()
        examination = examined(bundle)
    except (NotShownError, ValueError):
        return True
    others = {verdict.name for verdict in bundle.verdicts} ^ set(examination.checked)
    unshown = [one for one in examination.checked.values() if not one.shown and one.verdict.holds]
    return bool(others or unshown or set(bundle.evidence) - examination.used)


def gated_by_its_own() -> Net:
    """Gates on what a transition itself moves say nothing that Eq. (1) does not: `t` and `u` are decided together."""
    marked = {"a.p": False, "b.q": False, "b.r": True}
    transitions = (
        Transition("t", ("a.p",), ("b.q",)),
        Transition("u", ("b.r",), ("b.q",), permissive=("b.r",), inhibitive=("b.q",)),
        Transition("back", ("b.q",), ("b.r",)),
    )
    places = tuple(Place(name, name[0], marked=token) for name, token in marked.items())
    return Net("own", places, transitions, controllers=(Controller("a"), Controller("b")))


def test_a_part_that_is_behind_has_moved_what_its_own_gates_read() -> None:
    assert prove_of_the_dead(split(gated_by_its_own()), TIMEOUT_MS).open_ == ()
    assert is_as_explored(gated_by_its_own())
    for here, there in both(gated_by_its_own()):
        assert net_digest(here.net) == net_digest(there.net)
    assert not refused(partial(bundled, gated_by_its_own))


def test_without_the_promises_that_are_left_too_much_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Bereft, "left", ())
    assert {outage.name: outage for outage in outages(split(gated()))}["the coordinator"].goes_on == ("turn", "back")
    decomposition = split(gated())
    run, proofs = proved_without_exploring(decomposition, ["faults"], TIMEOUT_MS)
    verdicts, files = sealed_outages(decomposition)
    bounds = {verdict.name: verdict.bound for verdict in verdicts}
    assert bounds["faults.dead-coordinator"] == "z3 does not show 'undisturbed.dead-coordinator' of dead.smt2"
    monkeypatch.setattr(DeadProof, "lacks", lambda *_: "")
    verdicts, files = sealed_outages(decomposition)
    assert refused(lambda: Bundle(decomposition, (*run, *verdicts), {**proofs, **files}))


# --------------------------------------------------------------------------------------------------------------------
# It is shown, and nothing else is


@pytest.mark.parametrize("make", [gated, cells_in_a_line, partial(example, "shuttle")])
def test_the_verdicts_on_who_is_dead_are_shown(make: Callable[[], Net]) -> None:
    bundle = bundled(make)
    checked = examined(bundle).checked
    assert set(checked) == {verdict.name for verdict in bundle.verdicts}
    assert all(one.shown for one in checked.values())
    assert {verdict.status for verdict in bundle.verdicts} == {Status.PROVED}


def both(net: Net, free: Sequence[tuple[str, str]] = ()) -> Iterator[tuple[Bereft, Wake]]:
    here = {one.who or one.coordinator: one for one in deaths(Parts(split(net), PROTOCOL), free)}
    there = {one.told: one for one in wakes(Voting(Cut(net), faults=True), free)}
    assert set(here) == set(there)
    yield from ((here[name], there[name]) for name in here)


@pytest.mark.parametrize("make", [looping_net, owned_net])
def test_both_texts_make_the_same_net_of_random_nets(make: Callable[[int], Net]) -> None:
    left = 0
    for net in (cells_in_a_line(), overtaken(), *map(make, range(40))):
        for free in ((), freed(split(net)).free):
            for here, there in both(net, free):
                left += len(here.left)
                assert net_digest(here.net) == net_digest(there.net)
    assert left or make is owned_net


@pytest.mark.seeds
def test_every_single_change_of_a_verdict_on_who_is_dead_is_refused() -> None:
    for make in (gated, partial(example, "shuttle")):
        bundle = bundled(make)
        assert not refused(partial(replace, bundle))
        mutants = [(how, made) for how, made in verdict_mutants(bundle) if how.startswith(f"verdict {PREFIX}")]
        mutants += [
            (f"{v.name} {how}", made) for v in bundle.verdicts if PREFIX in v.name for how, made in more(bundle, v)
        ]
        assert len(mutants) > 50
        assert [how for how, made in some(mutants, 3) if not refused(made)] == []


def more(bundle: Bundle, verdict: Verdict) -> Iterator[tuple[str, Callable[[], Bundle]]]:
    changes = (
        ("one less stands still", replace(verdict, subjects=verdict.subjects[1:])),
        ("one more stands still", replace(verdict, subjects=(*verdict.subjects, "turn"))),
        ("machines", replace(verdict, hint=verdict.hint.replace("may stand still", "go on"))),
        ("method", replace(verdict, method="by hand")),
        ("weight", replace(verdict, weight=Weight.WARNING)),
    )
    for how, changed in changes:
        if changed != verdict:
            verdicts = tuple(changed if v is verdict else v for v in bundle.verdicts)
            yield how, partial(replace, bundle, verdicts=verdicts)


def test_evidence_on_who_is_dead_that_is_missing_or_exchanged_is_refused() -> None:
    bundle = bundled(gated)
    mutants = [(how, make) for how, make in evidence_mutants(bundle) if not how.startswith("another")]
    assert len(mutants) > 10
    mutants = [(how, make) for how, make in mutants if not is_same(make, bundle)]
    assert [how for how, make in mutants if not refused(make)] == []


def is_same(make: Callable[[], Bundle], bundle: Bundle) -> bool:
    """Whether nothing is changed: two controllers that are dead may leave the same net, and the same document."""
    try:
        return make() == bundle
    except ValueError:
        return False


# --------------------------------------------------------------------------------------------------------------------
# The nets that are left are tied to the protocol


@pytest.mark.parametrize("make", [looping_net, owned_net])
def test_what_ties_the_nets_that_are_left_to_the_protocol_is_proved_and_both_texts_state_it(
    make: Callable[[int], Net],
) -> None:
    for decomposition in (*map(split, map(make, range(6))), *map(with_free_parts, map(make, range(6)))):
        assert_tied(decomposition)


def test_of_nets_in_layers_and_of_cells_it_is_proved_with_free_parts_and_without() -> None:
    for net in (cells_in_a_line(), overtaken(), gated(), catalogue_net("two_robots_shared")):
        assert_tied(split(net))
        assert_tied(with_free_parts(net))


def assert_tied(decomposition: Decomposition) -> None:
    proof = prove_of_the_dead(decomposition, TIMEOUT_MS)
    assert proof.open_ == ()
    assert stated(decomposition).text == proof.text


def stated(decomposition: Decomposition) -> OutageObligations:
    return OutageObligations(Voting(Cut(decomposition.net), faults=True, free=frozenset(decomposition.free)))


def test_both_texts_state_what_a_step_without_arcs_changes() -> None:
    net = replace(gated(), transitions=(*gated().transitions, Transition("idle", permissive=("a.up",))))
    proof = prove_of_the_dead(split(net), TIMEOUT_MS)
    assert proof.open_ == ()
    assert stated(split(net)).text == proof.text


def unsound(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the net that is left say more than it may."""
    if how == "undisturbed: nothing is held up":
        monkeypatch.setattr(Bereft, "held_up", frozenset())
    elif how == "undisturbed: no promise is left":
        monkeypatch.setattr(Bereft, "left", ())
    elif how == "promised: no part is behind":
        holding = Bereft._holding

        def firable(self: Bereft, part: Part, held: dict[Part, str]) -> Iterator[Transition]:
            behind, hold = holding(self, part, held)
            yield from (hold, replace(hold, name=behind.name))

        monkeypatch.setattr(Bereft, "_holding", firable)
    elif how == "promised: nobody of its round has fired":
        monkeypatch.setattr("firable.decompose.protocol.bereft.moved_beside", lambda *_: frozenset())
    elif how == "keeps: a promise stands as it was given":
        monkeypatch.setattr("firable.decompose.protocol.dead_script.moved_beside", lambda *_: frozenset())
    else:
        monkeypatch.setattr(Bereft, "at_once", property(lambda self: self.held_up))


@pytest.mark.parametrize(
    "how",
    [
        "undisturbed: nothing is held up",
        "undisturbed: no promise is left",
        "promised: no part is behind",
        "promised: nobody of its round has fired",
        "keeps: a promise stands as it was given",
        "at-once: what is held up stands still at once",
    ],
)
def test_a_net_that_is_left_and_says_too_much_is_not_tied_to_the_protocol(
    how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    unsound(how, monkeypatch)
    open_ = prove_of_the_dead(split(overtaken()), TIMEOUT_MS).open_
    assert {name.partition(".")[0] for name in open_} == {how.partition(":")[0]}


def chute() -> Net:
    """`a` drops into the chute of `b`, whose door may be shut before `b` has heard of it; all parts may be free."""
    marked = ("a.part", "b.door", "b.empty")
    names = (*marked, "a.gone", "a.done", "b.shut", "b.full", "b.out")
    transitions = (
        Transition("drop", ("a.part", "b.empty"), ("a.gone", "b.full"), permissive=("b.door",)),
        Transition("shut", ("a.gone", "b.door"), ("a.done", "b.shut")),
        Transition("clear", ("b.full",), ("b.out",)),
    )
    places = tuple(Place(name, name[0], marked=name in marked) for name in names)
    return Net("chute", places, transitions, controllers=(Controller("a"), Controller("b")))


def unsound_of_free(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the net that is left say more of free parts than it may, or the obligations be given less."""
    if how == "promised: a part is behind while its gates are open":
        holding = Bereft._holding

        def gated_parts(self: Bereft, part: Part, held: dict[Part, str]) -> Iterator[Transition]:
            for t in holding(self, part, held):
                yield replace(t, permissive=tuple(sorted({*t.permissive, *part.permissive})))

        monkeypatch.setattr(Bereft, "_holding", gated_parts)
    elif how == "undisturbed: no part is behind":
        monkeypatch.setattr(Bereft, "left", ())
    elif how == "way: a part that is behind is in nobody's way":
        monkeypatch.setattr(DeadObligations, "_in_the_way", lambda *_: set())
    else:
        monkeypatch.setattr("firable.decompose.protocol.inductive_script.persistent", lambda _: iter(()))


@pytest.mark.parametrize(
    "how",
    [
        "promised: a part is behind while its gates are open",
        "undisturbed: no part is behind",
        "way: a part that is behind is in nobody's way",
        "keeps: votes need not stand",
    ],
)
def test_a_net_that_is_left_and_says_too_much_of_free_parts_is_not_tied_to_the_protocol(
    how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    decomposition = with_free_parts(chute())
    assert ("drop", "b") in decomposition.free
    assert prove_of_the_dead(decomposition, TIMEOUT_MS).open_ == ()
    unsound_of_free(how, monkeypatch)
    open_ = prove_of_the_dead(decomposition, TIMEOUT_MS).open_
    assert {name.partition(".")[0] for name in open_} == {how.partition(":")[0]}


def test_behind_a_dead_coordinator_a_free_part_is_behind_and_promises_nothing() -> None:
    decomposition = with_free_parts(chute())
    promising = Parts(replace(decomposition, free=()), PROTOCOL)
    (dead,) = (one for one in deaths(promising, decomposition.free) if not one.who)
    assert [t.name for t in dead.net.transitions if t.name.startswith(("hold/", "behind/"))] == ["behind/drop/b"]
    assert is_as_explored(chute(), with_free_parts)


def test_what_is_shown_of_the_protocol_in_which_every_part_promises_shows_nothing_of_the_one_with_free_parts() -> None:
    decomposition = with_free_parts(chute())
    verdicts, files = sealed_outages(decomposition)
    bundle, cut = Bundle(decomposition, verdicts, files), Cut(decomposition.net)
    examination = Examination(bundle)
    check_outages(examination, cut, answered, TIMEOUT_MS)
    assert [one.shown for one in examination.checked.values()] == [True, True, True]
    promising = prove_of_the_dead(split(chute()), TIMEOUT_MS).text
    with pytest.raises(NotShownError, match=r"dead\.smt2"):
        check_outages(
            Examination(replace(bundle, evidence={**files, "dead.smt2": promising})),
            cut,
            answered,
            TIMEOUT_MS,
        )


def test_steps_that_leave_no_less_to_be_done_leave_nobody_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.decompose.protocol.inductive_script.still_to_be_done", lambda _: ())
    decomposition = split(overtaken())
    assert {name.partition(".")[0] for name in prove_of_the_dead(decomposition, TIMEOUT_MS).open_} == {"homeward"}
    assert {verdict.status for verdict in sealed_outages(decomposition)[0]} == {Status.UNKNOWN}


def test_a_step_that_the_solver_gives_up_leaves_nobody_shown() -> None:
    def tired(text: str, timeout_ms: int) -> tuple[str, ...]:
        said = list(answered(text, timeout_ms))
        if "at-once.dead.a" in said:
            said[said.index("homeward.restart/a") + 1] = "unknown"
        return tuple(said)

    examination, cut = Examination(bundled(gated)), Cut(bundled(gated).net)
    check_explored(examination, cut, "cvc5", answered, TIMEOUT_MS)
    check_outages(examination, cut, tired, TIMEOUT_MS)
    dead = {one.name for one in bundled(gated).verdicts if one.name.startswith(PREFIX)}
    assert {name for name, one in examination.checked.items() if not one.shown} == dead


def test_every_change_of_a_line_that_ties_them_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    bundle, count = bundled(gated), 0
    cut = Cut(bundle.net)
    once = stated(bundle.decomposition)
    monkeypatch.setattr(checked_outages, "OutageObligations", lambda *_: once)
    check_outages(Examination(bundle), cut, answered, TIMEOUT_MS)
    for _, changed in line_mutants(bundle.evidence["dead.smt2"]):
        count += 1
        mutant = replace(bundle, evidence={**bundle.evidence, "dead.smt2": changed})
        with pytest.raises(NotShownError, match=r"dead\.smt2"):
            check_outages(Examination(mutant), cut, answered, TIMEOUT_MS)
    assert count > 500


OF_ONE = [
    ("at-once.dead.a", ".a"),
    ("undisturbed.dead-coordinator", "-coordinator"),
    ("promised.dead-coordinator.", "-coordinator"),
]
"""What the name of an obligation on the net that is left begins with, and who is dead there."""


def answering(begins: str, answer: str) -> Answers:
    """cvc5, which says something else of the first obligation whose name begins so."""

    def answers(text: str, timeout_ms: int) -> tuple[str, ...]:
        said = list(answered(text, timeout_ms))
        for i in [i for i, name in enumerate(said[::2]) if name.startswith(begins)][:1]:
            said[2 * i + 1] = answer
        return tuple(said)

    return answers


@pytest.mark.parametrize(("begins", "dead"), OF_ONE)
def test_an_obligation_on_one_who_is_dead_that_the_solver_gives_up_leaves_the_others_shown(
    begins: str, dead: str
) -> None:
    bundle = bundled(gated)
    examination, cut = Examination(bundle), Cut(bundle.net)
    check_explored(examination, cut, "cvc5", answered, TIMEOUT_MS)
    check_outages(examination, cut, answering(begins, "unknown"), TIMEOUT_MS)
    assert [name for name, one in examination.checked.items() if not one.shown] == [f"{PREFIX}{dead}"]


@pytest.mark.parametrize(("begins", "dead"), OF_ONE)
def test_an_obligation_that_is_refuted_leaves_the_others_shown_where_the_bundle_says_that_it_does_not_know(
    begins: str, dead: str
) -> None:
    bundle, refuting = bundled(gated), answering(begins, "sat")
    with pytest.raises(NotShownError, match=rf"'{re.escape(begins)}.*' of 'dead\.smt2' is refuted"):
        check_outages(Examination(bundle), Cut(bundle.net), refuting, TIMEOUT_MS)
    (said,) = (verdict for verdict in bundle.verdicts if verdict.name == f"{PREFIX}{dead}")
    doubted = replace(said, status=Status.UNKNOWN, evidence=(), subjects=(), hint="", bound=UNDECIDED)
    verdicts = tuple(doubted if verdict is said else verdict for verdict in bundle.verdicts)
    honest = replace(
        bundle, verdicts=verdicts, evidence={f: t for f, t in bundle.evidence.items() if f != said.evidence[0]}
    )
    examination = Examination(honest)
    check_outages(examination, Cut(bundle.net), refuting, TIMEOUT_MS)
    others = {f"{PREFIX}{who}" for who in (".a", ".b", "-coordinator")} - {said.name}
    assert {name for name, one in examination.checked.items() if one.shown} == others


def documents_of(bundle: Bundle) -> dict[str, str]:
    return {file: text for file, text in bundle.evidence.items() if file.endswith(".evidence.json")}


@pytest.mark.seeds
def test_every_change_of_an_answer_is_refused() -> None:
    bundle = bundled(gated)
    documents = {file: document_from_text(text, file) for file, text in documents_of(bundle).items()}
    mutants = [(file, changed) for file, document in documents.items() for changed in other_answers(document)]
    assert len(mutants) > 60
    for file, changed in some(mutants, 3):
        mutant = replace(bundle, evidence={**bundle.evidence, file: changed.to_text()})
        assert refused(partial(replace, mutant)), changed.to_text()[:400]


def other_answers(document: Document) -> Iterator[Document]:
    """One record left out, doubled, exchanged with the next, turned round, or without what shows it."""
    records = document.records
    for i, record in enumerate(records):
        before, after = records[:i], records[i + 1 :]
        yield replace(document, records=(*before, *after))
        yield replace(document, records=(*before, record, record, *after))
        yield replace(document, records=(*before, replace(record, proved=not record.proved), *after))
        if after:
            yield replace(document, records=(*before, after[0], record, *after[1:]))
            yield replace(document, records=(*before, replace(record, shown=after[0].shown), *after))
    properties = document.net.properties
    for i in range(len(properties)):
        net = replace(document.net, properties=(*properties[:i], *properties[i + 1 :]))
        yield replace(document, net=net, records=(*records[:i], *records[i + 1 :]))


def test_an_answer_without_evidence_is_only_claimed_and_such_a_verdict_is_not_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = bundled(gated)
    file, text = next(iter(documents_of(bundle).items()))
    document = document_from_text(text, file)
    bare = replace(document, records=(replace(document.records[0], shown=(), lacking="no time"), *document.records[1:]))
    checked = examined(replace(bundle, evidence={**bundle.evidence, file: bare.to_text()})).checked
    assert [one.only_claimed for one in checked.values() if not one.shown] == ["only claimed: no time"]
    monkeypatch.setattr("firable.decompose.protocol.outages.Inquest.document", lambda *_: bare)
    verdict, files = next(iter(inquests(split(gated())))).sealed()
    assert (verdict.status, verdict.bound, files) == (Status.UNKNOWN, "no evidence: no time", {})


def test_a_verdict_on_who_is_dead_may_be_left_open_and_says_nothing_else() -> None:
    bundle = bundled(gated)
    i = next(i for i, verdict in enumerate(bundle.verdicts) if verdict.name.startswith(PREFIX))
    first, others = bundle.verdicts[i], (*bundle.verdicts[:i], *bundle.verdicts[i + 1 :])
    rest = {file: text for file, text in bundle.evidence.items() if file != first.evidence[0]}
    doubted = replace(first, status=Status.UNKNOWN, evidence=(), subjects=(), hint="", bound=UNDECIDED)
    checked = examined(replace(bundle, verdicts=(*others, doubted), evidence=rest)).checked
    assert [name for name, one in checked.items() if not one.shown] == [first.name]
    edits: tuple[dict[str, Any], ...] = (
        {"hint": "all goes on"},
        {"subjects": first.subjects},
        {"bound": "proved by hand"},
    )
    for changed in (replace(doubted, **edit) for edit in edits):
        mutant = replace(bundle, verdicts=(*others, changed), evidence=rest)
        assert refused(partial(replace, mutant))


def test_a_controller_of_any_name_is_told_from_the_coordinator() -> None:
    found = [v for v in bundled(partial(gated, "coordinator")).verdicts if v.name.startswith(PREFIX)]
    assert [verdict.name for verdict in found] == [f"{PREFIX}.coordinator", f"{PREFIX}.b", f"{PREFIX}-coordinator"]


def test_a_transition_that_bears_a_name_of_the_net_that_is_left_is_refused() -> None:
    net = gated(together="life/dies")
    with pytest.raises(InputError, match="F4001"):
        split(net)
    forged = replace(bundled(gated).decomposition, net=net)
    with pytest.raises(NotShownError):
        examined(Bundle(forged, bundled(gated).verdicts, bundled(gated).evidence))
