"""`firable run --controller`: hosts of a cell as processes, and what is refused before one starts."""

import json
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization
from support.certificates import Site
from support.waiting import PATIENCE_SECONDS, heard_in_time, until

from firable.cli.main import main
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.links.zenoh_link import Certificates


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("bundle") / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    return str(path)


MISTAKES: dict[str, tuple[list[str], str]] = {
    "an option of a host alone": (["--join", "tcp/127.0.0.1:1"], "--join is for a host among others"),
    "a lease of nobody": (["--lease", "3"], "--lease is for a host among others"),
    "a rate of no line": (["--baud", "9600"], "--baud is for a host among others"),
    "a rate of no serial line": (
        ["--controller", "robot", "--dry-run", "1", "--join", "tcp/[::1]:1", "--baud", "9600"],
        "--baud is of a serial line",
    ),
    "no link": (["--controller", "robot", "--dry-run", "1"], "--listen, --join or --serial"),
    "two links": (["--controller", "robot", "--dry-run", "1", "--serial", "x", "--join", "tcp/[::1]:1"], "one link"),
    "no machines": (["--controller", "robot", "--join", "tcp/127.0.0.1:1"], "--bind"),
    "both": (["--controller", "robot", "--join", "tcp/[::1]:1", "--dry-run", "1", "--bind", "x"], "one of them"),
    "an unknown controller": (["--controller", "robt", "--dry-run", "1", "--join", "tcp/[::1]:1"], "'robot'"),
    "no such line": (["--controller", "robot", "--dry-run", "1", "--serial", "/dev/no-line"], "F5021"),
    "no address": (["--controller", "robot", "--dry-run", "1", "--join", "foo"], "--join foo: this is no address"),
    "no port": (["--controller", "robot", "--dry-run", "1", "--listen", "tcp/127.0.0.1"], "write tcp/HOST:PORT"),
    "a port too high": (["--controller", "robot", "--dry-run", "1", "--join", "tls/[::1]:65536"], "no address"),
    "another protocol": (["--controller", "robot", "--dry-run", "1", "--join", "udp/[::1]:1"], "no address"),
    "TLS without certificates": (["--controller", "robot", "--dry-run", "1", "--join", "tls/[::1]:1"], "with --tls CA"),
    "certificates without TLS": (
        ["--controller", "robot", "--dry-run", "1", "--join", "tcp/[::1]:1", "--tls", "{bundle}", "no-cert", "no-key"],
        "nothing is encrypted",
    ),
    "no certificates": (
        ["--controller", "robot", "--dry-run", "1", "--join", "tls/[::1]:1", "--tls", "{bundle}", "no-cert", "no-key"],
        "no-cert:1:1: error[F1001]",
    ),
    "a file that is no certificate": (
        [
            "--controller",
            "robot",
            "--dry-run",
            "1",
            "--join",
            "tls/[::1]:1",
            "--tls",
            "{bundle}",
            "{bundle}",
            "{bundle}",
        ],
        "cell.bundle is no certificate of an authority",
    ),
    "no machines to be held against a model": (
        ["--controller", "robot", "--dry-run", "1", "--join", "tcp/[::1]:1", "--watch", "stop"],
        "say with --bind",
    ),
    "no machines to tell of": (
        ["--controller", "robot", "--dry-run", "1", "--join", "tcp/[::1]:1", "--watch", "tell"],
        "say with --bind",
    ),
    "no model to tell by": (["--bind", "x", "--watch", "tell"], "--watch tell holds the machines against a plant file"),
    "a coordinator that the net names": (
        ["--controller", "robot", "--coordinator", "--dry-run", "1", "--join", "tcp/[::1]:1"],
        "it runs where --controller system does",
    ),
    "no model": (["--controller", "robot", "--bind", "x", "--join", "tcp/[::1]:1", "--watch", "stop"], "with --plant"),
    "no model of a whole run": (["--bind", "x", "--watch", "stop"], "with --plant"),
    "steps at the terminal": (["--controller", "robot", "--dry-run", "1", "--step"], "`firable operate` steps"),
    "one file for two": (["--controller", "mc", "--trace", "{bundle}", "--journal", "x"], "error[F1017]"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_clear_error(mistake: str, bundle: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments, said = MISTAKES[mistake]
    assert main(["run", bundle, *(argument.format(bundle=bundle) for argument in arguments)]) == 2
    errors = capsys.readouterr().err
    assert said in errors
    assert "Traceback" not in errors


def test_two_hosts_run_a_cell_and_end_in_order(bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    at = f"tcp/127.0.0.1:{free_port()}"
    hosts = {
        "system": ["--controller", "system", "--controller", "mc", "--listen", at],
        "robot": ["--controller", "robot", "--controller", "conveyor", "--join", at, "--format", "json"],
    }
    run = [sys.executable, "-m", "firable.cli", "run", bundle, "--dry-run", "0"]
    traces = {name: tmp_path / f"{name}.trace" for name in hosts}
    processes = {
        name: subprocess.Popen(
            [*run, *more, "--trace", str(traces[name])],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for name, more in hosts.items()
    }
    try:
        until(lambda: traces["system"].exists() and traces["system"].read_text().count('"round"') > 20, "rounds")
    finally:
        for process in processes.values():
            process.send_signal(signal.SIGINT if process is processes["robot"] else signal.SIGTERM)
    said = {name: process.communicate(timeout=PATIENCE_SECONDS) for name, process in processes.items()}
    assert [process.returncode for process in processes.values()] == [0, 0], said
    assert "is connected" in said["system"][1]
    report = json.loads(said["robot"][0])["reports"][0]
    assert report["run"]["machines"] == ["robot", "conveyor"]
    assert report["verdicts"][0]["name"] == "host-ended-in-order"
    assert main(["replay", *map(str, traces.values()), "--net", bundle]) == 0
    capsys.readouterr()


def test_a_host_with_another_bundle_is_refused_by_name(bundle: str, tmp_path: Path) -> None:
    other = str(tmp_path / "other.bundle")
    assert main(["bundle", "catalogue:two_robots_separate", "-o", other]) == 0
    at = f"tcp/127.0.0.1:{free_port()}"
    run = [sys.executable, "-m", "firable.cli", "run"]
    here = subprocess.Popen(
        [*run, bundle, "--controller", "system", "--listen", at, "--dry-run", "0"], stderr=subprocess.PIPE, text=True
    )
    try:
        for _ in range(2):  # who lets others in stays
            joining = [*run, other, "--controller", "mc", "--join", at, "--dry-run", "0"]
            there = subprocess.run(joining, capture_output=True, text=True, timeout=PATIENCE_SECONDS)
            assert there.returncode == 2
            assert "error[F5020]: 'system', the coordinator holds another bundle" in there.stderr
            assert there.stderr.count("another bundle") == 2, "when it is refused, and when nobody else has come"
            assert "Traceback" not in there.stderr
            assert here.stderr is not None
            # A busy machine may start the other host so late that it is told to be missing before it is refused.
            told = (line for line in here.stderr if "was never reached" not in line)
            assert "refused: the host of 'mc' is refused: 'mc' holds another bundle" in next(told)
            assert "gone: the host of 'mc' that was refused is gone" in next(told)
        assert here.poll() is None
    finally:
        here.kill()
        here.communicate()


@pytest.mark.parametrize("way", ["--listen", "--join"])
def test_a_certificate_that_has_expired_is_refused_before_it_is_shown(
    way: str, bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    expired = Site(tmp_path / "site").host("robot", valid_days=(-2, -1))
    tls = ["--tls", expired.authority, expired.certificate, expired.key]
    arguments = ["--controller", "robot", "--dry-run", "1", way, f"tls/127.0.0.1:{free_port()}", *tls]
    assert main(["run", bundle, *arguments]) == 2
    assert f"error[F5062]: the certificate {expired.certificate} cannot be used: certificate has expired" in (
        capsys.readouterr().err
    )


def changed_places(own: Certificates) -> Certificates:
    return replace(own, certificate=own.key, key=own.certificate)


def with_a_password(own: Certificates) -> Certificates:
    key = serialization.load_pem_private_key(Path(own.key).read_bytes(), None)
    form = serialization.PrivateFormat.PKCS8, serialization.BestAvailableEncryption(b"secret")
    Path(own.key).write_bytes(key.private_bytes(serialization.Encoding.PEM, *form))
    return own


def without_text(own: Certificates) -> Certificates:
    Path(own.key).write_bytes(b"\x30\x82\x01")
    return own


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (changed_places, "certificate and key have changed places"),
        (with_a_password, "the key has a password"),
        (without_text, "it is not in PEM"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_why_a_certificate_and_its_key_cannot_be_used_is_told_in_words(
    made: Callable[[Certificates], Certificates],
    said: str,
    bundle: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    own = made(Site(tmp_path / "site").host("robot"))
    tls = ["--tls", own.authority, own.certificate, own.key]
    assert main(["run", bundle, "--controller", "robot", "--dry-run", "1", "--join", "tls/127.0.0.1:1", *tls]) == 2
    assert f"are no certificate and its key: {said}" in capsys.readouterr().err


def test_hosts_whose_certificates_are_of_two_authorities_are_asked_for_them(bundle: str, tmp_path: Path) -> None:
    at, hosts = f"tls/127.0.0.1:{free_port()}", []
    try:
        for name, way in (("system", "--listen"), ("robot", "--join")):
            own = Site(tmp_path / name).host(name)
            command = ["run", bundle, "--controller", name, "--dry-run", "1", way, at]
            command += ["--tls", own.authority, own.certificate, own.key]
            hosts.append(
                subprocess.Popen(
                    [sys.executable, "-m", "firable.cli", *command],
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    text=True,
                )
            )
        for host in hosts:
            assert host.stderr is not None
            with heard_in_time(host):
                told = next(line for line in host.stderr if "was never reached" in line)
            assert (
                "is the certificate of each of the authority that the other names with --tls, and not expired?" in told
            )
    finally:
        for host in hosts:
            host.kill()
            host.communicate()


def test_hosts_whose_authority_has_expired_are_refused_before_they_are_linked(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = Site(tmp_path / "site", valid_days=(-2, -1)).host("robot")
    tls = ["--tls", own.authority, own.certificate, own.key]
    assert main(["run", bundle, "--controller", "robot", "--dry-run", "1", "--join", "tls/127.0.0.1:1", *tls]) == 2
    assert f"error[F5062]: the authority in {own.authority} cannot be used: certificate has expired" in (
        capsys.readouterr().err
    )


def test_a_host_that_is_started_again_without_its_journal_or_with_an_older_copy_is_refused_with_one_clear_error(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at = f"tcp/127.0.0.1:{free_port()}"
    run = [sys.executable, "-m", "firable.cli", "run", bundle, "--dry-run", "0.05"]
    robot = [*run, "--controller", "robot", "--controller", "conveyor", "--join", at]
    with_journal = [*robot, "--journal", str(tmp_path / "robot.journal"), "--trace", str(tmp_path / "robot.trace")]
    system = [*run, "--controller", "system", "--controller", "mc", "--listen", at]
    system += ["--journal", str(tmp_path / "system.journal"), "--trace", str(tmp_path / "system.trace")]
    processes = [subprocess.Popen(one, stderr=subprocess.DEVNULL) for one in (system, with_journal)]

    def rounds() -> int:
        return (tmp_path / "system.trace").read_text().count('"round"')

    try:
        until(lambda: (tmp_path / "system.trace").exists() and rounds() > 5, "rounds")
        processes[1].kill()
        processes[1].wait()
        trace = (tmp_path / "robot.trace").read_bytes()
        mistyped = [*robot, "--journal", str(tmp_path / "rbot.journal")]
        with_trace = [*mistyped, "--trace", str(tmp_path / "robot.trace")]
        refused = subprocess.run(with_trace, capture_output=True, text=True, timeout=PATIENCE_SECONDS)
        assert refused.returncode == 2
        assert (tmp_path / "robot.trace").read_bytes() == trace, "who is refused changes no file"
        assert "error[F1017]" in refused.stderr
        assert "hint: name another file, or the journal of the run that it is of" in refused.stderr
        refused = subprocess.run(mistyped, capture_output=True, text=True, timeout=PATIENCE_SECONDS)
        assert refused.returncode == 2
        assert "error[F5025]: the host of 'system', 'mc', the coordinator has worked with" in refused.stderr
        assert refused.stderr.count("has worked with another journal") == 1
        assert "Traceback" not in refused.stderr
        of_robot = list(tmp_path.glob("robot.journal*"))
        assert {path.name for path in of_robot} >= {"robot.journal", "robot.journal.generation"}
        copies, lasts = tmp_path / "copies", tmp_path / "lasts"
        for path in of_robot:
            copies.mkdir(exist_ok=True)
            shutil.copy(path, copies)
        done = rounds()
        processes[1] = subprocess.Popen([*with_journal, "--resume"], stderr=subprocess.DEVNULL)
        until(lambda: rounds() > done + 5, "rounds after the restart")
        processes[1].kill()
        processes[1].wait()
        lasts.mkdir()
        for path in tmp_path.glob("robot.journal*"):
            path.rename(lasts / path.name)
        for path in copies.iterdir():
            shutil.copy(path, tmp_path)
        trace, again = (tmp_path / "robot.trace").read_bytes(), [*with_journal, "--resume"]
        for _ in range(3):  # and it stays an older copy
            refused = subprocess.run(again, capture_output=True, text=True, timeout=PATIENCE_SECONDS)
            assert refused.returncode == 2
            assert "has worked with a later state of the journal of 'robot', 'conveyor': this host" in refused.stderr
            assert "Traceback" not in refused.stderr
            assert (tmp_path / "robot.trace").read_bytes() == trace
        for path in tmp_path.glob("robot.journal*"):
            path.unlink()
        for path in lasts.iterdir():
            path.rename(tmp_path / path.name)
        done = rounds()
        processes[1] = subprocess.Popen([*with_journal, "--resume"], stderr=subprocess.DEVNULL)
        until(lambda: rounds() > done + 5, "rounds with the last journal")
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        ended = [process.wait(PATIENCE_SECONDS) for process in processes]
    assert ended == [0, 0]
    assert main(["replay", str(tmp_path / "system.trace"), str(tmp_path / "robot.trace"), "--net", bundle]) == 0
    capsys.readouterr()


def test_an_operator_stops_the_machines_of_one_host_although_its_coordinator_never_came(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    token, at = str(tmp_path / "token"), f"tcp/127.0.0.1:{free_port()}"
    arguments = [
        "--controller",
        "robot",
        "--join",
        at,
        "--dry-run",
        "0",
        "--format",
        "json",
    ]
    serve = ["--serve", "127.0.0.1:0", "--token-file", token]
    process = subprocess.Popen(
        [sys.executable, "-m", "firable.cli", "run", bundle, *arguments, *serve],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        with heard_in_time(process):  # on a busy machine it tells first that it did not run for a while
            told = next(found for line in process.stderr if (found := re.search(r"http://\S+", line)))
            never = next(line for line in process.stderr if "never-met: the coordinator was never reached" in line)
            assert f"(this one joins {at})" in never

        def is_ready() -> bool:  # while something is kept, what waits is not told
            assert main(["operate", told.group(), "situation", "--token-file", token]) == 0
            return "G2 is ready here, and is decided by the coordinator" in capsys.readouterr().out

        until(is_ready, "G2 is ready")
        assert main(["operate", told.group(), "emergency-stop", "--token-file", token]) == 0
        assert main(["operate", told.group(), "stop", "--token-file", token]) == 0
        out, _ = process.communicate(timeout=PATIENCE_SECONDS)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 3, "whether it would have left nothing open is not known"
    run = json.loads(out)["reports"][0]["run"]
    assert (run["state"], run["message"], run["never_met"]) == ("stopped", "emergency stop: by an operator", [""])
