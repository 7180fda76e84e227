"""A run in real time that an operator acts on from another process."""

from __future__ import annotations

import json
import re
import resource
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from support.certificates import Site
from support.waiting import PATIENCE_SECONDS, until

from firable.cli.main import main
from firable.cli.operate import ServeOptions
from firable.executor.operating.control import new_token
from firable.nets.catalogue import catalogue_path
from firable.nets.diagnostics import InputError
from firable.semantics.trace import CommandSent, Noted, read_trace


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("operate") / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    return path


@pytest.fixture
def served(bundle: Path, tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str, Path]]:
    """A run of 50 workpieces, which would take minutes; its address and its folder."""
    # On a busy machine the simulated cell is late, which the monitor may tell.
    arguments = ["--speed", "1", "--workpieces", "50", "--serve", "127.0.0.1:0", "--format", "json"]
    arguments += ["--watch", "ignore"]
    files = ["--token-file", str(tmp_path / "token"), "--trace", str(tmp_path / "run.trace")]
    process = subprocess.Popen(
        [sys.executable, "-m", "firable.cli", "run", str(bundle), *arguments, *files],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        told = re.search(r"http://\S+", process.stderr.readline())
        assert told is not None
        yield process, told.group(), tmp_path
    finally:
        process.kill()
        process.communicate()


def operate(address: str, command: str, folder: Path, capsys: pytest.CaptureFixture[str], *, code: int = 0) -> str:
    assert main(["operate", address, *command.split(), "--token-file", str(folder / "token")]) == code
    return capsys.readouterr().out


def until_told(address: str, words: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """The first situation in which these words stand."""
    told = [""]

    def is_told() -> bool:
        told[0] = operate(address, "situation", folder, capsys)
        return words in told[0]

    until(is_told, lambda: f"{words} in {told[0]}")
    return told[0]


def step(address: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Step until something is enabled."""

    def is_fired() -> bool:
        told = operate(address, "step", folder, capsys)
        assert told.startswith(("fired", "no transition has fired"))
        return told.startswith("fired")

    until(is_fired, "a step")


def test_an_operator_pauses_steps_resumes_and_stops_a_run_at_once(
    served: tuple[subprocess.Popen[str], str, Path], bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    process, address, folder = served
    assert "tokens on" in operate(address, "situation", folder, capsys)
    assert operate(address, "pause", folder, capsys).startswith("paused")
    step(address, folder, capsys)
    assert "firable_firings_total" in operate(address, "metrics", folder, capsys)
    operate(address, "resume", folder, capsys)
    operate(address, "emergency-stop", folder, capsys)
    until_told(address, "latched: emergency stop: by an operator", folder, capsys)
    for command in ("resume", "step", "pause", "stop-at-end"):
        told = operate(address, command, folder, capsys, code=1)
        assert told.startswith("refused: the run is latched, and ")
    operate(address, "stop", folder, capsys)
    out, _ = process.communicate(timeout=PATIENCE_SECONDS)
    assert process.returncode == 3, "whether all workpieces go through is not known"
    report = json.loads(out)["reports"][0]["run"]
    assert report["message"] == "emergency stop: by an operator"
    trace = read_trace(folder / "run.trace")
    notes = [event for event in trace.events if isinstance(event, Noted)]
    assert {note.data.get("what") for note in notes} >= {"pause", "step", "resume", "emergency-stop"}
    stopped = next(note.at_seconds for note in notes if note.note == "emergency stop")
    assert not [e for e in trace.events if isinstance(e, CommandSent) and e.at_seconds > stopped]
    assert main(["replay", str(folder / "run.trace"), "--net", str(bundle)]) == 0


def test_a_run_without_a_journal_that_ends_held_does_not_advise_to_say_what_nobody_would_hear(
    served: tuple[subprocess.Popen[str], str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    process, address, folder = served
    until_told(address, "robot.to_cv1", folder, capsys)
    operate(address, "pause", folder, capsys)
    operate(address, "step", folder, capsys)
    operate(address, "emergency-stop", folder, capsys)
    until_told(address, "latched", folder, capsys)
    operate(address, "reset", folder, capsys)
    until_told(address, "say what it did", folder, capsys)
    operate(address, "stop", folder, capsys)
    out, _ = process.communicate(timeout=PATIENCE_SECONDS)
    message = json.loads(out)["reports"][0]["run"]["message"]
    assert "it has no journal to be taken up by: bring the cell to its initial marking" in message
    assert "--say" not in message


def test_an_operator_resets_an_emergency_stop_says_what_a_machine_did_and_resumes(
    served: tuple[subprocess.Popen[str], str, Path], bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    process, address, folder = served
    assert "there is no emergency stop" in operate(address, "reset", folder, capsys, code=1)
    until_told(address, "robot.to_cv1", folder, capsys)
    operate(address, "pause", folder, capsys)
    operate(address, "step", folder, capsys)  # it is over when all that waits for a disk has left, the command too
    operate(address, "emergency-stop", folder, capsys)
    until_told(address, "latched", folder, capsys)
    assert operate(address, "reset", folder, capsys).startswith("held")
    told = until_told(address, "say what it did", folder, capsys)
    assert "\n  look at the machine and say what it did" in told, "each sentence has a line of its own"
    places = re.findall(r"say (\S+)=done", told)
    assert places
    assert operate(address, "resume", folder, capsys, code=1).startswith("refused: the run is held")
    said = operate(address, "say mc.fix=done", folder, capsys, code=1)
    assert f"nobody asks after mc.fix; to be said is what became of {places[0]}" in said
    for place in places:
        operate(address, f"say {place}=not-received", folder, capsys)
    assert not operate(address, "resume", folder, capsys).startswith("held")
    until_told(address, "robot.grasp_cv1", folder, capsys)
    operate(address, "stop", folder, capsys)
    out, _ = process.communicate(timeout=PATIENCE_SECONDS)
    report = json.loads(out)["reports"][0]["run"]
    assert (process.returncode, report["message"]) == (3, "stopped by the operator")
    assert main(["replay", str(folder / "run.trace"), "--net", str(bundle)]) == 0


def test_a_run_that_is_paused_from_elsewhere_waits_though_its_machines_have_come_to_rest(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # One workpiece: once it is in and the command under way is done, nothing more happens by itself.
    arguments = ["--speed", "10", "--workpieces", "1", "--watch", "ignore", "--serve", "127.0.0.1:0"]
    arguments += ["--token-file", str(tmp_path / "token")]
    process = subprocess.Popen(
        [sys.executable, "-m", "firable.cli", "run", str(bundle), *arguments], stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stderr is not None
        told = re.search(r"http://\S+", process.stderr.readline())
        assert told is not None
        operate(told.group(), "pause", tmp_path, capsys)
        step(told.group(), tmp_path, capsys)  # the workpiece comes in
        assert "conveyor.cv1_run" in operate(told.group(), "situation", tmp_path, capsys)
        for _ in range(40):
            time.sleep(0.05)
            assert operate(told.group(), "situation", tmp_path, capsys).startswith("paused")
        operate(told.group(), "resume", tmp_path, capsys)
        assert process.wait(timeout=PATIENCE_SECONDS) == 0
    finally:
        process.kill()
        process.communicate()


def test_the_token_is_for_its_owner_alone_and_no_other_gets_in(
    served: tuple[subprocess.Popen[str], str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    process, address, folder = served
    assert stat.S_IMODE((folder / "token").stat().st_mode) == 0o600
    (folder / "other").write_text(new_token())
    assert main(["operate", address, "stop", "--token-file", str(folder / "other")]) == 2
    assert "error[F5063]" in capsys.readouterr().err
    assert "tokens on" in operate(address, "situation", folder, capsys)
    operate(address, "stop", folder, capsys)
    process.communicate(timeout=PATIENCE_SECONDS)
    notes = [event for event in read_trace(folder / "run.trace").events if isinstance(event, Noted)]
    assert [dict(note.data) for note in notes if note.note == "not let in"] == [{"what": "/stop", "by": "127.0.0.1"}]


def test_a_token_that_everybody_on_the_host_can_read_or_change_opens_no_endpoint(tmp_path: Path) -> None:
    token = tmp_path / "token"
    token.write_text(new_token())
    for mode in (0o600, 0o640):  # a group may be that of the operators
        token.chmod(mode)
        assert ServeOptions("127.0.0.1:0", token_file=str(token)).service("cell.bundle") is not None
    for mode in (0o644, 0o602):
        token.chmod(mode)
        with pytest.raises(InputError, match="everybody on this host can read this token, or change it") as refused:
            ServeOptions("127.0.0.1:0", token_file=str(token)).service("cell.bundle")
        assert refused.value.diagnostics[0].code == "F5060"


@pytest.mark.parametrize("token", ["/dev/zero", "long"])
def test_what_is_longer_than_any_token_is_none(token: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = Path(token) if token.startswith("/") else tmp_path / token
    if not file.exists():
        file.write_text("a" * 5000)
    assert main(["operate", "http://127.0.0.1:9", "stop", "--token-file", str(file)]) == 2
    assert "error[F1001]" in capsys.readouterr().err


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_token_that_an_editor_has_saved_in_another_way_is_told_so(
    encoding: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "token"
    file.write_text(new_token(), encoding=encoding)
    assert main(["operate", "http://127.0.0.1:9", "stop", "--token-file", str(file)]) == 2
    assert f"error[F1001]: {file}: no token: it has a character that is none of ASCII, " in capsys.readouterr().err


def test_who_may_operate_is_told_as_it_is_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = Site(tmp_path / "site").host("run")
    tls = (own.certificate, own.key)
    for options, who in (
        (ServeOptions("127.0.0.1:0"), "with the token "),
        (ServeOptions("127.0.0.1:0", token_file=str(tmp_path / "token")), "with the token in "),
        (ServeOptions("127.0.0.1:0", serve_tls=tls, operators=own.authority), "with a certificate of the authority in"),
    ):
        service = options.service("cell.bundle")
        assert service is not None
        service.served("https://127.0.0.1:8080")
        assert f"operate this run at https://127.0.0.1:8080 {who}" in capsys.readouterr().err


def test_a_run_that_is_not_there_is_one_clear_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "token").write_text(new_token())
    assert main(["operate", "http://127.0.0.1:9", "stop", "--token-file", str(tmp_path / "token")]) == 2
    assert "error[F5063]" in capsys.readouterr().err
    assert main(["operate", "http://127.0.0.1:9", "stop", "--token-file", str(tmp_path / "none")]) == 2
    assert "error[F1001]" in capsys.readouterr().err


WORDS = "say what became of a command: say PLACE=done, =working or =not-received"


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("pause x=y", "pause takes nothing after it: leave out 'x=y'; PLACE=ANSWER is for say"),
        ("stop now", "stop takes nothing after it: leave out 'now'"),
        ("say", WORDS),
        ("say robot.grasp", WORDS),
        ("say =done", WORDS),
        ("say robot.grasp=perhaps", WORDS),
        ("say robot.grasp=unknown", WORDS),
    ],
)
def test_a_command_that_is_told_what_it_does_not_take_asks_nobody(
    command: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "token").write_text(new_token())
    assert main(["operate", "http://127.0.0.1:9", *command.split(), "--token-file", str(tmp_path / "token")]) == 2
    said = capsys.readouterr().err
    assert f"Error: {told}" in said
    assert "F5063" not in said, "that nobody serves there"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--serve", "127.0.0.1:8080"], "in virtual time a run is over"),
        (["--serve", "8080", "--speed", "1"], "write ADDRESS:PORT"),
        (["--serve", "0.0.0.0:8080", "--speed", "1"], "F5060"),
        (["--token-file", "t"], "say with --serve"),
        (["--serve", "127.0.0.1:8080", "--speed", "1", "--operators", "ca.pem"], "name --serve-tls"),
        (
            ["--serve", ":1", "--speed", "1", "--serve-tls", "c", "k", "--operators", "a", "--token-file", "t"],
            "a certificate says who comes, and no token",
        ),
    ],
)
def test_what_cannot_be_served_is_refused_before_the_run_begins(
    bundle: Path, arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", str(bundle), *arguments]) == 2
    assert told in capsys.readouterr().err


def test_a_run_whose_address_is_taken_leaves_nothing(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal, trace = tmp_path / "cell.journal", tmp_path / "cell.trace"
    binding = str(catalogue_path("one_robot").with_name("one_robot.bind.yaml"))
    host = ("--controller", "robot", "--join", "tcp/127.0.0.1:9", "--dry-run", "1")
    with closing(socket.create_server(("127.0.0.1", 0))) as other:
        address = f"127.0.0.1:{other.getsockname()[1]}"
        for of in (("--speed", "1"), ("--bind", binding), host):
            files = ("--journal", str(journal), "--trace", str(trace))
            assert main(["run", str(bundle), *of, "--serve", address, *files]) == 2
            said = capsys.readouterr().err
            assert f"error[F5061]: nothing can be served at {address}: Address already in use" in said
            assert list(tmp_path.iterdir()) == []


def test_a_run_takes_all_the_descriptors_that_it_may_have(bundle: Path) -> None:
    """A shell gives a thousand, and whoever opens so many connections to a host has it hear nobody any more."""
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    script = (
        f"import resource, sys; resource.setrlimit(resource.RLIMIT_NOFILE, (100, {hard}));"
        "from firable.cli.main import main; sys.exit(main(sys.argv[1:]))"
    )
    arguments = ["run", str(bundle), "--speed", "1", "--workpieces", "50", "--serve", "127.0.0.1:0"]
    process = subprocess.Popen(
        [sys.executable, "-c", script, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stderr is not None
        process.stderr.readline()  # it serves
        assert resource.prlimit(process.pid, resource.RLIMIT_NOFILE) == (hard, hard)
    finally:
        process.kill()
        process.communicate()
