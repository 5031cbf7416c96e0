# make demo    set everything up and design a rig for the bundled head
# make test    set everything up and pass the tests (the quick ones)
# make check   lint, types, layers
# make firmware    build the trigger box's firmware (needs gcc-avr, avr-libc)
# make help    this list

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
OUT ?= out/demo

.PHONY: help firmware demo test test-all check format docs benchmarks clean

help:
	@sed -n 's/^# make/make/p' Makefile

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Rigwright needs Python 3.11 or newer")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $(STAMP)

demo: $(STAMP)
	$(BIN)/rigwright demo --out $(OUT) --force

test: $(STAMP)
	$(BIN)/python -m pytest -m 'not slow'

test-all: $(STAMP)
	$(BIN)/python -m pytest

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
	$(BIN)/python -m rig.schemas docs
	$(BIN)/python -m service.api.document docs/openapi.json

benchmarks: $(STAMP)
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.faces

clean:
	rm -rf $(VENV) out build dist *.egg-info
