"""How a command ends whose output goes nowhere, or that Ctrl-C meets before it has begun."""

import os
import pty
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from firable.cli.main import _is_hung_up, main

FIRABLE = [sys.executable, "-m", "firable.cli"]
SAYS_TOO_MUCH = [["check", "catalogue:one_robot"], ["check", "catalogue:one_robot", "--format", "json"], ["--help"]]


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [*SAYS_TOO_MUCH, ["schema", "net"]])
def test_a_disk_that_is_full_under_the_output_is_one_clear_error(arguments: list[str], unbuffered: str) -> None:
    with Path("/dev/full").open("w") as full:
        environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
        done = subprocess.run(
            [*FIRABLE, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, env=environment, check=False
        )
    assert done.returncode == 2
    assert done.stderr == (
        "error[F1017]: standard output cannot be written: No space left on device\n"
        "  hint: make room where it goes, or send it elsewhere\n"
    )


@pytest.mark.parametrize("arguments", [*SAYS_TOO_MUCH, ["schema", "net"]])
def test_a_terminal_that_is_closed_has_no_reader_as_a_broken_pipe(arguments: list[str]) -> None:
    side, terminal = pty.openpty()
    os.close(side)
    done = subprocess.run([*FIRABLE, *arguments], stdout=terminal, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (3, b"")
    assert subprocess.run([*FIRABLE, *arguments], stdout=terminal, stderr=terminal, check=False).returncode == 3
    os.close(terminal)


@pytest.mark.parametrize("arguments", [["check", "nowhere.firable.yaml"], ["check"]])
def test_an_error_that_can_be_told_nowhere_is_still_an_error_by_its_exit_code(arguments: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        assert subprocess.run([*FIRABLE, *arguments], stderr=full, check=False).returncode == 2
        assert subprocess.run([*FIRABLE, *arguments], stdout=full, stderr=full, check=False).returncode == 2


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_who_closes_an_output_gets_the_exit_code_alone(closed: str) -> None:
    line = f"{sys.executable} -m firable.cli check catalogue:conceptual_one_robot {closed}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("module", ["click", "firable.cli.main", "firable.cli.check", "pydantic"])
def test_ctrl_c_while_a_command_is_loaded_ends_it_as_later(module: str) -> None:
    script = f"""
import runpy, sys

class Interrupting:
    def find_spec(self, name, *_):
        if name == {module!r}:
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupting())
sys.argv[1:] = ["check", {str(Path(__file__).parents[2] / "nets/catalogue/one_robot.firable.yaml")!r}, "--no-cache"]
runpy.run_module("firable.cli", run_name="__main__", alter_sys=True)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.strip()) == (3, "", "interrupted: nothing is known yet")


def test_ctrl_c_while_a_class_is_loaded_is_no_fault_of_the_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def load(_name: str) -> None:
        raise RuntimeError("Error calling __set_name__ on 'cached_property'") from KeyboardInterrupt()

    monkeypatch.setattr("firable.cli.main.import_module", load)
    assert main(["check", "catalogue:one_robot"]) == 3
    assert capsys.readouterr().err == "interrupted: nothing is known yet\n"


ASKED_BESIDE = """
import os, signal, sys, threading, z3
from firable.cli.terminated import terminated_as_by_ctrl_c

def terminate():
    os.kill(os.getpid(), signal.SIGTERM)

holes = range(20)  # more pigeons than holes: z3 is at it for as long as anybody waits
sits = [[z3.Bool(f"{p}-{h}") for h in holes] for p in range(21)]
solver = z3.Solver()
solver.add([z3.Or(one) for one in sits])
solver.add([z3.Not(z3.And(sits[p][h], sits[q][h])) for h in holes for p in range(21) for q in range(p)])
if sys.argv[1] == "ignored":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
with terminated_as_by_ctrl_c():
    threading.Timer(0.3, terminate).start()
    print(solver.check(), solver.reason_unknown(), flush=True)
    print(signal.getsignal(signal.SIGTERM) is signal.SIG_DFL)
print(signal.getsignal(signal.SIGTERM) is signal.SIG_DFL, flush=True)
terminate()
"""


def test_sigterm_ends_a_solver_in_the_main_thread_and_is_itself_again_afterwards() -> None:
    done = subprocess.run([sys.executable, "-c", ASKED_BESIDE, ""], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (-signal.SIGTERM, "")
    assert done.stdout.split() == ["unknown", "interrupted", "from", "keyboard", "False", "True"]


def test_sigterm_ends_at_once_what_takes_no_ctrl_c() -> None:
    done = subprocess.run([sys.executable, "-c", ASKED_BESIDE, "ignored"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGTERM, "", "")


ENDED_WHILE_BUNDLING = """
import os, signal, sys, time
import firable.decompose.bundling as bundling
from firable.cli.main import main

stage, sent, of_the_stage = sys.argv[1:4]
work = getattr(bundling, stage)

def ended(*arguments, **options):
    try:
        os.kill(os.getpid(), getattr(signal, sent))
        while True:  # z3 has left the signal such that it ends no longer sleep
            time.sleep(0.01)
    except KeyboardInterrupt:
        if of_the_stage == "told":
            raise
    return work(*arguments, **options)

setattr(bundling, stage, ended)
sys.exit(main(["bundle", "catalogue:one_robot", "-o", "cell.bundle"]))
"""


@pytest.mark.parametrize(
    ("stage", "sent", "of_the_stage", "doing"),
    [
        ("votes", "SIGINT", "told", "votes"),
        ("prove", "SIGINT", "kept", r"Eq\. \(7\)"),
        ("evidence_of_report", "SIGTERM", "told", "evidence on the net"),
        ("evidence_of_report", "SIGTERM", "kept", "protocol"),
        ("proved_without_exploring", "SIGINT", "kept", "seal"),
    ],
)
def test_ctrl_c_ends_the_making_of_a_bundle_with_what_is_known(
    tmp_path: Path, stage: str, sent: str, of_the_stage: str, doing: str
) -> None:
    """Also where a part of the work has taken it for itself, as one does that tells then what it has."""
    (tmp_path / "cell.bundle").write_text("as it was", "utf-8")
    command = [sys.executable, "-c", ENDED_WHILE_BUNDLING, stage, sent, of_the_stage]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 3, done.stderr
    told = rf"  \? unknown +bundle +all that the bundle must hold is proved\n      reached: interrupted: {doing}\n"
    assert re.search(told, done.stdout), done.stdout
    assert re.search(r"not decided: \d+ unknown, \d+ proved, 1 warning\n  no bundle was made", done.stdout)
    assert "cell.bundle was not made by this call" in done.stderr
    assert [one.read_text("utf-8") for one in tmp_path.iterdir()] == ["as it was"]


def test_a_device_that_is_no_terminal_is_no_closed_one() -> None:
    with Path("/dev/null").open("w") as nowhere:
        assert not _is_hung_up(nowhere)
