"""Hosts whose certificates say which machines are theirs: a host with that of another one is not let in."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from support.certificates import Site
from support.waiting import heard_in_time, until

from firable.cli.main import main
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.operating.hosting import Network, make_link
from firable.nets.bundle import read_bundle
from firable.nets.diagnostics import InputError

CERTIFIED = ["--certified", "plc 1=mc,system", "--certified", "plc 2=robot,conveyor"]


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("certified") / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    return str(path)


def host(bundle: str, site: Site, name: str, *more: str) -> subprocess.Popen[str]:
    own = site.host(name)
    tls = ["--tls", own.authority, own.certificate, own.key]
    command = [sys.executable, "-m", "firable.cli", "run", bundle, "--dry-run", "0", *tls, *CERTIFIED, *more]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("certificate", ["plc 2", "plc 3"])
def test_a_host_is_let_in_with_its_own_certificate_alone(bundle: str, tmp_path: Path, certificate: str) -> None:
    site, at, trace = Site(tmp_path / "site"), f"tls/127.0.0.1:{free_port()}", tmp_path / "centre.trace"
    centre = host(bundle, site, "plc 1", "--controller=system", "--controller=mc", f"--listen={at}", f"--trace={trace}")
    other = host(bundle, site, certificate, "--controller=conveyor", "--controller=robot", f"--join={at}")
    try:
        if certificate == "plc 2":
            until(lambda: trace.exists() and trace.read_text().count('"round"') > 20, "rounds")
        else:
            assert centre.stderr is not None
            with heard_in_time(centre):
                told = next(line for line in centre.stderr if "'robot' was never reached" in line)
            assert "is it made out to the name that --certified says?" in told
            assert '"round"' not in trace.read_text()
    finally:
        for one in (centre, other):
            one.kill()
            one.communicate()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--certified", "plc 1=system,mc"], "'robot' is said to be of no certificate"),
        ([*CERTIFIED, "--certified", "plc 3=mc"], "'mc' is said to be of two certificates"),
        ([*CERTIFIED, "--certified", "plc 3=robt"], "has no controller 'robt'"),
        ([*CERTIFIED, "--certified", "plc 2=robot"], "--certified plc 2 stands twice"),
        (["--certified", "plc 1"], "--certified plc 1: write NAME=CONTROLLER"),
        (["--certified", "=mc"], "--certified =mc: write NAME=CONTROLLER"),
    ],
)
def test_what_is_said_of_certificates_has_to_be_of_each_host_once(
    bundle: str, tmp_path: Path, more: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    own = Site(tmp_path / "site").host("plc 2")
    tls = ["--join", "tls/127.0.0.1:1", "--tls", own.authority, own.certificate, own.key]
    assert main(["run", bundle, "--controller", "mc", "--dry-run", "1", *tls, *more]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--join", "tcp/127.0.0.1:1"], "--certified is of tls/ addresses alone"),
        (["--serial", "x"], "--serial is one link"),
    ],
)
def test_certificates_are_shown_over_tls_alone(
    bundle: str, more: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", bundle, "--controller", "mc", "--dry-run", "1", *CERTIFIED, *more]) == 2
    assert said in capsys.readouterr().err


def test_the_coordinator_of_a_net_that_names_none_has_a_host_as_well(tmp_path: Path) -> None:
    path, net = tmp_path / "cell.bundle", tmp_path / "cell.firable.yaml"
    assert main(["convert", "catalogue:one_robot", "-o", str(net)]) == 0
    net.write_text(net.read_text().replace("    coordinator: true\n", ""))
    assert main(["bundle", str(net), "-o", str(path)]) == 0
    own = Site(tmp_path / "site").host("plc 1")
    files, read = (own.authority, own.certificate, own.key), read_bundle(path)
    rest = {"plc 1": ("robot",), "plc 2": ("system", "mc", "conveyor")}
    make_link(read, ("robot",), Network(("tls/127.0.0.1:1",), (), files, {**rest, "plc 3": ("coordinator",)}))
    with pytest.raises(InputError, match="the coordinator is said to be of no certificate"):
        make_link(read, ("robot",), Network(("tls/127.0.0.1:1",), (), files, rest))
