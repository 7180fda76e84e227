"""`firable ci init`: the file by which a project's continuous integration checks its nets.

The file is the user's from then on, so it holds what they may want to change and nothing clever: one job, one `firable
check` of the whole project, and where its results go. An existing file is never written over.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import click

from firable import __version__
from firable.cli.choice import OneOf
from firable.cli.options import write_text

_GITHUB: Final = """\
# Checks every net of the project; written by `firable ci init`.
name: firable
on:
  push:
  pull_request:
permissions:
  contents: read
  security-events: write  # for the results in code scanning
jobs:
  check:
    runs-on: ubuntu-latest
    timeout-minutes: 30
    steps:
      - uses: actions/checkout@v5
      - uses: actions/setup-python@v6
        with:
          python-version: "3.12"
      - run: python -m pip install '{requirement}'
      - run: firable check . --format github --write sarif firable.sarif --write junit firable.xml
      - uses: github/codeql-action/upload-sarif@v4
        if: success() || failure()
        continue-on-error: true  # a private repository may be without code scanning
        with:
          sarif_file: firable.sarif
      - uses: actions/upload-artifact@v6
        if: success() || failure()
        with:
          name: firable
          path: |
            firable.sarif
            firable.xml
"""
_GITLAB: Final = """\
# Checks every net of the project; written by `firable ci init`. Name it in .gitlab-ci.yml:
#   include: {{local: {file}}}
firable:
  image: python:3.12
  script:
    - python -m pip install '{requirement}'
    - firable check . --write junit firable.xml --write sarif firable.sarif
  artifacts:
    when: always
    paths: [firable.xml, firable.sarif]
    reports:
      junit: firable.xml
"""
_FILES: Final = {"github": (".github/workflows/firable.yml", _GITHUB), "gitlab": (".gitlab/firable.yml", _GITLAB)}


@click.group(short_help="Check nets in continuous integration.")
def ci() -> None:
    """Check nets in continuous integration; see docs/ci.md for formats, and for pytest and pre-commit."""


@ci.command(short_help="Write the workflow that checks this project's nets.")
@click.option(
    "--for",
    "site",
    type=OneOf(sorted(_FILES)),
    default="github",
    show_default=True,
    help="Whose workflow.",
)
@click.option(
    "--install",
    "requirement",
    metavar="REQUIREMENT",
    default=f"firable[prove]=={__version__}",
    show_default=True,
    help="What pip installs there.",
)
@click.argument("folder", metavar="[FOLDER]", default=".", type=click.Path(exists=True, file_okay=False))
def init(site: str, requirement: str, folder: str) -> int:
    """Write the workflow that checks every net of the project in FOLDER, on each push and pull request.

    Its annotations, code scanning alerts and test results come from one `firable check`. A file that is there already
    is left as it is, and told.
    """
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.writing import make_folder

    if not requirement.isprintable() or any(part in requirement for part in ("'", " #", ": ")):
        # It stands between quotes of a shell, on a line of YAML.
        raise click.UsageError("--install: a requirement has no quotes ('), line ends, ' #' or ': ' in it")
    file, template = _FILES[site]
    path = Path(folder) / file
    if path.exists():
        message = f"{path}: there is a workflow already"
        raise InputError([Diagnostic("F1017", message, "change that file, or delete it and ask again")])
    make_folder(str(path.parent))
    write_text(str(path), template.format(requirement=requirement, file=file))
    click.echo(f"{path} checks every *.firable.yaml of the project")
    if site == "gitlab":
        click.echo(f"  name it in .gitlab-ci.yml: include: {{local: {file}}}")
    return 0
