# make run: the main job on a sample log. Needs Python 3.11 or newer and make, nothing else.
PYTHON ?= python3
VENV   ?= .venv
LOG    ?= sample_logs/city.mcap
PYTEST_ARGS ?= -n 2

ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
else
BIN := $(VENV)/bin
endif

.DEFAULT_GOAL := help
.PHONY: help setup run test test-slow check score gate bench sample-logs clean

help:  ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "%-14s%s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

setup: $(VENV)/.package  ## virtual environment with vehnav in it
	@echo "vehnav is installed: $(BIN)/vehnav --help"

run: $(VENV)/.package  ## vehnav run on LOG (sample_logs/city.mcap)
	$(BIN)/vehnav run $(LOG)

test: $(VENV)/.test  ## the tests
	$(BIN)/python -m pytest $(PYTEST_ARGS)

test-slow: $(VENV)/.test  ## the slow tests
	$(BIN)/python -m pytest $(PYTEST_ARGS) -m slow

check: $(VENV)/.dev  ## style, types, imports
	$(BIN)/python -m ruff check .
	$(BIN)/python -m ruff format --check .
	$(BIN)/python -m mypy
	$(BIN)/lint-imports

score: $(VENV)/.package  ## the suite of real drives; says which are not on this machine
	$(BIN)/vehnav score tests/suites/real.toml

gate: $(VENV)/.package  ## the suite of simulated drives against its baseline
	$(BIN)/vehnav score tests/suites/simulated.toml

bench: $(VENV)/.test  ## speed, as ratios within one run
	$(BIN)/python tests/bench

sample-logs: $(VENV)/.package  ## make sample_logs/ again
	$(BIN)/python -m vehnav.simulate.samples sample_logs

clean:  ## remove what make has made
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	rm -rf .hypothesis .benchmarks .coverage vehnav.egg-info *.vehnav sample_logs/*.vehnav

# A stamp per set of packages; made again when pyproject.toml changes.
$(VENV)/.made:
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11))" || \
	  { echo "vehnav needs Python 3.11 or newer: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.package: pyproject.toml $(VENV)/.made
	$(BIN)/python -m pip install -q --disable-pip-version-check -e .
	@touch $@

$(VENV)/.test: pyproject.toml $(VENV)/.made
	$(BIN)/python -m pip install -q --disable-pip-version-check -e ".[test]"
	@touch $@ $(VENV)/.package

$(VENV)/.dev: pyproject.toml $(VENV)/.made
	$(BIN)/python -m pip install -q --disable-pip-version-check -e ".[dev]"
	@touch $@ $(VENV)/.test $(VENV)/.package
