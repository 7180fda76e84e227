#!/bin/sh
# The five-minute story: the public commands one after the other, as anyone would type them. `make demo` runs it.
set -u
BIN=${BIN:-.venv/bin}
OUT=${OUT:-out}
PATH="$(cd "$BIN" && pwd):$PATH"
mkdir -p "$OUT"

if [ -t 1 ] && [ -z "${NO_COLOR:-}" ]; then bold=$(printf '\033[1m') plain=$(printf '\033[0m'); else bold='' plain=''; fi
say() { printf '\n%s== %s%s\n' "$bold" "$*" "$plain"; }
expect() { # the exit code that the command must have, and the command
    code=$1
    shift
    printf '\n$ %s\n' "$*"
    "$@"
    found=$?
    if [ "$found" -ne "$code" ]; then
        echo "expected exit code $code and got $found: this is a fault of firable, please report it" >&2
        exit 1
    fi
}

say "Act one: the one-robot cell. Is its control right? Every reachable marking is visited."
expect 0 firable check catalogue:one_robot --structure

say "Split it over its controllers, and prove that the parts together are the whole."
expect 0 firable prove catalogue:one_robot --smt-dir "$OUT/obligations"

say "Seal net, subnets, table, verdicts and evidence in one file: only that may run."
expect 0 firable bundle catalogue:one_robot -o "$OUT/one_robot.bundle"

say "Run it: a coordinator and four controllers on a simulated cell, 1,000 workpieces."
expect 0 firable run "$OUT/one_robot.bundle" --workpieces 1000 --trace "$OUT/run.trace.jsonl"

say "Was every step of that run one that the net allows? The reference player judges the trace."
expect 0 firable replay "$OUT/run.trace.jsonl" --net "$OUT/one_robot.bundle"

say "Draw the net."
expect 0 firable draw catalogue:one_robot -o "$OUT/one_robot.svg"

say "Act two: the same cell, but the machining centre is reserved late. It can deadlock, and must not run."
expect 1 firable check catalogue:one_robot_mc_late --trace-dir "$OUT/counterexamples"
expect 0 firable replay "$OUT/counterexamples/deadlock-free.trace.jsonl" --net catalogue:one_robot_mc_late
expect 0 firable draw catalogue:one_robot_mc_late --trace "$OUT/counterexamples/deadlock-free.trace.jsonl" \
    -o "$OUT/deadlock.svg"

say "Where things lie"
cat <<END
  $OUT/one_robot.svg       the picture of the cell's net (open it in a browser)
  $OUT/deadlock.svg        the deadlock, drawn: which step fired what, and where the tokens are stuck
  $OUT/run.trace.jsonl     the trace of the run, one event a line
  $OUT/one_robot.bundle    what may run on a cell
  $OUT/obligations/        the proof obligations in SMT-LIB 2, for any other solver
  $OUT/counterexamples/    firing sequences that replay
END
