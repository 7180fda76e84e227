"""`firable replay` of the traces of several hosts."""

import json
from pathlib import Path

import pytest
from support.host_traces import Hosts

from firable.cli.main import main
from firable.decompose import split
from firable.nets.catalogue import catalogue_net


def written(folder: Path) -> list[str]:
    """The traces of the hosts of one run, as files."""
    paths = []
    for trace in Hosts(split(catalogue_net("one_robot")), 1).run(600):
        path = folder / (trace.header.machines[0] or "coordinator")
        with path.open("w", encoding="utf-8") as stream:
            trace.write(stream)
        paths.append(str(path))
    return paths


def test_the_traces_of_all_hosts_are_joined_and_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    joined = str(tmp_path / "joined")
    assert main(["replay", *written(tmp_path), "--net", "catalogue:one_robot", "-o", joined]) == 0
    assert "holds" in (said := capsys.readouterr().out) or "proved" in said
    assert main(["replay", joined, "--net", "catalogue:one_robot"]) == 0


def test_the_trace_of_one_host_is_not_taken_for_that_of_the_cell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = written(tmp_path)
    for some in (paths[:1], paths[1:]):
        assert main(["replay", *some, "--net", "catalogue:one_robot"]) == 2
        assert "the traces of all hosts" in capsys.readouterr().err


def test_traces_that_contradict_each_other_violate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = written(tmp_path)
    lines = Path(paths[0]).read_text().splitlines(keepends=True)
    lines.remove(next(line for line in lines if "fired" in json.loads(line)))
    Path(paths[0]).write_text("".join(lines))
    assert main(["replay", *paths, "--net", "catalogue:one_robot"]) == 1
    assert "do not join" in capsys.readouterr().out
