"""Leaving a line to the program that has it, for whoever looks at devices, or sends something to them, by hand.

A serial line is one program's. The one that runs a cell closes it and opens it anew whenever something on it was
damaged, or its adapter was away. Whoever else tries again and again has it one day before that program does, which is
locked out then, and cannot even drive its safe outputs. So who comes by hand asks for a line that is in use once, and
never again. Rejected: to read along without the lock, as each would miss the bytes that the other has read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from firable.executor.drivers.binding import Binding
from firable.executor.drivers.device import Connection, DeviceKind, InUseError, Options, Point, Use, Wanted


def sparing(binding: Binding, told: Callable[[str, str], None]) -> Binding:
    """The binding for who leaves lines that are in use alone; `told` hears the device, and why."""
    kinds = {name: Sparing(kind, partial(told, name)) for name, kind in binding.kinds.items()}
    return replace(binding, kinds=kinds)


class Sparing:
    """A kind of device (`DeviceKind`), of which one is left alone from when its line was found to be another's."""

    def __init__(self, kind: DeviceKind, told: Callable[[str], None]) -> None:
        self.kind = kind
        self.told = told
        self.in_use: InUseError | None = None
        """With what its line was refused."""

    @property
    def options(self) -> type[Options]:
        """The model of its own keys in a binding."""
        return self.kind.options

    @property
    def through_broker(self) -> bool:
        """Whether a connection leads to who stands for the device."""
        return self.kind.through_broker

    def point_problem(self, point: Point, use: Use) -> str:
        """What is wrong with an address for a use."""
        return self.kind.point_problem(point, use)

    def load(self) -> None:
        """Import the library."""
        self.kind.load()

    async def connect(self, options: Any, wanted: Wanted) -> Connection:
        """Make a new connection, unless its line was in use once."""
        if self.in_use is None:
            try:
                return await self.kind.connect(options, wanted)
            except InUseError as error:
                self.in_use = error
                self.told(str(error))
        raise self.in_use
