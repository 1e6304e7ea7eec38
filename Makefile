# Sets everything up in .venv and runs the main job or the tests; needs Python 3.11+ and the package registries only.
PYTHON ?= python3
ifeq ($(OS),Windows_NT)
BIN := .venv/Scripts
else
BIN := .venv/bin
endif
JOBS ?= auto
# Containers often ask Python to keep nothing that it compiles. Every process of demo and tests would then compile its
# libraries again, two seconds each; what is kept lies in .venv and in folders that git ignores.
export PYTHONDONTWRITEBYTECODE :=
# mypy on all cores: half the wait where it has no cache yet. Releases that cannot do it do not look.
export MYPY_NUM_WORKERS ?= auto

.PHONY: demo .demo-words test .tests quick coverage test-lowest fuzz lint .style .types .types-beside hooks docs experiments blender test-blender setup setup-test clean

setup: .venv/.installed
setup-test: .venv/.installed-test

.venv/.installed: pyproject.toml
	@echo "Setting up .venv: fetches 250 MB of libraries, and says nothing meanwhile. A minute or so."
	$(PYTHON) -m venv .venv
	$(PYTHON) tools/install.py $(BIN)/python .
	$(PYTHON) -c "open('.venv/.installed', 'w').close()"

.venv/.installed-test: .venv/.installed
	@echo "Adding what the tests and the pages need, and system packages where this is root on Debian: a minute or two."
	$(PYTHON) tools/system_packages.py
	$(PYTHON) tools/install.py $(BIN)/python ".[test,broker]"
	$(PYTHON) -c "open('.venv/.installed-test', 'w').close()"

demo: .demo-words setup
	$(BIN)/lidarspectra demo

.demo-words:
	@echo "$(if $(wildcard .venv/.installed),Maps,Sets up .venv (a minute or so) and maps) the light in a room that comes with the package: about 20 s on two idle cores."

lint: .style .types

.style: setup-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

.types: setup-test
	$(BIN)/mypy

# mypy beside the tests: it has the processor while they wait. One process of it, since theirs are as many as the cores.
test: .style
	$(MAKE) --no-print-directory --jobs=2 .types-beside .tests

.types-beside: export MYPY_NUM_WORKERS := 0
.types-beside: .types

.tests: setup-test
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal

docs: setup-test
	$(BIN)/python -m sphinx -W --keep-going -q docs docs/_build/html

quick: setup-test
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "not slow"

# What the quick unit tests pass through, file by file.
coverage: setup-test
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "not slow" --cov --cov-report=term:skip-covered tests/unit

# The quick unit tests with every dependency at its lower bound. Old libraries warn of the new ones below them: no error here.
LOWEST := .venv-lowest/$(notdir $(BIN))
test-lowest:
	$(PYTHON) -m venv .venv-lowest
	$(LOWEST)/python -m pip install --quiet --upgrade pip uv
	$(LOWEST)/python tools/lowest_bounds.py > .venv-lowest/lowest.txt
	$(LOWEST)/uv pip install --quiet --python $(LOWEST)/python --constraint .venv-lowest/lowest.txt --editable ".[test]"
	$(LOWEST)/python -m pytest -n $(JOBS) --dist worksteal -m "not slow" tests/unit \
		-W default::DeprecationWarning -W default::PendingDeprecationWarning -W default::FutureWarning

# Checks before each commit: ruff and mypy, from .venv (.pre-commit-config.yaml).
hooks: setup-test
	$(BIN)/pre-commit install

# The Blender extension as a zip in dist, checked; needs nothing but Python.
blender:
	$(PYTHON) blender/build.py dist

# Its tests in Blender's Python, with the program of .venv: 1 GB, and the Python that this Blender has (5.0 and before: 3.11).
BPY ?= 4.5.1
BLENDER_PYTHON ?= $(PYTHON)
BLENDER_BIN := .venv-blender-$(BPY)/$(notdir $(BIN))
.venv-blender-$(BPY)/.installed:
	$(BLENDER_PYTHON) -m venv .venv-blender-$(BPY)
	$(BLENDER_BIN)/python -m pip install --quiet bpy==$(BPY) "pytest>=8.3"
	$(BLENDER_BIN)/python -c "open('.venv-blender-$(BPY)/.installed', 'w').close()"

test-blender: setup .venv-blender-$(BPY)/.installed
	$(BLENDER_BIN)/python -m pytest -c blender/pytest.ini blender/tests

# 10,000 damaged files for every reader: an hour or more on two cores; FUZZ="--only glb" for one (tests/fuzz/campaign.py).
fuzz: setup-test
	$(BIN)/python tests/fuzz/campaign.py $(FUZZ)

# The paper's experiments from nothing to docs/results.md; QUICK=--quick for a first look.
experiments: setup-test
	$(BIN)/python -m research.scenes.true_light office
	$(BIN)/python -m research.scenes.true_light apartment
	$(BIN)/python -m research.scenes.true_light large-office
	$(BIN)/python -m research.benchmarks.experiments $(QUICK)

clean:
	$(PYTHON) -c "import glob, shutil; [shutil.rmtree(name, ignore_errors=True) for name in glob.glob('.venv*')]"
