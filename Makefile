# Every target installs what it needs first, and only when something changed. `make help` lists the
# targets.

# Some container images forbid Python to cache bytecode. Then each process of a study compiles the
# package again, and each worker of pytest all tests.
export PYTHONDONTWRITEBYTECODE :=

PYTHON ?= python3
JOBS ?= 2

# Tests of whole programs spend half of their time waiting for the programs, so one more runs at once.
SYSTEM_JOBS ?= $(shell expr $(JOBS) + 1)

VENV := .venv
BIN := $(VENV)/bin
RUN := $(BIN)/python
# LeRobot's torch is older than ours, so its tests have an environment of their own.
LEROBOT := integrations/lerobot_robot_shapechanger
LEROBOT_VENV := .venv-lerobot
INSTALLED_LEROBOT := $(LEROBOT_VENV)/.installed
# Models of other people's robots: packages of which nothing is imported.
ROBOT_FILES := .robot-files
INSTALLED_ROBOTS := $(ROBOT_FILES)/.installed
# Tests of the files that `tool.coverage` measures. Under coverage a test takes almost twice as long.
COVERING := tests/contract/test_drive_reward.py tests/contract/test_limits.py tests/envs/stepping tests/envs/test_own.py tests/envs/test_own_models.py \
	tests/envs/test_own_scenes.py tests/envs/test_own_tasks.py tests/envs/vector tests/finger/identify \
	tests/finger/test_paths.py tests/finger/test_task.py tests/laws tests/morphology tests/robot/guard tests/robot/link \
	tests/robot/profile tests/test_architecture.py tests/test_errors.py tests/test_layout.py \
	tests/transfer/body_map tests/transfer/metrics

# Written after a successful installation: of `all` for the demo, and of `all` and `dev` for the tests.
INSTALLED_ALL := $(VENV)/.installed-all
INSTALLED_DEV := $(VENV)/.installed-dev
STUBS := typings/mujoco/.generated
# Tests of one module mostly stay on one worker, so that its fixtures are made once.
PYTEST := $(RUN) -m pytest -n $(JOBS) --dist worksteal
# The theme would advertise its successor at each build.
SITE := NO_MKDOCS_2_WARNING=1 $(RUN) -m mkdocs build --strict
VERSION_CHECK := import sys; v = sys.version_info; v >= (3, 11) or sys.exit( \
	"Shapechanger needs Python 3.11 or newer, and %s is %d.%d: " % (sys.executable, v[0], v[1]) \
	+ "name a newer one, as in `make PYTHON=python3.12 test`.")

# uv takes a third of pip's time. It does not read pip's settings, so pip's indexes are passed to it.
PIP_TO_UV := s/^[^.]+\.find-links=/export UV_FIND_LINKS=/p; s/^[^.]+\.index-url=/export UV_DEFAULT_INDEX=/p; \
	s/^[^.]+\.extra-index-url=/export UV_INDEX=/p
INSTALL = $(RUN) -m pip install --quiet -c constraints.txt uv && \
	eval "$$($(RUN) -m pip config list | sed -nE '$(PIP_TO_UV)')" && UV_INDEX_STRATEGY=unsafe-best-match \
	$(RUN) -m uv pip install --quiet --python $(RUN) -c constraints.txt

.DEFAULT_GOAL := help
.NOTPARALLEL:  # Two installations at once would interfere.
.PHONY: help setup demo test test-system test-all mutants test-matrix release test-lerobot test-robots check bench docs gallery clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s%s\n", $$1, $$2 }' Makefile

setup: $(INSTALLED_DEV)  ## create .venv with all dependencies
	@echo "Ready: source $(BIN)/activate"

demo: $(INSTALLED_ALL)  ## transfer a policy to a pole three times as long; see results/demo
	$(BIN)/shapechanger transfer InvertedPendulum InvertedPendulum \
		--target-body '[{"edit": "stretch", "body": "pole", "factor": 3}]' \
		--seeds 5 --source-steps 16384 --steps 16384 --out results/demo

test: $(INSTALLED_DEV)  ## run the fast tests, with the coverage gate
	$(PYTEST) -m "not slow and not system" $(COVERING) --cov
	$(PYTEST) -m "not slow and not system" $(COVERING:%=--ignore=%)

test-system: $(INSTALLED_DEV)  ## run the tests of whole programs: processes, browsers, terminals
	$(PYTEST) -m "system and not slow" -n $(SYSTEM_JOBS)

test-all: $(INSTALLED_DEV)  ## run all tests, including the slow ones
	$(PYTEST) --cov

mutants: $(INSTALLED_DEV)  ## change code in small ways that its tests must notice; hours
	$(RUN) -m benchmarks.run mutants

test-matrix: $(INSTALLED_DEV)  ## run the fast tests against other versions and installations
	$(RUN) scripts/test_matrix.py

release: $(INSTALLED_DEV)  ## build wheel and sdist into dist/, and test them on each Python here; an hour
	@! ls changelog.d/*.*.md 2>/dev/null || { echo "These are not in CHANGELOG.md yet: run towncrier build"; exit 1; }
	$(RUN) scripts/test_matrix.py

test-lerobot: $(INSTALLED_LEROBOT) $(STUBS)  ## test our robots in LeRobot; installs 6 GB
	$(RUN) -m pyright -p $(LEROBOT)
	$(LEROBOT_VENV)/bin/python -m pytest -c $(LEROBOT)/pyproject.toml --rootdir . $(LEROBOT)/tests

test-robots: $(INSTALLED_ROBOTS)  ## test robot files of other projects' packages for 20 minutes; installs 1 GB
	$(RUN) -m pytest tests/envs/test_real_robots.py

check: $(STUBS)  ## check format, lint, words, imports and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/codespell
	$(BIN)/lint-imports --no-cache
	$(RUN) -m pyright --threads $(JOBS)

bench: $(INSTALLED_DEV)  ## measure every number that the documentation states
	$(RUN) -m benchmarks.run

docs: $(INSTALLED_DEV)  ## check the documentation, and build its site into site/
	$(PYTEST) -m "not system" tests/test_docs.py tests/test_documented_commands.py tests/test_site.py
	$(SITE)

gallery: $(INSTALLED_DEV)  ## draw all pictures and clips of the documentation; trains for minutes
	$(RUN) scripts/draw_pictures.py

clean:  ## remove build products and environments; keep results/
	rm -rf $(VENV) $(LEROBOT_VENV) $(ROBOT_FILES) build dist site htmlcov .coverage .coverage.* .hypothesis .pytest_cache .ruff_cache \
		MUJOCO_LOG.TXT
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(RUN):
	@$(PYTHON) -c '$(VERSION_CHECK)'
	$(PYTHON) -m venv --clear $(VENV) || { rm -rf $(VENV); exit 1; }

$(INSTALLED_ALL): pyproject.toml constraints.txt | $(RUN)
	@$(RUN) -c '$(VERSION_CHECK)'
	@rm -f $@
	$(INSTALL) -e '.[all]'
	@touch $@

$(INSTALLED_DEV): pyproject.toml constraints.txt | $(RUN)
	@$(RUN) -c '$(VERSION_CHECK)'
	@rm -f $@
	$(INSTALL) -e '.[all,dev]'
	@touch $(INSTALLED_ALL) $@

# Type stubs of the installed MuJoCo, which ships none.
$(STUBS): scripts/generate_stubs.py $(INSTALLED_DEV)
	$(RUN) $<
	@touch $@

$(INSTALLED_LEROBOT): pyproject.toml $(LEROBOT)/pyproject.toml $(LEROBOT)/constraints.txt $(INSTALLED_DEV)
	$(PYTHON) -m venv $(LEROBOT_VENV)
	$(RUN) -m uv pip install --quiet --python $(LEROBOT_VENV)/bin/python \
		-c $(LEROBOT)/constraints.txt -e . -e '$(LEROBOT)[test]'
	@touch $@

$(INSTALLED_ROBOTS): tests/robot_files.txt $(INSTALLED_DEV)
	rm -rf $(ROBOT_FILES)
	$(RUN) -m pip install --quiet --no-deps --no-compile --target $(ROBOT_FILES) -r $<
	@touch $@
