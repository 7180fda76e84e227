"""Each condition of the checker is needed: a false claim for each, whose evidence breaks this one alone."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from support.evidence import document
from support.evidence_examples import (
    CHOICE,
    CIRCUIT,
    ENDING,
    LOOP,
    RACING,
    SOMETIMES,
    TRAPPED,
    TURNS,
    fires,
    in_order,
    net,
    widened,
)
from support.true_claims import true

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import (
    Back,
    Certificate,
    Clause,
    Continuation,
    Diagram,
    Equation,
    FiringSequence,
    InductiveInvariant,
    Label,
    Labelling,
    Markings,
    Progress,
    Ranks,
    Root,
    Rounds,
    Theorem,
    TheoremName,
    Unfolded,
    Whole,
)
from firable.analysis.evidence.checking.checker import check_document, check_evidence
from firable.analysis.evidence.checking.nodes import EMPTY, UNIT, Nodes
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import document_from_text
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Constant, Holds, Not, Start, parse_formula
from firable.nets.net import ExternalGate, Fairness, Net, Place, Signal, Transition
from firable.nets.temporal import parse_temporal
from firable.semantics.trace import Discipline

FORK = net("fork", "a", ("a", "b"), ("a", "c"))
BACKWARDS = net("backwards", "b", ("b", "a"))
OVER = net("over", "a", ("b", "a"))
HALF_LIVE = net("half", "a", ("a", "b"), ("b", "a"), ("a", "c"))


def listed(of: Net, text: str, markings: list[str], *ranks: int) -> Evidence:
    space = Markings(tuple(map(of.marking, markings)))
    labels: tuple[Label, ...] = (Ranks(ranks),) if ranks else ()
    return Evidence(of, Discipline.INTERLEAVING, Claim(ClaimKind.CTL, parse_temporal(text)), Labelling(space, labels))


def of_loop(label: Label, text: str, rows: str = "ab", of: Net = LOOP) -> Evidence:
    """On a diagram of the markings with one token each, in order of the net's places; the second root is M0 alone."""
    order = tuple(place.name for place in of.places)
    cells, whole = list[tuple[int, int, int]](), 0
    for name in sorted(rows):
        cells.append((order.index(name) + 1, whole, 1))
        whole = len(cells) + 1
    cells.append((order.index("a") + 1, 0, 1))
    space = Diagram(order, tuple(cells), (whole, len(cells) + 1))
    return Evidence(of, Discipline.INTERLEAVING, Claim(ClaimKind.CTL, parse_temporal(text)), Labelling(space, (label,)))


def never(of: Net, goal: str, space: Markings | Diagram) -> Evidence:
    return Evidence(of, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, parse_formula(goal)), Labelling(space))


LABELS: dict[str, Callable[[], Evidence]] = {
    "M0 is left out": lambda: never(ENDING, "a", Markings((ENDING.marking("b"),))),
    "M0 is left out after all others": lambda: never(BACKWARDS, "b", Markings((BACKWARDS.marking("a"),))),
    "a firing leads out": lambda: never(LOOP, "b", Markings((LOOP.marking("a"),))),
    "the goal is inside": lambda: never(LOOP, "b", Markings((1, 2))),
    "nearer is what has no rank": lambda: listed(LOOP, "EF z", ["a", "b"], 1, -1),
    "the rank stays": lambda: listed(LOOP, "EF z", ["a", "b"], 1, 1),
    "the end does not hold": lambda: listed(LOOP, "EF z", ["a", "b"], 0, 0),
    "the way is not through": lambda: listed(LOOP, "E[z U b]", ["a", "b"], 1, 0),
    "one next marking has no rank": lambda: listed(FORK, "AF b", ["a", "b", "c"], 1, 0, -1),
    "until every next ends in a deadlock": lambda: listed(ENDING, "AF (a and b)", ["a", "b"], 2, 1),
    "a deadlock has a rank": lambda: listed(ENDING, "AF (a and b)", ["a", "b", "ab"], 2, 1, 0),
    "a deadlock is not the end": lambda: listed(ENDING, "AF (a and b)", ["a", "b"], 1, 0),
    "it ends with the next": lambda: listed(LOOP, "EG a", ["a", "b"], 0, -1),
    "it does not hold throughout": lambda: listed(LOOP, "EG a", ["a", "b"], 0, 0),
    "always is left": lambda: listed(LOOP, "AG a", ["a", "b"], 0, -1),
    "another one than M0 has a rank": lambda: listed(ENDING, "EG b", ["a", "b"], -1, 0),
    "M0 has no rank": lambda: listed(LOOP, "EF z", ["a", "b"], -1, -1),
    "nothing is next": lambda: listed(OVER, "EX a", ["a"]),
    "one of two is not next": lambda: listed(LOOP, "EX b and EX z", ["a", "b"]),
    "who would fire is never opened": lambda: listed(SHUT, "EF b", ["a", "b"], 1, 0),
    "one way goes round before the end": lambda: listed(HALF_LIVE, "AF c", ["a", "b", "c"], 1, 2, 0),
    "always is left on the first way": lambda: listed(FORK, "AG not b", ["a", "b", "c"], 0, -1, 0),
    "always is left on the last way": lambda: listed(FORK, "AG not c", ["a", "b", "c"], 0, 0, -1),
    "the first next does not hold": lambda: listed(FORK, "AX c", ["a", "b", "c"]),
    "the last next does not hold": lambda: listed(FORK, "AX b", ["a", "b", "c"]),
    "a label too few": lambda: listed(LOOP, "EF z", ["a", "b"]),
    "a rank too few": lambda: listed(LOOP, "EF z", ["a", "b"], 0),
    "a diagram leaves M0 out": lambda: of_loop(Whole(), "AG b", "b", ENDING),
    "nothing is said of M0": lambda: never(ENDING, "a", Diagram(("a", "b"), ((2, 0, 1),), (2,))),
    "a diagram's row holds nothing": lambda: never(
        LOOP, "b or z", Diagram(("a", "z", "b"), ((1, 0, 1), (3, 1, 0), (3, 2, 3)), (4,))
    ),
    "a diagram is left": lambda: of_loop(Whole(), "AG a", "a"),
    "a diagram's whole does not hold": lambda: of_loop(Whole(), "AG a"),
    "a diagram's part is left": lambda: of_loop(Root(1), "EG a"),
    "a diagram's part does not hold": lambda: of_loop(Root(0), "EG a"),
    "going back not through": lambda: of_loop(Back(("t0",)), "E[z U b]"),
    "going back too little": lambda: of_loop(Back(("t1",)), "EF z"),
    "rounds not through": lambda: of_loop(Rounds(2), "A[z U b]"),
    "rounds out of a deadlock": lambda: of_loop(Rounds(3), "AF (a and b)", of=ENDING),
    "ranks on a diagram": lambda: of_loop(Ranks((0, 0)), "EF z"),
    "going back on every way": lambda: of_loop(Back(("t0",)), "AF z"),
}


@pytest.mark.parametrize("name", LABELS)
def test_a_large_set_is_refused_for_the_same_reasons(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(LABELS[name]())


@pytest.mark.parametrize("rank", [2, 2**63, 2**64, 10**30])
def test_a_rank_beyond_the_number_of_markings_is_refused(rank: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(listed(LOOP, "EF z", ["a", "b"], rank, rank - 1))
    with pytest.raises(InputError, match="no rank is as large as the number of markings"):
        check_evidence(listed(LOOP, "EF b", ["a", "b"], rank, 0))


@pytest.mark.parametrize("place", [0, 7, 8, 15, 16, 19])
def test_a_large_set_is_looked_through_to_its_end(place: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    monkeypatch.setattr("firable.analysis.evidence.checking.closed._CHUNK", 8)
    letters = "abcdefghijklmnopqrst"
    of = net("round", "a", *zip(letters, letters[1:] + "a", strict=True))
    space = Markings(tuple(1 << i for i in range(20)))
    assert check_evidence(never(of, f"{letters[place]} and {letters[place - 1]}", space)).shown
    with pytest.raises(InputError, match="holds in a marking of the set"):
        check_evidence(never(of, letters[place], space))


@pytest.mark.parametrize("markings", [(2, 1), (1, 1, 2)])
def test_a_large_set_is_in_order_each_marking_once(markings: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    with pytest.raises(InputError, match="not in order, each once"):
        check_evidence(never(LOOP, "a and b", Markings(markings)))


@pytest.mark.parametrize(
    ("space", "reason"),
    [
        (Markings((1, 2, 3)), "leads out of the set"),
        (Diagram(("a", "b"), ((1, 0, 1), (1, 1, 1), (2, 2, 3)), (4,)), "under interleaving only"),
    ],
)
def test_a_large_set_shows_nothing_of_steps_that_lead_out_of_it(
    space: Markings | Diagram, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    evidence = never(RACING, "not a and not b", space)
    assert check_evidence(evidence).shown
    with pytest.raises(InputError, match=reason):
        check_evidence(replace(evidence, discipline=Discipline.STEP))


def test_a_set_that_shows_what_is_after_a_run_is_looked_at_again_for_what_is_before_it() -> None:
    space = Labelling(Markings((ENDING.marking("b"),)))
    after = Evidence(
        ENDING, Discipline.INTERLEAVING, Claim(ClaimKind.LOST, Holds("a")), Continuation((("end",),), space)
    )
    before = replace(after, claim=Claim(ClaimKind.NEVER, Holds("a")), certificate=space)
    assert check_evidence(after).shown
    with pytest.raises(InputError, match="the initial marking is not in the set"):
        list(check_document(document(after, before)))


class Same:
    """Keys that are all the same: no firing of a loop changes the hash."""

    def __init__(self, n_places: int) -> None:
        self.n_places = n_places

    def integers(self, *_: object, dtype: type) -> object:
        return np.ones(self.n_places, dtype=dtype)


def test_a_marking_is_not_taken_for_another_one_with_the_same_hash(monkeypatch: pytest.MonkeyPatch) -> None:
    of = widened(LOOP)
    marking, after = of.initial_marking, of.initial_marking ^ of.marking(("a", "b"))
    evidence = [never(of, "a and b", Markings(markings)) for markings in [(marking, after), (marking,)]]
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    assert check_evidence(evidence[0]).shown
    monkeypatch.setattr(np.random, "default_rng", lambda _: Same(len(of.places)))
    with pytest.raises(InputError, match="leads out of the set"):
        check_evidence(evidence[1])


def test_two_markings_with_one_hash_get_others(monkeypatch: pytest.MonkeyPatch) -> None:
    of, drawn = widened(LOOP), np.random.default_rng
    begun: list[int] = []

    def first_the_same(seed: int) -> object:
        begun.append(seed)
        return drawn(seed) if seed else Same(len(of.places))

    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    monkeypatch.setattr(np.random, "default_rng", first_the_same)
    both = of.initial_marking, of.initial_marking ^ of.marking(("a", "b"))
    assert check_evidence(never(of, "a and b", Markings(both))).shown
    assert begun == [0, 1]


@pytest.mark.parametrize("edges_max", [100_000, 0])
@pytest.mark.parametrize(
    "evidence",
    [
        listed(ENDING, "EG (a or b)", ["a", "b"], 0, 0),  # a run ends well
        listed(ENDING, "AG (a or b)", ["a", "b"], 0, 0),
        listed(ENDING, "not E[not a U b]", ["a", "b"], 0, -1),  # an always that is over
        listed(ENDING, "not A[not a U b]", ["a", "b"], 0, -1),
        listed(LOOP, "EX b and AX b", ["a", "b"]),
        listed(LOOP, "EX b or EX z", ["a", "b"]),
        listed(OVER, "AX b", ["a"]),
        listed(FORK, "EX b", ["a", "b", "c"]),
        listed(FORK, "EF b", ["a", "b", "c"], 1, 0, -1),
    ],
    ids=str,
)
def test_labels_that_say_what_is_true_show_it(
    edges_max: int, evidence: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", edges_max)
    assert check_evidence(evidence).shown


def test_a_large_set_that_is_closed_is_shown_in_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    found = check_evidence(never(LOOP, "a and b", Markings((1, 2))))
    assert found.shown
    assert found.method == "2 markings and 2 firings looked through in columns"


def waits(of: Net, fairness: Fairness, ranks: Mapping[str, tuple[int, ...]], **helpful: str) -> Evidence:
    """Ranks of the markings with one of the first places, by its letter, and asked; with `done` none has one."""
    letters = [place.name for place in of.places if len(place.name) == 1]
    markings = [of.marking((letter, word)) for word in ("asked", "done") for letter in letters]
    of_each = tuple(ranks.get(letter, ()) for letter in letters) + ((),) * len(letters)
    helping = tuple(((int(key[1:]),), name) for key, name in helpful.items())
    claim = Claim(ClaimKind.LEADS_TO, Holds("asked"), Holds("done"), fairness)
    return Evidence(of, Discipline.INTERLEAVING, claim, Progress(Markings(tuple(markings)), of_each, helping))


ALL = {"a": (0,), "b": (0,)}
STUCK = Net(
    "stuck",
    (*SOMETIMES.places, Place("off")),
    (*SOMETIMES.transitions[:2], Transition("go", ("asked", "off"), ("done",))),
)
ROUND = Net(  # `go` is enabled in the first two of four markings, `on` in the others
    "round",
    (Place("a", marked=True), *map(Place, "bcd"), Place("asked", marked=True), Place("done")),
    (
        *(Transition(f"t{i}", (x,), (y,)) for i, (x, y) in enumerate(zip("abcd", "bcda", strict=True))),
        Transition("go", ("asked",), ("done",), inhibitive=("c", "d")),
        Transition("on", ("asked",), ("done",), inhibitive=("a", "b")),
    ),
)
RESPONSES: dict[str, Callable[[], Evidence]] = {
    "what is asked has no rank": lambda: waits(TURNS, Fairness.NONE, {}),
    "nothing helps without fairness": lambda: waits(TURNS, Fairness.NONE, ALL, r0="go"),
    "nobody helps": lambda: waits(TURNS, Fairness.NONE, ALL),
    "nothing helps all the time": lambda: waits(SOMETIMES, Fairness.WEAK, ALL),
    "the rank goes up": lambda: waits(SOMETIMES, Fairness.NONE, {"a": (0,), "b": (1,)}),
    "the rank goes up where somebody helps": lambda: waits(
        ROUND, Fairness.WEAK, {"a": (0,), "b": (0,), "c": (1,), "d": (1,)}, r0="go", r1="on"
    ),
    "it is not always enabled": lambda: waits(SOMETIMES, Fairness.WEAK, ALL, r0="now"),
    "the rank goes up and down": lambda: waits(SOMETIMES, Fairness.WEAK, {"a": (0,), "b": (1,)}, r0="tick", r1="now"),
    "who helps fires and stays": lambda: waits(STUCK, Fairness.STRONG, ALL, r0="tick"),
    "it is never enabled": lambda: waits(STUCK, Fairness.STRONG, ALL, r0="go"),
    "the next has no rank": lambda: waits(SOMETIMES, Fairness.WEAK, {"a": (0,)}, r0="tick"),
    "ranks too few": lambda: Evidence(
        ENDING,
        Discipline.INTERLEAVING,
        Claim(ClaimKind.LEADS_TO, Holds("a"), Constant(value=False)),
        Progress(Markings((1, 2)), ((1,),)),
    ),
    "the wait ends in a deadlock": lambda: Evidence(
        ENDING,
        Discipline.INTERLEAVING,
        Claim(ClaimKind.LEADS_TO, Holds("a"), Constant(value=False)),
        Progress(Markings((1, 2)), ((1,), (0,))),
    ),
}


def run(
    of: Net, claim: Claim, firings: str, cycle: str = "", discipline: Discipline = Discipline.INTERLEAVING
) -> Evidence:
    parts = [tuple((name,) for name in names.split()) for names in (firings, cycle)]
    return Evidence(of, discipline, claim, FiringSequence(*parts))


def of_all_runs(of: Net, text: str) -> Evidence:
    claim = Claim(ClaimKind.LTL, parse_temporal(text))
    return Evidence(of, Discipline.INTERLEAVING, claim, Unfolded(Markings((1, 2))))


def by_clauses(of: Net, goal: str, *clauses: Clause) -> Evidence:
    claim = Claim(ClaimKind.NEVER, Holds(goal))
    return Evidence(of, Discipline.INTERLEAVING, claim, InductiveInvariant(clauses=clauses))


def refuted(text: str) -> Claim:
    return Claim(ClaimKind.NOT_LTL, parse_temporal(text))


LATE = net("late", "a", ("a", "b"), ("b", "c"), ("c", "b"))


def unanswered(of: Net, fairness: Fairness, firings: str, cycle: str = "") -> Evidence:
    return run(of, Claim(ClaimKind.NOT_LEADS_TO, Holds("asked"), Holds("done"), fairness), firings, cycle)


_BOTH = (ExternalGate("s", wanted=True), ExternalGate("s", wanted=False))
SHUT: Net = Net(
    "shut",
    (Place("a", marked=True), Place("b")),
    (Transition("t0", ("a",), ("b",), external=_BOTH), Transition("t1", ("b",), ("a",))),
    (Signal("s"),),
)
RUNS: dict[str, Callable[[], Evidence]] = {
    "the cycle does not close": lambda: run(ENDING, refuted("F b"), "", "end"),
    "the run could go on": lambda: run(ENDING, refuted("F b"), ""),
    "the run satisfies it": lambda: run(LOOP, refuted("X b"), "", "t0 t1"),
    "not both hold": lambda: run(LOOP, refuted("not (a and X a)"), "", "t0 t1"),
    "one of both holds": lambda: run(LOOP, refuted("a or X a"), "", "t0 t1"),
    "until it ends it does not hold": lambda: run(LOOP, refuted("not (z U b)"), "", "t0 t1"),
    "it never ends": lambda: run(LOOP, refuted("not (a or b) U z or G (a or b)"), "", "t0 t1"),
    "after the cycle comes its first": lambda: run(LOOP, refuted("X X a"), "", "t0 t1"),
    "the answer comes in the cycle": lambda: unanswered(TURNS, Fairness.STRONG, "", "go again"),
    "the answer comes before it is asked again": lambda: unanswered(TURNS, Fairness.WEAK, "go", "tick again tock go"),
    "after the last comes the first of the cycle": lambda: run(LATE, refuted("X X X b"), "t0", "t1 t2"),
    "different things are put off": lambda: of_all_runs(LOOP, "F G a or F G b"),
    "nothing was asked": lambda: run(LOOP, Claim(ClaimKind.NOT_LEADS_TO, Holds("z"), Holds("z")), "", "t0 t1"),
    "the cycle is not weakly fair": lambda: unanswered(TURNS, Fairness.WEAK, "", "tick tock"),
    "the cycle is not strongly fair": lambda: unanswered(SOMETIMES, Fairness.STRONG, "", "tick tock"),
    "the goal is not met": lambda: run(LOOP, Claim(ClaimKind.REACHABLE, Holds("z")), "t0"),
    "it fires without the goal": lambda: run(LOOP, fires(Holds("z"), "t0"), "t0"),
    "later it does not hold": lambda: run(ENDING, Claim(ClaimKind.LATER, Holds("b"), Holds("a")), "end"),
    "it fires before the goal only": lambda: run(ENDING, fires(Holds("b"), "end"), "end"),
    "it does not fire": lambda: run(net("still", "a", ("z", "b")), fires(Holds("a"), "t0"), ""),
    "it fires in another order": lambda: run(HALF_LIVE, in_order(Start(), "t2", "t0"), "t0 t1 t2"),
    "it fires in order before the goal": lambda: run(ENDING, in_order(Holds("b"), "end"), "end"),
    "it fires once": lambda: run(ENDING, in_order(Start(), "end", "end"), "end"),
    "two fire at once": lambda: Evidence(
        RACING,
        Discipline.INTERLEAVING,
        Claim(ClaimKind.REACHABLE, parse_formula("not a and not b")),
        FiringSequence((("t", "u"),)),
    ),
    "it is never opened": lambda: run(SHUT, Claim(ClaimKind.REACHABLE, Holds("b")), "t0"),
    "a step leaves out what fires with it": lambda: run(
        CIRCUIT, Claim(ClaimKind.REACHABLE, parse_formula("a and d")), "go one", discipline=Discipline.STEP
    ),
    "one step has no order": lambda: Evidence(
        RACING, Discipline.STEP, in_order(Start(), "t", "u"), FiringSequence((("t", "u"),))
    ),
    "the step has an order": lambda: run(CIRCUIT, Claim(ClaimKind.UNORDERED), "go", discipline=Discipline.STEP),
    "the steps have no order": lambda: Evidence(
        RACING, Discipline.STEP, Claim(ClaimKind.ORDERED), Labelling(Markings((3, 0)))
    ),
    "a run refutes it": lambda: of_all_runs(LOOP, "F z"),
    "a run that ends refutes it": lambda: of_all_runs(ENDING, "F (a and b)"),
    "a run that fires nothing else refutes it": lambda: of_all_runs(LOOP, "not G (a or not fires(t0))"),
    "`start` means M0": lambda: Evidence(
        ENDING,
        Discipline.INTERLEAVING,
        Claim(ClaimKind.LOST, Not(Start())),
        Continuation((("end",),), Labelling(Markings((2,)))),
    ),
    "from there the goal is met": lambda: Evidence(
        LOOP,
        Discipline.INTERLEAVING,
        Claim(ClaimKind.LOST, Not(Start())),
        Continuation((("t0",), ("t1",)), Labelling(Markings((1, 2)))),
    ),
    "it takes more firings than are looked at": lambda: replace(
        by_clauses(LATE, "c"), certificate=InductiveInvariant((Equation((("a", 1), ("b", 1), ("c", 1)), 1),), depth=1)
    ),
    "nothing is initial": lambda: by_clauses(LOOP, "a", Clause(empty=("a",)), Clause(empty=("b",))),
    "nothing is kept": lambda: by_clauses(LOOP, "b", Clause(marked=("a",)), Clause(empty=("b",))),
}


ONE_TOKEN = InductiveInvariant((Equation((("a", 1), ("b", 1), ("c", 1)), 1),))
UNMARKED = net("unmarked", "", ("a", "b"), ("b", "a"))
RING = net("ring", "a", ("a", "b"), ("b", "a"))
DRAWN = net("drawn", "a", ("a", "b"), ("b", "a"), ("a", "a"))
# b and d exclude each other, each entered only beside the other's first place, so that `both` is dead.
APART = Net(
    "apart",
    (Place("a", marked=True), Place("b"), Place("c", marked=True), Place("d")),
    (
        Transition("t0", ("a",), ("b",), ("c",)),
        Transition("t1", ("b",), ("a",)),
        Transition("t2", ("c",), ("d",), ("a",)),
        Transition("t3", ("d",), ("c",)),
        Transition("both", (), (), ("b", "d")),
    ),
)
# From p one thing goes on at once, and the other one waits; only in the beginning both wait.
MIXED = net("mixed", "ac", ("p", "ay"), ("p", "cx"), ("a", "x"), ("c", "y"), ("xy", "p"))
GATED = Net(
    "gated",
    (Place("a", marked=True), Place("b"), Place("g", marked=True)),
    (Transition("t0", ("a",), ("b",), inhibitive=("g",)), Transition("t1", ("b",), ("a",))),
)
HALTED = net("halted", "a", ("a", "b"), ("bd", "ace"), ("ce", "d"))  # d would have to come before it can come
HALF_DONE = InductiveInvariant(
    (Equation((("a", 1), ("b", 1)), 1), Equation((("c", 1), ("d", 1)), 0), Equation((("d", 1), ("e", 1)), 0))
)
READ = Net("read", SHUT.places, (Transition("t0", ("a",), ("b",), ("a",)),))
ONE_OF_TWO = InductiveInvariant((Equation((("a", 1), ("b", 1)), 1),))
NO_CONTACT = InductiveInvariant((Equation((("a", 1), ("b", 1)), 1), Equation((("c", 1), ("d", 1)), 1)))


def theorem(
    of: Net, name: TheoremName, contact: InductiveInvariant, *traps: str, claim: Claim | None = None
) -> Evidence:
    certificate = Theorem(name, contact, tuple(map(tuple, traps)))
    return Evidence(of, Discipline.INTERLEAVING, claim or Claim(ClaimKind.LIVE), certificate)


HOME_AGAIN = Claim(ClaimKind.ALWAYS_POSSIBLE, Start())
NO_TOKEN = InductiveInvariant(clauses=(Clause(empty=("a",)), Clause(empty=("b",))))
EACH_ONCE = InductiveInvariant(tuple(Equation(tuple((name, 1) for name in names), 1) for names in ("apx", "cpy")))
THEOREMS: dict[str, Callable[[], Evidence]] = {
    "a circuit without a token": lambda: theorem(UNMARKED, TheoremName.MARKED_GRAPH, NO_TOKEN),
    "a marked graph with an end": lambda: theorem(ENDING, TheoremName.MARKED_GRAPH, ONE_OF_TWO),
    "a circuit that two tokens are waited for in": lambda: theorem(HALTED, TheoremName.MARKED_GRAPH, HALF_DONE),
    "no marked graph": lambda: theorem(HALF_LIVE, TheoremName.MARKED_GRAPH, ONE_TOKEN),
    "no trap in a siphon": lambda: theorem(HALF_LIVE, TheoremName.FREE_CHOICE, ONE_TOKEN, "abc"),
    "no traps at all": lambda: theorem(HALF_LIVE, TheoremName.FREE_CHOICE, ONE_TOKEN),
    "a trap that is none": lambda: theorem(HALF_LIVE, TheoremName.FREE_CHOICE, ONE_TOKEN, "ab"),
    "a trap of what is read and taken": lambda: theorem(READ, TheoremName.FREE_CHOICE, ONE_OF_TWO, "a"),
    "a trap without a token": lambda: theorem(UNMARKED, TheoremName.FREE_CHOICE, NO_TOKEN, "ab"),
    "an empty trap": lambda: theorem(MIXED, TheoremName.FREE_CHOICE, EACH_ONCE, "apx", "cpy", claim=HOME_AGAIN),
    "not free choice": lambda: theorem(APART, TheoremName.FREE_CHOICE, NO_CONTACT, "ab", "cd"),
    "not asymmetric choice": lambda: theorem(APART, TheoremName.ASYMMETRIC_CHOICE, NO_CONTACT, "ab", "cd"),
    "a transition that puts what it takes": lambda: theorem(DRAWN, TheoremName.FREE_CHOICE, ONE_OF_TWO, "ab"),
    "another kind of claim": lambda: theorem(
        RING, TheoremName.MARKED_GRAPH, ONE_OF_TWO, claim=Claim(ClaimKind.NEVER, Holds("b"))
    ),
    "another marking than M0": lambda: theorem(
        RING,
        TheoremName.MARKED_GRAPH,
        ONE_OF_TWO,
        claim=Claim(ClaimKind.ALWAYS_POSSIBLE, And((Holds("a"), Holds("b")))),
    ),
    "a transition that never opens": lambda: theorem(SHUT, TheoremName.MARKED_GRAPH, ONE_OF_TWO),
    "gates": lambda: theorem(GATED, TheoremName.MARKED_GRAPH, ONE_OF_TWO),
    "contact": lambda: theorem(TRAPPED, TheoremName.FREE_CHOICE, InductiveInvariant(), "abc"),
}


FALSE = {**LABELS, **RESPONSES, **RUNS, **THEOREMS}


def refused(evidence: Evidence) -> bool:
    try:
        return check_evidence(evidence).shown is not True
    except InputError as error:
        return {found.code for found in error.diagnostics} == {"F6002"}


@pytest.mark.parametrize("broken", FALSE)
def test_a_false_claim_is_refused_by_the_one_condition_that_its_evidence_breaks(broken: str) -> None:
    evidence = FALSE[broken]()
    assert not true(evidence)
    assert refused(evidence)


def test_the_same_conditions_are_met_by_true_claims() -> None:
    for evidence in (
        listed(LOOP, "EF b", ["a", "b"], 1, 0),
        listed(LOOP, "EG not z", ["a", "b"], 0, 0),
        listed(ENDING, "AF b", ["a", "b"], 1, 0),
        of_loop(Back(("t0",)), "EF b"),
        of_loop(Rounds(1), "AF b"),
        of_loop(Root(0), "EG not z"),
        waits(TURNS, Fairness.WEAK, ALL, r0="go"),
        waits(TURNS, Fairness.STRONG, ALL, r0="go"),
        theorem(CHOICE, TheoremName.FREE_CHOICE, ONE_TOKEN, "abc"),
        run(TURNS, fires(Holds("b"), "tock"), "tick tock"),
        run(TURNS, in_order(Holds("b"), "tock", "tick"), "tick tock tick"),
        run(HALF_LIVE, in_order(Start(), "t0", "t2"), "t0 t1 t2"),
    ):
        assert true(evidence)
        assert not refused(evidence)


STEPS_IN_ORDER = Labelling(Markings(tuple(CIRCUIT.marking(names) for names in ("ac", "bd"))))


@pytest.mark.parametrize(
    ("of", "claim", "right", "wrong"),
    [
        (RACING, ClaimKind.UNORDERED, FiringSequence((("t", "u"),)), FiringSequence((("t", "u"),), (("t",),))),
        (RACING, ClaimKind.UNORDERED, FiringSequence((("t", "u"),)), FiringSequence((("t", "u", "u"),))),
        (CIRCUIT, ClaimKind.ORDERED, STEPS_IN_ORDER, replace(STEPS_IN_ORDER, labels=(Whole(),))),
    ],
)
def test_what_nobody_would_look_at_is_refused(
    of: Net, claim: ClaimKind, right: Certificate, wrong: Certificate
) -> None:
    evidence = Evidence(of, Discipline.STEP, Claim(claim), right)
    assert not refused(evidence)
    assert refused(replace(evidence, certificate=wrong))


@pytest.mark.parametrize(
    ("kind", "goal", "certificate"),
    [
        (ClaimKind.NOT_LTL, "G not {}", FiringSequence((), (("go",), ("one", "two")))),
        (ClaimKind.LTL, "F {}", Unfolded(Markings(tuple(CIRCUIT.marking(names) for names in ("ac", "bd"))))),
    ],
)
def test_of_steps_nothing_is_said_of_one_firing(kind: ClaimKind, goal: str, certificate: Certificate) -> None:
    said, unsaid = (Claim(kind, parse_temporal(goal.format(atom))) for atom in ("b", "fires(one)"))
    assert not refused(Evidence(CIRCUIT, Discipline.STEP, said, certificate))
    with pytest.raises(InputError, match="a step holds several"):
        check_evidence(Evidence(CIRCUIT, Discipline.STEP, unsaid, certificate))


def test_two_helpers_in_one_rank_are_refused() -> None:
    evidence = waits(TURNS, Fairness.WEAK, ALL, r0="go")
    assert isinstance(evidence.certificate, Progress)
    helpful = (*evidence.certificate.helpful, ((0,), "tick"))
    doubled: Certificate = Progress(evidence.certificate.space, evidence.certificate.ranks, helpful)
    text = document(Evidence(TURNS, Discipline.INTERLEAVING, evidence.claim, doubled)).to_text()
    with pytest.raises(InputError, match="F6001"):
        document_from_text(text)


def test_a_theorem_of_asymmetric_choice_says_nothing_of_home_markings() -> None:
    evidence = theorem(CHOICE, TheoremName.ASYMMETRIC_CHOICE, ONE_TOKEN, "abc")
    assert not refused(evidence)
    assert refused(replace(evidence, claim=HOME_AGAIN))


def test_a_theorem_says_nothing_of_steps() -> None:
    evidence = theorem(CHOICE, TheoremName.FREE_CHOICE, ONE_TOKEN, "abc")
    assert not refused(evidence)
    assert refused(replace(evidence, discipline=Discipline.STEP))


def test_what_was_not_included_once_is_not_included_afterwards() -> None:
    nodes = Nodes()
    p, q = nodes.node(1, EMPTY, UNIT), nodes.node(2, EMPTY, UNIT)
    both = nodes.either(p, q)
    assert [nodes.includes(p, both) for _ in range(3)] == [False, False, False]
    assert nodes.includes(both, p)


def test_what_was_not_gone_through_in_time_is_not_included_afterwards() -> None:
    nodes, depth = Nodes(Deadline.after(0)), 5_000  # deeper than a look at the clock
    all_subsets, without_first = nodes.node(1, UNIT, UNIT), UNIT
    for level in range(2, depth):
        all_subsets = nodes.node(level, all_subsets, all_subsets)
        without_first = nodes.node(level, without_first, without_first)
    with pytest.raises(TimeIsOverError):
        nodes.includes(without_first, all_subsets)
    nodes.deadline = NEVER
    assert not nodes.includes(without_first, all_subsets)
    assert nodes.includes(all_subsets, without_first)
