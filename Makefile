# make demo   train BNS against a damaged robot, leave runs/demo/ with a report
# make test   run the test suite
# make lint   formatting, lint and types
# make docs   build the documentation's site, with the reference, into site/
# make clean  remove the environment and build leftovers (never runs/)
#
# Each first makes .venv with what it needs, once: the demo what trains and reports
# (`bns view`, for 3D, says how to add Rerun), the others everything. PYTHON=... chooses
# the Python.

SHELL := /bin/sh
VENV := .venv
STAMP := $(VENV)/.installed
SMALL := $(VENV)/.demo
BIN := $(VENV)/bin
DEMO := runs/demo
PYTHON ?=

export RERUN_ANALYTICS ?= 0

.PHONY: help demo test lint docs env clean

help:
	@sed -n '1,/^$$/s/^# \{0,1\}//p' Makefile

demo: $(SMALL)
	$(BIN)/bns run demo --out $(DEMO) --resume

test: env
	$(BIN)/python -m pytest

lint: env
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/python .ci/check_types.py

docs: env
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo "Written: site/index.html"

env: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@sh .ci/venv $(VENV) $(PYTHON)
	@echo "Installing into $(VENV) (some minutes, once) ..."
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[dev]'
	@touch $@

# bytecode is made of what is imported alone: 200 MB less, and sooner installed
$(SMALL): pyproject.toml constraints.txt
	@sh .ci/venv $(VENV) $(PYTHON)
	@test -f $(STAMP) || echo "Installing into $(VENV) (some minutes, once) ..."
	@test -f $(STAMP) || $(BIN)/python -m pip install --quiet --no-compile \
		-c constraints.txt -e '.[demo]'
	@touch $@

clean:
	rm -rf $(VENV) site build dist *.egg-info
