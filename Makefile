# make demo and make test work on a fresh machine with Python >= 3.11 and make.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
WORKERS ?= 2
# One thread a process: the tests run side by side, and small matrices gain nothing from more.
THREADS := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMEXPR_NUM_THREADS=1

# Types and layers are checked as a user has them: on an installed wheel, not on the checkout.
ON_INSTALLED := $(if $(filter /%,$(BIN)),$(BIN),../../$(BIN))

.PHONY: help install demo test test-all pytest pytest-all lint docs dist wheel benchmarks clean

help:
	@echo "make demo        environment, install, and the main job on simulated data (pictures in demo-output/)"
	@echo "make test        lint, types, layers and the tests of less than a second"
	@echo "make test-all    the same and the slow tests, as .ci/run does"
	@echo "make lint        ruff; mypy --strict and import-linter on an installed wheel"
	@echo "make docs        the documentation as a site in build/site"
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

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	rm -rf build/lib build/wheel build/installed
	$(BIN)/python -W ignore -m pip wheel --quiet --no-deps --no-build-isolation -w build/wheel .
	$(BIN)/python -W ignore -m pip install --quiet --no-deps --target build/installed build/wheel/*.whl
	cd build/installed && $(ON_INSTALLED)/lint-imports --config ../../pyproject.toml --no-cache
	cd build/installed && $(ON_INSTALLED)/mypy --config-file ../../pyproject.toml --cache-dir ../../.mypy_cache/installed
	cd build/installed && $(ON_INSTALLED)/mypy --config-file= --strict --follow-imports=silent \
		--cache-dir ../../.mypy_cache/user ../../tests/typing/user_script.py

pytest: install
	$(THREADS) $(BIN)/python -m pytest -n $(WORKERS) -m "not slow and not long"

pytest-all: install
	$(THREADS) $(BIN)/python -m pytest -n $(WORKERS)

# pytest comes last, so that its closing line is the last one.
test: lint pytest

test-all: lint pytest-all

# A warning is an error; then every link within the site is followed.
docs: install
	$(THREADS) $(BIN)/python -m sphinx -W --keep-going -q -b html -d build/doctrees docs build/site
	$(BIN)/python docs/check_site.py build/site

dist: install
	$(BIN)/python .ci/dist.py

# The wheel is installed into a new environment and used there, away from the checkout.
wheel: dist
	$(BIN)/python .ci/wheel.py

benchmarks: install
	@for file in benchmarks/[!_]*.py; do echo "== $$file"; $(THREADS) $(BIN)/python $$file || exit 1; done

clean:
	rm -rf $(VENV) build dist *.egg-info demo-output results docs/api docs/auto_gallery .pytest_cache .mypy_cache \
		.ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
