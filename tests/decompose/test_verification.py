"""Checking a bundle again: what was made passes, and every single change of what it holds does not."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any

import pytest
from support.bundle_mutants import decomposition_mutants, evidence_mutants, line_mutants, verdict_mutants
from support.examples import some
from support.remembered import UNORDERED, Answers, answered, bundled, rests_on_an_obligation

from firable.analysis.check import check
from firable.analysis.induction.smt import symbol
from firable.decompose.bundling import make_bundle
from firable.decompose.proofs.families import FAMILIES
from firable.decompose.proofs.proving import prove
from firable.decompose.protocol.parametric.proving import theorem
from firable.decompose.splitting.cut import split
from firable.decompose.verification import documents
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.formulas import spelled
from firable.decompose.verification.obligations import check_obligations, compared
from firable.decompose.verification.protocol import TITLE, blocks, check_protocol, published
from firable.decompose.verification.recut import Cut, check_cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.restating import HEADS
from firable.decompose.verification.solvers import SOLVERS, SolverError, gave_up
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, family_net
from firable.nets.diagnostics import InputError
from firable.nets.net import Controller, Net, Place, Transition
from firable.nets.text import parse_net
from firable.nets.verdict import NOTHING, TOKENS_MAX, Status, Verdict

CELLS = ("conceptual_one_robot", "one_robot", "two_robots_shared")


def survives(make: Callable[[], Bundle], whole: Bundle) -> bool:
    """Whether a mutant is a bundle of which everything is shown."""
    try:
        checked = check_bundle(make())
    except (InputError, ValueError):  # not shown; not a net
        return False
    return len(checked) == len(whole.verdicts) and all(one.shown for one in checked)


@pytest.mark.parametrize(
    ("name", "solver"), [*((name, "cvc5") for name in CELLS), ("conceptual_one_robot", "z3"), ("one_robot", "z3")]
)
def test_everything_in_the_bundle_of_a_cell_is_shown(name: str, solver: str) -> None:
    bundle = bundled(name)
    checked = check_bundle(bundle, solver=solver)
    assert [one.verdict for one in checked] == list(bundle.verdicts)
    assert all(one.shown and one.method and not one.only_claimed for one in checked)


@pytest.mark.usefixtures("remembering")
def test_what_is_read_back_is_shown_too() -> None:
    bundle = bundled("conceptual_one_robot")
    assert check_bundle(Bundle.from_bytes(bundle.to_bytes())) == check_bundle(bundle)


@pytest.mark.parametrize(
    "name",
    ["workshop-6", "vehicles-2-8", "philosophers-4", "grid-3", "counter-3", "interlocked-3", "one_robot_timed"],
)
def test_what_must_be_proved_is_stated_anew_as_the_prover_states_it(name: str) -> None:
    decomposition = split(family_net(name) if "-" in name else catalogue_net(name))
    proof = prove(decomposition)
    examination = Examination(Bundle(decomposition, proof.verdicts, proof.files))
    cut = check_cut(decomposition)
    stated = [one.name for family in HEADS for one in compared(examination, cut, family)]
    assert stated == [v.name for v in proof.verdicts if not v.name.startswith("protocol.")]


def test_layers_are_stated_anew() -> None:
    decomposition = split(catalogue_net("two_cells"))
    proof = prove(decomposition)
    assert {row.at for row in decomposition.coordinated} == {None, "cell_a", "cell_b"}
    examination = Examination(Bundle(decomposition, proof.verdicts, proof.files))
    for family in HEADS:
        assert compared(examination, check_cut(decomposition), family)
    for i, row in enumerate(decomposition.coordinated):
        other = replace(row, at="cell_a" if row.at is None else None)
        rows = (*decomposition.coordinated[:i], other, *decomposition.coordinated[i + 1 :])
        with pytest.raises(NotShownError):
            check_cut(replace(decomposition, coordinated=rows))


def test_names_in_any_script_are_stated_anew() -> None:
    net = Net(
        "größe",
        (Place("a.weiß", "a", marked=True), Place("b.größe", "b")),
        (Transition("füllt", ("a.weiß",), ("b.größe",)), Transition("leert", ("b.größe",), ("a.weiß",))),
        controllers=(Controller("a"), Controller("b")),
    )
    decomposition = split(net)
    proof = prove(decomposition)
    assert proof.holds
    examination = Examination(Bundle(decomposition, proof.verdicts, proof.files))
    for family in HEADS:
        compared(examination, check_cut(decomposition), family)


GATES = """\
firable: 1
cell: gates
controllers:
  a: {coordinator: true, start: [p, lit], places: {p: , q: , lit: , dark: }}
  b: {start: r, inputs: [go, stop], places: {r: , s: }}
transitions:
  there: {from: a.p, to: a.q, if: [b.r, a.lit], unless: [b.s, a.dark]}
  back: {from: a.q, to: a.p, if: [b.s, b.go], unless: [b.r, b.stop]}
  down: {from: b.r, to: b.s, if: a.q}
  up: {from: b.s, to: b.r, unless: a.q}
  out: {from: a.lit, to: a.dark, if: b.s}
  in: {from: a.dark, to: a.lit, if: b.go}
"""


def test_gates_of_every_kind_are_stated_anew() -> None:
    """No net of the catalogue has a permissive one."""
    decomposition = split(parse_net(GATES))
    proof = prove(decomposition)
    assert proof.holds
    examination = Examination(Bundle(decomposition, proof.verdicts, proof.files))
    cut = check_cut(decomposition)
    for family in HEADS:
        compared(examination, cut, family)


def test_the_families_stated_anew_are_those_of_the_prover() -> None:
    assert [(family.name, family.says) for family in FAMILIES] == [*HEADS.items(), ("protocol", TITLE)]


def test_the_theorem_on_the_protocol_is_published_as_it_is_proved() -> None:
    """To publish it anew: write `theorem()[1]` to the file, and read it."""
    verdicts, text = theorem()
    assert published() == text
    assert blocks() == tuple((verdict.name, verdict.statement) for verdict in verdicts)


@pytest.mark.usefixtures("remembering")
def test_another_theorem_on_the_protocol_is_refused() -> None:
    bundle = bundled("one_robot")
    text = bundle.evidence["protocol.smt2"]
    for changed in (
        text.replace("(assert invariant)", "(assert false)", 1),
        text.replace("; assumed of every net", "(assert false)\n; assumed of every net", 1),
        text[: text.rindex("\n; ")],
        text.replace("'apply' keeps", "'apply' has kept"),
    ):
        assert changed != text
        with pytest.raises(InputError, match="is not the theorem on the protocol"):
            check_bundle(replace(bundle, evidence={**bundle.evidence, "protocol.smt2": changed}))


@pytest.mark.usefixtures("remembering")
def test_the_theorem_on_the_protocol_needs_an_answer_to_each_of_its_obligations() -> None:
    def judged(change: Callable[[Answers], Answers]) -> Examination:
        examination = Examination(bundled("conceptual_one_robot"))
        check_protocol(examination, "cvc5", lambda *of: change(answered(*of)), 10_000)
        return examination

    names = [name for name, _ in blocks()]
    assert [(name, one.shown) for name, one in judged(lambda said: said).checked.items()] == [(n, True) for n in names]
    with pytest.raises(NotShownError, match=f"'{names[-1]}' is refuted: the solver says sat"):
        judged(lambda said: (*said[:-1], "sat"))
    late = [one for one in judged(lambda said: (*said[:-1], "unknown")).checked.values() if not one.shown]
    assert [(one.verdict.name, one.method, one.only_claimed) for one in late] == [(names[-1], NOTHING, "cvc5 gave up")]
    for changed in UNORDERED:
        with pytest.raises(NotShownError, match=r"does not answer one obligation of 'protocol\.smt2' after the other"):
            judged(changed)


# --------------------------------------------------------------------------------------------------------------------
# Mutants: everything sealed anew, so that all hashes are right


@pytest.mark.seeds
@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("name", ["workshop-1", "one_robot"])
def test_every_single_change_of_net_subnets_and_table_is_refused(name: str) -> None:
    """Most by cutting the net anew; what the cut does not depend on (names, orders, properties) by the evidence."""
    bundle = bundled(name)
    count = 0
    for how, make in some(decomposition_mutants(bundle), 2):
        try:
            mutant = make()
        except (InputError, ValueError):
            continue  # not even a net: nothing that could be read
        count += 1
        try:
            check_cut(mutant.decomposition)
        except NotShownError:
            continue
        assert how.startswith("net: ")
        assert not survives(make, bundle), how
    assert count > 500


@pytest.mark.usefixtures("remembering")
def test_another_net_split_rightly_is_not_shown_by_the_proofs_on_this_one() -> None:
    bundle = bundled("workshop-1")
    for how, net in consistent_edits(bundle.net):
        edited = replace(bundle, decomposition=split(net))
        assert not survives(partial(replace, edited), bundle), how


def consistent_edits(net: Net) -> Iterator[tuple[str, Net]]:
    """The net with each arc and gate left out, and each token moved."""
    for i, t in enumerate(net.transitions):
        for kind in ("inputs", "outputs", "permissive", "inhibitive", "external"):
            there = getattr(t, kind)
            for j in range(len(there)):
                changes: dict[str, Any] = {kind: (*there[:j], *there[j + 1 :])}
                changed = replace(t, **changes)
                try:
                    edited = replace(net, transitions=(*net.transitions[:i], changed, *net.transitions[i + 1 :]))
                    split(edited)
                except (InputError, ValueError):
                    continue
                yield f"{t.name} without {there[j]}", edited
    for i, p in enumerate(net.places):
        places = (*net.places[:i], replace(p, marked=not p.marked), *net.places[i + 1 :])
        yield f"a token of {p.name}", replace(net, places=places)


def test_every_single_change_of_the_verdict_on_an_obligation_is_refused() -> None:
    bundle = bundled("conceptual_one_robot")
    cut = check_cut(bundle.decomposition)
    mutants = [(family_of(bundle, how), how, make) for how, make in verdict_mutants(bundle)]
    mutants = [one for one in mutants if one[0] in HEADS]
    assert len(mutants) > 500
    for family, how, make in mutants:
        with pytest.raises(NotShownError):
            pytest.fail(how) if compared(Examination(make()), cut, family) else None


def family_of(bundle: Bundle, how: str) -> str:
    """The family of the obligation of which a mutant changes the verdict; nothing where it changes another verdict."""
    name = how.removeprefix("verdict ").partition(":")[0]
    verdicts = [v for v in bundle.verdicts if v.name == name and rests_on_an_obligation(v)]
    return verdicts[0].evidence[0].removesuffix(".smt2") if verdicts else ""


@pytest.mark.seeds
@pytest.mark.usefixtures("remembering")
def test_every_single_change_of_a_verdict_on_the_net_or_on_a_vote_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = bundled("workshop-1")

    def shown_before(examination: Examination, *_: object) -> None:
        for verdict in filter(rests_on_an_obligation, bundle.verdicts):
            examination.text(verdict.evidence[0])
            examination.judge(verdict, shown=True, method="the test above")

    monkeypatch.setattr("firable.decompose.verification.checking.check_obligations", shown_before)
    monkeypatch.setattr(documents, "obligations", lambda *_, **__: ())  # no document is changed here
    assert survives(lambda: bundle, bundle)
    mutants = [(how, make) for how, make in verdict_mutants(bundle) if not family_of(bundle, how)]
    assert len(mutants) > 250
    assert [how for how, make in some(mutants, 3) if survives(make, bundle)] == []


@pytest.mark.usefixtures("remembering")
def test_evidence_that_is_missing_exchanged_or_added_is_refused() -> None:
    bundle = bundled("conceptual_one_robot")
    assert [how for how, make in evidence_mutants(bundle) if survives(make, bundle)] == []


@cache
def cut_of(name: str) -> Cut:
    return check_cut(bundled(name).decomposition)


def family_refused(name: str, file: str, text: str) -> bool:
    bundle = bundled(name)
    mutant = replace(bundle, evidence={**bundle.evidence, file: text})
    try:
        compared(Examination(mutant), cut_of(name), file.removesuffix(".smt2"))
    except NotShownError:
        return True
    return False


@pytest.mark.parametrize("family", [family for family in HEADS if not family.startswith("o8")])  # one layer
def test_every_change_of_a_line_of_an_obligation_is_refused(family: str) -> None:
    file = f"{family}.smt2"
    whole = bundled("workshop-1").evidence[file]
    text = "\n\n".join(whole.split("\n\n")[:9])  # its head, and eight of its obligations
    rest = whole.removeprefix(text)
    for how, changed in line_mutants(text):
        mutant = changed + rest
        assert family_refused("workshop-1", file, mutant), how


TOKEN = re.compile(r'\|[^|]*\||"[^"]*"|[^\s()|"]+|[()]')


@pytest.mark.parametrize("family", [family for family in HEADS if not family.startswith("o8")])  # one layer
def test_every_change_of_a_word_of_an_obligation_is_refused(family: str) -> None:
    file = f"{family}.smt2"
    text = bundled("workshop-1").evidence[file]
    found = list(TOKEN.finditer("\n\n".join(text.split("\n\n")[:3])))  # its head, and two of its obligations
    swap = {"and": "or", "or": "and", "not": "or", "=": "or", "true": "false", "false": "true"}
    for token in found[:: max(1, len(found) // 100)]:
        for words in ("", swap.get(token[0], "true"), f"{token[0]} {token[0]}"):
            mutant = text[: token.start()] + words + text[token.end() :]
            assert family_refused("workshop-1", file, mutant), (token[0], words, token.start())


@pytest.mark.parametrize("family", ["eq7", "eq9-10", "persistence"])
def test_every_blank_more_or_less_in_an_obligation_is_refused(family: str) -> None:
    file = f"{family}.smt2"
    text = bundled("workshop-1").evidence[file]
    part = "\n\n".join(text.split("\n\n")[:4])
    for blank in re.finditer(r"\n+ *|(?<=[)|a-z=]) (?=[(|a-z])", part[part.index("(push 1)") :]):
        at = part.index("(push 1)") + blank.start()
        for words in (f"{text[at]}{text[at]}", ""):
            assert family_refused("workshop-1", file, text[:at] + words + text[at + 1 :]), (at, words)
    assert family_refused("workshop-1", file, text.removesuffix("\n"))
    assert family_refused("workshop-1", file, f"{text}\n")


@pytest.mark.parametrize("family", ["eq7", "eq9-10", "persistence"])
def test_every_other_division_into_lines_is_refused(family: str) -> None:
    file = f"{family}.smt2"
    text = bundled("workshop-1").evidence[file]
    part = "\n\n".join(text.split("\n\n")[:4])
    inside = re.finditer(r"(?<=[)|a-z=]) (?=[(|a-z])|\n +", part[part.index("(push 1)") :])
    ends = [(part.index("(push 1)") + blank.start(), part.index("(push 1)") + blank.end()) for blank in inside]
    assert ends
    for start, end in ends:
        before = text[text.rfind("\n(", 0, start) : start]
        indented = "\n" + "  " * (before.count("(") - before.count(")") - 1)
        words = " " if text[start] == "\n" else indented
        assert family_refused("workshop-1", file, text[:start] + words + text[end:]), (start, words)


def test_weaker_assertions_and_sly_commands_are_refused() -> None:
    text = bundled("workshop-1").evidence["eq7.smt2"]
    first = text.index("(push 1)")
    for changed in (
        text.replace("(assert (not\n", "(assert false)\n(assert (not\n", 1),
        text[:first] + "(assert false)\n" + text[first:],
        text[:first] + "(set-option :timeout 1)\n" + text[first:],
        text.replace("(check-sat)", '(check-sat)\n(echo "unsat")', 1),
        text.replace("(pop 1)", "", 1),
        text.replace("(set-logic QF_UF)", "(set-logic ALL)"),
        text.replace("; ", "; not ", 1),
        text.replace("(declare-const ", "(declare-const |shared1| Bool)\n(declare-const ", 1),
        text + "(exit)\n",
    ):
        assert changed != text
        assert family_refused("workshop-1", "eq7.smt2", changed)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda head, first, *more: [head, *more, first], "' where 'eq7."),
        (lambda head, first, *more: [head, first.replace('(echo "', '(echo "other.'), *more], "'other.*' where 'eq7."),
        (lambda head, first, *more: [head, first.replace("; ", "; not "), *more], "states something else than"),
        (lambda head, first, *more: [head.replace("; eq7", "; eq8"), first, *more], "does not say of what it is"),
        (lambda *blocks: [*blocks[:-1], ""], "lacks the obligation"),
        (lambda *blocks: [*(block.removesuffix("\n") for block in blocks), blocks[-1]], "which nobody demands"),
    ],
)
def test_a_file_of_other_obligations_is_told_by_the_first_that_is_another(
    change: Callable[..., list[str]], words: str
) -> None:
    bundle = bundled("workshop-1")
    text = "\n\n".join(change(*bundle.evidence["eq7.smt2"].split("\n\n"))).replace("\n\n\n", "\n\n")
    mutant = replace(bundle, evidence={**bundle.evidence, "eq7.smt2": text.rstrip("\n") + "\n"})
    with pytest.raises(NotShownError, match=words):
        compared(Examination(mutant), cut_of("workshop-1"), "eq7")


@pytest.mark.parametrize("changed", UNORDERED)
def test_answers_that_are_not_to_one_obligation_after_the_other_show_nothing(
    changed: Callable[[Answers], Answers],
) -> None:
    examination = Examination(bundled("workshop-1"))
    with pytest.raises(NotShownError, match=r"does not answer one obligation of 'eq7\.smt2' after the other"):
        check_obligations(
            examination, cut_of("workshop-1"), "z3", lambda *of: changed(SOLVERS["z3"](*of)), 10_000, ["eq7"]
        )
    assert examination.checked == {}


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("given_up", ["unknown", "unknown (TIMEOUT)", "unknown (INCOMPLETE)", "timeout"])
def test_an_answer_that_refutes_is_refused_and_one_that_is_missing_only_claims(
    given_up: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = bundled("conceptual_one_robot")

    def saying(answer: str) -> dict[str, Callable[[str, int], tuple[str, ...]]]:
        return {"cvc5": lambda text, ms: tuple(answer if line == "unsat" else line for line in answered(text, ms))}

    monkeypatch.setattr("firable.decompose.verification.checking.SOLVERS", saying("sat"))
    with pytest.raises(InputError, match=r"'eq7\..*' is refuted: the solver says sat"):
        check_bundle(bundle)
    monkeypatch.setattr("firable.decompose.verification.checking.SOLVERS", saying(given_up))
    checked = check_bundle(bundle)
    assert {one.shown for one in checked if one.verdict.name.startswith("eq7.")} == {False}
    assert {(one.only_claimed, one.method) for one in checked if not one.shown} == {("cvc5 gave up", NOTHING)}


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_solver_that_runs_out_of_time_has_given_up_and_goes_on_with_the_next(solver: str) -> None:
    pigeons, holes = range(13), range(12)
    lines = [f"(declare-const |{p} in {h}| Bool)" for p in pigeons for h in holes]
    lines += [f"(assert (or {' '.join(f'|{p} in {h}|' for h in holes)}))" for p in pigeons]
    lines += [f"(assert (not (and |{p} in {h}| |{q} in {h}|)))" for h in holes for p in pigeons for q in range(p)]
    told = SOLVERS[solver](
        "(set-logic QF_UF)(push 1)" + "".join(lines) + "(check-sat)(pop 1)(push 1)(assert false)(check-sat)(pop 1)", 1
    )
    assert [gave_up(one) for one in told] == [True, False]
    assert told[1] == "unsat"


def test_a_solver_that_cannot_read_a_file_says_so() -> None:
    for answers in SOLVERS.values():
        with pytest.raises(SolverError):
            answers("(assert nothing)", 1000)


RESERVED = (".p", "..", "true", "false", "not", "and", "or", "xor", "distinct", "ite", "as", "_", "=", "%2e.p", "let")


@pytest.mark.parametrize("name", RESERVED)
@pytest.mark.parametrize("solver", SOLVERS)
def test_names_that_smt_lib_reserves_are_spelled_so_that_solvers_take_them(solver: str, name: str) -> None:
    assert symbol(name) == f"|{spelled(name)}|"
    asked = f"(declare-const {symbol(name)} Bool)(assert (not {symbol(name)}))(check-sat)"
    assert SOLVERS[solver](f"(set-logic QF_UF){asked}", 1000) == ("sat",)
    asked = f"(declare-const {symbol(name)} Bool)(assert {symbol(name)})(check-sat)"
    assert SOLVERS[solver](f"(set-logic QF_UF){asked}", 1000) == ("sat",)
    assert len({*map(symbol, RESERVED)}) == len(RESERVED)


def test_an_unproved_bundle_is_refused_for_that() -> None:
    bundle = bundled("conceptual_one_robot")
    doubted = tuple(replace(v, status=Status.UNKNOWN) if v.name == "eq7.G1" else v for v in bundle.verdicts)
    with pytest.raises(InputError, match="F5002"):
        check_bundle(replace(bundle, verdicts=(*doubted, Verdict("x", Status.UNKNOWN, "x", "x"))))


@pytest.mark.usefixtures("remembering")
def test_a_vote_of_a_large_net_that_falls_is_shown() -> None:
    idle = tuple(Place(f"a.idle{i}", "a", marked=True) for i in range(TOKENS_MAX))
    marked = {"a.p": True, "a.q": False, "b.r": True, "b.s": False}
    places = (*(Place(name, name[0], marked=token) for name, token in marked.items()), *idle)
    transitions = (
        Transition("t", ("a.p", "b.r"), ("a.q", "b.s")),
        Transition("back", ("a.q", "b.s"), ("a.p", "b.r")),
        Transition("away", ("b.r",), ("b.s",), permissive=("a.p",)),
        Transition("home", ("b.s",), ("b.r",), permissive=("a.p",)),
    )
    bundle = make_bundle(check(Net("crowded", places, transitions, controllers=(Controller("a"), Controller("b")))))
    fallen = [v for v in bundle.verdicts if v.name.startswith("persistent.") and v.status is Status.VIOLATED]
    assert fallen
    assert not any(v.witness or v.subjects or v.hint for v in fallen)  # the run stands in the document
    assert all(one.shown for one in check_bundle(bundle))
