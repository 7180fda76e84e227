"""`firable run --controller NAME`: run some controllers of a bundle on this host, linked to the others."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from firable.cli import text
from firable.cli.files import JOURNAL, READ
from firable.cli.finite import FiniteRange
from firable.cli.log import told_aside
from firable.cli.options import binding_for, is_given, warn_of_open_key
from firable.cli.report import Report
from firable.cli.watched import AFTER_A_FAULT_OF_A_HOST, machines_verdict, show_coalesced
from firable.nets.source import printable

if TYPE_CHECKING:
    from firable.executor.drivers.driver import Drivers, Latched
    from firable.executor.links.link import Link
    from firable.executor.operating.conduct import Conduct
    from firable.executor.operating.situation import Situation
    from firable.nets.bundle import Bundle
    from firable.nets.diagnostics import Diagnostic
    from firable.nets.machines.plant_file import PlantModel
    from firable.nets.verdict import Verdict

_ADDRESS: Final = re.compile(r"(tcp|tls)/(\[[0-9A-Fa-f:.]+(%\w+)?\]|[^\s/:\[\]#?]+):(?P<port>[0-9]{1,5})")

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class HostOptions:
    """What the options say of the host, if anything."""

    controller: tuple[str, ...]
    coordinator: bool
    listen: tuple[str, ...]
    join: tuple[str, ...]
    tls: tuple[str, str, str] | None
    certified: Mapping[str, tuple[str, ...]]
    serial: str | None
    baud: int
    lease: float
    journal: str | None
    resume: bool
    dry_run: float | None
    bind: str | None

    @property
    def is_one_of_several(self) -> bool:
        """Whether only a part of the cell runs here."""
        return bool(self.controller) or self.coordinator

    @property
    def is_simulated(self) -> bool:
        """Whether the cell here is simulated: it is all here, and on no machines."""
        return self.bind is None and not self.is_one_of_several

    def refuse_alone(self) -> None:
        """Refuse what only a host among others has use for."""
        given = {
            "--listen": self.listen,
            "--join": self.join,
            "--tls": self.tls,
            "--certified": self.certified,
            "--serial": self.serial,
            "--baud": is_given("baud"),
            "--lease": is_given("lease"),
            "--dry-run": self.dry_run is not None,
        }
        if names := [name for name, value in given.items() if value]:
            raise click.UsageError(f"{names[0]} is for a host among others: say with --controller what runs here")


def _addresses(_context: click.Context, option: click.Parameter, addresses: tuple[str, ...]) -> tuple[str, ...]:
    """Refuse what is no address of a host, before anything is opened."""
    for address in addresses:
        match = _ADDRESS.fullmatch(address)
        if match is None or not 0 < int(match["port"]) < 2**16:
            known = "write tcp/HOST:PORT or tls/HOST:PORT, such as tcp/127.0.0.1:7447"
            raise click.UsageError(f"{option.opts[0]} {printable(address)}: this is no address; {known}")
    return addresses


def _certified(
    _context: click.Context, option: click.Parameter, said: tuple[str, ...]
) -> Mapping[str, tuple[str, ...]]:
    """Which controllers the host of each common name runs."""
    found: dict[str, tuple[str, ...]] = {}
    for one in said:
        name, _, controllers = one.rpartition("=")
        named = tuple(filter(None, controllers.split(",")))
        if not name or not named:
            raise click.UsageError(f"{option.opts[0]} {printable(one)}: write NAME=CONTROLLER, as in plc1=robot,mc")
        if name in found:
            raise click.UsageError(f"{option.opts[0]} {printable(name)} stands twice: name all its controllers at once")
        found[name] = named
    return found


def host_options(command: F) -> F:
    """The options of a host; they come as the keywords of `HostOptions`."""
    for option in reversed(
        (
            click.option(
                "--controller",
                metavar="NAME",
                multiple=True,
                help="Run only this controller here, with its coordinator if the net calls it one; may be repeated.",
            ),
            click.option("--coordinator", is_flag=True, help="Run the coordinator here, of a net that names none."),
            click.option(
                "--listen",
                metavar="ADDRESS",
                multiple=True,
                callback=_addresses,
                help="Let hosts join here, such as tcp/127.0.0.1:7447.",
            ),
            click.option(
                "--join",
                metavar="ADDRESS",
                multiple=True,
                callback=_addresses,
                help="Join the host that listens there.",
            ),
            click.option(
                "--tls",
                type=(READ, READ, READ),
                metavar="CA CERT KEY",
                help="The files of the site's authority, and of this host's certificate and key, for tls/ addresses.",
            ),
            click.option(
                "--certified",
                metavar="NAME=CONTROLLERS",
                multiple=True,
                callback=_certified,
                help="Let only the certificate with this common name be that of these controllers; for each host one.",
            ),
            click.option(
                "--serial", metavar="PORT", help="Reach the others over a serial line, polled by the coordinator."
            ),
            click.option("--baud", type=click.IntRange(min=1200), default=115_200, show_default=True, metavar="N"),
            click.option(
                "--lease",
                type=FiniteRange(min=0.05, max=600),
                default=1.0,
                show_default=True,
                metavar="SECONDS",
                help="A host that is silent for so long is lost.",
            ),
            click.option(
                "--journal",
                metavar="FILE",
                type=JOURNAL,
                help="Keep what a restart needs; a run that was killed is taken up from it.",
            ),
            click.option(
                "--resume",
                is_flag=True,
                help="After a restart go on as soon as it is known what became of each command.",
            ),
            click.option(
                "--bind", metavar="FILE", type=READ, help="Run on real machines: where they and the sensors are."
            ),
            click.option(
                "--dry-run",
                type=FiniteRange(min=0.0),
                metavar="SECONDS",
                help="Run without machines: each command is done after so long, each sensor shows 1.",
            ),
        )
    ):
        command = option(command)
    return command


def run_host_of(path: str, bundle: Bundle, options: HostOptions, conduct: Conduct, plant: PlantModel | None) -> Report:
    """Run this host until it is stopped or fails, and report how it ended."""
    from firable.executor.operating.hosting import machines_of, run_host

    machines = machines_of(bundle.net, options.controller, coordinator=options.coordinator)
    if options.coordinator and (named := bundle.net.coordinator) is not None and named.name not in machines:
        raise click.UsageError(
            f"--coordinator is of a net that names none, and in '{bundle.net.name}' '{named.name}' is the one: "
            f"it runs where --controller {named.name} does"
        )
    drivers, notes = _drivers(bundle, machines, options)
    link, warnings = _link(bundle, machines, options)
    for warning in (*notes, *warnings):
        text.show_diagnostic(warning)
    with told_aside(_told, conduct.log) as tell:
        report = run_host(bundle, machines, drivers, link, replace(conduct, tell=tell), plant=plant)
    return Report(
        "run",
        path,
        bundle.net,
        (_verdict(report.situation, machines), *machines_verdict(report, "run of one host, of its own machines")),
        notes=notes,
        run=report.to_json(),
    )


def show_host(report: Report) -> None:
    """How a host ended."""
    text.heading(report.net, report.input)
    done = report.run
    names = ", ".join(name or "the coordinator" for name in done["machines"])
    click.echo(f"  {names}: {done['state']}")
    click.echo(f"  {text.counted(done['messages'], 'message')}, {done['repeats']:,} of them repeated")
    show_coalesced(done["coalesced"])
    text.show_verdicts(report.net, report.verdicts)
    for file in report.files:
        click.echo(f"  trace {file}; `firable replay` judges it together with those of the other hosts")


def _told(kind: str, sentence: str) -> None:
    """One line of what happens, as it happens."""
    click.echo(f"{time.strftime('%H:%M:%S')} {kind}: {sentence}", err=True)


def _drivers(bundle: Bundle, machines: tuple[str, ...], options: HostOptions) -> tuple[Drivers, tuple[Diagnostic, ...]]:
    """What makes the driver of this host, and what is to be told of its binding."""
    from firable.executor.operating.hosting import own_net

    if options.bind is not None and options.dry_run is not None:
        raise click.UsageError("--bind is for machines and --dry-run for none: give one of them")
    if options.bind is not None:
        from firable.executor.drivers.bound import bound_driver

        own = own_net(bundle.decomposition, machines)
        binding, notes = binding_for(options.bind, bundle.net)
        return partial(bound_driver, binding, bundle.net, own), notes
    net = own_net(bundle.decomposition, machines)
    if options.dry_run is None and (net.signals or any(place.command for place in net.places)):
        raise click.UsageError("say with --bind where the machines of this host are, or --dry-run without any")
    from firable.executor.drivers.dry_run import DryRunDriver

    def dry(*, latched: bool = False) -> Latched:
        del latched  # there is nothing to be held safe
        return DryRunDriver([net], options.dry_run or 0.0)

    return dry, ()


def _link(bundle: Bundle, machines: tuple[str, ...], options: HostOptions) -> tuple[Link, tuple[Diagnostic, ...]]:
    from firable.executor.operating.hosting import Network, SerialLine, make_link

    if options.serial is not None:
        if options.listen or options.join or options.tls or options.certified:
            raise click.UsageError("--serial is one link, and --listen, --join and --tls are of another: give one")
        return make_link(bundle, machines, SerialLine(options.serial, options.baud, options.lease)), ()
    if is_given("baud"):
        raise click.UsageError("--baud is of a serial line: name it with --serial")
    if not options.listen and not options.join:
        raise click.UsageError("say with --listen, --join or --serial how this host is linked to the others")
    secured = [address for address in (*options.listen, *options.join) if address.startswith("tls/")]
    if secured and options.tls is None:
        raise click.UsageError(f"{secured[0]} asks for certificates: name those of this host with --tls CA CERT KEY")
    if options.tls is not None and not secured:
        raise click.UsageError("--tls is for tls/ addresses, and without one nothing is encrypted: write tls/HOST:PORT")
    if options.certified and len(secured) < len(options.listen) + len(options.join):
        raise click.UsageError("--certified is of tls/ addresses alone: over tcp/ nobody shows a certificate")
    if options.tls is not None:
        warn_of_open_key(options.tls[2])
    network = Network(options.listen, options.join, options.tls, options.certified, options.lease)
    link = make_link(bundle, machines, network)
    from firable.executor.links.zenoh_link import open_to_the_network

    return link, open_to_the_network(options.listen)


def _verdict(situation: Situation, machines: tuple[str, ...]) -> Verdict:
    from firable.executor import State
    from firable.nets.verdict import Status, Verdict

    fault = situation.state is State.FAULT
    status = Status.VIOLATED if fault else Status.UNKNOWN if situation.message else Status.PROVED
    return Verdict(
        "host-ended-in-order",
        status,
        "the host ran until it was stopped, and left nothing open",
        "run of one host",
        bound="" if fault else situation.message,
        hint=AFTER_A_FAULT_OF_A_HOST if fault else "",
        subjects=(situation.message,) if fault else tuple(name or "coordinator" for name in machines),
    )
