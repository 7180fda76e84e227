"""Numbers of a manual, which begin with the digit of their table and count from 1, are never taken for addresses."""

import pytest
from support.small_binding import GOOD

from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.modbus_points import TABLES, counted_from_one
from firable.nets.diagnostics import InputError


def why_not(point: str, *, wire: bool = False) -> str:
    """Why a binding with this point is refused; empty where it is not."""
    text = GOOD.replace("edges: input 7", f"edges: {point}")
    try:
        parse_binding(text.replace("    alive:", "    addresses: wire\n    alive:") if wire else text)
    except InputError as error:
        (problem,) = error.diagnostics
        assert problem.code == "F5102"
        return problem.message
    return ""


@pytest.mark.parametrize(
    ("number", "meant"),
    [
        ("40012", "holding 11"),
        ("4x0012", "holding 11"),
        ("400012", "holding 11"),
        ("holding 400012", "holding 11"),
        ("40012.3", "holding 11.3"),
        ("30001", "input 0"),
        ("365536", "input 65535"),
        ("10001", "discrete 0"),
        ('"00001"', "coil 0"),
        ("coil 00001", "coil 0"),
    ],
)
def test_a_number_of_a_manual_is_told_as_the_point_that_it_is(number: str, meant: str) -> None:
    assert f"counted from 1, with its table before it, as manuals do, it is `{meant}`" in why_not(number)


@pytest.mark.parametrize(
    "number", ["holding 99999", "40000", "365537", "21", "4x12", "50001", "10001.3", "holding 0x0B"]
)
def test_what_is_no_number_of_a_manual_gets_no_other_reading(number: str) -> None:
    assert "without a 0 before it" in why_not(number)
    assert "manuals" not in why_not(number)


@pytest.mark.parametrize(
    ("point", "meant"),
    [
        ("holding 40012", "holding 11"),
        ("holding 40012.3", "holding 11.3"),
        ("holding 49999", "holding 9998"),
        ("input 30011", "input 10"),
        ("discrete 10001", "discrete 0"),
    ],
)
def test_a_number_that_may_be_either_is_refused_with_both_readings(point: str, meant: str) -> None:
    why = why_not(point)
    assert f"is mostly `{meant}`, counted from 1, with its table before it: write that, or `addresses: wire`" in why
    assert why_not(point, wire=True) == ""


@pytest.mark.parametrize("point", ["holding 39999", "holding 40000", "holding 50000", "input 40012", "discrete 30001"])
def test_a_number_that_is_of_no_manual_is_the_address_that_it_is(point: str) -> None:
    assert why_not(point) == ""


def test_no_low_address_looks_like_a_number_of_a_manual() -> None:
    assert not any(counted_from_one(str(number)) for number in range(10_001))
    assert {counted_from_one(f"{digit}0001") for digit in "0134"} == {f"{table} 0" for table in TABLES}
