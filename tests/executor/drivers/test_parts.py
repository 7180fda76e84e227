"""The parts of a driver, each alone: process image, completions, channels, and the simulated driver."""

import asyncio
import sys
from collections.abc import Iterable
from dataclasses import replace

import pytest
from support.cells import decomposition_of, plant_of

from firable.cli.main import EXTRAS
from firable.executor.cell.plant import Plant
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import Heard
from firable.executor.drivers.binding import NUMBER_MAX, ChannelDocument, SignalDocument, parse_binding, read_binding
from firable.executor.drivers.bound import BoundDriver, bound_driver
from firable.executor.drivers.channels import Channel, Order, Outcome, Said
from firable.executor.drivers.completions import Completions
from firable.executor.drivers.device import Value, Writes
from firable.executor.drivers.driver import Answer, Quality
from firable.executor.drivers.image import Image
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.operating.hosting import own_net
from firable.nets.catalogue import catalogue_path


def image(**options: object) -> Image:
    return Image({"s": SignalDocument.model_validate({"device": "d", "read": "p", **options})})


def test_image_tells_where_a_signal_stands_at_the_end_of_a_batch_and_counts_the_rest() -> None:
    one = image()
    assert [change.value for change in one.take([("p", 0)], 1.0)[0]] == [False]
    assert one.take([("p", 1), ("p", 0), ("p", 1), ("q", 1)], 2.0)[0][0].value is True
    assert one.readings["s"].coalesced == 2
    assert one.take([("p", 0), ("p", 1)], 3.0) == ([], [])
    assert (one.readings["s"].coalesced, one.readings["s"].at_seconds) == (4, 3.0)


def test_image_counts_edges_that_only_the_device_saw() -> None:
    one = image(edges="n")
    one.take([("p", 0), ("n", 65_530)], 1.0)
    one.take([("p", 1), ("n", 65_531)], 2.0)
    assert one.readings["s"].coalesced == 0
    one.take([("p", 1), ("n", 3)], 3.0)  # round the end of its register
    assert one.readings["s"].coalesced == 8
    one.lost("gone")
    one.take([("p", 1), ("n", 500)], 4.0)  # the device may have begun anew
    assert one.readings["s"].coalesced == 8


def test_image_inverts_a_signal_that_is_wired_so() -> None:
    assert image(invert=True).take([("p", False)], 0.0)[0][0].value is True


@pytest.mark.parametrize(
    ("policy", "value", "quality", "faults"),
    [
        ("hold", True, Quality.UNCERTAIN, []),
        ("0", False, Quality.BAD, []),
        ("1", True, Quality.BAD, []),
        ("fault", True, Quality.BAD, ["s"]),
    ],
)
def test_what_is_neither_0_nor_1_is_lost_by_the_policy_of_its_signal(
    policy: str, value: bool, quality: Quality, faults: list[str]
) -> None:
    one = image(on_loss=policy)
    one.take([("p", 1)], 1.0)
    changes, found = one.take([("p", 7)], 2.0)
    assert found == faults
    assert [change.value for change in changes] == ([value] if value is False else [])
    assert (one.readings["s"].value, one.readings["s"].quality) == (value, quality)
    assert "'p' shows 7" in one.readings["s"].why
    assert one.readings["s"].at_seconds == 1.0
    assert one.take([("p", 7)], 3.0) == ([], [])
    one.take([("p", 1)], 4.0)
    assert one.take([("p", 7)], 5.0)[1] == faults


def test_completion_needs_the_acknowledgement_of_its_own_entry_and_its_sensor() -> None:
    formed = Completions({"seen": False})
    formed.commanded("seen", 1)
    assert formed.shows("seen", value=True) is None
    assert formed.acknowledged("seen", 2) is None
    formed.commanded("seen", 2)  # the sensor still shows the outcome of the command before
    assert formed.acknowledged("seen", 1) is None
    assert formed.acknowledged("seen", 2) == 2
    assert formed.acknowledged("seen", 2) is None
    formed.commanded("blind", 1)
    assert formed.acknowledged("blind", 1) == 1


def channel(*places: str, answered: Iterable[str] = (), taken: bool = True, failed: bool = False) -> Channel:
    more = {**({"taken": "t"} if taken else {}), **({"failed": "f"} if failed else {})}
    document = ChannelDocument.model_validate({"number": "n", "done": "d", **more})
    return Channel(document, places, frozenset(answered))


def test_numbers_of_a_channel_differ_by_place_and_entry_and_fit_a_register() -> None:
    three = channel("a", "b", "c")
    numbers = [three.number(place, entry) for place in "abc" for entry in range(1, 10_000)]
    assert len(set(numbers)) == len(numbers)
    assert all(0 < three.number(place, entry) <= NUMBER_MAX for place in "abc" for entry in (21_844, 21_845, 10**9))


def after(one: Channel, **shown: Value) -> Writes | None:
    """What the channel writes once the device shows something."""
    for key, value in shown.items():
        one.shows(key, value)
    return one.next_writes()


def test_next_command_waits_until_the_device_has_the_one_before() -> None:
    one = channel("a", "b", answered="ab")
    first, second = one.number("a", 1), one.number("b", 1)
    one.send("a", 1, "", (("x", 5),))
    one.send("b", 1, "", ())
    assert after(one, taken=0, done=0) == (("x", 5), ("n", first))
    assert one.next_writes() is None
    one.written()
    assert one.next_writes() is None
    assert after(one, taken=first) == (("n", second),)


def test_number_that_the_device_shows_already_is_cleared_before_it_is_sent() -> None:
    one = channel("a", answered="a")
    number = one.number("a", 1)
    one.send("a", 1, "", ())
    assert after(one, taken=number, done=number) == (("n", 0),)
    one.written()
    assert after(one, taken=0, done=number) is None
    assert after(one, taken=0, done=0) == (("n", number),)
    assert [(told.said, told.order.entry) for told in one.shows("done", number)] == [(Said.TAKEN, 1), (Said.DONE, 1)]


def names(one: Channel) -> bool:
    """Whether it names its newest order as one that the device does not show to have."""
    return one.unanswered is not None and one.unanswered is one.current


def test_order_that_the_device_does_not_show_to_have_is_named_until_it_does() -> None:
    one = channel("a", answered="a")
    number = one.number("a", 1)
    one.send("a", 1, "", ())
    after(one, taken=number, done=0)
    assert names(one)  # its number is to be cleared first
    after(one, taken=0)
    assert not names(one)  # written, and not confirmed
    one.written()
    assert names(one)
    one.shows("taken", number)
    assert not names(one)
    blind = channel("a", answered="a", taken=False)
    blind.send("a", 1, "", ())
    after(blind, done=0)
    blind.written()
    assert not names(blind)  # it shows nothing before it is done


def test_write_that_failed_is_repeated_with_its_number_unless_the_device_has_it() -> None:
    for is_there in (False, True):
        one = channel("a", answered="a")
        number = one.number("a", 1)
        one.send("a", 1, "", ())
        assert after(one, taken=0, done=0) == (("n", number),)
        one.shows("taken", number if is_there else 0)
        assert one.connected_again() is None
        assert one.next_writes() == (None if is_there else (("n", number),))


def test_command_that_was_given_up_or_followed_by_another_of_its_place_is_not_sent_when_the_link_is_back() -> None:
    one = channel("a", "b", answered="ab")
    one.send("a", 1, "", ())
    one.send("b", 1, "", ())
    one.send("a", 2, "", ())
    assert after(one, taken=0, done=0) == (("n", one.number("b", 1)),)
    one.withdraw("a")
    one.withdraw("b")
    assert one.connected_again() is None  # the connection has failed before anybody knew whether it was written
    assert one.next_writes() is None
    assert not one.is_writing


GIVEN_UP = ("while it is awaited", "while the line is down", "while it is to be written again", "after a restart")


@pytest.mark.parametrize("taken", [True, False], ids=["taken", "blind"])
@pytest.mark.parametrize("when", GIVEN_UP)
def test_number_0_goes_out_before_what_follows_a_command_that_was_given_up_and_may_stand_at_the_device(
    when: str, taken: bool
) -> None:
    """Its number must not be taken with what the next one writes."""
    one = channel("move", "halt", answered=["move"], taken=taken)
    one.shows("done", 0)
    if when == GIVEN_UP[3]:
        one.expect("move", 1)
    else:
        one.send("move", 1, "", (("code", 1),))
        assert one.next_writes() == (("code", 1), ("n", one.number("move", 1)))
        if taken or when == GIVEN_UP[0]:  # of one that shows nothing, what is confirmed is had
            one.written() if taken else None
        if when == GIVEN_UP[2]:
            assert one.connected_again() is None
    one.withdraw("move")
    if when == GIVEN_UP[1] or (when == GIVEN_UP[0] and not taken):
        assert one.connected_again() is None
    one.send("halt", 1, "", (("code", 9),))
    assert one.next_writes() == (("n", 0),)
    one.written()
    halting = (("code", 9), ("n", one.number("halt", 1)))
    assert one.next_writes() == halting
    one.written()
    one.shows("taken", one.number("halt", 1))
    one.send("move", 2, "", ())
    assert one.next_writes() == (("n", one.number("move", 2)),), "0 goes out once"


def test_nothing_goes_out_before_what_follows_a_command_that_was_given_up_and_was_taken() -> None:
    one = channel("move", "halt", answered=["move"])
    one.send("move", 1, "", ())
    assert after(one, taken=0, done=0) == (("n", one.number("move", 1)),)
    one.withdraw("move")
    one.written()
    one.send("halt", 1, "", ())
    assert after(one, taken=one.number("move", 1)) == (("n", one.number("halt", 1)),)


def test_command_without_completion_is_asked_after_by_the_number_that_it_was_sent_with() -> None:
    one = channel("a", "b")
    one.send("b", 2, "", ())
    assert after(one, taken=0, done=0) == (("n", one.number("b", 2)),)
    again = channel("a", "b")
    for key in ("taken", "done"):
        again.shows(key, one.number("b", 2))
    assert again.answer("b", 3, stopped=False) is Answer.UNKNOWN
    assert again.answer("b", 2, stopped=False) is Answer.DONE


@pytest.mark.parametrize("shows", ["taken", "done", "failed"])
def test_command_is_taken_when_the_device_shows_its_number_and_told_so_once(shows: str) -> None:
    one = channel("a")
    number = one.number("a", 1)
    one.send("a", 1, "", ())
    after(one, taken=0, done=0)
    assert one.written() == ()  # it stands in a register, and no program has read it
    assert one.shows("taken", 0) == ()
    told = [each.said for _ in range(2) for each in one.shows(shows, number)]
    assert told[0] is Said.TAKEN
    assert told.count(Said.TAKEN) == 1


def test_without_a_number_of_what_was_taken_the_confirmed_write_must_do() -> None:
    one = channel("a", taken=False)
    one.send("a", 1, "", ())
    after(one, done=0)
    assert [told.said for told in one.written()] == [Said.TAKEN]
    assert [told.said for told in one.shows("done", one.number("a", 1))] == [Said.DONE]


def test_command_that_a_device_has_had_since_before_a_restart_is_not_told_as_taken_by_its_number_alone() -> None:
    one = channel("a", taken=True)
    one.shows("failed", one.number("a", 3))
    assert one.answer("a", 3, stopped=False) is Answer.UNKNOWN  # a person is asked, and no poll may answer instead
    assert one.shows("failed", one.number("a", 3)) == ()  # nor end what that person resumes
    one.shows("failed", "BadNoCommunication")
    assert one.shows("failed", one.number("a", 3)) == ()
    one.shows("failed", 0)
    assert one.shows("failed", one.number("a", 3)) == (Outcome(Order("a", 3, one.number("a", 3), ""), Said.FAILED),)


def begun() -> Channel:
    """A channel of which the device has taken the first command of `a`."""
    one = channel("a", answered="a")
    one.send("a", 1, "RUN", ())
    after(one, taken=0, done=0)
    one.written()
    one.shows("taken", one.number("a", 1))
    return one


def test_device_that_has_forgotten_a_command_is_not_given_it_again() -> None:
    one = begun()
    one.shows("taken", 0)  # it has been switched off and on
    forgotten = one.connected_again()
    assert forgotten is not None
    assert forgotten.place == "a"
    assert one.next_writes() is None


def test_device_whose_server_has_no_value_of_what_it_has_taken_has_not_forgotten_it() -> None:
    one = begun()
    number = one.number("a", 1)
    one.shows("taken", "BadWaitingForInitialData")
    assert one.connected_again() is None
    assert one.forgotten() is None
    one.shows("taken", number)
    assert one.forgotten() is None
    assert [told.said for told in one.shows("done", number)] == [Said.DONE]

    one.send("a", 2, "RUN", ())
    one.next_writes()
    one.written()
    one.shows("taken", one.number("a", 2))
    one.shows("taken", "BadWaitingForInitialData")
    assert one.connected_again() is None
    one.shows("taken", 0)
    assert one.forgotten() == Order("a", 2, one.number("a", 2), "RUN")
    assert one.next_writes() is None


@pytest.mark.parametrize("answered", ["", "a"])
def test_command_that_was_told_as_taken_by_its_confirmed_write_is_not_given_again(answered: str) -> None:
    one = channel("a", "b", answered=answered, taken=False)
    one.send("a", 1, "START", (("x", 5),))
    after(one, done=0)
    assert [told.said for told in one.written()] == [Said.TAKEN]
    one.shows("done", 0)  # it may have been switched off and on
    assert one.connected_again() is None
    assert one.next_writes() is None
    one.send("b", 1, "STOP", ())
    assert one.next_writes() == (("n", one.number("b", 1)),)


@pytest.mark.parametrize("taken", [False, True])
def test_command_that_was_told_as_taken_before_its_write_was_confirmed_stands_in_no_way_when_it_is_forgotten(
    taken: bool,
) -> None:
    one = channel("a", "b", taken=taken, failed=True)
    one.send("a", 1, "START", ())
    after(one, failed=0, done=0, **({"taken": 0} if taken else {}))
    shown = "taken" if taken else "failed"
    assert Said.TAKEN in [told.said for told in one.shows(shown, one.number("a", 1))]
    one.shows(shown, 0)  # it has been switched off and on, and its confirmation is lost
    one.connected_again()
    assert one.next_writes() is None
    assert not one.is_writing
    one.send("b", 1, "STOP", ())
    assert one.next_writes() == (("n", one.number("b", 1)),)


def test_command_that_an_old_connection_has_brought_late_is_neither_cleared_nor_given_again() -> None:
    one = channel("a")
    number = one.number("a", 1)
    one.send("a", 1, "START", ())
    after(one, taken=0, done=0)
    one.connected_again()
    assert [told.said for told in one.shows("taken", number)] == [Said.TAKEN]
    assert one.next_writes() is None
    assert not one.is_writing


def test_command_that_a_device_forgets_on_the_same_connection_is_told_once_and_one_that_it_has_done_is_not() -> None:
    one = channel("a", "b", answered="ab")
    first, second = one.number("a", 1), one.number("b", 1)
    one.send("a", 1, "RUN", ())
    assert one.forgotten() is None
    after(one, taken=0, done=0)
    one.written()
    assert one.forgotten() is None, "it has not shown that it has it"
    one.shows("taken", first)
    assert one.forgotten() is None
    one.shows("taken", 0)
    one.shows("done", first)  # in one batch
    assert one.forgotten() is None
    one.send("b", 1, "STOP", ())
    after(one)
    one.written()
    one.shows("taken", second)
    one.shows("taken", "?")  # which says nothing
    assert one.forgotten() is None
    one.shows("taken", first)
    assert one.forgotten() == Order("b", 1, second, "STOP")
    assert one.forgotten() is None


def test_answer_after_a_restart_is_made_of_the_numbers_shown() -> None:
    def answer(
        taken: Value | None, done: Value = 0, *, failed: Value | None = None, stopped: bool = False, place: str = "a"
    ) -> Answer:
        one = channel("a", "b", "stop", answered="ab", taken=taken is not None, failed=failed is not None)
        if taken is not None:
            one.shows("taken", taken)
        one.shows("done", done)
        if failed is not None:
            one.shows("failed", failed)
        return one.answer(place, 3, stopped=stopped)

    one = channel("a", "b", "stop", answered="ab")
    this, earlier, other, stop = (
        one.number("a", 3), one.number("a", 2), one.number("b", 9), one.number("stop", 1)
    )  # fmt: skip
    assert answer(this, this) is Answer.DONE
    assert answer(this) is Answer.WORKING
    # Without a number of what has failed, nobody knows what the safe outputs have ended.
    assert answer(this, stopped=True) is answer(this, failed=this, stopped=True) is Answer.UNKNOWN
    assert answer(this, failed=0, stopped=True) is Answer.WORKING
    assert answer(stop, place="stop") is Answer.UNKNOWN  # of another entry
    assert answer(one.number("stop", 3), place="stop", stopped=True) is Answer.DONE
    assert answer(0) is answer(earlier, earlier) is answer(other, other) is Answer.NOT_RECEIVED
    # A stop may have come after it, and says nothing of what it has overtaken.
    assert answer(stop) is Answer.UNKNOWN
    assert answer("?") is answer(None) is Answer.UNKNOWN


def test_simulated_driver_shows_its_image_and_says_what_became_of_a_command() -> None:
    async def main() -> list[Answer]:
        net = decomposition_of("one_robot").net
        driver = SimulatedDriver(Plant(plant_of("one_robot"), workpieces=1), net)
        heard = Heard()
        task = asyncio.create_task(driver.run(heard, heard))
        await asyncio.sleep(5)
        assert driver.readings()["conveyor.part_at_entry"].value is True
        place = net.place("conveyor.cv1_run")
        answers = [await driver.ask(place, 1)]
        driver.send(place, 1)
        answers.append(await driver.ask(place, 1))
        await asyncio.sleep(10)
        answers += [await driver.ask(place, 1), await driver.ask(place, 2)]
        assert ("conveyor.part_at_end", True, 1) in heard.signals
        task.cancel()
        return answers

    answers = run_in_virtual_time(main())
    assert answers == [Answer.NOT_RECEIVED, Answer.WORKING, Answer.DONE, Answer.NOT_RECEIVED]


@pytest.mark.parametrize(
    ("library", "device"),
    [
        ("pymodbus", "driver: modbus-tcp, host: localhost"),
        ("serial", "driver: modbus-rtu, port: /dev/ttyS0"),
        ("asyncua", "driver: opcua, url: 'opc.tcp://localhost:4840/'"),
        ("aiomqtt", "driver: mqtt, host: localhost"),
        ("serial", "driver: serial, port: /dev/ttyS0"),
    ],
)
def test_missing_library_ends_the_run_and_is_told_by_the_extra_that_brings_it(
    library: str, device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    binding = parse_binding(f"{{firable_bind: 1, cell: c, devices: {{d: {{{device}}}}}}}")  # needs no library
    for name in list(sys.modules):
        if name.partition(".")[0] == library:
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    heard = Heard()
    with pytest.raises(ModuleNotFoundError) as missing:
        asyncio.run(BoundDriver(binding, (), frozenset()).run(heard, heard))
    assert missing.value.name is not None
    assert missing.value.name.partition(".")[0] in EXTRAS


def test_a_host_without_machines_runs_with_the_binding_of_its_cell() -> None:
    async def main() -> None:
        heard, decomposition = Heard(), decomposition_of("one_robot")
        binding = read_binding(catalogue_path("one_robot").with_name("one_robot.bind.yaml"))
        without_contact = replace(binding, document=binding.document.model_copy(update={"emergency_stop": {}}))
        driver = bound_driver(without_contact, decomposition.net, own_net(decomposition, ("system",)))
        assert not driver.devices
        running = asyncio.create_task(driver.run(heard, heard))
        await asyncio.sleep(10)
        assert not running.done()
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running
        assert driver.unconfirmed == ()

    run_in_virtual_time(main())
