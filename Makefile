# `make help` lists the targets. Nothing here needs root, and every path is relative, so a folder with spaces is fine.
#
# PYTHON is the interpreter that .venv is made from; without it the first Python 3.11 or 3.12 of these is taken.
SHELL := /bin/sh
.DEFAULT_GOAL := help
.SUFFIXES:
.PHONY: help setup run console test check test-slow bench docs pictures lock clean

CANDIDATES := python3.11 python3.12 python3
IS_SUPPORTED := import sys, venv, ensurepip; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))
BIN := .venv/bin
READY := .venv/ready
PYTEST := $(BIN)/pytest
BESIDE := .pytest_cache/beside.log
PIP := $(BIN)/python -m pip
QUIET := install --disable-pip-version-check --quiet --no-compile
OWN_INDEX := \.(index-url|no-index|proxy)=

help: ## say what each target does
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' Makefile

setup: $(READY) ## create .venv with the locked dependencies; does nothing while they are unchanged

# uv, taken from the lock by its hash, installs five times as fast as pip (docs/decisions/0002) but does not read pip's
# configuration: where that names an index or a proxy, and where uv fails, pip does it.
$(READY): requirements.lock pyproject.toml
	@python="$(PYTHON)"; \
	for candidate in $(CANDIDATES); do \
	    [ -z "$$python" ] && "$$candidate" -c '$(IS_SUPPORTED)' >/dev/null 2>&1 && python=$$candidate; \
	done; \
	"$${python:-python3}" -c '$(IS_SUPPORTED)' >/dev/null 2>&1 || { \
	    echo "dipac needs Python 3.11 or 3.12 with venv; name one: make setup PYTHON=/path/to/python3.11" >&2; exit 1; }; \
	$(BIN)/python -c '$(IS_SUPPORTED)' >/dev/null 2>&1 || { \
	    echo "Creating .venv with $$("$$python" --version)"; "$$python" -m venv --clear .venv; }
	@rm -f $(READY)
	@echo "Installing the locked dependencies; the first time downloads about 1.2 GB"
	@awk '/^uv==/ { found = 1 } found && /#/ { exit } found' requirements.lock > .venv/uv.lock
	@$(PIP) config list | grep -qE '$(OWN_INDEX)' || \
	    { $(PIP) $(QUIET) --require-hashes --requirement .venv/uv.lock && \
	      $(BIN)/uv pip install --python $(BIN)/python --require-hashes --requirement requirements.lock; } || \
	    $(PIP) $(QUIET) --require-hashes --requirement requirements.lock
	@$(PIP) $(QUIET) --no-deps --no-build-isolation --editable .
	@touch $(READY)

run: setup ## push a rope to its goal in the simulated cell
	$(BIN)/dipac run rope_push

console: setup ## a session in the browser, each push approved by hand
	$(BIN)/dipac console

# Small linear algebra is slower with threads. Tests that heed no clock give way to those that do, file by file.
test test-slow: export OPENBLAS_NUM_THREADS := 1
test: setup ## everything that CI runs: lint, types, layering, tests, documentation
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	$(BIN)/lint-imports
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@mkdir -p $(dir $(BESIDE)); \
	nice -n 19 $(PYTEST) -q -n 2 --dist loadfile -m "not slow and unhurried" -o timeout=1800 >$(BESIDE) 2>&1 & beside=$$!; \
	trap 'kill $$beside' INT TERM; \
	$(PYTEST) -m "not slow and not unhurried"; others=$$?; \
	echo "Those that heed no clock ran beside them:"; \
	wait $$beside; unhurried=$$?; cat $(BESIDE); \
	exit $$((others + unhurried))

check: test ## the same as test

test-slow: setup ## the tests that take minutes
	$(PYTEST) -m slow

bench: setup ## measure what docs/results.md states
	$(BIN)/dipac bench

docs: setup ## serve the documentation on http://127.0.0.1:8000
	$(BIN)/mkdocs serve

pictures: setup ## take the pictures of the console anew, from the running program; needs Chromium
	$(BIN)/python -m bench.console_pictures

lock: setup ## resolve requirements.lock anew from pyproject.toml
	UV_CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/uv pip compile --quiet --universal --fork-strategy fewest --python-version 3.11 \
	    --generate-hashes --no-emit-index-url --no-emit-find-links --group dev pyproject.toml --output-file requirements.lock

clean: ## remove .venv and everything that can be made again; recordings stay
	rm -rf .venv site dist .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find app bench tests -name __pycache__ -type d -prune -exec rm -rf {} +
