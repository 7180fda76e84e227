"""Whether claims suffice for a verdict: those that say less do not, and true ones never for its opposite."""

import random
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import pytest
from support.evidence_examples import LOOP, RACING, fires, in_order, net
from support.lively_nets import lively_net
from support.naive_space import NaiveSpace
from support.true_claims import true

from firable.analysis.check import check
from firable.analysis.evidence.certificate import FiringSequence, InductiveInvariant
from firable.analysis.evidence.checking.checker import check_document
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import FALSE, TRUE, Claim, ClaimKind, is_marking, tidy
from firable.analysis.evidence.document import document_from_text
from firable.analysis.evidence.meaning import (
    commands_clash,
    compete,
    competing,
    contact,
    never_beside,
    senders,
    some_firable,
    suffices,
)
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.report import report_on
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Constant, Deadlock, Firable, Formula, Holds, Not, Or, Start, parse_formula
from firable.nets.net import (
    Command,
    ExternalGate,
    Fairness,
    Net,
    Place,
    Property,
    PropertyKind,
    Signal,
    SignalKind,
    TemporalProperty,
    Transition,
)
from firable.nets.queries import Query, QueryKind, query_named
from firable.nets.temporal import Logic, format_temporal, parse_temporal
from firable.nets.verdict import Status
from firable.semantics.trace import Discipline

FIRES_ALL = fires(Constant(value=True), "t0", "t1")


def test_what_is_met_from_a_home_marking_is_always_possible_and_from_another_it_is_not() -> None:
    asked = Property("p", PropertyKind.ALWAYS_POSSIBLE, Firable("t0"))
    of = replace(net("ring", "a", ("a", "b"), ("b", "a")), properties=(asked,))
    home, start = tidy(is_marking(of, of.initial_marking)), Claim(ClaimKind.ALWAYS_POSSIBLE, Holds("a"))
    possible, later = Claim(ClaimKind.ALWAYS_POSSIBLE, home), Claim(ClaimKind.LATER, home, then=Firable("t0"))

    def enough(*claims: Claim) -> bool:
        return suffices(of, Discipline.INTERLEAVING, "property.p", True, claims, None)

    assert enough(possible, later)
    assert enough(Claim(ClaimKind.ALWAYS_POSSIBLE, Firable("t0")))
    for claims in (
        (possible,),
        (later,),
        (start, replace(later, goal=Holds("a"))),  # which is not one marking
        (possible, replace(later, goal=Holds("b"))),
        (possible, replace(later, then=Firable("t1"))),
        (Claim(ClaimKind.REACHABLE, home), later),
    ):
        assert not enough(*claims)


def test_what_holds_in_every_deadlock_is_always_possible_where_every_run_can_end() -> None:
    asked = Property("p", PropertyKind.ALWAYS_POSSIBLE, Holds("b"))
    of = replace(net("way", "a", ("a", "b")), properties=(asked,))
    ends = Claim(ClaimKind.ALWAYS_POSSIBLE, Deadlock())

    def always(text: str) -> Claim:
        return Claim(ClaimKind.CTL, parse_temporal(text))

    def enough(*claims: Claim) -> bool:
        return suffices(of, Discipline.INTERLEAVING, "property.p", True, claims, None)

    holds = always("AG (not deadlock or b)")
    assert enough(ends, holds)
    for claims in (
        (ends,),
        (holds,),
        (replace(ends, kind=ClaimKind.REACHABLE), holds),
        (replace(ends, goal=Holds("a")), holds),
        (ends, always("AG (not deadlock or a)")),
        (ends, always("AG (not deadlock or not b)")),
        (ends, always("AG (deadlock or b)")),
        (ends, always("EG (not deadlock or b)")),
        (ends, always("AF (not deadlock or b)")),
        (ends, replace(holds, kind=ClaimKind.LTL)),
    ):
        assert not enough(*claims)


@pytest.mark.parametrize(
    ("name", "proved", "claims"),
    [
        ("live", True, [fires(Start(), "t0", "t1")]),  # no home marking
        ("live", True, [Claim(ClaimKind.ALWAYS_POSSIBLE, Holds("a")), fires(Holds("a"), "t0", "t1")]),  # no marking
        ("live", True, [Claim(ClaimKind.ALWAYS_POSSIBLE, Firable("t0"))]),  # of one
        ("live", False, [Claim(ClaimKind.LOST, Holds("a"))]),
        ("quasi-live", True, [fires(Constant(value=True), "t0")]),
        ("quasi-live", False, [Claim(ClaimKind.LOST, Firable("t0"))]),
        ("deadlock-free", True, [FIRES_ALL]),
        ("deadlock-free", False, [Claim(ClaimKind.LOST, Deadlock())]),
        ("home-markings", False, [Claim(ClaimKind.LOST, Holds("a")), Claim(ClaimKind.LOST, Not(Holds("b")))]),
        ("home-markings", True, [Claim(ClaimKind.ALWAYS_POSSIBLE, Holds("a"))]),
        ("starvation", True, []),
        ("contact-free", True, [Claim(ClaimKind.NEVER, And((Holds("a"), Holds("z"))))]),
        ("effective-conflicts", False, [Claim(ClaimKind.REACHABLE, And((Firable("t0"), Firable("t1"))))]),
        (
            "effective-conflicts",
            False,
            [Claim(ClaimKind.REACHABLE, And((Firable("t0"), Firable("t0"))))],
        ),  # one of them
        ("query.q", True, [FIRES_ALL]),
        ("nonsense", True, [FIRES_ALL]),
    ],
)
def test_claims_that_say_less_do_not_suffice(name: str, proved: bool, claims: list[Claim]) -> None:
    of = net("less", "ab", ("a", "c"), ("b", "d"), ("c", "a"))
    assert not suffices(of, Discipline.INTERLEAVING, name, proved, claims, None)


def reachable(*goals: str) -> list[Claim]:
    return [Claim(ClaimKind.REACHABLE, parse_formula(goal)) for goal in goals]


def never(*goals: str) -> list[Claim]:
    return [Claim(ClaimKind.NEVER, parse_formula(goal)) for goal in goals]


def of_formula(kind: ClaimKind, text: str) -> Claim:
    return Claim(kind, parse_temporal(text))


HERE = net("here", "a", ("a", "b"), ("b", "a"), ("a", "a"))  # t2 puts what it takes, and never fires
QUERIES = {  # what suffices for a query, and what does not
    ("AG EF a", True): ([of_formula(ClaimKind.CTL, "AG EF a")], [of_formula(ClaimKind.CTL, "EF a"), *reachable("a")]),
    ("AG EF z", False): ([of_formula(ClaimKind.CTL, "not AG EF z")], [of_formula(ClaimKind.LTL, "G F z"), *never("z")]),
    ("ltl G F a", True): ([of_formula(ClaimKind.LTL, "G F a")], [of_formula(ClaimKind.CTL, "AG AF a")]),
    ("ltl G F a", False): ([of_formula(ClaimKind.NOT_LTL, "G F a")], [of_formula(ClaimKind.CTL, "EF AG not a")]),
    ("live", True): ([Claim(ClaimKind.LIVE)], [fires(TRUE, "t0", "t1", "t2"), *reachable("firable(t0)")]),
    ("live", False): (never("firable(t2)"), never("a and b")),
    ("quasi_live", True): ([fires(TRUE, "t0", "t1", "t2")], [fires(TRUE, "t0", "t1")]),
    ("quasi_live", False): (never("firable(t2)"), [Claim(ClaimKind.LOST, Firable("t2"))]),
    ("stable_marking", True): (never("z"), reachable("z")),
    ("stable_marking", False): (
        reachable("a", "not a", "b", "not b", "z", "not z"),
        reachable("a", "not a", "b", "not b", "not z"),
    ),
    ("bound tokens(a, b)", True): (
        [*reachable("tokens(a, b) >= 1"), *never("tokens(a, b) >= 2")],
        [*reachable("tokens(a, b) >= 1", "a"), *never("tokens(a, b, b) >= 2")],
    ),
    ("bound tokens(a, z)", True): (reachable("tokens(a, z) >= 2"), never("tokens(a, z) >= 2")),
    ("bound tokens(a)", True): (reachable("tokens(a) >= 1"), []),
    ("bound tokens(z)", True): (never("tokens(z) >= 1"), []),
}


@pytest.mark.parametrize(("text", "proved"), QUERIES)
def test_a_query_is_answered_by_claims_that_say_so_and_by_no_less(text: str, proved: bool) -> None:
    enough, less = QUERIES[text, proved]
    query = query_named(text, HERE, "q")
    asked = partial(suffices, HERE, Discipline.INTERLEAVING, "query.q", query=query)
    assert asked(proved=proved, claims=enough)
    assert not asked(proved=proved, claims=less)
    assert not asked(proved=not proved, claims=enough)


def test_whether_a_net_with_loops_is_safe_as_an_ordinary_one_is_shown_by_no_claim() -> None:
    query, loops = Query("q", QueryKind.ONE_SAFE), replace(HERE, transitions=HERE.transitions[2:])
    free = Claim(ClaimKind.NEVER, contact(loops, openable=True))
    for of, enough in ((replace(loops, transitions=()), True), (loops, False)):
        assert suffices(of, Discipline.INTERLEAVING, "query.q", True, [free], query) is enough


def test_a_home_marking_is_the_formula_of_all_places() -> None:
    home = Claim(ClaimKind.ALWAYS_POSSIBLE, is_marking(LOOP, LOOP.marking("b")))
    assert suffices(LOOP, Discipline.INTERLEAVING, "home-markings", proved=True, claims=[home], query=None)
    both = [home, fires(home.state_goal, "t0", "t1")]
    assert suffices(LOOP, Discipline.INTERLEAVING, "live", proved=True, claims=both, query=None)


def test_a_machine_is_stopped_by_another_command_in_the_same_run() -> None:
    places = (
        Place("a", marked=True),
        Place("b", command=Command("M", "RUN")),
        Place("c", command=Command("M", "STOP")),
    )
    of = Net("m", places, (Transition("go", ("a",), ("b",)), Transition("halt", ("b",), ("c",))))

    def enough(*claims: Claim) -> bool:
        return suffices(of, Discipline.INTERLEAVING, "machine-never-stopped", proved=True, claims=claims, query=None)

    anything = Constant(value=True)
    assert enough(in_order(anything, "go", "halt"))
    assert enough(in_order(anything, "halt", "go"))
    assert enough(fires(anything, "go"), in_order(anything, "go", "go", "halt"))
    assert not enough(fires(anything, "go", "halt"))  # in one step, it may be
    assert not enough(in_order(anything, "go", "go"))
    assert not enough(fires(anything, "go"), fires(anything, "halt"))
    assert not enough(fires(anything, "go"))


@pytest.mark.parametrize("discipline", list(Discipline))
def test_two_commands_sent_at_one_moment_do_not_follow_each_other(discipline: Discipline) -> None:
    places = (
        Place("a", marked=True),
        Place("b", command=Command("M", "RUN")),
        Place("c", command=Command("M", "STOP")),
    )
    of = Net("m", places, (Transition("both", ("a",), ("b", "c")),))
    claims = [fires(Start(), "both"), in_order(Start(), "both")]
    assert all(true(Evidence(of, discipline, claim, FiringSequence(()))) for claim in claims)
    assert not suffices(of, discipline, "machine-never-stopped", proved=True, claims=claims, query=None)
    again = [in_order(Start(), "both", "both")]
    assert suffices(of, discipline, "machine-never-stopped", proved=True, claims=again, query=None)


def test_of_single_firings_nobody_asks_whether_their_steps_have_an_order() -> None:
    ordered = [Claim(ClaimKind.ORDERED)]
    assert suffices(LOOP, Discipline.STEP, "steps-serialisable", proved=True, claims=ordered, query=None)
    assert not suffices(LOOP, Discipline.INTERLEAVING, "steps-serialisable", proved=True, claims=ordered, query=None)
    for of, read_off in ((LOOP, True), (RACING, False)):
        assert suffices(of, Discipline.STEP, "steps-serialisable", proved=True, claims=[], query=None) is read_off


def test_starvation_is_excluded_by_all_that_wait() -> None:
    of = net("waiting", "a", ("a", "b"), ("b", "a"), ("zb", "a"), ("zc", "a"))

    def enough(*names: str) -> bool:
        claims = [Claim(ClaimKind.NEVER, Firable(name)) for name in names]
        return suffices(of, Discipline.INTERLEAVING, "starvation", proved=True, claims=claims, query=None)

    assert enough("t2", "t3")
    assert not enough("t2")


def test_where_no_valuation_opens_two_ways_at_once_they_do_not_compete_and_nothing_is_said_of_starvation() -> None:
    def ways(*wanted: bool) -> Net:
        gated = (
            Transition(f"t{i}", ("a",), ("b",), external=(ExternalGate("s", one),)) for i, one in enumerate(wanted)
        )
        back = Transition("back", ("b",), ("a",))
        return Net("ways", (Place("a", marked=True), Place("b")), (*gated, back), (Signal("s"),))

    both = Claim(ClaimKind.REACHABLE, And((Firable("t0"), Firable("t1"))))
    live = Claim(ClaimKind.ALWAYS_POSSIBLE, Firable("t1"))
    for of, together in ((ways(True, True), True), (ways(True, False), False)):
        for name, claim in (("effective-conflicts", both), ("starvation", live)):
            assert suffices(of, Discipline.INTERLEAVING, name, False, [claim], None) is together, name


def _commanded(draw: random.Random) -> Net:
    """A lively net of which half the places send one of two commands to one of two machines."""
    of = lively_net(draw, most_places=8)

    def command() -> Command | None:
        return Command(draw.choice("mn"), draw.choice(["RUN", "STOP"])) if draw.random() < 0.5 else None

    return replace(of, places=tuple(replace(place, command=command()) for place in of.places))


def _claims(of: Net, space: NaiveSpace, draw: random.Random) -> Iterator[Claim]:
    """Whatever a verdict of the net may come down to, true or not."""
    names = [t.name for t in of.transitions]
    everywhere: list[Formula] = [Deadlock(), Start(), *map(Firable, names)]
    sent = [some_firable(sending) for commands in senders(of).values() for sending in commands.values()]
    goals: list[Formula] = [contact(of), commands_clash(of), competing(of) or Deadlock(), *sent]
    for kind in (ClaimKind.NEVER, ClaimKind.REACHABLE):
        yield from (Claim(kind, goal) for goal in everywhere + goals)
    for kind in (ClaimKind.ALWAYS_POSSIBLE, ClaimKind.LOST):
        yield from (Claim(kind, goal) for goal in everywhere)
    homes = [tidy(is_marking(of, marking)) for marking in sorted(space.graph)[:4]]
    yield from (Claim(ClaimKind.ALWAYS_POSSIBLE, goal) for goal in homes)
    yield from map(Claim, (ClaimKind.LIVE, ClaimKind.HOME, ClaimKind.ORDERED, ClaimKind.UNORDERED))
    for goal in (Start(), *homes):
        some = draw.sample(names, min(len(names), 2))
        yield fires(goal, *some)
        yield in_order(goal, *some)
        yield in_order(goal, some[0], some[0])


@pytest.mark.parametrize("discipline", list(Discipline))
def test_true_claims_never_suffice_for_the_opposite_of_a_verdict(discipline: Discipline) -> None:
    judged = 0
    for seed in range(40):
        draw = random.Random(seed)
        of = _commanded(draw)
        space = NaiveSpace(of, discipline)
        if len(space.graph) > 40:
            continue  # the oracle goes through everything for each claim
        known = [c for c in _claims(of, space, draw) if true(Evidence(of, discipline, c, FiringSequence(())))]
        for verdict in report_on(space).verdicts:
            if verdict.status is not Status.UNKNOWN:
                judged += 1
                opposite = verdict.status is not Status.PROVED
                assert not suffices(of, discipline, verdict.name, opposite, known, None), f"{seed}: {verdict.name}"
    assert judged > 200


def test_only_runs_from_the_start_or_from_home_show_that_a_transition_fires() -> None:
    net = catalogue_net("conceptual_one_robot")
    every = [t.name for t in net.transitions]

    def enough(*claims: Claim) -> bool:
        return suffices(net, Discipline.INTERLEAVING, "quasi-live", True, claims, None)

    assert enough(fires(TRUE, *every))
    assert not enough(fires(Start(), *every))
    assert enough(fires(Start(), *every), Claim(ClaimKind.ALWAYS_POSSIBLE, Start()))


def test_a_transition_that_never_opens_is_in_contact_and_puts_no_second_token() -> None:
    never = (ExternalGate("s"), ExternalGate("s", wanted=False))
    places = (Place("a", marked=True), Place("b", marked=True))
    of = Net("shut", places, (Transition("t", ("a",), ("b",), external=never),), (Signal("s"),))
    met, query = Claim(ClaimKind.REACHABLE, parse_formula("a and b")), Query("q", QueryKind.ONE_SAFE)

    def enough(name: str, proved: bool, *claims: Claim) -> bool:
        return suffices(of, Discipline.INTERLEAVING, name, proved, claims, query)

    assert enough("contact-free", False, met)
    assert not enough("contact-free", True)
    assert enough("query.q", True)
    assert not enough("query.q", False, met)


@pytest.mark.parametrize("moves", [("ax", "ay", "az"), ("xa", "ya", "za")])
def test_too_many_pairs_to_list_are_shown_by_no_claim(moves: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    of = net("many", "", *((move[0], move[1]) for move in moves))

    def enough() -> bool:
        goal = tidy(Or(tuple(And((Firable(f"t{i}"), Firable(f"t{k}"))) for i, k in pairs)))
        claims = [Claim(ClaimKind.NEVER, goal)]
        return suffices(of, Discipline.INTERLEAVING, "effective-conflicts", True, claims, None)

    pairs = [(0, 1), (0, 2), (1, 2)]
    assert enough()
    monkeypatch.setattr("firable.semantics.conflict.PAIRS_MAX", 2)
    pairs = pairs[:2]
    assert not enough()


def test_what_needs_nothing_to_show_it_stands_in_no_record() -> None:
    net = replace(catalogue_net("conceptual_one_robot"), properties=(Property("no", PropertyKind.NEVER, FALSE),))
    document = evidence_of_report(check(net))
    (record,) = (one for one in document.records if one.name == "property.no")
    assert record.shown == ()
    (shown,) = (one for one in check_document(document) if one.record.name == "property.no")
    assert shown.shown
    never = Claim(ClaimKind.NEVER, FALSE)
    idle = replace(record, shown=((never, InductiveInvariant()),))
    with pytest.raises(InputError, match="needs nothing to show it"):
        document_from_text(replace(document, records=(idle,)).to_text())


def test_a_machine_is_never_stopped_where_no_run_sends_another_command_before_or_after() -> None:
    places = (
        Place("a", marked=True),
        Place("b", command=Command("M", "RUN")),
        Place("c", command=Command("M", "STOP")),
    )
    go, halt = Transition("go", ("a",), ("b",)), Transition("halt", ("a",), ("c",))
    either = Net("either", places, (go, halt))
    beside = Claim(ClaimKind.LTL, never_beside(("go",), ("halt",)))
    sent = fires(TRUE, "go")

    def enough(*claims: Claim) -> bool:
        return suffices(either, Discipline.INTERLEAVING, "machine-never-stopped", False, claims, None)

    assert enough(sent, beside)
    assert not enough(sent)
    assert not enough(beside)
    for text in ("G (not fires(go) or X G not fires(halt))", "G (not fires(halt) or X G not fires(go))"):
        assert not enough(sent, Claim(ClaimKind.LTL, parse_temporal(text)))
    evidence = Evidence(either, Discipline.INTERLEAVING, beside, FiringSequence(()))
    assert true(evidence)
    again = Transition("again", ("b",), ("a",))
    assert not true(replace(evidence, net=Net("again", places, (go, halt, again))))
    found = evidence_of_report(check(either))
    (shown,) = (one for one in check_document(found) if one.record.name == "machine-never-stopped")
    assert not shown.record.proved
    assert shown.shown


def machine(name: str, *transitions: Transition) -> Net:
    """Two places that command one machine, and one that does not."""
    go, stop = (Place(word.lower(), command=Command("A", word)) for word in ("GO", "STOP"))
    return Net(name, (Place("idle", marked=True), go, stop), transitions)


TOGETHER = machine("together", Transition("both", (), ("go", "stop")), Transition("clear", ("go", "stop")))
APART = machine(
    "apart", Transition("t1", (), ("go",)), Transition("t2", ("go",)), Transition("t5", ("idle",), ("stop",))
)


@pytest.mark.parametrize("discipline", list(Discipline))
@pytest.mark.parametrize("of", [TOGETHER, APART])
def test_one_run_that_shows_both_commands_to_be_followed_is_claimed_once(of: Net, discipline: Discipline) -> None:
    found = evidence_of_report(check(of, discipline))
    assert document_from_text(found.to_text()) == found
    (shown,) = (one for one in check_document(found) if one.record.name == "machine-never-stopped")
    assert shown.record.proved
    assert shown.shown


def test_two_places_that_wait_for_one_signal_share_a_completion() -> None:
    ended = (ExternalGate("done"),)
    ways = (Transition("t", ("a",), ("x",), external=ended), Transition("u", ("b",), ("y",), external=ended))
    waiting = tuple(Place(name, command=Command("m", "run"), completion="done") for name in "ab")
    places = (*waiting, Place("x"), Place("y"))
    of = Net("shared", places, ways, (Signal("done", kind=SignalKind.COMPLETION),))
    once = replace(of, places=(places[0], Place("b"), *places[2:]))
    asked = partial(suffices, name="shared-completions", query=None, discipline=Discipline.INTERLEAVING)
    assert not asked(of, proved=True, claims=[])
    assert not asked(of, proved=True, claims=never("a"))
    assert asked(of, proved=True, claims=never("a and b"))
    assert asked(of, proved=False, claims=reachable("a and b"))
    assert asked(once, proved=True, claims=[])


AT_A, AT_B = (tidy(is_marking(LOOP, LOOP.marking(name))) for name in "ab")
ASKED = replace(
    LOOP,
    properties=(
        Property("answered", PropertyKind.LEADS_TO, Holds("a"), Holds("b")),
        Property("possible", PropertyKind.ALWAYS_POSSIBLE, Holds("b")),
        Property("never", PropertyKind.NEVER, Holds("z")),
        Property("always", PropertyKind.ALWAYS, Holds("a")),
        Property("reachable", PropertyKind.REACHABLE, Holds("b")),
        TemporalProperty("linear", Logic.LTL, parse_temporal("G F a")),
        TemporalProperty("branching", Logic.CTL, parse_temporal("AG AF a")),
    ),
)
ANSWERED = Claim(ClaimKind.LEADS_TO, Holds("a"), Holds("b"), Fairness.WEAK)
SAID = {  # of each property what says that it holds, and that it is violated
    "answered": (ANSWERED, replace(ANSWERED, kind=ClaimKind.NOT_LEADS_TO)),
    "possible": (Claim(ClaimKind.ALWAYS_POSSIBLE, Holds("b")), Claim(ClaimKind.LOST, Holds("b"))),
    "never": (*never("z"), *reachable("z")),
    "always": (*never("not a"), *reachable("not a")),
    "reachable": (*reachable("b"), *never("b")),
    "linear": (of_formula(ClaimKind.LTL, "G F a"), of_formula(ClaimKind.NOT_LTL, "G F a")),
    "branching": (of_formula(ClaimKind.CTL, "AG AF a"), of_formula(ClaimKind.CTL, "not AG AF a")),
}


def test_a_property_holds_or_is_violated_by_the_claim_that_says_so_and_by_no_other() -> None:
    claims = [(name, proved, both[not proved]) for name, both in SAID.items() for proved in (True, False)]
    claims.append(("", True, replace(ANSWERED, then=Constant(value=False))))
    claims.append(("", False, replace(ANSWERED, kind=ClaimKind.NOT_LEADS_TO, then=Constant(value=False))))
    claims.append(("", True, replace(ANSWERED, fairness=Fairness.STRONG)))
    for name in SAID:
        for proved in (True, False):
            enough = {
                (of, said)
                for of, said, claim in claims
                if suffices(ASKED, Discipline.INTERLEAVING, f"property.{name}", proved, [claim], None)
            }
            assert enough == {(name, proved)}
    assert not suffices(ASKED, Discipline.INTERLEAVING, "property.other", True, [c for _, _, c in claims], None)


@pytest.mark.parametrize(
    ("name", "proved", "claim"),
    [
        ("home-markings", True, Claim(ClaimKind.HOME)),
        ("home-markings", True, Claim(ClaimKind.ALWAYS_POSSIBLE, Start())),
        ("quasi-live", True, Claim(ClaimKind.LIVE)),
        ("quasi-live", True, in_order(TRUE, "t0", "t1")),
        ("live", True, Claim(ClaimKind.LIVE)),
        ("deadlock-free", True, Claim(ClaimKind.LIVE)),
        ("deadlock-free", True, Claim(ClaimKind.ALWAYS_POSSIBLE, Firable("t0"))),
        ("doomed-markings", True, Claim(ClaimKind.NEVER, Deadlock())),
    ],
)
def test_one_claim_suffices(name: str, proved: bool, claim: Claim) -> None:
    assert suffices(LOOP, Discipline.INTERLEAVING, name, proved, [claim], None)
    assert not suffices(LOOP, Discipline.INTERLEAVING, name, not proved, [claim], None)
    assert not suffices(LOOP, Discipline.INTERLEAVING, name, proved, [], None)


def test_each_transition_is_shown_to_fire_in_a_way_of_its_own() -> None:
    of, home = replace(LOOP, transitions=(*LOOP.transitions, Transition("t2", ("a",), ("z",)))), Start()
    ways = [*reachable("firable(t2)"), Claim(ClaimKind.ALWAYS_POSSIBLE, home), fires(home, "t0"), fires(TRUE, "t1")]
    assert suffices(of, Discipline.INTERLEAVING, "quasi-live", True, ways, None)
    for left_out in (0, 2, 3):
        less = [claim for i, claim in enumerate(ways) if i != left_out]
        assert not suffices(of, Discipline.INTERLEAVING, "quasi-live", True, less, None)


def test_steps_of_races_have_an_order_where_a_claim_says_so() -> None:
    asked = partial(suffices, RACING, Discipline.STEP, "steps-serialisable", query=None)
    ordered, unordered = Claim(ClaimKind.ORDERED), Claim(ClaimKind.UNORDERED)
    assert asked(proved=True, claims=[ordered])
    assert asked(proved=False, claims=[unordered])
    assert not asked(proved=True, claims=[unordered])
    assert not asked(proved=False, claims=[ordered])


def test_two_transitions_compete_for_an_input_or_for_an_output() -> None:
    of = net("shared", "a", ("a", "b"), ("b", "c"), ("a", "c"), ("c", "a"))
    pairs = {frozenset((t.name, u.name)) for t in of.transitions for u in of.transitions if compete(of, t.name, u.name)}
    assert pairs == {frozenset(("t0", "t2")), frozenset(("t1", "t2"))}


def test_a_command_that_is_never_sent_needs_no_other_after_it() -> None:
    places = (Place("a", marked=True), *(Place(name, command=Command("M", name)) for name in "bcd"))
    ways = (Transition("go", ("a",), ("b",)), Transition("halt", ("b",), ("c",)), Transition("off", ("d",), ("d",)))
    of = Net("m", places, (*ways, Transition("late", ("b", "c"), ("d",))))
    asked = partial(suffices, of, Discipline.INTERLEAVING, "machine-never-stopped", proved=True, query=None)
    assert asked(claims=[in_order(TRUE, "go", "halt"), *never("firable(off) or firable(late)")])
    assert not asked(claims=[in_order(TRUE, "go", "halt"), *never("firable(off)")])
    assert not asked(claims=[in_order(TRUE, "go", "halt")])
    assert not asked(claims=never("firable(off) or firable(late)"))


@pytest.mark.parametrize(
    ("name", "proved", "claims"),
    [
        # These fire nothing, and meet nothing: no kind of claim but theirs speaks of what is beside the goal.
        ("quasi-live", True, [Claim(ClaimKind.REACHABLE, TRUE, fires=("t0", "t1"))]),
        ("live", True, [Claim(ClaimKind.ALWAYS_POSSIBLE, AT_B, fires=("t0", "t1"))]),
        (
            "property.possible",
            True,
            [Claim(ClaimKind.ALWAYS_POSSIBLE, AT_A), Claim(ClaimKind.REACHABLE, AT_A, then=Holds("b"))],
        ),
        ("home-markings", False, reachable("a", "not a")),
        ("starvation", False, []),  # nobody waits
        ("property.answered", True, [Claim(ClaimKind.NOT_LEADS_TO, Holds("a"), Holds("b"))]),
        ("property.answered", False, [ANSWERED]),
        ("property.other", True, [ANSWERED]),
        ("property.other", False, []),
        ("property.", True, []),
        ("answered", True, [ANSWERED]),
    ],
)
def test_claims_of_something_else_do_not_suffice(name: str, proved: bool, claims: list[Claim]) -> None:
    assert not suffices(ASKED, Discipline.INTERLEAVING, name, proved, claims, None)


def test_a_net_without_transitions_has_a_deadlock() -> None:
    still = Net("still", (Place("a", marked=True),), ())
    asked = partial(suffices, still, Discipline.INTERLEAVING, "deadlock-free", query=None)
    assert not asked(proved=True, claims=[])
    assert asked(proved=False, claims=reachable("deadlock"))


def test_a_net_is_one_safe_where_no_openable_transition_is_in_contact() -> None:
    query, both = Query("q", QueryKind.ONE_SAFE), (ExternalGate("s", wanted=True), ExternalGate("s", wanted=False))
    of = Net(
        "touching",
        (Place("a", marked=True), Place("b", marked=True), Place("c")),
        (Transition("t", ("a",), ("b",)), Transition("shut", ("c",), ("a",), external=both)),
        (Signal("s"),),
    )
    asked = partial(suffices, of, Discipline.INTERLEAVING, "query.q", query=query)
    assert not asked(proved=True, claims=[])
    assert not asked(proved=True, claims=never("a and c"))
    assert asked(proved=True, claims=never("a and b"))
    assert asked(proved=False, claims=reachable("a and b"))


def test_each_of_those_that_send_a_command_is_beside_none_that_sends_another() -> None:
    one, other = "(fires(t) or fires(v))", "(fires(u) or fires(w))"
    asked = format_temporal(never_beside(("t", "v"), ("u", "w")))
    assert asked == f"G (not {one} or X G not {other}) and G (not {other} or X G not {one})"
    assert never_beside(("t",), ()) == never_beside((), ("u",)) == TRUE
