"""How the checker says no: the evidence does not show what it claims, or it is not known within the time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NoReturn, TypeVar

from firable.analysis.deadline import Deadline
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Marking, Net

T = TypeVar("T")


class TimeIsOverError(Exception):
    """The time for a check ended before it did: nothing is known."""

    def __init__(self, reason: str = "the time was over") -> None:
        super().__init__(reason)


def ticking(deadline: Deadline) -> Callable[[], None]:
    """What raises `TimeIsOverError` once there is no more time."""

    def tick() -> None:
        if deadline.over:
            raise TimeIsOverError

    return tick


def in_time(of: Iterable[T], deadline: Deadline) -> Iterator[T]:
    """The same, one by one, for as long as there is time; raises `TimeIsOverError` then."""
    for one in of:
        if deadline.over:
            raise TimeIsOverError
        yield one


def refuse(reason: str) -> NoReturn:
    """Raise `InputError` F6002: this does not show what it claims."""
    message = f"the evidence does not show what it claims: {reason}"
    hint = "it was edited, or the technique that made it is wrong; whether the claim is true is not known from it"
    raise InputError([Diagnostic("F6002", message, hint)])


def shown(net: Net, marking: Marking) -> str:
    """A marking for a message."""
    return "{" + ", ".join(net.names(marking)) + "}"
