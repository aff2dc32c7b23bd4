# The two commands of the README are `make paper` and `make test`; each builds .venv by itself.
PYTHON ?= python3
BIN := .venv/bin
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1

.PHONY: help setup paper test quick fuzz kills mutants corpus bench lint wheel wheel-check clean

help:
	@echo "make paper   compute the paper's figures and claims into out/paper/"
	@echo "make test    lint, types, import boundaries and the whole test suite"
	@echo "make quick   the same without the tests marked slow"
	@echo "make fuzz    fresh mutations of projects and robots for MINUTES=60, any SEED=n"
	@echo "make kills   kill a sweep 20 times at random (KILLS=n), and see that no row is lost or computed twice"
	@echo "make mutants falsify answers one by one, and see that a test notices (an hour); ROOM=delay for one room"
	@echo "make corpus  take every robot below FOLDER=… through sealag, into OUT=out/corpus.md; ONLY=--read reads them"
	@echo "make wheel-check  build sdist and wheel, install and use the wheel in a fresh environment"
	@echo "make bench   certificates and control ticks beside their peers, as ratios"
	@echo "make setup   build .venv only (the other commands do this by themselves)"

setup: .venv/.ready

.venv/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "sealag needs Python 3.11 or newer; set PYTHON=/path/to/python3.11")'
	@echo "[1/3] creating .venv"
	@$(PYTHON) -m venv .venv
	@echo "[2/3] installing the packages pinned in constraints.txt"
	@$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[dev]'
	@touch $@

# Numba does not see that a kernel used by another one changed, so all are compiled anew.
.venv/.ready: .venv/.installed $(wildcard src/sealag/kernels/*.py)
	@echo "[3/3] compiling kernels"
	@rm -rf src/sealag/kernels/__pycache__
	@$(BIN)/python -m sealag.kernels
	@touch $@

paper: setup
	$(BIN)/sealag paper --out out/paper

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

test: lint
	$(BIN)/pytest -n auto --dist worksteal --durations=20

quick: lint
	$(BIN)/pytest -n auto --dist worksteal -m "not slow"

MINUTES ?= 60
fuzz: setup
	PYTHONPATH=tests $(BIN)/python -W ignore -m fuzz --minutes $(MINUTES) $(if $(SEED),--seed $(SEED))

KILLS ?= 20
kills: setup
	KILLS=$(KILLS) $(BIN)/pytest -n 0 tests/cli/test_cli_sweep_killed.py

mutants: setup
	PYTHONPATH=tests $(BIN)/python -m mutants $(if $(ROOM),--room $(ROOM))

FOLDER ?= $(error give FOLDER=, a folder with robots in it)
OUT ?= out/corpus.md
corpus: setup
	@mkdir -p $(dir $(OUT))
	PYTHONPATH=tests $(BIN)/python -W ignore -m corpus $(FOLDER) --out $(OUT) $(ONLY)

# The wheel is built from the sdist, so that both are known to be complete.
wheel:
	@rm -rf dist build/wheel
	@$(PYTHON) -m venv build/wheel
	@build/wheel/bin/python -m pip install --disable-pip-version-check -q build
	build/wheel/bin/python -m build --outdir dist .

wheel-check: wheel
	PYTHON=$(PYTHON) .ci/wheel-check dist/*.whl

bench: setup
	$(BIN)/python -m bench

clean:
	rm -rf out build dist .pytest_cache .ruff_cache .hypothesis
