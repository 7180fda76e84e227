"""Frames on a serial line: addresses, a kind, a number, a length and a checksum, between bytes that occur nowhere else.

    00 | stuffed: to 1, from 1, kind 1, number 1, length 2, payload, CRC-32 4 | 00

Stuffing is COBS (Cheshire and Baker 1999): a frame contains no 0, so a 0 always ends one, and a reader that has lost a
byte, or gained one, is right again at the next frame. It costs one byte in 254, whatever the payload; escaping, as
HDLC does, doubles the worst frame.

The checksum covers all before it. Rejected: CRC-16, as Modbus has it. It lets one damaged frame in 65,536 pass, which
on a line with a few damaged frames a second is a wrong message a day; with two bytes more it is one in centuries.
Numbers are of the high byte first.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final
from zlib import crc32

PAYLOAD_BYTES_MAX: Final = 4096
"""At 115,200 baud a third of a second, which is as long as the line is not anybody else's."""

_HEAD: Final = struct.Struct(">BBBBH")
_SUM: Final = struct.Struct(">I")
_STUFFED_BYTES_MAX: Final = (_HEAD.size + PAYLOAD_BYTES_MAX + _SUM.size) * 255 // 254 + 2
FRAME_BYTES_MAX: Final = _STUFFED_BYTES_MAX + 2
"""The longest frame as it is on the line."""


class Kind(IntEnum):
    """What a frame is for."""

    GREETING = 1
    """Who the sender is."""
    MESSAGES = 2
    """Messages, perhaps none: a poll, or the answer to one."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame; `number` is that of the poll, which its answer repeats."""

    to: int
    sender: int
    kind: Kind
    number: int
    payload: bytes


def pack_frame(frame: Frame) -> bytes:
    """A frame as the bytes of the line; raises `ValueError` where the payload is too long.

    >>> read = FrameReader()
    >>> list(read.feed(pack_frame(Frame(3, 0, Kind.MESSAGES, 7, b"a\\0b"))))
    [Frame(to=3, sender=0, kind=<Kind.MESSAGES: 2>, number=7, payload=b'a\\x00b')]
    """
    if len(frame.payload) > PAYLOAD_BYTES_MAX:
        raise ValueError(f"{len(frame.payload):,} bytes are more than a frame holds ({PAYLOAD_BYTES_MAX:,})")
    body = _HEAD.pack(frame.to, frame.sender, frame.kind, frame.number, len(frame.payload)) + frame.payload
    return b"\0" + _stuff(body + _SUM.pack(crc32(body))) + b"\0"


class FrameReader:
    """Finds frames in the bytes of a line; what is damaged is dropped, and counted on from `damaged`."""

    def __init__(self, damaged: int = 0) -> None:
        self.buffer = bytearray()
        self.overlong = False
        self.damaged = damaged

    def feed(self, data: bytes) -> Iterator[Frame]:
        """The frames that these bytes complete."""
        for piece in _pieces(data):
            if piece is not None:
                self.buffer += piece
                if len(self.buffer) > _STUFFED_BYTES_MAX:  # noise without an end must not fill the memory
                    self.overlong = True
                    self.buffer.clear()
                continue
            stuffed, overlong = bytes(self.buffer), self.overlong
            self.buffer.clear()
            self.overlong = False
            frame = None if overlong else _unpacked(stuffed)
            if frame is not None:
                yield frame
            elif stuffed or overlong:
                self.damaged += 1


def _pieces(data: bytes) -> Iterator[bytes | None]:
    """The runs between the zeros, and None for each zero."""
    first, *others = data.split(b"\0")
    if first:
        yield first
    for piece in others:
        yield None
        if piece:
            yield piece


def _unpacked(stuffed: bytes) -> Frame | None:
    """The frame, or None where it is damaged."""
    data = _unstuff(stuffed)
    if data is None or len(data) < _HEAD.size + _SUM.size:
        return None
    body, (checksum,) = data[: -_SUM.size], _SUM.unpack(data[-_SUM.size :])
    to, sender, kind, number, length = _HEAD.unpack_from(body)
    if crc32(body) != checksum or length != len(body) - _HEAD.size or kind not in Kind.__members__.values():
        return None
    return Frame(to, sender, Kind(kind), number, body[_HEAD.size :])


def _stuff(data: bytes) -> bytes:
    """COBS: each run of up to 254 bytes without a zero, behind one byte that says where the next zero was."""
    stuffed = bytearray()
    for run in data.split(b"\0"):
        while len(run) >= 254:
            stuffed += b"\xff" + run[:254]
            run = run[254:]
        stuffed += bytes([len(run) + 1]) + run
    return bytes(stuffed)


def _unstuff(stuffed: bytes) -> bytes | None:
    """What was stuffed, or None where nothing stuffs to this."""
    data = bytearray()
    position = 0
    while position < len(stuffed):
        code = stuffed[position]
        run = stuffed[position + 1 : position + code]
        if len(run) != code - 1:
            return None
        data += run
        position += code
        if code != 0xFF and position < len(stuffed):
            data.append(0)
    return bytes(data)
