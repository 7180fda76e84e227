#!/bin/sh
# mutants.sh FILE TESTS: edit FILE wrongly, one place at a time, and list the edits that TESTS do not notice.
#
# Each survivor is code that no test needs: a missing test, or a line that can go. The edits are cosmic-ray's, in a clone of
# HEAD in a temporary folder, so that a run that is broken off leaves the checkout as it is. BIN holds the tools.
set -eu
file=$1 tests=$2
here=$(pwd)
clone=$(mktemp -d)
trap 'rm -rf "$clone"' EXIT
git clone --quiet "$here" "$clone"
cp analysis/_engine*.so "$clone/analysis/"
cd "$clone"
export PYTHONPATH="$clone/src" PYTHONDONTWRITEBYTECODE=1 CI=1
cat > mutants.toml <<TOML
[cosmic-ray]
module-path = "$file"
timeout = 60.0
excluded-modules = []
test-command = "$BIN/python -m pytest -q -x -p no:cacheprovider $tests"
[cosmic-ray.distributor]
name = "local"
TOML
"$BIN/cosmic-ray" init mutants.toml mutants.sqlite
"$BIN/cosmic-ray" baseline mutants.toml
"$BIN/cosmic-ray" exec mutants.toml mutants.sqlite
"$BIN/cr-report" mutants.sqlite --surviving-only --show-diff
