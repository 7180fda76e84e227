"""A run does not go on at machines that are elsewhere than its journal has them, before a person has said so."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Awaitable, Callable
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from support.served_cells import DECOMPOSITION, NET, Served, served
from support.takeovers import OLD, journal, old_and_new
from support.third_party_driver import MemoryEnd

from firable.cli.main import main
from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers import kinds
from firable.executor.drivers.bench import until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.device import Point, Value
from firable.executor.journal.journal import Journal, MemoryJournal, sync_now
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting
from firable.executor.operating import hosting
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.hosting import own_net, run_host
from firable.executor.operating.recorder import KEY, TRACE, Recorder
from firable.executor.operating.restart import uncertain
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.taken_up import opened
from firable.executor.operating.whereabouts import AT, MACHINES, Elsewhere, elsewhere, machines_at
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.messages import Keep
from firable.nets.bundle import read_bundle
from firable.nets.interchange import net_digest
from firable.nets.text import parse_net

MOVED = Elsewhere({"A": ("theirs there", "theirs here")}, {"A": "theirs here"})


# What is compared


def bound(devices: str, *, channel: str = "number: n, done: d", at: str = "D") -> dict[str, str]:
    text = (
        f"firable_bind: 1\ncell: cell\ndevices:\n  {at}: {{{devices}, channels: {{R: {{{channel}}}}}}}\n"
        f"signals: {{robot.worked: acknowledged}}\ncommands: {{robot.working: {{device: {at}, channel: R}}}}\n"
    )
    return machines_at(parse_binding(text), parse_net(OLD))


def test_a_machine_is_at_the_far_end_of_its_device_however_that_is_called_and_spoken_with() -> None:
    registers = "number: holding 1, done: input 1"
    tcp = partial(bound, channel=registers)
    at = {"R": "modbus-tcp plc.cell:502 unit 1"}
    assert tcp("driver: modbus-tcp, host: plc.cell") == at
    assert tcp("driver: modbus-tcp, host: PLC.cell., every_s: 1, timeout_s: 3", at="renamed") == at
    assert tcp("driver: modbus-tcp, host: plc.cell, port: 503, unit: 2") == {"R": "modbus-tcp plc.cell:503 unit 2"}
    assert tcp("driver: modbus-rtu, port: /dev/ttyS0") == {"R": "modbus-rtu /dev/ttyS0 unit 1"}
    assert bound("driver: serial, port: /dev/ttyS0") == {"R": "serial /dev/ttyS0"}


def test_servers_that_share_a_port_are_told_apart_by_their_paths() -> None:
    """As the path comes with the first message, a listener can have a server for each."""

    def at(rest: str) -> dict[str, str]:
        return bound(f"driver: opcua, url: 'opc.tcp://{rest}'", channel="number: ns=2;s=n, done: ns=2;s=d")

    assert at("plc:4840/left") == at("PLC.:4840/left") == {"R": "opcua plc:4840/left"}
    assert at("plc:4840/right") == {"R": "opcua plc:4840/right"}
    assert at("plc:4840") == at("me:word@plc:4840/") == {"R": "opcua plc:4840"}


def test_a_machine_behind_a_broker_is_at_the_topic_of_its_commands() -> None:
    broker = "driver: mqtt, host: broker, user: cell, password: secret"
    assert bound(broker, channel="number: cell/r/n, done: d") == {"R": "mqtt broker:1883 cell/r/n"}
    assert bound(broker, channel="number: trial/r/n, done: d") == {"R": "mqtt broker:1883 trial/r/n"}


def test_where_a_kind_of_device_has_no_far_end_its_name_is_all() -> None:
    assert bound("driver: simulated, seconds: 2", channel="command: r, done: r.done") == {"R": "simulated"}


def test_what_has_moved_is_told_together_and_what_nobody_has_kept_has_not_moved() -> None:
    now = {"A": "serial x", "B": "serial x", "C": "serial z", "D": "simulated"}
    assert elsewhere(None, now) is None
    assert elsewhere({"A": "serial x", "E": "serial e"}, now) is None
    found = elsewhere({"A": "serial y", "B": "serial y", "C": "serial z", "D": "serial d"}, now)
    assert found is not None
    assert found.moved == {
        "A": ("serial y", "serial x"),
        "B": ("serial y", "serial x"),
        "D": ("serial d", "simulated"),
    }
    assert found.now == now
    assert found.sentences() == (
        "the journal has A, B at serial y, the binding at serial x",
        "the journal has D at serial d, the binding at simulated",
    )


def test_machines_that_have_changed_places_have_moved() -> None:
    found = elsewhere({"A": "serial x", "B": "serial y"}, {"A": "serial y", "B": "serial x"})
    assert found is not None
    assert set(found.moved) == {"A", "B"}


# On real sockets


async def executed(
    one: Served,
    kept: Path,
    operator: Callable[[Host], Awaitable[None]] | None = None,
    said: list[str] | None = None,
    *,
    resume: bool = False,
) -> tuple[Situation, Host]:
    """Run the net on a served cell, as `firable run --bind` does."""
    driver = bound_driver(one.binding, NET)
    tell = (said if said is not None else []).append
    conduct = Conduct(operator=operator, resume=resume, tell=lambda kind, sentence: tell(f"{kind}: {sentence}"))
    with opened(DECOMPOSITION, "digest", kept, None, at=machines_at(driver.binding, NET)) as files:
        host = Host(DECOMPOSITION, driver, files.recorder, conduct, journal=files.journal, elsewhere=files.elsewhere)
        return await host.main(), host


def test_the_real_machines_get_no_command_that_a_trial_on_sockets_has_left(tmp_path: Path) -> None:
    kept = tmp_path / "journal"

    async def main() -> None:
        async with served(1) as trial, served(1) as real:
            was, now = (machines_at(one.binding, NET) for one in (trial, real))
            assert was.keys() == now.keys()
            assert all(was[machine] != now[machine] for machine in now)

            async def at_work(host: Host) -> None:
                await until(lambda: trial.cell.at, "a machine at work")
                host.stop()

            situation, _ = await executed(trial, kept, at_work)
            assert situation.state is State.STOPPED
            said: list[str] = []
            situation, host = await executed(real, kept, said=said, resume=True)
            assert (situation.state, situation.is_held) == (State.HELD, True)
            (told,) = [sentence for sentence in said if sentence.startswith("held: ")]
            for text in (told, situation.message):
                assert all(f" at {was[machine]}, the binding at {now[machine]}" in text for machine in now)
                assert "--resume does not count: if they are the same machines, start with --serve or --step" in text
            assert host.recorder.commands == 0
            assert not real.cell.at

            async def theirs(host: Host) -> None:
                await until(lambda: host.taking_up is not None and host.elsewhere is not None, "the hold")
                assert "if they are the same machines, resume" in host.situation().message
                await asyncio.sleep(0.2)
                assert host.recorder.commands == 0, "--resume does not count, also where somebody is there"
                assert host.resume()
                await until(lambda: host.taking_up is None or host.taking_up.is_final, "the answers of the machines")
                for place in uncertain(host):
                    assert not host.say(place, Answer.NOT_RECEIVED)
                host.resume()
                await until(lambda: real.cell.at, "a machine at work")
                host.stop()

            situation, _ = await executed(real, kept, theirs, resume=True)
            assert situation.state is State.STOPPED
            with opened(DECOMPOSITION, "digest", kept, None, at=now) as files:
                assert files.elsewhere is None, "the next start is as usual"
            with opened(DECOMPOSITION, "digest", kept, None, at=was) as files:
                assert files.elsewhere is not None, "and the trial is elsewhere now"

    asyncio.run(main())


# Until somebody has said that these are the machines

TWO = parse_net("""
firable: 1
cell: c
controllers:
  a: {start: free, places: {free: , busy: {send: {machine: A, command: WORK}, until: done}, gone: }}
transitions:
  begin: {from: a.free, to: a.busy}
  end: {from: a.busy, to: a.gone}
""")
THEIRS = """
firable_bind: 1
cell: c
devices: {A: {driver: theirs, memory: A, channels: {A: {number: number, taken: taken, done: done}}}}
signals: {a.done: acknowledged}
commands: {a.busy: {device: A, channel: A, write: {code: 1}}}
"""


@pytest.fixture
def theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)]
    monkeypatch.setattr(kinds, "entry_points", lambda **_: found)


def host(kept: Journal, trace: io.StringIO, *, moved: Elsewhere | None = MOVED, resume: bool = True) -> Host:
    recorder = Recorder(TWO, net_digest(TWO), trace, kept.kept(TRACE).get(KEY))
    conduct = Conduct(resume=resume, said={"a.busy": Answer.DONE})
    binding = parse_binding(THEIRS)
    return Host(
        split(TWO),
        bound_driver(binding, TWO),
        recorder,
        conduct,
        journal=kept,
        latched=partial(bound_driver, binding, TWO, latched=True),
        elsewhere=moved,
    )


async def interrupted() -> tuple[MemoryEnd, Journal]:
    """The machine, which is done by now, and the journal of a run that was ended while it was busy."""
    end, kept, written = MemoryEnd("A"), MemoryJournal(), dict[Point, Value]()
    end.values.update({"taken": 0, "done": 0})
    await end.start(written.__setitem__)
    run = host(kept, io.StringIO(), moved=None)
    ending = asyncio.create_task(run.main())
    await asyncio.sleep(2)
    assert run.marking == ("a.busy",)
    run.stop()
    await ending
    end.values.update(dict.fromkeys(("taken", "done"), written["number"]))
    return end, kept


def test_what_machines_elsewhere_say_of_a_command_is_not_asked(theirs: None) -> None:
    """Their numbers may be those of the commands, and done: that would be taken for ever."""

    async def main() -> None:
        _, kept = await interrupted()
        before, trace = kept.kept("a"), io.StringIO()
        ended = await host(kept, trace).main()
        assert (ended.state, ended.marking) == (State.HELD, ("a.busy",))
        assert "the journal has A at theirs there, the binding at theirs here; --resume does not count" in ended.message
        assert "asked after" not in trace.getvalue()
        assert {**kept.kept("a"), "epoch": 0} == before, "every start is an epoch of its own"
        assert AT not in kept.kept(MACHINES), "nobody has said that these are the machines"
        assert (await host(kept, io.StringIO(), moved=None).main()).marking == ("a.gone",), "and else it goes on"

    run_in_virtual_time(main())


@pytest.mark.parametrize("is_latched_before", [False, True])
def test_an_operator_says_that_these_are_the_machines_and_then_they_are_asked(
    theirs: None, is_latched_before: bool
) -> None:
    async def main() -> None:
        end, kept = await interrupted()
        end.values.update({"taken": "?", "done": "?"})
        trace = io.StringIO()
        run = host(kept, trace)
        run.served = True
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(2)
        if is_latched_before:
            run.emergency_stop("a person")
            await asyncio.sleep(2)
            assert not run.resume()
            assert run.reset() == ()
            await asyncio.sleep(2)
        held = run.situation()
        assert held.state is State.HELD
        assert held.message.endswith(
            "theirs here; if they are the same machines, resume; if not, stop and name another journal"
        )
        assert run.say("a.busy", Answer.DONE) == ("nobody asks after a.busy",)
        assert run.resume()
        assert kept.kept(MACHINES)[AT] == {"A": "theirs here"}
        await asyncio.sleep(10)
        assert "look at the machine and say what it did" in run.situation().message, "what was said beforehand is void"
        assert not run.resume()
        assert not run.say("a.busy", Answer.DONE)
        assert run.resume()
        ended = await ending
        assert ended.marking == ("a.gone",)
        assert trace.getvalue().count("the journal has A at theirs there") == 1 + is_latched_before
        assert trace.getvalue().index('"found again"') < trace.getvalue().index('"asked after"')

    run_in_virtual_time(main())


def test_a_run_goes_on_by_itself_once_somebody_has_resumed_it_and_its_machines_can_tell(theirs: None) -> None:
    async def main() -> None:
        _, kept = await interrupted()
        run = host(kept, io.StringIO())
        run.served = True
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(2)
        assert run.resume()
        assert (await ending).marking == ("a.gone",)

    run_in_virtual_time(main())


# Which runs compare

BOUND = """firable_bind: 1
cell: cell
devices:
  plc:
    driver: modbus-tcp
    host: 127.0.0.1
    port: 9
    start_s: 0.1
    channels: {R: {number: holding 1, done: input 1}}
signals: {robot.worked: acknowledged}
commands: {robot.working: {device: plc, channel: R, write: {holding 2: 1}}}
"""
ELSEWHERE = BOUND.replace("port: 9", "port: 10")
SENTENCE = "the journal has R at modbus-tcp 127.0.0.1:9 unit 1, the binding at modbus-tcp 127.0.0.1:10 unit 1"
WORKING = {"line.free", "robot.working", "table.full"}


def at_home(path: Path, of: Path, *machines: str) -> Path:
    """A journal of the cell while the robot works, where its binding has it."""
    read = read_bundle(of)
    made = journal(path, of, WORKING, machines)
    names = machines or (COORDINATOR, *(subnet.name for subnet in read.decomposition.subnets))
    written = SqliteJournal(made, read.digest, names)
    written.write(MACHINES, [Keep(AT, machines_at(parse_binding(BOUND), read.net))])
    sync_now(written)
    written.close()
    return made


def test_a_run_at_another_address_is_held_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (old, new), binding = old_and_new(tmp_path), tmp_path / "cell.bind.yaml"
    kept, taken = at_home(tmp_path / "journal", old), tmp_path / "taken"
    log = tmp_path / "log"
    binding.write_text(ELSEWHERE)
    capsys.readouterr()
    run = ["run", "--bind", str(binding), "--resume", "--log", str(log)]
    for _ in range(2):  # until somebody has said that these are the machines
        assert main([*run, str(old), "--journal", str(kept)]) == 3
        assert SENTENCE in "".join(capsys.readouterr())
    told = [line for line in log.read_text().splitlines() if '"event": "held"' in line and SENTENCE in line]
    assert len(told) == 2
    assert main(["takeover", str(old), str(new), "--journal", str(kept), "--into", str(taken)]) == 0
    capsys.readouterr()
    assert main([*run, str(new), "--journal", str(taken), "--format", "json"]) == 3
    assert SENTENCE in capsys.readouterr().out


def test_a_host_among_others_compares_its_own_machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, _ = old_and_new(tmp_path)
    read, here = read_bundle(old), ("robot",)
    kept, found = at_home(tmp_path / "journal", old, *here), list[Elsewhere | None]()

    def seen(*_: object, elsewhere: Elsewhere | None, **__: object) -> Host:
        found.append(elsewhere)
        raise InterruptedError

    monkeypatch.setattr(hosting, "Host", seen)
    monkeypatch.setattr(hosting, "listen_first", lambda _: None)
    link = InProcessLink(Exchange(), Greeting(read.digest, here))
    for text in (BOUND, ELSEWHERE):
        drivers = partial(bound_driver, parse_binding(text), read.net, own_net(read.decomposition, here))
        with pytest.raises(InterruptedError):
            run_host(read, here, drivers, link, Conduct(journal_path=kept))
    assert found[0] is None
    assert found[1] is not None
    assert found[1].sentences() == (SENTENCE,)
