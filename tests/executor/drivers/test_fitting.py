"""Bindings that do not fit their net, or in which commands of two machines stand in each other's way."""

import pytest
from support.small_binding import GOOD, NET, NET_TEXT, edited, refusal

from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.fitting import misfits
from firable.nets.text import parse_net


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("cell: c", "cell: d", "2: cell"),
        ("  M.moved: acknowledged\n", "", "13: signals"),
        ("M.moved: acknowledged", "M.moved: acknowledged\n  M.mooved: acknowledged", "16: M.mooved"),
        ("{device: plc, read: discrete 0, on_loss: hold, edges: input 7, invert: true}", "acknowledged", "14: M.there"),
        ("  M.stop: {device: plc, channel: M, write: {holding 2: 8}}\n", "", "16: commands"),
        ("M.stop: {device: plc, channel: M, write: {holding 2: 8}}", "M.idle: {device: plc, channel: M}", "18: M.idle"),
        ("M.move: {device: plc, channel: M", "M.move: {device: plc, channel: N", "17: channel"),
    ],
)
def test_a_binding_that_does_not_fit_the_net_is_refused(old: str, new: str, place: str) -> None:
    assert ("F5101", place) in refusal(edited(old, new), fit=True)


def test_commands_of_different_words_that_a_machine_cannot_tell_apart_are_refused() -> None:
    assert refusal(edited("{holding 2: 8}", "{holding 2: 7}"), fit=True) == [("F5102", "18: write")]
    bare = GOOD.replace(", write: {holding 2: 7}", "").replace(", write: {holding 2: 8}", "")
    assert refusal(bare, fit=True) == [("F5102", "18: M.stop")]
    texts = bare.replace("modbus-tcp", "mqtt").replace("M: {number: holding 1", "M: {command: holding 1")
    bound_driver(parse_binding(texts), NET)
    alike = GOOD.replace("{holding 2: 7}", "{coil 2: true}").replace("{holding 2: 8}", "{coil 2: 1}")
    assert refusal(alike, fit=True) == [("F5102", "18: write")]
    spelled = GOOD.replace("{holding 2: 8}", "{holding 02: 7}")  # the same register, which must not look like another
    assert refusal(spelled) == [("F5102", "18: holding 02")]


def test_commands_of_different_machines_that_are_written_alike_are_refused_and_one_at_two_places_is_not() -> None:
    stop = "command: STOP"
    for other, is_refused in (("{machine: M, command: MOVE}", False), ("{machine: N, command: MOVE}", True)):
        net = parse_net(NET_TEXT.replace(f"{{machine: M, {stop}}}", other))
        binding = parse_binding(edited("{holding 2: 8}", "{holding 2: 7}"))
        assert [problem.code for problem in misfits(binding, net)] == (["F5102"] if is_refused else [])


@pytest.mark.parametrize(
    ("owner", "machine", "is_refused"), [("B", "N", True), ("B", "M", False), ("M", "N", False), ("M", "M", False)]
)
def test_a_channel_is_for_one_machine_where_two_controllers_may_give_it_commands_at_once(
    owner: str, machine: str, is_refused: bool
) -> None:
    given = f"{{start: x, places: {{x: , y: {{send: {{machine: {machine}, command: RUN}}}}}}}}"
    text = NET_TEXT.replace("transitions:", f"  B: {given}\ntransitions:")
    if owner == "M":
        text = text.replace(given, "{start: x, places: {x: , y: }}").replace(
            "stop: {send: {machine: M, command: STOP}}", f"stop: {{send: {{machine: {machine}, command: STOP}}}}"
        )
    net = parse_net(f"{text}  t4: {{from: B.x, to: B.y}}\n  t5: {{from: B.y, to: B.x}}\n")
    more = "" if owner == "M" else "  B.y: {device: plc, channel: M, write: {holding 2: 9}}\n"
    found = misfits(parse_binding(GOOD + more, "c.bind.yaml"), net)
    assert [(one.code, one.message) for one in found] == (
        [("F5102", "'M' has commands of 'M', such as 'M.move', and here of 'N'")] if is_refused else []
    )
    assert [one.span.line for one in found if one.span is not None] == [19] * is_refused


@pytest.mark.parametrize("machine", ["N", "M"])
@pytest.mark.parametrize(
    ("written", "another", "is_refused"),
    [
        ("holding 2: 9", "", True),
        ("holding 2: 7", "", True),  # as M.move does, and M.stop does not
        ("holding 6: 9", "", False),
        ("holding 2: 9", "10.0.0.1", True),
        ("holding 2: 9", "10.0.0.2", False),
    ],
)
def test_two_machines_that_may_be_at_work_at_once_are_not_told_different_things_at_one_point(
    written: str, another: str, is_refused: bool, machine: str
) -> None:
    given = f"{{start: x, places: {{x: , y: {{send: {{machine: {machine}, command: RUN}}}}}}}}"
    text = NET_TEXT.replace("transitions:", f"  B: {given}\ntransitions:")
    net = parse_net(f"{text}  t4: {{from: B.x, to: B.y}}\n  t5: {{from: B.y, to: B.x}}\n")
    channel = "channels: {O: {number: holding 7}}"
    bound = edited("signals:", f"  second: {{driver: modbus-tcp, host: {another}, {channel}}}\nsignals:")
    to = "device: second, channel: O" if another else "device: plc, channel: N"
    binding = parse_binding(f"{bound if another else GOOD}  B.y: {{{to}, write: {{{written}}}}}\n")
    found = [(one.code, one.subject) for one in misfits(binding, net)]
    point = ("commands", "B.y", "write", "holding 2")
    assert found == ([("F5102", point)] if is_refused and machine == "N" else [])


def test_two_signals_may_be_read_at_one_point() -> None:
    net = parse_net(NET_TEXT.replace("inputs: there", "inputs: [there, gone]"))
    both = edited("  M.moved: acknowledged", "  M.gone: {device: plc, read: discrete 0}\n  M.moved: acknowledged")
    assert misfits(parse_binding(both), net) == ()


def test_it_is_for_one_machine_in_whatever_order_its_places_stand() -> None:
    text = NET_TEXT.replace(
        "transitions:", "  B: {start: x, places: {x: , y: {send: {machine: M, command: RUN}}}}\ntransitions:"
    )
    more = "  t4: {from: B.x, to: B.y}\n  t5: {from: B.y, to: B.x}\n"
    bound = "  B.y: {device: plc, channel: M, write: {holding 2: 9}}\n"
    for of_move, of_stop in (("M", "N"), ("N", "M")):
        named = text.replace("machine: M, command: MOVE", f"machine: {of_move}, command: MOVE")
        named = named.replace("machine: M, command: STOP", f"machine: {of_stop}, command: STOP")
        found = misfits(parse_binding(GOOD + bound, "c.bind.yaml"), parse_net(named + more))
        assert [one.code for one in found] == ["F5102"]
