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

.PHONY: help setup demo test check crash-matrix fuzz size docs wheel-test release clean

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

demo: $(INSTALLED) ## Map the bundled sample log and plan a route; writes groundmap-demo/
	$(BIN)/groundmap demo

test: $(READY) ## Run the tests and the doctests
	$(BIN)/pytest -n $(WORKERS)

check: $(READY) ## Check format, lint, types, import contracts, wording and docstrings
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/codespell -D - -D tools/dialect.txt
	$(BIN)/python tools/check_docstrings.py

crash-matrix: $(READY) ## Plan random problems in processes that can crash (ATTEMPTS=2000 SEED=7)
	$(BIN)/python tools/crash_matrix.py --attempts $(ATTEMPTS) $(if $(SEED),--seed $(SEED))

size: $(READY) ## Print lines per room and module, public names, longest functions
	@$(BIN)/python tools/size.py

fuzz: $(READY) ## Fuzz readers and API (FILES, CALLS, SECONDS, SEED), then draw new examples
	cd tests && PYTHONPATH=. '$(CURDIR)/$(BIN)/python' -m fuzz --files $(FILES) --calls $(CALLS) --seconds $(SECONDS) $(addprefix --seed ,$(SEED)) --keep '$(CURDIR)/fuzz-failures'
	$(BIN)/pytest -n $(WORKERS) -m hypothesis --hypothesis-profile=explore

docs: $(READY) ## Build the documentation in docs/_build/html; warnings are errors
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	rm -rf docs/_build docs/api
	$(BIN)/python tools/make_api.py docs/api
	$(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build/html
	@echo 'Open docs/_build/html/index.html'

release: $(READY) ## Set the version, date the changelog, commit and tag: make release VERSION=0.2.0
	$(BIN)/python tools/release.py $(VERSION)

wheel-test: $(READY) ## Build the wheel, install it without the sources, run the tests against it
	rm -rf dist
	$(BIN)/python -m build --wheel --no-isolation --outdir dist
	$(BIN)/python tools/install_wheel.py dist $(WHEEL_VENV)
	cd $(WHEEL_VENV) && bin/pytest -n $(WORKERS) -c '$(CURDIR)/pyproject.toml' --installed '$(CURDIR)/tests' '$(CURDIR)/scenarios' --pyargs groundmap planners

clean: ## Remove everything that the other targets created
	rm -rf .venv $(WHEEL_VENV) dist groundmap-demo fuzz-failures docs/_build docs/api .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find groundmap planners tests tools -name __pycache__ -type d -prune -exec rm -rf {} +
