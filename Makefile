# `make demo` and `make test` set everything up by themselves on a machine with Python 3.11 or newer.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# What runs, what tests need besides, and the kernels and the tests that processes would compile each on its own.
INSTALLED := $(VENV)/.installed
READY := $(VENV)/.ready
KERNELS := $(VENV)/.kernels
COLLECTED := $(VENV)/.collected
# Python compiles what it imports when it first does; to compile all of it takes as long as to install it.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt

# Modules that were imported are kept compiled, also where the environment says otherwise: tests start many processes.
export PYTHONDONTWRITEBYTECODE =

.PHONY: demo demo-advice check test lint types audit lock artefacts check-wheel release sign docs clean

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed; set PYTHON=python3.x") if sys.version_info < (3, 11) else None'
	@echo "Installing into $(VENV): 250 MB to download, half a minute or more"
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable .
	touch $(INSTALLED)

$(READY): $(INSTALLED)
	@echo "Installing what the tests need: 150 MB more"
	$(PIP) --editable '.[dev]'
	touch $(READY)

$(KERNELS): $(READY)
	$(BIN)/deconflict prepare
	touch $(KERNELS)

# pytest compiles tests as it collects them. What can't be collected is reported when tests run.
$(COLLECTED): $(KERNELS)
	-@$(BIN)/python -m pytest -q --collect-only >/dev/null
	@touch $(COLLECTED)

demo: $(INSTALLED)
	$(BIN)/deconflict demo

# Robots that stand for each other, with advice off and on in turns: a quarter of an hour, then what advice saved.
demo-advice: $(INSTALLED)
	$(BIN)/deconflict demo --scene standoffs --seconds 840

# The short inner loop: what breaks most often, in under a minute.
check: lint types $(KERNELS)
	$(BIN)/python -m pytest -q -n 2 --dist worksteal -m 'not slow'

# Many tests wait for a service that they have started, so more of them run at a time than there are cores, and the
# longest begin first (tests/helpers/order.py).
test: lint types $(COLLECTED)
	$(BIN)/python -m pytest -n 5 --dist worksteal

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

# Writes the locks with hashes anew, after a change of constraints.txt or of the dependencies in pyproject.toml.
lock:
	rm -rf build/lock locks && mkdir -p locks
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip install --quiet --disable-pip-version-check 'uv>=0.9'
	$(LOCK) pyproject.toml --extra cluster --output-file locks/runtime.txt
	$(LOCK) pyproject.toml $(EXTRAS:%=--extra %) --output-file locks/development.txt
	$(LOCK) deconflict_client/pyproject.toml --output-file locks/client.txt
	echo hatchling | $(LOCK) - --output-file locks/build.txt
LOCK := build/lock/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate \
	--no-header --constraint constraints.txt
EXTRAS := dev dask cluster export plot fuzz

# What a release consists of, in build/release: the wheels of the service and of its client, their locks, and a bill of
# materials of the service as installed.
artefacts:
	rm -rf build/release build/wheel && mkdir -p build/release build/wheel
	$(PYTHON) -m venv build/wheel/builder
	$(call LOCKED,build/wheel/builder,locks/build.txt)
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) build/wheel/builder/bin/python -m pip wheel --quiet --no-deps \
		--disable-pip-version-check --no-build-isolation --wheel-dir build/release ./deconflict_client .
	$(PYTHON) -m venv build/wheel/venv
	$(call LOCKED,build/wheel/venv,locks/runtime.txt)
	build/wheel/venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps build/release/*.whl
	build/wheel/builder/bin/python -m pip install --quiet --disable-pip-version-check 'cyclonedx-bom>=7,<8'
	build/wheel/builder/bin/cyclonedx-py environment --output-reproducible --mc-type application --pyproject pyproject.toml \
		--output-file build/release/sbom.cdx.json build/wheel/venv/bin/python
	cp locks/runtime.txt build/release/requirements.txt
	cp locks/client.txt build/release/requirements-client.txt
LOCKED = $(1)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes --only-binary :all: -r $(2)

# Runs the demo from the wheel in an empty environment, and loads the client in one that has nothing else.
check-wheel: artefacts
	$(PYTHON) -m venv build/wheel/client
	$(call LOCKED,build/wheel/client,locks/client.txt)
	build/wheel/client/bin/python -m pip install --quiet --disable-pip-version-check build/release/amr_deconflict_client-*.whl
	cd build/wheel && client/bin/python -c 'import deconflict_client.client'
	@size=$$(du -sm --exclude='pip*' --exclude='setuptools*' build/wheel/client/lib/python3*/site-packages | cut -f1); \
		echo "The client takes $$size MB"; test "$$size" -lt $(MOST_CLIENT_MB)
	build/wheel/venv/bin/python -m pip check --disable-pip-version-check
	cd build/wheel && venv/bin/deconflict --version
	cd build/wheel && venv/bin/deconflict demo --seconds 10 > demo.txt || { cat demo.txt; exit 1; }
	tail -n 1 build/wheel/demo.txt
MOST_CLIENT_MB := 40

release: check-wheel sign

# Signs the hashes of what is in $(DIST) with the private SSH key $(KEY).
DIST ?= build/release
sign:
	@test -n "$(KEY)" || { echo "Set KEY to the private SSH key that signs releases: make release KEY=FILE"; exit 2; }
	cd "$(DIST)" && rm -f SHA256SUMS SHA256SUMS.sig && sha256sum -- * > SHA256SUMS
	ssh-keygen -q -Y sign -f "$(KEY)" -n amr-deconflict-release "$(DIST)/SHA256SUMS"

# Builds the documentation as a site. Fails on a page that is not in the menu; tests check the links.
docs:
	$(PYTHON) -m venv build/docs
	build/docs/bin/python -m pip install --quiet --disable-pip-version-check 'mkdocs-material>=9.6,<10'
	NO_MKDOCS_2_WARNING=1 build/docs/bin/mkdocs build --strict --quiet
	@echo "Open build/site/index.html"

clean:
	rm -rf $(VENV) build
