"""A driver of others, found by its entry point, passes what every driver has to."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import EntryPoint

import pytest
from support.third_party_driver import MemoryEnd

from firable.executor.drivers import kinds
from firable.executor.drivers.bench import Far
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.far_side.machine import ROLES


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)]
    monkeypatch.setattr(kinds, "entry_points", lambda **_: found)


class TestNumbers(DriverConformance):
    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        points = {role: f"the {role}" for role in (*ROLES, "number", "code")}
        yield Far(MemoryEnd("m"), "driver: theirs, memory: m", points)


class TestTexts(DriverConformance):
    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        points = {role: f"the {role}" for role in (*ROLES, "command")}
        yield Far(MemoryEnd("m"), "driver: theirs, memory: m", points)
