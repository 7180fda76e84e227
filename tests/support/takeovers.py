"""A cell before and after a change, and its journals where the old one has stopped."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from firable.cli.main import main
from firable.decompose.splitting.cut import split
from firable.executor.journal.journal import sync_now
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.links.link import COORDINATOR
from firable.executor.operating.taken_up import ON, On
from firable.executor.operating.whereabouts import MACHINES
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import Keep, Stored
from firable.nets.bundle import read_bundle
from firable.nets.decomposition import Decomposition
from firable.nets.text import parse_net

OLD = """\
firable: 1
cell: cell
controllers:
  line: {coordinator: true, places: {}}
  robot:
    start: free
    places:
      free:
      working: {send: {machine: R, command: WORK}, until: worked}
      worked_out:
  table:
    start: empty
    places:
      empty:
      full:
transitions:
  begin: {from: [robot.free, table.empty], to: [robot.working, table.full]}
  end:   {from: robot.working, to: robot.worked_out}
  clear: {from: [robot.worked_out, table.full], to: [robot.free, table.empty]}
"""
WITH_INSPECTION = OLD.replace("      full:\n", "      full:\n      inspected:\n").replace(
    "  clear: {from: [robot.worked_out, table.full],",
    "  inspect: {from: table.full, to: table.inspected, if: robot.worked_out}\n"
    "  clear: {from: [robot.worked_out, table.inspected],",
)


def cell(text: str) -> Decomposition:
    """The split of a net."""
    return split(parse_net(text))


def kept_in(
    marking: set[str], decomposition: Decomposition, **more: Mapping[str, Stored]
) -> dict[str, dict[str, Stored]]:
    """What journals keep of a cell at rest in a marking."""
    kept: dict[str, dict[str, Stored]] = {COORDINATOR: {"epoch": 2}}
    for subnet in decomposition.subnets:
        word = sum(1 << i for i, place in enumerate(subnet.places) if place.name in marking)
        kept[subnet.name] = {"epoch": 4, "word": f"{word:x}"}
    for machine, of in more.items():
        kept[machine].update(of)
    return kept


def joint_marking(decomposition: Decomposition, kept: Mapping[str, Mapping[str, Stored]]) -> set[str]:
    """The places with a token of controllers that are restored from their journals, all held."""
    machines = [LocalController.restored(decomposition, s.name, kept[s.name]) for s in decomposition.subnets]
    assert all(machine.held for machine in machines)
    return {name for machine in machines for name in machine.subnet.names(machine.marking)}


def bundle(folder: Path, name: str, text: str) -> Path:
    """The bundle of a net, made as its users make it."""
    net, made = folder / f"{name}.firable.yaml", folder / f"{name}.bundle"
    net.write_text(text)
    assert main(["bundle", str(net), "-o", str(made)]) == 0
    return made


def old_and_new(folder: Path) -> tuple[Path, Path]:
    """The bundles of the cell before and after the change."""
    return bundle(folder, "old", OLD), bundle(folder, "new", WITH_INSPECTION)


def journal(path: Path, of: Path, marking: set[str], machines: tuple[str, ...] = ()) -> Path:
    """The journal of a whole cell, or of the host of some of its machines."""
    read = read_bundle(of)
    kept = kept_in(marking, read.decomposition)
    kept = {machine: records for machine, records in kept.items() if not machines or machine in machines}
    written = SqliteJournal(path, read.digest, kept)
    written.write(MACHINES, [Keep(ON, On.MACHINES.value)])
    for machine, records in kept.items():
        written.write(machine, [Keep(key, value) for key, value in records.items()])
    sync_now(written)
    written.close()
    return path
