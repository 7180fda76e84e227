"""OPC UA against a server of asyncua; making one takes a second, so that all tests have the same."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, suppress
from types import SimpleNamespace
from typing import Any

import pytest
from asyncua import ua
from asyncua.client.client import Client
from asyncua.ua.status_codes import StatusCodes

from firable.executor.drivers.bench import PATIENCE_S, Far
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.device import LinkError, NoValue, Point, Use, Value, Wanted
from firable.executor.drivers.far_side.machine import ROLES
from firable.executor.drivers.far_side.opcua_server import OpcUaEnd
from firable.executor.drivers.opcua import KIND, OpcUaConnection, OpcUaOptions, spelling
from firable.nets.diagnostics import InputError

POINTS = {role: f"ns=2;s=M.{role}" for role in (*ROLES, "number")}
BITS = {"sensor", "closed", "button", "tripped", "output"}


@pytest.fixture(scope="module")
def shared() -> Iterator[tuple[asyncio.Runner, OpcUaEnd]]:
    with asyncio.Runner() as runner:
        end = OpcUaEnd({point: False if role in BITS else 0 for role, point in POINTS.items()})
        yield runner, end
        runner.run(end.end())


class TestOpcUa(DriverConformance):
    @pytest.fixture(autouse=True)
    def _shared(self, shared: tuple[asyncio.Runner, OpcUaEnd]) -> None:
        self.runner, self.end = shared
        self.end.faults.silent = self.end.faults.garbage = False
        self.end.faults.delay_s = 0.0

    def run(self, work: Any) -> None:
        self.runner.run(work)

    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        if not self.end.port:
            await self.end.start(lambda _point, _value: None)
            await self.end.stop()
        yield Far(self.end, f"driver: opcua, url: 'opc.tcp://127.0.0.1:{self.end.port}/', every_s: 0.005", POINTS)

    def test_a_node_that_the_server_has_not_is_named_when_it_is_to_be_written(self) -> None:
        async def main() -> None:
            await self.end.start(lambda _point, _value: None)
            options = OpcUaOptions(url=f"opc.tcp://127.0.0.1:{self.end.port}/")
            connection = await KIND.connect(options, Wanted((POINTS["sensor"],), 10.0))
            with pytest.raises(LinkError, match=r"not let .ns=2;s=M\.numbr. be written: .*BadNodeIdUnknown"):
                await connection.write((("ns=2;s=M.numbr", 1),))
            await connection.close()
            await self.end.stop()

        self.run(main())

    def test_a_truth_value_takes_no_heartbeat_nor_the_number_of_a_command(self) -> None:
        async def main() -> None:
            await self.end.start(lambda _point, _value: None)
            options = OpcUaOptions(url=f"opc.tcp://127.0.0.1:{self.end.port}/")
            connection = await KIND.connect(options, Wanted((POINTS["sensor"],), PATIENCE_S))
            for value in (0, 1, True, False):
                await connection.write(((POINTS["output"], value),))
            with pytest.raises(LinkError, match=r"M\.output' does not take 2: a truth value is 0 or 1"):
                await connection.write(((POINTS["output"], 2),))
            await connection.close()
            await self.end.stop()

        self.run(main())

    @pytest.mark.parametrize("is_dropped", [True, False])
    def test_a_subscription_that_the_server_has_dropped_or_tells_nothing_of_ends_the_connection(
        self, is_dropped: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The server answers all questions meanwhile, so that what was read once would look good for ever."""

        async def main() -> None:
            await self.end.start(lambda _point, _value: None)
            options = OpcUaOptions(url=f"opc.tcp://127.0.0.1:{self.end.port}/")
            connection = await KIND.connect(options, Wanted((POINTS["sensor"],), 1.0))
            assert [point for point, _ in await connection.read()] == [POINTS["sensor"]]
            with suppress(TimeoutError):  # nothing changes, and the server says that the subscription is there
                pytest.fail(str(await asyncio.wait_for(connection.read(), 3.0)))
            served = self.end.server.iserver.subscription_service
            if is_dropped:
                await served.delete_subscriptions(list(served.subscriptions))
            else:
                for one in served.subscriptions.values():
                    monkeypatch.setattr(one, "publish_results", nothing)
            why = "has (dropped|told nothing of) the subscription"  # it may keep the question for what it has dropped
            with pytest.raises(LinkError, match=why):
                await asyncio.wait_for(connection.read(), PATIENCE_S)
            await connection.close()
            await self.end.stop()

        async def nothing(*_args: Any) -> bool:
            return False

        self.run(main())

    def test_a_subscription_that_the_server_says_it_has_not_ends_the_connection_at_once(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Long before its signs of life are missed."""
        from asyncua.client.ua_session import UaSession
        from asyncua.ua.uaerrors import BadNoSubscription

        async def none(*_args: Any) -> None:
            raise BadNoSubscription

        async def main() -> None:
            await self.end.start(lambda _point, _value: None)
            monkeypatch.setattr(UaSession, "publish", none)
            options = OpcUaOptions(url=f"opc.tcp://127.0.0.1:{self.end.port}/")
            connection = await KIND.connect(options, Wanted((POINTS["sensor"],), 10 * PATIENCE_S))
            with pytest.raises(LinkError, match="has dropped the subscription"):
                await asyncio.wait_for(connection.read(), PATIENCE_S)
            await connection.close()
            await self.end.stop()

        self.run(main())

    def test_a_change_that_nobody_can_read_ends_the_connection_though_the_server_goes_on(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """asyncua drops it: a contact of the emergency stop that has opened would look closed for ever."""
        from asyncua.client.ua_session import UaSession
        from asyncua.ua.uaerrors import UaStructParsingError

        publish, is_readable = UaSession.publish, True

        async def unreadable(*args: Any) -> Any:
            answer = await publish(*args)
            if not is_readable and answer.Parameters.NotificationMessage.NotificationData:
                raise UaStructParsingError
            return answer

        async def main() -> None:
            nonlocal is_readable
            await self.end.start(lambda _point, _value: None)
            self.end.show(POINTS["sensor"], value=False)
            monkeypatch.setattr(UaSession, "publish", unreadable)
            options = OpcUaOptions(url=f"opc.tcp://127.0.0.1:{self.end.port}/")
            connection = await KIND.connect(options, Wanted((POINTS["sensor"],), 1.0))
            assert await connection.read() == [(POINTS["sensor"], False)]
            is_readable = False
            self.end.show(POINTS["sensor"], value=True)
            with pytest.raises(LinkError, match="was lost, or is what nobody can read"):
                await asyncio.wait_for(connection.read(), PATIENCE_S)
            await connection.close()
            await self.end.stop()

        self.run(main())

    @pytest.mark.parametrize("revised_ms", [float("nan"), float("inf"), -20.0, 3_600_000.0])
    def test_a_server_that_would_not_say_in_time_that_it_is_there_is_refused(
        self, revised_ms: float, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from asyncua.client.ua_session import UaSession

        for name in ("create_subscription", "update_subscription"):
            monkeypatch.setattr(UaSession, name, revising(getattr(UaSession, name), revised_ms))

        async def main() -> None:
            await self.end.start(lambda _point, _value: None)
            options = OpcUaOptions(url=f"opc.tcp://127.0.0.1:{self.end.port}/")
            with pytest.raises(LinkError, match=r"would say every \S+ s that it is there, not at least every 10 s"):
                await KIND.connect(options, Wanted((POINTS["sensor"],), 10.0))
            await self.end.stop()

        self.run(main())


@pytest.mark.parametrize(
    ("messages", "is_lost"),
    [
        ("1 2 3", False),
        ("1- 1 2- 2 3", False),
        ("1 1- 2 2- 2- 3", False),
        ("7 8 8 0-", False),
        ("4294967295 1 2", False),
        ("4294967295 1- 1 2- 2", False),
        ("4294967295 1 3", True),
        ("1 3", True),
        ("1- 2", True),
        ("1 2- 3-", True),
        ("1 2 2- 4", True),
    ],
    ids=str,
)
def test_messages_are_missing_where_numbers_are(messages: str, is_lost: bool) -> None:
    """A sign of life (-) has the number of the next message, or on some servers that of the last."""

    async def main() -> None:
        connection = OpcUaConnection(Client("opc.tcp://127.0.0.1:4840/"), Wanted((), 1.0))
        for message in messages.split():
            connection.published(int(message.removesuffix("-")), tells=not message.endswith("-"))
        assert connection.told.empty() != is_lost

    asyncio.run(main())


@pytest.mark.parametrize(
    ("value", "status", "told", "is_value"),
    [
        (17, "Good", 17, True),
        (17, "BadNoCommunication", "BadNoCommunication", False),
        (17, "UncertainLastUsableValue", "UncertainLastUsableValue", False),
        (None, "Good", "None", False),
        (float("nan"), "Good", "nan", False),
        (float("inf"), "Good", float("inf"), True),
    ],
    ids=str,
)
def test_what_is_no_value_of_a_node_is_told_apart(value: Any, status: str, told: Value, is_value: bool) -> None:
    connection = OpcUaConnection(Client("opc.tcp://127.0.0.1:1/"), Wanted((), 1.0))
    connection.points["i=85"] = "i=85"
    code = ua.StatusCode(ua.UInt32(getattr(StatusCodes, status)))
    shown = ua.MonitoredItemNotification(Value=ua.DataValue(ua.Variant(value), code))
    connection.datachange_notification(connection._node("i=85"), value, SimpleNamespace(monitored_item=shown))
    heard = connection.told.get_nowait()
    assert not isinstance(heard, Exception)
    assert (heard, isinstance(heard[1], NoValue)) == (("i=85", told), not is_value)


def revising(ask: Any, revised_ms: float) -> Any:
    """A question about a subscription, in whose answer the server has another interval."""

    async def asked(*args: Any, **keys: Any) -> Any:
        answer = await ask(*args, **keys)
        answer.RevisedPublishingInterval = revised_ms
        return answer

    return asked


@pytest.mark.parametrize("at", [{2: "urn:a", 3: "urn:b"}, {2: "urn:b", 3: "urn:a"}, {4: "urn:a"}])
def test_a_node_is_found_wherever_the_server_has_its_namespace(
    at: dict[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def nothing(_: Client) -> None:
        return None

    async def main() -> None:
        own = next(index for index, uri in at.items() if uri == "urn:a")
        points: dict[Point, Value] = {f"ns={index};s=M.{name}": index == own for index in at for name in ("done", "go")}
        end, written = OpcUaEnd(points, namespaces=at), asyncio.Queue[tuple[Point, Value]]()
        await end.start(lambda point, value: written.put_nowait((point, value)))
        url, done, go = f"opc.tcp://127.0.0.1:{end.port}/", "ns=7;s=M.done", "ns=7;s=M.go"
        options = OpcUaOptions.model_validate({"url": url, "namespaces": {"7": "urn:a"}})
        try:
            connection = await KIND.connect(options, Wanted((done,), PATIENCE_S))
            assert list(await connection.read()) == [(done, True)]
            await connection.write(((go, False),))
            assert await asyncio.wait_for(written.get(), PATIENCE_S) == (f"ns={own};s=M.go", False)
            await connection.close()
            with monkeypatch.context() as patch:
                patch.setattr(Client, "get_namespace_array", nothing)
                with pytest.raises(LinkError, match="does not say which namespaces it has"):
                    await KIND.connect(options, Wanted((done,), PATIENCE_S))
            elsewhere = options.model_copy(update={"namespaces": {"7": "urn:c"}})
            with pytest.raises(LinkError, match="the server has no namespace 'urn:c'"):
                await KIND.connect(elsewhere, Wanted((done,), PATIENCE_S))
        finally:
            await end.stop()
            await end.end()

    asyncio.run(main())


@pytest.mark.parametrize(
    ("namespaces", "told"),
    [
        ("{0: urn:a}", "0"),
        ("{two: urn:a}", "two"),
        ('{2: ""}', "2"),
        ("{2: urn:a, 3: urn:a}", "'urn:a' has two indexes"),
        ('{2: "http://opcfoundation.org/UA/"}', "which has the index 0"),
    ],
)
def test_namespaces_that_mean_nothing_are_refused_where_they_stand(namespaces: str, told: str) -> None:
    text = f"""firable_bind: 1
cell: n
devices:
  D:
    driver: opcua
    url: "opc.tcp://127.0.0.1:4840/"
    namespaces: {namespaces}
"""
    with pytest.raises(InputError) as caught:
        parse_binding(text)
    (problem,) = caught.value.diagnostics
    assert told in problem.message
    assert problem.span is not None
    assert problem.span.line == 7


def test_what_the_namespaces_of_a_binding_leave_open_is_refused() -> None:
    text = """{firable_bind: 1, cell: n, devices: {
A: {driver: opcua, url: "opc.tcp://h:4840/", namespaces: {2: urn:a}, safe: {"ns=2;s=x": 0, "i=5": 0, "ns=3;s=x": 0}},
B: {driver: opcua, url: "opc.tcp://H:4840/", namespaces: {3: urn:a}}}}"""
    with pytest.raises(InputError) as caught:
        parse_binding(text)
    assert [(problem.code, problem.message) for problem in caught.value.diagnostics] == [
        ("F5102", "'ns=3;s=x' cannot be a point to write: `namespaces` does not say what the index 3 means"),
        ("F5102", "'B' stands at the address of 'A', and has another `namespaces`"),
    ]


def test_a_server_that_takes_a_connection_and_says_nothing_has_not_answered_in_time() -> None:
    async def silent(_reader: asyncio.StreamReader, _writer: asyncio.StreamWriter) -> None:
        await asyncio.sleep(PATIENCE_S)  # with the writer, which would close the connection when it is gone

    async def main() -> None:
        server = await asyncio.start_server(silent, "127.0.0.1", 0)
        options = OpcUaOptions(url=f"opc.tcp://127.0.0.1:{server.sockets[0].getsockname()[1]}/")
        with pytest.raises(TimeoutError):  # which is told as that by whoever keeps the connection
            await KIND.connect(options, Wanted((POINTS["sensor"],), 0.2))
        server.close()

    asyncio.run(main())


GUID = "c496578a-0dfe-4b8f-870a-745238c6aeae"


@pytest.mark.parametrize(
    ("point", "one"),
    [
        *((one, one) for one in ("i=85", "i=0", "ns=2;i=4294967295", "s=a;b=c", f"g={GUID}", "b=AQ==")),
        *(("ns=0;i=85", "i=85"), ("ns=02;i=5", "ns=2;i=5"), ("ns=2;i=05", "ns=2;i=5"), ("ns=00;s= a", "s= a")),
        *((f"ns=1;g={{{GUID.upper()}}}", f"ns=1;g={GUID}"), ("ns=3;b=AR==", "ns=3;b=AQ==")),
    ],
)  # fmt: skip
def test_a_node_has_one_spelling(point: str, one: str) -> None:
    from asyncua import ua

    assert spelling(point) == spelling(one) == one
    told = f"each node has one spelling, so that two can be told apart: write `{one}`"
    assert KIND.point_problem(point, Use.READ) == ("" if point == one else told)
    if "{" not in point:  # which no server has
        assert ua.NodeId.from_string(point) == ua.NodeId.from_string(one)
    if ";b=" not in point and not point.startswith("b="):
        assert ua.NodeId.from_string(one).to_string() == one


@pytest.mark.parametrize(
    "point",
    [
        *("", "i=", "i=x", "i=-1", "i=+1", "i=1_0", "i= 5", "i=\u0665", "i=4294967296", "i=5;ns=2", "ns=2", "x=5"),
        *(
            "ns=65536;i=1",
            "ns=-1;i=1",
            "ns=2;ns=3;i=5",
            "ns=;i=5",
            "srv=1;i=5",
            "s=a\nb",
            "g=1",
            "b=A",
            "b=A Q==",
            "b=0xAB",
        ),
    ],
)
def test_what_is_no_node_is_refused(point: str) -> None:
    assert spelling(point) is None
    assert "has an id such as" in KIND.point_problem(point, Use.READ)
