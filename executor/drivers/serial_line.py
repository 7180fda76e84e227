"""Commands and values as lines of text on a serial line, by pyserial: for robots and for devices built for the purpose.

Each line is `POINT=VALUE` and ends with a check value, `*` and two hexadecimal digits, the exclusive or of the bytes
before it, as navigation receivers have it; then a line feed. The driver writes a point by such a line, and the device
confirms by sending the same line back. The device sends a line of its own accord whenever something changes. On `?N`
it sends every point, then `.N`; the driver asks so at the beginning of a connection, with an N of its own, and whenever
it has heard nothing for `every_s`, so that it knows that somebody is there. A line that is damaged ends the connection,
because nobody knows what it was.

Points are words of letters, digits, `.`, `_`, `-` and `/`. A driver of commands for one make of robot, whose language
is given, is better a kind of its own.
"""

from __future__ import annotations

import asyncio
import itertools
import os
import re
from collections import deque
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Final

from pydantic import Field

from firable.executor.drivers.addresses import LinePath
from firable.executor.drivers.device import (
    Connection,
    InUseError,
    LinkError,
    Options,
    Point,
    Stepwise,
    Use,
    Value,
    Wanted,
    Writes,
)
from firable.executor.reasons import is_in_use, port_reason

if TYPE_CHECKING:
    from serial import Serial

LINE_BYTES_MAX: Final = 1024
_POINT: Final = re.compile(r"[A-Za-z0-9._/-]+")
_QUESTIONS: Final = itertools.count(1)
"""Questions are numbered through, so that the end of an old answer is not taken for that of a new one."""


class SerialOptions(Options):
    """A port, and after how long a silence somebody is asked for."""

    port: LinePath
    baud: int = Field(default=115_200, ge=300, le=4_000_000)
    every_s: float = Field(default=1.0, gt=0, le=60, allow_inf_nan=False)

    def far_end(self) -> object:
        """What stands at the end of a line."""
        return self.port


def framed(text: str) -> bytes:
    """A line as it goes over the wire.

    >>> framed("done=7")
    b'done=7*0A\\n'
    """
    data = text.encode()
    return b"%s*%02X\n" % (data, _check(data))


def unframed(line: bytes) -> str | None:
    """What a line says, without its end; None where it is damaged.

    A zero byte, as a break on the line is read, leaves the check value as it is.

    >>> unframed(b"done=7*0A"), unframed(b"done=8*0A"), unframed(b"\\0done=7*0A")
    ('done=7', None, None)
    """
    text, star, check = line.rpartition(b"*")
    if not star or check != b"%02X" % _check(text) or b"\0" in text:
        return None
    return text.decode("utf-8", "replace")


def _check(data: bytes) -> int:
    value = 0
    for byte in data:
        value ^= byte
    return value


class Lines:
    """Lines that come and go over an open port, both without waiting in the operating system."""

    def __init__(self, port: Serial) -> None:
        self.port = port
        self.loop = asyncio.get_running_loop()
        self.unfinished = b""
        self.lines: deque[bytes] = deque()
        self.out = b""
        self.come = asyncio.Event()
        self.error: Exception | None = None
        self.loop.add_reader(port.fileno(), self._read)

    def put(self, text: str) -> None:
        """Send a line."""
        self.out += framed(text)
        self._write()

    async def get(self) -> str:
        """The next line; raises `LinkError` for one that is damaged, or where the port is gone."""
        while not self.lines:
            if self.error is not None:
                raise LinkError(str(self.error)) from self.error
            self.come.clear()
            await self.come.wait()
        line = self.lines.popleft()
        text = unframed(line)
        if text is None:
            raise LinkError(f"a damaged line: {line[:40]!r}")
        return text

    def close(self) -> None:
        """Close the port."""
        self.loop.remove_reader(self.port.fileno())
        self.loop.remove_writer(self.port.fileno())
        self.port.close()

    def _read(self) -> None:
        try:
            *lines, self.unfinished = (self.unfinished + (self.port.read(65_536) or b"")).split(b"\n")
        except Exception as error:  # pyserial raises of its own for a port that is gone
            self._failed(error)
            return
        if len(self.unfinished) > LINE_BYTES_MAX:
            self._failed(LinkError(f"a line of more than {LINE_BYTES_MAX} bytes"))
        self.lines.extend(lines)
        self.come.set()

    def _write(self) -> None:
        try:  # not by pyserial, which tries for ever where nothing can be sent now
            self.out = self.out[os.write(self.port.fileno(), self.out) :]
        except BlockingIOError:
            pass
        except OSError as error:
            self._failed(LinkError(port_reason(error)))
            return
        if self.out:
            self.loop.add_writer(self.port.fileno(), self._write)
        else:
            self.loop.remove_writer(self.port.fileno())

    def _failed(self, error: Exception) -> None:
        self.error = error
        self.loop.remove_reader(self.port.fileno())
        self.loop.remove_writer(self.port.fileno())
        self.come.set()


class SerialConnection(Stepwise):
    """A line with a device at its other end."""

    def __init__(self, lines: Lines, wanted: Wanted, every_s: float) -> None:
        self.lines = lines
        self.wanted = set(wanted.read)
        self.timeout_s = wanted.timeout_s
        self.every_s = every_s
        self.unconfirmed: dict[str, asyncio.Future[None]] = {}
        """What was written and not sent back yet, by its line."""
        self.is_first = True

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """The lines that have come; at first, and after a silence, all that the device has to tell."""
        try:
            if not self.is_first:
                line = await asyncio.wait_for(self.lines.get(), self.every_s)
                return self._taken([line, *await self._others()])
        except TimeoutError:
            pass  # nothing for a while: is anybody there?
        self.is_first = False
        return await asyncio.wait_for(self._asked(), self.timeout_s)

    async def write(self, writes: Writes) -> None:
        """Write values in their order, each when the device has confirmed the one before."""
        withheld = self.withheld
        for point, value in writes:
            line = f"{point}={int(value) if isinstance(value, bool) else value}"
            confirmed = self.unconfirmed[line] = asyncio.get_running_loop().create_future()
            try:
                with self.step(f"'{line}'", withheld):
                    self.lines.put(line)
                    await asyncio.wait_for(confirmed, self.timeout_s)
            except TimeoutError:
                raise LinkError(f"'{line}' is not confirmed within {self.timeout_s:g} s") from None
            finally:
                self.unconfirmed.pop(line, None)

    async def close(self) -> None:
        """Close the port."""
        self.lines.close()

    async def _asked(self) -> list[tuple[Point, Value]]:
        """Ask for everything, and take lines until the end of the answer to that question."""
        number = next(_QUESTIONS)
        self.lines.put(f"?{number}")
        lines = []
        while (line := await self.lines.get()) != f".{number}":
            lines.append(line)
        return self._taken(lines)

    async def _others(self) -> list[str]:
        """The lines that are there already, behind the first."""
        return [await self.lines.get() for _ in range(len(self.lines.lines))]

    def _taken(self, lines: Sequence[str]) -> list[tuple[Point, Value]]:
        batch: list[tuple[Point, Value]] = []
        for line in lines:
            if (confirmed := self.unconfirmed.get(line)) is not None and not confirmed.done():
                confirmed.set_result(None)
            point, is_value, value = line.partition("=")
            if is_value and point in self.wanted:
                batch.append((point, value))
        return batch


class SerialLine:
    """Devices that speak lines of text."""

    options: type[Options] = SerialOptions
    through_broker = False

    def point_problem(self, point: Point, use: Use) -> str:
        """What is wrong with a name."""
        if _POINT.fullmatch(point) is None or len(point) > 60:
            return f"what a line is to {use} is a word of letters, digits, and . _ / -"
        return ""

    def load(self) -> None:
        """Import what is needed."""
        import_module("serial")

    async def connect(self, options: SerialOptions, wanted: Wanted) -> Connection:
        """Open the port anew, and forget what has come before."""
        from serial import Serial, SerialException

        try:
            port = Serial(options.port, options.baud, timeout=0, write_timeout=0, exclusive=True)
        except (SerialException, ValueError) as error:
            kind = InUseError if is_in_use(error) else LinkError
            raise kind(f"{options.port}: {port_reason(error)}") from None
        port.reset_input_buffer()
        return SerialConnection(Lines(port), wanted, options.every_s)


KIND: Final = SerialLine()
