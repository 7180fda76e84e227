"""The entry of the command `firable`, and `python -m firable.cli`: a Ctrl-C may come before the commands are loaded.

What it ends later tells what it knows; here nothing is known, and nothing is loaded that could say it otherwise.

Where numpy is loaded it starts a thread for each processor, for products of matrices, of which none are asked for here.
"""

import os
import sys


def main() -> int:
    """Run the command line and return the exit code."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from firable.cli.main import main as run

        return run()
    except KeyboardInterrupt:
        sys.stderr.write("interrupted: nothing is known yet\n")
        return 3  # unknown


if __name__ == "__main__":
    sys.exit(main())
