# make demo    set everything up and render a picture
# make test    set everything up and run the tests (a few minutes)
PYTHON ?= python3
VENV   ?= .venv
BIN     = $(VENV)/bin

.PHONY: demo test test-slow check bench clean

demo: $(VENV)/.installed
	$(BIN)/sightray render whitted --output demo.png
	@echo "The picture is $(CURDIR)/demo.png"

test: $(VENV)/.tested check
	$(BIN)/python -m pytest -n auto --dist worksteal

test-slow: $(VENV)/.tested
	$(BIN)/python -m pytest -m slow

check: $(VENV)/.tested
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.installed
	$(BIN)/python benchmarks/whitted.py

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.tested: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[test]"
	@touch $@

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache
