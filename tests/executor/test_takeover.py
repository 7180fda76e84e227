"""What is taken over from an old bundle to a new one, and what is refused, with every reason."""

from __future__ import annotations

import pytest
from support.takeovers import OLD, WITH_INSPECTION, cell, joint_marking, kept_in

from firable.executor.drivers.binding import ChannelDocument
from firable.executor.drivers.channels import Channel
from firable.executor.journal.takeover import take_over
from firable.executor.links.link import COORDINATOR
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import EPOCH_BITS, Keep, Sending, Stored, VoteRequest
from firable.nets.diagnostics import InputError

OTHER_COMMAND = OLD.replace("command: WORK", "command: GRIND")
MORE_COMMANDS = WITH_INSPECTION.replace("      worked_out:", "      worked_out: {send: {machine: R, command: SHOW}}")
OTHER_NAME = OLD.replace("working", "at_work")


def reasons(error: InputError) -> str:
    assert {diagnostic.code for diagnostic in error.diagnostics} == {"F5050"}
    return "\n".join(diagnostic.message for diagnostic in error.diagnostics)


def test_the_marking_is_taken_over_by_the_names_of_its_places_and_all_are_held() -> None:
    old, new = cell(OLD), cell(WITH_INSPECTION)
    marking = {"robot.worked_out", "table.full"}
    moved = take_over(old, new, kept_in(marking, old), [COORDINATOR])
    assert set(moved.marking) == marking
    assert joint_marking(new, moved.kept) == marking


def test_nothing_said_under_the_old_net_is_new_under_the_new_one() -> None:
    old, new = cell(OLD), cell(WITH_INSPECTION)
    moved = take_over(old, new, kept_in({"robot.free", "table.empty"}, old), [COORDINATOR])
    coordinator = Coordinator.restored(new, moved.kept[COORDINATOR])
    robot = LocalController.restored(new, "robot", moved.kept["robot"])
    assert coordinator.next_round >= robot.above[COORDINATOR].closed_below > (4 << EPOCH_BITS)
    assert robot.epoch > 4
    late = VoteRequest("robot", (4 << EPOCH_BITS) + 17, ("begin",), 0, 0)
    assert not any(isinstance(effect, Keep) and effect.key.startswith("promise") for effect in robot.receive(late))


def test_a_command_under_way_keeps_its_number_and_is_asked_after() -> None:
    old, new = cell(OLD), cell(WITH_INSPECTION)
    under_way: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "issued")}
    moved = take_over(old, new, kept_in({"robot.working", "table.full"}, old, robot=under_way), [COORDINATOR])
    robot = LocalController.restored(new, "robot", moved.kept["robot"])
    assert moved.under_way == ("robot.working",)
    assert robot.commands.questions == (("robot.working", 7),)
    assert robot.read("robot.worked", value=True, entry=6) == []


def test_a_command_that_a_time_limit_gave_up_is_asked_after_and_hinders_no_new_net_that_gives_it_up_too() -> None:
    """The machine hangs, and the new net is there because of that."""
    text = OLD.replace("until: worked}", "until: worked, within: 5s}").replace(
        "transitions:", "transitions:\n  again: {from: robot.working_fault, to: robot.working}"
    )
    old, new = cell(text), cell(text.replace("5s", "9s"))
    given_up: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "issued")}
    kept = kept_in({"robot.working_fault", "table.full"}, old, robot=given_up)
    moved = take_over(old, new, kept, [COORDINATOR])
    robot = LocalController.restored(new, "robot", moved.kept["robot"])
    assert moved.under_way == ("robot.working",)
    assert robot.commands.questions == (("robot.working", 7),)
    robot.answer("robot.working", 7, Answer.NOT_RECEIVED)
    assert not any(isinstance(effect, Sending) and effect.place == "robot.working" for effect in robot.resume())
    untimed = text.replace(", within: 5s", "").replace("      free:\n", "      free:\n      working_fault:\n")
    for other in (text.replace("command: WORK", "command: GRIND"), untimed):
        with pytest.raises(InputError, match="has gone on"):
            take_over(old, cell(other), kept, [COORDINATOR])


def test_the_number_of_a_command_that_is_over_goes_on() -> None:
    old, new = cell(OLD), cell(WITH_INSPECTION)
    over: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "over")}
    moved = take_over(old, new, kept_in({"robot.free", "table.empty"}, old, robot=over), [COORDINATOR])
    robot = LocalController.restored(new, "robot", moved.kept["robot"])
    assert robot.commands.entry("robot.worked") == 7
    assert not robot.commands.questions


@pytest.mark.parametrize(
    ("text", "marking", "more", "reason"),
    [
        (OTHER_NAME, {"robot.working", "table.full"}, {}, "the new net has no place of that name"),
        (OTHER_COMMAND, {"robot.working", "table.full"}, {}, "sends another command"),
        (WITH_INSPECTION, {"robot.free", "table.empty"}, {"robot": {"promise/3": ("begin",)}}, "has promised"),
        (WITH_INSPECTION, {"robot.free", "table.empty"}, {COORDINATOR: {"round/3": ("begin",)}}, "not everybody"),
        (
            WITH_INSPECTION,
            {"robot.worked_out", "table.full"},
            {"robot": {"command/signal/robot.worked": ("robot.working", 7, "issued")}},
            "its token has gone on",
        ),
    ],
)
def test_what_cannot_be_carried_over_is_refused(
    text: str, marking: set[str], more: dict[str, dict[str, Stored]], reason: str
) -> None:
    old = cell(OLD)
    with pytest.raises(InputError) as caught:
        take_over(old, cell(text), kept_in(marking, old, **more), [COORDINATOR])
    assert reason in reasons(caught.value)


def test_a_command_under_way_is_not_carried_to_a_net_in_which_its_machine_would_not_know_its_number() -> None:
    """The channel of a machine numbers its commands by the places that send any."""
    old, new = cell(OLD), cell(MORE_COMMANDS)
    record: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "issued")}
    numbers = []
    for net in (old.net, new.net):
        document = ChannelDocument(number="holding 1", taken="input 1", done="input 2")
        channel = Channel(document, [place.name for place in net.places if place.command], frozenset())
        numbers.append(channel.number("robot.working", 7))
    assert numbers[0] != numbers[1]
    marking = {"robot.working", "table.full"}
    with pytest.raises(InputError) as caught:
        take_over(old, new, kept_in(marking, old, robot=record), [COORDINATOR])
    assert "'R' is commanded by other places in the new net" in reasons(caught.value)
    over: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "over")}
    assert set(take_over(old, new, kept_in(marking, old, robot=over), [COORDINATOR]).marking) == marking


def test_a_place_that_is_renamed_is_no_matter_while_it_is_empty() -> None:
    old, new = cell(OLD), cell(OTHER_NAME)
    over: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "over")}
    moved = take_over(old, new, kept_in({"robot.free", "table.empty"}, old, robot=over), [COORDINATOR])
    assert joint_marking(new, moved.kept) == {"robot.free", "table.empty"}
    robot = LocalController.restored(new, "robot", moved.kept["robot"])
    assert robot.commands.questions == robot.commands.owed == ()
    assert robot.resume() == []
    entered = robot.commands.enter(new.net.place("robot.at_work"), held=False)
    assert Sending("robot.at_work", 8) in entered


def test_all_reasons_are_told_together() -> None:
    old = cell(OLD)
    kept = kept_in({"robot.working", "table.full"}, old, robot={"promise/3": ("begin",)})
    with pytest.raises(InputError) as caught:
        take_over(old, cell(OTHER_NAME), kept, [COORDINATOR])
    assert len(caught.value.diagnostics) == 2
