"""Modbus over TCP and over a serial line (RTU), by pymodbus: how a device is named and reached.

What is asked of one that is reached, and what is made of its answers, is in `modbus_connection.py`.
"""

from __future__ import annotations

import asyncio
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, cast

from pydantic import Field, WithJsonSchema

from firable.executor.drivers.addresses import HostName, LinePath, one_name
from firable.executor.drivers.device import (
    Connection,
    InUseError,
    LinkError,
    Options,
    Point,
    Use,
    Value,
    Wanted,
    drop_at_close,
    is_to_itself,
    quiet,
)
from firable.executor.drivers.modbus_connection import ModbusConnection
from firable.executor.drivers.modbus_points import BITS, REGISTER_MAX, REGISTER_MIN, WRITTEN, address, counted_from_one
from firable.executor.reasons import is_in_use, port_reason

if TYPE_CHECKING:
    from functools import partial

    from pymodbus.client import AsyncModbusSerialClient

    from firable.executor.drivers.modbus_connection import Client


class _ModbusOptions(Options):
    """What both kinds have in common."""

    addresses: Literal["wire"] | None = None

    def point_problem(self, point: Point) -> str:
        """A number that may be the address, or that of a manual, where the binding does not say which is meant."""
        table, _, number = point.partition(" ")
        counted = counted_from_one(number)
        if self.addresses is not None or counted.partition(" ")[0] != table:
            return ""
        return (
            f"in a manual {number} is mostly `{counted}`, counted from 1, with its table before it: write that, "
            "or `addresses: wire` at the device if its numbers are the addresses themselves"
        )


class TcpOptions(_ModbusOptions):
    """A device in a network."""

    host: HostName
    port: int = Field(default=502, ge=1, le=65_535)
    unit: int = Field(default=1, ge=0, le=255)
    every_s: float = Field(default=0.01, ge=0, le=60, allow_inf_nan=False)

    @property
    def polled_s(self) -> float:
        """The time from one poll to the next."""
        return self.every_s

    def far_end(self) -> object:
        """A unit behind an address."""
        return f"{one_name(self.host)}:{self.port} unit {self.unit}"


class RtuOptions(_ModbusOptions):
    """A device on a serial line."""

    port: LinePath
    baud: int = Field(default=19_200, ge=300, le=4_000_000)
    parity: Literal["N", "E", "O"] = "E"
    stop_bits: Annotated[Literal["1", "2"], WithJsonSchema({"enum": [1, 2]})] = "1"
    unit: int = Field(default=1, ge=1, le=247)
    every_s: float = Field(default=0.02, ge=0, le=60, allow_inf_nan=False)

    def far_end(self) -> object:
        """A unit on a line."""
        return f"{self.port} unit {self.unit}"


class _Modbus:
    """What both kinds have in common."""

    def point_problem(self, point: Point, use: Use) -> str:
        """What is wrong with an address."""
        try:
            found = address(point)
        except ValueError as error:
            return str(error)
        if use is Use.WRITE and found.table not in WRITTEN:
            return f"nobody can write {'an' if found.table[0] in 'aeiou' else 'a'} {found.table} but the device"
        return ""

    def value_problem(self, point: Point, value: Value) -> str:
        """What is wrong with a value: a bit is 0 or 1, and a register a whole number of 16 bits, with a sign or not."""
        found = address(point)
        if found.table in BITS or found.bit is not None:
            return "" if value in {0, 1} else "a bit takes 0 or 1"
        is_whole = isinstance(value, int) and REGISTER_MIN <= value <= REGISTER_MAX
        return "" if is_whole else f"a register takes whole numbers from {REGISTER_MIN} to {REGISTER_MAX}"

    def whole(self, point: Point) -> Point:
        """The register of a bit."""
        return point.partition(".")[0]


class ModbusTcp(_Modbus):
    """Modbus in a network."""

    options: type[Options] = TcpOptions
    through_broker = False
    shows_writes = True

    def load(self) -> None:
        """Import what is needed."""
        import_module("pymodbus.client")

    async def connect(self, options: TcpOptions, wanted: Wanted) -> Connection:
        """Make a new connection."""
        from pymodbus.client import AsyncModbusTcpClient

        client = AsyncModbusTcpClient(
            options.host, port=options.port, timeout=wanted.timeout_s, retries=0, reconnect_delay=0
        )
        where = f"{options.host}:{options.port}"
        return await _opened(client, where, options, wanted, is_line=False)


class ModbusRtu(_Modbus):
    """Modbus on a serial line."""

    options: type[Options] = RtuOptions
    through_broker = False

    def load(self) -> None:
        """Import what is needed."""
        import_module("serial")  # which pymodbus would say to be missing only in passing
        import_module("pymodbus.client")

    async def connect(self, options: RtuOptions, wanted: Wanted) -> Connection:
        """Open the line anew."""
        import termios

        from pymodbus.client import AsyncModbusSerialClient

        client = AsyncModbusSerialClient(
            options.port,
            baudrate=options.baud,
            parity=options.parity,
            stopbits=int(options.stop_bits),
            timeout=wanted.timeout_s,
            retries=0,
            reconnect_delay=0,
        )
        _close_where_refused(client)
        try:
            return await _opened(client, options.port, options, wanted, is_line=True)
        except (ValueError, termios.error) as error:
            raise LinkError(f"{options.port} cannot be set to these options: {error}") from None


def _close_where_refused(client: AsyncModbusSerialClient) -> None:
    """Have a client close a port whose settings are refused once it is open.

    pymodbus sets an open port once more, and where that fails keeps it: nobody could open it again.
    """
    from pymodbus.transport.serialtransport import SerialTransport

    class Transport(SerialTransport):
        def __init__(self, *port: Any, **settings: Any) -> None:
            try:
                super().__init__(*port, **settings)
            except BaseException:
                if opened := getattr(self, "sync_serial", None):
                    opened.close()
                raise

    async def create() -> tuple[asyncio.Transport, asyncio.BaseProtocol]:
        loop, protocol_of, port = wanted.args
        protocol = protocol_of()
        transport = Transport(loop, protocol, port, **wanted.keywords)
        loop.call_soon(transport.setup)
        return transport, protocol

    wanted = cast("partial[Any]", client.ctx.call_create)
    client.ctx.call_create = create


def _port_refused(port: str) -> LinkError:
    """Why a port could not be opened: pymodbus tells nobody."""
    from serial import Serial

    try:
        Serial(port, exclusive=True).close()
    except OSError as error:
        kind = InUseError if is_in_use(error) else LinkError
        return kind(f"{port}: {port_reason(error)}")
    return LinkError(f"{port} does not answer")


async def _opened(
    client: Client, where: str, options: TcpOptions | RtuOptions, wanted: Wanted, *, is_line: bool
) -> Connection:
    quiet("pymodbus")
    try:
        if not await client.connect():
            raise _port_refused(where) if is_line else LinkError(f"{where} does not answer")
        if is_to_itself(client.ctx.transport):
            raise LinkError(f"{where} does not answer: the connection leads to itself")
    except BaseException:
        client.close()
        raise
    setattr(client.ctx.comm_params, "timeout_connect", None)  # noqa: B010 - its type says that there is one always
    connection = ModbusConnection(client, options.unit, options.every_s, wanted.timeout_s, is_line=is_line)
    drop_at_close(client.ctx.transport)
    connection.want(list(wanted.read), wanted.urgent)
    return connection


TCP: Final = ModbusTcp()
RTU: Final = ModbusRtu()
