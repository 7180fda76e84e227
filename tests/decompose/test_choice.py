"""What is claimed of the choice of a group is enough: whatever meets it is maximal and without conflict."""

from collections import Counter
from itertools import product

from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.analysis.induction.smt import Terms, value
from firable.decompose.proofs.arbitration import Competition, Steps, choice, maximal_without_conflict
from firable.nets.net import Net, Place, Transition


@given(st.data())
@examples(50)
def test_choice_that_meets_its_claims_is_maximal_and_without_conflict(data: st.DataObject) -> None:
    """Of a right choice they hold; of one that overlooks or invents places they hold only where nothing comes of it."""
    sets = st.frozensets(st.sampled_from("pqr"), min_size=1, max_size=2).map(sorted).map(tuple)
    outputs = st.sampled_from("xy")
    names = [f"t{i}" for i in range(4)]
    net = Net(
        "n", tuple(map(Place, "pqrxy")), tuple(Transition(t, data.draw(sets), (data.draw(outputs),)) for t in names)
    )
    whole = Competition.of([(net, names.__getitem__)])
    overlooked = data.draw(st.frozensets(st.sampled_from(list(whole.at) or [None])))
    seen = {t: [place for place in whole.places.get(t, ()) if place not in overlooked] for t in names}
    besides = data.draw(st.frozensets(st.sampled_from(names)))
    for t in besides:
        seen[t].append("what nobody competes for")
    terms, turns = Terms(), data.draw(st.booleans())
    sequence = data.draw(st.lists(st.sampled_from(names), max_size=4))
    rest = [t for t in names if t not in sequence]
    steps = Steps(terms)
    chosen = choice(terms, steps, sequence, rest, Competition({}, seen, {}), turns=turns)
    claims = list(maximal_without_conflict(terms, steps, chosen, names, whole))
    if not overlooked and not besides:
        assert all(claim.operands[0] is claim.operands[1] for claim in claims)
    for enabled in product((False, True), repeat=4):
        assignment = {f"enabled({t})": its for t, its in zip(names, enabled, strict=True)}
        assignment |= {f"turn({i})": i == 0 for i in range(4)}
        for is_so in steps.definitions():
            assignment[is_so.operands[0].name] = value(is_so.operands[1], assignment)
        if all(value(claim, assignment) for claim in claims):
            granted = [t for t in names if value(chosen.granted[t], assignment)]
            taken = Counter(place for t in granted for place in whole.places.get(t, ()))
            assert all(n == 1 for n in taken.values())
            refused = [t for t in names if assignment[f"enabled({t})"] and t not in granted]
            assert all(any(place in taken for place in whole.places.get(t, ())) for t in refused)


def test_who_fills_a_place_does_not_compete_with_who_takes_from_it() -> None:
    """Each would be refused for the sake of one that can never fire with it."""
    filling = (Transition("one", ("p",), ("r",)), Transition("other", ("q",), ("r",)))
    taking = (Transition("this", ("r",), ("x",)), Transition("that", ("r",), ("y",)))
    net = Net("n", tuple(map(Place, "pqrxy")), (*filling, *taking))
    competition = Competition.of([(net, lambda t: net.transitions[t].name)])
    assert list(competition.at.values()) == [["this", "that"], ["one", "other"]]
    for t in (*filling, *taking):
        assert [t.name in competition.at[place] for place in competition.places[t.name]] == [True]
        assert competition.inputs.get(t.name, []) == (competition.places[t.name] if t in taking else [])


def test_first_of_those_enabled_from_the_turn_on_is_granted() -> None:
    names = ["one", "two", "three"]
    net = Net("n", (Place("p"),), tuple(Transition(name, ("p",)) for name in names))
    terms = Terms()
    steps = Steps(terms)
    chosen = choice(terms, steps, names, (), Competition.of([(net, names.__getitem__)]), turns=True)
    for turn, enabled in product(range(3), product((False, True), repeat=3)):
        its = dict(zip(names, enabled, strict=True))
        assignment = {f"enabled({t})": so for t, so in its.items()} | {f"turn({i})": i == turn for i in range(3)}
        for is_so in steps.definitions():
            assignment[is_so.operands[0].name] = value(is_so.operands[1], assignment)
        granted = [t for t in names if value(chosen.granted[t], assignment)]
        assert granted == [t for t in names[turn:] + names[:turn] if its[t]][:1]
