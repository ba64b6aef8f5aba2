# reachmap: from a clean machine to ranked grasps, and the checks of the project.
# The same targets serve a person, a hook and CI.

PYTHON ?= python3
VENV   ?= .venv
JOBS   ?= 2
# The pipeline: which cell, which grasps, where the results go, and how much of it.
CELL   ?= ur5-eye-in-hand
GRASPS ?= examples/pile-1.json
RUN    ?= run
WORKERS ?= $(JOBS)
# Empty for the cell's own sizes, which are the paper's.
SIZE   ?=
QUICK  := --set bin_scan.repeats=2 --set 'bin_scan.grid=[10,7]'

BIN      := $(VENV)/bin
PIP      := $(BIN)/python -m pip --disable-pip-version-check -qq
REACHMAP := $(BIN)/reachmap
SCAN     := -j $(WORKERS) --overwrite
# Programs that look after the lock file; they are no part of any environment.
TOOLS    := build/tools/bin
FUZZ_S   ?= 60
RESULTS  := $(RUN)/.pictures $(RUN)/ranked.json $(RUN)/report.html

.DEFAULT_GOAL := run
.DELETE_ON_ERROR:
.PHONY: help run paper quick install dev test test-slow lint check docs bench wheel view \
        clean clean-run test-lowest fuzz lock sbom audit

help: ## Show this list
	@awk 'BEGIN {FS = ":.*## "} /^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

run: $(RESULTS) ## Install, then scan, place, scan and rank on the shipped cell (default)
	@echo "Done. Open $(RUN)/report.html, $(RUN)/pictures and $(RUN)/ranked.json."

paper: ## The experiment of the paper: its sizes, five searches to each listed orientation
	@$(MAKE) --no-print-directory run \
	    SIZE="--set bin_scan.attempts=planner --set tool.roll=listed"

quick: ## The same with fewer test grasps and attempts, into run/quick
	@$(MAKE) --no-print-directory run RUN=run/quick SIZE="$(QUICK)"

install: $(VENV)/.runtime ## Create the virtual environment and install reachmap
dev: $(VENV)/.dev ## Add what tests, checks and documentation need

test: $(VENV)/.dev ## Run the default test suite (COVERAGE=yes measures it)
	$(BIN)/python -m pytest -n $(JOBS) $(if $(COVERAGE),--cov --cov-report=term:skip-covered)

test-slow: $(VENV)/.dev ## Run the tests that take minutes
	$(BIN)/python -m pytest -n $(JOBS) -m slow --hypothesis-profile=explore

test-lowest: $(TOOLS)/uv ## Run the default suite with the oldest dependencies that are allowed
	$(TOOLS)/uv pip compile -q --resolution lowest-direct --only-binary :all: --extra test --extra docs pyproject.toml \
	    --python-version 3.11 -o build/lowest.txt
	$(TOOLS)/uv venv -q --seed --clear --python 3.11 build/lowest
	$(TOOLS)/uv pip install -q --python build/lowest/bin/python -r build/lowest.txt
	$(TOOLS)/uv pip install -q --python build/lowest/bin/python --no-deps --editable .
	@# Old versions may use what newer ones of other packages call deprecated.
	build/lowest/bin/python -m pytest -n $(JOBS) -W ignore::DeprecationWarning \
	    -W "ignore:numpy.ndarray size changed:RuntimeWarning"

fuzz: $(VENV)/.dev ## Let a fuzzer at every reader of files, FUZZ_S seconds each
	$(PIP) install --editable '.[fuzz]'
	@set -e; for target in cell urdf srdf limits grasps hdf5; do \
	    $(BIN)/python -m tests.fuzz.readers $$target -max_total_time=$(FUZZ_S); done

lock: $(TOOLS)/uv ## Write requirements.lock: the newest versions, with their hashes
	$(TOOLS)/uv pip compile -q --universal --python-version 3.11 --generate-hashes --upgrade \
	    --no-annotate --no-emit-index-url --no-emit-find-links \
	    --custom-compile-command "make lock" --extra xacro --extra view --extra dask \
	    --extra xarray pyproject.toml -o requirements.lock

sbom: $(TOOLS)/uv ## Write build/sbom.json (CycloneDX) of requirements.lock
	$(TOOLS)/cyclonedx-py requirements requirements.lock --pyproject pyproject.toml \
	    --output-reproducible -o build/sbom.json

audit: $(TOOLS)/uv ## Look the versions of requirements.lock up among known vulnerabilities
	$(TOOLS)/pip-audit --requirement requirements.lock --require-hashes --disable-pip

lint: $(VENV)/.dev view ## Format, lint, types, architecture
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/architecture

check: lint docs ## All checks that are not tests

docs: $(VENV)/.dev ## Build the documentation into build/docs; warnings are errors
	$(BIN)/python -m sphinx -E -W --keep-going -q -b html docs build/docs
	@echo "Open build/docs/index.html"

bench: $(VENV)/.dev ## Run the benchmarks, one after the other
	@set -e; for script in benchmarks/bench_*.py; do \
	    echo "== $$script"; $(BIN)/python $$script; done

wheel: $(VENV)/.dev ## Build sdist and wheel into dist/
	rm -rf build/lib build/bdist.*
	$(BIN)/python -m build --outdir dist .

view: ## Symlinks that show the installed package layout to type checkers
	@mkdir -p build/view/reachmap
	@cd build/view/reachmap && find . -xtype l -delete && \
	    ln -sfn ../../../cli cli && ln -sfn ../../../cells cells && \
	    for entry in ../../../src/reachmap/[a-z_]*; do \
	        case $$entry in *__pycache__) ;; *) ln -sfn $$entry . ;; esac; done

clean: ## Remove what was built; keep the environment and the results
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis htmlcov
	find . -path ./$(VENV) -prune -o -name __pycache__ -type d -exec rm -rf {} +

clean-run: ## Remove the results of the pipeline
	rm -rf run

$(TOOLS)/uv:
	$(PYTHON) -m venv build/tools
	$(TOOLS)/python -m pip install -qq uv cyclonedx-bom pip-audit

# --- environment ------------------------------------------------------------------

$(BIN)/python:
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if (3, 11) <= v < (3, 14) \
	    else "reachmap needs Python 3.11, 3.12 or 3.13; set PYTHON=python3.12, say")'
	$(PYTHON) -m venv $(VENV)
	$(PIP) install --upgrade pip

$(VENV)/.runtime: pyproject.toml | $(BIN)/python
	@echo "Installing reachmap and its engines (about 1 GB, a minute or two) ..."
	$(PIP) install --editable .
	@touch $@

$(VENV)/.dev: pyproject.toml | $(BIN)/python
	@echo "Installing reachmap for development (a minute or two) ..."
	$(PIP) install --editable '.[dev]'
	@touch $(VENV)/.runtime $@

# --- pipeline: every file is one command, and make knows what is up to date ---------
# Not `reachmap run`, which refuses a folder whose cell has changed: make makes anew what
# a newer cell or list leaves stale, and stops at any file (`make run/bin.h5`).

$(RUN)/workspace.h5: $(wildcard cells/$(CELL).yaml $(CELL)) | $(VENV)/.runtime
	@mkdir -p $(RUN)
	$(REACHMAP) workspace-scan $(CELL) $(SIZE) $(SCAN) -o $@

$(RUN)/placement.h5: $(RUN)/workspace.h5
	$(REACHMAP) place-bin $< -j $(WORKERS) -o $@ --overwrite

$(RUN)/bin.h5: $(RUN)/placement.h5
	$(REACHMAP) bin-scan $< $(SCAN) -o $@

$(RUN)/.pictures: $(RUN)/workspace.h5 $(RUN)/placement.h5 $(RUN)/bin.h5
	$(REACHMAP) heatmap $(RUN)/workspace.h5 -o $(RUN)/pictures --overwrite
	$(REACHMAP) heatmap $(RUN)/placement.h5 -o $(RUN)/pictures --overwrite
	$(REACHMAP) heatmap $(RUN)/bin.h5 -o $(RUN)/pictures --overwrite
	@touch $@

$(RUN)/ranked.json: $(RUN)/bin.h5 $(GRASPS)
	$(REACHMAP) rank $(GRASPS) --map $< --chart $(RUN)/ranking.png -o $@ --overwrite

$(RUN)/report.html: $(RUN)/ranked.json $(RUN)/.pictures
	$(REACHMAP) report $(RUN) -o $@ --overwrite
