"""Starting a host of a cell: from a bundle and a few words on its link to a `Host` that runs.

A coordinator runs beside the controller whose name it bears; where the net calls none its coordinator, one host is
told to hold the one at the top. Each host checks for itself that the bundle may run and, if that is demanded, who has
signed it; at connection the hosts compare what they hold.
"""

from __future__ import annotations

import ssl
import time
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.driver import Drivers
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.drivers.rivals import listen_first
from firable.executor.journal.sqlite_journal import refuse_taken_over
from firable.executor.links.link import Greeting, Link, called
from firable.executor.operating.conduct import UNATTENDED, Conduct, Watch
from firable.executor.operating.host import Host
from firable.executor.operating.local_monitor import LocalMonitor
from firable.executor.operating.monitor import Divergence
from firable.executor.operating.own_certificate import fault_of, fault_of_authority, remedy_of, unloaded
from firable.executor.operating.service import (
    demand_address,
    demand_no_loop,
    figures_for,
    patience_with,
    run_to_the_end,
)
from firable.executor.operating.situation import Situation
from firable.executor.operating.taken_up import NOWHERE, On, opened
from firable.executor.operating.whereabouts import machines_at
from firable.executor.protocol.deciders import TOP, controller_of, coordinator_at, coordinators
from firable.nets.bundle import Bundle
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError, did_you_mean
from firable.nets.layers import Layers
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import Net
from firable.nets.source import printable, read_bytes

CERTIFICATE_BYTES_MAX: Final = 1_000_000
NAMELESS: Final = "coordinator"
"""What the coordinator of a net that names none is called where a host is to be named."""


@dataclass(frozen=True, slots=True)
class Network:
    """How a host reaches the others over Zenoh: where it listens, whom it joins, and its certificates, if any."""

    listen: tuple[str, ...] = ()
    join: tuple[str, ...] = ()
    certificates: tuple[str, str, str] | None = None
    """The files of the authority, of the certificate and of its key."""
    certified: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """For each common name in a certificate the controllers of the host that has it, if these are to be told apart."""
    lease_seconds: float = 1.0


@dataclass(frozen=True, slots=True)
class SerialLine:
    """How a host reaches the others over a serial line."""

    port: str
    baud: int = 115_200
    lease_seconds: float = 1.0


@dataclass(frozen=True, slots=True)
class HostReport:
    """How a host ended, and what it had to say and to repeat; `never_met` are machines that were never reached.

    Where its own machines were `watched`, `divergence` is the first thing that they did and cannot have done.
    """

    situation: Situation
    machines: tuple[str, ...]
    messages: int
    repeats: int
    never_met: tuple[str, ...]
    watched: bool = False
    divergence: Divergence | None = None
    coalesced: Mapping[str, int] = field(default_factory=dict)
    """For each signal how many of its changes came faster than they were read, and were told to nobody."""

    def to_json(self) -> dict[str, object]:
        """The report as JSON data."""
        return {
            "state": self.situation.state.value,
            "message": self.situation.message,
            "marking": list(self.situation.marking),
            "blocked": [str(blocked) for blocked in self.situation.blocked],
            "machines": list(self.machines),
            "messages": self.messages,
            "repeats": self.repeats,
            "never_met": list(self.never_met),
            "coalesced": dict(self.coalesced),
            **({"divergence": self.divergence.to_json()} if self.divergence is not None else {}),
        }


def machines_of(net: Net, controllers: Sequence[str], *, coordinator: bool) -> tuple[str, ...]:
    """The machines of a host that runs these controllers; raises `InputError` F2005 for one that the net has not.

    >>> from firable.nets.catalogue import catalogue_net
    >>> machines_of(catalogue_net("one_robot"), ["system", "mc"], coordinator=False)
    ('system', 'mc', '')
    >>> machines_of(catalogue_net("two_cells"), ["cell_a", "robot_a"], coordinator=False)
    ('cell_a', 'robot_a', 'coordinator cell_a')
    """
    known = [controller.name for controller in net.controllers]
    if unknown := [name for name in controllers if name not in known]:
        message = f"'{net.name}' has no controller '{unknown[0]}'"
        hint = f"{did_you_mean(unknown[0], known)}it has: {', '.join(known)}"
        raise InputError([Diagnostic("F2005", message, hint)])
    names = tuple(dict.fromkeys(controllers))
    holds = coordinator or (net.coordinator is not None and net.coordinator.name in names)
    below = (coordinator_at(name) for name in names if Layers(net).children.get(name))
    at_the_top = net.coordinator.name if net.coordinator else None
    return (*names, *((TOP,) if holds else ()), *(name for name in below if controller_of(name) != at_the_top))


def make_link(bundle: Bundle, machines: tuple[str, ...], way: Network | SerialLine) -> Link:
    """The link of a host; raises `ModuleNotFoundError` where the extra `zenoh` or `serial` is not installed.

    On a serial line controllers speak to the master alone: `InputError` F5021 where only some coordinators are there.
    F2005 where it is said whose a certificate is, and not of all hosts.
    F1001 or F1003 where a certificate cannot be read, F5062 where it is none, or the key not its own: Zenoh would look
    at them at a connection, and only try again.
    """
    greeting = Greeting(bundle.digest, machines)
    if isinstance(way, SerialLine):
        from firable.executor.links.serial_line import MASTER, SerialLink, addresses_on_a_line

        deciding = coordinators(bundle.decomposition)
        if (here := set(deciding).intersection(machines)) and len(here) < len(deciding):
            message = f"the serial line {way.port} has one master, and not all coordinators are at it"
            hint = "run the coordinators of the layers beside the one at the top, or link the hosts over a network"
            raise InputError([Diagnostic("F5021", message, hint)])
        addresses = addresses_on_a_line(deciding, tuple(c.name for c in bundle.net.controllers))
        own = MASTER if TOP in machines else min(addresses[name] for name in machines)
        return SerialLink(greeting, way.port, addresses, own, baud=way.baud, lease_seconds=way.lease_seconds)
    from firable.executor.links.zenoh_link import Certificates, ZenohLink

    certificates = None
    if way.certificates is not None:
        _demand_certificates(*way.certificates, serves=bool(way.listen), joins=bool(way.join))
        certificates = Certificates(*way.certificates, _certified(bundle, machines, way.certified))
        greeting = Greeting(bundle.digest, _in_order(bundle, machines))  # the one order in which they are claimed
    return ZenohLink(
        greeting, listen=way.listen, join=way.join, certificates=certificates, lease_seconds=way.lease_seconds
    )


def _demand_certificates(authority: str, certificate: str, key: str, *, serves: bool, joins: bool) -> None:
    for file in (authority, certificate, key):
        read_bytes(file, CERTIFICATE_BYTES_MAX)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    problem, files = f"{authority} is no certificate of an authority", [authority]
    try:
        context.load_verify_locations(authority)
        problem, files = f"{certificate} and {key} are no certificate and its key", [certificate, key]
        context.load_cert_chain(certificate, key, password="")  # or one would be asked for at the terminal
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        message = f"{printable(problem)}: {printable(unloaded(error, *files))}"
        raise InputError([Diagnostic("F5062", message, "name PEM files, and a key without a password")]) from None
    if fault := fault_of_authority(authority, time.time()):
        message = f"the authority in {printable(authority)} cannot be used: {fault}"
        hint = "name the certificate by which those of the hosts were signed, and look at the clock of this host"
        raise InputError([Diagnostic("F5062", message, hint)])
    for is_server in (True,) * serves + (False,) * joins:
        if fault := fault_of(certificate, key, is_server=is_server):
            message = f"the certificate {printable(certificate)} cannot be used: {printable(fault)}"
            raise InputError([Diagnostic("F5062", message, remedy_of(fault))])


def _in_order(bundle: Bundle, machines: Collection[str] | None = None) -> tuple[str, ...]:
    """All machines of a bundle, or these, in the order of the net."""
    known = (*coordinators(bundle.decomposition), *(controller.name for controller in bundle.net.controllers))
    return tuple(name for name in known if machines is None or name in machines)


def _certified(
    bundle: Bundle, here: Collection[str], certified: Mapping[str, tuple[str, ...]]
) -> Mapping[str, tuple[str, ...]]:
    """For each common name all machines of its host; raises `InputError` F2005 where one elsewhere has none, or two."""
    if not certified:
        return {}
    is_nameless = bundle.net.coordinator is None and NAMELESS not in {c.name for c in bundle.net.controllers}
    found: dict[str, tuple[str, ...]] = {}
    for name, controllers in certified.items():
        holds = is_nameless and NAMELESS in controllers
        own = [controller for controller in controllers if not (holds and controller == NAMELESS)]
        found[name] = _in_order(bundle, machines_of(bundle.net, own, coordinator=holds))
    named = Counter(machine for machines in found.values() for machine in machines)
    for machine in _in_order(bundle):
        if named[machine] > 1 or (machine not in here and not named[machine]):
            said = "of two certificates" if named[machine] else "of no certificate"
            hint = "name with --certified each controller once, with all of its host, as in plc1=robot,mc"
            if is_nameless:
                hint += f"; that which --coordinator holds is named {NAMELESS}"
            raise InputError([Diagnostic("F2005", f"{called(machine)} is said to be {said}", hint)])
    return found


def own_net(decomposition: Decomposition, machines: Sequence[str]) -> Net:
    """The places and signals of some machines, wherever those above them are: what their driver has to serve."""
    subnets = [subnet for subnet in decomposition.subnets if subnet.name in machines]
    controllers = tuple(replace(c, under=None) for c in decomposition.net.controllers if c.name in machines)
    places = tuple(place for subnet in subnets for place in subnet.places)
    signals = tuple(signal for subnet in subnets for signal in subnet.signals)
    return Net(decomposition.net.name, places, (), signals=signals, controllers=controllers)


def run_host(
    bundle: Bundle,
    machines: tuple[str, ...],
    drivers: Drivers,
    link: Link,
    conduct: Conduct = UNATTENDED,
    *,
    plant: PlantModel | None = None,
) -> HostReport:
    """Run a host until it is stopped (Ctrl-C, SIGTERM, an operator) or fails.

    Where a `plant` says what the machines should do, those here are held against it as the run goes, until it is taken
    up or reset. With a service, it stays after an emergency stop until that is reset. Raises `InputError` as drivers,
    link, journal and trace do, F5003 where the plant does not fit, F5061 where the address of the service is taken, and
    F5106 where another program commands a device, before anything is written; `RuntimeError` within an event loop,
    before that.
    """
    demand_no_loop()
    driver = drivers()
    demand_address(conduct.service)
    if conduct.journal_path is not None:
        refuse_taken_over(conduct.journal_path)
    at: Mapping[str, str] = NOWHERE
    if isinstance(driver, BoundDriver):
        listen_first(driver.binding)
        at = machines_at(driver.binding, bundle.net)
    controllers = [subnet.name for subnet in bundle.decomposition.subnets if subnet.name in machines]
    monitor = None
    if plant is not None and conduct.watch is not Watch.IGNORE:
        monitor = LocalMonitor(bundle.decomposition, controllers, plant)
    on = On.NOTHING if isinstance(driver, DryRunDriver) else On.MACHINES
    decomposition, journal = bundle.decomposition, conduct.journal_path
    with opened(decomposition, bundle.digest, journal, conduct.trace, machines=machines, on=on, at=at) as files:
        host = Host(
            decomposition,
            driver,
            files.recorder,
            conduct,
            machines=machines,
            link=link,
            journal=files.journal,
            begin_seconds=files.begin_seconds,
            patience=patience_with(driver),
            figures=figures_for(bundle.net, conduct.service, machines),
            monitor=monitor,
            latched=partial(drivers, latched=True),
            elsewhere=files.elsewhere,
        )
        if files.is_taken_up:
            host.unwatch()
        situation = run_to_the_end(host)
    return HostReport(
        situation,
        machines,
        host.acts.messages,
        host.acts.repeats,
        host.peers.never_met,
        host.is_watched,
        host.divergence,
        host.coalesced.up_to_now(host.driver),
    )
