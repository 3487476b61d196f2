# `make demo`, `make demo-rl` and `make test` set up everything they need in .venv.
PYTHON ?= python3
BIN := .venv/bin
INSTALL := $(BIN)/pip install --quiet --disable-pip-version-check --constraint .ci/constraints.txt

.PHONY: demo demo-rl test lint clean

demo: .venv/.studies
	$(BIN)/python -m agents.compare --scene dam_break --n-instances 6 --n-search 4 \
		--grid 3 4 2 --output runs/demo

demo-rl: .venv/.agents
	$(BIN)/python -m agents.ppo --scene dam_break --steps 30000 --output runs/demo-rl
	$(BIN)/python -m agents.compare --scene dam_break --n-instances 6 --n-search 4 \
		--grid 3 4 2 --networks ppo runs/demo-rl/ppo_dam_break/network.npz --output runs/demo-rl

test: .venv/.dev lint
	$(BIN)/python -m pytest

lint: .venv/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean:
	rm -rf .venv runs

.venv/bin/python:
	$(PYTHON) -m venv .venv

.venv/.studies: .venv/bin/python pyproject.toml .ci/constraints.txt
	$(INSTALL) --editable ".[studies]"
	touch $@

.venv/.agents: .venv/bin/python pyproject.toml .ci/constraints.txt
	$(INSTALL) --editable ".[agents]"
	touch $@

.venv/.dev: .venv/bin/python pyproject.toml .ci/constraints.txt
	$(INSTALL) --editable ".[agents,dev]"
	touch $@
