# make demo    set everything up and design a rig for the bundled head
# make test    set everything up and pass the tests (the quick ones)
# make mutation  plant faults in named modules, and see whether the quick tests notice
# make check   lint, types, layers
# make firmware    build the trigger box's firmware (needs gcc-avr, avr-libc)
# make help    this list

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
OUT ?= out/demo
# Files are kept together: what a file sets up once is set up once. Quick tests wait a third of
# their time for boxes, cameras and servers: one process more than there are cores is busy then.
TESTS_SIDE_BY_SIDE := -n auto --dist loadfile
QUICK_WORKERS ?= $(shell $(PYTHON) -c 'import os; print((os.cpu_count() or 1) + 1)')

# Compiled modules are kept: some machines switch that off, and then every command that a test starts
# compiles the whole program again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help firmware demo mutation test test-slow test-all check format docs benchmarks clean

help:
	@sed -n 's/^# make/make/p' Makefile

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Rigwright needs Python 3.11 or newer")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Setting up $(VENV), once: 1.8 GB, about three minutes."
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --constraint constraints.txt --editable '.[dev]'
	touch $(STAMP)

demo: $(STAMP)
	@echo "Designing seven cameras for the bundled head: about a quarter of a minute on two quiet cores."
	$(BIN)/rigwright demo --out $(OUT) --force
	@echo "For the command rigwright in this terminal: . $(BIN)/activate"

test: $(STAMP)
	$(BIN)/python -m pytest -n $(QUICK_WORKERS) --dist loadfile -m 'not slow'

test-slow: $(STAMP)
	$(BIN)/python -m pytest $(TESTS_SIDE_BY_SIDE) -m slow

test-all: test test-slow

mutation: $(STAMP)
	$(BIN)/python -m benchmarks.mutation

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

firmware:
	$(MAKE) -C rig/firmware

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(STAMP)
	$(BIN)/python -m service.reference.schemas docs/reference
	$(BIN)/python -m service.reference.openapi docs/reference/openapi.json
	$(BIN)/python -m service.reference.house docs/explanation

benchmarks: $(STAMP)
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.faces
	$(BIN)/python -m benchmarks.fires --fires 10000 --seed 1
	$(BIN)/python -m benchmarks.crashes --times 200 --seed 1
	$(BIN)/python -m benchmarks.rendering
	$(BIN)/python -m benchmarks.firmware --out docs/explanation/trigger-timing.md

clean:
	rm -rf $(VENV) out build dist *.egg-info
