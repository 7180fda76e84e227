"""Frames and the bus of the serial line, with noise on it."""

import asyncio
import os
import pty
import random
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.hosts import Cell
from support.link_rigs import CONTROLLERS, PATIENCE_SECONDS, Heard, SerialRig, over_a_serial_line, running

from firable.executor.links.framing import PAYLOAD_BYTES_MAX, Frame, FrameReader, Kind, pack_frame
from firable.executor.links.link import COORDINATOR, Greeting
from firable.executor.links.serial_line import SerialLink, addresses_on_a_line
from firable.executor.links.storages import LIVES_MAX, Memory, Met, Storage
from firable.executor.protocol.messages import Decision
from firable.nets.diagnostics import InputError

FRAMES = st.builds(
    Frame,
    st.integers(0, 255),
    st.integers(0, 255),
    st.sampled_from(Kind),
    st.integers(0, 255),
    st.one_of(st.binary(max_size=600), st.integers(0, 1100).map(bytes), st.integers(0, 1100).map(lambda n: b"\1" * n)),
)


@examples(100)
@given(st.lists(FRAMES, max_size=4), st.integers(1, 50))
def test_frames_are_read_as_they_were_written_however_the_bytes_come(frames: list[Frame], at_once: int) -> None:
    line = b"".join(map(pack_frame, frames))
    reader = FrameReader()
    found = [f for i in range(0, len(line), at_once) for f in reader.feed(line[i : i + at_once])]
    assert found == frames
    assert not reader.damaged


@examples(100)
@given(FRAMES, FRAMES, st.data())
def test_a_damaged_frame_is_dropped_and_the_next_one_read(first: Frame, second: Frame, data: st.DataObject) -> None:
    line = bytearray(pack_frame(first))
    at = data.draw(st.integers(1, len(line) - 2))
    match data.draw(st.sampled_from(["flipped", "lost", "doubled"])):
        case "flipped":
            line[at] ^= data.draw(st.integers(1, 255))
        case "lost":
            del line[at]
        case "doubled":
            line.insert(at, line[at])
    reader = FrameReader()
    same = line == pack_frame(first)  # of two equal bytes side by side, one was lost and the other doubled by nobody
    assert list(reader.feed(bytes(line) + pack_frame(second))) == ([first, second] if same else [second])


def test_noise_makes_no_frame_and_no_heap() -> None:
    dice, reader = random.Random(3), FrameReader()
    for _ in range(200):
        assert not list(reader.feed(dice.randbytes(5000)))
        assert not list(reader.feed(b"\1" * 5000))
        assert len(reader.buffer) < 3 * PAYLOAD_BYTES_MAX
    assert reader.damaged > 100
    list(reader.feed(b"\0"))
    frame = Frame(1, 0, Kind.MESSAGES, 1, b"x")
    assert list(reader.feed(pack_frame(frame))) == [frame]


def test_a_payload_that_is_too_long_is_not_packed() -> None:
    with pytest.raises(ValueError, match="more than a frame holds"):
        pack_frame(Frame(1, 0, Kind.MESSAGES, 1, bytes(PAYLOAD_BYTES_MAX + 1)))


@pytest.mark.parametrize(
    "noise",
    [{"flipped": 0.0005}, {"lost": 0.0005}, {"doubled": 0.0005}, {"flipped": 3e-4, "lost": 3e-4, "doubled": 3e-4}],
)
def test_on_a_noisy_line_messages_are_lost_and_none_is_damaged(noise: dict[str, float]) -> None:
    async def main() -> None:
        async with over_a_serial_line() as rig:
            here, stations = rig.link(Greeting("d", (COORDINATOR,))), []
            for name in CONTROLLERS:
                stations.append(rig.link(Greeting("d", (name,))))
            async with (
                asyncio.timeout(PATIENCE_SECONDS),
                running(here) as centre,
                running(stations[0]) as a,
                running(stations[1]) as b,
                running(stations[2]) as c,
            ):
                await centre.until_told(*(("connected", name) for name in CONTROLLERS[:3]))
                for name, value in noise.items():
                    setattr(rig, name, value)
                sent, number = set(), 0
                while sum(link.damaged for link in (here, *stations)) < 20 or len(a.messages) < 50:
                    number += 1
                    for name in CONTROLLERS[:3]:
                        message = Decision(name, number, f"G{number}", 0, 0)
                        sent.add((COORDINATOR, name, message))
                        here.send(COORDINATOR, name, message)
                    await asyncio.sleep(0.001)
                # The line is quiet again, and what comes now goes through.
                rig.flipped = rig.lost = rig.doubled = 0.0
                for name, heard in zip(CONTROLLERS, (a, b, c), strict=False):
                    last = Decision(name, 0, None, 0, 0)
                    sent.add((COORDINATOR, name, last))
                    while not heard.messages or heard.messages[-1][2] != last:
                        here.send(COORDINATOR, name, last)
                        await asyncio.sleep(0.01)
                assert {*a.messages, *b.messages, *c.messages} <= sent

    asyncio.run(main())


class CountingReader(FrameReader):
    def __init__(self) -> None:
        super().__init__()
        self.polls: list[int] = []

    def feed(self, data: bytes) -> Iterator[Frame]:
        for frame in super().feed(data):
            self.polls.append(frame.to)
            yield frame


def test_a_dead_station_does_not_keep_the_others_waiting() -> None:
    async def main() -> None:
        async with over_a_serial_line() as rig:
            here, there = rig.link(Greeting("d", (COORDINATOR,))), rig.link(Greeting("d", ("robot",)))
            async with asyncio.timeout(PATIENCE_SECONDS), running(here), running(there) as robot:
                await robot.until_told(("connected", COORDINATOR))
                there.reader = counting = CountingReader()  # a link that runs begins with a reader of its own
                while len(counting.polls) < 40:
                    await asyncio.sleep(0.05)
                assert counting.polls.count(2) > 20  # of three that are dead, each is asked one time in five

    asyncio.run(main())


def test_who_drives_the_line_for_ever_keeps_nobody_from_being_told_lost() -> None:
    async def main() -> None:
        async with over_a_serial_line() as rig:
            here, there = rig.link(Greeting("d", (COORDINATOR,))), rig.link(Greeting("d", ("robot",)))
            async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(there):
                await centre.until_told(("connected", "robot"))
                rig.cut()
                while ("lost", "robot") not in centre.told:
                    with suppress(BlockingIOError):
                        os.write(rig.ports[0][0], b"\x55" * 20)
                    await asyncio.sleep(0.005)
                rig.mend()
                centre.told.clear()
                await centre.until_told(("connected", "robot"))

    asyncio.run(main())


def test_a_station_answers_a_poll_once_though_the_line_doubles_it() -> None:
    async def main() -> None:
        async with over_a_serial_line() as rig:
            here, there = rig.link(Greeting("d", (COORDINATOR,))), rig.link(Greeting("d", ("robot",)))
            async with running(there), running(here) as centre:
                await centre.until_told(("connected", "robot"))
                rig.cut()
                await asyncio.sleep(0.1)
                poll = Frame(2, 0, Kind.MESSAGES, 250, b"")
                there.peers[0].queue.extend([b"one\n" * 100, b"two\n" * 100])
                there._asked_for(poll)
                there._asked_for(poll)
                assert len(there.peers[0].queue) == 1  # each answer takes one

    asyncio.run(main())


def test_a_port_that_is_none_is_refused() -> None:
    async def main() -> None:
        link = SerialLink(Greeting("d", ("robot",)), "/dev/no-such-line", addresses_on_a_line(("",), CONTROLLERS), 2)
        with pytest.raises(InputError, match="F5021"):
            async with asyncio.timeout(PATIENCE_SECONDS):
                await link.run(Heard())

    asyncio.run(main())


def test_a_port_that_another_program_has_open_is_refused_in_plain_words() -> None:
    ours, theirs = pty.openpty()
    port = os.ttyname(theirs)
    try:
        with serial.Serial(port, exclusive=True), pytest.raises(InputError) as refused:
            asyncio.run(
                SerialLink(Greeting("d", ("robot",)), port, addresses_on_a_line(("",), CONTROLLERS), 2).run(Heard())
            )
    finally:
        os.close(ours)
        os.close(theirs)
    assert f"error[F5021]: the link {port} cannot be opened: another program has it open\n" in str(refused.value)


def test_a_line_that_is_taken_away_ends_the_link() -> None:
    async def main() -> None:
        rig = SerialRig()
        link = rig.link(Greeting("d", ("robot",)))
        task = asyncio.create_task(link.run(Heard()))
        await asyncio.sleep(0.1)
        rig.close()
        with pytest.raises(InputError, match=r"F5021.* has failed: "):
            async with asyncio.timeout(PATIENCE_SECONDS):
                await task

    asyncio.run(main())


def test_a_message_that_no_frame_holds_ends_the_link() -> None:
    async def main() -> None:
        async with over_a_serial_line() as rig:
            here, there = rig.link(Greeting("d", (COORDINATOR,))), rig.link(Greeting("d", ("robot",)))
            centre = asyncio.create_task(here.run(Heard()))
            async with running(there) as robot:
                await robot.until_told(("connected", COORDINATOR))
                while not centre.done():
                    here.send(COORDINATOR, "robot", Decision("robot", 1, "G" * PAYLOAD_BYTES_MAX, 0, 0))
                    await asyncio.sleep(0.01)
                with pytest.raises(InputError, match="longer than a frame"):
                    async with asyncio.timeout(PATIENCE_SECONDS):
                        await centre

    asyncio.run(main())


def test_a_host_that_cannot_say_who_it_is_in_a_frame_is_refused_before_the_line_is_opened() -> None:
    names = tuple(f"station_{i:03}" for i in range(255))
    addresses = addresses_on_a_line((COORDINATOR,), names)
    with pytest.raises(InputError, match="to say who this host is takes") as caught:
        SerialLink(Greeting("0" * 64, names), "/dev/null", addresses, 1)
    assert caught.value.diagnostics[0].code == "F5021"
    SerialLink(Greeting("0" * 64, names[:40]), "/dev/null", addresses, 1)


def test_the_longest_greeting_is_one_frame() -> None:
    """Of a host that was started as often as is remembered, and whose journal was stored ten thousand million times."""
    stored = 10**10
    storage = Storage("5eed5eed")
    for life in range(LIVES_MAX):
        storage = storage.in_new_life(f"{life:08}", stored)
    master = Storage("1a1a1a1a").in_new_life("2b2b2b2b", stored)
    known = {COORDINATOR: Met(master.name, master.life, stored)}
    names = ("robot", *(f"station_{i:03}" for i in range(40)))

    async def main() -> None:
        async with over_a_serial_line() as rig:
            here, there = rig.link(Greeting("d" * 64, (COORDINATOR,))), rig.link(Greeting("d" * 64, ("robot",)))
            there.greeting = Greeting("d" * 64, names)
            centre, station = Heard(memory=Memory(master)), Heard(memory=Memory(storage, known))
            links = [asyncio.create_task(here.run(centre)), asyncio.create_task(there.run(station))]
            async with asyncio.timeout(PATIENCE_SECONDS):
                await centre.until_told(("connected", names[-1]))
            assert not any(link.done() for link in links)
            for link in links:
                link.cancel()
            await asyncio.gather(*links, return_exceptions=True)

    asyncio.run(main())


def test_more_controllers_than_addresses_are_refused() -> None:
    names = tuple(f"c{i}" for i in range(1, 257))
    assert addresses_on_a_line((COORDINATOR,), names[:-1])["c255"] == 255
    with pytest.raises(InputError, match="255 addresses for stations, and the cell 256 controllers"):
        addresses_on_a_line((COORDINATOR,), names)


@pytest.mark.parametrize("noise", [0.0, 0.0003])
def test_hosts_run_a_cell_over_a_line_with_noise(noise: float, tmp_path: Path) -> None:
    async def main() -> None:
        async with over_a_serial_line() as rig, asyncio.timeout(PATIENCE_SECONDS):
            cell = Cell(tmp_path, link=rig.link, seconds=0.005)
            while cell.firings() < 10:
                await asyncio.sleep(0.05)
            rig.flipped = rig.lost = rig.doubled = noise
            while cell.firings() < 60:
                await asyncio.sleep(0.05)
            rig.flipped = rig.lost = rig.doubled = 0.0
            await cell.stop()
            assert cell.replayed().firings >= 60

    asyncio.run(main())
