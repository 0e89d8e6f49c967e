# `make demo` and `make test` set everything up by themselves on a machine with Python 3.11 or newer.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# What runs, and what tests need besides.
INSTALLED := $(VENV)/.installed
READY := $(VENV)/.ready
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

.PHONY: demo check test lint types audit check-wheel docs clean

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed; set PYTHON=python3.x") if sys.version_info < (3, 11) else None'
	@echo "Installing into $(VENV): 250 MB to download, half a minute or more"
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable .
	touch $(INSTALLED)

$(READY): $(INSTALLED)
	@echo "Installing what the tests need: 150 MB more"
	$(PIP) --editable '.[dev]'
	$(BIN)/deconflict prepare
	touch $(READY)

demo: $(INSTALLED)
	$(BIN)/deconflict demo

# The short inner loop: what breaks most often, in under a minute.
check: lint types
	$(BIN)/python -m pytest -q -n 2 --dist worksteal -m 'not slow'

test: lint types
	$(BIN)/python -m pytest -n 3 --dist worksteal

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

# Asks for known vulnerabilities of everything that is pinned; fails too where there is nobody to ask.
audit:
	$(PYTHON) -m venv build/audit
	build/audit/bin/python -m pip install --quiet pip-audit
	build/audit/bin/pip-audit --strict --no-deps --disable-pip --requirement constraints.txt

# Installs the built wheel in an empty environment and runs the demo from it.
check-wheel: $(INSTALLED)
	rm -rf build/wheel && mkdir -p build/wheel
	$(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir build/wheel .
	$(PYTHON) -m venv build/wheel/venv
	build/wheel/venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt build/wheel/*.whl
	cd build/wheel && venv/bin/deconflict --version
	cd build/wheel && venv/bin/deconflict demo --seconds 10 > demo.txt || { cat demo.txt; exit 1; }
	tail -n 1 build/wheel/demo.txt

# Builds the documentation as a site. Fails on a page that is not in the menu; tests check the links.
docs:
	$(PYTHON) -m venv build/docs
	build/docs/bin/python -m pip install --quiet --disable-pip-version-check 'mkdocs-material>=9.6,<10'
	build/docs/bin/mkdocs build --strict --quiet
	@echo "Open build/site/index.html"

clean:
	rm -rf $(VENV) build
