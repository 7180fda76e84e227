"""The README is executed: every command it shows is run, and must print what it shows.

Blocks marked `console` hold commands after `$ ` and their output, in which a line `...` stands for any lines, and `...`
within a line for any words. A `yaml` block is saved under the name that the sentence before it gives.
"""

import re
from pathlib import Path

import pytest
from support.sessions import fits, run_here, session

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(console|yaml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_every_command_of_the_readme_prints_what_it_shows(tmp_path: Path) -> None:
    status, commands = 0, 0
    for match in BLOCK.finditer(README):
        kind, text = match.groups()
        if kind == "yaml":
            (name,) = re.findall(r"Save this as `([^`]+)`", README[: match.start()].rpartition("```")[2])
            (tmp_path / name).write_text(text, encoding="utf-8")
            continue
        for command, shown in session(text):
            done = run_here(command, tmp_path, status)
            status, commands = done.returncode, commands + 1
            assert fits(shown, done.stdout), f"$ {command}\n{done.stdout}"
    assert commands >= 10


@pytest.mark.parametrize(
    ("shown", "printed", "fit"),
    [
        ("a\n", "a\n", True),
        ("a\n", "a\nb\n", False),
        ("a\n...\n", "a\nb\nc\n", True),
        ("a ... c\n", "a b c\n", True),
        ("a ... c\n", "a b d\n", False),
        ("", "a\n", False),
    ],
)
def test_the_comparison_is_strict(shown: str, printed: str, fit: bool) -> None:
    assert fits(shown, printed) is fit


@pytest.mark.parametrize("name", ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_links_and_paths_in_the_front_matter_exist(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        assert target.startswith("https://") or (ROOT / target).exists(), f"{name} links to {target}"
    for path in re.findall(r"`([a-z_]+/[\w/.-]*)`", text):
        assert (ROOT / path).exists() or (ROOT / "src" / path).exists(), f"{name} names {path}"


def test_every_make_target_that_is_named_exists() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"):
        named = set(re.findall(r"(?:^|`)make ([a-z-]+)", (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE))
        assert named <= targets, f"{name}: {named - targets}"


@pytest.mark.parametrize(
    "page", ["README.md", "ARCHITECTURE.md", *(f"docs/{p.name}" for p in sorted(ROOT.glob("docs/*.md")))]
)
def test_no_blank_line_cuts_a_table(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    outside = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    heads = re.findall(r"(?:\A|\n\n)\|[^\n]*\n([^\n]*)", outside)
    assert all(re.fullmatch(r"[|:\- ]+", below) for below in heads)


def test_a_file_that_the_map_names_alone_lies_beside_the_path_before_it() -> None:
    rows = [line for line in (ROOT / "ARCHITECTURE.md").read_text("utf-8").splitlines() if line.startswith("|")]
    astray, folder = [], ROOT
    for name in re.findall(r"`([\w.-]+\.(?:py|rs)|[\w.-]+/[\w/.-]*)`|^\|", "\n".join(rows), re.MULTILINE):
        if not name:  # a row begins
            folder = ROOT
        elif "/" in name:
            folder = ROOT / name if name.endswith("/") else (ROOT / name).parent
        elif not (folder / name).is_file():
            astray.append(f"{folder.relative_to(ROOT)}: {name}")
    assert not astray
