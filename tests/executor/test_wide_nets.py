"""A net of thousands of places does what it would do without those that nothing touches, and spends as little on it."""

import random
from dataclasses import replace

import pytest
from support.examples import seeds
from support.owned_nets import owned_net

from firable.decompose.splitting.cut import split
from firable.executor.journal.journal import MemoryJournal
from firable.executor.protocol import enabled
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.enabled import WIDE_BITS
from firable.executor.protocol.messages import Decision, Effect, Keep, ProtocolError, VoteRequest
from firable.executor.protocol.stored_word import PIECE_BITS, pieces, stored_word
from firable.executor.simulation.campaign import Run, campaign
from firable.executor.simulation.judge import Subject
from firable.nets.bits import bits
from firable.nets.decomposition import Decomposition
from firable.nets.net import Net, Place


def widened(net: Net, draw: random.Random) -> Net:
    """The net with places that nothing touches, among the others and behind them, as many for each controller."""
    owners = [controller.name for controller in net.controllers]
    idle = [Place(f"{owner}.idle{i}", owner, marked=i % 3 == 0) for owner in owners for i in range(WIDE_BITS + 300)]
    places = list(net.places)
    cut, at = draw.randrange(len(places) + 1), draw.randrange(len(idle))
    return replace(net, places=tuple(idle[:at] + places[:cut] + idle[at:] + places[cut:]))


class Beside:
    """A controller of a net and the same one of the widened net, given the same."""

    def __init__(self, narrow: Decomposition, wide: Decomposition, name: str) -> None:
        self.name = name
        self.narrow, self.wide = LocalController(narrow, name), LocalController(wide, name)
        self.journal = MemoryJournal()

    def given(self, act: str, *arguments: object) -> None:
        """Both do it, and what they say is the same; what is kept is the whole word, and no more than has changed."""
        (plain, refused), (effects, refused_too) = (
            answer(controller, act, *arguments) for controller in (self.narrow, self.wide)
        )
        assert refused == refused_too
        assert [e for e in effects if not is_word(e)] == [e for e in plain if not is_word(e)]
        before = pieces(stored_word(self.journal.kept(self.name), self.wide.subnet.initial_marking))
        kept = {effect.key: effect.value for effect in effects if isinstance(effect, Keep) and is_word(effect)}
        assert all(before.get(key, "0") != value for key, value in kept.items())
        assert bool(kept) == any(map(is_word, plain))
        self.journal.write(self.name, effects)
        self.check()

    def check(self) -> None:
        """What is enabled, and what a restart would find, is so by the words themselves."""
        wide = self.wide
        known = [t for t, compiled in enumerate(wide.transitions) if compiled.enabled(wide.word)]
        assert list(bits(wide.enabled.at(wide.word))) == known
        assert [wide.transitions[t].name for t in known] == self.narrow_enabled()
        kept = stored_word(self.journal.kept(self.name), wide.subnet.initial_marking)
        assert (kept ^ wide.word) & (wide.player.places | wide.player.completing) == 0

    def narrow_enabled(self) -> list[str]:
        """The transitions that the narrow word enables."""
        return [compiled.name for compiled in self.narrow.transitions if compiled.enabled(self.narrow.word)]


def answer(controller: LocalController, act: str, *arguments: object) -> tuple[list[Effect], str]:
    """What it says, and why it refuses."""
    try:
        return list(getattr(controller, act)(*arguments)), ""
    except ProtocolError as error:
        return [], str(error)


def is_word(effect: Effect) -> bool:
    return isinstance(effect, Keep) and effect.key.partition("/")[0] == "word"


@pytest.mark.seeds
def test_wide_controller_does_what_the_narrow_one_does() -> None:
    moved = 0
    for seed in seeds(40):
        draw = random.Random(seed)
        net = owned_net(seed)
        narrow, wide = split(net), split(widened(net, draw))
        for name in [subnet.name for subnet in narrow.subnets]:
            beside = Beside(narrow, wide, name)
            beside.given("start")
            signals = [signal.name for signal in narrow.subnet(name).signals]
            for number in range(60):
                match draw.randrange(5):
                    case 0 if beside.narrow.parts:
                        above = draw.choice(list(beside.narrow.above))
                        asked = draw.choice(sorted(beside.narrow.parts))
                        beside.given("receive", VoteRequest(name, number, (asked,), 0, 0, 0, above))
                        committed = asked if any(asked in p.promised for p in beside.narrow.promises.values()) else None
                        if draw.random() < 0.8:
                            beside.given("receive", Decision(name, number, committed, 0, 0, 0, above))
                    case 1 | 2 if signals:
                        beside.given("read", draw.choice(signals), draw.random() < 0.7)
                    case _:
                        beside.given("fire")
                beside.given("report")
            moved += beside.wide.marking != beside.wide.subnet.initial_marking
    assert moved > 20


@pytest.mark.seeds
def test_runs_in_which_no_word_is_remembered_and_each_step_is_said_are_traces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(enabled, "WIDE_BITS", 0)
    subjects = [Subject(split(owned_net(seed))) for seed in seeds(5)]
    done = campaign(lambda seed: subjects[seed % len(subjects)], map(Run, seeds(50)))
    assert not done.failed, [(failed.kind, failed.message) for failed in done.failed]


def test_wide_nets_run_through_faults() -> None:
    net = owned_net(3)
    subject = Subject(split(widened(net, random.Random(3))))
    assert len(subject.decomposition.subnets[0].places) > 2 * PIECE_BITS
    done = campaign(lambda _: subject, map(Run, range(3)))
    assert not done.failed, [(failed.kind, failed.message) for failed in done.failed]
