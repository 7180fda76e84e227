"""An OPC UA server of points, by asyncua, behind a relay that can be cut.

Its nodes are made when it starts, from the values that its points have at first, and keep their types.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from types import MappingProxyType
from typing import Any

from asyncua import ua
from asyncua.common.callback import CallbackType
from asyncua.server.server import Server
from asyncua.ua.status_codes import StatusCodes
from asyncua.ua.uatypes import UInt32

from firable.executor.drivers.device import Point, Value, quiet
from firable.executor.drivers.far_side.end import Faults
from firable.executor.drivers.far_side.relay import Relay, RelayedEnd


class OpcUaEnd(RelayedEnd):
    """A server in the network of this host; `port` 0 takes a free one."""

    def __init__(
        self,
        points: Mapping[Point, Value],
        port: int = 0,
        secure: Callable[[Server], Awaitable[None]] | None = None,
        namespaces: Mapping[int, str] = MappingProxyType({}),
    ) -> None:
        self.secure = secure
        """What makes the server demand more than that somebody comes."""
        self.namespaces = namespaces
        """What the server calls its namespaces, where it matters."""
        self.faults = Faults()
        self.values = dict(points)
        self.relay = Relay(self.faults, port, garbles=False)
        self.server: Any = None
        self.nodes: dict[Point, Any] = {}
        self.names: dict[str, Point] = {}
        self.written: Callable[[Point, Value], None] = lambda _point, _value: None
        self.changes: asyncio.Queue[tuple[Point, Value]] = asyncio.Queue()
        self.showing: asyncio.Task[None] | None = None

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        """Begin to serve."""
        self.written = written
        if self.server is None:
            await self._serve()
        while not self.changes.empty():  # what is shown from the beginning
            await self._show_next()
        self.showing = asyncio.create_task(self._show())
        await self.mend()

    async def stop(self) -> None:
        """Close all connections; the server itself stays, to be started again, until `end`."""
        await self.cut()
        if self.showing is not None:
            self.showing.cancel()

    async def end(self) -> None:
        """Take the server away."""
        if self.server is not None:
            await self.server.stop()

    def show(self, point: Point, value: Value) -> None:
        """Show a value to whoever has subscribed to it."""
        self.changes.put_nowait((point, value))

    async def _serve(self) -> None:
        quiet("asyncua")
        self.server = Server()
        await self.server.init()
        if self.secure is None:
            self.server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        else:
            await self.secure(self.server)
        self.server.set_endpoint("opc.tcp://127.0.0.1:0/")
        if (own := self.namespaces.get(1)) is not None:
            await self.server.set_application_uri(own)
        for index in range(2, max(self.namespaces, default=2) + 1):  # 0 is that of OPC UA
            await self.server.register_namespace(self.namespaces.get(index, f"firable:{index}"))
        for point, value in self.values.items():
            kind = {bool: ua.VariantType.Boolean, str: ua.VariantType.String}.get(type(value), ua.VariantType.Int64)
            node_id = ua.NodeId.from_string(point)
            node = await self.server.nodes.objects.add_variable(node_id, str(node_id.Identifier), value, kind)
            await node.set_writable()
            self.nodes[point] = node
            self.names[node_id.to_string()] = point
        await self.server.start()
        self.relay.target = self.server.bserver._server.sockets[0].getsockname()[1]
        self.server.subscribe_server_callback(CallbackType.PostWrite, self._taken)

    async def _show(self) -> None:
        while True:
            await self._show_next()

    async def _show_next(self) -> None:
        point, value = await self.changes.get()
        node = self.nodes[point]
        await node.write_value(self.faulty(value, await node.read_data_type_as_variant_type()))

    def faulty(self, value: Value, kind: Any) -> Any:
        """The value as it is shown: with a bad status where answers are garbage."""
        if self.faults.garbage:
            return ua.DataValue(ua.Variant(value, kind), ua.StatusCode(UInt32(StatusCodes.BadSensorFailure)))
        return ua.DataValue(ua.Variant(value, kind))

    def _taken(self, event: Any, _service: Any) -> None:
        if event.is_external:
            for one, result in zip(event.request_params.NodesToWrite, event.response_params, strict=True):
                if result.is_good() and (point := self.names.get(one.NodeId.to_string())) is not None:
                    self.written(point, one.Value.Value.Value)
