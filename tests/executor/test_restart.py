"""Machines that crash and are restored from what they kept: nothing is lost, nothing done twice, nothing moves."""

from collections import Counter
from collections.abc import Callable, Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples, seeds
from support.owned_nets import owned_net, owned_nets
from support.reference import load_net

from firable.decompose.splitting.cut import split
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import (
    EPOCH_BITS,
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
    Stored,
    Taken,
    ToController,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.network import Network, ProgressLostError, Simulation
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    Net,
    Place,
    Signal,
    SignalKind,
    Transition,
)
from firable.nets.text import parse_net
from firable.semantics.replaying import replay

Machine = LocalController | Coordinator


def store(storage: dict[str, Stored], effects: Iterable[Effect]) -> None:
    """Write what is kept."""
    for effect in effects:
        if isinstance(effect, Keep) and effect.value is None:
            storage.pop(effect.key, None)
        elif isinstance(effect, Keep) and effect.value is not None:
            storage[effect.key] = effect.value


class Crashing(Simulation):
    """A simulation in which each machine may crash after any act, before or while what the act does leaves it.

    Stable storage here loses nothing: an act is stored whole. Commands that were issued are in the trace, and may or
    may not have reached the machine, which knows them by their entry.
    """

    def __init__(
        self,
        decomposition: Decomposition,
        seed: int,
        network: Network,
        coordinator: Callable[[Decomposition, str], Coordinator] = Coordinator,
        controller: Callable[[Decomposition, str], LocalController] = LocalController,
        crashes: float = 0.02,
        forgets: tuple[str, str] = ("nobody", ""),
    ) -> None:
        super().__init__(decomposition, seed, network, coordinator, controller)
        self.decomposition = decomposition
        self.crashes = crashes
        self.forgets = forgets
        """Whose stable storage loses what: "coordinator" or "controllers", and how the key begins."""
        self.crashed = 0
        self.kept: dict[str, dict[str, Stored]] = {name: {} for name in (*self.coordinators, *self.controllers)}
        self.issued: Counter[tuple[str, int]] = Counter()
        self.received: set[tuple[str, int]] = set()
        self.acting = ""
        for name in self.kept:
            self._act(name, self._machine(name).start())

    def _machine(self, name: str) -> Machine:
        return self.controllers[name] if name in self.controllers else self.coordinators[name]

    def _act(self, name: str, effects: list[Effect]) -> None:
        self.acting = name
        self._perform(effects)

    def _turn(self, controller: LocalController) -> None:
        if controller.held and self.random.random() < 0.3:
            self._resume(controller)
        self.acting = controller.name
        super()._turn(controller)

    def _something(self) -> None:
        choice, controller = self.random.random(), self.random.choice(list(self.controllers.values()))
        if self.late and choice < 0.03:
            self.in_flight.append(self.late.pop(self.random.randrange(len(self.late))))
        if choice < 0.55 and self.in_flight:
            self._deliver()
        elif choice < 0.80:
            self._turn(controller)
        elif choice < 0.87 and self.completing:
            self._read(*self.completing.pop(self.random.randrange(len(self.completing))))
        elif choice < 0.96 and self.sensors:
            signal = self.random.choice(self.sensors)
            self.values[signal] = not self.values[signal]
            self._read(signal)
        elif choice >= 0.96:
            for name in self.kept:
                self._act(name, self._machine(name).resend())
        if self.random.random() < self.crashes:
            self._crash(self.random.choice(list(self.kept)))

    def _read(self, signal: str, entry: int | None = None) -> None:
        owner = self.owner_of[signal]
        self._act(owner, self.controllers[owner].read(signal, entry is not None or self.values[signal], entry))

    def _receive(self, message: Message) -> None:
        self.acting = message.controller if isinstance(message, ToController) else message.coordinator
        super()._receive(message)

    def _perform(self, effects: list[Effect]) -> None:
        storage = self.kept[self.acting]
        store(storage, (effect for effect in effects if isinstance(effect, Keep) and not self._is_forgotten(effect)))
        cut = self.random.random() < self.crashes / 3
        for effect in effects:
            if isinstance(effect, Sending):
                if not effect.again:
                    self.issued[effect.place, effect.entry] += 1
                if not cut:
                    assert (effect.place, effect.entry) not in self.received, "a machine gets a command twice"
                    self.received.add((effect.place, effect.entry))
        before = len(self.completing)
        told = [e for e in effects if not (isinstance(e, Sending) and e.again)]
        super()._perform([e for e in told if not cut or isinstance(e, Firing | Taken | Sending)])
        if cut:
            del self.completing[before:]
            self._crash(self.acting)
        for effect in effects:
            if isinstance(effect, Sending) and effect.again and not cut:
                self._completes(effect.place, effect.entry)
        for effect in effects:
            if isinstance(effect, Sending) and not cut:
                taken = self.controllers[self.acting].sent(effect.place, effect.entry)
                store(storage, (e for e in taken if isinstance(e, Keep) and not self._is_forgotten(e)))

    def _sent(self, place: str, entry: int) -> None:
        """It is done where the command is known to have left."""

    def _is_forgotten(self, write: Keep) -> bool:
        whose, prefix = self.forgets
        return whose == ("controllers" if self.acting in self.controllers else "coordinator") and write.key.startswith(
            prefix
        )

    def _completes(self, place: str, entry: int) -> None:
        if completion := self.net.place(place).completion:
            self.completing.append((completion, entry))

    def _crash(self, name: str) -> None:
        self.crashed += 1
        kept = self.kept[name]
        if name in self.coordinators:
            self.coordinators[name] = type(self.coordinators[name]).restored(self.decomposition, kept, name)
        else:
            before = self.controllers[name]
            self.controllers[name] = after = type(before).restored(self.decomposition, name, kept)
            after.held = True  # also where nothing is left of what it kept
        self._act(name, self._machine(name).start())
        if name in self.controllers:
            for signal in self.controllers[name].subnet.signals:
                if signal.name in self.values and self.random.random() < 0.7:
                    self._read(signal.name)

    def _resume(self, controller: LocalController) -> None:
        """The operator resumes: the driver is asked first, and knows what it received."""
        self.acting = controller.name
        for place, entry in controller.commands.questions:
            answer = Answer.WORKING if (place, entry) in self.received else Answer.NOT_RECEIVED
            if (place, entry) in self.received and self.random.random() < 0.5:
                answer = Answer.DONE
            self._perform(controller.answer(place, entry, answer))
        if self.controllers[controller.name] is controller:
            self._perform(controller.resume())

    def _quieten(self, *, fire: bool) -> None:
        self.crashes = 0.0
        for controller in list(self.controllers.values()):
            if controller.held:
                self._resume(controller)
        for signal in self.sensors:
            self._read(signal)
        for name in self.coordinators:
            self._act(name, self.coordinators[name].permit(None if fire else 0))
        before = self._firings()
        for _ in range(1000):
            for name, controller in self.controllers.items():
                self._act(name, [*(controller.fire() if fire else []), *controller.report(), *controller.resend()])
            for name in self.coordinators:
                self._act(name, self.coordinators[name].resend())
            for _ in range(100):  # not all: what is asked again at once, and refused, waits for what is repeated above
                if self.in_flight:
                    self._receive(self.in_flight.pop(0))
            if (not self.in_flight and all(each.idle for each in self.coordinators.values())) or (
                fire and self._firings() > before
            ):
                return

    def finished(self, steps: int) -> int:
        """Run, replay on the central net, and return the number of firings."""
        trace = self.run(steps)
        assert not [command for command, times in self.issued.items() if times > 1]
        return replay(self.net, trace).firings


NETWORKS = [Network(), Network(loss=0.3), Network(duplication=0.4), Network(loss=0.2, duplication=0.2)]
SMALL = ["local_conflict", "local_gate", "local_output_conflict", "read_before_order", "remote_gate", "ring"]


@pytest.mark.seeds
@pytest.mark.parametrize("network", NETWORKS, ids=str)
def test_traces_through_crashes_are_traces_of_the_central_net(network: Network) -> None:
    for name in SMALL:
        assert sum(Crashing(split(load_net(name)), seed, network).finished(150) for seed in seeds(15)) >= 15


@pytest.mark.seeds
@pytest.mark.parametrize("cell", ["one_robot", "two_robots_separate"])
def test_cells_go_on_through_crashes(cell: str) -> None:
    for seed in seeds(2):
        simulation = Crashing(split(catalogue_net(cell)), seed, NETWORKS[3], crashes=0.01)
        assert simulation.finished(4000) > 10
        assert simulation.crashed > 10


@examples(150)
@given(owned_nets(), st.integers(0, 2**16), st.sampled_from(NETWORKS))
def test_random_nets_go_on_through_crashes(net: Net, seed: int, network: Network) -> None:
    Crashing(split(net), seed, network).finished(300)


@pytest.mark.parametrize(
    "forgets",
    [
        *(("controllers", key) for key in ("word", "promise/", "closed", "command/", "epoch")),
        *(("coordinator", key) for key in ("round/", "epoch")),
    ],
    ids="-".join,
)
def test_nothing_that_is_kept_is_kept_for_nothing(forgets: tuple[str, str]) -> None:
    decompositions = [split(catalogue_net("one_robot")), *(split(load_net(name)) for name in SMALL)]
    decompositions += [split(owned_net(seed)) for seed in range(20)]
    for seed in range(20):
        for decomposition in decompositions:
            try:
                Crashing(decomposition, seed, NETWORKS[3 - seed % 4], forgets=forgets).finished(400)
            except (InputError, ProtocolError, ProgressLostError, AssertionError):
                return
    pytest.fail("no run shows that it was forgotten")


def restarted(controller: LocalController, decomposition: Decomposition, kept: list[Effect]) -> LocalController:
    """The controller after a crash, from the writes in these effects."""
    storage: dict[str, Stored] = {}
    store(storage, kept)
    return LocalController.restored(decomposition, controller.name, storage)


def robot_on_its_way() -> tuple[Decomposition, LocalController, list[Effect]]:
    """The robot's controller after G2, whose command is issued, and all that it has done."""
    decomposition = split(catalogue_net("one_robot"))
    controller = LocalController(decomposition, "robot")
    effects = controller.start()
    effects += controller.receive(VoteRequest("robot", 0, ("G2",), 0, -1))
    effects += controller.receive(Decision("robot", 0, "G2", 0, -1))
    assert Sending("robot.to_cv1", 1) in effects
    return decomposition, controller, effects


def test_controller_that_restarts_is_held_until_it_knows_what_became_of_its_commands() -> None:
    decomposition, controller, kept = robot_on_its_way()
    after = restarted(controller, decomposition, kept)
    assert (after.marking, after.epoch, after.held) == (controller.marking, 1, True)
    assert after.commands.questions == (("robot.to_cv1", 1),)
    with pytest.raises(ProtocolError, match="without knowing"):
        after.resume()
    after.answer("robot.to_cv1", 1, Answer.UNKNOWN)
    with pytest.raises(ProtocolError, match="without knowing"):
        after.resume()


def test_command_that_was_not_received_is_sent_again_under_its_number_when_resumed() -> None:
    decomposition, controller, kept = robot_on_its_way()
    after = restarted(controller, decomposition, kept)
    assert after.answer("robot.to_cv1", 1, Answer.NOT_RECEIVED) == []
    assert after.commands.owed == (("robot.to_cv1", 1),)
    assert after.resume() == [Sending("robot.to_cv1", 1, again=True)]
    assert after.resume() == []


def test_command_that_is_done_completes_and_is_not_sent_again() -> None:
    decomposition, controller, kept = robot_on_its_way()
    after = restarted(controller, decomposition, kept)
    told = after.answer("robot.to_cv1", 1, Answer.DONE)
    assert Taken("robot.at_cv1", value=True) in told
    assert after.resume() == []
    again = restarted(after, decomposition, [*kept, *told])
    assert again.commands.questions == ()


def test_decision_of_a_promise_from_before_the_restart_is_applied_and_its_command_owed() -> None:
    decomposition = split(catalogue_net("one_robot"))
    controller = LocalController(decomposition, "robot")
    kept = [*controller.start(), *controller.receive(VoteRequest("robot", 0, ("G2",), 0, -1))]
    after = restarted(controller, decomposition, kept)
    assert [vote.promised for vote in after.resend() if isinstance(vote, Vote)] == [{"G2"}]
    effects = after.receive(Decision("robot", 0, "G2", 0, -1))
    assert not [effect for effect in effects if isinstance(effect, Sending)]
    assert after.commands.owed == (("robot.to_cv1", 1),)
    assert Sending("robot.to_cv1", 1) in after.resume()


def test_held_controller_promises_nothing_more() -> None:
    decomposition, controller, kept = robot_on_its_way()
    after = restarted(controller, decomposition, kept[:1])
    (vote,) = after.receive(VoteRequest("robot", 1, ("G2",), 0, -1))
    assert vote == Vote("robot", 1, frozenset(), Readiness(1 << EPOCH_BITS, frozenset()))
    assert after.fire() == after.report() == []


def test_sensor_is_unknown_after_a_restart_until_it_is_told_anew() -> None:
    decomposition = split(catalogue_net("one_robot"))
    controller = LocalController(decomposition, "conveyor")
    controller.read("conveyor.part_at_entry", value=True)
    after = restarted(controller, decomposition, controller.start())
    after.resume()
    after.read("conveyor.part_at_end", value=False)
    for value, ready in ((None, False), (True, True)):
        if value is not None:
            assert after.read("conveyor.part_at_entry", value=value) == [Taken("conveyor.part_at_entry", value)]
        (report,) = after.report()
        assert isinstance(report, Report)
        assert ("G1" in report.readiness.transitions) is ready


def test_vote_of_a_round_that_a_restart_has_forgotten_is_answered_by_its_abort() -> None:
    decomposition = split(load_net("ring"))
    after = Coordinator.restored(decomposition, {"epoch": 0})
    hello = after.start()
    assert {effect.controller for effect in hello if isinstance(effect, Hello)} == set(after.seen)
    effects = after.receive(Vote("c1", 7, frozenset({"G"}), Readiness(0, frozenset())))
    assert [(e.round, e.committed, e.epoch) for e in effects if isinstance(e, Decision)] == [(7, None, 1)]
    assert not [effect for effect in after.resend() if isinstance(effect, Hello) and effect.controller == "c1"]


def test_promise_below_the_closed_rounds_has_ended() -> None:
    controller = LocalController(split(load_net("local_gate")), "c1")
    controller.receive(VoteRequest("c1", 3, ("G",), 0, -1))
    assert controller.promises[3].promised
    effects = controller.receive(Hello("c1", 1 << EPOCH_BITS, -1, 1))
    assert Keep("promise/3", None) in effects
    assert not controller.promises


def test_committed_round_is_finished_after_a_restart_and_its_number_never_given_again() -> None:
    decomposition = split(load_net("ring"))
    after = Coordinator.restored(decomposition, {"epoch": 4, "round/9": ["G", "G"]})
    decisions = [effect for effect in after.start() if isinstance(effect, Decision)]
    assert {(d.round, d.committed) for d in decisions} == {(9, "G")}
    assert after.next_round == 5 << EPOCH_BITS
    assert after.closed_below == 9


def test_turns_of_an_arbiter_outlive_a_restart() -> None:
    net = Net(
        "turns",
        tuple(Place(f"a.{p}", "a", marked=p == "p") for p in "pqr"),
        (
            *(Transition(t, ("a.p",), (f"a.{p}",)) for t, p in (("A", "q"), ("B", "r"))),
            *(Transition(f"{t}-back", (f"a.{p}",), ("a.p",)) for t, p in (("A", "q"), ("B", "r"))),
        ),
        controllers=(Controller("a"),),
        arbiters=(Arbiter("next", ("A", "B"), ArbitrationRule.ROTATION),),
    )
    decomposition = split(net)
    controller = LocalController(decomposition, "a")
    kept, fired = controller.start(), []
    for _ in range(6):
        effects = controller.fire()
        kept += effects
        fired += [effect.transition for effect in effects if isinstance(effect, Firing)]
        controller = restarted(controller, decomposition, kept)
        kept += controller.start()
        controller.resume()
    assert fired == ["A", "A-back", "B", "B-back", "A", "A-back"]


def test_both_of_two_commands_that_share_a_completion_are_asked_after_and_over_together() -> None:
    fill, shared = Command("FILL", "RUN"), Command("HEAT", "RUN")
    net = Net(
        "both",
        (
            Place("a.p", "a", marked=True),
            Place("a.fill", "a", command=fill, completion="a.done"),
            Place("a.heat", "a", command=shared, completion="a.done"),
        ),
        (Transition("begin", ("a.p",), ("a.fill", "a.heat")),),
        (Signal("a.done", "a", SignalKind.COMPLETION),),
        (Controller("a"),),
    )
    decomposition = split(net)
    controller = LocalController(decomposition, "a")
    kept = [*controller.start(), *controller.fire()]
    again = restarted(controller, decomposition, kept)
    assert again.commands.questions == (("a.heat", 2), ("a.fill", 1))
    for place, entry in again.commands.questions:
        again.answer(place, entry, Answer.NOT_RECEIVED)
    assert {(e.place, e.entry) for e in again.resume() if isinstance(e, Sending)} == {("a.fill", 1), ("a.heat", 2)}
    kept += again.read("a.done", value=True, entry=2)
    assert not restarted(again, decomposition, kept).commands.questions


def test_a_token_waits_on_its_place_until_a_driver_has_the_command_that_has_no_completion() -> None:
    text = """\
firable: 1
cell: flash
controllers:
  lamp:
    start: dark
    places:
      dark:
      lit: {send: {machine: L, command: FLASH}}
transitions:
  light: {from: lamp.dark, to: lamp.lit}
  fade:  {from: lamp.lit, to: lamp.dark}
"""
    decomposition = split(parse_net(text))
    lamp = LocalController.restored(decomposition, "lamp", {})
    kept: dict[str, Stored] = {}

    def keep(effects: list[Effect]) -> list[Effect]:
        for effect in effects:
            if isinstance(effect, Keep) and effect.value is not None:
                kept[effect.key] = effect.value
        return effects

    keep(lamp.start())
    assert Sending("lamp.lit", 1) in keep(lamp.fire())
    assert lamp.fire() == [], "the command has not left yet"
    again = LocalController.restored(decomposition, "lamp", kept)
    assert again.commands.questions == (("lamp.lit", 1),)
    again.answer("lamp.lit", 1, Answer.NOT_RECEIVED)
    assert again.resume() == [Sending("lamp.lit", 1, again=True)]
    assert again.fire() == []
    again.sent("lamp.lit", 1)
    assert Firing("fade") in again.fire()
    for received in (Answer.DONE, Answer.WORKING):
        found = LocalController.restored(decomposition, "lamp", kept)
        found.answer("lamp.lit", 1, received)
        assert found.resume() == []
        assert Firing("fade") in found.fire()
