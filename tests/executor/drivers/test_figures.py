"""What drivers have read stands in the figures of a run: edges that were not told, and what cannot be believed."""

import asyncio
from importlib.metadata import EntryPoint

import pytest
from aiohttp import ClientSession
from support.third_party_driver import MemoryEnd

from firable.decompose.splitting.cut import split
from firable.executor.drivers import kinds
from firable.executor.drivers.bench import until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.control import Endpoint
from firable.executor.operating.host import Host
from firable.executor.operating.metrics import Metrics
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.service import Service, _serving
from firable.nets.interchange import net_digest
from firable.nets.text import parse_net

NET = parse_net("""
firable: 1
cell: lamp
controllers:
  a: {start: dark, inputs: [key, other], places: {dark: , lit: }}
transitions:
  on1: {from: a.dark, to: a.lit, if: [a.key, a.other]}
  off1: {from: a.lit, to: a.dark, unless: a.key}
""")
BINDING = """
firable_bind: 1
cell: lamp
devices:
  near: {driver: theirs, memory: near}
  far: {driver: theirs, memory: far, start_s: 0.05}
emergency_stop: {door: {device: near, read: door}}
signals:
  a.key: {device: near, read: key}
  a.other: {device: far, read: other, on_loss: 0}
"""


def test_coalesced_edges_and_lost_signals_of_every_device_are_among_the_figures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    theirs = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [theirs])
    token = "a token that nobody guesses"

    async def main() -> tuple[str, str]:
        near, _ = MemoryEnd("near"), MemoryEnd("far")  # which cannot be reached
        await near.start(lambda _point, _value: None)
        near.show("key", value=False)
        near.show("door", value=True)
        driver, metrics = bound_driver(parse_binding(BINDING), NET), Metrics(NET)
        recorder, address = Recorder(NET, net_digest(NET), None), asyncio.get_running_loop().create_future()
        host = Host(split(NET), driver, recorder, figures=metrics)
        service = Service(Endpoint("127.0.0.1", 0, token), address.set_result)
        serving = asyncio.create_task(_serving(host, service, metrics))
        await until(lambda: driver.readings()["a.key"].value is False, "the signal is read")
        for _ in range(3):
            near.show("key", value=True)
            near.show("key", value=False)
        await until(lambda: driver.readings()["a.key"].coalesced == 6, "the edges")
        await until(lambda: driver.readings()["a.other"].value is False, "the loss")
        async with ClientSession(headers={"Authorization": f"Bearer {token}"}) as session:
            text = await (await session.get(f"{await address}/metrics")).text()
            near.show("door", value=False)
            ended = await serving
        return text, ended.message

    text, message = asyncio.run(main())
    assert 'firable_coalesced_inputs_total{signal="a.key"} 6.0' in text
    assert 'firable_input_good{signal="a.key"} 1.0' in text
    assert 'firable_input_good{signal="a.other"} 0.0' in text
    assert 'firable_input_good{signal="emergency stop door"} 1.0' in text
    assert message == "emergency stop: near: 'door' is open"


def test_a_signal_that_its_device_never_shows_is_told_with_its_point(monkeypatch: pytest.MonkeyPatch) -> None:
    """A topic that was mistyped is no error to a broker: nothing ever comes."""
    theirs = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [theirs])
    binding = BINDING.replace("read: key", "read: ky").replace("memory: near", "memory: near, start_s: 0.05")

    async def main() -> None:
        near, far = MemoryEnd("near"), MemoryEnd("far")
        for end, points in ((near, ("key", "door")), (far, ("other",))):
            await end.start(lambda _point, _value: None)
            for point in points:
                end.show(point, value=True)
        told: list[str] = []
        driver = bound_driver(parse_binding(binding), NET)
        host = Host(
            split(NET),
            driver,
            Recorder(NET, net_digest(NET), None),
            Conduct(operator=lambda _: asyncio.sleep(60), tell=lambda _, sentence: told.append(sentence)),
        )
        ending = asyncio.create_task(host.main())
        sentence = "near: has never shown 'a.key' (at ky): are the points written as the device has them?"
        await until(lambda: sentence in told, "the sentence")
        assert driver.unreached == ("near has never shown 'a.key' (at ky)",)
        assert "near has never shown 'a.key' (at ky)" in host.situation().message
        await asyncio.sleep(0.2)
        assert not [one for one in told if one.startswith("far: has never")]
        near.show("ky", value=True)
        await until(lambda: not driver.unreached, "the signal is shown")
        host.stop()
        assert "never shown" not in (await ending).message

    asyncio.run(main())


def test_a_machine_that_never_shows_what_it_has_done_is_told_though_it_shows_what_it_has_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    theirs = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [theirs])
    net = parse_net("""
firable: 1
cell: lamp
controllers:
  a: {start: dark, places: {dark: , lit: {send: {machine: L, command: LIGHT}, until: is_lit}}}
transitions:
  on1: {from: a.dark, to: a.lit}
  off1: {from: a.lit, to: a.dark}
""")
    binding = """
firable_bind: 1
cell: lamp
devices:
  near: {driver: theirs, memory: near, start_s: 0.05, channels: {lamp: {number: n, taken: t, done: dnoe}}}
signals: {a.is_lit: acknowledged}
commands: {a.lit: {device: near, channel: lamp}}
"""

    async def main() -> None:
        near = MemoryEnd("near")
        await near.start(lambda _point, value: near.show("t", value))
        near.show("t", value=0)
        told: list[str] = []
        driver = bound_driver(parse_binding(binding), net)
        host = Host(
            split(net),
            driver,
            Recorder(net, net_digest(net), None),
            Conduct(operator=lambda _: asyncio.sleep(60), tell=lambda _, sentence: told.append(sentence)),
        )
        ending = asyncio.create_task(host.main())
        sentence = (
            "near: has never shown what 'lamp' has done (at dnoe): are the points written as the device has them?"
        )
        await until(lambda: sentence in told, "the sentence")
        near.show("dnoe", value=0)
        await until(lambda: not driver.unreached, "the number")
        host.stop()
        await ending

    asyncio.run(main())
