"""No output of a command is written over what the command reads, nor over another output of it.

Which options name files is read off the commands; an option that names a file and does not say so by its type is found,
because all options of plain words stand in a table here.
"""

from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from firable.cli.files import (
    FOLDER,
    JOURNAL,
    MADE,
    NETS,
    OLD_JOURNAL,
    READ,
    WRITTEN,
    WRITTEN_BUNDLE,
    WRITTEN_NET,
    FileType,
)
from firable.cli.main import COMMANDS, firable, main
from firable.nets.catalogue import catalogue_path

WORDS = {
    "check": {"--query"},
    "ci init": {"--install"},
    "draw": {"--marking", "--collapse", "--controller"},
    "explain": {"code"},
    "io": {"--force", "--send"},
    "operate": {"address", "what"},
    "refine": {"--cell"},
    "rehearse": {"--faults"},
    "run": {"--certified", "--controller", "--listen", "--join", "--serial", "--say", "--serve"},
    "sim": {"--stuck", "--drop", "--hang"},
    "split": {"--own"},
    "view": {"--collapse", "--controller"},
}
"""The options and arguments that are words, and name no file."""

LATE = "catalogue:one_robot_mc_late"
FOLDERS = {
    ("check", "--trace-dir"): ("check", LATE),
    ("check", "--evidence"): ("check", LATE),
    ("prove", "--smt-dir"): ("prove", "catalogue:machines-2"),
    ("refine", "--evidence"): ("refine", "catalogue:conceptual_one_robot", "--no-confirm"),
    ("split", "--subnets"): ("split", "catalogue:one_robot"),
    ("verify", "--smt-dir"): ("verify", "evidence/machines-2.evidence.json"),
}
"""The options that name a folder, each with a command that writes files into it."""

STANDING = {
    ("sign", "--make-key"): ("sign", "--make-key", "stands"),
    ("sim", "--bind"): ("sim", "catalogue:one_robot", "--modbus", "--for", "0", "--bind", "stands"),
}
"""The options that name a file that is only made where none stands, each with a command that would write over one."""


def commands() -> Iterator[tuple[str, click.Command]]:
    context = click.Context(firable)
    for name in COMMANDS:
        command = firable.get_command(context, name)
        assert command is not None
        inner = command.commands if isinstance(command, click.Group) else {}
        yield name, command
        yield from ((f"{name} {word}", one) for word, one in inner.items())


def parameters() -> Iterator[tuple[str, click.Parameter]]:
    for name, command in commands():
        yield from ((name, parameter) for parameter in command.params)


def types_of(parameter: click.Parameter) -> list[object]:
    return list(parameter.type.types) if isinstance(parameter.type, click.Tuple) else [parameter.type]


def named_as(kind: FileType) -> set[tuple[str, str]]:
    return {(name, one.opts[0]) for name, one in parameters() if kind in types_of(one)}


def pairs() -> Iterator[tuple[str, str, str]]:
    """Each command with an output and with what it reads or writes besides; twice the same where it is repeatable."""
    for name, command in commands():
        written = [one for one in command.params if {WRITTEN, WRITTEN_BUNDLE, WRITTEN_NET, JOURNAL} & {*types_of(one)}]
        files = [
            one
            for one in command.params
            if {WRITTEN, WRITTEN_BUNDLE, WRITTEN_NET, JOURNAL, READ, NETS, OLD_JOURNAL} & {*types_of(one)}
        ]
        for output in written:
            for other in files:
                if other is not output or output.multiple:
                    yield name, output.opts[0], other.opts[0]


def line(name: str, *named: tuple[str, str]) -> list[str]:
    """A command line in which options and arguments name these files, and what is required besides names others."""
    command = dict(commands())[name]
    by_name = {parameter.opts[0]: parameter for parameter in command.params}
    missing = [(one, f"no-{number}") for number, one in enumerate(by_name) if one not in dict(named)]
    words = name.split()
    for option, file in (*named, *((one, other) for one, other in missing if by_name[one].required)):
        words += [option] if option.startswith("-") else []
        for kind in types_of(by_name[option]):
            words.append(kind.choices[0] if isinstance(kind, click.Choice) else file)
    return words


@pytest.fixture
def spelled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """A file by several names: its own, a way around, a symbolic link and a hard link."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "cell.yaml"
    file.write_bytes(catalogue_path("one_robot").read_bytes())
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.yaml").symlink_to(file.name)
    (tmp_path / "hard.yaml").hardlink_to(file)
    return {
        "itself": file.name,
        "around": str(tmp_path / "folder" / ".." / file.name),
        "symbolic link": "link.yaml",
        "hard link": "hard.yaml",
    }


def test_each_option_says_whether_it_names_a_file() -> None:
    words: dict[str, set[str]] = {}
    for name, parameter in parameters():
        if click.STRING in types_of(parameter):
            words.setdefault(name, set()).add(parameter.opts[0])
    assert words == WORDS


@pytest.mark.parametrize(("name", "output", "other"), sorted(pairs()))
def test_no_output_is_written_over_another_file_of_the_command(
    name: str, output: str, other: str, spelled: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    file = Path(spelled["itself"])
    before = file.read_bytes()
    for spelling in spelled.values():
        for named in ((output, spelling), (other, file.name)), ((other, file.name), (output, spelling)):
            assert main(line(name, *named)) == 2
            said = capsys.readouterr().err
            assert "error[F1017]" in said
            assert " would overwrite what " in said
            assert "hint: name another file" in said
            assert file.read_bytes() == before
    assert sorted(path.name for path in Path.cwd().iterdir()) == [
        "cell.yaml",
        "folder",
        "hard.yaml",
        "link.yaml",
    ]


@pytest.mark.parametrize(
    "name",
    [
        "cell.firable.yaml",
        "cell.firable.yml",
        "Cell.plant.yaml",
        "cell.bind.yaml",
        "cell.layout.yaml",
        "cell.bundle",
        "cell.bundle.signatures",
        "release.key",
        "release.key.pub",
        "host.pem",
    ],
)
def test_no_output_is_named_like_what_people_keep_unless_it_is_a_net_or_a_bundle(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).write_text("mine")
    for command, option in sorted(named_as(WRITTEN)):
        assert main(line(command, (option, name))) == 2
        said = capsys.readouterr().err
        assert f"error[F1017]: {name}: that is the name of a" in said
        assert f"which {option} does not write" in said
    for command, option in sorted(named_as(WRITTEN_BUNDLE)):
        if not name.endswith(".bundle"):
            assert main(line(command, (option, name))) == 2
            assert "that is the name of a" in capsys.readouterr().err
    for command, option in sorted(named_as(WRITTEN_NET)):
        if "firable" not in name:
            assert main(line(command, (option, name))) == 2
            assert "that is the name of a" in capsys.readouterr().err
    assert Path(name).read_text() == "mine"
    assert main(["convert", "catalogue:one_robot", "-o", "other.firable.yaml"]) == 0


def test_two_outputs_are_two_files_before_there_is_any(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["bundle", "catalogue:one_robot", "-o", "new.html", "--report", "./new.html"]) == 2
    assert "error[F1017]: ./new.html: --report would overwrite what -o writes\n" in capsys.readouterr().err
    assert main(["check", "catalogue:one_robot", "--write", "json", "new", "--write", "junit", "new"]) == 2
    assert "new: --write would overwrite what another --write writes\n" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert main(["timeline", "-", "--net", "catalogue:one_robot", "-o", "-"]) == 2, "that is standard output"
    assert "would overwrite" not in capsys.readouterr().err


def test_no_output_is_written_over_a_net_of_a_folder_that_is_read(
    spelled: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    net = Path(spelled["itself"]).rename("cell.firable.yaml")
    before = net.read_bytes()
    Path("report.json").symlink_to(net)
    assert main(["check", ".", "--write", "json", "report.json"]) == 2
    assert "--write would overwrite what the command reads" in capsys.readouterr().err
    assert net.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("cell.plant.yaml", ("run", "cell.bundle", "--trace")),
        ("cell.plant.yaml", ("check", ".", "--write", "json")),
        ("cell.layout.yaml", ("draw", "cell.firable.yaml", "-o")),
        ("cell.bundle.signatures", ("run", "cell.bundle", "--trace")),
        ("cell.bundle.signatures", ("verify", "cell.bundle", "--write", "json")),
    ],
)
def test_no_output_is_written_over_what_is_found_beside_a_file_that_is_read(
    name: str, command: tuple[str, ...], spelled: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path(spelled["itself"]).rename("cell.firable.yaml")
    file = Path(name)
    file.write_text("mine", encoding="utf-8")
    Path("link").symlink_to(name)
    assert main([*command, str(Path("folder") / ".." / "link")]) == 2
    assert "would overwrite what the command reads\n" in capsys.readouterr().err
    assert file.read_text("utf-8") == "mine"


def test_what_is_read_of_the_catalogue_are_its_files() -> None:
    plant = catalogue_path("one_robot").with_name("one_robot.plant.yaml")
    assert {*READ.files("catalogue:one_robot")} == {str(catalogue_path("one_robot")), str(plant)}
    assert not list(READ.files("catalogue:nothing"))


@pytest.mark.parametrize(("name", "option"), sorted(named_as(FOLDER)))
def test_nothing_in_a_folder_is_written_over_another_output(
    name: str, option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    command = [*FOLDERS[name, option], option, "out"]
    if name == "verify":
        assert main(["check", "catalogue:machines-2", "--method", "structure", "--evidence", "evidence"]) == 0
    assert main(command) in {0, 1}
    capsys.readouterr()
    for file in (names := sorted(Path("out").iterdir())):
        file.unlink()
    here = names[0] if names[0].suffix == ".json" else Path("here.json")
    if here != names[0]:
        names[0].symlink_to(Path("..") / here)  # the name of a net is refused at once
    assert main([*command, "--write", "json", str(here)]) == 2
    printed = capsys.readouterr()
    said = f"{names[0]}: what is written there would overwrite what --write writes"
    assert f"error[F1017]: {said}\n  hint: name another folder" in printed.err
    assert sorted(Path("out").iterdir()) == names[:1], "the report alone, which tells of that"
    assert said in names[0].read_text("utf-8")


def test_no_subnet_is_written_over_the_net(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    net = tmp_path / "robot.firable.yaml"
    net.write_bytes(catalogue_path("one_robot").read_bytes())
    assert main(["split", net.name, "--subnets", "."]) == 2
    assert f"{net.name}: what is written there would overwrite what the command reads" in capsys.readouterr().err
    assert net.read_bytes() == catalogue_path("one_robot").read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == [net.name]


def test_no_schema_is_written_over_another_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    options = ("-o", "new.firable.yaml", "--report", "net.schema.json")
    assert main(["split", "catalogue:one_robot", "--suggest", "2", *options]) == 2
    assert "net.schema.json: what is written there would overwrite what --report writes" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_each_option_that_names_a_folder_is_tried() -> None:
    assert named_as(FOLDER) == {*FOLDERS}
    assert named_as(MADE) == {*STANDING}


@pytest.mark.parametrize(("name", "option"), sorted(STANDING))
def test_what_is_only_made_is_never_written_over_what_stands(
    name: str, option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stands").write_text("precious")
    assert main([*STANDING[name, option]]) == 2
    assert "a file stands there" in capsys.readouterr().err
    assert (tmp_path / "stands").read_text() == "precious"
