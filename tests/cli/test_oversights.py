"""What a net hardly means is warned of by each command that judges it, once for what is the same."""

import re
from pathlib import Path

import pytest

from firable.cli.main import main
from firable.nets.catalogue import catalogue_path


def test_of_many_places_that_nothing_fills_the_first_is_told_and_the_others_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net = tmp_path / "cell.firable.yaml"
    places = ", ".join(f"p{i}: " for i in range(9))
    net.write_text(f"firable: 1\ncell: c\nplaces: {{{places}}}\nstart: p0\ntransitions: {{t: {{from: p0, to: p1}}}}\n")
    main(["check", str(net)])
    told = capsys.readouterr().err
    assert told.count("warning[F2031]") == 1
    assert "  the same of 6 more: 'p3', 'p4', 'p5', 'p6', and 2 others\n" in told


@pytest.mark.parametrize("command", ["check", "check --machines", "bundle"])
def test_what_a_net_hardly_means_is_warned_of_where_it_stands(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = catalogue_path("one_robot").read_text("utf-8")
    net, at = tmp_path / "cell.firable.yaml", text.index("    places:\n") + len("    places:\n")
    net.write_text(f"{text[:at]}      nowhere:\n{text[at:]}", "utf-8")
    plant, made = ["--machines", "catalogue:one_robot"], ["-o", str(tmp_path / "cell.bundle")]
    options = {"check": [], "check --machines": plant, "bundle": made}
    assert main([command.split()[0], str(net), *options[command]]) == 0
    (told,) = re.findall(r"cell\.firable\.yaml:(\d+):7: warning\[F2031\]", capsys.readouterr().err)
    assert int(told) == 1 + text[:at].count("\n")
