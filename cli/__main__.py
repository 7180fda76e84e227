"""`python -m firable.cli` is the command `firable`."""

import sys

from firable.cli.main import main

sys.exit(main())
