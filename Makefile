# What a newcomer and the checks run. Needs Python 3.11 or newer, and make.
#
#   make demo     the yeast channel, with trajectory, figures and summary in out/yeast
#   make test     lint, types and tests
#   make test-long  further variants of the tests, which take long
#   make coverage   the tests, and the share of the lines of Python that they run
#   make docs     this program's documentation, as a web site in site/
#   make notebooks   executes the notebooks in docs/notebooks and keeps what they show
#   make clean    removes what these targets have made
#
# Another interpreter:  make PYTHON=python3.13 demo
# One part of the tests: make tests PYTEST_FLAGS="tests/chemistry -x"

PYTHON ?= python3
VENV ?= .venv
SITE ?= site
# several processes, since many tests are too small for several threads
PYTEST_FLAGS ?= -n auto --maxprocesses 4 --dist worksteal

BIN = $(VENV)/bin
PIP = $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: demo test test-long lint types tests coverage docs docs-tools notebooks clean
.DELETE_ON_ERROR:

demo: $(VENV)/.run
	$(BIN)/particell run yeast-channel --out out/yeast --overwrite

test: lint types tests

lint: $(VENV)/.test
	$(BIN)/ruff check
	$(BIN)/ruff format --check

types: $(VENV)/.test
	$(BIN)/mypy

tests: $(VENV)/.test
	$(BIN)/python -m pytest $(PYTEST_FLAGS)

test-long: $(VENV)/.test
	$(BIN)/python -m pytest $(PYTEST_FLAGS) -m long

coverage: $(VENV)/.test
	rm -rf .cache/coverage && mkdir -p .cache/coverage
	$(BIN)/python -m coverage run -m pytest $(PYTEST_FLAGS)
	$(BIN)/python -m coverage combine --quiet
	$(BIN)/python -m coverage report

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict --site-dir "$(abspath $(SITE))"
	@echo "documentation in $(SITE)/index.html"

docs-tools: $(VENV)/.docs

notebooks: $(VENV)/.test
	$(BIN)/python docs/notebooks/execute.py

clean:
	rm -rf .venv site .cache out/yeast build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis

# The environment is made once, and again where pyproject.toml has changed: the files below say so.

$(VENV)/.python:
	@command -v $(PYTHON) >/dev/null || \
	  { echo "There is no '$(PYTHON)' here: install Python 3.11 or newer, or name it: make PYTHON=..."; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Python 3.11 or newer is needed, and '$(PYTHON)' is $$($(PYTHON) --version 2>&1): name another with make PYTHON=..."; exit 1; }
	@echo "making the environment $(VENV) (once; a minute or two)"
	@$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.run: pyproject.toml | $(VENV)/.python
	@$(PIP) --editable .
	@touch $@

$(VENV)/.test: pyproject.toml | $(VENV)/.python
	@$(PIP) --editable '.[test,lint]'
	@touch $@

$(VENV)/.docs: pyproject.toml | $(VENV)/.python
	@$(PIP) --editable '.[docs]'
	@touch $@
