# Commands for newcomers and CI; all of them use a virtual environment of their own in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT := out/drawer-pull
PANEL_OUT := out/panel
COMPILED := out/compiled
LOWEST := out/lowest
CAMPAIGN_OUT := out/campaign

.PHONY: campaign demo panel test test-all test-compiled test-lowest wheel wheel-compiled lint coverage bench docs sbom site panel-pictures clean

# Install, run the warehouse robot's drawer pull on the embedded board and print where the pictures are.
demo: $(VENV)/.installed
	$(BIN)/steptwin run warehouse-scara drawer-pull --out $(OUT)
	@echo "The machine in a browser: make panel"

# Serve the laboratory robot's board and open its panel at the address that is printed, until Ctrl-C.
panel: $(VENV)/.installed-panel
	@echo "What the machine does, once more: $(BIN)/steptwin view $(PANEL_OUT)"
	$(BIN)/steptwin serve lab-scara --panel --out $(PANEL_OUT) --replace

# Tests start some hundred processes: keep bytecode, even where the environment says not to, and a core for each.
test test-all test-compiled test-lowest coverage: export PYTHONDONTWRITEBYTECODE =
test test-all test-compiled test-lowest coverage: export OPENBLAS_NUM_THREADS = 1

PYTEST = $(BIN)/python -m pytest
TOGETHER := --numprocesses auto --dist worksteal

# All tests that are fast: units, whole commands, runs from end to end. tests/budget.py says what fast is.
test: $(VENV)/.installed-dev
	$(PYTEST) $(TOGETHER) -m "not slow and not live"

# Tests that hold buttons in a browser: beside others a slow computer is too slow for them.
ALONE := tests/live/test_held_network.py tests/live/test_browser.py

# The rest too: slow tests; those with a server or processes in real time, of which more run at once than there are cores, since
# they wait as long as they compute; those with a browser, one after the other; the lowest versions of libraries; linters.
test-all: test $(LOWEST)/.installed
	$(PYTEST) $(TOGETHER) -m "slow and not live"
	$(PYTEST) --numprocesses 5 --dist loadfile --no-loadscope-reorder -m live $(ALONE:%=--ignore %)
	$(PYTEST) $(ALONE)
	$(MAKE) test-lowest
	$(MAKE) lint

# The wheel for every machine, and one for this kind of machine whose hot modules are compiled (docs/evidence.md).
wheel: $(BIN)/python
	$(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist .

wheel-compiled: $(BIN)/python
	HATCH_BUILD_HOOK_ENABLE_CUSTOM=1 $(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist .

# The list of all that a user gets with the wheel and all extras, in CycloneDX' format: out/sbom/steptwin.cdx.json.
sbom: $(BIN)/python
	rm -rf out/sbom
	$(PYTHON) -m venv out/sbom/tool
	$(PYTHON) -m venv out/sbom/installed
	out/sbom/tool/bin/python -m pip install --quiet 'cyclonedx-bom>=7'
	out/sbom/installed/bin/python -m pip install --quiet '.[fast,plot,m3,mcap,campaign,panel]'
	out/sbom/tool/bin/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible \
		--output-file out/sbom/steptwin.cdx.json out/sbom/installed/bin/python

# The tests of what is compiled, and the bytes of 16 runs, on a compiled wheel instead of the checkout: some 10 minutes.
# `steptwin` is the wheel's; `tests` is the checkout's, before any library's.
ON_WHEEL := PYTHONPATH=$(CURDIR)/$(COMPILED)/site:$(CURDIR) $(BIN)/python -P

test-compiled: $(VENV)/.installed-dev
	rm -rf $(COMPILED)
	HATCH_BUILD_HOOK_ENABLE_CUSTOM=1 $(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir $(COMPILED)/wheel .
	$(BIN)/python -m pip install --quiet --no-deps --target $(COMPILED)/site $(COMPILED)/wheel/*.whl
	$(ON_WHEEL) -c 'from tests.compiled import COMPILED; assert COMPILED'
	$(ON_WHEEL) -m pytest --import-mode importlib --numprocesses auto \
		tests/protocol tests/controller tests/emulator tests/host/client
	$(ON_WHEEL) -m tests.end_to_end.fingerprints

# With the lowest versions that pyproject.toml allows: the drawer pull, and tests that meet each library. The compiled kernel has
# its own cache: while one numba writes over what another has stored, a third process can load the other's code, and fails.
test-lowest: export NUMBA_CACHE_DIR = $(abspath $(LOWEST)/numba)
test-lowest: $(LOWEST)/.installed
	$(LOWEST)/bin/steptwin run warehouse-scara drawer-pull --out $(LOWEST)/drawer-pull
	$(LOWEST)/bin/python -m pytest $(TOGETHER) \
		tests/host/record/recorded_bus tests/host/record/waveforms tests/features/campaigns/test_results.py \
		tests/host/client/test_axis.py tests/host/client/test_bus_link.py tests/live/test_ros2_bridge.py tests/features/panel/page/test_guard.py \
		tests/end_to_end/test_help.py tests/end_to_end/test_narrow_terminal.py

$(LOWEST)/.installed: pyproject.toml tests/lowest_versions.py
	rm -rf $(LOWEST)
	$(PYTHON) -m venv $(LOWEST)
	$(PYTHON) tests/lowest_versions.py > $(LOWEST)/constraints.txt
	$(LOWEST)/bin/python -m pip install --quiet --constraint $(LOWEST)/constraints.txt --editable \
		'.[fast,plot,m3,mcap,campaign,panel,ros2]' filelock hypothesis pytest pytest-xdist
	@touch $@

lint: $(VENV)/.installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy --num-workers auto
	$(BIN)/lint-imports
	$(BIN)/python -m tests.rules

# Measure the lines and branches of firmware and protocol that the tests run; fail below 95 %.
coverage: $(VENV)/.installed-dev
	$(PYTEST) $(TOGETHER) tests/controller tests/protocol tests/host/client tests/emulator \
		--cov=steptwin.controller --cov=steptwin.protocol --cov-branch --cov-fail-under=95 --cov-report=term-missing:skip-covered

# Make the nightly campaign, 10 000 runs over the papers' robots and all faults, and its report; it continues where it was interrupted.
# `make campaign RUNS=100` makes the first hundred. Exit code 1, runs that failed, is no reason to end before the report.
campaign: $(VENV)/.installed-campaign
	$(BIN)/steptwin campaign nightly --out $(CAMPAIGN_OUT) $(RUNS:%=--runs %) || test $$? -eq 1
	$(BIN)/steptwin campaign report $(CAMPAIGN_OUT)

bench: $(VENV)/.installed-dev
	$(BIN)/python -m steptwin.bench

# Generate docs/command-line.md, docs/driver.md, docs/protocol.md, docs/programs.md, docs/robot-files.md and docs/papers, and the pictures of
# these and of docs/run-folder.md. Every job is run for it.
docs: $(VENV)/.installed
	$(BIN)/python -m docs.generate

# Make the documentation site of the pages, with search, a menu and the types of the Python API: out/site/index.html.
# A warning, such as a link that leads nowhere, fails.
site: $(VENV)/.installed-dev
	$(BIN)/sphinx-build -q -W --keep-going -c docs/site . out/site
	@echo "The site: out/site/index.html"

# Make the pictures of docs/panel.md: needs Chromium and its driver.
panel-pictures: $(VENV)/.installed-dev
	$(BIN)/python -m docs.generate.panel_pictures

clean:
	rm -rf $(VENV) out

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "StepTwin needs Python 3.11 or newer, this is " + sys.version.split()[0] + ": try make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[fast,plot]'
	@touch $@

$(VENV)/.installed-panel: pyproject.toml $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[panel]'
	@touch $@

$(VENV)/.installed-campaign: pyproject.toml $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[campaign]'
	@touch $@

# Dependency groups need pip 25.1; the upgrade of pip above provides it.
$(VENV)/.installed-dev: pyproject.toml $(VENV)/.installed-panel
	$(BIN)/python -m pip install --quiet --group dev
	@touch $@
