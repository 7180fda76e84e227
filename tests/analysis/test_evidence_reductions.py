"""The checker takes no step of a reduction that loses the goal, and nothing false is said of what is left."""

import random
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import pytest
from support.evidence import document
from support.evidence_examples import ENDING, EXAMPLES, reduced
from support.examples import seeds
from support.reduction_forging import drawn_net, drawn_steps, met, reached, taken
from support.small_text import net_of
from support.stubborn_forging import goal_of
from support.true_claims import true

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import (
    Clause,
    Diagram,
    Equation,
    InductiveInvariant,
    Inequality,
    Labelling,
    Markings,
    Ranks,
    Reduction,
    Rule,
    Step,
    StubbornSets,
)
from firable.analysis.evidence.checking.checker import check_document, check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.checking.reductions import Draft
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.producing.lacking import LackingError
from firable.analysis.evidence.producing.reductions import reduction
from firable.analysis.evidence.refusal import TimeIsOverError, refuse
from firable.analysis.goal import Limits
from firable.nets.catalogue.families import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Deadlock, Firable, Holds, parse_formula
from firable.nets.net import Net, Place, Transition
from firable.semantics.trace import Discipline

STEPS_MAX = 10


@pytest.mark.seeds
def test_no_step_that_is_taken_loses_the_goal_or_adds_a_marking() -> None:
    taken_of = dict.fromkeys(Rule, 0)
    for seed in seeds(30):
        draw = random.Random(seed)
        net = drawn_net(draw)
        goal = Deadlock() if len(net.places) < 5 or draw.random() < 0.3 else goal_of(draw, net)
        draft = Draft(net, goal, NEVER)
        before = reached(draft)
        for _ in range(STEPS_MAX):
            step, then = next(
                ((step, then) for step in drawn_steps(draw, draft) if (then := taken(draft, step)) is not None),
                (None, None),
            )
            if step is None or then is None:
                break
            taken_of[step.rule] += 1
            now, kept = reached(then), frozenset(then.values)
            assert now <= {marking & kept for marking in before}, (seed, step)
            assert met(then, now) or not met(draft, before), (seed, step)
            if step.rule is Rule.FACTS and (facts := then.facts) is not None:
                for literals in ([(p, p in marking) for p in kept] for marking in now):
                    assert not any(facts.exclude(*pair) for pair in combinations(literals, 2)), seed
            draft, before = then, now
            if draft.deadlock and draft.never_dead:
                break
    assert all(taken_of.values()), taken_of


def steps(*texts: str) -> tuple[Step, ...]:
    """Steps such as `copy p q` or `subsumed 1 0`: a rule, and the moves and places it names."""
    found = []
    for text in texts:
        rule, *named = text.split()
        moves = tuple(int(name) for name in named if name.isdigit())
        found.append(Step(Rule(rule), moves, tuple(name for name in named if not name.isdigit())))
    return tuple(found)


_LATE = ("h: a -> p", "f: p -> b if k", "m: c -> d if a", "n: d -> c if a")
WRONG: dict[str, tuple[Net, str, tuple[str, ...]]] = {
    "a constant changes": (net_of("a", "t: a -> b"), "b", ("constant b",)),
    "what is wanted is irrelevant": (net_of("a", "t: a -> b"), "b", ("irrelevant 0",)),
    "what is needed is irrelevant": (net_of("a", "t: a -> b", "u: b -> c"), "c", ("irrelevant 0",)),
    "nothing is irrelevant to a deadlock": (net_of("a b", "t: a -> ", "u: b -> "), "deadlock", ("irrelevant 0",)),
    "the goal speaks of what no move needs": (net_of("a z", "t: a -> b"), "z", ("unneeded z",)),
    "a move needs the place": (net_of("a", "t: a -> b", "u: b -> c"), "c", ("unneeded b",)),
    "copies are not flipped together": (net_of("a", "t: a -> b, c", "u: b -> "), "c and not b", ("copy b c",)),
    "copies are flipped by a move that reads the other": (
        net_of("a", "t: a -> b, c", "u: b -> if c"),
        "c and not b",
        ("copy b c",),
    ),
    "copies are read by a move that flips the other": (
        net_of("a", "t: a -> b, c", "u: c -> if b"),
        "b and not c",
        ("copy b c",),
    ),
    "who subsumes does something else": (net_of("a", "t: a -> b", "u: a -> c"), "c", ("subsumed 1 0",)),
    "who subsumes does more": (net_of("a c", "t: a, c -> b", "u: a -> b if c"), "b and c", ("subsumed 1 0",)),
    "who subsumes takes less": (net_of("a b", "t: a -> ", "u: a, b -> "), "not a and not b", ("subsumed 1 0",)),
    "who subsumes needs more": (net_of("a", "t: a -> b", "u: a -> b if k"), "b", ("subsumed 0 1",)),
    "early is not possible yet": (net_of("a", "t: a -> b", "u: b -> c"), "a and not b", ("early 1",)),
    "early takes what another needs": (net_of("a", "t: a -> b", "u: a -> c"), "c", ("early 0",)),
    "early takes what is wanted": (net_of("a", "t: a -> b"), "a", ("early 0",)),
    "early brings what is wanted not to be": (net_of("a", "t: a -> b"), "not b", ("early 0",)),
    "early may be too late for a deadlock": (
        net_of("a r e", "t: a -> b if r", "u: r -> c", "x: e -> f if b", "y: f -> e if b"),
        "deadlock",
        ("early 0",),
    ),
    "no fact makes it dead": (net_of("a b", "t: a, b -> c"), "c", ("facts", "dead 0")),
    "no fact implies the gate": (net_of("a", "t: a -> b", "u: b -> c if a"), "b", ("facts", "gate 1 a")),
    "what a move flips is no gate": (net_of("a x", "t: a, x -> c"), "c", ("facts", "gate 0 a")),
    "no fact implies the place": (net_of("a", "t: a -> b", "u: b -> c"), "c", ("facts", "implied b")),
    "the goal speaks of an implied place": (net_of("a", "t: a -> b, c"), "c", ("facts", "implied c")),
    "it cannot always be made": (net_of("a", "t: a -> b"), "deadlock", ("always 0",)),
    "what changes nothing cannot always be made": (net_of("a", "t: -> if a", "u: a -> "), "deadlock", ("always 0",)),
    "the goal speaks of the place around which it is composed": (
        net_of("a", "h: a -> p", "f: p -> b"),
        "p",
        ("facts", "closers-early p"),
    ),
    "there is no closer": (net_of("a", "h: a -> p", "g: -> c"), "c and not a", ("facts", "closers-early p")),
    "a place is read": (net_of("a", "h: a -> p", "f: p -> b", "r: -> c if p"), "c", ("facts", "openers-late p")),
    "a closer waits for something": (
        net_of("a", "h: a -> p", "f: p -> b if k", "u: -> k unless a", "v: k -> "),
        "b and k",
        ("facts", "closers-early p"),
    ),
    "a closer waits for something that stands before it": (
        net_of("a", "u: -> k unless a", "v: k -> ", "h: a -> p", "f: p -> b if k"),
        "b and k",
        ("facts", "closers-early p"),
    ),
    "an early closer takes what another needs": (
        net_of("a s x", "h: a -> p, q", "f: p, q, x -> y", "u: s -> g if x, q"),
        "g",
        ("facts", "closers-early p"),
    ),
    "an early closer takes what is wanted": (
        net_of("a x", "h: a -> p", "f: p, x -> y"),
        "x and not a",
        ("facts", "closers-early p"),
    ),
    "a late opener brings what another needs": (
        net_of("a", "h: a -> p, x", "f: p -> b if g", "u: -> g if x"),
        "b",
        ("facts", "openers-late p"),
    ),
    "a late opener brings what is wanted": (
        net_of("a", "h: a -> p, x", "f: p -> b if k"),
        "x",
        ("facts", "openers-late p"),
    ),
    "a late opener finds changed what it reads": (
        net_of("a y", "h: a -> p if y", "f: p -> b if z", "u: y -> z"),
        "b",
        ("facts", "openers-late p"),
    ),
    "a late opener finds changed what it reads, of several places": (
        net_of("a x y", "h: a -> p if y", "f: p -> b if z", "u: y -> z", "v: x -> "),
        "b",
        ("facts", "openers-late p"),
    ),
    "a late opener has competitors in a deadlock": (net_of("a c", *_LATE), "deadlock", ("facts", "openers-late p")),
    "a late opener takes what a deadlock is to lack": (
        net_of("a", "h: a -> p", "f: p -> b if k"),
        "deadlock and not a",
        ("facts", "openers-late p"),
    ),
    "another late opener serves the closer in a deadlock": (
        net_of("a c", "h: a -> p", "i: c -> p", "f: p -> b if a"),
        "deadlock and not b",
        ("facts", "openers-late p"),
    ),
}
"""Nets that meet a goal, and steps of which the last would lose it, or add markings by which a later one might."""


def after(net: Net, goal: str, *texts: str) -> Draft:
    draft = Draft(net, parse_formula(goal), NEVER)
    for step in steps(*texts):
        draft.apply(step)
    return draft


@pytest.mark.parametrize("name", WRONG)
def test_a_step_is_refused_whose_condition_does_not_hold(name: str) -> None:
    net, goal, texts = WRONG[name]
    before = after(net, goal, *texts[:-1])
    assert met(before, reached(before))
    with pytest.raises(InputError, match=f"the rule '{texts[-1].split()[0]}' cannot be applied"):
        after(net, goal, *texts)


@pytest.mark.parametrize(
    "text", ["copy a", "copy a a", "copy a z", "subsumed 0", "dead 0 0", "dead 7", "facts a", "early 0 a", "always 1 0"]
)
def test_a_step_names_what_its_rule_is_about_and_what_is_there(text: str) -> None:
    with pytest.raises(InputError, match="cannot be applied"):
        after(net_of("a", "t: a -> b", "u: b -> a", "v: -> z"), "b", "constant", "unneeded", text.replace("z", "a"))


# Two rings side by side; in the second c and d are never both full.
RINGS = net_of("a c", "t: a -> b", "u: b -> a", "v: c -> d", "w: d -> c")
LEFT = Reduction((), ("c", "d"), parse_formula("c and d"), Labelling(Markings((0b01, 0b10))))


def of_rings(certificate: Reduction, goal: str = "a and c and d", net: Net = RINGS) -> Evidence:
    return Evidence(net, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, parse_formula(goal)), certificate)


def test_one_part_shows_what_the_whole_never_meets() -> None:
    assert check_evidence(of_rings(LEFT)).shown


SUM = InductiveInvariant((Equation((("c", 1), ("d", 1)), 1),))
FALSE: dict[str, Callable[[], Evidence]] = {
    "the part does not ask for what the net does": lambda: of_rings(LEFT, "a and c"),
    "the goal of the part is wrong": lambda: of_rings(replace(LEFT, goal=parse_formula("not c and not d")), "a and c"),
    "the goal is not false": lambda: of_rings(Reduction(()), "a"),
    "there is a deadlock": lambda: of_rings(Reduction(()), "deadlock", net_of("a", "t: a -> b")),
    "something always fires, and a deadlock is not asked for": lambda: of_rings(
        Reduction(steps("always 0")), "b", net_of("a", "t: -> ", "u: a -> b")
    ),
    "the part is not apart": lambda: of_rings(
        replace(LEFT, part=("c",), goal=parse_formula("not c"), then=Labelling(Markings((1,)))), "not c"
    ),
    "a copy of a copy": lambda: of_rings(
        Reduction(steps("copy a b", "copy b c"), ("c", "k"), parse_formula("not c"), Labelling(Markings((0b01,)))),
        "a",
        net_of("a c", "t: a, c -> b if k"),
    ),
    "the sets have markings of a larger net": lambda: of_rings(
        replace(LEFT, then=StubbornSets(Markings((0b01, 0b10, 0b100)), (0b11,), (0, 0, 0)))
    ),
    "the part is gone": lambda: of_rings(replace(LEFT, steps=steps("copy d c")), "a and c and d"),
    "the markings are of a larger net": lambda: of_rings(replace(LEFT, then=Labelling(Markings((0b01, 0b10, 0b100))))),
    "the goal speaks of places of the net": lambda: of_rings(replace(LEFT, goal=parse_formula("a"))),
    "the goal speaks of transitions of the net": lambda: of_rings(replace(LEFT, goal=Firable("t"))),
    "the sets are of a goal that speaks of transitions of the net": lambda: of_rings(
        Reduction((), ("c", "d"), Firable("t"), StubbornSets(Markings((0b01, 0b10)), (0b11,), (0, 0)))
    ),
    "the sums speak of places of the net": lambda: of_rings(
        replace(LEFT, then=InductiveInvariant((*SUM.equations, Equation((("a", 1), ("b", 1)), 1))))
    ),
    "the lower bounds speak of places of the net": lambda: of_rings(
        replace(LEFT, then=replace(SUM, inequalities=(Inequality((("a", 1), ("b", 1)), 1),)))
    ),
    "the clauses speak of places of the net": lambda: of_rings(
        replace(LEFT, then=replace(SUM, clauses=(Clause(("a", "b")),)))
    ),
    "the clauses speak of empty places of the net": lambda: of_rings(
        replace(LEFT, then=replace(SUM, clauses=(Clause(empty=("a", "b")),)))
    ),
    "the sets are of a larger net": lambda: of_rings(
        replace(LEFT, then=StubbornSets(Markings((0b01, 0b10)), (0b111,), (0, 0)))
    ),
    "one of the sets is of a larger net": lambda: of_rings(
        replace(LEFT, then=StubbornSets(Markings((0b01, 0b10)), (0b11, 0b111), (0, 0)))
    ),
    "labels show nothing of it": lambda: of_rings(replace(LEFT, then=Labelling(Markings((1, 2)), (Ranks((0, 0)),)))),
    "steps are another discipline": lambda: replace(of_rings(LEFT), discipline=Discipline.STEP),
    "the markings are of the net itself": lambda: of_rings(
        Reduction((), ("c", "d"), parse_formula("c and d"), Labelling(Markings((0b0101, 0b0110, 0b1001, 0b1010))))
    ),
}


@pytest.mark.parametrize("name", FALSE)
def test_what_is_left_is_refused_where_it_does_not_show_the_goal(name: str) -> None:
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(FALSE[name]())


def test_a_set_that_two_nets_without_transitions_share_is_looked_at_for_each() -> None:
    net, space = net_of("c a", "t: a -> b", "u: d -> d"), Labelling(Markings((0b01,)))
    true_of_c = Reduction(steps("irrelevant 0"), ("c", "b"), parse_formula("not c"), space)
    false_of_b = Reduction(steps("early 0", "constant a"), ("b", "d"), parse_formula("b"), space)
    first, second = of_rings(true_of_c, "not c", net), of_rings(false_of_b, "b", net)
    assert check_evidence(first).shown
    with pytest.raises(InputError, match=r"the goal \(b\) holds in a marking of the set"):
        list(check_document(document(first, second)))


def test_a_set_that_two_nets_of_the_same_places_share_is_looked_at_for_each() -> None:
    net, part, space = net_of("a", "t: a -> b", "u: c -> d"), ("a", "b", "c", "d"), Labelling(Markings((0b0001,)))
    true_without_t = of_rings(Reduction(steps("irrelevant 0"), part, parse_formula("d"), space), "d", net)
    false_with_it = of_rings(Reduction((), part, parse_formula("b"), space), "b", net)
    assert check_evidence(true_without_t).shown
    with pytest.raises(InputError, match="leads out of the set"):
        list(check_document(document(true_without_t, false_with_it)))


@pytest.mark.parametrize("then", [SUM, StubbornSets(Markings((0b01, 0b10)), (0b11,), (0, 0))])
def test_invariants_and_stubborn_sets_show_what_is_left(then: InductiveInvariant | StubbornSets) -> None:
    assert check_evidence(of_rings(replace(LEFT, then=then))).shown


def test_what_is_said_of_a_net_that_nothing_is_left_of_is_looked_at() -> None:
    found = EXAMPLES["reduced to nothing"]()
    assert found is not None
    assert isinstance(found.certificate, Reduction)
    wrong = InductiveInvariant((Equation((), 1),))
    with pytest.raises(InputError, match="is 0 in the initial marking"):
        check_evidence(replace(found, certificate=replace(found.certificate, goal=parse_formula("true"), then=wrong)))


HELD = Net(  # neither transition ever fires: one reads what is empty, the other one is held up by what is full
    "held",
    tuple(Place(name, marked=name in "aq") for name in "abpq"),
    (Transition("t", ("a",), ("b",), permissive=("p",)), Transition("u", ("a",), ("b",), inhibitive=("q",))),
)
EITHER_WAY = Diagram(("a", "b"), ((1, 0, 1), (2, 2, 1)), (3,))


def numbered(place: str, beside: str) -> Net:
    """A token goes by m to another place, or stays where it is by a transition that does nothing."""
    ways = (Transition("t", ("a",), ("m",)), Transition("u", ("m",), (place,)), Transition(beside))
    return Net("numbered", (Place("a", marked=True), Place("m"), Place(place)), ways)


@pytest.mark.parametrize(
    ("of", "goal", "certificate"),
    [
        (HELD, "b", Reduction((), tuple("abpq"), Holds("b"), Labelling(Markings((HELD.initial_marking,))))),
        (ENDING, "deadlock and a", Reduction((), ("a", "b"), Holds("a"), Labelling(Markings((1, 2))))),
        (ENDING, "deadlock and a", Reduction((), ("a", "b"), Holds("a"), Labelling(EITHER_WAY))),
        # What is composed bears its number, and something behind it where the net has that name.
        *(
            (
                numbered(place, beside),
                f"a and {place}",
                Reduction(
                    (Step(Rule.OPENERS_LATE, places=("m",)),),
                    ("a", place),
                    And((Holds("a"), Holds(place))),
                    Labelling(Markings((1, 2))),
                ),
            )
            for place, beside in (("b", "v"), ("3", "v"), ("b", "3"), ("3", "3-"))
        ),
    ],
)
def test_what_a_reduction_leaves_is_the_net_of_its_moves(of: Net, goal: str, certificate: Reduction) -> None:
    claim = Claim(ClaimKind.NEVER, parse_formula(goal))
    evidence = Evidence(of, Discipline.INTERLEAVING, claim, certificate)
    assert true(evidence)
    assert check_evidence(evidence).shown


def test_of_a_net_that_nothing_is_left_of_nothing_is_said() -> None:
    of = family_net("philosophers-2")
    claim = Claim(ClaimKind.NEVER, parse_formula("p1.eating and not p1.eating"))
    evidence = Evidence(of, Discipline.INTERLEAVING, claim, Reduction(()))
    assert check_evidence(evidence).shown
    for said in (Reduction((), part=("p1.eating",)), Reduction((), goal=parse_formula("nowhere"))):
        with pytest.raises(InputError, match="nothing shows anything of it"):
            check_evidence(replace(evidence, certificate=said))


@pytest.mark.parametrize("name", ["reduction", "reduced to nothing", "reduced to a part"])
def test_a_reduction_with_a_step_left_out_or_at_another_place_shows_nothing_false(name: str) -> None:
    found = EXAMPLES[name]()
    assert found is not None
    assert isinstance(found.certificate, Reduction)
    of, draw, refused = found.certificate.steps, random.Random(0), 0
    changed = [of[:i] + of[i + 1 :] for i in range(len(of))] + [tuple(draw.sample(of, len(of))) for _ in range(10)]
    for goal in (found.claim.state_goal, Deadlock(), parse_formula("start")):
        evidence = replace(found, claim=replace(found.claim, goal=goal))
        holds = true(evidence)
        for edited in changed:
            try:
                shown = check_evidence(replace(evidence, certificate=replace(found.certificate, steps=edited))).shown
            except InputError:
                refused += 1
            else:
                assert not shown or holds
    assert refused


def test_applying_the_steps_ends_in_time() -> None:
    found = reduced(family_net("workshop-2"), Deadlock())
    assert found is not None
    assert isinstance(found.certificate, Reduction)
    draft = Draft(found.net, Deadlock(), Deadline.after(0))
    with pytest.raises(TimeIsOverError):
        draft.apply(found.certificate.steps[0])
    assert check_evidence(found, timeout_ms=0).shown is None


def test_a_transition_is_dead_whose_only_need_never_holds() -> None:
    # what fills its place is dead too, but stands there until the same step: the place is no constant of the arcs yet
    net = net_of("a", "go: a -> b", "fill: a, b -> c", "leave: c -> ")
    draft = Draft(net, Firable("fill"), NEVER)
    draft.apply(Step(Rule.FACTS))
    draft.apply(Step(Rule.DEAD, (1, 2)))
    assert list(draft.moves) == [0]


@pytest.mark.parametrize("text", ["deadlock and (p or q)", "not not deadlock", "not (deadlock -> p and not p)"])
def test_what_the_rules_see_of_a_goal_the_checker_sees_too(text: str) -> None:
    # q is the complement of p, so (p or q) always holds, and the goal wants nothing of it: a firing may come early
    net, goal = net_of("p", "t: p -> q", "u: q -> p"), parse_formula(text)
    found = reduction(net, goal, Limits(), lambda *_: None)
    assert found is not None
    assert Rule.EARLY in {step.rule for step in found.steps}
    assert check_evidence(Evidence(net, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, goal), found)).shown


def test_steps_that_the_checker_refuses_are_no_evidence_even_where_they_decide_the_goal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refused(_draft: Draft, step: Step) -> None:
        refuse(f"the rule '{step.rule}' cannot be applied")

    monkeypatch.setattr(Draft, "apply", refused)
    with pytest.raises(LackingError):
        reduction(net_of("p", "t: p -> q", "u: q -> p"), Deadlock(), Limits(), lambda *_: None)
