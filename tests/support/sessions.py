"""Console sessions of documents: the commands after `$ `, each with the output that the document shows.

What is a command of firable alone may be run in this process, where its modules are loaded and what the solvers said
of the theorem is known: that takes a third of the time. What needs a shell, as a quoted formula does, is run by one, as
whoever tries it would.
"""

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Final

from firable.cli.main import main

_OF_A_SHELL: Final = re.compile(r"[|&;<>$*?~`\\#{}()\[\]\n]")


def session(text: str) -> list[tuple[str, str]]:
    """The commands of a block, each with the output that it shows."""
    return [(part.partition("\n")[0], part.partition("\n")[2]) for part in re.split(r"^\$ ", text, flags=re.M)[1:]]


def fits(shown: str, printed: str) -> bool:
    """Whether this was printed: a line `...` stands for any lines, and `...` within a line for any words."""
    pattern = "".join("(?:.*\n)*" if line == "..." else _words(line) + "\n" for line in shown.splitlines())
    return re.fullmatch(pattern, printed) is not None


def _words(line: str) -> str:
    return ".*".join(re.escape(part) for part in line.split("..."))


def run(command: str, folder: Path, status: int = 0) -> subprocess.CompletedProcess[str]:
    """Run a command of a document in a folder, as a shell whose last command ended with this status."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "-c", f"(exit {status}); {command}"],
        cwd=folder,
        env={**os.environ, "PATH": path, "NO_COLOR": "1", "COLUMNS": "120"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def run_here(command: str, folder: Path, status: int = 0) -> subprocess.CompletedProcess[str]:
    """Run a command as `run` does; one of firable that needs no shell in this process."""
    if not command.startswith("firable ") or _OF_A_SHELL.search(command):
        return run(command, folder, status)
    words = shlex.split(command)
    told = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
        code = main(words[1:])
    return subprocess.CompletedProcess(command, code, told.getvalue())
