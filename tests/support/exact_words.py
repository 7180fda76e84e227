"""The mistakes that no page of `docs/codes` can show by commands: each made here, with the whole text of the answer.

A page shows what happens on a console. What happens on the page of `firable view`, between hosts, at a port that is
taken or in a program is made by the functions of this module, one for a code: each makes the mistake and returns what
is said of it. `{folder}` in an answer stands for the folder that the function is given.
"""

from __future__ import annotations

import asyncio
import io
import socket
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr
from itertools import count
from pathlib import Path
from typing import Final
from unittest.mock import patch

from aiohttp import web
from support.reference import cases

import firable.analysis.check
from firable.cli.main import main
from firable.cli.text import reasons
from firable.cli.view.moment import moment_of
from firable.decompose.protocol.exploring import explore_protocol
from firable.decompose.protocol.wrong import WRONG, example
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.rivals import demand_alone
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.links.link import Greeting, Refusal, come_back_without, objection
from firable.executor.links.storages import Estranged
from firable.executor.links.zenoh_link import open_to_the_network
from firable.executor.operating.control import Endpoint, listening
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.editing import edits
from firable.nets.editing.net_file import NetFile
from firable.nets.machines.closing import close
from firable.nets.machines.plant_file import parse_plant
from firable.nets.secret_files import warning_if_open
from firable.nets.source import Source
from firable.nets.text import parse_net
from firable.nets.verdict import Status


def refusal(act: Callable[[], object]) -> str:
    """What is said where something is refused."""
    try:
        act()
    except InputError as error:
        return str(error)
    raise AssertionError("not refused")


def a_file_that_another_has_changed(folder: Path) -> str:
    path = folder / "cell.firable.yaml"
    path.write_text("firable: 1\ncell: c\n", "utf-8")
    read = NetFile.read(path)
    path.write_text("firable: 1\ncell: d\n", "utf-8")
    return refusal(lambda: read.written("firable: 1\ncell: e\n"))


def a_gate_that_stands_nowhere(_: Path) -> str:
    text = (
        "firable: 1\ncell: c\ncontrollers:\n  r:\n    start: free\n"
        "    places: {free: , busy: {send: {machine: R, command: GO}, until: there}}\n"
        "transitions:\n  go: {from: r.free, to: r.busy}\n  back: {from: r.busy, to: r.free}\n"
    )
    return refusal(lambda: edits.disconnect(Source("cell.firable.yaml", text), "back", "if", "r.there"))


def a_gate_with_two_sources(_: Path) -> str:
    return refusal(next(case for case in cases() if case.label == "gate both internal and external").net)


def thirteen_machines_at_once(_: Path) -> str:
    count = range(13)
    places = "".join(f"      p{i}: {{send: {{machine: M{i}, command: GO}}, until: done{i}}}\n" for i in count)
    net = (
        f"firable: 1\ncell: many\ncontrollers:\n  c:\n    start: begin\n    places:\n      begin:\n{places}"
        f"transitions:\n  all: {{from: c.begin, to: [{', '.join(f'c.p{i}' for i in count)}]}}\n"
    )
    machines = "".join(f"  M{i}: {{commands: {{GO: {{does: clamp, station: s, takes_s: 1}}}}}}\n" for i in count)
    plant = (
        "firable_plant: 1\nplant: many\nstations: [s]\narrivals: {station: s, every_s: 1}\n"
        f"departures: {{station: s}}\nmachines:\n{machines}"
    )
    return refusal(lambda: close(parse_net(net), parse_plant(plant)))


def a_protocol_that_reads_copies_of_gates(_: Path) -> str:
    wrong = next(one for one in WRONG if one.name == "cached-gates")
    found = explore_protocol(example(wrong.example), wrong.variant, wrong.faults)
    verdict = next(one for one in found.verdicts if one.status is Status.VIOLATED)
    return "\n".join((verdict.statement, *reasons(found.protocol.net, verdict)))


def _refused(why: Refusal | None) -> str:
    assert why is not None
    return str(why.problem)


def a_host_with_another_bundle(_: Path) -> str:
    return _refused(objection(Greeting("0" * 64, ("",)), Greeting("1" * 64, ("robot",))))


def a_host_without_its_journal(_: Path) -> str:
    return _refused(come_back_without(Estranged(("robot",), is_older=False)))


def an_address_without_tls(_: Path) -> str:
    return "\n".join(map(str, open_to_the_network(["tcp/0.0.0.0:7447"])))


def a_journal_that_is_open(folder: Path) -> str:
    first = SqliteJournal(folder / "cell.journal", "d1", ("a",))
    try:
        return refusal(lambda: SqliteJournal(folder / "cell.journal", "d1", ("a",)))
    finally:
        first.close()


def a_device_with_the_heartbeat_of_another(_: Path) -> str:
    async def listen() -> None:
        end = ModbusTcpEnd()
        await end.start(lambda _point, _value: None)
        text = (
            "firable_bind: 1\ncell: c\ndevices:\n  plc:\n    driver: modbus-tcp\n    host: 127.0.0.1\n"
            f"    port: {end.port}\n    heartbeat: {{write: holding 0, every_s: 0.2}}\n"
        )

        async def another() -> None:
            for beat in count():
                end.show("holding 0", beat)
                await asyncio.sleep(0.01)

        beating = asyncio.create_task(another())
        try:
            await demand_alone(parse_binding(text, "cell.bind.yaml"))
        finally:
            await ended([beating])
            await end.stop()

    return refusal(lambda: asyncio.run(listen()))


def a_port_that_is_taken(_: Path) -> str:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]

        async def serve() -> None:
            async with listening(web.Application(), Endpoint("127.0.0.1", port, "a-token-of-some-length")):
                pass

        return refusal(lambda: asyncio.run(serve())).replace(str(port), "8080")


def a_place_that_the_net_has_not(_: Path) -> str:
    asked = {"marking": ["no.place"], "signals": [], "free": True}
    return refusal(lambda: moment_of(catalogue_net("one_robot"), asked))


def a_key_that_all_can_read(folder: Path) -> str:
    path = folder / "host.key"
    path.touch()
    path.chmod(0o644)
    return "\n".join(map(str, warning_if_open(path, "key")))


def a_password_without_tls(_: Path) -> str:
    device = "{driver: mqtt, host: 10.1.1.1, user: u, password: p}"
    binding = parse_binding(f"firable_bind: 1\ncell: c\ndevices:\n  D: {device}\n", "cell.bind.yaml")
    return "\n".join(map(str, binding.exposed()))


def a_fault_of_firable(_: Path) -> str:
    told = io.StringIO()
    with patch.object(firable.analysis.check, "check", side_effect=RuntimeError("planted")), redirect_stderr(told):
        main(["check", "catalogue:one_robot"])
    return told.getvalue()


EXACT: Final[Mapping[str, tuple[Callable[[Path], str], str]]] = {
    "F1019": (
        a_file_that_another_has_changed,
        """\
error[F1019]: {folder}/cell.firable.yaml has been changed by somebody else since it was read
  hint: read it again; what was to be written is not
""",
    ),
    "F1020": (
        a_gate_that_stands_nowhere,
        """\
error[F1020]: `if: r.there` of 'back' stands nowhere in the file by itself
  hint: what `until` of a place names is a gate of all that take its token: edit `until` there
""",
    ),
    "F2010": (
        a_gate_with_two_sources,
        """\
error[F2010]: a gate of 't' has two sources, 'p' and 's'
  hint: write two gates
""",
    ),
    "F3007": (
        thirteen_machines_at_once,
        """\
error[F3007]: 'all' sends commands with more than 4,096 outcomes in one firing
  hint: send them one after the other, in transitions of their own
""",
    ),
    "F4006": (
        a_protocol_that_reads_copies_of_gates,
        """\
whatever the protocol fires, the central net can fire
from the initial marking fire:
    1. fire/open                       guard fires open
    2. fire/close/astray/guard.opened  press fires close, though in the central net guard.opened is full
by the last event something fires that the central net cannot fire
then hold a token: central/press.ready, press.closed, guard.opened, central/guard.opened, astray
hint: [F4006] the protocol itself is at fault: run no net by it, and report it
""",
    ),
    "F5020": (
        a_host_with_another_bundle,
        """\
error[F5020]: 'robot' holds another bundle: 1111111111111111…, and this host 0000000000000000…
  hint: give all hosts of the cell the same bundle file, and start them again
""",
    ),
    "F5022": (
        an_address_without_tls,
        """\
warning[F5022]: tcp/0.0.0.0:7447 is open to the network: whoever reaches it can take part in the cell
  hint: use tls/ with the certificates of the site, or a network that nobody else is on
""",
    ),
    "F5025": (
        a_host_without_its_journal,
        """\
error[F5025]: 'robot' came back without what was kept there: the journal is another one, or there is none
  hint: start it with the journal that it had (--journal); where that is lost, bring the cell to its initial marking,\
 and start all hosts anew, each with a new journal
""",
    ),
    "F5026": (
        a_key_that_all_can_read,
        """\
warning[F5026]: {folder}/host.key: everybody on this host can read this key, or change it
  hint: `chmod o-rw {folder}/host.key`
""",
    ),
    "F5027": (
        a_password_without_tls,
        """\
cell.bind.yaml:4:46: warning[F5027]: the password of 'D' goes over the network as it is: whoever is on it can read that
    4 |   D: {driver: mqtt, host: 10.1.1.1, user: u, password: **
                                                     ^^^^^^^^
  hint: encrypt it, as docs/drivers.md tells of `driver: mqtt`
""",
    ),
    "F5033": (
        a_journal_that_is_open,
        """\
error[F5033]: {folder}/cell.journal: the journal is in use by another process
  hint: one process at a time runs these machines: stop that one first, or name another journal
""",
    ),
    "F5061": (
        a_port_that_is_taken,
        """\
error[F5061]: nothing can be served at 127.0.0.1:8080: Address already in use
  hint: name another port; 0 takes a free one
""",
    ),
    "F5070": (
        a_place_that_the_net_has_not,
        """\
error[F5070]: the page speaks of a marking that the net cannot have
  hint: load the page again; its server may be another one now
""",
    ),
    "F5106": (
        a_device_with_the_heartbeat_of_another,
        """\
cell.bind.yaml:8:17: error[F5106]: another program sends the heartbeat of 'plc', at 'holding 0', and commands its\
 machines
    8 |     heartbeat: {write: holding 0, every_s: 0.2}
                        ^^^^^
  hint: nothing was begun or written here: find out which of the two is the one that should command them
""",
    ),
    "F9001": (
        a_fault_of_firable,
        """\
error[F9001]: internal error: RuntimeError: planted
  hint: this is our fault, not yours; please report it with the output of `firable --traceback ...`
""",
    ),
}
"""For a code: what makes the mistake, and the whole text of what is said then."""
