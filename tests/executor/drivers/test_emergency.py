"""The contacts of the emergency stop, each alone: closed as long as they have been read as closed without a break."""

import pytest

from firable.executor.drivers.binding import EmergencyDocument
from firable.executor.drivers.device import Value
from firable.executor.drivers.emergency import Contacts
from firable.executor.drivers.image import Image


def contacts(*, invert: bool = False) -> tuple[Contacts, Image]:
    door = Contacts({"door": EmergencyDocument(device="d", read="p", invert=invert)})
    return door, Image(door.signals())


def told(door: Contacts, image: Image, *values: Value) -> str:
    batch = [("p", value) for value in values]
    opened = door.opened(batch)
    image.take(batch, 1.0)
    if not opened:
        door.read(image.readings)
    return opened


def test_contact_that_was_not_read_is_open_and_nothing_of_it_is_told() -> None:
    door, image = contacts()
    assert not door.are_closed
    assert door.opened([("q", 0)]) == ""
    assert told(door, image, 1) == ""
    assert door.are_closed


@pytest.mark.parametrize(
    ("values", "told_of"),
    [((0,), "'door' is open"), ((1, 0, 1), "'door' is open"), (("?",), "'door' shows '?', which is neither 0 nor 1")],
)
def test_contact_that_opens_is_told_also_if_it_closes_in_the_same_batch(
    values: tuple[Value, ...], told_of: str
) -> None:
    door, image = contacts()
    told(door, image, 1)
    assert told(door, image, *values) == told_of
    assert not door.are_closed


def test_contact_that_is_wired_the_other_way_round_is_open_at_1() -> None:
    door, image = contacts(invert=True)
    assert told(door, image, 0) == ""
    assert door.are_closed
    assert told(door, image, 1) == "'door' is open"


def test_contact_whose_device_is_lost_is_open() -> None:
    door, image = contacts()
    told(door, image, 1)
    assert door.lost("no answer in time") == "'door' cannot be read: no answer in time"
    assert not door.are_closed
