"""A driver of others, found by its entry point, passes what every driver has to."""

import json
import os
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import EntryPoint
from pathlib import Path

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
        points = {role: f"the {role}" for role in (*ROLES, "number")}
        yield Far(MemoryEnd("m"), "driver: theirs, memory: m", points)


class TestTexts(DriverConformance):
    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        points = {role: f"the {role}" for role in (*ROLES, "command")}
        yield Far(MemoryEnd("m"), "driver: theirs, memory: m", points)


PACKAGE = """
from firable.executor.drivers.device import LinkError, Options

class Lamps(Options):
    lamps: int

class Connection:
    def __init__(self, options, wanted):
        self.told = [(point, int(point.removeprefix("lamp ")) < options.lamps) for point in wanted.read]

    async def read(self):
        import asyncio
        if not self.told:
            await asyncio.get_running_loop().create_future()
        told, self.told = self.told, []
        return told

    async def write(self, writes):
        raise LinkError("lamps are only looked at")

    async def close(self):
        pass

class Kind:
    options = Lamps
    through_broker = False

    def point_problem(self, point, use):
        return "" if point.startswith("lamp ") else f"what there is to {use} is a lamp"

    def load(self):
        pass

    async def connect(self, options, wanted):
        return Connection(options, wanted)

KIND = Kind()
"""
BINDING = """
firable_bind: 1
cell: lamps
devices: {hall: {driver: lamps-of-others, lamps: 1}}
signals: {a.on1: {device: hall, read: lamp 0}, a.on2: {device: hall, read: lamp 1}}
"""


def test_a_driver_of_an_installed_package_is_found_by_the_command_line(tmp_path: Path) -> None:
    site = tmp_path / "site"
    about = site / "lamps_of_others-1.0.dist-info"  # as pip leaves it
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: lamps-of-others\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[firable.drivers]\nlamps-of-others = lamps_of_others:KIND\n")
    (site / "lamps_of_others.py").write_text(PACKAGE)
    (tmp_path / "hall.bind.yaml").write_text(BINDING)
    looked = [sys.executable, "-m", "firable.cli", "io", str(tmp_path / "hall.bind.yaml"), "--once", "--format", "json"]
    paths = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(looked, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    shown = json.loads(done.stdout)["signals"]
    assert {name: one["value"] for name, one in shown.items()} == {"a.on1": True, "a.on2": False}
    without = subprocess.run(looked, capture_output=True, text=True, timeout=60)
    assert without.returncode == 2
    assert "there is no driver 'lamps-of-others'" in without.stderr
