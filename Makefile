# Two commands do all set-up by themselves: `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
EVO := .venv-evo

.PHONY: demo test test-evo test-kernel kernel-parts lint clean

demo: $(READY)
	$(BIN)/fusion demo --output fusion-demo

test: $(READY)
	$(BIN)/python -m pytest -q -n auto $(TESTS)

# Scores agree with evo's to 1e-9. It is GPL: a program of its own in an environment of its own, never imported.
test-evo: $(READY) $(EVO)/bin/evo_ape
	PATH="$(CURDIR)/$(EVO)/bin:$$PATH" $(BIN)/python -m pytest -q tests/benchmarks/metrics/test_against_evo.py

$(EVO)/bin/evo_ape:
	$(PYTHON) -m venv $(EVO)
	$(EVO)/bin/python -m pip install --quiet --disable-pip-version-check evo==1.38.0

# The real drivers of a real kernel, emulated: docs/kernel-tier.md.
test-kernel: kernel-parts
	$(BIN)/python -m pytest -q -n 2 --dist loadfile -m kernel tests/kernel

kernel-parts: $(READY)
	PYTHONPATH=tests $(BIN)/python -m kernel.fetch

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Installed anew whenever what is pinned or declared changes.
$(READY): pyproject.toml .ci/constraints.txt
	$(PYTHON) -c 'import sys; sys.exit("fusion needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; run make with PYTHON=python3.12, say" if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint .ci/constraints.txt --editable '.[test]'
	touch $@

clean:
	rm -rf $(VENV) $(EVO) fusion-demo build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
