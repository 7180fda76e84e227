# One command for each habit. Every target does its own set-up: it needs Python 3.11 or later, cargo, make, git and the
# package registries, nothing else. What was set up is remembered in the environment (.venv), so the second time is quick.

PYTHON ?= $(firstword $(foreach name,python3 python3.14 python3.13 python3.12 python3.11,$(shell \
	$(name) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $(name))))
VENV ?= .venv
BIN := $(VENV)/bin
MADE := $(VENV)/made
CRATE := analysis/engine
CARGO_OPTIONS := --locked --manifest-path $(CRATE)/Cargo.toml
# Some tests wait for links, devices and browsers, so two workers more than there are processors. Files go in their order:
# those with few tests, which have the longest, would else come last, and one worker would end alone.
PYTEST_OPTIONS ?= -q -n $(shell echo $$(($$(nproc 2>/dev/null || echo 1) + 2))) --dist loadfile --no-loadscope-reorder
# A command to run beside the build of the crate, before the tests; `.ci/run` installs what some of them need.
MEANWHILE ?=
# A campaign: how many times the examples of a test run, from which seed, and in which folder of tests.
FACTOR ?= 40
SEED := $(shell date +%s)
CAMPAIGN ?= tests
# A rehearsal: how many runs of each cell, from which seed, by how many processes.
RUNS ?= 20000
FROM ?= 0
JOBS ?= $(shell nproc 2>/dev/null || echo 1)
REHEARSED := $(addprefix catalogue:,one_robot two_robots_shared two_robots_separate one_robot_mc_late one_robot_timed \
	two_cells) drawn drawn-timed drawn-layered

# Public nets to test against, where they stand beside the checkout; tests that miss them say so.
ifneq ($(wildcard ../shared/nets),)
export FIRABLE_NETS ?= $(abspath ../shared/nets)
endif

# Tests start hundreds of processes: without the cache of Python, which some environments turn off, each compiles its modules.
unexport PYTHONDONTWRITEBYTECODE

# The crate is built for the Python that the environment was made with.
export PYO3_PYTHON = $(abspath $(BIN)/python)

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test meanwhile fmt docs page bench bench-instructions campaign simulate explore mutants clean lint lint-python lint-ruff
.PHONY: lint-format lint-types lint-rust lint-rust-format lint-clippy test-rust test-last test-python

help: ## these lines
	@grep -E '^[a-z-]+:.*##' Makefile | sed -E 's/:.*##/\t/' | expand -t 20

demo: $(MADE)/install ## check, prove, bundle and run the one-robot cell, and see another one deadlock
	@BIN=$(BIN) sh docs/demo.sh

# The compiler of a crate, the installer and the type checker each leave a processor idle for long, so all goes on side by
# side: the crate is checked and tested while the environment is made, of which the longest is the same crate, optimised as
# shipped. The tests begin when they are compiled, once for all workers, and the linters have found nothing; types and the
# crate's own tests go on beside them. What make says to its own children (MAKEFLAGS) is kept from cargo, which takes it for
# an order to wait for make.
test: $(MADE)/rust-tools ## lint, format, types, and all tests
	$(MAKE) --jobs=$(if $(MEANWHILE),4,3) --output-sync=target $(MADE)/develop test-rust lint test-last

meanwhile:
	$(MEANWHILE)

lint: lint-python lint-rust ## what `make test` checks besides the tests

lint-python: lint-ruff lint-format lint-types

lint-ruff: $(MADE)/develop
	$(BIN)/ruff check --quiet .

lint-format: $(MADE)/develop
	$(BIN)/ruff format --check .

lint-types: $(MADE)/develop
	$(BIN)/mypy src/firable tests $(wildcard benchmarks/*.py)

lint-rust: lint-rust-format lint-clippy

lint-rust-format: $(MADE)/rust-tools
	cargo fmt --manifest-path $(CRATE)/Cargo.toml --check

lint-clippy: $(MADE)/rust-tools
	MAKEFLAGS= cargo clippy --quiet $(CARGO_OPTIONS) --all-targets --all-features -- -D warnings

test-rust: $(MADE)/venv
	MAKEFLAGS= cargo test $(CARGO_OPTIONS) --quiet

test-last: $(if $(MEANWHILE),meanwhile) $(MADE)/collected lint-rust lint-ruff lint-format
	$(MAKE) --output-sync=none test-python # which tell at once how far they are

test-python: $(MADE)/develop
	MAKEFLAGS= $(BIN)/pytest $(PYTEST_OPTIONS)

fmt: $(MADE)/develop $(MADE)/rust-tools ## format all code, and repair what the linter can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	cargo fmt --manifest-path $(CRATE)/Cargo.toml

docs: $(MADE)/develop ## the documents as pages, in out/docs; every command that they show is run by the tests
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs out/docs
	@echo "out/docs/index.html"

page: ## build the page of `firable view` from web/; needs Node 20.19 or later, with npm
	cd web && npm ci --no-fund --no-audit && npm run build

bench: $(MADE)/develop ## measure, as ratios to yardsticks in the same run; writes benchmarks/RESULTS.md
	$(BIN)/python benchmarks/run.py

campaign: $(MADE)/develop ## every property of the tests on FACTOR times as many drawn nets; SEED brings a campaign back
	$(if $(filter tests tests/engine,$(CAMPAIGN)),MAKEFLAGS= FIRABLE_CAMPAIGN=$(FACTOR) cargo test $(CARGO_OPTIONS) --release --quiet)
	FIRABLE_CAMPAIGN=$(FACTOR) FIRABLE_SEED=$(SEED) $(BIN)/pytest $(PYTEST_OPTIONS) --dist load \
		-m "hypothesis or seeds" --hypothesis-seed=$(SEED) $(CAMPAIGN)

simulate: $(MADE)/develop ## the executor through faults, RUNS seeds on each cell and on drawn nets; FROM is the first seed
	@set -e; for net in $(REHEARSED); do \
		$(BIN)/firable rehearse $$net --seeds $(RUNS) --from $(FROM) --jobs $(JOBS); done

explore: $(MADE)/develop ## the machines of the cells, each alone and to its end, held to the proof; CELLS names some
	$(BIN)/python tests/explore_cells.py $(CELLS)
	$(BIN)/pytest -n 0 tests/explore_alone.py

mutants: $(MADE)/mutants ## which wrong edits of FILE the tests in TESTS do not notice
	@test -n "$(FILE)" -a -n "$(TESTS)" || { echo "make mutants FILE=semantics/firing.py TESTS=tests/semantics"; exit 2; }
	@BIN=$(abspath $(BIN)) sh tests/mutants.sh $(FILE) "$(TESTS)"

bench-instructions: $(MADE)/develop ## count the instructions of the engine's hot loops against the record; needs valgrind
	$(BIN)/python benchmarks/instructions.py

clean: ## remove what was built
	rm -rf $(VENV) out build dist src/*.egg-info $(CRATE)/target .mypy_cache .ruff_cache .pytest_cache
	rm -f analysis/_engine*.so

$(MADE)/venv:
	@test -n "$(PYTHON)" || { echo "firable needs Python 3.11 or later; none was found (make PYTHON=... names one)"; exit 1; }
	@command -v cargo >/dev/null || { echo "firable needs cargo, to build its Rust crate"; exit 1; }
	@cargo --version | $(PYTHON) -c 'import re, sys; found = tuple(map(int, re.findall(r"\d+", sys.stdin.read())[:2])); \
		found >= (1, 88) or sys.exit("firable needs cargo 1.88 or later, to build its Rust crate; here is %d.%d" % found)'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	@mkdir -p $(MADE) && touch $@

$(MADE)/install: $(MADE)/venv pyproject.toml $(CRATE)/Cargo.toml $(CRATE)/Cargo.lock $(shell find $(CRATE)/src -name "*.rs")
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[prove]'
	@touch $@

$(MADE)/develop: $(MADE)/install
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --group test --group lint
	@touch $@

# Each worker would else compile all tests, with their assertions rewritten. What cannot be collected, the tests tell.
$(MADE)/collected: $(MADE)/develop
	-$(BIN)/pytest -qq -n 0 --collect-only >/dev/null
	@touch $@

$(MADE)/mutants: $(MADE)/develop
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --group mutants
	@touch $@

# Some distributions package these apart from cargo. Without them the gate would check less than it says.
$(MADE)/rust-tools: $(MADE)/venv
	@cargo fmt --version >/dev/null 2>&1 && cargo clippy --version >/dev/null 2>&1 \
		|| rustup component add rustfmt clippy \
		|| { echo "install rustfmt and clippy (with rustup, or your packages rustfmt and rust-clippy)"; exit 1; }
	@touch $@
