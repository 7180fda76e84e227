"""A device at the far end of a serial line without wires, which speaks lines of text."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from serial import Serial

from firable.executor.drivers.device import LinkError, Point, Value
from firable.executor.drivers.far_side.end import Faults
from firable.executor.drivers.far_side.line import LineEnd, PseudoLine
from firable.executor.drivers.serial_line import Lines


class SerialEnd(LineEnd):
    """A device; the driver takes the port `line.near`, or a `link` to it."""

    def __init__(self, link: str = "") -> None:
        self.faults = Faults()
        self.line = PseudoLine(link)
        self.values: dict[Point, Value] = {}
        self.written: Callable[[Point, Value], None] = lambda _point, _value: None
        self.lines: Lines | None = None
        self.serving: asyncio.Task[None] | None = None

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        """Begin to serve."""
        self.written = written
        self.line.open()
        self.lines = Lines(Serial(self.line.far, 115_200, timeout=0, write_timeout=0))
        self.serving = asyncio.create_task(self._serve(self.lines))

    async def stop(self) -> None:
        """End, and take the line away."""
        if self.serving is not None:
            self.serving.cancel()
            await asyncio.gather(self.serving, return_exceptions=True)
        if self.lines is not None:
            self.lines.close()
        self.line.close()

    def show(self, point: Point, value: Value) -> None:
        """Send a value."""
        self.values[point] = value
        if not self.faults.silent:
            self._tell(point)

    def _tell(self, point: Point) -> None:
        value = self.values[point]
        self._put(f"{point}={int(value) if isinstance(value, bool) else value}")

    def _put(self, text: str) -> None:
        if self.lines is not None:
            self.lines.put(text)
            if self.faults.garbage:
                self.lines.port.write(b"~~~\n")

    async def _serve(self, lines: Lines) -> None:
        while True:
            try:
                line = await lines.get()
            except LinkError:
                continue  # the driver will ask again
            await asyncio.sleep(self.faults.delay_s)
            while self.faults.silent:
                await asyncio.sleep(0.01)
            if line.startswith("?"):
                for point in self.values:
                    self._tell(point)
                self._put(f".{line[1:]}")
            elif "=" in line:
                point, _, value = line.partition("=")
                if point in self.values:  # something that it shows is forced
                    self.values[point] = value
                self._put(line)
                self.written(point, value)
