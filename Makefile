# `make demo`, `make demo-rl` and `make test` set up everything they need in .venv.
PYTHON ?= python3
BIN := .venv/bin
UNCOMPILED := $(BIN)/python -m pytest tests/solver tests/test_fuzz.py
# What is imported is compiled to bytecode then; pip would take half a minute for all the rest.
INSTALL := $(BIN)/pip install --quiet --no-compile --disable-pip-version-check \
	--constraint .ci/constraints.txt

.PHONY: demo demo-rl docs test test-all uncompiled lint clean

demo: .venv/.studies
	$(BIN)/python -m agents.compare --scene dam_break --n-instances 6 --n-search 4 \
		--grid 3 4 2 --output runs/demo

demo-rl: .venv/.agents
	$(BIN)/python -m agents.ppo_warm --scene dam_break --n-envs 4 --steps 60000 \
		--output runs/demo-rl
	$(BIN)/python -m agents.compare --scene dam_break --agents default tuned_cfl ppo_warm \
		--n-instances 16 --networks ppo_warm runs/demo-rl/ppo_warm_dam_break_seed0/network.npz \
		--output runs/demo-rl

# The site: docs/_build/html/index.html. It needs no network, neither to be built nor to be read.
docs: .venv/.docs
	$(BIN)/python -m sphinx -W --keep-going -b html docs docs/_build/html

# What a contributor needs: minutes. The short parts come first, side by side.
test: .venv/.dev
	$(MAKE) --jobs 2 lint uncompiled
	$(BIN)/python -m pytest -m "not slow"

# The solver runs as plain Python too, which tests each effect by itself without compiling it.
uncompiled: .venv/.dev
	NUMBA_DISABLE_JIT=1 $(UNCOMPILED) -m "without_jit and not slow"

# Everything, also on a cluster of Ray and of Dask.
test-all: .venv/.dev .venv/.docs .venv/.cluster lint
	$(BIN)/python -m pytest
	NUMBA_DISABLE_JIT=1 $(UNCOMPILED) -m without_jit

lint: .venv/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean:
	rm -rf .venv runs docs/_build docs/generated

.venv/bin/python:
	$(PYTHON) -m venv .venv

.venv/.studies: .venv/bin/python pyproject.toml .ci/constraints.txt
	$(INSTALL) --editable ".[studies]"
	touch $@

.venv/.agents: .venv/bin/python pyproject.toml .ci/constraints.txt
	$(INSTALL) --editable ".[agents]"
	touch $@

.venv/.docs: .venv/bin/python pyproject.toml .ci/constraints.txt
	$(INSTALL) --editable ".[docs]"
	touch $@

.venv/.cluster: .venv/bin/python pyproject.toml .ci/constraints.txt
	$(INSTALL) --editable ".[cluster]"
	touch $@

.venv/.dev: .venv/bin/python pyproject.toml .ci/constraints.txt
	$(INSTALL) --editable ".[agents,dev]"
	touch $@
