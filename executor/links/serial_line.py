"""A link over a serial line with many stations, as RS-485 has it: one master polls, stations answer.

On such a line one may speak at a time. The master (the host of the coordinator) sends a frame to one station after the
other, with the messages for it; the addressed station answers with one frame, with those for the master; nobody speaks
unasked, so nothing collides. That is also the bus of the paper, and it fits the protocol: controllers talk with their
coordinator alone. A lost frame loses its messages, and the next poll goes on.

A station that is not connected answers any poll by its greeting, which is how the master notices that one is there, or
was started anew; then the master greets it. So an address where nobody is costs a short frame, and no greeting. A
station that has not answered for the lease is lost, and asked less often, so that a dead one does not slow the line
down; one that has not been asked for the lease has lost its master.

The address of a host follows from the bundle, which all have: 0 for the master, and for a station the number of its
first controller in the net, from 1. Rejected: a token that goes round, or collisions as on Ethernet: both need what a
half-duplex converter does not have, and save only the time of empty polls.
"""

from __future__ import annotations

import asyncio
import os
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

import serial
from pydantic import TypeAdapter, ValidationError

from firable.executor.links.encoding import EncodingError, pack, unpack
from firable.executor.links.framing import FRAME_BYTES_MAX, PAYLOAD_BYTES_MAX, Frame, FrameReader, Kind, pack_frame
from firable.executor.links.link import Greeting, LinkListener, cannot_open, come_back_without, has_failed, objection
from firable.executor.links.standing import Standing
from firable.executor.links.storages import Memory, Met, Storage
from firable.executor.protocol.messages import Message
from firable.executor.reasons import port_reason
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.interchange import canonical_json
from firable.nets.source import printable

MASTER: Final = 0
STATIONS_MAX: Final = 255
"""An address is a byte."""
GREETING_BYTES_MAX: Final = PAYLOAD_BYTES_MAX - 3072
"""Who a host is, as far as it does not grow: the rest of the frame is for what is remembered (`storages.LIVES_MAX`)."""
LEASE_SECONDS: Final = 1.0
ANSWER_SECONDS: Final = 0.05
"""How long a station may take to begin its answer."""

BATCH_BYTES_MAX: Final = 512
"""Several messages go into one frame up to here: noise hits a long frame more often, and more is lost with it."""

QUEUE_MAX: Final = 1000
_STANDING_BYTES_MAX: Final = 16
_BITS_A_BYTE: Final = 10


@dataclass(frozen=True, slots=True)
class _Said:
    """A greeting on the line; `instance` is another after each start."""

    greeting: Greeting
    instance: str
    storage: str = ""
    known: Mapping[str, str] = field(default_factory=dict)
    """What is remembered of the machines of the other host. Hosts of older versions say neither."""

    @property
    def memory(self) -> Memory:
        """What a host remembers that says this."""
        return Memory(Storage.read(self.storage), {name: Met.read(met) for name, met in self.known.items()})


_SAID: Final = TypeAdapter(_Said)
_LINE: Final = TypeAdapter(tuple[str, str, str])
_STANDINGS: Final = {canonical_json(standing.value): standing for standing in Standing}
"""How a host stands, as the line that comes before its messages where it does not go on."""


@dataclass(slots=True)
class _Peer:
    """What a host knows of another one on the line."""

    names: tuple[str, ...] = ()
    """Its machines, once it is connected."""
    instance: str = ""
    heard_seconds: float = 0.0
    refused: str = ""
    """The instance that was refused, which is told once."""
    objected: tuple[str, ...] = ()
    """Its machines, if it was refused for what its greeting says."""
    queue: deque[bytes] = field(default_factory=lambda: deque(maxlen=QUEUE_MAX))
    """Messages for it, each the line of a frame. Of too many the oldest are lost."""
    standing: Standing = Standing.GOING
    asked_at_cycle: int = 0
    is_there: bool = False
    """Of a station: whether it has answered the last poll."""

    @property
    def is_known(self) -> bool:
        """Whether somebody was told of it."""
        return bool(self.names or self.objected)


class SerialLink:
    """One end of the line; `addresses` says at which address each machine is, and `own` which address this host has.

    Raises `InputError` F5021 where the names of its machines are too long for a greeting.
    """

    def __init__(
        self,
        greeting: Greeting,
        port: str,
        addresses: Mapping[str, int],
        own: int,
        *,
        baud: int = 115_200,
        lease_seconds: float = LEASE_SECONDS,
        answer_seconds: float = ANSWER_SECONDS,
    ) -> None:
        self.greeting = greeting
        self.port = port
        self.own = own
        self.addresses = addresses
        self.baud = baud
        self.lease_seconds = lease_seconds
        self.answer_seconds = answer_seconds
        self.instance = os.urandom(8).hex()
        if (size_bytes := len(_payload(_Said(greeting, self.instance)))) > GREETING_BYTES_MAX:
            message = f"the link {printable(port)} cannot be opened: to say who this host is takes {size_bytes:,} bytes"
            hint = "run fewer controllers on this host, or link the hosts over a network"
            raise InputError([Diagnostic("F5021", f"{message}, and there are {GREETING_BYTES_MAX:,}", hint)])
        self.standing = Standing.GOING
        others = sorted({a for a in addresses.values() if a != own}) if own == MASTER else [MASTER]
        self.peers = {address: _Peer() for address in others}
        self.reader = FrameReader()
        self.listener: LinkListener | None = None
        self.line: serial.Serial | None = None
        self.unsent = bytearray()
        self.answered: asyncio.Future[Frame] | None = None
        self.asked = (MASTER, 0)
        """The address and number of the poll that waits for its answer."""
        self.byte_seconds = 0.0
        """When the line last brought anything."""
        self.polled = -1
        """Of a station: the number of the last poll, which comes twice where the line doubles frames."""
        self.awake = asyncio.Event()
        self.broken: asyncio.Future[None] | None = None

    @property
    def question(self) -> str:
        """What there is to ask, of a host that was never reached."""
        return "is its host started, at this line, and with the same --baud?"

    @property
    def damaged(self) -> int:
        """How many frames were dropped, as they were damaged or no message."""
        return self.reader.damaged

    async def run(self, listener: LinkListener) -> None:
        """Serve until cancelled; raises `InputError` F5021 where the port cannot be opened, or breaks."""
        loop = asyncio.get_running_loop()
        try:
            self.line = serial.Serial(self.port, self.baud, timeout=0, write_timeout=0, exclusive=True)
        except (OSError, ValueError) as error:  # pyserial's own error is an OSError
            raise cannot_open(self.port, port_reason(error)) from None
        descriptor = self.line.fileno()
        # It may have run before: whoever was heard then is met anew, and meets somebody else.
        self.instance, self.reader, self.polled = os.urandom(8).hex(), FrameReader(self.damaged), -1
        self.peers = {address: _Peer() for address in self.peers}
        self.unsent.clear()
        self.listener = listener
        self.broken = loop.create_future()
        loop.add_reader(descriptor, self._readable, descriptor)
        task = asyncio.create_task(self._poll() if self.own == MASTER else self._watch())
        try:
            await asyncio.wait({task, self.broken}, return_when=asyncio.FIRST_COMPLETED)
            if self.broken.done():
                self.broken.result()
            task.result()
        finally:
            task.cancel()
            loop.remove_reader(descriptor)
            loop.remove_writer(descriptor)
            self.line.close()
            self.line = self.listener = None

    def send(self, sender: str, receiver: str, message: Message) -> None:
        """Put a message in the queue of its host; where that is not connected it is lost."""
        peer = next((peer for peer in self.peers.values() if receiver in peer.names), None)
        if peer is None:
            return
        line = _line(sender, receiver, pack(self._tell().age, message))
        if len(line) > PAYLOAD_BYTES_MAX - _STANDING_BYTES_MAX:
            self._break(has_failed(self.port, f"a message of {len(line):,} bytes is longer than a frame"))
        peer.queue.append(line)
        self.awake.set()

    def stand(self, standing: Standing) -> None:
        """Say with each frame from now on how this host stands."""
        self.standing = standing

    # The master

    async def _poll(self) -> None:
        """Ask one station after the other, for ever."""
        loop = asyncio.get_running_loop()
        cycle = number = 0
        while True:
            cycle += 1
            busy = False
            self.awake.clear()
            for address, peer in self.peers.items():
                if not peer.names and cycle - peer.asked_at_cycle < 5 and peer.asked_at_cycle:
                    continue
                peer.asked_at_cycle = cycle
                number = (number + 1) % 256
                busy |= bool(peer.queue)
                greets = peer.is_there and not peer.names
                answered = self.answered = loop.create_future()
                self.asked = (address, number)
                poll = self._frame(address, peer, number, greet=greets)
                self._write(poll)
                answer = await self._answer(answered, len(poll))
                was_there, peer.is_there = peer.is_there, answer is not None
                if answer is not None:
                    busy |= (bool(answer.payload) and answer.kind is Kind.MESSAGES) or not was_there
                    if peer.names or greets:
                        self._heard(peer, answer)
                elif peer.is_known and loop.time() - peer.heard_seconds > self.lease_seconds:
                    self._lose(peer)
            if not busy:
                try:
                    await asyncio.wait_for(self.awake.wait(), self.lease_seconds / 20)
                except TimeoutError:
                    continue

    async def _answer(self, answered: asyncio.Future[Frame], poll_bytes: int) -> Frame | None:
        """The answer to the last poll: it must begin in time, and is waited for while bytes come and a frame lasts.

        What comes for longer is no answer: a converter that is broken, say, and drives the line for ever.
        """
        loop = asyncio.get_running_loop()
        waiting = self.answer_seconds + poll_bytes * _BITS_A_BYTE / self.baud
        frame_seconds = FRAME_BYTES_MAX * _BITS_A_BYTE / self.baud
        until = loop.time() + waiting + max(self.lease_seconds, 2 * frame_seconds)
        self.byte_seconds = float("-inf")
        while True:
            done, _ = await asyncio.wait({answered}, timeout=waiting)
            if done:
                return answered.result()
            waiting = min(self.byte_seconds + self.answer_seconds, until) - loop.time()
            if waiting <= 0:
                answered.cancel()
                return None

    # The station

    async def _watch(self) -> None:
        """Notice that the master asks no more."""
        loop = asyncio.get_running_loop()
        (peer,) = self.peers.values()
        while True:
            await asyncio.sleep(self.lease_seconds / 4)
            if peer.is_known and loop.time() - peer.heard_seconds > self.lease_seconds:
                self._lose(peer)

    def _asked_for(self, poll: Frame) -> None:
        if poll.number == self.polled:
            return  # the same frame once more: an answer would meet the next poll
        self.polled = poll.number
        (peer,) = self.peers.values()
        was = peer.instance if peer.names else ""
        self._heard(peer, poll)
        greeted = poll.kind is Kind.GREETING or not peer.names or peer.instance != was
        self._write(self._frame(MASTER, peer, poll.number, greet=greeted))

    # Both

    def _frame(self, to: int, peer: _Peer, number: int, *, greet: bool = False) -> bytes:
        """A frame for a host: the greeting as long as it is not connected, then as many messages as go into one."""
        if greet or (self.own != MASTER and not peer.names):
            memory = self._tell().memory
            known = {name: str(met) for name, met in memory.known.items() if self.addresses.get(name) == to}
            said = _Said(self.greeting, self.instance, str(memory.storage), known)
            return pack_frame(Frame(to, self.own, Kind.GREETING, number, _payload(said)))
        before = b"" if self.standing is Standing.GOING else canonical_json(self.standing.value) + b"\n"
        lines: list[bytes] = []
        while peer.queue and (not lines or len(peer.queue[0]) + sum(map(len, lines)) <= BATCH_BYTES_MAX):
            lines.append(peer.queue.popleft())
        return pack_frame(Frame(to, self.own, Kind.MESSAGES, number, before + b"".join(lines)))

    def _heard(self, peer: _Peer, frame: Frame) -> None:
        """Take a frame of a host in."""
        peer.heard_seconds = asyncio.get_running_loop().time()
        match frame.kind:
            case Kind.GREETING:
                self._greeted(peer, frame.payload)
            case Kind.MESSAGES if peer.names:
                lines = frame.payload.splitlines()
                standing = _STANDINGS.get(lines[0] if lines else b"", Standing.GOING)
                if standing is not peer.standing:
                    peer.standing = standing
                    for name in peer.names:
                        self._tell().stands(name, standing)
                for line in lines[standing is not Standing.GOING :]:
                    self._message(peer, line)

    def _greeted(self, peer: _Peer, payload: bytes) -> None:
        try:
            said = _SAID.validate_json(payload)
        except ValidationError:
            self.reader.damaged += 1
            return
        here, ours, theirs = self._tell(), self._tell().memory, said.memory
        come_back = ours.estranged(said.greeting.names, theirs.storage)
        forgotten = theirs.estranged(self.greeting.names, ours.storage)
        why = objection(self.greeting, said.greeting)
        objected = () if why is None else said.greeting.names
        if why is None and come_back:
            why = come_back_without(come_back)
        is_fit = why is None and not forgotten
        if peer.names and self.own == MASTER:
            self._lose(peer)  # it was asked for messages, and does not know us: the next poll is a greeting
            return
        if peer.names and (said.instance != peer.instance or not is_fit):
            self._lose(peer)  # it has been started anew: whatever was under way is gone
        if peer.objected != objected:
            self._say_gone(peer)
            peer.objected = objected
        if not is_fit:
            if peer.refused != said.instance:
                peer.refused = said.instance
                if why is not None:
                    here.refused(said.greeting.names, why)
                if forgotten is not None and (why is None or forgotten.is_older):
                    here.disowned(said.greeting.names, forgotten)
        elif not peer.names:
            peer.names, peer.instance = said.greeting.names, said.instance
            for name in peer.names:
                here.connected(name, theirs.storage)

    def _message(self, peer: _Peer, line: bytes) -> None:
        try:
            sender, receiver, text = _LINE.validate_json(line)
            age, message = unpack(text.encode())
        except (ValidationError, EncodingError):
            self.reader.damaged += 1
            return
        if sender in peer.names and receiver in self.greeting.names:
            self._tell().arrived(sender, receiver, message, age)

    def _lose(self, peer: _Peer) -> None:
        names, peer.names, peer.instance, peer.standing = peer.names, (), "", Standing.GOING
        peer.queue.clear()
        for name in names:
            self._tell().lost(name)
        self._say_gone(peer)

    def _say_gone(self, peer: _Peer) -> None:
        """Tell that a host is gone that was refused for what it had said."""
        objected, peer.objected = peer.objected, ()
        if objected:
            peer.refused = ""
            self._tell().gone(objected)

    def _readable(self, descriptor: int) -> None:
        self._guarded(lambda: self._read(descriptor))

    def _read(self, descriptor: int) -> None:
        data = os.read(descriptor, 65_536)
        if not data:
            raise OSError("the line has been taken away")
        self.byte_seconds = asyncio.get_running_loop().time()
        for frame in self.reader.feed(data):
            if frame.to != self.own:
                continue
            if self.own != MASTER:
                if frame.sender == MASTER:
                    self._asked_for(frame)
            elif self.answered is not None and not self.answered.done() and self.asked == (frame.sender, frame.number):
                self.answered.set_result(frame)

    def _write(self, data: bytes) -> None:
        if self.line is not None:
            waiting = bool(self.unsent)
            self.unsent += data
            if not waiting:
                self._writable(self.line.fileno())

    def _writable(self, descriptor: int) -> None:
        self._guarded(lambda: self._flush(descriptor))

    def _flush(self, descriptor: int) -> None:
        with suppress(BlockingIOError):
            del self.unsent[: os.write(descriptor, self.unsent)]
        loop = asyncio.get_running_loop()
        if self.unsent:
            loop.add_writer(descriptor, self._writable, descriptor)
        else:
            loop.remove_writer(descriptor)

    def _guarded(self, act: Callable[[], None]) -> None:
        """A callback of the loop has no caller: what fails in it ends `run`."""
        try:
            act()
        except OSError as error:
            self._break(has_failed(self.port, port_reason(error)))
        except Exception as error:
            self._break(error)

    def _break(self, error: Exception) -> None:
        if self.broken is not None and not self.broken.done():
            self.broken.set_exception(error)

    def _tell(self) -> LinkListener:
        if self.listener is None:
            raise RuntimeError("the link does not run")
        return self.listener


def addresses_on_a_line(coordinators: tuple[str, ...], controllers: tuple[str, ...]) -> dict[str, int]:
    """The address of each machine: the coordinators are the master, controllers are numbered from 1.

    Raises `InputError` F5021 where there are more controllers than addresses.

    >>> addresses_on_a_line(("",), ("system", "robot"))
    {'': 0, 'system': 1, 'robot': 2}
    """
    if len(controllers) > STATIONS_MAX:
        message = (
            f"a serial line has {STATIONS_MAX} addresses for stations, and the cell {len(controllers):,} controllers"
        )
        raise InputError([Diagnostic("F5021", message, "link the hosts over a network")])
    return {**dict.fromkeys(coordinators, MASTER), **{name: i for i, name in enumerate(controllers, 1)}}


def _payload(said: _Said) -> bytes:
    return canonical_json(_SAID.dump_python(said, mode="json"))


def _line(sender: str, receiver: str, text: bytes) -> bytes:
    """One message of a frame, with who says it to whom."""
    return canonical_json([sender, receiver, text.decode()]) + b"\n"
