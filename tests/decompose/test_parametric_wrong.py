"""The proof is about something: every action can happen, every demand is needed, every wrong protocol is refuted."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from support.examples import some

from firable.analysis.induction.smt import Answer
from firable.decompose.proofs.script import Reader
from firable.decompose.protocol.parametric.invariant import INVARIANT, Conjunct
from firable.decompose.protocol.parametric.logic import both
from firable.decompose.protocol.parametric.proving import start
from firable.decompose.protocol.parametric.runs import central_marking, find_run, steps_of
from firable.decompose.protocol.parametric.script import Action, Demand
from firable.decompose.protocol.parametric.side_conditions import CONDITIONS
from firable.decompose.protocol.parametric.system import PROTOCOL, Protocol
from firable.decompose.protocol.parametric.theorem import parametric_obligations
from firable.decompose.protocol.parametric.wrong import WRONG, Wrong, refute

# --- Nothing is proved of nothing


def test_every_action_can_happen_with_two_rounds_open() -> None:
    steps = steps_of(
        "ask r1 G; ask r2 H; promise r1 G a; promise r2 H a; promise r1 G b; promise r2 H b; hear r1 G a; fire l;"
        "hear r1 G b; decide r1 G; apply r1 G a; hear r2 H a; apply r1 G b; note r1 G a; note r1 G b; close r1;"
        "forget r1 a; give-up r2; release r2 H a; ask r3 H; restart k1; release r3 H b; sense s1;"
        "ask r4 F; stand F a; stand F b; decide r4 F; sense-late r4 F s2; apply-free r4 F a; apply-free r4 F b"
    )
    assert {name for name, _ in steps} == {action.name for action in PROTOCOL.actions}
    run = find_run(PROTOCOL, steps, 6, both([]))
    assert run is not None
    assert run.course[:2] == ("l", "G")
    assert run.course[-1] == "F"
    assert set(central_marking(run) or ()) == set(run.local) == set(run.central)


@pytest.mark.parametrize("name", [obligation.name for obligation in parametric_obligations()])
def test_what_an_obligation_is_given_is_possible(name: str) -> None:
    block = next(o.block for o in parametric_obligations() if o.name == name)
    given, denied, _ = block.partition("; and what is to be shown does not hold\n")
    assert denied
    assert small().answer(given + "(check-sat)\n(pop 1)\n") is Answer.SAT


# --- Every demand is needed


def without(action: Action, demand: Demand) -> Protocol:
    changed = replace(action, demands=tuple(other for other in action.demands if other is not demand))
    return replace(PROTOCOL, actions=tuple(changed if other is action else other for other in PROTOCOL.actions))


def small(protocol: Protocol = PROTOCOL, conjuncts: Sequence[Conjunct] = INVARIANT) -> Reader:
    """z3, told of three places and two things of each other sort at most; what is possible there is possible."""
    told = start(protocol, conjuncts)
    for sort, n in (("Place", 3), ("Transition", 2), ("Controller", 2), ("Round", 2), ("Coordinator", 2)):
        names = [f"some-{sort}-{i}" for i in range(n)]
        told += "".join(f"(declare-const {name} {sort})\n" for name in names)
        told += f"(assert (forall ((x {sort})) (or {' '.join(f'(= x {name})' for name in names)})))\n"
    return Reader(20_000, told)


def fails(protocol: Protocol, names: tuple[str, ...]) -> bool:
    """Whether an obligation of these names is refuted."""
    reader = small(protocol)
    chosen = (o for o in parametric_obligations(protocol) if o.name in names)
    return any(reader.answer(o.block) is Answer.SAT for o in chosen)


@pytest.mark.seeds
@pytest.mark.parametrize(
    ("action", "demand"),
    some(
        (
            pytest.param(action, demand, id=f"{action.name}-{demand.words}")
            for action in PROTOCOL.actions
            for demand in action.demands
            if demand.words != "it is a signal"  # the proof would hold for whatever else the cell may change
        ),
        1,
    ),
)
def test_no_demand_can_be_left_out(action: Action, demand: Demand) -> None:
    assert fails(without(action, demand), (f"keeps.{action.name}", f"follows.{action.name}"))


@pytest.mark.parametrize("words", [words for words, _ in PROTOCOL.static])
def test_no_assumption_on_the_net_can_be_left_out(words: str) -> None:
    changed = replace(PROTOCOL, static=tuple(its for its in PROTOCOL.static if its[0] != words))
    assert fails(
        changed, ("follows.decide", "follows.fire", "complete.fire", "keeps.decide", "keeps.fire", "keeps.sense")
    )


@pytest.mark.seeds
@pytest.mark.parametrize(
    ("action", "changes"),
    some(
        (
            (a.name, up.relation.name)
            for a in PROTOCOL.actions
            for up in a.updates
            if a.name not in {"forget", "sense-late"}
        ),
        1,
    ),
)
def test_no_change_can_be_left_out(action: str, changes: str) -> None:
    its = PROTOCOL.action(action)
    changed = replace(its, updates=tuple(up for up in its.updates if up.relation.name != changes))
    protocol = replace(PROTOCOL, actions=tuple(changed if a is its else a for a in PROTOCOL.actions))
    assert fails(protocol, (f"keeps.{action}", f"home.{action}", f"complete.{action}"))


@pytest.mark.seeds
@pytest.mark.parametrize("conjunct", some(INVARIANT, 1), ids=lambda conjunct: conjunct.name)
def test_no_conjunct_can_be_left_out(conjunct: Conjunct) -> None:
    kept = tuple(other for other in INVARIANT if other is not conjunct)
    reader = small(PROTOCOL, kept)
    assert any(reader.answer(o.block) is Answer.SAT for o in parametric_obligations(PROTOCOL, kept))


# --- Wrong protocols


@pytest.mark.parametrize("wrong", WRONG, ids=[wrong.name for wrong in WRONG])
def test_wrong_protocol_is_refuted_by_a_run_that_the_reference_player_confirms(wrong: Wrong) -> None:
    found = refute(wrong)
    assert found is not None
    assert len(found.run.events) == len(steps_of(wrong.run))


@pytest.mark.parametrize("wrong", WRONG, ids=[wrong.name for wrong in WRONG])
def test_wrong_protocol_breaks_the_proof(wrong: Wrong) -> None:
    assert wrong.breaks
    assert all(fails(wrong.protocol, (name,)) for name in wrong.breaks)


@pytest.mark.parametrize(
    "wrong",
    [w for w in WRONG if len(w.protocol.actions) == len(PROTOCOL.actions) and "earlier" not in w.words],
    ids=lambda wrong: wrong.name,
)
def test_right_protocol_has_no_such_run(wrong: Wrong) -> None:
    if all(len(names) == len(PROTOCOL.action(name).parameters) for name, names in steps_of(wrong.run)):
        assert find_run(PROTOCOL, steps_of(wrong.run), wrong.places, wrong.goal, wrong.given) is None


def test_every_obligation_is_forgotten_by_some_wrong_protocol() -> None:
    forgotten = {name for wrong in WRONG for name in wrong.forgets.split(", ")}
    assert forgotten == {"O1", "O2", "O3", "O4", "O5", "O6", "O8", "Eq. (5)", "free"}


PLACE = r"'[abc]\.p[1-9]'"
# Which places they are is the solver's choice.
ENDS = {
    "filled-outputs-not-looked-at": f"the central net cannot fire 'G' then: {PLACE} is full",
    "given-up-after-the-commit": f"the controllers hold a token on {PLACE}, and the central net does not"
    f"|the central net holds a token on {PLACE}, and the controllers do not",
    "late-requests-promise": "every round is closed, and a promise still stands, which nobody will release",
}


@pytest.mark.parametrize("name", ENDS)
def test_end_of_a_run_says_what_is_wrong(name: str) -> None:
    found = refute(next(wrong for wrong in WRONG if wrong.name == name))
    assert found is not None
    assert re.fullmatch(ENDS[name], found.end)


def test_run_reads_as_a_story() -> None:
    wrong = next(wrong for wrong in WRONG if wrong.name == "votes-from-before-the-decision")
    found = refute(wrong)
    assert found is not None
    assert found.end.startswith("the central net cannot fire 'G' then: 'a.")
    assert found.run.events == (
        "the coordinator asks for 'G' in round 1",
        "'a' promises 'G' in round 1, and votes yes",
        "the coordinator gives round 1 up",
        "the abort of 'G' in round 1 arrives at 'a'",
        "the local transition 'l' fires",
        "the coordinator asks for 'G' in round 2",
        "'b' promises 'G' in round 2, and votes yes",
        "the vote of 'a' for 'G' in round 2 arrives",
        "the vote of 'b' for 'G' in round 2 arrives",
        "the coordinator decides 'G' in round 2: it fires",
    )


def test_document_lists_every_action_conjunct_condition_and_wrong_protocol() -> None:
    text = (Path(__file__).parents[2] / "docs" / "protocol-invariant.md").read_text("utf-8")
    rows = {tuple(cell.strip() for cell in line.strip("|").split("|")) for line in text.splitlines() if line[:1] == "|"}
    assert {(conjunct.name, conjunct.words) for conjunct in INVARIANT} <= rows
    assert {(f"protocol.side.{name}", says) for name, says, _ in CONDITIONS} <= rows
    assert {(wrong.name, wrong.forgets, wrong.words) for wrong in WRONG} <= rows
    actions = {" ".join([a.name, *(parameter.name for parameter in a.parameters)]) for a in PROTOCOL.actions}
    assert actions <= {row[0] for row in rows}
    families = {o.name.partition(".")[0] for o in parametric_obligations()}
    assert families <= {family for row in rows for family in row[0].split(", ")}
    assert f"{len(list(parametric_obligations()))} obligations" in text
