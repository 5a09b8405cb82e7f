# Works on a machine with python3 (3.11 or newer), pip and make: everything else is installed into .venv.
.DEFAULT_GOAL := help
.PHONY: help demo test lint bench gallery studio clean
SHELL := /bin/sh

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
# Two workers: each loads the compiled kernels and the CAD kernel once (about 0.6 GB), and small machines have two cores.
WORKERS ?= 2

export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_NO_INPUT := 1
export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1

help: ## Say what can be made
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' $(MAKEFILE_LIST)

demo: $(VENV)/.test-stamp ## Scan CAD parts with the simulator, rebuild a whole part and one surface, write STEP files and reports into demo/
	@mkdir -p demo
	$(BIN)/python examples/demo.py demo

test: $(VENV)/.test-stamp ## Run the tests
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile $(PYTEST_ARGS)

lint: $(VENV)/.lint-stamp ## Check style, types and layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports

bench: $(VENV)/.test-stamp ## Measure accuracy and speed; with SCANS=FOLDER on the scans of a folder too
	@# All of them, whatever one says; then fail if one did, as that of surfaces does when a row misses what is wanted.
	@failed=0; \
	$(BIN)/python -m benchmarks.parts --quick || failed=1; \
	$(BIN)/python -m benchmarks.edges --quick || failed=1; \
	$(BIN)/python -m benchmarks.surface || failed=1; \
	$(BIN)/python -m benchmarks.speed || failed=1; \
	[ -z "$(SCANS)" ] || $(BIN)/python -m benchmarks.scans "$(SCANS)" || failed=1; \
	exit $$failed

gallery: $(VENV)/.test-stamp ## Redo the paper's experiments and their pictures
	$(BIN)/python -m examples.paper
	@mkdir -p demo
	$(BIN)/python examples/demo.py demo
	$(BIN)/python -m examples.picture demo/scan.ply docs/images/demo.png

studio: $(VENV)/.test-stamp ## Build the page of the studio from studio-web (needs node)
	PYTHON=$(abspath $(BIN))/python studio-web/build.sh

clean: ## Remove what was made, but not .venv
	rm -rf demo dist build .pytest_cache .ruff_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Python 3.11 or newer is needed; say which, e.g.: make PYTHON=python3.12"; exit 1; }
	@# Some systems ship python3 without its venv module; virtualenv then comes by pip.
	$(PYTHON) -m venv $(VENV) || \
	  { rm -rf $(VENV) build/virtualenv && $(PYTHON) -m pip install --quiet --target build/virtualenv virtualenv && \
	    PYTHONPATH=build/virtualenv $(PYTHON) -m virtualenv $(VENV); }

$(VENV)/.test-stamp: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	@touch $@

$(VENV)/.lint-stamp: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[test,lint]'
	@touch $@
