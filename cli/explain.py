"""`firable explain CODE`: the page of a diagnostic, as docs/ has it.

The pages stand in docs/codes, one file for each code, where they are written, read and searched; `cli/codes` is a link
to them, by which they come into the wheel. Their examples are run by the tests, so what they show is what is printed.
"""

from __future__ import annotations

import re
from importlib.resources import files

import click


def page_of(code: str) -> str:
    """The page of a code of the table, as Markdown."""
    return files("firable.cli").joinpath("codes", f"{code}.md").read_text(encoding="utf-8")


@click.command(short_help="Tell what a code such as F2003 means, and what to do.")
@click.argument("code", metavar="CODE")
def explain(code: str) -> int:
    """Tell what a diagnostic or a verdict means, with an example, and what to do about it.

    CODE stands in brackets where it is told: error[F2003], or hint: [F3011]. Without the F, and in small letters, it
    will do too.
    """
    from firable.nets.diagnostics import CODES, with_meant

    wanted = re.sub(r"[\[\]]|^(error|warning)", "", code.strip()).upper()
    wanted = wanted if wanted.startswith("F") else f"F{wanted}"
    if wanted not in CODES:
        raise click.UsageError(with_meant(f"'{code}' is no code of firable.", wanted, list(CODES)))
    for line in page_of(wanted).removesuffix("\n").splitlines():
        if not line.startswith("```"):
            click.echo(click.style(line.removeprefix("# "), bold=True) if line.startswith("# ") else line)
    return 0
