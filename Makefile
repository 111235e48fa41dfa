# make demo       render a scene that comes along, and compare it with Blender's multiview
# make test       run the tests that are quick, with a real frame on every fill method; some minutes
# make test-all   run them all, which CI does; about 25 minutes (PYTEST_ARGS="-m blender" for some of them)
# make gui-test   the same in a real window: BLENDER_WINDOW="xvfb-run blender" (pictures in build/gui)
# make lint       ruff and pyright
# make extension  the zips to install in Blender, into dist/
# make bench      what a pair costs by every method, over scenes, sizes and a camera path (SCENES=folder); hours, and goes
#                 on where it was interrupted. BENCH_OPTIONS=--quick: the Cornell box alone, in five minutes
# make coverage   how often the estimate's interval holds the truth, in scenes of others (SCENES=folder); some 20 minutes
# make spending   what the numbers of probes and refinement are worth, one changed at a time (SCENES=folder); some minutes
# make hostile    try to break it, in some 3200 ways (docs/reliability.md); HOSTILE_OPTIONS="options --match size" for
#                 some of them; 40 minutes
# make preview    how long a preview in Blender takes, and what of that is not the pair (SCENES=folder); a minute
# make objects    what scenes of many objects cost Blender, and what a pair adds to that; some minutes
# make clean      remove everything that the others made, environments included
#
# Each sets itself up. The environment is .venv; for another Python:  make test PYTHON=python3.11 VENV=.venv-3.11

PYTHON ?=
VENV ?= .venv
LINT_VENV ?= .venv-lint
PYTEST_ARGS ?=

DEMO_SCENE ?= demo/still-life/still-life.blend
DEMO_OPTIONS ?= --size 960x540 --samples 32 --compare
DEMO_OUTPUT ?= demo-output

# The user's own file of measured costs is neither read nor written: each run begins alike.
export STEREO_REPROJECT_USER_FOLDER ?=

SCENES ?= ../shared/scenes
BENCH_OPTIONS ?=
COVERAGE_OPTIONS ?=
SPENDING_OPTIONS ?=
HOSTILE_OPTIONS ?=
OBJECTS_OPTIONS ?=

INSTALLED := $(VENV)/.installed
TEST_INSTALLED := $(VENV)/.test-installed
LINT_INSTALLED := $(LINT_VENV)/.installed
INSTALL_FROM := pyproject.toml setup.py
# setuptools warns at each editable installation that the package's folder is in the working directory: that is the idea
PIP := PYTHONWARNINGS=ignore $(VENV)/bin/python -m pip install --quiet

.PHONY: demo test test-all gui-test lint lint-tools extension bench coverage spending hostile preview objects clean

demo: $(INSTALLED)
	@$(VENV)/bin/python -m stereo_reproject render $(DEMO_SCENE) --output $(DEMO_OUTPUT) $(DEMO_OPTIONS)
	@echo "The pictures are in $(CURDIR)/$(DEMO_OUTPUT): stereo.png is the pair, holes.png what was traced again"

test: $(TEST_INSTALLED)
	@echo "The quick tests: about 9 minutes on two cores (make test-all has them all, in about 25)"
	@$(VENV)/bin/python -m pytest -m "not slow" $(PYTEST_ARGS) tests

test-all: $(TEST_INSTALLED)
	@echo "All tests: about 25 minutes on two cores"
	@$(VENV)/bin/python -m pytest $(PYTEST_ARGS) tests

gui-test: $(TEST_INSTALLED)
	@test -n "$$BLENDER_WINDOW" || { echo 'BLENDER_WINDOW names no Blender with a window: BLENDER_WINDOW="xvfb-run blender" make gui-test' >&2; exit 2; }
	@$(VENV)/bin/python -m pytest $(PYTEST_ARGS) tests/gui

lint: $(LINT_INSTALLED)
	$(LINT_VENV)/bin/python -m ruff check .
	$(LINT_VENV)/bin/python -m ruff format --check .
	$(LINT_VENV)/bin/python -m pyright --pythonpath $(LINT_VENV)/bin/python

lint-tools: $(LINT_INSTALLED)

extension: $(INSTALLED)
	@$(VENV)/bin/python .ci/extension.py

bench: $(TEST_INSTALLED)
	@$(VENV)/bin/python -m tests.bench.performance --scenes "$(SCENES)" $(BENCH_OPTIONS)

coverage: $(TEST_INSTALLED)
	@$(VENV)/bin/python tests/bench/coverage.py --scenes "$(SCENES)" $(COVERAGE_OPTIONS)

spending: $(TEST_INSTALLED)
	@$(VENV)/bin/python tests/bench/spending.py --scenes "$(SCENES)" $(SPENDING_OPTIONS)

hostile: $(TEST_INSTALLED)
	@$(VENV)/bin/python -m tests.hostile $(HOSTILE_OPTIONS)

preview: $(TEST_INSTALLED)
	@$(VENV)/bin/python tests/bench/preview.py --scenes "$(SCENES)"

objects: $(TEST_INSTALLED)
	@$(VENV)/bin/python tests/bench/many_objects.py $(OBJECTS_OPTIONS)

clean:
	rm -rf .venv .venv-* build dist wheels $(DEMO_OUTPUT) *.egg-info .pytest_cache .hypothesis .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Order-only: they look at the environment each time, and that alone installs nothing anew.
.PHONY: environment lint-environment
environment:
	@.ci/venv "$(VENV)" "$(PYTHON)"
lint-environment:
	@.ci/venv "$(LINT_VENV)"

$(INSTALLED): $(INSTALL_FROM) | environment
	@echo "Installing into $(VENV); Blender as a Python module is a large download"
	@$(PIP) --editable .
	@$(VENV)/bin/python .ci/check_bpy.py
	@touch $@

$(TEST_INSTALLED): $(INSTALLED)
	@$(PIP) --editable ".[test]"
	@touch $@

$(LINT_INSTALLED): pyproject.toml | lint-environment
	@$(LINT_VENV)/bin/python -m pip install --quiet --group lint
	@touch $@
