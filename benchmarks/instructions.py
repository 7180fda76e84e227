"""Instructions that the engine's hot loops take, against those that are on record: the guard on its speed.

Times on a shared machine differ by half from run to run, so a commit that costs 5 % goes unseen. The number of
instructions does not depend on the machine's load; valgrind counts it (`cachegrind`, caches not simulated). It says
nothing of cache misses, so it is no measure of speed, only an alarm: a count that differs from the one in
`instructions.json` by more than 3 % fails, a lower one too, so that the record stays true. After a change on purpose,
`--update` writes the new counts, and the commit shows them. Counts depend on the compiler; the record names the one it
was made with.

    python benchmarks/instructions.py [--update]
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any, Final

CRATE: Final = Path(__file__).resolve().parent.parent / "analysis" / "engine"
PROGRAM: Final = CRATE / "target" / "release" / "examples" / "hot_loops"
RECORD: Final = Path(__file__).with_suffix(".json")
TOLERANCE: Final = 0.03

NETS: Final = ("philosophers 11", "interlocked 9", "interlocked 9 60", "interlocked 9 180")
WORK: Final = ("explore", "bottoms", "edges", "backward", "endless")


def counted(net: str, work: str) -> tuple[int, int]:
    """The instructions of one run, and the edges of the net's graph."""
    valgrind = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    run = subprocess.run([*valgrind, str(PROGRAM), net, work], capture_output=True, text=True, check=True)
    refs = re.search(r"I\s+refs:\s+([\d,]+)", run.stderr)
    if refs is None:
        raise SystemExit(f"valgrind counted nothing:\n{run.stderr}")
    return int(refs[1].replace(",", "")), int(run.stdout.split()[1])


def main() -> int:
    """Print one line for each count; 1 where one of them is not the one on record."""
    parser = argparse.ArgumentParser(description="instructions of the engine's hot loops, against the record")
    parser.add_argument("--update", action="store_true", help="write the counts as the new record")
    update = parser.parse_args().update
    if shutil.which("valgrind") is None:
        parser.error("this needs valgrind, which counts the instructions; install it from your packages")
    build = ["cargo", "build", "--release", "--locked", "--quiet", "--example", "hot_loops"]
    subprocess.run(build, cwd=CRATE, check=True)
    compiler = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    record: dict[str, Any] = {"compiler": "", "counts": {}}
    if RECORD.exists():
        record = json.loads(RECORD.read_text(encoding="utf-8"))
    if record["compiler"] != compiler and not update:
        print(f"note: the record was made with {record['compiler']}; here is {compiler}\n")

    counts: dict[str, int] = {}
    wrong = 0
    print(f"{'net':20}{'work':10}{'instructions':>14}{'an edge':>9}{'on record':>11}")
    for net in NETS:
        for work in WORK:
            count, edges = counted(net, work)
            counts[f"{net}: {work}"] = count
            before = record["counts"].get(f"{net}: {work}")
            change = "new" if before is None else f"{count / before - 1:+.1%}"
            differs = before is None or abs(count / before - 1) > TOLERANCE
            wrong += differs
            mark = "  <-" if differs and not update else ""
            print(f"{net:20}{work:10}{count:14,}{count / edges:9.1f}{change:>11}{mark}", flush=True)
    if update:
        text = json.dumps({"compiler": compiler, "counts": counts}, indent=2) + "\n"
        RECORD.write_text(text, encoding="utf-8")
        return 0
    if wrong:
        print(f"\n{wrong} counts differ by more than {TOLERANCE:.0%}; if that is meant, --update writes them down")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
