"""What is Zenoh's own: certificates, who is heard of two, what listens, and what strangers publish."""

import asyncio
import json
import socket
from contextlib import AsyncExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import zenoh
from support.certificates import Site
from support.link_rigs import PATIENCE_SECONDS, Heard, running

from firable.executor.drivers.bench import until
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.links.encoding import MESSAGE_BYTES_MAX, pack
from firable.executor.links.link import COORDINATOR, PROTOCOL_VERSION, Greeting
from firable.executor.links.storages import Memory, Storage
from firable.executor.links.zenoh_link import Certificates, ZenohLink, open_to_the_network
from firable.executor.protocol.messages import Decision, Readiness, Report
from firable.nets.diagnostics import InputError, Severity

CENTRE = Greeting("d1", (COORDINATOR,))
ROBOT = Greeting("d1", ("robot",))


def test_hosts_with_certificates_of_the_site_are_connected(tmp_path: Path) -> None:
    site = Site(tmp_path / "site")

    async def main() -> None:
        at = f"tls/127.0.0.1:{free_port()}"
        here = ZenohLink(CENTRE, listen=[at], certificates=site.host("centre"))
        there = ZenohLink(ROBOT, join=[at], certificates=site.host("robot"))
        async with running(here) as centre, running(there) as robot:
            await centre.until_told(("connected", "robot"))
            await robot.until_told(("connected", COORDINATOR))

    asyncio.run(main())


@pytest.mark.parametrize("who", ["of another site", "nobody"])
def test_a_host_without_a_certificate_of_the_site_is_kept_out(tmp_path: Path, who: str) -> None:
    site, other = Site(tmp_path / "site"), Site(tmp_path / "other")
    of_other = other.host("robot")
    stranger = Certificates(str(site.authority), of_other.certificate, of_other.key)

    async def main() -> None:
        at = f"tls/127.0.0.1:{free_port()}"
        here = ZenohLink(CENTRE, listen=[at], certificates=site.host("centre"))
        there = ZenohLink(ROBOT, join=[at], certificates=stranger if who == "of another site" else None)
        late = ZenohLink(replace(ROBOT, names=("mc",)), join=[at], certificates=site.host("mc"))
        async with running(here) as centre, running(there) as robot:
            await asyncio.sleep(0.6)  # several attempts
            async with running(late):
                await centre.until_told(("connected", "mc"))
            assert not [peer for _, peer in centre.told if peer == "robot"]
            assert not robot.told

    asyncio.run(main())


def test_of_two_hosts_with_one_name_the_first_is_heard_until_it_ends() -> None:
    async def main() -> None:
        at = f"tcp/127.0.0.1:{free_port()}"
        here, first, second = ZenohLink(CENTRE, listen=[at]), ZenohLink(ROBOT, join=[at]), ZenohLink(ROBOT, join=[at])
        message = Decision("robot", 1, None, 0, 0)
        async with running(here) as centre, AsyncExitStack() as until_it_ends:
            one = await until_it_ends.enter_async_context(running(first, Memory(Storage("r1"))))
            await centre.until_told(("connected", "robot"))
            async with asyncio.timeout(PATIENCE_SECONDS), running(second, Memory(Storage("r1"))) as two:
                await centre.until_told(("refused", "robot"))
                assert [problem.code for problem in centre.problems] == ["F5020"]
                assert "two hosts" in centre.problems[0].message
                await two.until_told(("refused", COORDINATOR))
                assert "'robot' is run by two hosts" in {problem.message for problem in two.problems}
                assert two.run_by_two == {"robot"}  # and it is not that one who has said so
                while not one.messages:
                    second.send("robot", COORDINATOR, Report("robot", Readiness(0, frozenset())))
                    here.send(COORDINATOR, "robot", message)
                    await asyncio.sleep(0.02)
                assert not two.messages
                assert not centre.messages
                assert ("connected", COORDINATOR) not in two.told
                await until_it_ends.aclose()
                await centre.until(lambda: centre.told.count(("connected", "robot")) == 2)
                while not two.messages:
                    here.send(COORDINATOR, "robot", message)
                    await asyncio.sleep(0.02)

    asyncio.run(main())


def test_a_second_host_is_known_by_none_of_its_machines() -> None:
    """Or the right host of the others, started when the mistake is seen, would be refused."""

    async def main() -> None:
        at = f"tcp/127.0.0.1:{free_port()}"
        more = replace(ROBOT, names=("robot", "mc"))
        first = running(ZenohLink(ROBOT, join=[at]), Memory(Storage("r1")))
        async with running(ZenohLink(CENTRE, listen=[at])) as centre, first:
            await centre.until_told(("connected", "robot"))
            async with running(ZenohLink(more, join=[at]), Memory(Storage("r1"))) as second:
                await second.until_told(("refused", COORDINATOR))
                await asyncio.sleep(0.2)
                assert ("connected", "mc") not in centre.told
            async with running(ZenohLink(replace(ROBOT, names=("mc",)), join=[at])):
                await centre.until_told(("connected", "mc"))

    asyncio.run(main())


def test_what_a_stranger_publishes_is_not_delivered() -> None:
    async def main() -> None:
        port = free_port()
        here, there = (
            ZenohLink(CENTRE, listen=[f"tcp/127.0.0.1:{port}"]),
            ZenohLink(ROBOT, join=[f"tcp/127.0.0.1:{port}"]),
        )
        async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(there) as robot:
            await centre.until_told(("connected", "robot"))
            await robot.until_told(("connected", COORDINATOR))
            assert there.session is not None
            message = pack(0, Report("robot", Readiness(0, frozenset())))
            to = f"firable/{PROTOCOL_VERSION}/d1/to/%/{here.identity}/from/robot"
            there.session.put(f"{to}/{there.identity}", b"\xff" + message)  # damaged
            there.session.put(f"{to}/abc", message)  # of a process that is not known
            there.session.delete(f"{to}/{there.identity}")  # not a message
            there.session.put(
                f"firable/{PROTOCOL_VERSION}/d2/to/%/{here.identity}/from/robot/{there.identity}", message
            )
            while not centre.messages:
                there.send("robot", COORDINATOR, Report("robot", Readiness(7, frozenset())))
                await asyncio.sleep(0.02)
            assert here.damaged == 1
            assert {m for _, _, m in centre.messages} == {Report("robot", Readiness(7, frozenset()))}

    asyncio.run(main())


@pytest.mark.parametrize(
    "key",
    [
        "firable/**",
        "firable/*/*/alive/*/*",
        f"firable/{PROTOCOL_VERSION}/d1/alive/**",
        f"firable/{PROTOCOL_VERSION}/d1/heard/**",
        f"firable/{PROTOCOL_VERSION}/d1/stands/**",
        f"firable/{PROTOCOL_VERSION}/d1/to/%/**",
        f"firable/{'9' * 5000}/d1/alive/robot/abc-x",
    ],
)
def test_no_key_of_a_stranger_ends_a_link(key: str) -> None:
    """Zenoh lets anybody publish to all keys of a pattern at once; and a number may be longer than any is."""

    async def main() -> None:
        at = f"tcp/127.0.0.1:{free_port()}"
        here, stranger = ZenohLink(CENTRE, listen=[at]), ZenohLink(Greeting("d2", ("stranger",)), join=[at])
        async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(stranger):
            await centre.until_told(("refused", "stranger"))
            assert stranger.session is not None
            stranger.session.put(key, b"nothing of ours")
            token: Any = stranger.session.liveliness().declare_token(key)
            token.undeclare()
            async with running(ZenohLink(ROBOT, join=[at])):  # it is heard behind that
                await centre.until_told(("connected", "robot"))
            assert here.broken is not None
            assert not here.broken.done()

    asyncio.run(main())


def test_a_message_to_a_machine_that_is_not_here_is_not_delivered() -> None:
    async def main() -> None:
        at = f"tcp/127.0.0.1:{free_port()}"
        here, there = ZenohLink(CENTRE, listen=[at]), ZenohLink(ROBOT, join=[at])
        async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(there) as robot:
            await centre.until_told(("connected", "robot"))
            await robot.until_told(("connected", COORDINATOR))
            assert there.session is not None
            to = f"firable/{PROTOCOL_VERSION}/d1/to/%/{here.identity}"
            message = pack(0, Report("robot", Readiness(0, frozenset()), "mc"))
            there.session.put(f"{to}/to/mc/{here.identity}/from/robot/{there.identity}", message)
            while not centre.messages:
                there.send("robot", COORDINATOR, Report("robot", Readiness(7, frozenset())))
                await asyncio.sleep(0.02)
            assert {receiver for _, receiver, _ in centre.messages} == {COORDINATOR}

    asyncio.run(main())


def test_a_link_takes_no_message_that_is_larger_than_any_of_ours() -> None:
    """Zenoh would put one of a gigabyte together for anybody who can reach the address."""
    size = json.loads(ZenohLink(CENTRE)._configuration().get_json("transport/link/rx/max_message_size"))
    assert MESSAGE_BYTES_MAX < size < 2 * MESSAGE_BYTES_MAX


def test_a_process_of_the_same_system_sends_no_larger_one_either() -> None:
    """Zenoh shares memory with it, for all that is longer than some thousand bytes."""
    sizes: list[int] = []

    async def main() -> None:
        at = f"tcp/127.0.0.1:{free_port()}"
        here, stranger = ZenohLink(CENTRE, listen=[at]), zenoh.Config()
        stranger.insert_json5("connect/endpoints", json.dumps([at]))
        stranger.insert_json5("scouting/multicast/enabled", "false")
        async with asyncio.timeout(PATIENCE_SECONDS), running(here):
            while here.session is None:
                await asyncio.sleep(0.02)
            heard: Any = here.session.declare_subscriber(
                "x", lambda sample: sizes.append(len(sample.payload.to_bytes()))
            )
            with await asyncio.to_thread(zenoh.open, stranger) as session:
                while len(sizes) < 2:
                    session.put("x", b"small")
                    await asyncio.sleep(0.02)
                for _ in range(20):  # it makes that memory when something is first to go there
                    session.put("x", bytes(3 * MESSAGE_BYTES_MAX))
                    await asyncio.sleep(0.05)
                session.put("x", b"last one")
                while 8 not in sizes:
                    await asyncio.sleep(0.02)
            heard.undeclare()

    asyncio.run(main())
    assert set(sizes) == {5, 8}


def test_an_address_that_is_taken_is_refused() -> None:
    async def main() -> None:
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            link = ZenohLink(CENTRE, listen=[f"tcp/127.0.0.1:{taken.getsockname()[1]}"])
            with pytest.raises(InputError, match="F5021"):
                async with asyncio.timeout(PATIENCE_SECONDS):
                    await link.run(Heard())

    asyncio.run(main())


def test_a_link_listens_at_what_it_is_told_and_asks_nobody_else() -> None:
    configuration = ZenohLink(CENTRE)._configuration()
    assert json.loads(configuration.get_json("listen/endpoints")) == []
    assert json.loads(configuration.get_json("scouting/multicast/enabled")) is False
    assert json.loads(configuration.get_json("scouting/gossip/enabled")) is False
    assert json.loads(configuration.get_json("transport/link/tx/lease")) == 1000


@pytest.mark.parametrize(
    ("address", "open_"),
    [
        ("tcp/127.0.0.1:7447", False),
        ("tcp/[::1]:7447", False),
        ("tcp/localhost:7447", False),
        ("tls/10.0.0.1:7447", False),
        ("tcp/10.0.0.1:7447", True),
        ("tcp/0.0.0.0:7447", True),
        ("tcp/[::]:7447", True),
        ("udp/10.0.0.1:7447", True),
        ("tcp/cell.example:7447", True),
    ],
)
def test_plain_addresses_beyond_the_host_are_warned_of(address: str, open_: bool) -> None:
    found = open_to_the_network([address])
    assert [(d.code, d.severity) for d in found] == ([("F5022", Severity.WARNING)] if open_ else [])


def test_the_session_of_a_link_is_closed_with_it() -> None:
    async def main() -> zenoh.Session:
        link = ZenohLink(CENTRE, listen=[f"tcp/127.0.0.1:{free_port()}"])
        async with running(link):
            await until(lambda: link.session is not None, "the session")
            assert link.session is not None
            return link.session

    assert asyncio.run(main()).is_closed()


def test_who_has_the_certificate_of_another_host_is_heard_as_that_one_alone(tmp_path: Path) -> None:
    """Neither may it claim machines of others, nor say something in the name of one that is connected."""
    site = Site(tmp_path / "site")
    of = {"plc 1": (COORDINATOR,), "plc 2": ("robot",), "plc 3": ("mc", "coordinator cell_a")}

    async def main() -> None:
        at = f"tls/127.0.0.1:{free_port()}"
        here = ZenohLink(CENTRE, listen=[at], certificates=replace(site.host("plc 1"), of=of))
        there = ZenohLink(ROBOT, join=[at], certificates=replace(site.host("plc 2"), of=of))
        other = replace(ROBOT, names=("mc", "coordinator cell_a"))
        forger = ZenohLink(other, join=[at], certificates=replace(site.host("plc 3"), of=of))
        claims = ZenohLink(replace(ROBOT, names=("conveyor",)), join=[at], certificates=site.host("plc 4"))
        second = ZenohLink(replace(ROBOT, names=("robot",)), join=[at], certificates=site.host("plc 3 too"))
        async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(there) as robot:
            await centre.until_told(("connected", "robot"))
            await robot.until_told(("connected", COORDINATOR))
            async with running(forger), running(claims), running(second):
                await centre.until_told(("connected", "mc"), ("connected", "coordinator cell_a"))
                assert forger.session is not None
                forged = pack(0, Report("robot", Readiness(1, frozenset({"forged"}))))
                to = f"firable/{PROTOCOL_VERSION}/d1/to/%/{here.identity}"
                forger.session.put(f"{to}/from/robot/{there.identity}", forged)
                forger.session.put("firable/**", forged)
                while len(centre.messages) < 2:
                    there.send("robot", COORDINATOR, Report("robot", Readiness(7, frozenset())))
                    forger.send("mc", COORDINATOR, Report("mc", Readiness(7, frozenset())))
                    await asyncio.sleep(0.3)
                said = {m for _, _, m in centre.messages}
                assert said == {Report(name, Readiness(7, frozenset())) for name in ("robot", "mc")}
                assert not [peer for _, peer in centre.told if peer == "conveyor"]
                assert "refused" not in {kind for kind, _ in centre.told}

    asyncio.run(main())
