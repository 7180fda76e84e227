"""A device behind an MQTT broker, and a broker for it: mosquitto, as a process of its own, behind a relay.

The relay stands between the driver and the broker; the device talks to the broker directly, as one in another part of
the plant would.
"""

from __future__ import annotations

import asyncio
import logging
import shutil
import tempfile
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path

from aiomqtt import Client, MqttError

from firable.executor.drivers.device import Point, Value, quiet
from firable.executor.drivers.far_side.end import Faults, GoneError
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.drivers.far_side.relay import Relay, RelayedEnd


def mosquitto() -> str | None:
    """The broker's program, if it is installed; Debian puts it where ordinary users do not look."""
    return shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


class MqttEnd(RelayedEnd):
    """A device that takes what is written to `taken` topics, and a broker; `port` 0 takes a free one for drivers.

    With `secured`, drivers come by a listener of their own that has these lines of the broker's configuration.
    """

    def __init__(self, taken: Collection[Point], port: int = 0, secured: str = "") -> None:
        self.secured = secured
        self.faults = Faults()
        quiet("firable.mqtt")
        self.taken = sorted(taken)
        self.relay = Relay(self.faults, port)
        self.behind = 0
        self.broker: asyncio.subprocess.Process | None = None
        self.folder: tempfile.TemporaryDirectory[str] | None = None
        self.changes: asyncio.Queue[tuple[Point, Value]] = asyncio.Queue()
        self.written: Callable[[Point, Value], None] = lambda _point, _value: None
        self.serving: asyncio.Task[None] | None = None
        self.is_ready = asyncio.Event()

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        """Start the broker and the device."""
        self.written = written
        program = mosquitto()
        if program is None:
            raise FileNotFoundError("mosquitto is not installed")
        self.behind = self.relay.target = free_port()
        self.folder = tempfile.TemporaryDirectory()
        configuration = Path(self.folder.name) / "mosquitto.conf"
        lines = ["per_listener_settings true", "persistence false", "set_tcp_nodelay true"]
        lines += [f"listener {self.behind} 127.0.0.1", "allow_anonymous true"]
        if self.secured:
            self.relay.target = free_port()
            lines += [f"listener {self.relay.target} 127.0.0.1", self.secured]
        configuration.write_text("\n".join([*lines, ""]))
        quiet = asyncio.subprocess.DEVNULL
        # In a session of its own: Ctrl-C at the terminal is for whoever ends it, and no end of its own.
        self.broker = await asyncio.create_subprocess_exec(
            program, "-c", str(configuration), stdout=quiet, stderr=quiet, start_new_session=True
        )
        self.serving = asyncio.create_task(self._serve())
        ways = [asyncio.create_task(self.is_ready.wait()), asyncio.create_task(self.broker.wait())]
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        for way in ways:
            way.cancel()
        if self.broker.returncode is not None:
            raise RuntimeError("mosquitto has ended; does it understand its configuration?")
        await self.mend()

    async def stop(self) -> None:
        """End the device and the broker."""
        await self.cut()
        if self.serving is not None:
            self.serving.cancel()
            await asyncio.gather(self.serving, return_exceptions=True)
        if self.broker is not None:
            if self.broker.returncode is None:
                self.broker.terminate()
            await self.broker.wait()
        if self.folder is not None:
            self.folder.cleanup()

    async def gone(self) -> None:
        """Wait until the broker has ended; raises `GoneError` then."""
        if self.broker is not None:
            await self.broker.wait()
            raise GoneError("its broker, mosquitto, has ended")

    def show(self, point: Point, value: Value) -> None:
        """Publish a value, retained."""
        self.changes.put_nowait((point, value))

    async def _serve(self) -> None:
        while True:
            with suppress(MqttError):
                async with Client("127.0.0.1", self.behind, logger=logging.getLogger("firable.mqtt")) as client:
                    await client.subscribe([(topic, 1) for topic in self.taken])
                    self.is_ready.set()
                    await asyncio.gather(self._take(client), self._publish(client))
            await asyncio.sleep(0.01)  # the broker is not there yet

    async def _take(self, client: Client) -> None:
        async for message in client.messages:
            payload = message.payload
            if isinstance(payload, (bytes, bytearray)):
                self.written(message.topic.value, payload.decode())

    async def _publish(self, client: Client) -> None:
        while True:
            point, value = await self.changes.get()
            text = str(int(value)) if isinstance(value, bool) else str(value)
            await client.publish(point, "garbage" if self.faults.garbage else text, qos=1, retain=True)
