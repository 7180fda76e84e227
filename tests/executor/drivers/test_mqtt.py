"""MQTT through mosquitto, which is started for each test."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from firable.executor.drivers.bench import Far
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.far_side.machine import ROLES
from firable.executor.drivers.far_side.mqtt_device import MqttEnd, mosquitto

ALIVE = "alive: {read: cell/M/button,within_s: 600}"
"""What a broker's device needs for an emergency stop; here it does not change."""


@pytest.mark.skipif(mosquitto() is None, reason="needs the broker mosquitto, which is not installed")
class TestMqtt(DriverConformance):
    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        points = {role: f"cell/M/{role}" for role in (*ROLES, "command")}
        end = MqttEnd({points[role] for role in ("output", "beat", "code", "command")})
        yield Far(end, f"driver: mqtt, host: 127.0.0.1, port: {end.port}, {ALIVE}", points)
