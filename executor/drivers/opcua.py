"""OPC UA, by asyncua.

Points are node ids, such as `ns=2;s=Robot.Done` or `ns=3;i=1001`, each in the one spelling that it has: points are
compared as they are written, and `ns=2;i=05` would be the node of `ns=2;i=5`, and look like another. The server tells
of changes by a subscription with a queue for each node, so that edges between two of its messages are counted; a value
whose status is not good is no value, and neither are null and NaN. What is written takes the type that its node has. Of
several writes the last, which is the number of a command, goes out when the others are confirmed, because a server may
take those of one request in any order.

A node id names its namespace by an index, and a server that is configured anew, or only started again, may have its
namespaces in another order: the same index and name are then another node, which would be read as if it were the one.
So a binding can say which namespaces its indexes mean (`namespaces`); each connection looks where the server has them.

A client that has lost its connection is not repaired: asyncua can reconnect by itself, and would then bring back
subscriptions with what was queued in the meantime. A new client begins with what the nodes hold now. So it is where the
server answers, and has dropped the subscription or tells of it no more: what was read once would look good for ever.
While nothing changes it is to say that it is there several times within the time of an answer; asyncua would have it
do so every three quarters of an hour, and subscribe anew by itself. A server that will not do so in time is refused.

Messages of a subscription are numbered. asyncua goes on behind one that it cannot read, and what that has told would be
missing without a word, the contact of an emergency stop as much as anything else: so a number that is missing ends the
connection.
"""

from __future__ import annotations

import asyncio
import re
from base64 import b64decode, b64encode
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, Final, Literal, cast
from urllib.parse import urlsplit
from uuid import UUID

from pydantic import BaseModel, ConfigDict, Field, field_validator

from firable.executor.drivers.addresses import OpcUaUrl, one_name, refuse
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import (
    Connection,
    File,
    LinkError,
    NoValue,
    Options,
    Password,
    Point,
    Stepwise,
    Use,
    Value,
    Wanted,
    Writes,
    drop_at_close,
    not_let_in,
    quiet,
)
from firable.executor.loopback import is_loopback
from firable.executor.reasons import reason

if TYPE_CHECKING:
    from asyncua.client.client import Client
    from asyncua.common.node import Node
    from asyncua.common.subscription import Subscription
    from asyncua.ua.uaprotocol_auto import PublishResult

QUEUE: Final = 1000
"""How many changes of a node the server keeps between two of its messages."""

SIGNS: Final = 4
"""How often within the time of an answer the server is to say that the subscription is there, while nothing changes."""

OVERFLOW: Final = 0x480
"""The bits of a status by which a server says that it has dropped changes from a queue."""


_NAMESPACE_MAX: Final = 0xFFFF
_NAMESPACE_OF_ALL: Final = "http://opcfoundation.org/UA/"


class OpcUaSecurity(BaseModel):
    """How messages are signed and encrypted, and the files of who is who (PEM or DER).

    `server` is the certificate of the server itself: what another one shows is not believed, whoever has signed it.
    `application` is the name by which the certificate of this client was made out, where the server asks for that.
    """

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)
    policy: Literal["Basic256Sha256", "Aes128Sha256RsaOaep", "Aes256Sha256RsaPss"] = "Basic256Sha256"
    mode: Literal["Sign", "SignAndEncrypt"] = "SignAndEncrypt"
    certificate: File
    key: File
    server: File
    application: str | None = None


class OpcUaOptions(Options):
    """A server, and how often it looks at its nodes and tells of them; what the indexes of its node ids mean."""

    url: OpcUaUrl
    every_s: float = Field(default=0.01, gt=0, le=60, allow_inf_nan=False)
    user: str | None = None
    password: Password = None
    security: OpcUaSecurity | None = None
    namespaces: dict[str, str] = Field(default_factory=dict)

    @field_validator("namespaces")
    @classmethod
    def _are_namespaces(cls, namespaces: dict[str, str]) -> dict[str, str]:
        for index, uri in namespaces.items():
            if not re.fullmatch("[1-9][0-9]{0,4}", index) or int(index) > _NAMESPACE_MAX:
                refuse(f"'{index}' is no index of a namespace", "write a number from 1 to 65535; 0 is that of OPC UA")
            if uri in {"", _NAMESPACE_OF_ALL}:
                said = f"is that of {_NAMESPACE_OF_ALL}, which has the index 0" if uri else "has no name"
                refuse(f"the namespace of {index} {said}", "write the URI that the server has for it")
        twice = [uri for uri, count in Counter(namespaces.values()).items() if count > 1]
        if twice:  # its nodes would have two spellings
            refuse(f"'{twice[0]}' has two indexes", "give each namespace one")
        return namespaces

    @property
    def polled_s(self) -> float:
        """The time from one look of the server to the next."""
        return self.every_s

    @property
    def is_overheard(self) -> bool:
        """Without security a server is whoever answers, and may ask for the password as it is."""
        is_open = self.password is not None and self.security is None
        return is_open and not is_loopback(str(urlsplit(self.url).hostname))

    def point_problem(self, point: Point) -> str:
        """An index that means nothing."""
        found = _NODE.fullmatch(point)
        is_named = found is None or found[1] is None or not self.namespaces or found[1] in self.namespaces
        return "" if is_named else f"`namespaces` does not say what the index {found and found[1]} means"

    def unlike(self, other: Options) -> str:
        """The namespaces, by which the indexes are spelled."""
        return "" if isinstance(other, OpcUaOptions) and other.namespaces == self.namespaces else "namespaces"

    def meant(self) -> dict[int, str]:
        """What each index means."""
        return {int(index): uri for index, uri in self.namespaces.items()}

    def far_end(self) -> object:
        """What is at a port: mostly one server, of whose endpoints the path chooses one."""
        parts = urlsplit(self.url)
        return f"{one_name(str(parts.hostname))}:{parts.port}"

    def stands_at(self) -> str:
        """The port with the path, by which several servers may share it (OPC UA, Part 6, 7.1.2.3)."""
        path = urlsplit(self.url).path
        return f"{self.far_end()}{'' if path == '/' else path}"


class OpcUaConnection(Stepwise):
    """A session with a server, and a subscription to the nodes that are read."""

    def __init__(self, client: Client, wanted: Wanted) -> None:
        self.client = client
        self.indexes: dict[int, int] = {}
        """Where the server has the namespaces that the indexes of points mean, if it is said what they mean."""
        self.wanted = wanted
        self.told: asyncio.Queue[tuple[Point, Value] | Exception] = asyncio.Queue()
        self.points: dict[str, Point] = {}
        self.types: dict[Point, Any] = {}
        self.is_first = True
        self.number: int | None = None
        """The number of the last message that has told something, as far as the first one shows it."""
        self.looking: asyncio.TimerHandle | None = None
        """When it is looked next whether the server still tells of the subscription."""

    async def open(self, every_s: float, namespaces: Mapping[int, str]) -> None:
        """Connect, and subscribe to what is wanted."""
        from asyncua.ua.uaprotocol_auto import CreateSubscriptionParameters, ModifySubscriptionParameters
        from asyncua.ua.uatypes import Byte, Double, UInt32

        self.client.connection_lost_callback = self._lost
        await self.client.connect()
        drop_at_close(self._transport)
        if namespaces:
            there: object = await self.client.get_namespace_array()
            if not isinstance(there, list):
                raise LinkError("the server does not say which namespaces it has")
            for index, uri in namespaces.items():
                if uri not in there:
                    raise LinkError(f"the server has no namespace '{uri}'")
                self.indexes[index] = there.index(uri)
        nodes = [self._node(point) for point in self.wanted.read]
        self.points = {node.nodeid.to_string(): point for node, point in zip(nodes, self.wanted.read, strict=True)}
        counts = self._counts(every_s)
        asked = CreateSubscriptionParameters(
            RequestedPublishingInterval=Double(1000 * every_s),
            RequestedLifetimeCount=UInt32(counts[0]),
            RequestedMaxKeepAliveCount=UInt32(counts[1]),
            MaxNotificationsPerPublish=UInt32(10_000),
            PublishingEnabled=True,
            Priority=Byte(0),
        )
        # Not one of the client, which would subscribe anew by itself, and have the server say seldom that it is there.
        subscription = _numbered()(self.client.uaclient.session, asked, self)
        given = await subscription.init()
        within_s = given.RevisedPublishingInterval / 1000 * max(1, given.RevisedMaxKeepAliveCount)
        if given.RevisedPublishingInterval != asked.RequestedPublishingInterval:
            counts = self._counts(given.RevisedPublishingInterval / 1000)
            changed = ModifySubscriptionParameters(
                SubscriptionId=given.SubscriptionId,
                RequestedPublishingInterval=given.RevisedPublishingInterval,
                RequestedLifetimeCount=UInt32(counts[0]),
                RequestedMaxKeepAliveCount=UInt32(counts[1]),
                MaxNotificationsPerPublish=asked.MaxNotificationsPerPublish,
                Priority=asked.Priority,
            )
            kept = await self.client.uaclient.session.update_subscription(changed)
            within_s = kept.RevisedPublishingInterval / 1000 * max(1, kept.RevisedMaxKeepAliveCount)
        most_s = max(every_s, self.wanted.timeout_s)
        if not 0 <= within_s <= most_s:
            raise LinkError(
                f"the server would say every {within_s:g} s that it is there, not at least every {most_s:g} s"
            )
        if (publishing := self.client.uaclient.session._publish_task) is not None:
            publishing.add_done_callback(self._ended)
        if nodes:
            several: Iterable[Node] = nodes
            self._look(subscription, within_s + self.wanted.timeout_s, monotonic())
            made = await subscription.subscribe_data_change(several, queuesize=QUEUE, sampling_interval=Double(0))
            for point, one in zip(self.wanted.read, made, strict=True):
                if not isinstance(one, int):
                    raise LinkError(f"the server does not let '{point}' be read: {one.name}")

    def _counts(self, every_s: float) -> tuple[int, int]:
        """After how many intervals the server may drop the subscription, and is to say that it is there (Part 4)."""
        signs = max(1, int(self.wanted.timeout_s / SIGNS / max(0.001, every_s)))  # in this order: it may be NaN
        return max(10_000, 3 * signs), signs

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """All changes that have come; at first, what every node holds."""
        batch: list[tuple[Point, Value]] = []
        missing = set(self.wanted.read) if self.is_first else set()
        while missing or not batch or not self.told.empty():
            if self.is_first and not missing and self.told.empty():
                break
            one = await asyncio.wait_for(self.told.get(), self.wanted.timeout_s if missing else None)
            if isinstance(one, Exception):
                raise LinkError(str(one) or type(one).__name__) from one
            missing.discard(one[0])
            batch.append(one)
        self.is_first = False
        return batch

    async def write(self, writes: Writes) -> None:
        """Write values, the last one when the others are confirmed."""
        withheld = self.withheld
        for some in (writes[:-1], writes[-1:]):
            if some:
                await self._write(some, withheld)

    async def close(self) -> None:
        """End the session if that can be, and the connection in any case."""
        if self.looking is not None:
            self.looking.cancel()
        transport = self._transport
        try:
            if not self.is_in_doubt:
                with suppress(Exception):
                    await asyncio.wait_for(self.client.disconnect(), self.wanted.timeout_s)
        finally:
            if transport is not None:
                transport.abort()  # before asyncua, which would send what it still has
            self.client.disconnect_socket()
            await ended(self._tasks)

    def datachange_notification(self, node: Node, value: Any, data: Any) -> None:
        """The subscription tells of a change (called by asyncua)."""
        status = data.monitored_item.Value.StatusCode
        point = self.points[node.nodeid.to_string()]
        shown = value if isinstance(value, (bool, int, float, str)) else repr(value)
        if isinstance(shown, bool) and status.value & OVERFLOW == OVERFLOW:
            self.told.put_nowait((point, shown))  # how many edges are gone nobody knows, but not fewer than two
            self.told.put_nowait((point, not shown))
        is_value = status.is_good() and value is not None and shown == shown  # NaN is equal to nothing
        self.told.put_nowait((point, shown if is_value else NoValue(shown if status.is_good() else status.name)))

    def status_change_notification(self, status: Any) -> None:
        """The subscription has ended (called by asyncua)."""
        self.told.put_nowait(LinkError(f"the server has ended the subscription: {status.Status.name}"))

    async def _lost(self, error: Exception) -> None:
        self.told.put_nowait(error)

    def _ended(self, publishing: asyncio.Task[None]) -> None:
        """Nobody asks any more for what the subscription tells: the server has said that there is none."""
        if not publishing.cancelled():
            self.told.put_nowait(LinkError("the server has dropped the subscription"))

    def _look(self, subscription: Subscription, within_s: float, since_seconds: float) -> None:
        """Look whether the server has told of a subscription in time, a change or that there is none."""
        since_seconds = subscription.last_publish_at or since_seconds
        if (left_s := since_seconds + within_s - monotonic()) > 0:
            loop = asyncio.get_running_loop()
            self.looking = loop.call_later(left_s, self._look, subscription, within_s, since_seconds)
        else:
            self.told.put_nowait(LinkError(f"the server has told nothing of the subscription for {within_s:g} s"))

    def published(self, number: int, *, tells: bool) -> None:
        """A message of the subscription has come; a sign of life, which tells nothing, has the number of the next."""
        last = number if tells else number - 1
        if self.number is not None and last > self.number + tells:
            self.told.put_nowait(LinkError("what the server has told was lost, or is what nobody can read"))
        is_over = self.number == _NUMBER_MAX and tells  # it begins again at 1
        self.number = last if is_over else max(last, self.number or 0)

    @property
    def _transport(self) -> asyncio.Transport | None:
        protocol = self.client.uaclient.protocol
        return None if protocol is None else protocol.transport

    @property
    def _tasks(self) -> list[asyncio.Task[Any]]:
        """What asyncua does beside: it ends that with a goodbye alone, and else publishes and renews for ever."""
        client, session = self.client, self.client.uaclient.session
        several = (
            client._stale_watchdog_task,
            client._supervisor_task,
            client._renew_channel_task,
            session._publish_task,
        )
        return [task for task in several if task is not None]

    def _node(self, point: Point) -> Node:
        from asyncua.ua.uatypes import Int16, NodeId

        found = NodeId.from_string(point)
        if self.indexes and found.NamespaceIndex:
            found = replace(found, NamespaceIndex=Int16(self.indexes[found.NamespaceIndex]))
        return self.client.get_node(found)

    async def _write(self, writes: Writes, withheld: int) -> None:
        from asyncua import ua
        from asyncua.ua.uaerrors import UaError

        nodes = [self._node(point) for point, _ in writes]
        for (point, _), node in zip(writes, nodes, strict=True):
            if point not in self.types:
                try:
                    with self.step(f"'{point}'", withheld):
                        self.types[point] = await node.read_data_type_as_variant_type()
                except UaError as error:
                    raise LinkError(f"the server does not let '{point}' be written: {error}") from None
        try:
            values = [
                ua.DataValue(ua.Variant(_typed(value, self.types[point]), self.types[point])) for point, value in writes
            ]
            with self.step(f"'{writes[0][0]}'", withheld):
                await self.client.write_values(nodes, values)
        except UaError as error:
            raise LinkError(f"the server does not let '{writes[0][0]}' be written: {error}") from None
        except (ValueError, TypeError) as error:
            raise LinkError(f"'{writes[0][0]}' does not take {writes[0][1]!r}: {error}") from None


def _numbered() -> type[Subscription]:
    """A subscription that tells its connection the number of each message, read or signs of life alone."""
    from asyncua.common.subscription import Subscription

    class Numbered(Subscription):
        async def publish_callback(self, publish_result: PublishResult) -> None:
            message = publish_result.NotificationMessage
            cast("OpcUaConnection", self._handler).published(
                message.SequenceNumber, tells=bool(message.NotificationData)
            )
            await super().publish_callback(publish_result)

    return Numbered


def _typed(value: Value, kind: Any) -> Value:
    """The value in the type that a node has."""
    match kind.name:
        case "Boolean":
            if value not in {0, 1}:  # a heartbeat would be 1 for ever
                raise ValueError("a truth value is 0 or 1")
            return bool(value)
        case "String":
            return str(value)
        case "Float" | "Double":
            return float(value)
        case _:
            return int(value)


_NODE: Final = re.compile(r"(?:ns=([0-9]{1,9});)?([isgb])=([^\x00-\x1f\x7f]+)")
_NUMBER_MAX: Final = 0xFFFF_FFFF


def spelling(point: Point) -> Point | None:
    """The one spelling of a node id (OPC UA, Part 6, 5.3.1.10); None for what is none.

    >>> spelling("ns=02;i=0005"), spelling("ns=0;s=Motor; left"), spelling("i=x")
    ('ns=2;i=5', 's=Motor; left', None)
    """
    found = _NODE.fullmatch(point)
    if found is None:
        return None
    namespace, kind, name = int(found[1] or 0), found[2], found[3]
    try:
        match kind:
            case "i":
                name = str(int(name)) if name.isascii() and name.isdecimal() and int(name) <= _NUMBER_MAX else ""
            case "g":
                name = str(UUID(name))
            case "b" if name.startswith("0x"):  # which asyncua reads as hexadecimal
                return None
            case "b":
                name = b64encode(b64decode(name, validate=True)).decode()
    except ValueError:
        return None
    if namespace > _NAMESPACE_MAX or not name:
        return None
    return f"ns={namespace};{kind}={name}" if namespace else f"{kind}={name}"


class OpcUa:
    """OPC UA servers."""

    options: type[Options] = OpcUaOptions
    through_broker = False
    shows_writes = True

    def point_problem(self, point: Point, use: Use) -> str:
        """What is wrong with a node id; what may be written only the server knows."""
        one = spelling(point)
        if one is None:
            return f"a node to {use} has an id such as `ns=2;s=Robot.Done` or `ns=3;i=1001`"
        return "" if one == point else f"each node has one spelling, so that two can be told apart: write `{one}`"

    def load(self) -> None:
        """Import what is needed."""
        import_module("asyncua.client.client")

    async def connect(self, options: OpcUaOptions, wanted: Wanted) -> Connection:
        """Make a new client."""
        from asyncua.client.client import Client
        from asyncua.ua import uaerrors
        from cryptography.exceptions import InvalidSignature

        quiet("asyncua")
        client = Client(options.url, timeout=wanted.timeout_s, watchdog_intervall=wanted.timeout_s)
        if options.user is not None:
            client.set_user(options.user)
            client.set_password(options.password or "")
        connection = OpcUaConnection(client, wanted)
        try:
            if options.security is not None:
                await _secure(client, options.security)
            await connection.open(options.every_s, options.meant())
        except (uaerrors.BadUserAccessDenied, uaerrors.BadIdentityTokenRejected, uaerrors.BadIdentityTokenInvalid):
            await connection.close()
            raise not_let_in(options.url, options.user, options.password) from None
        except TimeoutError:
            await connection.close()
            raise
        except (uaerrors.UaError, InvalidSignature, OSError) as error:
            await connection.close()
            raise LinkError(f"{options.url}: {reason(error) or type(error).__name__}") from None
        except BaseException:
            await connection.close()
            raise
        return connection


async def _secure(client: Client, security: OpcUaSecurity) -> None:
    from asyncua.crypto import security_policies
    from asyncua.crypto.uacrypto import CertProperties
    from asyncua.ua.uaprotocol_auto import MessageSecurityMode

    if security.application is not None:
        client.application_uri = security.application
    try:
        await client.set_security(
            getattr(security_policies, f"SecurityPolicy{security.policy}"),
            Path(security.certificate),
            Path(security.key),
            server_certificate=CertProperties(Path(security.server)),
            mode=MessageSecurityMode[security.mode],
        )
    except ValueError as error:
        files = f"{security.certificate}, {security.key}, {security.server}"
        raise LinkError(f"what stands in these files is no certificate and its key: {files}: {error}") from None


KIND: Final = OpcUa()
