"""Points of one device that would mean two things, such as a heartbeat at the register of a channel's number.

Each is an address that the device has, so no kind of device objects to it, and the machines make of it what they like:
with the heartbeat there, each beat is a command. Refused is

- what gives a command, at one point with the heartbeat, with what gives those of another channel, or with a value that
  a command writes before it; and such a value at the point of the heartbeat;
- an answer (*taken*, *done*, *failed*) at one point with another answer, or with what is written. Only the bits by
  which machines without numbers say that they have failed may be one, a common alarm.

A signal may be read anywhere, and safe outputs may be any: to take a request back is one. Points are compared as they
are written. Rejected: a warning, which nobody reads before the machine moves.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from firable.executor.drivers.device import Point
from firable.nets.yaml_tree import Path

if TYPE_CHECKING:
    from firable.executor.drivers.binding import BindingDocument

Overlap = tuple[Path, str, str]
"""Where a point stands that has a meaning already, what both are, and what to do."""

_HINT: Final = "look up where the device has the second of them, and give it that address"


def overlaps(document: BindingDocument) -> Iterator[Overlap]:
    """The points of each device that have two meanings of which one would be taken for the other."""
    for device in document.devices:
        written: dict[Point, str] = {}
        yield from _gives(document, device, written)
        yield from _answers(document, device, written)


def _gives(document: BindingDocument, device: str, written: dict[Point, str]) -> Iterator[Overlap]:
    """Of what gives commands, and of the heartbeat, those that are written where another is; they are put down."""
    body = document.devices[device]
    roles: list[tuple[Path, Point, str]] = [
        (("devices", device, "channels", name, key), point, f"the {key} of '{name}'")
        for name, channel in body.channels.items()
        for key in ("number", "command", "request")
        if (point := getattr(channel, key)) is not None
    ]
    if body.heartbeat is not None:
        roles.append((("devices", device, "heartbeat", "write"), body.heartbeat.write, "the heartbeat"))
    for path, point, role in roles:
        if point in written:
            yield _two(path, device, point, written[point], role)
        written.setdefault(point, role)
    for place, command in document.commands.items():
        for point in command.write if command.device == device else ():
            if point in written:
                role = f"what the command of '{place}' writes"
                yield _two(("commands", place, "write", point), device, point, written[point], role)


def _answers(document: BindingDocument, device: str, written: dict[Point, str]) -> Iterator[Overlap]:
    """The answers of channels that stand where another answer does, or something that is written."""
    answers: dict[Point, tuple[str, bool]] = {}
    for name, channel in document.devices[device].channels.items():
        for key in ("taken", "done", "failed"):
            if (point := getattr(channel, key)) is None:
                continue
            role, may_be_common = f"'{key}' of '{name}'", key == "failed" and channel.request is not None
            other, is_common = answers.get(point, (written.get(point, ""), False))
            if other and not (may_be_common and is_common):
                yield _two(("devices", device, "channels", name, key), device, point, other, role)
            answers.setdefault(point, (role, may_be_common))


def _two(path: Path, device: str, point: Point, one: str, other: str) -> Overlap:
    return path, f"'{point}' of '{device}' would be {one} and {other}", _HINT
