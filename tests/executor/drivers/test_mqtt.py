"""MQTT through mosquitto, which is started for each test."""

import asyncio
import gc
import os
import socket
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from firable.cli.main import main
from firable.executor.drivers.bench import Far, Heard, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.device import LinkError, Point, Value, Wanted
from firable.executor.drivers.far_side.ends import PORTS
from firable.executor.drivers.far_side.machine import ROLES
from firable.executor.drivers.far_side.mqtt_device import MqttEnd, mosquitto
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.drivers.mqtt import KIND, Guarded, MqttConnection, MqttOptions

needs_mosquitto = pytest.mark.skipif(mosquitto() is None, reason="needs the broker mosquitto, which is not installed")


@needs_mosquitto
class TestMqtt(DriverConformance):
    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        points = {role: f"cell/M/{role}" for role in (*ROLES, "command")}
        end = MqttEnd({points[role] for role in ("output", "beat", "code", "command")})
        yield Far(end, f"driver: mqtt, host: 127.0.0.1, port: {end.port}", points, through_broker=True)


@needs_mosquitto
def test_a_cell_whose_broker_has_died_ends_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    start = MqttEnd.start

    async def killed_soon(end: MqttEnd, written: Callable[[Point, Value], None]) -> None:
        await start(end, written)
        assert end.broker is not None
        assert os.getpgid(end.broker.pid) != os.getpgrp(), "Ctrl-C at the terminal reaches it"
        asyncio.get_running_loop().call_later(0.2, end.broker.kill)

    monkeypatch.setattr(MqttEnd, "start", killed_soon)
    monkeypatch.setitem(PORTS, "mqtt", str(free_port()))
    command = ["sim", "catalogue:one_robot", "--mqtt", "--bind", str(tmp_path / "bind"), "--for", "60"]
    assert main(command) == 2
    said = capsys.readouterr().err
    assert "error[F5104]: the cell cannot be served any more: mqtt: its broker, mosquitto, has ended" in said


@needs_mosquitto
def test_a_connection_that_is_given_up_before_a_frozen_broker_has_answered_leaves_no_error_to_the_event_loop() -> None:
    async def main() -> list[object]:
        left: list[object] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: left.append(context))
        end = MqttEnd({"cell/lamp"})
        await end.start(lambda _point, _value: None)
        end.faults.silent = True
        connecting = KIND.connect(MqttOptions(host="127.0.0.1", port=end.port), Wanted(("cell/key",), timeout_s=0.5))
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(connecting, 0.2)
        end.faults.silent = False
        await end.stop()
        return left

    assert asyncio.run(main()) == []


@pytest.mark.parametrize(
    ("answer", "why"),
    [(b"", "Operation timed out"), (b"\x90\x04\x00\x01\x80\x01", "the broker does not let 'cell/key' be read")],
    ids=["ends", "refuses"],
)
def test_a_broker_that_does_not_let_a_topic_be_read_is_told_and_leaves_no_error_to_the_event_loop(
    answer: bytes, why: str
) -> None:
    async def main() -> list[object]:
        left: list[object] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: left.append(context))

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            await reader.read(1000)
            writer.write(b"\x20\x02\x00\x00")
            await reader.read(1000)
            writer.write(answer)
            if answer:
                await reader.read(1000)
            writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        options = MqttOptions(host="127.0.0.1", port=server.sockets[0].getsockname()[1])
        with pytest.raises(LinkError, match=why):
            await KIND.connect(options, Wanted(("cell/key",), timeout_s=0.7))
        server.close()
        gc.collect()
        return left

    assert asyncio.run(main()) == []


@pytest.mark.parametrize(
    ("told", "why"),
    [
        (b"\x30\x84\x80\x80\x01\x00\x01s1", "a message of 2097156 bytes, more than a device has to tell"),
        (b"\x34\x06\x00\x01s\x00\x07" + b"1" + b"\x30\x04\x00\x01s1", "a message that is to be acknowledged twice"),
        (b"\x30\x04\x00\x01\xff1", "Disconnected"),
    ],
    ids=["too long", "twice", "unreadable"],
)
def test_what_no_device_tells_ends_the_connection_at_once_and_is_watched_no_more(told: bytes, why: str) -> None:
    """Who may publish at a broker can send 256 MB, for which the event loop stood still for seconds."""

    async def main() -> None:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            await reader.read(1000)
            writer.write(b"\x20\x02\x00\x00")
            subscribing = await reader.read(1000)
            writer.write(b"\x90\x04" + subscribing[2:4] + b"\x01\x01")
            own = await reader.read(1000)
            topic = own[2 : 4 + own[3]]
            writer.write(b"\x40\x02" + own[len(topic) + 2 : len(topic) + 4])
            writer.write(b"\x30" + bytes([len(topic) + 1]) + topic + b"1" + told)
            await reader.read()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        options = MqttOptions(host="127.0.0.1", port=server.sockets[0].getsockname()[1])
        connection = await KIND.connect(options, Wanted(("s",), timeout_s=10.0))
        assert isinstance(connection, MqttConnection)
        watched = connection.client._client.socket()
        assert isinstance(watched, socket.socket)
        descriptor = watched.fileno()
        assert await connection.read() == []
        with pytest.raises(LinkError, match=why):
            await asyncio.wait_for(connection.read(), 10.0)
        await connection.close()
        assert not asyncio.get_running_loop().remove_reader(descriptor)
        server.close()

    asyncio.run(main())


def test_a_socket_that_is_closed_before_it_is_watched_leaves_no_error_to_the_event_loop() -> None:
    async def test() -> tuple[list[str], list[object]]:
        loop, called, left = asyncio.get_running_loop(), list[str](), list[object]()
        loop.set_exception_handler(lambda _loop, context: left.append(context["exception"]))
        guarded, (one, other) = Guarded(loop), socket.socketpair()
        closed = os.dup(one.fileno())
        os.close(closed)
        for fd in (closed, one.fileno()):
            guarded.call_soon_threadsafe(
                guarded.add_writer, fd, lambda fd=fd: called.append(f"writer of {fd == closed}")
            )
            guarded.call_soon_threadsafe(
                guarded.add_reader, fd, lambda fd=fd: called.append(f"reader of {fd == closed}")
            )
        other.send(b"?")
        await until(lambda: len(set(called)) == 2, "both are called")
        loop.remove_writer(one.fileno())
        loop.remove_reader(one.fileno())
        one.close()
        other.close()
        return sorted(set(called)), left

    assert asyncio.run(test()) == (["reader of False", "writer of False"], [])


def test_broker_that_no_packet_reaches_is_not_waited_for_beyond_the_attempt_to_connect() -> None:
    """The attempt is made by a thread, for whose end the event loop waits at its own."""
    waiting: list[socket.socket] = []
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen(0)
        for _ in range(4):  # until no more are let in, and what comes is dropped
            waiting.append(one := socket.socket())
            one.setblocking(False)
            one.connect_ex(listening.getsockname())

        async def main() -> None:
            options = MqttOptions(host="127.0.0.1", port=listening.getsockname()[1])
            with pytest.raises(LinkError, match="timed out"):
                await KIND.connect(options, Wanted(("cell/key",), timeout_s=0.3))

        begun = time.monotonic()
        asyncio.run(main())
        assert time.monotonic() - begun < 4
    for one in waiting:
        one.close()


@needs_mosquitto
def test_whoever_connects_after_a_signal_was_forced_finds_it_forced_and_no_command_is_found_there() -> None:
    """A device's own values are retained, and nothing that is written to command it."""

    async def main() -> dict[str, bool | None]:
        end = MqttEnd({"cell/lamp"})
        written: list[object] = []
        await end.start(lambda point, value: written.append((point, value)))
        for topic in ("cell/key", "cell/lamp"):
            end.show(topic, value=False)
        binding = parse_binding(f"""
firable_bind: 1
cell: lamp
devices:
  box:
    driver: mqtt
    host: 127.0.0.1
    port: {end.port}
    safe: {{cell/lamp: false}}
signals:
  key: {{device: box, read: cell/key, force: true}}
  lamp: {{device: box, read: cell/lamp, force: true}}
""")
        for turn in range(2):
            driver = BoundDriver(binding, (), frozenset())
            heard = Heard()
            running = asyncio.create_task(driver.run(heard, heard))
            await driver.met()
            found = {name: reading.value for name, reading in driver.readings().items()}
            if turn == 0:
                driver.force("key", value=True)
                driver.force("lamp", value=True)
                await until(lambda: ("cell/lamp", "1") in written, "the lamp is lit")
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
        await end.stop()
        return found

    assert asyncio.run(main()) == {"key": True, "lamp": False}
