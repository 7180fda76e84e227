"""How a command ends that Ctrl-C meets before it has begun."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize("module", ["click", "firable.cli.main", "firable.cli.check", "pydantic"])
def test_ctrl_c_while_a_command_is_loaded_ends_it_as_later(module: str) -> None:
    script = f"""
import runpy, sys

class Interrupting:
    def find_spec(self, name, *_):
        if name == {module!r}:
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupting())
sys.argv[1:] = ["check", {str(Path(__file__).parents[2] / "nets/catalogue/one_robot.firable.yaml")!r}, "--no-cache"]
runpy.run_module("firable.cli", run_name="__main__", alter_sys=True)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.strip()) == (3, "", "interrupted: nothing is known yet")
