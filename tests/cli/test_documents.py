"""The documents are executed: what a page shows of a session is what is printed, and what it only names exists.

Blocks marked `console` hold commands after `$ ` and their output, in which a line `...` stands for any lines, and `...`
within a line for any words. What a sentence before a block bids to save is saved. Commands in a block marked `sh` need
other hosts, machines or hours: they are not run, and each of their options must exist.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import click
import pytest
from support.sessions import fits, run_here, session

from firable.cli.main import firable
from firable.nets import document as doc
from firable.nets.document_errors import keys_of

DOCS: Final = Path(__file__).parents[2] / "docs"
BLOCK: Final = re.compile(r"^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
SAVED: Final = re.compile(r"Save\s+(?:this|it)\s+(?:again\s+)?as\s+`([^`]+)`")
PAGES: Final = sorted(path for path in DOCS.rglob("*.md") if path.parent != DOCS / "codes")
SHOWN: Final = (doc.NetDocument, doc.ControllerDocument, doc.TransitionDocument, doc.ArbiterDocument,
                doc.PropertyDocument, doc.LeadsToDocument)  # fmt: skip


def _with(kind: str) -> list[str]:
    return [str(page.relative_to(DOCS)) for page in PAGES if f"```{kind}\n" in page.read_text("utf-8")]


@pytest.mark.parametrize("name", _with("console"))
def test_every_command_of_a_page_prints_what_it_shows(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    text, status, end = (DOCS / name).read_text("utf-8"), 0, 0
    for block in BLOCK.finditer(text):
        between, end = text[end : block.start()], block.end()
        if block["kind"] != "console":
            for file in SAVED.findall(between)[-1:]:
                (tmp_path / file).write_text(block["text"], "utf-8")
            continue
        for command, shown in session(block["text"]):
            done = run_here(command, tmp_path, status)
            status = done.returncode
            assert fits(shown, done.stdout), f"$ {command}\n{done.stdout}"
    for picture in re.findall(r"\]\(pictures/([\w.]+)\)", text):
        drawn = (tmp_path / picture).read_text("utf-8")
        assert drawn == (DOCS / "pictures" / picture).read_text("utf-8"), f"draw {picture} anew, as the page does"


@pytest.mark.parametrize("name", _with("sh"))
def test_every_option_that_a_page_names_exists(name: str) -> None:
    text = (DOCS / name).read_text("utf-8")
    named = [command for block in BLOCK.finditer(text) if block["kind"] == "sh" for command in _commands(block["text"])]
    assert named
    for words in named:
        command = firable.get_command(click.Context(firable), words[0])
        assert command is not None, words
        command.make_parser(click.Context(command, info_name=words[0])).parse_args(words[1:])


def _commands(text: str) -> Iterator[list[str]]:
    """The commands of firable in a script, each as its words."""
    for line in text.replace("\\\n", " ").splitlines():
        for part in line.split("&&"):
            words = shlex.split(part, comments=True)
            if words[:1] == ["firable"]:
                yield words[1:]


def test_the_documents_are_made_without_a_warning(tmp_path: Path) -> None:
    # In a theme without a tree of all pages on each, which takes three times as long as the pages themselves.
    plain = ["-D", "html_theme=basic"]
    made = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", *plain, DOCS, tmp_path / "html"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stderr
    index = (tmp_path / "html" / "searchindex.js").read_text("utf-8")
    assert "unless" in index  # search asks no server
    pages = {str(page.relative_to(DOCS).with_suffix(".html")) for page in PAGES}
    assert all((tmp_path / "html" / page).is_file() for page in pages)


@pytest.mark.parametrize("key", sorted({key for model in SHOWN for key in keys_of(model)}))
def test_a_key_of_a_net_file_is_written_out_for_who_reads_the_sources_of_the_pages(key: str) -> None:
    """The tables of keys are there only once the pages are made; without them the examples have to do."""
    blocks = [block for page in PAGES for block in BLOCK.finditer(page.read_text("utf-8"))]
    written = [block["text"] for block in blocks if block["kind"] == "yaml" and "firable: 1\n" in block["text"]]
    assert any(re.search(rf"(?:^|[ {{]){key}:", text, re.MULTILINE) for text in written)


def test_no_page_shows_a_command_that_nothing_looks_at() -> None:
    for page in PAGES:
        assert not re.findall(r"^    \$ .*", page.read_text("utf-8"), re.MULTILINE), page.name
