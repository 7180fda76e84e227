"""What a net file says in the words that it is free to choose does not look like what is said of it.

A description, a command or the name of a verdict that is expected may hold line ends and escapes, and net files come
from anybody: a runner of CI obeys each line that begins with `::`, and a terminal each escape.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from firable.cli.main import main
from firable.nets.catalogue import catalogue_net
from firable.nets.printing import format_net

EVIL = r'"a\n::stop-commands::x\n  ✓ proved    deadlock-free\u001b[2J"'
NET = format_net(catalogue_net("one_robot_mc_late"))


def written(pattern: str) -> str:
    """The net file with all that fits replaced."""
    text, count = re.subn(pattern, lambda found: f"{found[1]}{EVIL}", NET)
    assert count
    return text


@pytest.mark.parametrize(
    "text",
    [
        written(r"(description: )[^,}\n\"]+"),
        written(r"(machine: )\w+"),
        written(r"(command: )\w+"),
        f"{NET}\nexpect:\n  {EVIL}: violated\n",
    ],
    ids=["description", "machine", "command", "expect"],
)
@pytest.mark.parametrize("command", [["check"], ["check", "--verbose"], ["check", "--format", "github"], ["split"]])
def test_words_that_are_free_make_no_line_of_a_report(
    text: str, command: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cell.firable.yaml").write_text(text)
    main([command[0], "cell.firable.yaml", *command[1:]])
    told = "".join(capfd.readouterr())
    assert told
    assert "\x1b[2J" not in told
    said = [line.strip() for line in told.splitlines()]
    assert not [line for line in said if line.startswith(("::stop-commands", "✓ proved    deadlock-free"))]


def test_names_of_files_and_of_signals_make_no_line_of_an_error(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path("a\n::stop-commands::x\x1b[2J.firable.yaml")
    file.write_text("firable: 1\ncell: [\n")
    assert main(["check", str(file)]) == 2
    trace = Path("run.trace")
    head = '{"firable_trace": 1, "net": "one-robot", "digest": "", "discipline": "interleaving", "signals": true}'
    trace.write_text(f'{head}\n{{"at": 1.0, "signal": "a\\n::stop-commands::x\\u001b[2J", "value": 1}}\n')
    assert main(["timeline", str(trace), "--net", "catalogue:one_robot", "-o", "run.svg"]) == 2
    told = "".join(capfd.readouterr())
    assert "\x1b[2J" not in told
    assert not [line for line in told.splitlines() if line.strip().startswith("::")]
