# Everything runs in .venv, which `setup` builds from requirements.lock once and again only when it has to.
# make PYTHON=python3.12 chooses the interpreter that .venv is built on.
PYTHON ?=
# make bench SEEDS=11,12 MOVIES=8 judges on 8 tabletop movies, and on 8 of putting and taking, of each of these seeds;
# they are rendered first.
SEEDS ?=
MOVIES ?=
BIN := .venv/bin
PYTEST := $(BIN)/python -m pytest
NBVAL := --nbval --nbval-current-env --nbval-cell-timeout=300
# Nothing is fetched while one works: no news, no updates, no extensions.
LAB := --LabApp.default_url=/lab/tree/notebooks --LabApp.news_url=None --LabApp.extension_manager=readonly \
       --LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate
# A file of tests at a time to each of two processes: a notebook's cells stay together and in order.
SPREAD := --numprocesses=2 --dist=loadfile
# Tests of every kind; folders that are not there are left out.
TESTS := $(wildcard README.md tests/unit tests/integration tests/notebooks tests/browser tests/benchmarks sec_lab notebooks)

# Kernels come from .venv, whatever else is installed for the user; figures from the notebooks' own backend.
export JUPYTER_PREFER_ENV_PATH := 1
unexport MPLBACKEND

.DEFAULT_GOAL := help
.PHONY: help setup report lab test check bench notebooks chains lint types layers clean

help:  ## list what can be made
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup:  ## build .venv from requirements.lock, if need be
	@.ci/set_up.sh $(PYTHON)

report: setup  ## execute every notebook and write build/report/index.html
	@$(BIN)/sec-lab report

lab: setup  ## open the notebooks in JupyterLab
	@$(BIN)/jupyter lab $(LAB) $(if $(filter 0,$(shell id -u)),--allow-root)

test: setup lint types layers  ## run everything that CI runs
	@$(PYTEST) $(SPREAD) --doctest-modules --doctest-glob=README.md --benchmark-disable $(NBVAL) $(TESTS)

check: setup lint types layers  ## run the quick part of it, for every commit
	@$(PYTEST) -q -m "not slow" $(wildcard tests/unit)

bench: setup  ## print the tables of speed and quality
	@$(PYTEST) $(if $(SEEDS),--seeds=$(SEEDS)) $(if $(MOVIES),--movies=$(MOVIES)) --benchmark-only --benchmark-columns=min,median,max,ops,rounds --benchmark-sort=name tests/benchmarks

notebooks: setup  ## execute the notebooks in place and store their outputs
	@$(BIN)/python tests/notebooks/execute.py $(wildcard notebooks/*.ipynb)

chains: setup  ## observe the tabletop movies again, keep their chains, and execute the notebook that shows them
	@$(BIN)/python -m sec_lab.worlds.tabletop.chains datasets/tabletop_actions --jobs 2
	@$(BIN)/python -m sec_lab.worlds.tabletop.chains datasets/put_and_take --jobs 2
	@$(BIN)/python tests/notebooks/execute.py notebooks/chapter2_2_real_actions.ipynb notebooks/chapter2_3_learning.ipynb

lint:
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types:
	@$(BIN)/mypy

layers:
	@$(BIN)/lint-imports --no-logo

clean:  ## remove .venv and all that was built
	rm -rf .venv build dist *.egg-info .benchmarks .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
