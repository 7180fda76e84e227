"""Run all benchmarks and write `benchmarks/RESULTS.md`.

    python benchmarks/run.py [--repeat 3] [--only explicit] [--output FILE]

The goals that stand beside the figures were set before the engine was written; one that is missed stays in the table.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

import executing
import explicit
import lasting
import linking
import protocols
import public_nets
import public_queries
import reacting
import reading
import splitting
import viewing
import whole_spaces
from measuring import REPOSITORY, build_examples, is_busy, machine

BENCHMARKS: Final = {
    "explicit": explicit.tables,
    "whole_spaces": whole_spaces.tables,
    "reading": reading.tables,
    "splitting": splitting.tables,
    "protocols": protocols.tables,
    "linking": linking.tables,
    "public_nets": public_nets.tables,
    "public_queries": public_queries.tables,
    "executing": executing.tables,
    "reacting": reacting.tables,
    "lasting": lasting.tables,
    "viewing": viewing.tables,
}

BUSY: Final = (
    " Other programs kept the machine busy: times are longer than they would be alone, by shared caches and memory, "
    "and what was to end within a time by the clock had a fraction of it."
)

OTHER_TOOLS: Final = """## Other tools

None of them is measured by this script. The figures below were measured before, elsewhere, on a machine of the same
class, in processor seconds; they are no ratio to anything in this file.

| net | tool | seconds |
|---|---|---|
| philosophers-16, 1,331,714 markings, explicit | verifypn (TAPAAL) | 6.5 |
| | LTSmin | 7.0 |
| | LoLA | 13 |
| philosophers, n = 1,000 and 2,000, symbolic | LTSmin with Sylvan | 3.3 and 9.3 |
| | ITS-tools | 35 and over 60 |
| vehicles that share zones, 4e11 markings, symbolic | LTSmin | 7 |
| | pnmc | 17 |
| | ITS-tools | 25 |
"""


def main() -> None:
    """Measure, and write the results."""
    parser = argparse.ArgumentParser(description="measure firable")
    parser.add_argument("--repeat", type=int, default=3, help="runs of each thing")
    parser.add_argument("--only", choices=BENCHMARKS, action="append", help="these benchmarks alone, to the terminal")
    parser.add_argument("--output", type=Path, default=REPOSITORY / "benchmarks" / "RESULTS.md")
    options = parser.parse_args()
    if options.repeat < 1:
        parser.error("--repeat must be at least 1")
    head = machine()
    if not options.only or "explicit" in options.only:
        build_examples()
    about = (
        f"# Results\n\nWritten by `make bench`; do not edit. {head}.\n\n"
        "Each figure is a ratio to something measured in the same run, from the smallest of "
        f"{options.repeat} processor times; beside a goal stands whether it is met.{BUSY if is_busy() else ''}\n"
    )
    parts = [about]
    for name in options.only or BENCHMARKS:
        for table in BENCHMARKS[name](options.repeat):
            print(table.markdown(), flush=True)
            parts.append(table.markdown())
            if not options.only:  # after each table, so that a run that is broken off has not been for nothing
                options.output.write_text("\n".join([*parts, OTHER_TOOLS]))


if __name__ == "__main__":
    main()
