"""The voting protocol on a bad network: it refines the central net, and planted faults in it are found."""

from collections.abc import Iterator
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples, seeds
from support.gated_nets import GATE_MOVED_BY_A_LOCAL, GATE_OF_A_LOCAL, net_of
from support.owned_nets import owned_net, owned_nets
from support.reference import load_net
from support.rehearsals import NETWORKS, ORDERLY, rehearsed

from firable.decompose.splitting.cut import split
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Hello,
    Keep,
    Message,
    ProtocolError,
    Readiness,
    Report,
    Sending,
    Taken,
    Vote,
    VoteRequest,
)
from firable.executor.protocol.token_player import TokenPlayer
from firable.executor.simulation.world import Machines
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    ExternalGate,
    Net,
    Place,
    Signal,
    SignalKind,
    Transition,
)
from firable.nets.text import parse_net
from firable.semantics.player import Player

SMALL = [
    *("local_conflict", "local_gate", "local_output_conflict", "read_before_order", "remote_gate", "ring"),
    "no_trouble",
]
CELLS = ["cell1", "cell1_mc_late", "cell2_shared", "cell2_separate"]
CATALOGUE = ["one_robot", "one_robot_mc_late", "two_robots_separate"]


@cache
def decomposition_of(name: str) -> Decomposition:
    return split(catalogue_net(name) if name in CATALOGUE else load_net(name))


def fired(decomposition: Decomposition, seed: int, kinds: tuple[str, ...] = ORDERLY, steps: int = 300) -> int:
    """How often something fires in a run that is judged by the reference player."""
    return rehearsed(decomposition, seed, kinds, steps).counts["firings"]


@pytest.mark.seeds
@pytest.mark.parametrize("kinds", NETWORKS, ids=str)
@pytest.mark.parametrize("name", SMALL)
def test_joint_traces_of_the_small_nets_are_traces_of_the_central_net(name: str, kinds: tuple[str, ...]) -> None:
    assert sum(fired(decomposition_of(name), seed, kinds, 150) for seed in seeds(40)) >= 40


@pytest.mark.seeds
@pytest.mark.parametrize("kinds", NETWORKS, ids=str)
@pytest.mark.parametrize("name", CELLS + CATALOGUE)
def test_joint_traces_of_the_cells_are_traces_of_the_central_net(name: str, kinds: tuple[str, ...]) -> None:
    assert sum(fired(decomposition_of(name), seed, kinds, 2000) for seed in seeds(4)) > 40


@examples(60)
@given(owned_nets(), st.integers(0, 2**16), st.sampled_from(NETWORKS))
def test_joint_traces_of_random_nets_are_traces_of_the_central_net(net: Net, seed: int, kinds: tuple[str, ...]) -> None:
    fired(split(net), seed, kinds, 300)


@pytest.mark.seeds
def test_random_nets_fire() -> None:
    assert sum(fired(split(owned_net(seed)), seed, steps=400) for seed in seeds(40)) > 200


@pytest.mark.seeds
@pytest.mark.parametrize("net", [GATE_OF_A_LOCAL, GATE_MOVED_BY_A_LOCAL], ids=["reads", "moves"])
def test_joint_traces_of_nets_with_gates_at_local_transitions_are_traces_of_the_central_net(net: Net) -> None:
    assert sum(fired(split(net), seed, NETWORKS[seed % 4], 150) for seed in seeds(40)) >= 40


# Single machines


def pump(decomposition: Decomposition, firings: int) -> list[str]:
    """The firings of the machines on a perfect network, each message handled in turn."""
    coordinator = Coordinator(decomposition)
    controllers = {subnet.name: LocalController(decomposition, subnet.name) for subnet in decomposition.subnets}
    queue: list[Message] = []
    fired: list[str] = []

    def perform(effects: list[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Firing):
                fired.append(effect.transition)
            elif not isinstance(effect, Taken | Sending | Keep):
                queue.append(effect)

    for _ in range(20 * firings):
        for controller in controllers.values():
            perform([*controller.fire(), *controller.report()])
        while queue:
            message = queue.pop(0)
            if isinstance(message, VoteRequest | Decision | Hello):
                perform(controllers[message.controller].receive(message))
            else:
                perform(coordinator.receive(message))
            if len(fired) >= firings:
                return fired[:firings]
    return fired


def rivals(by: ArbitrationRule, among: tuple[str, ...] = ("A", "B")) -> Decomposition:
    """Two global transitions that compete for the same tokens, again and again."""
    names = ("a.p", "a.x", "a.y", "b.q", "b.x", "b.y")
    return split(
        Net(
            "rivals",
            tuple(Place(name, name[0], marked=name in {"a.p", "b.q"}) for name in names),
            (
                Transition("A", ("a.p", "b.q"), ("a.x", "b.x")),
                Transition("B", ("a.p", "b.q"), ("a.y", "b.y")),
                Transition("A-back", ("a.x", "b.x"), ("a.p", "b.q")),
                Transition("B-back", ("a.y", "b.y"), ("a.p", "b.q")),
            ),
            controllers=(Controller("a"), Controller("b")),
            arbiters=(Arbiter("next", among, by),),
        )
    )


def test_conflicting_yes_votes_are_decided_by_the_rule_of_the_arbiter() -> None:
    def winners(by: ArbitrationRule, among: tuple[str, ...] = ("A", "B")) -> str:
        return "".join(name for name in pump(rivals(by, among), 12) if "-" not in name)

    assert winners(ArbitrationRule.PRIORITY) == "AAAAAA"
    assert winners(ArbitrationRule.PRIORITY, ("B", "A")) == "BBBBBB"
    assert winners(ArbitrationRule.ROTATION) == "ABABAB"
    assert winners(ArbitrationRule.ORDER, ("B", "B", "A")) == "BBABBA"


def beside_keeping(effects: list[Effect]) -> list[Effect]:
    """What is done beside writing to stable storage."""
    return [effect for effect in effects if not isinstance(effect, Keep)]


def asked(controller: LocalController, number: int, *transitions: str) -> list[Effect]:
    return beside_keeping(controller.receive(VoteRequest(controller.name, number, transitions, 0, -1)))


def decided(controller: LocalController, number: int, committed: str | None) -> list[Effect]:
    return beside_keeping(controller.receive(Decision(controller.name, number, committed, 0, -1)))


def test_decision_is_applied_once_and_acknowledged_each_time() -> None:
    controller = LocalController(decomposition_of("ring"), "c1")
    assert [vote.promised for vote in asked(controller, 0, "G") if isinstance(vote, Vote)] == [{"G"}]
    for _ in range(3):
        assert any(isinstance(effect, Acknowledgement) for effect in decided(controller, 0, "G"))
        assert controller.subnet.names(controller.marking) == ("c1.q",)


def test_request_that_comes_after_its_decision_gets_no_vote() -> None:
    controller = LocalController(decomposition_of("ring"), "c1")
    decided(controller, 0, None)
    assert asked(controller, 0, "G") == []
    assert controller.promises == {}


def test_promise_holds_a_local_transition_back_until_the_abort() -> None:
    controller = LocalController(decomposition_of("local_gate"), "c1")
    asked(controller, 0, "G")
    assert beside_keeping(controller.fire()) == []
    decided(controller, 0, None)
    assert beside_keeping(controller.fire()) == [Firing("l")]


GUARDED = """
firable: 1
cell: guarded
controllers:
  a: {start: x, places: {x: , y: }}
  b: {start: x, places: {x: , y: }}
  c:
    start: idle
    inputs: [guard]
    places: {idle: , busy: }
transitions:
  enters: {from: a.x, to: a.y, if: c.guard}
  also_enters: {from: b.x, to: b.y, if: c.guard}
  begins: {from: c.idle, to: c.busy, if: c.guard}
"""


def test_guard_that_opens_during_a_promise_stays_closed_for_its_commit_and_for_nothing_else() -> None:
    controller = LocalController(split(parse_net(GUARDED)), "c")
    controller.read("c.guard", value=True)
    asked(controller, 0, "enters")
    assert controller.may_fire
    assert controller.read("c.guard", value=False) == []
    assert beside_keeping(controller.fire()) == []
    votes = [vote for vote in asked(controller, 1, "also_enters") if isinstance(vote, Vote)]
    assert [(vote.promised, vote.readiness.transitions) for vote in votes] == [(frozenset(), frozenset())]
    assert Taken("c.guard", value=False) in decided(controller, 0, "enters")
    assert beside_keeping(controller.fire()) == []
    controller.read("c.guard", value=True)
    assert beside_keeping(controller.fire()) == [Firing("begins")]


@pytest.mark.parametrize("shown", [(), (False,)], ids=["nothing shown", "open"])
def test_guard_that_a_promise_reads_is_open_after_a_restart_until_it_is_seen_closed(shown: tuple[bool, ...]) -> None:
    decomposition = split(parse_net(GUARDED))
    controller = LocalController(decomposition, "c")
    effects = [*controller.start(), *controller.read("c.guard", value=True)]
    effects += controller.receive(VoteRequest("c", 0, ("enters",), 0, -1))
    kept = {effect.key: effect.value for effect in effects if isinstance(effect, Keep) and effect.value is not None}
    again = LocalController.restored(decomposition, "c", kept)
    again.start()
    for value in shown:
        again.read("c.guard", value)
    again.resume()
    assert again.promises
    assert beside_keeping(again.fire()) == []
    decided(again, 0, None)
    again.read("c.guard", value=True)
    assert beside_keeping(again.fire()) == [Firing("begins")]


def test_commit_without_a_promise_is_refused() -> None:
    controller = LocalController(decomposition_of("ring"), "c1")
    with pytest.raises(ProtocolError, match="without a promise"):
        decided(controller, 0, "G")


def test_command_clears_its_completion_before_it_is_sent() -> None:
    controller = LocalController(decomposition_of("one_robot"), "robot")
    assert beside_keeping(controller.read("robot.at_cv1", value=True)) == [Taken("robot.at_cv1", value=True)]
    asked(controller, 0, "G2")
    effects = decided(controller, 0, "G2")
    assert effects[:2] == [Taken("robot.at_cv1", value=False), Sending("robot.to_cv1", 1)]
    assert beside_keeping(controller.fire()) == []


def test_completion_of_an_earlier_command_is_stale() -> None:
    controller = LocalController(decomposition_of("one_robot"), "robot")
    asked(controller, 0, "G2")
    decided(controller, 0, "G2")
    assert beside_keeping(controller.read("robot.at_cv1", value=True, entry=0)) == []
    assert beside_keeping(controller.read("robot.at_cv1", value=True, entry=1)) == [Taken("robot.at_cv1", value=True)]


def test_value_from_before_a_command_is_not_taken_for_its_completion() -> None:
    done = Signal("a.done", "a", SignalKind.COMPLETION)
    net = Net(
        "net",
        (Place("a.p", "a", marked=True), Place("a.q", "a", command=Command("A", "GO"), completion="a.done")),
        (
            Transition("G", ("a.p",), ("a.q",), external=(ExternalGate("a.done", wanted=False), ExternalGate("b.s"))),
            Transition("back", ("a.q",), ("a.p",), external=(ExternalGate("a.done"),)),
        ),
        (done, Signal("b.s", "b")),
        (Controller("a"), Controller("b")),
    )
    controller = LocalController(split(net), "a")
    asked(controller, 0, "G")
    assert beside_keeping(controller.read("a.done", value=True)) == []  # latched: the promise reads it
    decided(controller, 0, "G")
    assert beside_keeping(controller.fire()) == []
    controller.read("a.done", value=True, entry=1)
    assert beside_keeping(controller.fire()) == [Firing("back")]


@examples(38)
@given(owned_nets(), st.integers(0, 2**16), st.sampled_from(NETWORKS))
def test_rounds_side_by_side_never_meet_at_a_promise(net: Net, seed: int, kinds: tuple[str, ...]) -> None:
    class Alone(LocalController):
        def _vote(self, request: VoteRequest) -> Iterator[Effect]:
            asked_for = [self.parts[name] for name in request.transitions]
            if not self._is_closed(request.round) and request.round not in self.promises:
                assert not any(self._disturbs_promises(part) for part in asked_for)
            yield from super()._vote(request)

    rehearsed(split(net), seed, kinds, 300, Machines(controller=Alone))


def test_permit_for_one_firing_lets_one_of_two_open_rounds_commit() -> None:
    places = ("a.p", "a.q", "a.r", "a.s", "b.p", "b.q", "b.r", "b.s")
    both = (Transition("G", ("a.p", "b.p"), ("a.q", "b.q")), Transition("H", ("a.r", "b.r"), ("a.s", "b.s")))
    decomposition = split(net_of(" ".join(places), "a.p b.p a.r b.r", *both))
    coordinator = Coordinator(decomposition)
    ready = Readiness(0, frozenset({"G", "H"}))
    assert coordinator.receive(Report("a", ready)) == []
    requests = coordinator.receive(Report("b", ready))
    assert {(r.controller, r.transitions) for r in requests if isinstance(r, VoteRequest)} == {
        (controller, (name,)) for controller in "ab" for name in "GH"
    }
    effects = coordinator.permit(1)
    for request in requests:
        if isinstance(request, VoteRequest):
            vote = Vote(request.controller, request.round, frozenset(request.transitions), ready)
            effects += coordinator.receive(vote)
    assert [effect for effect in effects if isinstance(effect, Firing)] == [Firing("G")]
    assert {effect.committed for effect in effects if isinstance(effect, Decision)} == {"G", None}


def test_request_of_a_forgotten_round_gets_no_vote() -> None:
    controller = LocalController(decomposition_of("ring"), "c1")
    decided(controller, 0, None)
    controller.receive(Decision("c1", 1, None, 1, -1))  # every round below 1 is closed
    assert controller.closed == {1}
    assert asked(controller, 0, "G") == []
    assert controller.promises == {}


def test_transition_that_is_always_enabled_does_not_keep_others_from_firing() -> None:
    there_and_back = (
        *(Transition("t", ("a.p",), ("a.q",)), Transition("u", ("a.q",), ("a.p",))),
        *(Transition("v", ("a.r",), ("a.s",)), Transition("w", ("a.s",), ("a.r",))),
    )
    controller = LocalController(split(net_of("a.p a.q a.r a.s", "a.p a.r", *there_and_back)), "a")
    fired = [effect.transition for _ in range(40) for effect in controller.fire() if isinstance(effect, Firing)]
    assert sorted(fired) == sorted("tuvw" * 10)


def test_closed_rounds_are_forgotten() -> None:
    decomposition = decomposition_of("no_trouble")
    assert len(pump(decomposition, 200)) == 200
    world = rehearsed(decomposition, 1, steps=4000)
    machines = [process.machine for process in world.controllers.values()]
    assert max(len(machine.closed) for machine in machines if machine is not None) <= 2


@examples(50)
@given(owned_nets(), st.data())
def test_compiled_transitions_are_enabled_and_fire_as_the_reference_says(net: Net, data: st.DataObject) -> None:
    player, reference = TokenPlayer.of(net), Player(net)
    for _ in range(10):
        word = data.draw(st.integers(0, (1 << len(net.places) + len(net.signals)) - 1))
        signals = {s.name: bool(word >> len(net.places) + j & 1) for j, s in enumerate(net.signals)}
        marking = player.marking(word)
        enabled = [t for t, c in enumerate(player.transitions.values()) if c.enabled(word)]
        assert tuple(enabled) == reference.enabled(marking, signals)
        for t in enabled:
            fired = player.transitions[net.transitions[t].name].fire(word)
            assert player.marking(fired) == reference.fire(marking, (t,))
