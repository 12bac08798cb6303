# One verb per chore. `make run` and `make test` do all the set-up they need on a machine with Python 3.11+, make and a
# package index: they build .venv from pyproject.toml and the pins in constraints.txt.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt
# refill=0: a slot that repeats a program is not sampled again, which saves a minute. seeds=5 is a limit: a winner
# that two seeds confirm needs no more.
RUN ?= env=ballbalance sample=4 iteration=2 steps=350000 seeds=5 refill=0

.DEFAULT_GOAL := help
.PHONY: help run test check fix docs pins clean

help: ## List these verbs
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-6s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

run: $(VENV)/local ## Search for a reward with the embedded language model, no key and no GPU needed
	$(BIN)/eureka run $(RUN)

# In the order of their names. xdist's own order puts modules of few tests last. These take longest, so one core would
# wait.
test: $(VENV)/dev ## Run the tests
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadscope --no-loadscope-reorder

check: $(VENV)/dev ## Lint, types, import layers, the tree's own rules, generated pages; changes nothing
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/basedpyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports
	$(BIN)/python scripts/check_tree.py
	$(BIN)/python scripts/docs.py --check

fix: $(VENV)/dev ## Format and apply the linter's safe fixes
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

docs: $(VENV)/dev ## Renew the generated pages and tables
	$(BIN)/python scripts/docs.py

pins: ## Renew constraints.txt from a fresh environment with the newest allowed versions
	PYTHON=$(PYTHON) scripts/pin.sh

clean: ## Remove the environment and caches, never outputs/
	rm -rf $(VENV) .pytest_cache .ruff_cache .import_linter_cache .hypothesis

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "openeureka needs Python 3.11 or newer; try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 2; }
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

# The two files below mark a finished installation. A newer pyproject.toml or constraints.txt makes it run again.
$(VENV)/dev: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) --editable '.[dev,gpu,gym,ray,ui]'
	@touch $@

$(VENV)/local: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing openeureka with its language model, about 1.1 GB of weights; this is done once."
	$(PIP) --editable '.[local]'
	@touch $@
