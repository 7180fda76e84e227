"""A cell on four hosts of a network in which a line, the coordinator or a process fails; sockets and disks are real.

After each fault work goes on, and the traces of all hosts join to a trace of the central net.
"""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.network import PREFIX, Network, network
from support.waiting import PATIENCE_SECONDS, until

from firable.cli.main import main
from firable.nets.catalogue import catalogue_net
from firable.semantics.joining import join
from firable.semantics.replaying import replay
from firable.semantics.trace import read_trace

CONTROLLERS = ("system", "robot", "mc", "conveyor")
"""On the hosts 1, 2, 3 and 4; the coordinator is with `system`."""
ROBOT = 2

RELAY = """
import asyncio
async def way(reader, writer):
    loop = asyncio.get_running_loop()
    while data := await reader.read(65536):
        loop.call_later(0.2, writer.write, data)
    writer.close()
async def serve(reader, writer):
    there = await asyncio.open_connection("{prefix}.1", 7447)
    await asyncio.gather(way(reader, there[1]), way(there[0], writer))
async def main():
    server = await asyncio.start_server(serve, "{prefix}.2", 7448)
    await server.serve_forever()
asyncio.run(main())
"""


@pytest.fixture(scope="module")
def hosts() -> Iterator[Network]:
    with network(4) as made:
        yield made


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("bundle") / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    return str(path)


class Cell:
    """The one-robot cell on four hosts, without machines."""

    def __init__(self, hosts: Network, bundle: str, folder: Path, robot_joins: str = f"tcp/{PREFIX}.1:7447") -> None:
        self.hosts, self.bundle, self.folder, self.robot_joins = hosts, bundle, folder, robot_joins
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "Cell":
        for name in CONTROLLERS:
            self.start(name)
        self.until(lambda: self.fired() > 5)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes.values():
            process.kill()
            process.wait()

    def start(self, name: str, *more: str) -> None:
        """Start a host, or start it anew."""
        joins = self.robot_joins if name == "robot" else f"tcp/{PREFIX}.1:7447"
        where = ["--listen", f"tcp/{PREFIX}.1:7447"] if name == "system" else ["--join", joins]
        files = ["--trace", str(self.trace(name)), "--journal", str(self.folder / f"{name}.journal")]
        run = [sys.executable, "-m", "firable.cli", "run", self.bundle, "--controller", name, *where, *files]
        with self.said(name).open("ab") as said:
            self.processes[name] = subprocess.Popen(
                [*self.hosts.within(CONTROLLERS.index(name) + 1), *run, "--dry-run", "0.02", *more],
                stdout=said,
                stderr=said,
            )

    def trace(self, name: str) -> Path:
        return self.folder / f"{name}.trace"

    def said(self, name: str) -> Path:
        return self.folder / f"{name}.said"

    def heard(self, name: str, what: str) -> int:
        """How often a host has said something."""
        return self.said(name).read_text().count(what)

    def fired(self) -> int:
        """How many transitions the coordinator has fired."""
        path = self.trace("system")
        return path.read_text().count('"round"') if path.exists() else 0

    def until(self, condition: Callable[[], bool]) -> None:
        """Wait for something, with patience."""
        until(condition, lambda: {name: self.said(name).read_text() for name in CONTROLLERS}, every_seconds=0.05)

    def goes_on(self, transitions: int = 18) -> None:
        """So many transitions of several controllers are fired from now on: nine carry a workpiece through."""
        now = self.fired()
        self.until(lambda: self.fired() > now + transitions)

    def stop_and_judge(self) -> None:
        """Stop all hosts in order; their traces are one of the net."""
        for process in self.processes.values():
            process.terminate()
        codes = {name: process.wait(PATIENCE_SECONDS) for name, process in self.processes.items()}
        assert set(codes.values()) == {0}, {name: self.said(name).read_text() for name in CONTROLLERS}
        net = catalogue_net("one_robot")
        done = replay(net, join(net, [read_trace(self.trace(name)) for name in CONTROLLERS]))
        assert done.complete


@pytest.fixture
def cell(hosts: Network, bundle: str, tmp_path: Path) -> Iterator[Cell]:
    with Cell(hosts, bundle, tmp_path) as started:
        yield started


def test_a_line_that_goes_down_and_comes_up_again(cell: Cell) -> None:
    cell.hosts.cut(ROBOT)
    cell.until(lambda: bool(cell.heard("system", "'robot' is lost") and cell.heard("robot", "is lost")))
    time.sleep(0.5)
    cell.hosts.mend(ROBOT)
    cell.until(lambda: cell.heard("system", "'robot' is connected") >= 2)
    cell.goes_on()
    cell.stop_and_judge()


def test_a_line_that_loses_thirty_in_a_hundred_packets(cell: Cell) -> None:
    cell.hosts.lose(ROBOT, 30)
    try:
        cell.goes_on()
        assert cell.hosts.dropped(ROBOT) > 10
    finally:
        cell.hosts.lose_nothing(ROBOT)
    cell.goes_on()
    cell.stop_and_judge()


def test_a_line_that_takes_two_hundred_milliseconds(hosts: Network, bundle: str, tmp_path: Path) -> None:
    relay = subprocess.Popen([*hosts.within(ROBOT), sys.executable, "-c", RELAY.format(prefix=PREFIX)])
    try:
        with Cell(hosts, bundle, tmp_path, f"tcp/{PREFIX}.2:7448") as cell:
            cell.goes_on(9)  # each takes a second
            cell.stop_and_judge()
    finally:
        relay.kill()
        relay.wait()


def test_a_coordinator_that_is_killed_and_started_anew(cell: Cell) -> None:
    cell.processes["system"].kill()
    cell.processes["system"].wait()
    cell.until(lambda: bool(cell.heard("robot", "the coordinator is lost")))
    cell.start("system", "--resume")
    cell.until(lambda: cell.heard("robot", "the coordinator is connected") >= 2)
    cell.goes_on()
    cell.stop_and_judge()


def test_a_process_that_freezes_and_thaws(cell: Cell) -> None:
    cell.processes["robot"].send_signal(signal.SIGSTOP)
    cell.until(lambda: bool(cell.heard("system", "'robot' is lost")))
    time.sleep(0.5)
    cell.processes["robot"].send_signal(signal.SIGCONT)
    cell.until(lambda: cell.heard("system", "'robot' is connected") >= 2)
    cell.goes_on()
    cell.stop_and_judge()
