"""`python -m firable.cli` is the command `firable`."""

from firable.cli.main import run_as_script

run_as_script()
