# Every command a person needs. `make` alone lists them.

SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
REQUIREMENTS := grader/requirements
PIP := $(BIN)/python -m pip --disable-pip-version-check install -qq --require-hashes --no-deps
GRADER := PYTHONPATH=grader$${PYTHONPATH:+:$$PYTHONPATH} $(BIN)/python -m lab2_grader

SUBMISSION ?= solution
OUT ?=
INBOX ?=
JOBS ?=
SCHEDULER ?=
RESULTS ?= results
RUBRIC ?=
ISOLATION ?= auto
SOURCED := $(if $(and $(ROS_DISTRO),$(shell command -v ros2 2>/dev/null)),yes,)

.PHONY: help setup setup-dev isolation grade test test-slow lint bench stress clean lock

help: ## list the commands
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-18s %s\n", $$1, $$2}'

# --- set-up: each command below does what it needs by itself -----------------------------------

setup: $(VENV)/.ready isolation ## install what grading needs into .venv (the ROS wheels unless ROS is sourced)

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
		|| { echo "Python 3.10 or newer is needed; $(PYTHON) is $$($(PYTHON) --version). Try: make PYTHON=python3.12 …"; exit 2; }
	@$(PYTHON) -m venv $(VENV) >/dev/null 2>&1 || { rm -rf $(VENV); \
		if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			echo "Installing python3-venv …"; apt-get update -qq && apt-get install -y -qq python3-venv >/dev/null; \
			$(PYTHON) -m venv $(VENV); \
		else echo "This Python cannot make a virtual environment. Run: sudo apt-get install python3-venv"; exit 2; fi; }

$(VENV)/.ready: $(wildcard $(REQUIREMENTS)/*.txt) | $(VENV)/bin/python
	@echo "Installing $(if $(SOURCED),the grader's libraries (ROS 2 $(ROS_DISTRO) is sourced),the grader's libraries and ROS 2 from wheels) …"
	@$(PIP) -r $(REQUIREMENTS)/$(if $(SOURCED),sourced,wheels).txt
	@$(BIN)/python -m compileall -q grader/lab2_grader  # the sandbox shows it read-only, so nothing is compiled there
	@touch $@

setup-dev: $(VENV)/.ready-dev isolation ## install what the tests and linters need as well

$(VENV)/.ready-dev: $(REQUIREMENTS)/dev.txt $(VENV)/.ready
	@echo "Installing what the tests need …"
	@$(PIP) -r $(REQUIREMENTS)/$(if $(SOURCED),dev-sourced,dev).txt
	@touch $@

isolation: # bubblewrap, where it can be had
	@command -v bwrap >/dev/null || { \
		if [ "$(ISOLATION)" != off ] && [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			echo "Installing bubblewrap …"; \
			apt-get update -qq && apt-get install -y -qq bubblewrap >/dev/null || echo "bubblewrap could not be installed."; \
		fi; }

# --- grading ------------------------------------------------------------------------------------

grade: setup ## grade one submission: SUBMISSION=folder|archive|git-address [OUT=…] [RUBRIC=…] [ISOLATION=off]
	@$(GRADER) grade "$(SUBMISSION)" $(if $(OUT),--out "$(OUT)") $(if $(RUBRIC),--rubric "$(RUBRIC)") --isolation $(ISOLATION)

# --- development --------------------------------------------------------------------------------

test: setup-dev ## run every test but the slow ones
	@$(BIN)/python -m pytest grader -m "not slow"

test-slow: setup-dev ## run the tests that take long
	@$(BIN)/python -m pytest grader -m slow

lint: setup-dev ## check style, types and the lab's facts
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@cd grader && ../$(BIN)/mypy

bench: setup-dev ## measure how fast a grade is; writes build/bench.json
	@PYTHONPATH=grader $(BIN)/python grader/tests/bench.py build/bench.json

lock: setup-dev ## pin the dependencies anew: every *.in to its *.txt, with hashes
	@for name in base sourced wheels dev dev-sourced; do \
		$(BIN)/uv pip compile --quiet --universal --python-version 3.10 --generate-hashes --no-header \
			$(REQUIREMENTS)/$$name.in -o $(REQUIREMENTS)/$$name.txt; done

clean: ## remove what the commands made, but no results
	@rm -rf $(VENV) build dist .pytest_cache .ruff_cache .mypy_cache grader/.mypy_cache
