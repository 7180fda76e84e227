"""What is kept up to date by what changed is what looking at everything would say."""

import random
from copy import copy
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.owned_nets import owned_net, owned_nets

from firable.decompose.splitting.cut import split
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.situation import is_deadlock
from firable.executor.protocol import enabled
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.enabled import EnabledSet
from firable.executor.protocol.messages import Firing
from firable.executor.protocol.token_player import Arbiter, TokenPlayer
from firable.nets.bits import bits
from firable.nets.decomposition import ArbitrationGroup
from firable.nets.net import Arbiter as NetArbiter
from firable.nets.net import ArbitrationRule, Controller, Net, Place, Transition
from firable.semantics.arbitration import Arbitration


@examples(100)
@given(owned_nets(), st.lists(st.integers(0, 2**30), max_size=12))
def test_enabled_set_is_what_each_transition_says(net: Net, words: list[int]) -> None:
    compiled = list(TokenPlayer.of(net).transitions.values())
    watched = EnabledSet([(c.needs, c.forbids) for c in compiled], len(net.places) + len(net.signals))
    for drawn in words:
        word = drawn & ((1 << len(net.places) + len(net.signals)) - 1)
        assert list(bits(watched.at(word))) == [t for t, c in enumerate(compiled) if c.enabled(word)]


@examples(100)
@given(owned_nets(), st.data(), st.sampled_from([0, 3, enabled.KNOWN_MAX]), st.booleans())
def test_enabled_set_is_the_same_whether_a_step_is_said_or_not(
    net: Net, data: st.DataObject, known_max: int, is_wide: bool
) -> None:
    compiled = list(TokenPlayer.of(net).transitions.values())
    width = len(net.places) + len(net.signals)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(enabled, "KNOWN_MAX", known_max)
        patch.setattr(enabled, "WIDE_BITS", 0 if is_wide else enabled.WIDE_BITS)
        watched = EnabledSet([(c.needs, c.forbids) for c in compiled], width)
        word, sets = data.draw(st.integers(0, (1 << width) - 1)), [watched]
        for _ in range(12):
            step = data.draw(st.lists(st.integers(0, 2 * width - 1), max_size=4))
            after = word
            for one in step:
                after = after & ~(1 << one // 2) | (one % 2) << one // 2
            one_set = data.draw(st.sampled_from(sets))
            how = data.draw(st.sampled_from(["said", "asked", "copied", "forgotten"]))
            if how == "copied":  # copies go ways of their own
                sets.append(copy(one_set))
            if how in ("said", "copied"):
                one_set.said = word, after, step
            if how != "forgotten":
                assert list(bits(one_set.at(after))) == [t for t, c in enumerate(compiled) if c.enabled(after)]
            word = after


def test_transition_that_reads_nothing_is_always_enabled() -> None:
    watched = EnabledSet([(0, 0), (1, 0)], 2)
    assert [watched.at(word) for word in (0, 1, 0)] == [1, 3, 1]


def chosen_by_looking_at_all(
    arbitration: Arbitration, turns: tuple[int, ...], last: int, candidates: frozenset[int], count: int
) -> tuple[int, tuple[int, ...]]:
    """The choice as it is defined: of all that is granted, the first behind the last winner."""
    if len(candidates) == 1:
        return next(iter(candidates)), turns
    granted, _ = arbitration.decide(candidates, turns)
    chosen = min(granted, key=lambda t: (t - last - 1) % count)
    if losers := arbitration.conflicts.input_rivals[chosen] & candidates:
        turns = tuple(
            group.turn_after({chosen}, losers, turn) if chosen in group.sequence else turn
            for group, turn in zip(arbitration.groups, turns, strict=True)
        )
    return chosen, turns


@pytest.mark.parametrize("are_bound", [False, True])
@pytest.mark.parametrize("by", ArbitrationRule)
def test_choice_among_rivals_alone_is_the_choice_among_all(by: ArbitrationRule, are_bound: bool) -> None:
    """Of rivals that are enabled and may not fire now, as where they would disturb a promise, none is in the way."""
    for seed in range(60):
        draw = random.Random(seed)
        net = owned_net(seed)
        components = Arbitration.of(net).groups
        groups = []
        for g, group in enumerate(components):
            members = [net.transitions[t].name for t in group.rest]
            named = draw.sample(members, draw.randint(0, len(members)))
            rest = tuple(m for m in members if m not in named)
            groups.append(ArbitrationGroup(f"g{g}", tuple(named), rest, by))
        arbiter = Arbiter(net, groups)
        turns, last = arbiter.turns, -1
        for _ in range(30):
            candidates = frozenset(t for t in range(len(net.transitions)) if draw.random() < 0.6)
            bound = {t for t in range(len(net.transitions)) if are_bound and draw.random() < 0.4} - candidates
            if candidates:
                last, turns = chosen_by_looking_at_all(
                    arbiter.arbitration, turns, last, candidates, len(net.transitions)
                )
            enabled = sum(1 << t for t in candidates | bound)
            is_free = candidates.__contains__ if are_bound else None
            assert arbiter.following(enabled, is_free) == (last if candidates else None)
            assert arbiter.turns == turns


@pytest.mark.parametrize("by", ArbitrationRule)
def test_turn_of_a_controller_is_that_of_the_whole_net_where_one_transition_is_granted(by: ArbitrationRule) -> None:
    """Interleaving and steps make the same choice there, so a rotation must go on alike."""
    compared = 0
    for seed in range(60):
        draw, net = random.Random(seed), owned_net(seed)
        members = [[net.transitions[t].name for t in g.rest] for g in Arbitration.of(net).groups]
        named = [(names, draw.sample(names, draw.randint(2, len(names)))) for names in members]
        whole = Arbitration.of(
            replace(net, arbiters=tuple(NetArbiter(f"g{g}", tuple(its), by) for g, (_, its) in enumerate(named)))
        )
        groups = (
            ArbitrationGroup(f"g{g}", tuple(its), tuple(m for m in names if m not in its), by)
            for g, (names, its) in enumerate(named)
        )
        arbiter, turns = Arbiter(net, groups), whole.first_turns
        for _ in range(30):
            enabled = {t for t in range(len(net.transitions)) if draw.random() < 0.6}
            granted, after = whole.decide(enabled, turns)
            if len(granted) == 1:
                arbiter.choose(net.transitions[t].name for t in enabled)
                compared += after != turns
                turns = after
                assert arbiter.turns == turns
    assert (compared == 0) is (by is ArbitrationRule.PRIORITY)


def test_deadlock_that_the_recorder_knows_is_that_of_the_net() -> None:
    for seed in range(30):
        net, draw = owned_net(seed), random.Random(seed)
        recorder = Recorder(net, "", None)
        for _ in range(40):
            recorder.word = draw.getrandbits(len(net.places) + len(net.signals))
            assert recorder.is_deadlock is is_deadlock(recorder.player, recorder.word)


def test_firing_looks_only_at_the_transitions_that_it_touches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(enabled, "KNOWN_MAX", 0)  # words of before are not known

    def looked_at(n_rings: int) -> int:
        places = [Place(f"a.{r}.{i}", "a", marked=not i) for r in range(n_rings) for i in range(3)]
        moves = [
            Transition(f"t{r}.{i}", (f"a.{r}.{i}",), (f"a.{r}.{(i + 1) % 3}",))
            for r in range(n_rings)
            for i in range(3)
        ]
        controller = LocalController(split(Net("n", tuple(places), tuple(moves), controllers=(Controller("a"),))), "a")
        controller.fire()
        looks: list[int] = []

        class Counting(tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]):
            def __getitem__(self, one: Any) -> Any:
                found = super().__getitem__(one)
                looks.extend((*found[0], *found[1]))
                return found

        monkeypatch.setattr(controller.enabled, "_readers", Counting(controller.enabled._readers))
        fired = [effect for _ in range(20) for effect in controller.fire() if isinstance(effect, Firing)]
        assert len(fired) == 20
        return len(looks)

    assert looked_at(2) == looked_at(200) == 20 * 4
