# `make help` lists the targets. Nothing here needs root, and every path is relative, so a folder with spaces is fine.
#
# PYTHON is the interpreter that .venv is made from; without it the first supported one of CANDIDATES is taken.
SHELL := /bin/sh
.DEFAULT_GOAL := help
.SUFFIXES:
# Images of Python often set it, and then every process would compile every module anew; `make clean` removes the files.
unexport PYTHONDONTWRITEBYTECODE
.PHONY: help setup develop static run console test check test-slow wheel bench docs pictures lock clean

CANDIDATES := python3.11 python3.12 python3.13 python3.14 python3
IS_SUPPORTED := import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))
HAS_PIP := import pip._internal; $(IS_SUPPORTED)
BIN := .venv/bin
READY := .venv/ready
DEVELOPED := .venv/developed
BEGUN := .venv/begun
PYTEST := $(BIN)/pytest
# Gives way; with 19, it would wait for others' jobs of ordinary priority for hours.
NICE := nice -n 5
BESIDE := .pytest_cache/beside.log
PIP := $(BIN)/python -m pip
QUIET := install --disable-pip-version-check --quiet --no-compile --no-deps
OWN_INDEX := \.(index-url|no-index|proxy)=

help: ## say what each target does
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' Makefile

setup: $(READY) ## create .venv with what running needs; does nothing while that is unchanged

develop: $(DEVELOPED) ## add what tests, types, lint and documentation need

# A lock is whole, so nothing is resolved here (--no-deps). uv, taken from the lock by its hash, installs five times as fast
# as pip (docs/decisions/0002) but does not read pip's configuration: where that names an index or a proxy, and where uv
# fails, pip does it. What an interrupted installation left behind is installed anew: $(BEGUN) tells.
define install # lock, what it downloads
	@echo "Installing $(1); the first time downloads about $(2)"
	@[ -e $(BEGUN) ] && again=1 || again=; touch $(BEGUN); \
	cache=$${UV_CACHE_DIR:-$${XDG_CACHE_HOME:-$$HOME/.cache}/uv}; \
	mkdir -p "$$cache" 2>/dev/null && [ -w "$$cache" ] || export UV_NO_CACHE=1; \
	awk '/^uv==/ { found = 1; print; next } found && !/^ +--hash/ { exit } found' requirements.lock > .venv/uv.lock; \
	{ ! $(PIP) config list | grep -E '$(OWN_INDEX)' >/dev/null && \
	  $(PIP) $(QUIET) --require-hashes --requirement .venv/uv.lock 2>.venv/install.log && \
	  $(BIN)/uv pip install --python $(BIN)/python $${again:+--reinstall} --no-deps --require-hashes --requirement $(1); \
	} || \
	$(PIP) $(QUIET) $${again:+--force-reinstall} --require-hashes --requirement $(1) 2>.venv/install.log || { \
	    echo "dipac: $(1) could not be installed: check the network (pip config list) and the disk (df -h .)," \
	         "then call make again; .venv/install.log holds what pip said" >&2; exit 1; }
	@rm -f $(BEGUN)
endef

# An environment that has lost its interpreter is not ready, whatever the stamp says.
ifeq ($(wildcard $(BIN)/python),)
.PHONY: $(READY)
endif

$(READY): requirements.lock pyproject.toml
	@[ -e $(READY) ] || [ ! -d .venv ] || touch $(BEGUN); \
	python="$(PYTHON)"; \
	for candidate in $(CANDIDATES); do \
	    [ -z "$$python" ] && "$$candidate" -c '$(IS_SUPPORTED)' >/dev/null 2>&1 && python=$$candidate; \
	done; \
	"$${python:-python3}" -c '$(IS_SUPPORTED)' >/dev/null 2>&1 || { \
	    echo "dipac needs Python 3.11 to 3.14 with venv; name one: make setup PYTHON=/path/to/python3.11" >&2; exit 1; }; \
	$(BIN)/python -c '$(HAS_PIP)' >/dev/null 2>&1 || { \
	    echo "Creating .venv with $$("$$python" --version)"; "$$python" -m venv --clear .venv; }
	$(call install,requirements.lock,0.9 GB)
	@$(PIP) $(QUIET) --no-build-isolation --editable .
	@touch $(READY)

$(DEVELOPED): $(READY) requirements-dev.lock
	$(call install,requirements-dev.lock,0.3 GB)
	@touch $(DEVELOPED)

run: setup ## push a rope to its goal in the simulated cell
	$(BIN)/dipac run rope_push

console: setup ## a session in the browser, each push approved by hand
	$(BIN)/dipac console

# Imports are linted by tests/test_structure.py.
define static_checks
$(NICE) $(BIN)/ruff check . && $(NICE) $(BIN)/ruff format --check . && $(NICE) $(BIN)/basedpyright && \
NO_MKDOCS_2_WARNING=1 $(NICE) $(BIN)/mkdocs build --strict
endef

# Everything at once: tests that wait for clocks, processes and sockets hardly use a core, so what uses one goes beside
# them and gives way to them. Two files of the former at a time are a third faster, and trip watchdogs now and then.
test: develop ## everything that CI runs: lint, types, layering, tests, documentation
	@mkdir -p $(dir $(BESIDE)); \
	( $(static_checks); status=$$?; \
	  $(NICE) $(PYTEST) -q -n 2 --dist worksteal -m "not slow and not serial" -o timeout=1800 --durations=25; \
	  exit $$((status + $$?)) ) >$(BESIDE) 2>&1 & beside=$$!; \
	trap 'kill $$beside' INT TERM; \
	$(PYTEST) -m "not slow and serial" --durations=25; serial=$$?; \
	echo "Lint, types, documentation, and the tests that need a core alone, which ran beside them:"; \
	wait $$beside; parallel=$$?; cat $(BESIDE); \
	exit $$((serial + parallel))

static: develop ## what is checked without running the program: lint, format, types, documentation
	@$(static_checks)

check: test ## the same as test

test-slow: develop ## the tests that take minutes
	$(PYTEST) -m slow --hypothesis-profile=search

wheel: setup ## build dist/dipac-*.whl, which pip and uvx install
	$(PIP) wheel --disable-pip-version-check --quiet --no-deps --no-build-isolation --wheel-dir dist .
	@ls dist/*.whl

bench: setup ## measure what docs/results.md states
	$(BIN)/dipac bench

docs: develop ## serve the documentation on http://127.0.0.1:8000
	$(BIN)/mkdocs serve

pictures: develop ## take the pictures of the console anew, from the running program; needs Chromium
	$(BIN)/python -m bench.console_pictures

# Everything is resolved at once, at the versions locked today where they fit; what running needs stands in
# requirements.lock, the rest in requirements-dev.lock; what running needs on some systems alone is in both.
lock: develop ## resolve both locks anew from pyproject.toml
	@set -e; compile() { UV_CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/uv pip compile --quiet --universal \
	    --fork-strategy fewest --python-version 3.11 --generate-hashes --no-annotate --no-emit-index-url --no-emit-find-links "$$@"; }; \
	cat requirements.lock requirements-dev.lock > .venv/all.lock; \
	compile --group dev pyproject.toml --output-file .venv/all.lock; \
	compile --group setup pyproject.toml --constraint .venv/all.lock --output-file requirements.lock; \
	compile --group dev pyproject.toml --constraint .venv/all.lock --output-file requirements-dev.lock \
	    $$(sed -nE 's/^([a-z0-9._-]+)==[^ ;]+ .$$/--no-emit-package \1/p' requirements.lock)

clean: ## remove .venv and everything that can be made again; recordings stay
	rm -rf .venv site dist .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find app bench tests -name __pycache__ -type d -prune -exec rm -rf {} +
