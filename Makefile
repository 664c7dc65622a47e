# One command each; every target first installs what it needs, and does that only when something
# changed. `make help` lists them.

PYTHON ?= python3
JOBS ?= 2

VENV := .venv
BIN := $(VENV)/bin
RUN := $(BIN)/python
# Written after an installation that succeeded: what the demo needs, and what everything needs.
INSTALLED_ALL := $(VENV)/.installed-all
INSTALLED_DEV := $(VENV)/.installed-dev
TEST := $(RUN) -m pytest -n $(JOBS) --cov

VERSION_CHECK := import sys; v = sys.version_info; v >= (3, 11) or sys.exit( \
	"Shapechanger needs Python 3.11 or newer, and %s is %d.%d: " % (sys.executable, v[0], v[1]) \
	+ "name a newer one, as in `make PYTHON=python3.12 test`.")

.DEFAULT_GOAL := help
.NOTPARALLEL:  # Two installations at once would spoil each other.
.PHONY: help setup demo test test-all check bench clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s%s\n", $$1, $$2 }' Makefile

setup: $(INSTALLED_DEV)  ## create .venv with everything that the other targets need
	@echo "Ready: source $(BIN)/activate"

demo: $(INSTALLED_ALL)  ## move a skill from a pole to one twice as long; see results/demo
	$(BIN)/shapechanger transfer shapechanger/InvertedPendulum-v1 \
		shapechanger/BigInvertedPendulum-v1 --seeds 5 --source-steps 16384 --out results/demo

test: $(INSTALLED_DEV)  ## run the quick tests; the pure parts must be covered to the last line
	$(TEST) -m "not slow"

test-all: $(INSTALLED_DEV)  ## run all tests, the slow ones too
	$(TEST)

check: $(INSTALLED_DEV)  ## check format, lint and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(RUN) -m pyright

bench: $(INSTALLED_DEV)  ## measure every number that the project promises
	$(RUN) -m benchmarks.run

clean:  ## remove what the other targets made, but keep results/
	rm -rf $(VENV) build dist htmlcov .coverage .coverage.* .hypothesis .pytest_cache .ruff_cache \
		MUJOCO_LOG.TXT
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(RUN):
	@$(PYTHON) -c '$(VERSION_CHECK)'
	$(PYTHON) -m venv --clear $(VENV) || { rm -rf $(VENV); exit 1; }

$(INSTALLED_ALL): pyproject.toml constraints.txt | $(RUN)
	@$(RUN) -c '$(VERSION_CHECK)'
	@rm -f $@
	$(RUN) -m pip install --quiet -c constraints.txt -e '.[all]'
	@touch $@

$(INSTALLED_DEV): pyproject.toml constraints.txt | $(RUN)
	@$(RUN) -c '$(VERSION_CHECK)'
	@rm -f $@
	$(RUN) -m pip install --quiet -c constraints.txt -e '.[all,dev]'
	@touch $(INSTALLED_ALL) $@
