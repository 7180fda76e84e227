"""Where the machines of a run are: its journal tells where their tokens stand, and of no machines elsewhere.

A binding is no part of what is proved, and may change between two starts: a controller of a machine gets another
address, or a trial on a simulated cell behind sockets is over and the real machines come. The first goes on where it
was, the second must not, and no program can tell them apart. So the journal keeps where each machine was commanded,
and a run that finds one elsewhere is held, whatever was said beforehand, until a person has said that these are the
machines. Before that nobody asks them what became of a command: what others would say of its number is no answer.

It is told by machine and not by device, as what a binding calls its devices moves nothing. Where a kind of device does
not say where it stands, its name alone is kept. What may be another machine is another one here, as the path of an OPC
UA server at the same port: a machine that is held until somebody has said that it is the one costs a minute, and one
that is taken for another is moved from where it is not. What may be the same device is one where it is asked who writes
what (`Options.far_end`).

Rejected: to refuse such a journal. Whoever gives a controller another address would lose where the workpieces are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from firable.executor.drivers.binding import Binding
from firable.executor.protocol.messages import Keep, Stored
from firable.nets.net import Net
from firable.nets.source import printable

if TYPE_CHECKING:
    from firable.executor.journal.journal import Journal

MACHINES: Final = "\nmachines"
"""Whose row of the journal says on what the run commands: no machine of the protocol has a line feed in its name."""

AT: Final = "at"
"""Under this the row has where each machine is."""


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """Machines that are not where the journal has them, and where all of them are now."""

    moved: Mapping[str, tuple[str, str]]
    """Where each of those was, and where it is."""
    now: Mapping[str, str]

    def sentences(self) -> tuple[str, ...]:
        """Which machines were where and are where, in words; those that have moved together in one."""
        together: dict[tuple[str, str], list[str]] = {}
        for machine, way in self.moved.items():
            together.setdefault(way, []).append(machine)
        return tuple(
            f"the journal has {printable(', '.join(machines))} at {printable(was)}, the binding at {printable(is_)}"
            for (was, is_), machines in together.items()
        )

    def keep(self, journal: Journal) -> None:
        """Have the journal hold where the machines are now."""
        journal.write(MACHINES, [Keep(AT, dict(self.now))])


def machines_at(binding: Binding, net: Net) -> dict[str, str]:
    """Where each machine is that a binding has commands for: the kind of its device, its place, a topic at a broker.

    One that is commanded at several devices is at all of them.
    """
    found: dict[str, set[str]] = {}
    for place, one in binding.document.commands.items():
        device, stands_at = binding.document.devices[one.device], binding.options[one.device].stands_at()
        at = f"{device.driver} {stands_at}" if stands_at else device.driver
        if binding.kinds[one.device].through_broker:
            at += f" {device.channels[one.channel].asks}"
        if (command := net.place(place).command) is not None:
            found.setdefault(command.machine, set()).add(at)
    return {machine: " and ".join(sorted(ats)) for machine, ats in sorted(found.items())}


def elsewhere(kept: Stored | None, now: Mapping[str, str]) -> Elsewhere | None:
    """What has moved of what a journal has kept, if anything; of a machine that it has nowhere nobody can tell.

    >>> elsewhere({"R": "modbus-tcp 127.0.0.1:5020 unit 1"}, {"R": "modbus-tcp plc:502 unit 1"}).sentences()
    ('the journal has R at modbus-tcp 127.0.0.1:5020 unit 1, the binding at modbus-tcp plc:502 unit 1',)
    >>> elsewhere({"R": "serial /dev/ttyS0"}, {"R": "serial /dev/ttyS0", "S": "serial /dev/ttyS1"}) is None
    True
    """
    before = {machine: str(at) for machine, at in kept.items()} if isinstance(kept, Mapping) else {}
    moved = {machine: (before[machine], at) for machine, at in now.items() if before.get(machine, at) != at}
    return Elsewhere(moved, now) if moved else None
