"""What the machines of the executor do is what the parametric proof is about: each step of theirs is actions of it.

A run on a bad network is watched: after each thing that a machine does, the whole system is told in the relations of
the proof. The invariant must hold of it, and actions of the proof must lead there, each possible where it stands. So
whatever is proved of the actions is proved of the machines, as far as these runs show all that they do.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from support.abstraction import Instance, broken, explain, net_structure, of_coordinators, with_relations
from support.examples import seeds
from support.finite_structures import Structure, Thing
from support.gated_nets import SENSOR
from support.owned_nets import owned_net
from support.reference import load_net

from firable.decompose.protocol.parametric.system import PROTOCOL
from firable.decompose.splitting.cut import split
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator, Round
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    ProtocolError,
    Sending,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.protocol.token_player import Compiled, TokenPlayer
from firable.executor.simulation.network import Network, Simulation
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.net import Controller, Net, Place, Transition

Key = tuple[Thing, ...]


class Watched(Simulation):
    """A simulation that tells each of its steps as actions of the proof."""

    def __init__(self, decomposition: Decomposition, seed: int, network: Network, **machines: Any) -> None:
        super().__init__(decomposition, seed, network, **machines)
        self.structure = net_structure(decomposition, (), signals=True)
        self.takes_part = self.structure.relations["takes-part"]
        self.central = TokenPlayer.of(self.net)
        self.shadow = self.net.initial_marking
        self.image: frozenset[str] = frozenset()
        """The signals that are 1 in the process images."""
        self.rounds: dict[int, tuple[tuple[str, ...], dict[str, frozenset[str]], str | None, set[str]]] = {}
        """Of each round that was ever opened: what it asks for, the votes, the commit, who has obeyed."""
        self.sent: dict[str, set[Key]] = {
            name: set() for name in ("request", "vote", "commit_order", "abort_order", "acknowledgement")
        }
        self.actions: Counter[str] = Counter()
        self.now = self.told()
        assert broken(self.now) == []

    def _perform(self, effects: list[Effect]) -> None:
        super()._perform(effects)
        fired = []
        cleared = set()
        for effect in effects:
            match effect:
                case VoteRequest():
                    self.sent["request"] |= {(effect.round, t, effect.controller) for t in effect.transitions}
                case Vote():
                    self.sent["vote"] |= {(effect.round, t, effect.controller) for t in effect.promised}
                case Firing(transition):
                    compiled = self.central.transitions[transition]
                    assert compiled.enabled(self.shadow), f"'{transition}' is not enabled in the central net"
                    self.shadow = compiled.fire(self.shadow)
                    fired.append(transition)
                case Sending(place):
                    cleared.add(self.net.place(place).completion)
        before_image, self.image = self.image, self._image()
        changed = before_image ^ self.image
        sensed = sorted(name for name in changed if name not in cleared or name in self.image)
        for name in sensed:
            self.shadow ^= self.central.signal_bit(name)
        self._remember()
        for effect in effects:
            match effect:
                case Decision():
                    for key in self._asked_of(effect.round, effect.controller):
                        self.sent["commit_order" if key[1] == effect.committed else "abort_order"].add(key)
                case Acknowledgement():
                    self.sent["acknowledgement"] |= set(self._asked_of(effect.round, effect.controller))
        before, self.now = self.now, self.told()
        local = [name for name in fired if (name,) not in self.structure.relations["coordinated"]]
        steps: list[Instance] = explain(with_things(before, self.now), self.now, local, sensed)
        self.actions.update(name for name, _ in steps)
        if steps:
            assert broken(self.now) == [], steps

    def _image(self) -> frozenset[str]:
        every = self.controllers.values()
        return frozenset(s.name for c in every for s in c.subnet.signals if c.word & c.player.signal_bit(s.name))

    def _asked_of(self, number: int, controller: str) -> Iterator[Key]:
        for t in self.rounds[number][0]:
            if (t, controller) in self.takes_part:
                yield (number, t, controller)

    @property
    def open_rounds(self) -> dict[int, Round]:
        """The rounds of all coordinators that are not closed."""
        return {number: opened for each in self.coordinators.values() for number, opened in each.rounds.items()}

    def _remember(self) -> None:
        for number, opened in self.open_rounds.items():
            self.rounds[number] = (
                opened.transitions, dict(opened.votes), opened.committed, set(opened.acknowledged)
            )  # fmt: skip
        for number, (transitions, votes, committed, _) in list(self.rounds.items()):
            if number not in self.open_rounds:  # closed: all have obeyed
                self.rounds[number] = (transitions, votes, committed, set(self.controllers))

    def told(self) -> Structure:
        """The whole system in the relations of the proof."""
        keys = [(r, t, c) for r, (names, *_) in self.rounds.items() for t in names for c in self.controllers]
        asked = [(r, t, c) for r, t, c in keys if (t, c) in self.takes_part]
        is_open = self.open_rounds
        obeyed: set[Key] = {key for key in asked if self.controllers[key[2]]._is_closed(key[0])}
        for name, controller in self.controllers.items():
            for above in controller.above.values():
                closed = [r for r in range(above.closed_below) if controller.coordinator_of(r) == above.name]
                obeyed |= {(r, t.name, name) for r in closed for t in self.net.transitions}
        names = tuple(self.coordinators)
        whose: dict[Thing, str] = {r: names[r % len(names)] for r in self.rounds}
        return with_relations(
            of_coordinators(self.structure, whose),
            marked=[(name,) for name in (*self.net.names(self.marking), *self.image)],
            shadow=[(place,) for place in self.net.names(self.central.marking(self.shadow))]
            + [(s.name,) for s in self.net.signals if self.shadow & self.central.signal_bit(s.name)],
            begun=[(r,) for r in self.rounds],
            asked=[(r, t) for r, (names, *_) in self.rounds.items() for t in names],
            heard=[(r, t, c) for r, (_, votes, *_) in self.rounds.items() for c, yes in votes.items() for t in yes],
            decided=[(r,) for r in self.rounds if r not in is_open or is_open[r].decided],
            committed=[(r, t) for r, (_, _, t, _) in self.rounds.items() if t is not None],
            noted=[key for key in asked if key[2] in self.rounds[key[0]][3]],
            closed=[(r,) for r in self.rounds if r not in is_open],
            promised=[
                (r, t, name)
                for name, controller in self.controllers.items()
                for r, promise in controller.promises.items()
                for t in promise.promised
            ],
            obeyed=obeyed,
            **self.sent,
        )


def with_things(structure: Structure, other: Structure) -> Structure:
    """The structure with the rounds that there are later."""
    return Structure(other.things, other.functions, structure.relations)


NETWORKS = [Network(), Network(loss=0.2, duplication=0.3)]
SMALL = (
    "local_conflict",
    "local_gate",
    "local_output_conflict",
    "read_before_order",
    "remote_gate",
    "ring",
    "no_trouble",
)


@pytest.mark.seeds
@pytest.mark.parametrize("network", NETWORKS, ids=str)
@pytest.mark.parametrize("name", SMALL)
def test_each_step_of_the_machines_is_some_actions_of_the_proof(name: str, network: Network) -> None:
    for seed in seeds(2):
        Watched(split(load_net(name)), seed, network).run(100)


@pytest.mark.seeds
def test_each_step_of_the_machines_is_some_actions_of_the_proof_on_random_nets() -> None:
    happened: Counter[str] = Counter()
    nets = [load_net("ring"), *map(owned_net, seeds(10))]
    for seed, net in enumerate(nets):
        watched = Watched(split(net), seed, NETWORKS[1])
        watched.run(120)
        happened += watched.actions
    # The coordinator of the simulation does not crash.
    assert set(happened) == {action.name for action in PROTOCOL.actions} - {
        "restart",
        "stand",
        "apply-free",
        "sense-late",
    }


@pytest.mark.seeds
def test_each_step_of_the_machines_is_some_actions_of_the_proof_on_the_cell() -> None:
    for seed in seeds(1):
        watched = Watched(split(catalogue_net("one_robot")), seed, NETWORKS[1])
        watched.run(300)
        assert watched.actions["decide"] > 0


def test_rounds_of_one_group_side_by_side_are_some_actions_of_the_proof() -> None:
    """The executor opens a second round of a group beside the first where what they ask for is disjoint."""
    beside: list[Round] = []

    class Noting(Coordinator):
        def _ask(self, group: int, names: tuple[str, ...]) -> Iterator[Effect]:
            beside.extend(opened for opened in self.rounds.values() if opened.group == group)
            yield from super()._ask(group, names)

    places = ("a.p", "a.q", "a.r", "b.p", "b.q", "b.r")
    net = Net(
        "chain",
        tuple(Place(place, place[0], marked=place.endswith("p")) for place in places),
        (
            Transition("A", ("a.p",), ("b.q",)),
            Transition("B", ("a.p", "b.p"), ("a.r", "b.r")),
            Transition("C", ("b.p",), ("a.q",)),
            Transition("A-back", ("b.q",), ("a.p",)),
            Transition("C-back", ("a.q",), ("b.p",)),
        ),
        controllers=(Controller("a"), Controller("b")),
    )
    for seed in range(7, 60):
        Watched(split(net), seed, NETWORKS[0], coordinator=Noting).run(60)
        if beside:
            return
    pytest.fail("no two rounds of one group were open at once")


# --- Machines with a planted fault are not what the proof is about


class NoLock(LocalController):
    """A yes vote promises nothing."""

    def _disturbs_promises(self, _transition: Compiled) -> bool:
        return False


class AppliesTwice(LocalController):
    """An order that comes again is carried out again."""

    def _decided(self, decision: Decision) -> Iterator[Effect]:
        if decision.committed in self.parts and decision.round in self.closed:
            yield from self._fire(self.parts[decision.committed])
        yield from super()._decided(decision)


class VotesAgain(LocalController):
    """A late request of a round that is over is granted."""

    def _vote(self, request: VoteRequest) -> Iterator[Effect]:
        self.closed.discard(request.round)
        yield from super()._vote(request)


class SignalsUnlocked(LocalController):
    """A signal may change between the vote and the commit."""

    def _locked_reads(self) -> int:
        return 0


class StaleVotes(Coordinator):
    """A vote of an earlier round counts for the present one."""

    def receive(self, message: ToCoordinator) -> list[Effect]:
        if isinstance(message, Vote):
            for opened in self.rounds.values():
                if not opened.decided and message.controller in opened.participants and message.round < opened.number:
                    return super().receive(replace(message, round=opened.number))
        return super().receive(message)


class DecidesEarly(Coordinator):
    """The decision does not wait for all votes."""

    def _voted(self, vote: Vote) -> Iterator[Effect]:
        voted = self.rounds.get(vote.round)
        if voted is not None and not voted.decided:
            yield from self._decide(voted, voted.transitions[0])


class ClosesEarly(Coordinator):
    """A round is closed when the first has acknowledged."""

    def _acknowledged(self, message: Acknowledgement) -> Iterator[Effect]:
        if message.round in self.rounds and self.rounds[message.round].decided:
            self.rounds[message.round].acknowledged.update(self.rounds[message.round].participants[1:])
        yield from super()._acknowledged(message)


FAULTS: list[tuple[str, type, str]] = [
    ("controller", NoLock, "O1"),
    ("controller", AppliesTwice, "leads elsewhere"),
    ("controller", VotesAgain, "obeyed"),
    ("controller", SignalsUnlocked, "no promise reads or clears it"),
    ("coordinator", StaleVotes, "a vote of the round has arrived"),
    ("coordinator", DecidesEarly, "all who have to promise have voted yes"),
    ("coordinator", ClosesEarly, "an acknowledgement of the round has arrived"),
]


@pytest.mark.parametrize(("machine", "fault", "says"), FAULTS, ids=[fault.__name__ for _, fault, _ in FAULTS])
def test_planted_fault_is_no_action_of_the_proof(machine: str, fault: type, says: str) -> None:
    said = []
    for seed in range(30):
        for net in (load_net("local_gate"), load_net("ring"), load_net("read_before_order"), SENSOR):
            try:
                Watched(split(net), seed, NETWORKS[1], **{machine: fault}).run(120)
            except AssertionError as failed:
                said.append(str(failed))
            except ProtocolError:
                pass  # the machines have noticed it themselves
            if said and says in said[-1]:
                return
    pytest.fail(f"not found: {said}")
