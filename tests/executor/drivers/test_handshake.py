"""Channels of devices that know no numbers: bits for request and done, and what they leave open."""

import pytest

from firable.executor.drivers.binding import ChannelDocument
from firable.executor.drivers.channels import Said
from firable.executor.drivers.device import Writes
from firable.executor.drivers.driver import Answer
from firable.executor.drivers.handshake import Handshake


def bits(*, taken: bool = True, failed: bool = True, done: bool = True) -> Handshake:
    has = {"taken": taken, "failed": failed, "done": done}
    document = ChannelDocument.model_validate({"request": "q", **{key: key for key, there in has.items() if there}})
    one = Handshake(document, frozenset("ab"))
    for key, there in has.items():
        if there:
            one.shows(key, 0)
    return one


def put(one: Handshake) -> Writes | None:
    """What is written, and confirmed."""
    if (some := one.next_writes()) is not None:
        one.written()
    return some


def said(one: Handshake, key: str, value: int) -> list[tuple[str, Said]]:
    return [(outcome.order.place, outcome.said) for outcome in one.shows(key, value)]


def test_handshake_has_four_edges_and_the_next_command_waits_for_the_last_of_them() -> None:
    one = bits()
    one.send("a", 1, "", (("code", 5),))
    one.send("b", 1, "", ())
    assert put(one) == (("q", False),)  # whatever it was before
    assert put(one) == (("code", 5), ("q", True))
    assert put(one) is None
    assert said(one, "taken", 1) == [("a", Said.TAKEN)]
    assert said(one, "taken", 1) == []
    assert said(one, "done", 1) == [("a", Said.DONE)]
    assert said(one, "done", 1) == []
    assert put(one) == (("q", False),)
    assert put(one) is None
    said(one, "taken", 0)
    assert put(one) is None
    said(one, "done", 0)
    assert put(one) == (("q", True),)


def test_done_that_stands_there_from_before_is_of_no_command() -> None:
    one = bits(taken=False)
    assert said(one, "done", 1) == []
    one.send("a", 1, "", ())
    assert put(one) == (("q", False),)
    assert said(one, "done", 1) == []
    assert put(one) is None
    assert said(one, "done", 0) == []
    assert put(one) == (("q", True),)
    assert said(one, "done", 1) == [("a", Said.TAKEN), ("a", Said.DONE)]


@pytest.mark.parametrize("when", ["never came", "came", "was done"])
def test_request_whose_confirmation_was_lost_is_repeated_as_a_level_and_never_as_an_edge(when: str) -> None:
    one = bits()
    one.send("a", 1, "", ())
    put(one)
    assert one.next_writes() == (("q", True),)  # and the connection fails
    if when != "never came":
        assert said(one, "taken", 1) == [("a", Said.TAKEN)]
    if when == "was done":
        assert said(one, "done", 1) == [("a", Said.DONE)]
    assert one.connected_again() is None
    assert put(one) == {"never came": (("q", True),), "came": None, "was done": (("q", False),)}[when]


def test_failure_is_told_and_ends_the_handshake() -> None:
    one = bits()
    one.send("a", 1, "", ())
    put(one)
    put(one)
    assert said(one, "failed", 1) == [("a", Said.TAKEN), ("a", Said.FAILED)]
    assert put(one) == (("q", False),)


def test_command_that_was_given_up_stands_in_the_way_until_the_device_has_let_go_of_it() -> None:
    for taken in (True, False):
        one = bits(taken=taken)
        one.send("a", 1, "", ())
        put(one)
        put(one)
        one.withdraw("a")
        one.send("b", 1, "", ())
        assert put(one) is None  # it may have seen the request
        if taken:
            said(one, "taken", 1)
            assert put(one) == (("q", False),)
            assert said(one, "done", 1) == []
            said(one, "done", 0)
            assert put(one) is None
            said(one, "taken", 0)
        else:
            assert said(one, "done", 1) == [("a", Said.TAKEN), ("a", Said.DONE)]
            assert put(one) == (("q", False),)
            said(one, "done", 0)
        assert put(one) == (("q", True),)


def test_request_that_was_given_up_before_it_is_repeated_falls() -> None:
    """A machine would move by it when its line is back, by no token."""
    one = bits()
    one.send("a", 1, "", (("code", 5),))
    assert put(one) == (("q", False),)
    assert one.next_writes() == (("code", 5), ("q", True))
    assert one.connected_again() is None  # nobody knows whether it has come
    one.withdraw("a")
    assert put(one) == (("q", False),)
    assert put(one) is None


def test_what_waits_behind_another_is_given_up_without_a_word() -> None:
    one = bits()
    one.send("a", 1, "", ())
    one.withdraw("a")
    assert put(one) is None
    assert not one.is_writing


def test_device_that_shows_nothing_any_more_of_what_it_had_is_told() -> None:
    one = bits()
    one.send("a", 1, "", ())
    put(one)
    put(one)
    said(one, "taken", 1)
    said(one, "taken", 0)
    forgotten = one.connected_again()
    assert forgotten is not None
    assert forgotten.place == "a"


def test_request_may_fall_by_what_is_taken_where_nothing_shows_what_is_done() -> None:
    one = bits(done=False, failed=False)
    one.send("halt", 1, "", ())
    put(one)
    put(one)
    assert said(one, "taken", 1) == [("halt", Said.TAKEN)]
    assert put(one) == (("q", False),)


@pytest.mark.parametrize(
    ("shown", "place", "stopped", "failed", "answer"),
    [
        ({}, "a", False, True, Answer.UNKNOWN),  # done and cleared, or never received
        ({"done": 1}, "a", False, True, Answer.UNKNOWN),  # of this command, or of the one before
        ({"taken": 1}, "a", False, True, Answer.WORKING),
        ({"taken": 1}, "a", True, True, Answer.WORKING),
        ({"taken": 1}, "a", True, False, Answer.UNKNOWN),
        ({"taken": 1, "failed": 1}, "a", False, True, Answer.UNKNOWN),
        ({"taken": 1}, "halt", False, True, Answer.UNKNOWN),  # it is at something
    ],
)
def test_after_a_restart_only_a_machine_at_work_says_something(
    shown: dict[str, int], place: str, stopped: bool, failed: bool, answer: Answer
) -> None:
    one = bits(failed=failed)
    for key, value in shown.items():
        one.shows(key, value)
    assert one.answer(place, 3, stopped=stopped) is answer
    told = said(one, "done", 1)
    assert told == ([(place, Said.DONE)] if answer is Answer.WORKING else [])


def names(one: Handshake) -> bool:
    """Whether it names its newest order as one that the device does not show to have."""
    return one.unanswered is not None and one.unanswered is one.current


def test_command_that_the_device_does_not_show_to_have_is_named_until_it_does() -> None:
    one = bits()
    one.send("a", 1, "", ())
    put(one)
    assert not names(one)  # only that nothing is asked for is written yet
    put(one)
    assert names(one)
    said(one, "taken", 1)
    assert not names(one)
    slow = bits(taken=False)  # which shows nothing before it is done
    slow.send("a", 1, "", ())
    put(slow)
    put(slow)
    assert not names(slow)


def test_command_that_waits_for_a_bit_that_was_never_shown_is_named() -> None:
    one = Handshake(ChannelDocument(request="q", taken="t", done="d"), frozenset("a"))
    one.shows("taken", 0)
    one.send("a", 1, "", ())
    put(one)
    assert names(one)
    one.shows("done", 1)  # of the command before, which is to be over first
    assert not names(one)
