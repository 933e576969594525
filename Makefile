# make demo and make test work on a fresh machine with Python >= 3.11 and make.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
WORKERS ?= 2
# Where the versions of the site stand; a folder that is kept elsewhere keeps the earlier ones.
SITE := build/site
# One thread a process: the tests run side by side, and small matrices gain nothing from more.
THREADS := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMEXPR_NUM_THREADS=1

# Types and layers are checked as a user has them: on an installed wheel, not on the checkout.
ON_INSTALLED := $(if $(filter /%,$(BIN)),$(BIN),../../$(BIN))

.PHONY: help install demo test test-all pytest pytest-all lowest lint style types docs dist wheel benchmarks clean

help:
	@echo "make demo        environment, install, and the main job on simulated data (pictures in demo-output/)"
	@echo "make test        lint, types, layers and the tests of less than a second"
	@echo "make test-all    the same and the slow tests, of which .ci/run runs a quarter"
	@echo "make lowest      the tests of less than a second with the lowest versions of all dependencies, in build/lowest"
	@echo "make lint        ruff; mypy --strict and import-linter on an installed wheel"
	@echo "make docs        the documentation as a site, this version in a folder of its own in build/site"
	@echo "make dist        wheel and sdist in dist/, built twice to the same bytes"
	@echo "make wheel       the same, and the wheel tried in an environment of its own"
	@echo "make benchmarks  print the figures that the README and docs state"
	@echo "make clean       remove the environment and everything that was built"

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'pamid needs Python 3.11 or newer')"
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	touch $@

demo: install
	$(THREADS) $(BIN)/pamid demo --out demo-output

lint: style types

style: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install
	rm -rf build/lib build/wheel build/installed
	$(BIN)/python -W ignore -m pip wheel --quiet --no-deps --no-build-isolation -w build/wheel .
	$(BIN)/python -W ignore -m pip install --quiet --no-deps --target build/installed build/wheel/*.whl
	cd build/installed && $(ON_INSTALLED)/lint-imports --config ../../pyproject.toml --no-cache
	cd build/installed && $(ON_INSTALLED)/mypy --config-file ../../pyproject.toml --cache-dir ../../.mypy_cache

# Each worker begins with one half of the tests in their order, so that what a module computes once is computed in one.
pytest: install
	$(THREADS) $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -m "not slow and not long"

# QUARTER="--quarter KEY" runs a quarter of the slow tests, drawn by a key, as .ci/run does to end within twenty minutes.
QUARTER ?=

pytest-all: install
	$(THREADS) $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(QUARTER)

# Types take one core and some waiting: they are checked beside the tests, and told of where they fail. Otherwise
# pytest's closing line is the last one.
test: style
	@mkdir -p build; $(MAKE) --no-print-directory types >build/types.log 2>&1 & types=$$!; \
	$(MAKE) --no-print-directory pytest; tests=$$?; \
	wait $$types || { cat build/types.log; echo "types or layers fail, see above"; exit 1; }; exit $$tests

test-all: lint pytest-all

# An environment of its own, some minutes and GB; Python 3.11 or 3.12, since the lowest versions know no later one.
lowest: build/lowest/.installed
	$(THREADS) build/lowest/bin/python -m pytest -n $(WORKERS) -m "not slow and not long" $(TESTS)

build/lowest/.installed: pyproject.toml constraints-lowest.txt
	$(PYTHON) -c "import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)) and 'needs Python 3.11 or 3.12')"
	test -x build/lowest/bin/python || $(PYTHON) -m venv build/lowest
	build/lowest/bin/python -m pip install --quiet --disable-pip-version-check -c constraints-lowest.txt -e ".[test]"
	touch $@

# A warning is an error; then the version stands beside those of earlier builds, every link
# within it is followed, and its pages are drawn where there is a browser.
docs: install
	version=$$($(BIN)/python -c "import pamid; print(pamid.__version__)") && \
	$(THREADS) $(BIN)/python -m sphinx -W --keep-going -q -b html -d build/doctrees docs $(SITE)/$$version && \
	$(BIN)/python docs/versions.py $(SITE) && \
	$(BIN)/python docs/check_site.py $(SITE)/$$version --draw

dist: install
	$(BIN)/python .ci/dist.py

# The wheel is installed into a new environment and used there, away from the checkout: commands, and tests of the rooms
# that read templates of the package. WHEEL_TESTS= runs all tests of less than a second.
WHEEL_TESTS ?= tests/report/test_report.py tests/survey tests/export/test_export_formulas.py
# COMPLETE=--complete installs the dependencies, too, as a user has them, and runs the demo.
COMPLETE ?=
wheel: dist
	$(THREADS) $(BIN)/python .ci/wheel.py $(COMPLETE) --tests -q -n $(WORKERS) $(WHEEL_TESTS)

benchmarks: install
	@for file in benchmarks/[!_]*.py; do echo "== $$file"; $(THREADS) $(BIN)/python $$file || exit 1; done

clean:
	rm -rf $(VENV) build dist *.egg-info demo-output results docs/api docs/auto_gallery .pytest_cache .mypy_cache \
		.ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
