# The short way to everything. `make demo` and `make test` are all that most people need.
#
# Stamp files make reruns instant: what is installed is installed again only when its lock file changes,
# the editor is built again only when its sources change, and kernels are compiled again only when theirs do.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin
PYTHON_STAMP := $(VENV)/.stamp-packages
PROJECT_STAMP := $(VENV)/.stamp-project
CLIENT_STAMP := client_web/node_modules/.stamp-packages
CLIENT_BUILD := client_web/dist/index.html
KERNEL_STAMP := $(VENV)/.stamp-kernels
KERNEL_SOURCES := $(shell grep -rlE '^(import|from) numba' relume --include='*.py' 2>/dev/null) relume/precompile.py
TESTS_STAMP := $(VENV)/.stamp-tests
CLIENT_SOURCES := $(shell find client_web -type f -not -path '*/node_modules/*' -not -path '*/dist/*' 2>/dev/null)
LOCK_TOOLS := build/lock-tools
AUDIT_TOOLS := build/audit-tools
BLENDER_TOOLS := build/blender-tools

# Everything that is not slow; browser tests only where there is a browser.
CHROMIUM := $(firstword $(foreach name,chromium chromium-browser google-chrome,$(shell command -v $(name) 2>/dev/null)))
MARKERS := not slow$(if $(CHROMIUM),, and not e2e)

# Tests are shared out to processes; which of them stay together, tests/conftest.py says.
SHARED_OUT := --numprocesses=logical --maxprocesses=4 --dist=loadscope --no-loadscope-reorder

# Of NumPy's linear algebra: its threads spin where they wait for a core that another process of tests has.
ONE_THREAD := OPENBLAS_NUM_THREADS=1

# Bytecode is kept, whatever the shell says: tests start hundreds of processes, each of which would compile all sources.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup demo test test-slow corpus bench soak wheel release blender-addon blender-check lint audit lock clean client-check

help:  ## what each target does
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "make %-12s %s\n", $$1, $$2}'

setup: $(PROJECT_STAMP) $(CLIENT_BUILD) $(KERNEL_STAMP)  ## virtual environment, packages, the editor's build

demo: setup  ## bake the built-in scene, serve it, open the editor
	$(BIN)/relume demo $(ARGS)

test:  ## everything that must hold before a commit
	@$(MAKE) --no-print-directory --jobs=2 --output-sync=line setup lint client-check $(TESTS_STAMP)
	$(if $(CHROMIUM),,@echo "No chromium on this machine: the browser tests (marker e2e) are left out.")
	$(ONE_THREAD) $(BIN)/python -m pytest -m "$(MARKERS)" $(SHARED_OUT)
	$(BIN)/relume bench --quick --check

test-slow: setup  ## the long tests
	$(ONE_THREAD) $(BIN)/python -m pytest -m slow --timeout=3600

corpus: setup  ## rewrite the table of what opening each file of the shared data ends as
	$(ONE_THREAD) $(BIN)/python -W ignore tests/corpus/write.py

bench: setup  ## the project's own figures
	$(BIN)/relume bench $(ARGS)

MINUTES ?= 120
soak: setup  ## sessions, bakes, deletes and killed processes for MINUTES; memory, handles and disk stay flat
	$(BIN)/python -m relume_bench.soak --minutes $(MINUTES)

wheel: $(PROJECT_STAMP) $(CLIENT_BUILD)  ## the wheel, with the built editor, and the source distribution, in dist/
	$(BIN)/python scripts/build_distributions.py

release: $(PROJECT_STAMP) $(CLIENT_BUILD)  ## the same of a clean checkout whose VERSION the changelog names
	$(BIN)/python scripts/build_distributions.py --release "$(or $(VERSION),$(error name it: make release VERSION=0.1.0))"

blender-addon: $(PROJECT_STAMP)  ## the Blender add-on as an extension, in dist/
	$(BIN)/python scripts/build_blender_addon.py

# Blender as a Python module, which is large and under the GPL: never one of relume's own packages.
blender-check: setup blender-addon $(BLENDER_TOOLS)/.stamp-bpy  ## the tests of the add-on in Blender
	RELUME_BLENDER_PYTHON=$(CURDIR)/$(BLENDER_TOOLS)/bin/python $(ONE_THREAD) $(BIN)/python -m pytest tests/blender

lint: $(PROJECT_STAMP)  ## style and types
	$(BIN)/ruff check .
	$(BIN)/mypy

client-check: $(CLIENT_STAMP)
	cd client_web && npm run --silent check && npm test --silent

# Both ask services of the package registries, and fail where those do not answer or do not know a package.
audit: $(AUDIT_TOOLS)/bin/pip-audit  ## known holes in the packages that the locks name
	$(AUDIT_TOOLS)/bin/pip-audit --strict --progress-spinner off --disable-pip --require-hashes \
		-r requirements.lock -r docker/requirements.lock
	cd client_web && npm audit

lock: $(LOCK_TOOLS)/bin/uv  ## choose package versions again
	@printf '$(BUILD_NEEDS)' | $(UV) --extra dev --extra notebook $(OPTIONAL) pyproject.toml - -o requirements.lock
	@printf '$(BUILD_NEEDS)' | $(UV) --constraint requirements.lock $(OPTIONAL) pyproject.toml - -o docker/requirements.lock

clean:  ## remove what make made; data and bakes stay
	rm -rf $(VENV) client_web/node_modules client_web/dist build dist test-results
	rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# What `pip install -e .` builds with, so that nothing is fetched beside the lock.
BUILD_NEEDS := hatchling>=1.27\neditables\n
# Installed everywhere but by a bare `pip install`.
OPTIONAL := --extra usd --extra materialx --extra postgres
# Names, versions and hashes only: where packages come from is each machine's own setting.
UV := $(LOCK_TOOLS)/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --upgrade \
	--no-annotate --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock"

$(LOCK_TOOLS)/bin/uv:
	@python="$$(.ci/find-python)" && "$$python" -m venv $(LOCK_TOOLS)
	@$(LOCK_TOOLS)/bin/pip install --quiet uv

$(AUDIT_TOOLS)/bin/pip-audit:
	@python="$$(.ci/find-python)" && "$$python" -m venv $(AUDIT_TOOLS)
	@$(AUDIT_TOOLS)/bin/pip install --quiet pip-audit

# This bpy needs exactly Python 3.11.
$(BLENDER_TOOLS)/.stamp-bpy:
	@command -v python3.11 >/dev/null || { echo "relume: the tests in Blender need python3.11 and its venv module." >&2; exit 1; }
	@echo "Installing Blender as a Python module into $(BLENDER_TOOLS) …"
	@python3.11 -m venv $(BLENDER_TOOLS) && $(BLENDER_TOOLS)/bin/pip install --quiet bpy==5.0.1 httpx websockets
	@touch $@

# The lock names all that is needed, so nothing is looked for; what is imported is compiled then, a part of all there is.
$(PYTHON_STAMP): requirements.lock
	@python="$$(.ci/find-python)" && { [ -x $(BIN)/python ] || "$$python" -m venv $(VENV); }
	@echo "Installing Python packages into $(VENV) …"
	@$(BIN)/python -m pip install --quiet --no-deps --no-compile --require-hashes -r requirements.lock
	@touch $@

$(PROJECT_STAMP): $(PYTHON_STAMP) pyproject.toml
	@$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	@touch $@

$(KERNEL_STAMP): $(PROJECT_STAMP) $(KERNEL_SOURCES)
	@echo "Compiling kernels (once, a minute or two) …"
	@$(ONE_THREAD) $(BIN)/python -m relume.precompile
	@touch $@

# Processes that tests are shared out to begin at once: each would compile all sources and tests, and find no bytecode yet.
$(TESTS_STAMP): $(PROJECT_STAMP) $(shell find relume worker server cli bench tests -name '*.py')
	@$(BIN)/python -m pytest --collect-only -qq | { grep -v '^tests/.*: [0-9]*$$' || true; }
	@touch $@

$(CLIENT_STAMP): client_web/package-lock.json
	@.ci/check-node
	@echo "Installing the editor's packages …"
	@cd client_web && npm ci --no-audit --no-fund --loglevel=error
	@touch $@

$(CLIENT_BUILD): $(CLIENT_STAMP) $(CLIENT_SOURCES)
	@echo "Building the editor …"
	@cd client_web && npm run --silent build
	@touch $@
