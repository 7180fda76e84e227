"""The other end of a connection: something that serves points, and can be made to misbehave.

One for each protocol, beside the machine that stands behind it: `machine.py` for the conformance of drivers, `cell.py`
for a whole simulated cell. An end knows its protocol and no machine; a machine knows what its points mean and no
protocol. The misbehaviours are those that lines and devices have: cut, silent, slow, garbled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from firable.executor.drivers.device import Point, Value


@dataclass
class Faults:
    """How an end misbehaves at present."""

    silent: bool = False
    delay_s: float = 0.0
    garbage: bool = False


class FarEnd(Protocol):
    """A server of points."""

    faults: Faults

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        """Begin to serve; `written` is called with each value that a client writes, in order."""
        ...

    async def stop(self) -> None:
        """End, and close all connections."""
        ...

    def show(self, point: Point, value: Value) -> None:
        """Show a value to whoever reads it."""
        ...

    async def cut(self) -> None:
        """Let the line be cut: nothing passes any more, until `mend`."""
        ...

    async def mend(self) -> None:
        """Let the line be as before."""
        ...


class GoneError(Exception):
    """What an end cannot be without has ended, in a phrase."""


@runtime_checkable
class Dependent(Protocol):
    """An end that cannot be without another process."""

    async def gone(self) -> None:
        """Wait until that has ended; raises `GoneError` then."""
        ...
