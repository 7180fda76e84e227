"""MQTT, by aiomqtt: points are topics, values their payloads as text.

What a device shows it publishes *retained*, so that a driver that connects learns at once how things stand; what the
driver writes is not, because a device that comes back must not find an old command waiting; but a signal that is forced
is published in the place of the device, and as it would: retained, or whoever connects next would learn what stood
there before. Everything goes with QoS 1, and a write is confirmed by the broker: that the device has a command is shown
by the number that it has taken. That the device is there at all is not to be seen from a connection to a broker;
`alive` in the binding is for that.

The first answer of a connection is what the broker has retained. It ends with a message that the driver sends to itself
on a topic of its own: the broker answers on one connection in order.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import math
import re
import socket
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, cast

from pydantic import BaseModel, ConfigDict, Field

from firable.executor.drivers.addresses import HostName, one_name
from firable.executor.drivers.device import (
    DROPPING,
    Connection,
    File,
    LinkError,
    Options,
    Password,
    Point,
    Stepwise,
    Use,
    Value,
    Wanted,
    Writes,
    not_let_in,
    quiet,
)
from firable.executor.loopback import is_loopback

if TYPE_CHECKING:
    from aiomqtt import Client, MqttError

_NUMBER: Final = re.compile(r"^\[(code:|Errno )-?\d+\] ")


NOT_LET_IN: Final = frozenset({134, 135})
"""How a broker says that a user's password is wrong, or that somebody may not connect."""

REFUSED: Final = 0x80
"""From here on the codes of a broker say that it does not do what it was asked for."""

MESSAGE_BYTES_MAX: Final = 1 << 20
"""A longer message is none of a device; who may publish at a broker may send 256 MB, which take seconds to receive."""


class MqttTls(BaseModel):
    """The files of TLS: the authority of the broker, and a certificate of one's own where the broker asks for one."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)
    ca: File | None = None
    certificate: File | None = None
    key: File | None = None


class MqttOptions(Options):
    """A broker; `tls: true` trusts the authorities that the system trusts."""

    host: HostName
    port: int = Field(default=1883, ge=1, le=65_535)
    user: str | None = None
    password: Password = None
    tls: bool | MqttTls = False

    @property
    def is_overheard(self) -> bool:
        """Without TLS a password goes out as it is."""
        return self.password is not None and not self.tls and not is_loopback(self.host)

    def far_end(self) -> object:
        """The broker, whoever asks it for what: topics are everybody's."""
        return f"{one_name(self.host)}:{self.port}"


class Guarded:
    """An event loop for aiomqtt, which asks for a socket to be watched a turn later: it may be closed by then."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop

    def __getattr__(self, name: str) -> Any:
        return getattr(self.loop, name)

    def add_reader(self, fd: int, callback: Callable[[], object]) -> None:
        """Have a socket watched for what comes; not one that is closed, whose end is told elsewhere."""
        _unless_closed(self.loop.add_reader, fd, callback)

    def add_writer(self, fd: int, callback: Callable[[], object]) -> None:
        """Have a socket watched for room; likewise."""
        _unless_closed(self.loop.add_writer, fd, callback)


class MqttConnection(Stepwise):
    """A connection to a broker."""

    def __init__(self, client: Client, wanted: Wanted) -> None:
        self.client = client
        self.wanted = wanted
        self.own = f"firable/{uuid.uuid4().hex}"
        self.is_first = True

    async def open(self) -> None:
        """Connect, and subscribe to what is wanted."""
        try:
            await self.client.__aenter__()
        except asyncio.CancelledError:
            # As aiomqtt does where its own time is over: else the end of the connection is asked what nobody answers,
            # and that is an error that the event loop tells at the terminal.
            self.client._connected = asyncio.get_running_loop().create_future()
            raise
        topics = (*self.wanted.read, self.own)
        said: Sequence[Any] = await self.client.subscribe([(topic, 1) for topic in topics])
        for topic, code in zip(topics, said, strict=False):
            if getattr(code, "value", code) >= REFUSED:
                raise LinkError(f"the broker does not let '{topic}' be read")
        await self.client.publish(self.own, "1", qos=1, timeout=self.wanted.timeout_s)

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """All messages that have come; at first, all that were retained."""
        from aiomqtt import MqttError

        batch: list[tuple[Point, Value]] = []
        messages = self.client.messages
        try:
            while self.is_first or not batch or len(messages):
                message = await asyncio.wait_for(anext(messages), self.wanted.timeout_s if self.is_first else None)
                if message.topic.value == self.own:
                    self.is_first = False
                    break
                payload = message.payload
                text = payload.decode("utf-8", "replace") if isinstance(payload, (bytes, bytearray)) else str(payload)
                batch.append((message.topic.value, text))
        except MqttError as error:
            raise LinkError(_why(error)) from None
        return batch

    async def write(self, writes: Writes) -> None:
        """Publish values in their order, each when the broker has the one before."""
        from aiomqtt import MqttError

        withheld = self.withheld
        for topic, value in writes:
            payload = str(int(value)) if isinstance(value, bool) else str(value)
            try:
                with self.step(f"'{topic}'", withheld):
                    is_shown = topic in self.wanted.forced
                    await self.client.publish(topic, payload, qos=1, retain=is_shown, timeout=self.wanted.timeout_s)
            except MqttError as error:
                raise LinkError(f"'{topic}': {_why(error)}") from None

    async def close(self) -> None:
        """Say goodbye if that can be, and end the connection in any case."""
        from aiomqtt import MqttError

        try:
            if not self.is_in_doubt:
                with suppress(Exception):
                    await asyncio.wait_for(self.client.__aexit__(None, None, None), self.wanted.timeout_s)
        finally:
            # There is no other way: aiomqtt ends a connection by a goodbye alone, which it sends behind all else.
            if isinstance(found := self.client._client.socket(), socket.socket):
                with suppress(OSError):
                    found.shutdown(socket.SHUT_RDWR)
                with suppress(MqttError):  # when it has seen that
                    while await anext(self.client.messages):
                        pass
            self.client._client._sock_close()  # which else is watched on behind what nobody could read
            if (gone := self.client._disconnected).done() and not gone.cancelled():
                gone.exception()  # nobody else asks, where it was gone before anything was read


def _unless_closed(
    watch: Callable[[int, Callable[[], object]], object], fd: int, callback: Callable[[], object]
) -> None:
    try:
        watch(fd, callback)
    except OSError as error:
        if error.errno != errno.EBADF:
            raise


def _bounded(paho: Any) -> Callable[[int], bytes]:
    """How paho receives the next bytes of a message; raises `LinkError`, which ends the connection.

    It would take a message of any length in one turn of the event loop, and as many messages as a broker leaves open
    that are to be acknowledged twice (QoS 2), for which nobody has asked.
    """
    receive: Callable[[int], bytes] = paho._sock_recv

    def received(size_bytes: int) -> bytes:
        if size_bytes > MESSAGE_BYTES_MAX:
            raise LinkError(f"a message of {size_bytes} bytes, more than a device has to tell")
        if paho._in_messages:
            raise LinkError("a message that is to be acknowledged twice, which nobody has asked for")
        return receive(size_bytes)

    return received


def _why(error: MqttError) -> str:
    """What has failed, without the number that stands before it."""
    cause = error.__cause__
    return _NUMBER.sub("", str(cause if isinstance(cause, LinkError) else error))


class Mqtt:
    """Devices behind an MQTT broker."""

    options: type[Options] = MqttOptions
    through_broker = True
    shows_writes = True

    def point_problem(self, point: Point, use: Use) -> str:
        """What is wrong with a topic."""
        if any(sign in point for sign in "+#\0") or len(point.encode()) > 65_535:
            return f"a topic to {use} has no wildcards: no `+`, no `#`"
        return ""

    def load(self) -> None:
        """Import what is needed."""
        import_module("aiomqtt")

    async def connect(self, options: MqttOptions, wanted: Wanted) -> Connection:
        """Make a new client."""
        from aiomqtt import Client, MqttCodeError, MqttError, TLSParameters

        quiet("firable.mqtt")
        tls = TLSParameters() if options.tls else None
        if isinstance(options.tls, MqttTls):
            tls = TLSParameters(options.tls.ca, options.tls.certificate, options.tls.key)
        client = Client(
            options.host,
            options.port,
            username=options.user,
            password=options.password,
            logger=logging.getLogger("firable.mqtt"),
            timeout=wanted.timeout_s,
            keepalive=max(1, math.ceil(wanted.timeout_s)),
            tls_params=tls,
            socket_options=[DROPPING],
        )
        client._loop = cast("asyncio.AbstractEventLoop", Guarded(asyncio.get_running_loop()))
        paho: Any = client._client  # of which a method is replaced
        paho._sock_recv = _bounded(paho)
        paho.connect_timeout = wanted.timeout_s  # of a thread that no cancellation ends, nor a stop before it
        connection = MqttConnection(client, wanted)
        try:
            await connection.open()
        except MqttError as error:
            await connection.close()
            where = f"{options.host}:{options.port}"
            if isinstance(error, MqttCodeError) and getattr(error.rc, "value", error.rc) in NOT_LET_IN:
                raise not_let_in(where, options.user, options.password) from None
            raise LinkError(f"{where}: {_why(error)}") from None
        except BaseException:
            await connection.close()
            raise
        return connection


KIND: Final = Mqtt()
