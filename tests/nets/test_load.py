"""A net is read from whatever file it is in, and a file that is none is refused by the reader that it names."""

import os
from pathlib import Path

import pytest

from firable.nets.bundle import Bundle, write_bundle
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.loading import load
from firable.nets.net import Net, Place
from firable.nets.pnml_writer import write_pnml

NET = Net("n", (Place("p"),))


def refused(path: Path) -> list[str]:
    with pytest.raises(InputError) as refusal:
        load(path)
    return [problem.code for problem in refusal.value.diagnostics]


def test_the_extension_or_the_content_tells_the_format(tmp_path: Path) -> None:
    text, _ = write_pnml(NET)
    for name in ("a.pnml", "b.xml", "c.unknown"):
        (tmp_path / name).write_text(text)
        assert load(tmp_path / name).net == NET
    assert load(catalogue_path("one_robot")).net == catalogue_net("one_robot")
    (tmp_path / "d").write_text(catalogue_path("one_robot").read_text())
    loaded = load(tmp_path / "d")
    assert (loaded.net, loaded.notes) == (catalogue_net("one_robot"), ())


@pytest.mark.parametrize("name", ["cell.bundle", "cell", "cell.yaml", "cell.pnml"])
def test_a_bundle_is_known_by_its_content_and_gives_its_net(name: str, tmp_path: Path) -> None:
    write_bundle(tmp_path / name, Bundle(Decomposition(NET, (), (), ()), ()))
    loaded = load(tmp_path / name)
    assert (loaded.net, loaded.notes, loaded.positions) == (NET, (), None)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:-1])
    assert refused(tmp_path / name) == ["F5001"]


@pytest.mark.parametrize("name", ["none", "none.yaml", "none.pnml", "none.bundle", ".", "pipe", "a\0b"])
def test_a_file_that_is_none_is_refused_whatever_its_extension(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert refused(tmp_path / name) == ["F1001"]
