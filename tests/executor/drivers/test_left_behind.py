"""What a connection leaves behind that is lost, or never made: no task that goes on, no error that nobody hears of."""

import asyncio
import gc
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from firable.executor.drivers import modbus, opcua
from firable.executor.drivers.binding import DeviceDocument
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import Connection, LinkError, Options, Point, Use, Wanted
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.far_side.opcua_server import OpcUaEnd
from firable.executor.drivers.keeping import Kept, Nobody
from firable.executor.drivers.modbus_connection import ModbusConnection
from firable.executor.drivers.opcua import OpcUaConnection


def left_by(work: Callable[[], Awaitable[None]]) -> list[dict[str, Any]]:
    """What the event loop was told of that nobody else has heard of."""
    left: list[dict[str, Any]] = []

    async def main() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _loop, context: left.append(context))
        await work()
        gc.collect()

    gc.collect()  # what others have left behind is not ours
    asyncio.run(main())
    return left


class Unreachable:
    """A kind of device that nobody reaches; who gives it up waits for the end of the attempt, which fails."""

    options = Options
    through_broker = False

    def __init__(self, ending_s: float) -> None:
        self.ending_s = ending_s
        self.is_tried = asyncio.Event()

    def point_problem(self, point: Point, use: Use) -> str:
        """None."""
        del point, use
        return ""

    def load(self) -> None:
        """Nothing."""

    async def connect(self, options: Options, wanted: Wanted) -> Connection:
        """Wait for ever."""
        del options, wanted
        self.is_tried.set()
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            ending = asyncio.get_running_loop().create_future()
            asyncio.get_running_loop().call_later(self.ending_s, ending.set_result, None)
            while not ending.done():
                await asyncio.wait([ending], timeout=self.ending_s)
            raise LinkError("nobody is there")


@pytest.mark.parametrize("ending_s", [0.0, 1.0])
def test_attempt_to_connect_that_is_given_up_fails_for_who_has_made_it(ending_s: float) -> None:
    """Also where it takes longer to end than its second cancellation takes to come."""

    async def work() -> None:
        kind = Unreachable(ending_s)
        document = DeviceDocument(driver="none", timeout_s=30)
        running = asyncio.create_task(Kept(document, kind, Options(), Wanted((), 30), Nobody()).run())
        await kind.is_tried.wait()
        await ended([running])
        await asyncio.sleep(2 * ending_s)

    assert left_by(work) == []


def test_command_over_modbus_that_is_begun_as_its_connection_is_lost_fails_unheard() -> None:
    """Whoever was to wait for it is told of the loss already, and waits for nothing more."""

    async def work() -> None:
        end = ModbusTcpEnd()
        await end.start(lambda _point, _value: None)
        options = modbus.TcpOptions(host="127.0.0.1", port=end.port)
        connection = await modbus.TCP.connect(options, Wanted(("coil 1",), timeout_s=30))
        assert isinstance(connection, ModbusConnection)
        await connection.read()
        await end.stop()
        with pytest.raises(LinkError):
            await connection.read()
        connection.begin([("coil 0", True)]).close()
        await connection.close()

    assert left_by(work) == []


def test_session_over_opcua_that_is_closed_without_a_goodbye_leaves_no_task() -> None:
    """One that renews its channel would fail three quarters of an hour later."""

    async def work() -> None:
        end = OpcUaEnd({"ns=2;s=a": False})
        await end.start(lambda _point, _value: None)
        options = opcua.OpcUaOptions(url=f"opc.tcp://127.0.0.1:{end.port}/")
        connection = await opcua.KIND.connect(options, Wanted(("ns=2;s=a",), timeout_s=30))
        assert isinstance(connection, OpcUaConnection)
        connection.is_in_doubt = True
        await connection.close()
        assert [task for task in asyncio.all_tasks() if "Client" in repr(task.get_coro())] == []
        await end.stop()

    assert left_by(work) == []
