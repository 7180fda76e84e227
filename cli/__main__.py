"""The entry of the command `firable`, and `python -m firable.cli`: a Ctrl-C may come before the commands are loaded.

What it ends later tells what it knows; here nothing is known, and nothing is loaded that could say it otherwise.
"""

import sys


def main() -> int:
    """Run the command line and return the exit code."""
    try:
        from firable.cli.main import main as run

        return run()
    except KeyboardInterrupt:
        sys.stderr.write("interrupted: nothing is known yet\n")
        return 3  # unknown


if __name__ == "__main__":
    sys.exit(main())
