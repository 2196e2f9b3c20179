# `make reproduce` runs the studies, `make test` the tests; both make the environment first.
# The other targets are for those who change Ethogram: see CONTRIBUTING.md.

PYTHON ?= python3
OUT ?= results
JOBS ?= 2

BIN := .venv/bin
READY := .venv/.ready
DOCS_READY := .venv/.docs-ready
KERNELS := src/ethogram/physics/_native/build.json
REQUIREMENTS := pyproject.toml constraints.txt src/ethogram/__init__.py
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help venv kernels reproduce test test-slow check format docs bench constraints

help:  ## list these targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile | expand -t 14

venv: $(READY)  ## make the environment in .venv

kernels: $(KERNELS)  ## compile the native kernels, where their sources have changed

reproduce: $(KERNELS)  ## run every study's quick plan, then write the report: results/index.html
	$(BIN)/ethogram reproduce --plan quick --out $(OUT)

test: $(KERNELS)  ## run the tests that take seconds
	$(BIN)/pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder

test-slow: $(KERNELS)  ## run the tests that take minutes
	$(BIN)/pytest -m slow

check: $(READY)  ## check format, lint, types and import layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

format: $(READY)  ## format the code and mend what lint can mend
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(DOCS_READY)  ## build the site: docs/_build/html/index.html
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet docs docs/_build/html

bench: $(KERNELS)  ## measure speed and memory, beside the peers where there are any
	$(INSTALL) --editable '.[dev,bench]'
	for script in benchmarks/*.py; do $(BIN)/python $$script || exit; done

constraints: $(READY)  ## choose the newest allowed version of every dependency
	$(BIN)/uv pip compile --universal --all-extras --upgrade --python-version 3.11 --quiet \
		--no-header --no-annotate pyproject.toml --output-file constraints.txt

$(READY): $(REQUIREMENTS) | $(BIN)/python
	$(INSTALL) --editable '.[dev]'
	@touch $@

$(KERNELS): hatch_build.py $(shell find kernels -type f) | $(READY)
	$(BIN)/python hatch_build.py
	@touch $@

$(DOCS_READY): $(REQUIREMENTS) | $(READY)
	$(INSTALL) --editable '.[dev,docs]'
	@touch $@

$(BIN)/python:
	@command -v $(PYTHON) >/dev/null \
		|| { echo 'Ethogram needs Python 3.11 or newer, and there is no $(PYTHON) here.' >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "Ethogram needs Python 3.11 or newer; $$($(PYTHON) --version) is too old." \
			'Name another one: make PYTHON=python3.12' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
		|| { echo "$$($(PYTHON) --version) lacks its module venv;" \
			'on Debian and Ubuntu: apt-get install python3-venv' >&2; exit 1; }
	$(PYTHON) -m venv .venv
