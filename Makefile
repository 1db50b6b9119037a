# Everything a newcomer needs: `make demo` and `make test`; each sets up what it uses, in .venv.
PYTHON ?= python3
BIN := .venv/bin
DEMO ?= out/demo
SEED ?= 0
USE := worldgen,viewer
DEV := worldgen,viewer,photos,usd,s3,docs,dev

.PHONY: demo test test-changed test-all check docs wheel bench clean

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(not ((3, 11) <= sys.version_info[:2] < (3, 15)))' \
	  || { echo "virtual-community needs Python 3.11 to 3.14; say which: make demo PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv .venv

# $(call install,EXTRAS): pip would make byte code of all, in one process, and none of what is in src. UNUSED: never imported.
UNUSED := /(tests?|sumo|OpenGL|pip|setuptools|mypyc?)/
define install
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e '.[$(1)]'
	@$(BIN)/python -m compileall -q -j 0 -x '$(UNUSED)' .venv/lib src
endef

.venv/demo: pyproject.toml constraints.txt | .venv/bin/python
	$(call install,$(USE))
	@touch $@

.venv/dev: pyproject.toml constraints.txt | .venv/bin/python
	$(call install,$(DEV))
	@touch .venv/demo $@

# Bodies and robots with real meshes, and the page's 3D library, from the packages that ship them. Compiled code is warmed once, here.
.venv/assets: .venv/demo
	$(BIN)/vico assets install people
	$(BIN)/vico assets install robots
	$(BIN)/vico assets install viewer
	$(BIN)/vico warm-up
	@touch $@

demo: .venv/assets
	$(BIN)/vico demo --out $(DEMO) --seed $(SEED) --force

# Many tests start processes: none need compile the sources' byte code, whatever the environment says.
PYTEST := PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal --durations 60 --durations-min 4

test: .venv/dev
	$(PYTEST)

# Those of the rooms that changed since this branch left main, and of the rooms above them.
test-changed: .venv/dev
	PYTHONDONTWRITEBYTECODE= $(BIN)/python scripts/test_changed.py

# Those too that take minutes each.
test-all: .venv/dev
	$(PYTEST) -m ''

# The Khronos glTF validator, for a test; without npm that test is skipped.
.venv/gltf:
	@if command -v npm > /dev/null; then npm install --silent --prefix .venv/gltf gltf-validator@2.0.0-dev.3.10; \
	  else echo "no npm: worlds' meshes are not held against the glTF validator"; fi

check: .venv/dev .venv/gltf
	$(BIN)/ruff format --no-cache --check .
	$(BIN)/ruff check --no-cache .
	$(BIN)/mypy
	$(BIN)/python scripts/api_reference.py out/api

# The API reference, a page a module: out/api/index.html.
docs: .venv/dev
	$(BIN)/python scripts/api_reference.py out/api

# The wheel, installed into an empty environment and used there.
wheel: .venv/dev
	$(BIN)/python scripts/try_wheel.py

bench: .venv/assets .venv/dev
	for what in world render sim memory; do $(BIN)/vico bench $$what --table benchmarks/results/$$what.md; done

clean:
	rm -rf .venv out build dist .pytest_cache .mypy_cache .ruff_cache src/*.egg-info
