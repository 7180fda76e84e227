"""Points of one device that would mean two things, such as a heartbeat at the register of a channel's number.

Two devices of the binding that stand at one address are one: each command of either would be one of the other, too.

Each is an address that the device has, so no kind of device objects to it, and the machines make of it what they like:
with the heartbeat there, each beat is a command. Refused is

- what gives a command, at one point with the heartbeat, with what gives those of another channel, or with a value that
  a command writes before it; and such a value at the point of the heartbeat;
- an answer (*taken*, *done*, *failed*) at one point with another answer, or with what is written. Only the bits by
  which machines without numbers say that they have failed may be one, a common alarm;
- what a device must show by itself (its sign of life, that its watchdog has tripped, contacts of the emergency stop) at
  one point with anything that is written, safe outputs as well: the echo of a heartbeat would be life for ever.

A signal may be read anywhere, and safe outputs may be any: to take a request back is one. Two devices at one address
may have one heartbeat (`sharing.py` says when not). Points are compared as they are written. Rejected: a warning, which
nobody reads before the machine moves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from firable.executor.drivers.device import Point
from firable.nets.yaml_tree import Path

if TYPE_CHECKING:
    from firable.executor.drivers.binding import BindingDocument

Overlap = tuple[Path, str, str]
"""Where a point stands that has a meaning already, what both are, and what to do."""

_HEARTBEAT: Final = "the heartbeat"
_HINT: Final = "look up where the device has the second of them, and give it that address"


def overlaps(
    document: BindingDocument, is_one: Callable[[str, str], bool], whole: Callable[[str, Point], Point]
) -> Iterator[Overlap]:
    """The points of each device that have two meanings of which one would be taken for the other.

    `is_one` tells of two devices whether they stand at one address; `whole` gives the point of a device that is written
    with one, which is a part of it.
    """
    found: dict[str, _Points] = {}
    for device, body in document.devices.items():
        found[device] = next((points for name, points in found.items() if is_one(name, device)), _Points())
        found[device].besides.update(dict.fromkeys(body.safe, (device, "a safe output")))
    for place, command in document.commands.items():
        what = f"what the command of '{place}' writes"
        if command.device in found:
            found[command.device].besides.update(dict.fromkeys(command.write, (command.device, what)))
    for judge in (_gives, _writes, _answers):  # each of all devices, before what is judged by it
        for device, points in found.items():
            yield from judge(document, device, points)
    for device, points in found.items():
        yield from _echoes(document, device, points, whole)


@dataclass(frozen=True, slots=True)
class _Points:
    """What is at the points of a device: who has put each there, and what is written, or answered."""

    written: dict[Point, tuple[str, str]] = field(default_factory=dict)
    answers: dict[Point, tuple[str, str, bool]] = field(default_factory=dict)
    besides: dict[Point, tuple[str, str]] = field(default_factory=dict)
    """Safe outputs and values of commands, of which one point may have several."""


def _gives(document: BindingDocument, device: str, points: _Points) -> Iterator[Overlap]:
    """Of what gives commands, and of the heartbeat, those that are written where another is; they are put down."""
    body, written = document.devices[device], points.written
    roles: list[tuple[Path, Point, str]] = [
        (("devices", device, "channels", name, key), point, f"the {key} of '{name}'")
        for name, channel in body.channels.items()
        for key in ("number", "command", "request")
        if (point := getattr(channel, key)) is not None
    ]
    if body.heartbeat is not None:
        roles.append((("devices", device, "heartbeat", "write"), body.heartbeat.write, _HEARTBEAT))
    for path, point, role in roles:
        of, other = written.setdefault(point, (device, role))
        if (of, other) != (device, role) and not (other == _HEARTBEAT and role == _HEARTBEAT):
            yield _two(path, device, point, of, other, role)


def _writes(document: BindingDocument, device: str, points: _Points) -> Iterator[Overlap]:
    """What commands write where a command is given, or the heartbeat."""
    for place, command in document.commands.items():
        for point in command.write if command.device == device else ():
            if point in points.written:
                role = f"what the command of '{place}' writes"
                yield _two(("commands", place, "write", point), device, point, *points.written[point], role)


def _answers(document: BindingDocument, device: str, points: _Points) -> Iterator[Overlap]:
    """The answers of channels that stand where another answer does, or something that is written."""
    for name, channel in document.devices[device].channels.items():
        for key in ("taken", "done", "failed"):
            if (point := getattr(channel, key)) is None:
                continue
            role, may_be_common = f"'{key}' of '{name}'", key == "failed" and channel.request is not None
            of, other, is_common = points.answers.get(point, (*points.written.get(point, ("", "")), False))
            if other and not (may_be_common and is_common):
                yield _two(("devices", device, "channels", name, key), device, point, of, other, role)
            points.answers.setdefault(point, (device, role, may_be_common))


def _echoes(
    document: BindingDocument, device: str, points: _Points, whole: Callable[[str, Point], Point]
) -> Iterator[Overlap]:
    """What a device must show by itself, as nobody else knows it, where something is written."""
    body = document.devices[device]
    roles: list[tuple[Path, Point, str]] = []
    if body.alive is not None:
        roles.append((("devices", device, "alive", "read"), body.alive.read, "the sign of life"))
    if body.heartbeat is not None and body.heartbeat.tripped is not None:
        tripped = body.heartbeat.tripped
        roles.append((("devices", device, "heartbeat", "tripped"), tripped, "what tells that its watchdog has tripped"))
    for name, contact in document.emergency_stop.items():
        if contact.device == device:
            roles.append((("emergency_stop", name, "read"), contact.read, f"the contact '{name}'"))
    for path, point, role in roles:
        for written, (of, other) in (points.besides | points.written).items():
            if point in (written, whole(device, written)) or written == whole(device, point):
                yield _two(path, device, point, of, other, role)
                break


def _two(path: Path, device: str, point: Point, of: str, one: str, other: str) -> Overlap:
    if of == device:
        return path, f"'{point}' of '{device}' would be {one} and {other}", _HINT
    message = f"'{point}' of '{device}', which stands at the address of '{of}', would be {one} there and {other}"
    return path, message, f"{_HINT}; or correct the address of '{device}'"
