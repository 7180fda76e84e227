"""A new bundle goes on where an old one has stopped, or is refused with every reason."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

import pytest
from support.hosts import Cell

import firable.cli.takeover as cli_takeover
from firable.cli.main import main
from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.binding import ChannelDocument
from firable.executor.drivers.channels import Channel
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal, sync_now
from firable.executor.journal.memory import HOSTS, remembered
from firable.executor.journal.sqlite_journal import SqliteJournal, machines_of
from firable.executor.journal.takeover import take_over
from firable.executor.links.link import COORDINATOR
from firable.executor.links.storages import Memory, Met, Storage
from firable.executor.operating.acquaintances import Acquaintances
from firable.executor.operating.dispatch import TAKEN
from firable.executor.operating.host import Host
from firable.executor.operating.taken_up import opened
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import EPOCH_BITS, Keep, Stored, VoteRequest
from firable.nets.bundle import read_bundle
from firable.nets.catalogue import catalogue_path
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.text import parse_net
from firable.nets.writing import write_whole
from firable.semantics.joining import join
from firable.semantics.replaying import replay
from firable.semantics.trace import Start, read_trace

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
OTHER_COMMAND = OLD.replace("command: WORK", "command: GRIND")
MORE_COMMANDS = WITH_INSPECTION.replace("      worked_out:", "      worked_out: {send: {machine: R, command: SHOW}}")
OTHER_NAME = OLD.replace("working", "at_work")


def cell(text: str) -> Decomposition:
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
    machines = [LocalController.restored(decomposition, s.name, kept[s.name]) for s in decomposition.subnets]
    assert all(machine.held for machine in machines)
    return {name for machine in machines for name in machine.subnet.names(machine.marking)}


def reasons(error: InputError) -> str:
    assert {diagnostic.code for diagnostic in error.diagnostics} == {"F5050"}
    return "\n".join(diagnostic.message for diagnostic in error.diagnostics)


def test_the_marking_is_taken_over_by_the_names_of_its_places_and_all_are_held() -> None:
    old, new = cell(OLD), cell(WITH_INSPECTION)
    marking = {"robot.worked_out", "table.full"}
    moved = take_over(old, new, kept_in(marking, old), [COORDINATOR])
    assert set(moved.marking) == marking
    assert joint_marking(new, moved.kept) == marking


def test_nothing_said_under_the_old_net_is_new_under_the_new_one() -> None:
    old, new = cell(OLD), cell(WITH_INSPECTION)
    moved = take_over(old, new, kept_in({"robot.free", "table.empty"}, old), [COORDINATOR])
    coordinator = Coordinator.restored(new, moved.kept[COORDINATOR])
    robot = LocalController.restored(new, "robot", moved.kept["robot"])
    assert coordinator.next_round >= robot.above[COORDINATOR].closed_below > (4 << EPOCH_BITS)
    assert robot.epoch > 4
    late = VoteRequest("robot", (4 << EPOCH_BITS) + 17, ("begin",), 0, 0)
    assert not any(isinstance(effect, Keep) and effect.key.startswith("promise") for effect in robot.receive(late))


def test_a_command_under_way_keeps_its_number_and_is_asked_after() -> None:
    old, new = cell(OLD), cell(WITH_INSPECTION)
    under_way: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "issued")}
    moved = take_over(old, new, kept_in({"robot.working", "table.full"}, old, robot=under_way), [COORDINATOR])
    robot = LocalController.restored(new, "robot", moved.kept["robot"])
    assert moved.under_way == ("robot.working",)
    assert robot.commands.questions == (("robot.working", 7),)
    assert robot.read("robot.worked", value=True, entry=6) == []


def test_the_number_of_a_command_that_is_over_goes_on() -> None:
    old, new = cell(OLD), cell(WITH_INSPECTION)
    over: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "over")}
    moved = take_over(old, new, kept_in({"robot.free", "table.empty"}, old, robot=over), [COORDINATOR])
    robot = LocalController.restored(new, "robot", moved.kept["robot"])
    assert robot.commands.entry("robot.worked") == 7
    assert not robot.commands.questions


@pytest.mark.parametrize(
    ("text", "marking", "more", "reason"),
    [
        (OTHER_NAME, {"robot.working", "table.full"}, {}, "the new net has no place of that name"),
        (OTHER_COMMAND, {"robot.working", "table.full"}, {}, "sends another command"),
        (WITH_INSPECTION, {"robot.free", "table.empty"}, {"robot": {"promise/3": ("begin",)}}, "has promised"),
        (WITH_INSPECTION, {"robot.free", "table.empty"}, {COORDINATOR: {"round/3": ("begin",)}}, "not everybody"),
        (
            WITH_INSPECTION,
            {"robot.worked_out", "table.full"},
            {"robot": {"command/signal/robot.worked": ("robot.working", 7, "issued")}},
            "its token has gone on",
        ),
    ],
)
def test_what_cannot_be_carried_over_is_refused(
    text: str, marking: set[str], more: dict[str, dict[str, Stored]], reason: str
) -> None:
    old = cell(OLD)
    with pytest.raises(InputError) as caught:
        take_over(old, cell(text), kept_in(marking, old, **more), [COORDINATOR])
    assert reason in reasons(caught.value)


def test_a_command_under_way_is_not_carried_to_a_net_in_which_its_machine_would_not_know_its_number() -> None:
    """The channel of a machine numbers its commands by the places that send any."""
    old, new = cell(OLD), cell(MORE_COMMANDS)
    record: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "issued")}
    numbers = []
    for net in (old.net, new.net):
        document = ChannelDocument(number="holding 1", taken="input 1", done="input 2")
        channel = Channel(document, [place.name for place in net.places if place.command], frozenset())
        numbers.append(channel.number("robot.working", 7))
    assert numbers[0] != numbers[1]
    marking = {"robot.working", "table.full"}
    with pytest.raises(InputError) as caught:
        take_over(old, new, kept_in(marking, old, robot=record), [COORDINATOR])
    assert "'R' is commanded by other places in the new net" in reasons(caught.value)
    over: dict[str, Stored] = {"command/signal/robot.worked": ("robot.working", 7, "over")}
    assert set(take_over(old, new, kept_in(marking, old, robot=over), [COORDINATOR]).marking) == marking


def test_a_place_that_is_renamed_is_no_matter_while_it_is_empty() -> None:
    old, new = cell(OLD), cell(OTHER_NAME)
    moved = take_over(old, new, kept_in({"robot.free", "table.empty"}, old), [COORDINATOR])
    assert joint_marking(new, moved.kept) == {"robot.free", "table.empty"}


def test_all_reasons_are_told_together() -> None:
    old = cell(OLD)
    kept = kept_in({"robot.working", "table.full"}, old, robot={"promise/3": ("begin",)})
    with pytest.raises(InputError) as caught:
        take_over(old, cell(OTHER_NAME), kept, [COORDINATOR])
    assert len(caught.value.diagnostics) == 2


def bundle(folder: Path, name: str, text: str) -> Path:
    net, made = folder / f"{name}.firable.yaml", folder / f"{name}.bundle"
    net.write_text(text)
    assert main(["bundle", str(net), "-o", str(made)]) == 0
    return made


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("bundles")
    return bundle(folder, "old", OLD), bundle(folder, "new", WITH_INSPECTION)


def journal(path: Path, of: Path, marking: set[str], machines: tuple[str, ...] = ()) -> Path:
    """The journal of a whole cell, or of the host of some of its machines."""
    read = read_bundle(of)
    kept = kept_in(marking, read.decomposition)
    kept = {machine: records for machine, records in kept.items() if not machines or machine in machines}
    written = SqliteJournal(path, read.digest, kept)
    for machine, records in kept.items():
        written.write(machine, [Keep(key, value) for key, value in records.items()])
    sync_now(written)
    written.close()
    return path


def test_the_command_writes_a_journal_that_the_new_bundle_opens(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = bundles
    before = journal(tmp_path / "old.journal", old, {"robot.worked_out", "table.full"})
    content, into = before.read_bytes(), tmp_path / "new.journal"
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 0
    assert "robot.worked_out, table.full" in capsys.readouterr().out
    assert before.read_bytes() == content
    read = read_bundle(new)
    opened = SqliteJournal(into, read.digest, [COORDINATOR, *(s.name for s in read.decomposition.subnets)])
    kept = {s.name: dict(opened.kept(s.name)) for s in read.decomposition.subnets}
    opened.close()
    assert joint_marking(read.decomposition, kept) == {"robot.worked_out", "table.full"}


def test_a_marking_that_the_new_net_never_reaches_is_refused_and_nothing_written(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = bundles
    before, into = journal(tmp_path / "old.journal", old, {"robot.free", "table.full"}), tmp_path / "new.journal"
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 2
    said = capsys.readouterr().err
    assert "error[F5051]: 'cell' never comes into the marking robot.free, table.full, so nothing is proved of" in said
    assert "which the old net has not" not in said
    assert not into.exists()


def test_a_place_of_the_new_net_alone_that_begins_with_a_token_is_named_where_its_token_is_missing(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with_light = OLD.replace("start: empty", "start: [empty, light]").replace(
        "      full:\n", "      full:\n      light:\n"
    )
    with_light = with_light.replace("[robot.free, table.empty], to", "[robot.free, table.empty, table.light], to")
    with_light = with_light.replace("to: [robot.free, table.empty]", "to: [robot.free, table.empty, table.light]")
    old, new = bundles[0], bundle(tmp_path, "light", with_light)
    capsys.readouterr()
    before, into = journal(tmp_path / "old.journal", old, {"robot.free", "table.empty"}), tmp_path / "new.journal"
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 2
    said = capsys.readouterr().err
    assert "table.light, which the old net has not, begins with a token and would have none" in said
    assert "a marking that both nets reach: in the new net with no token on table.light; where there is none" in said
    assert not into.exists()
    meanwhile = journal(tmp_path / "later.journal", old, {"robot.worked_out", "table.full"})
    assert main(["takeover", str(old), str(new), "--journal", str(meanwhile), "--into", str(into)]) == 0


def test_files_that_stand_in_the_way_or_are_missing_are_told_of(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = bundles
    missing, into = tmp_path / "none.journal", tmp_path / "new.journal"
    assert main(["takeover", str(old), str(new), "--journal", str(missing), "--into", str(into)]) == 2
    assert "F1001" in capsys.readouterr().err
    assert not missing.exists(), "a journal is not made by looking for one"
    before = journal(tmp_path / "old.journal", old, {"robot.free", "table.empty"})
    into.write_text("precious")
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 2
    assert "F1017" in capsys.readouterr().err
    assert into.read_text() == "precious"
    into.unlink()
    assert main(["takeover", str(new), str(old), "--journal", str(before), "--into", str(into)]) == 2
    assert "F5031" in capsys.readouterr().err


def test_nobody_runs_the_old_bundle_on_while_it_is_taken_over(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new = bundles
    before = journal(tmp_path / "old.journal", old, {"robot.free", "table.empty"})
    names = [COORDINATOR, *(subnet.name for subnet in read_bundle(old).decomposition.subnets)]
    command = ["takeover", str(old), str(new), "--journal", str(before), "--into", str(tmp_path / "new.journal")]
    alive = SqliteJournal(before, read_bundle(old).digest, names)
    assert main(command) == 2
    assert "error[F5033]" in capsys.readouterr().err
    assert not (tmp_path / "new.journal").exists()
    alive.close()
    refused: list[str] = []

    def deciding(*_: object) -> None:
        with pytest.raises(InputError) as caught:
            SqliteJournal(before, read_bundle(old).digest, names)
        refused.append(caught.value.diagnostics[0].code)

    monkeypatch.setattr(cli_takeover, "_demand_reachable", deciding)
    assert main(command) == 0
    assert refused == ["F5033"]


def test_a_run_on_the_simulated_cell_goes_on_under_the_new_bundle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = catalogue_path("one_robot").read_text("utf-8")
    old = bundle(tmp_path, "old", text)
    new = bundle(tmp_path, "new", text.replace("program: O0001", "program: O0002"))
    renamed = bundle(tmp_path, "renamed", text.replace("machining", "milling"))
    plant = ("--plant", "catalogue:one_robot", "--workpieces", "1")
    before, after, other = (str(tmp_path / name) for name in ("before", "after", "other"))
    assert main(["run", str(old), *plant, "--journal", before]) == 0
    assert main(["takeover", str(old), str(new), "--journal", before, "--into", after]) == 0
    assert main(["run", str(new), *plant, "--journal", after]) == 3  # held
    assert main(["run", str(new), *plant, "--journal", after, "--resume"]) == 0
    assert main(["takeover", str(old), str(renamed), "--journal", before, "--into", other]) == 0
    assert main(["run", str(renamed), *plant, "--journal", other]) == 2
    assert "which is no place" in capsys.readouterr().err
    Path(f"{after}.cell").unlink()
    assert main(["run", str(new), *plant, "--journal", after]) == 2
    assert "empty or gone" in capsys.readouterr().err


def test_the_trace_of_a_run_that_has_taken_a_cell_over_begins_there_and_is_judged_from_there(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = bundles
    before = journal(tmp_path / "old.journal", old, {"robot.working", "table.full"})
    with closing(SqliteJournal(before, read_bundle(old).digest, machines_of(before))) as owing:
        owing.write("robot", [Keep("command/signal/robot.worked", ("robot.working", 7, "owed"))])
        sync_now(owing)
    after, trace = tmp_path / "new.journal", tmp_path / "new.trace"
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(after)]) == 0
    read = read_bundle(new)

    async def for_some_seconds() -> None:
        with opened(read.decomposition, read.digest, after, trace) as files:
            driver = DryRunDriver(read.decomposition.subnets, 1.0)
            run = Host(
                read.decomposition,
                driver,
                files.recorder,
                journal=files.journal,
                begin_seconds=files.begin_seconds,
                resume=True,
            )
            ending = asyncio.create_task(run.main())
            await asyncio.sleep(3.5)
            run.stop()
            await ending

    for firings in (7, 14):  # the second goes on in the trace of the first
        run_in_virtual_time(for_some_seconds())
        told = read_trace(trace)
        assert told.header.start == Start(("robot.working", "table.full"), (), ("robot.working",))
        done = replay(read.net, told)
        assert done.complete
        assert done.firings >= firings
    capsys.readouterr()
    assert main(["replay", str(trace), "--net", str(new)]) == 0
    assert "from the marking that was taken over: robot.working, table.full" in capsys.readouterr().out
    assert main(["timeline", str(trace), "--net", str(new), "-o", str(tmp_path / "t.svg")]) == 0
    assert main(["draw", str(new), "--what", "strip", "--trace", str(trace), "-o", str(tmp_path / "s.svg")]) == 0


def test_the_traces_of_hosts_that_were_taken_over_join_and_not_with_one_that_was_not(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(4.6)
        await cell.stop()
        begun = read_trace(cell.path(("robot",)))
        kept = {name: of.kept(name) for machines, of in cell.journals.items() for name in machines}
        moved = take_over(cell.decomposition, cell.decomposition, kept, [COORDINATOR])
        assert set(moved.marking) != set(cell.net.names(cell.net.initial_marking))
        for machines in cell.journals:
            cell.journals[machines] = MemoryJournal()
            for name in machines:
                cell.journals[machines].write(name, [Keep(key, value) for key, value in moved.kept[name].items()])
            cell.start(machines, resume=True)
        await asyncio.sleep(30)
        await cell.stop()
        assert cell.replayed().firings > 10
        traces = [read_trace(cell.path(machines)) for machines in cell.hosts]
        mixed = [begun if trace.header.machines == ("robot",) else trace for trace in traces]
        with pytest.raises(InputError, match="begins where a cell was taken over, and another in the initial marking"):
            join(cell.net, mixed)

    run_in_virtual_time(main())


HOSTS_OF_OLD = {"system": (COORDINATOR, "line"), "robot": ("robot",), "table": ("table",)}


def hosts(bundles: tuple[Path, Path], folder: Path, *without: str) -> list[str]:
    """The options of a takeover on several hosts, at the end of the robot's work."""
    options = []
    for name, machines in HOSTS_OF_OLD.items():
        if name not in without:
            at = journal(folder / f"{name}.old", bundles[0], {"robot.worked_out", "table.full"}, machines)
            options += ["--journal", str(at), "--into", str(folder / f"{name}.new")]
    return options


def test_a_cell_on_several_hosts_is_taken_over_together_and_its_hosts_know_each_other(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["takeover", *map(str, bundles), *hosts(bundles, tmp_path)]) == 0
    told = capsys.readouterr().out
    assert f"  next: firable run {bundles[1]} --controller robot --journal {tmp_path / 'robot.new'}, with" in told
    read = read_bundle(bundles[1])
    kept, memories = dict[str, Mapping[str, Stored]](), dict[str, Memory]()
    for name, machines in HOSTS_OF_OLD.items():
        with closing(SqliteJournal(tmp_path / f"{name}.new", read.digest, machines)) as opened:
            kept |= {machine: opened.kept(machine) for machine in machines}
            memories[name] = remembered(opened.kept(HOSTS), opened.age)
    assert joint_marking(read.decomposition, kept) == {"robot.worked_out", "table.full"}
    storages = {
        machine: Met(memories[name].storage.name) for name, machines in HOSTS_OF_OLD.items() for machine in machines
    }
    assert len(set(storages.values())) == len(HOSTS_OF_OLD)
    for name, machines in HOSTS_OF_OLD.items():
        assert memories[name].known == {of: storage for of, storage in storages.items() if of not in machines}


def test_of_several_hosts_one_with_an_older_copy_of_its_journal_is_not_taken_over(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options, digest = hosts(bundles, tmp_path), read_bundle(bundles[0]).digest

    def remembers(name: str, age: int) -> None:
        """The journal of the line was let in by the robot's, which has heard of it at this age since."""
        with closing(SqliteJournal(tmp_path / "system.old", digest, HOSTS_OF_OLD["system"])) as of_line:
            line = Acquaintances(of_line, is_linked=True)
            line.met("robot", Storage(name))
            line.write()
            sync_now(of_line)
            with closing(SqliteJournal(tmp_path / "robot.old", digest, HOSTS_OF_OLD["robot"])) as of_robot:
                robot = Acquaintances(of_robot, is_linked=True)
                robot.met("line", line.storage)
                robot.heard("line", of_line.age + age)
                robot.write()
                sync_now(of_robot)
                name = robot.storage.name
            line.known["robot"] = Met(name)
            line.write()
            sync_now(of_line)

    remembers("", 7)
    assert main(["takeover", *map(str, bundles), *options]) == 2
    told = capsys.readouterr().err
    older = f"{tmp_path}/system.old: the journal is an older copy: it does not hold what {tmp_path}/robot.old knows of"
    assert f"error[F5050]: {older} 'line'" in told
    assert not list(tmp_path.glob("*.new*"))
    remembers("", 1)
    assert main(["takeover", *map(str, bundles), *options]) == 0


def test_a_takeover_of_several_hosts_that_fails_leaves_none_of_its_journals(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = hosts(bundles, tmp_path)
    last = options[-1]
    options[-1] = str(tmp_path / "no folder" / "table.new")
    assert main(["takeover", *map(str, bundles), *options]) == 2
    assert "error[F1017]: " in capsys.readouterr().err
    assert not list(tmp_path.glob("*.new*"))
    assert main(["takeover", *map(str, bundles), *options[:-1], last]) == 0


def test_what_a_machine_has_taken_is_taken_over(bundles: tuple[Path, Path], tmp_path: Path) -> None:
    options = hosts(bundles, tmp_path)
    with closing(SqliteJournal(tmp_path / "robot.old", read_bundle(bundles[0]).digest, ("robot",))) as of_robot:
        of_robot.write(TAKEN, [Keep("robot.working", 3)])
        sync_now(of_robot)
    assert main(["takeover", *map(str, bundles), *options]) == 0
    with closing(SqliteJournal(tmp_path / "robot.new", read_bundle(bundles[1]).digest, ("robot",))) as of_robot:
        assert of_robot.kept(TAKEN) == {"robot.working": 3}


def test_a_marking_is_taken_over_whole_from_one_journal_for_each_machine(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    takeover = ["takeover", *map(str, bundles)]
    assert main([*takeover, *hosts(bundles, tmp_path, "table")]) == 2
    told = capsys.readouterr().err
    assert told.count("error[") == 1
    assert "error[F5050]: none of the journals is of 'table'" in told
    again = journal(tmp_path / "again.old", bundles[0], {"robot.free"}, ("robot",))
    twice = ["--journal", str(again), "--into", str(tmp_path / "again.new")]
    assert main([*takeover, *hosts(bundles, tmp_path), *twice]) == 2
    assert "error[F5050]: 'robot' is in 2 journals: " in capsys.readouterr().err
    assert main([*takeover, *hosts(bundles, tmp_path), "--journal", str(again)]) == 2
    assert "name a file --into for each --journal" in capsys.readouterr().err
    same = hosts(bundles, tmp_path)
    same[-1] = same[-5]
    assert main([*takeover, *same]) == 2
    assert "two journals would be written there" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.new*"))


def test_a_journal_is_named_once_however_it_is_spelled(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    takeover = ["takeover", *map(str, bundles)]
    whole = str(journal(tmp_path / "whole", bundles[0], {"robot.worked_out", "table.full"}))
    assert (
        main([*takeover, "--journal", whole, "--into", f"{whole}.1", "--journal", whole, "--into", f"{whole}.2"]) == 2
    )
    assert "error[F5050]: " in (said := capsys.readouterr().err)
    assert "the journal is named twice" in said
    same = hosts(bundles, tmp_path)
    (tmp_path / "folder").mkdir()
    same[-1] = str(tmp_path / "folder" / ".." / "robot.new")
    assert main([*takeover, *same]) == 2
    assert "two journals would be written there" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.new*"))


def test_what_a_killed_run_has_left_of_its_journal_is_not_taken_for_the_end_of_the_new_one(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = journal(tmp_path / "whole", bundles[0], {"robot.worked_out", "table.full"})
    new = tmp_path / "new"
    takeover = ["takeover", *map(str, bundles), "--journal", str(whole), "--into", str(new)]
    assert main(takeover) == 0
    names = (COORDINATOR, "line", "robot", "table")
    with closing(SqliteJournal(new, read_bundle(bundles[1]).digest, names)) as running:
        running.write("robot", [Keep("word", "1")])
        sync_now(running)
        left = Path(f"{new}-wal").read_bytes()  # it is killed here
    for file in (new, Path(f"{new}.generation")):
        file.unlink()
    Path(f"{new}-wal").write_bytes(left)
    assert main(takeover) == 2
    assert f"error[F1017]: {new}-wal: what an earlier journal of that name has left" in capsys.readouterr().err
    assert not new.exists()


def coordinators_of(bundles: tuple[Path, Path], folder: Path) -> dict[str, tuple[str, ...]]:
    """The machines of the journals of the hosts of the new cell, as a run of each opens them."""
    read = read_bundle(bundles[1])
    found = {}
    for name in HOSTS_OF_OLD:
        machines = machines_of(folder / f"{name}.new")
        with closing(SqliteJournal(folder / f"{name}.new", read.digest, machines)):
            found[name] = machines
    return found


def test_the_coordinator_goes_to_the_host_where_the_new_net_has_it(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = OLD.replace("line: {coordinator: true, places: {}}", "line: {places: {}}")
    other = other.replace("  robot:\n", "  robot:\n    coordinator: true\n")
    new = (bundles[0], bundle(tmp_path, "other", other))
    assert main(["takeover", *map(str, new), *hosts(new, tmp_path)]) == 0
    assert coordinators_of(new, tmp_path) == {"system": ("line",), "robot": ("", "robot"), "table": ("table",)}
    assert "--coordinator" not in capsys.readouterr().out
    folder = tmp_path / "nobody"
    folder.mkdir()
    nobody = (bundles[0], bundle(folder, "nobody", OLD.replace("line: {coordinator: true, ", "line: {")))
    assert main(["takeover", *map(str, nobody), *hosts(nobody, folder)]) == 0
    assert coordinators_of(nobody, folder) == {"system": ("", "line"), "robot": ("robot",), "table": ("table",)}
    told = capsys.readouterr().out
    assert f"firable run {nobody[1]} --controller line --coordinator --journal {folder / 'system.new'}, with" in told
    assert f"firable run {nobody[1]} --controller robot --journal {folder / 'robot.new'}, with" in told


def test_a_controller_that_only_the_new_net_has_needs_a_host(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = OLD.replace("transitions:", "  lamp: {start: dark, places: {dark: , lit: }}\ntransitions:")
    more += "  light: {from: lamp.dark, to: lamp.lit}\n  darken: {from: lamp.lit, to: lamp.dark}\n"
    new = bundle(tmp_path, "more", more)
    assert main(["takeover", str(bundles[0]), str(new), *hosts(bundles, tmp_path)]) == 2
    assert "error[F5050]: no host runs 'lamp', which only the new net has" in capsys.readouterr().err


def test_a_host_of_which_the_new_net_has_nothing_has_no_journal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = bundle(tmp_path, "old", OLD.replace("  table:\n", "  spare: {places: {}}\n  table:\n"))
    new = bundle(tmp_path, "new", OLD)
    of_spare = journal(tmp_path / "spare.old", old, set(), ("spare",))
    options = [*hosts((old, new), tmp_path), "--journal", str(of_spare), "--into", str(tmp_path / "spare.new")]
    assert main(["takeover", str(old), str(new), *options]) == 0
    assert "spare.new is not written: 'cell' has none of the machines of that host" in capsys.readouterr().out
    assert (tmp_path / "robot.new").exists()
    assert not (tmp_path / "spare.new").exists()


def test_a_takeover_that_breaks_off_leaves_no_journal_that_begins_anew(
    bundles: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    written: list[str] = []

    def breaking(path: Path | str, data: bytes | str) -> None:
        if len(written) == at:
            raise KeyboardInterrupt
        written.append(str(path))
        write_whole(path, data)

    monkeypatch.setattr("firable.nets.writing.write_whole", breaking)
    for at in range(6):
        folder = tmp_path / str(at)
        folder.mkdir()
        written.clear()
        assert main(["takeover", *map(str, bundles), *hosts(bundles, folder)]) == 3
        capsys.readouterr()
        for name, machines in HOSTS_OF_OLD.items():
            new = folder / f"{name}.new"
            if new.exists():
                with closing(SqliteJournal(new, read_bundle(bundles[1]).digest, machines)) as opened:
                    assert all(opened.kept(machine) for machine in machines)
            elif Path(f"{new}.generation").exists():
                with pytest.raises(InputError, match="F5032"):
                    SqliteJournal(new, read_bundle(bundles[1]).digest, machines)
