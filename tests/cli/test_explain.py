"""Every code has a page, and what is said of it is known word for word: by the page's example, or by `EXACT`."""

import re
from pathlib import Path

import pytest
from support.exact_words import EXACT
from support.sessions import fits, run_here, session

from firable.cli.main import main
from firable.nets.diagnostics import CODES

PAGES = Path(__file__).parents[2] / "docs" / "codes"
BLOCK = re.compile(r"^(?:In `(?P<file>[^`]+)`:\n\n)?```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
WITH_EXAMPLE = [code for code in CODES if "```console" in (PAGES / f"{code}.md").read_text("utf-8")]
WITH_DOTS = {
    "F5031",  # it names bundles by their identities, which each release makes anew
    *("F4011", "F5101"),  # they have dots of their own
}


def page(code: str) -> str:
    return (PAGES / f"{code}.md").read_text("utf-8")


def test_there_is_a_page_for_each_code_and_no_other() -> None:
    assert {path.stem for path in PAGES.iterdir()} == set(CODES)


@pytest.mark.parametrize("code", CODES)
def test_a_page_begins_with_the_code_and_its_title(code: str) -> None:
    title, blank, text = page(code).split("\n", 2)
    assert title == f"# {code}: {CODES[code]}"
    assert not blank
    assert len(text) > 60
    assert all(len(line) <= 120 for line in BLOCK.sub("", text).splitlines())


@pytest.mark.parametrize("code", WITH_EXAMPLE)
def test_what_a_page_shows_is_printed(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    commands = 0
    for block in BLOCK.finditer(page(code)):
        if block["kind"] != "console":
            if block["file"]:
                (tmp_path / block["file"]).write_text(block["text"], "utf-8")
            continue
        for command, shown in session(block["text"]):
            told = run_here(command, tmp_path).stdout
            assert fits(shown, told), f"$ {command}\n{told}"
            commands += 1
    assert commands
    assert code in page(code).split("```console")[1]


def test_every_code_has_an_exact_output() -> None:
    """A new code gets an example on its page; where no command shows it, a row in tests/support/exact_words.py."""
    assert {*WITH_EXAMPLE, *EXACT} == set(CODES)


@pytest.mark.parametrize("code", EXACT)
def test_what_no_command_shows_is_said_word_for_word(code: str, tmp_path: Path) -> None:
    mistake, words = EXACT[code]
    assert f"[{code}]" in words
    assert mistake(tmp_path).rstrip("\n") == words.rstrip("\n").replace("{folder}", str(tmp_path))


@pytest.mark.parametrize("code", EXACT)
def test_what_is_said_word_for_word_has_a_hint(code: str) -> None:
    assert "hint: " in EXACT[code][1]


@pytest.mark.parametrize("code", WITH_EXAMPLE)
def test_an_example_shows_the_words_of_its_code_whole_and_the_hint(code: str) -> None:
    """From the line that bears the code to the hint no words are left out."""
    lines = page(code).split("```console\n", 1)[1].splitlines()
    begin = next(i for i, line in enumerate(lines) if f"[{code}]" in line)
    end = next(i for i in range(begin, len(lines)) if "hint: " in lines[i])
    assert "..." not in "\n".join(lines[begin : end + 1]) or code in WITH_DOTS


@pytest.mark.parametrize("asked", ["F3011", "f3011", "3011", "[F3011]", "error[F3011]"])
def test_explain_prints_the_page(asked: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", asked]) == 0
    told = capsys.readouterr().out
    assert told.startswith("F3011: a deadlock can be reached\n")
    assert "$ firable check cell.firable.yaml" in told
    assert "```" not in told


def test_an_unknown_code_is_refused_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "F301"]) == 2
    assert "'F301' is no code of firable; did you mean 'F30" in capsys.readouterr().err
