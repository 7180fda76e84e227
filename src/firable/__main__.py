"""`python -m firable` is the command `firable`, where its script is not on the path."""

import sys

from firable.cli.__main__ import main

if __name__ == "__main__":
    sys.exit(main())
