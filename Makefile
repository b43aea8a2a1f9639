PYTHON ?= python3
WORKERS ?= auto
ATTEMPTS ?= 2000
FILES ?= 10000
CALLS ?= 10000
SECONDS ?= inf
SEED ?=

export PIP_DISABLE_PIP_VERSION_CHECK = 1

BIN := .venv/bin
INSTALLED := .venv/.installed
READY := .venv/.ready
WHEEL_VENV := .wheel-venv

.PHONY: help setup demo test check crash-matrix fuzz size wheel-test clean

help: ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "%-12s %s\n", $$1, $$2}' Makefile

setup: $(READY) ## Create .venv with the project (editable) and its tools

$(INSTALLED): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "groundmap needs Python 3.11 or newer; name one: make PYTHON=python3.11")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

$(READY): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

demo: $(INSTALLED) ## Map a recorded courtyard and plan through it; writes groundmap-demo/
	$(BIN)/groundmap demo

test: $(READY) ## Run the tests and the doctests
	$(BIN)/pytest -n $(WORKERS)

check: $(READY) ## Check format, lint, types and import contracts
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

crash-matrix: $(READY) ## Plan at random in processes that may crash (ATTEMPTS=2000 SEED=7)
	$(BIN)/python tools/crash_matrix.py --attempts $(ATTEMPTS) $(if $(SEED),--seed $(SEED))

size: $(READY) ## Print lines per module, longest functions, public names, layers
	@$(BIN)/python tools/size.py

fuzz: $(READY) ## Fuzz readers and API (FILES, CALLS, SECONDS, SEED), then seek new examples
	cd tests && PYTHONPATH=. '$(CURDIR)/$(BIN)/python' -m fuzz --files $(FILES) --calls $(CALLS) --seconds $(SECONDS) $(addprefix --seed ,$(SEED)) --keep '$(CURDIR)/fuzz-failures'
	$(BIN)/pytest -n $(WORKERS) -m hypothesis --hypothesis-profile=explore

wheel-test: $(READY) ## Build the wheel, install it alone, run the tests against it
	rm -rf dist
	$(BIN)/python -m build --wheel --no-isolation --outdir dist
	$(BIN)/python tools/install_wheel.py dist $(WHEEL_VENV)
	cd $(WHEEL_VENV) && bin/pytest -n $(WORKERS) -c '$(CURDIR)/pyproject.toml' --installed '$(CURDIR)/tests' '$(CURDIR)/scenarios' --pyargs groundmap planners

clean: ## Remove everything that the other targets made
	rm -rf .venv $(WHEEL_VENV) dist groundmap-demo fuzz-failures .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find groundmap planners tests tools -name __pycache__ -type d -prune -exec rm -rf {} +
