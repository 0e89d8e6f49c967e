# `make demo` and `make test` set everything up by themselves on a machine with Python 3.11 or newer.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
COMPILED := $(VENV)/.compiled
# What pyproject.toml lists for mypyc, each on a line of its own.
MODULES := $(shell sed -n 's|^  "\(.*\.py\)",$$|\1|p' pyproject.toml)
CAN_COMPILE = $(BIN)/python -c 'import os, shutil, sys, sysconfig as c; \
  cc = os.environ.get("CC") or c.get_config_var("CC"); \
  sys.exit(not (shutil.which(cc.split()[0]) and os.path.exists(c.get_path("include") + "/Python.h")))'
# A product and a sum are rounded apart, as the interpreter does; compilers for arm64 would else make one operation of them.
export CFLAGS := -ffp-contract=off $(CFLAGS)
INTERPRET := rm -f $(COMPILED) *__mypyc.*.so && find ingest deconflict metrics -name '*.so' -delete

.PHONY: demo test lint types audit check-wheel compiled interpreted clean

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed; set PYTHON=python3.x") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	$(BIN)/python -c 'import deconflict.sweep, ingest.following, ingest.plain'  # compiles their kernels, once
	touch $(READY)

# Modules compiled in place by mypyc. Without a C compiler their source is interpreted, with the same results.
$(COMPILED): $(READY) $(MODULES)
	@if $(CAN_COMPILE); then \
	  echo "Compiling $(words $(MODULES)) modules; this takes a minute or more."; \
	  HATCH_BUILD_HOOK_ENABLE_MYPYC=1 $(BIN)/python -m pip install --quiet --no-build-isolation --no-deps --editable . && touch $@; \
	else \
	  echo "Interpreted: reading a message takes 1.5 times as long or more. To compile, install a C compiler and Python's headers (apt-get install gcc libc6-dev python3-dev)."; \
	  $(INTERPRET); \
	fi

compiled: $(COMPILED)

# Takes the compiled modules away, until the next `make`.
interpreted:
	$(INTERPRET)

demo: $(COMPILED)
	$(BIN)/deconflict demo

test: lint types $(COMPILED)
	$(BIN)/python -m pytest -n 2

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

# Installs the built wheel, compiled where that can be, in an empty environment and runs the command from it.
check-wheel: $(READY)
	rm -rf build/wheel && mkdir -p build/wheel
	if $(CAN_COMPILE); then export HATCH_BUILD_HOOK_ENABLE_MYPYC=1; fi; \
	  $(BIN)/python -m pip wheel --quiet --no-build-isolation --no-deps --wheel-dir build/wheel .
	$(PYTHON) -m venv build/wheel/venv
	build/wheel/venv/bin/python -m pip install --quiet --constraint constraints.txt build/wheel/*.whl
	cd build/wheel && venv/bin/deconflict --version
	! $(CAN_COMPILE) || (cd build/wheel/venv/lib/python*/site-packages && ls $(MODULES:.py=.*.so) *__mypyc.*.so >/dev/null)

clean: interpreted
	rm -rf $(VENV) build
