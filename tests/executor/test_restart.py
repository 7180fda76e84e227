"""Machines that crash and are restored from what they kept: nothing is lost, nothing done twice, nothing moves."""

from collections.abc import Iterable

import pytest
from support.owned_nets import owned_net
from support.reference import load_net
from support.rehearsals import forgetting

from firable.decompose.splitting.cut import split
from firable.executor.protocol.commands import Answer, Commands
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import (
    EPOCH_BITS,
    Decision,
    Effect,
    Firing,
    Hello,
    Keep,
    ProtocolError,
    Readiness,
    Report,
    Sending,
    Stored,
    Taken,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.campaign import Failed, Run, rehearse
from firable.executor.simulation.judge import Subject
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
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

Machine = LocalController | Coordinator


def store(storage: dict[str, Stored], effects: Iterable[Effect]) -> None:
    """Write what is kept."""
    for effect in effects:
        if isinstance(effect, Keep) and effect.value is None:
            storage.pop(effect.key, None)
        elif isinstance(effect, Keep) and effect.value is not None:
            storage[effect.key] = effect.value


SMALL = ["local_conflict", "local_gate", "local_output_conflict", "read_before_order", "remote_gate", "ring"]
CRASHES = ("crash", "duplication", "delay")


@pytest.mark.parametrize(
    ("whose", "prefix"),
    [
        *(("controllers", key) for key in ("word", "promise/", "closed", "command/", "epoch")),
        *(("coordinators", key) for key in ("round/", "epoch")),
    ],
    ids="-".join,
)
def test_nothing_that_is_kept_is_kept_for_nothing(whose: str, prefix: str) -> None:
    subjects = [
        Subject(split(net)) for net in (catalogue_net("one_robot"), *map(load_net, SMALL), *map(owned_net, range(9)))
    ]
    for seed in range(400):
        run = Run(seed, CRASHES, 400)
        if isinstance(rehearse(subjects[seed % len(subjects)], run, forgetting(whose, prefix)), Failed):
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


def fill_and_heat() -> Decomposition:
    """A machine that is given two commands at once, of which one signal says that they are done."""
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
    return split(net)


def test_both_of_two_commands_that_share_a_completion_are_asked_after_and_over_together() -> None:
    decomposition = fill_and_heat()
    controller = LocalController(decomposition, "a")
    kept = [*controller.start(), *controller.fire()]
    again = restarted(controller, decomposition, kept)
    assert again.commands.questions == (("a.fill", 1), ("a.heat", 2))
    for place, entry in again.commands.questions:
        again.answer(place, entry, Answer.NOT_RECEIVED)
    assert again.resume() == [Sending("a.fill", 1, again=True), Sending("a.heat", 2, again=True)]
    kept += again.read("a.done", value=True, entry=2)
    assert not restarted(again, decomposition, kept).commands.questions


def test_commands_that_share_a_completion_and_are_owed_are_sent_in_their_order() -> None:
    (subnet,) = fill_and_heat().subnets
    commands = Commands(subnet, {})
    entered = ("a.fill", "a.heat")
    for place in entered:
        commands.enter(subnet.place(place), held=True)
    resumed = commands.resume(frozenset(entered))
    assert [e for e in resumed if isinstance(e, Sending)] == [Sending("a.fill", 1), Sending("a.heat", 2)]


def test_the_order_of_commands_is_that_of_their_entries_within_a_completion_and_else_that_of_their_first() -> None:
    places = [Place(f"a.{name}", "a", command=Command(name, "M"), completion="a.done") for name in "xyz"]
    lamp = Place("a.lamp", "a", command=Command("LIGHT", "L"))
    signals = (Signal("a.done", "a", SignalKind.COMPLETION),)
    commands = Commands(Net("three", (*places, lamp), (), signals, (Controller("a"),)), {})
    x, y, z = places
    for place in (lamp, z, lamp, x, y):
        commands.enter(place, held=True)
    assert commands.owed == (("a.lamp", 2), ("a.z", 1), ("a.x", 2), ("a.y", 3))
    commands.enter(z, held=True)
    assert commands.owed == (("a.lamp", 2), ("a.x", 2), ("a.y", 3), ("a.z", 4))


def test_a_crash_between_two_commands_that_share_a_completion_leaves_the_later_one_to_be_sent() -> None:
    """Were the later one sent first, its completion would be that of both, and the earlier one never sent."""
    decomposition = fill_and_heat()
    controller = LocalController(decomposition, "a")
    kept = [*controller.start(), *controller.fire()]
    controller = restarted(controller, decomposition, kept)
    for place, entry in controller.commands.questions:
        controller.answer(place, entry, Answer.NOT_RECEIVED)
    first, second = (effect for effect in controller.resume() if isinstance(effect, Sending))
    again = restarted(controller, decomposition, kept)
    kept += again.answer(first.place, first.entry, Answer.DONE)
    again.answer(second.place, second.entry, Answer.NOT_RECEIVED)
    assert again.resume() == [Sending("a.heat", 2, again=True)]
    assert Taken("a.done", value=True) not in kept


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
