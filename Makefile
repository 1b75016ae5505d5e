# Everything is installed in a virtual environment inside the clone; nothing global, no root.
#
#   make demo     the warehouse, from scenario file to report
#   make test     all tests               make test ARGS="-k world"
#   make lint     ruff and mypy
#   make gallery  every scenario, two at a time, compared with reports/baseline.json
#   make gallery EFFORT=quick   the same with plan.effort quick, in under five minutes on two cores
#   make baseline every scenario at the effort of its file; writes reports/baseline.json
#   make bench    speed against peers
#   make study    how graphs rank homotopy classes, on 1,000 random worlds (half an hour; goes on where it stopped)
#   make peers    installs what benchmarks and some tests compare with (needs a C compiler)
#   make reproduction   every figure printed in the source beside ours: docs/reproduction.md
#   make figures  those of docs/speed_graph.md, docs/certificate.md, docs/vc_method.md and docs/braking_zones.md
#   make clean    removes environment, caches and reports
#
# PYTHON=... chooses the interpreter (3.11, 3.12 or 3.13), VENV=... the place of the environment.

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
MAKEFLAGS += --no-builtin-rules
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

VENV ?= .venv
PYTHON ?=
ARGS ?=
JOBS ?= auto
EFFORT ?=
GALLERY ?= --jobs 2
RUN := $(VENV)/bin/python -m

# Packages of another Python (a sourced ROS workspace, say) must not shadow those of the lock file.
unexport PYTHONPATH PYTHONHOME
# Worker processes share the cores: one thread each.
export OMP_NUM_THREADS ?= 1

# An environment of a clone that has moved since, or of another PYTHON, is built anew.
STAMP := $(VENV)/.installed
STALE := $(shell tools/set-up --check "$(VENV)" "$(PYTHON)" || echo stale)

.PHONY: help demo test lint gallery baseline bench study reproduction peers figures clean setup
ifneq ($(STALE),)
.PHONY: $(STAMP)
endif

help:
	@sed -n '/^#   make/s/^#   //p' Makefile

setup: $(STAMP)

$(STAMP): requirements.lock pyproject.toml
	@tools/set-up "$(VENV)" "$(PYTHON)"

$(VENV)/.installed-bench: requirements-bench.lock $(STAMP)
	$(RUN) pip install --quiet --disable-pip-version-check --require-hashes -r requirements-bench.lock
	@touch $@

demo: $(STAMP)
	$(RUN) verify scenarios/warehouse.yaml

gallery: $(STAMP)
ifeq ($(EFFORT),)
	$(RUN) verify scenarios/*.yaml $(GALLERY) --baseline reports/baseline.json
else
	@rm -rf build/scenarios && mkdir -p build/scenarios
	@for file in scenarios/*.yaml; do sed 's/^  effort: .*/  effort: $(EFFORT)/' "$$file" >"build/$$file"; done
	$(RUN) verify build/scenarios/*.yaml $(GALLERY) --out reports/$(EFFORT) --baseline reports/baseline.json
endif

baseline: $(STAMP)
	$(RUN) verify scenarios/*.yaml $(GALLERY) --baseline reports/baseline.json --update-baseline

test: $(STAMP)
	$(RUN) pytest -n $(JOBS) --maxprocesses 8 --dist loadfile $(ARGS)

lint: $(STAMP)
	$(RUN) ruff check
	$(RUN) ruff format --check
	$(RUN) mypy

peers: $(VENV)/.installed-bench

bench: $(VENV)/.installed-bench
	$(RUN) benchmarks $(ARGS)

study: $(STAMP)
	$(RUN) benchmarks.ranking --worlds 1000 --out reports/ranking.jsonl --summary docs/data/ranking.json $(ARGS)

reproduction: $(STAMP)
	$(RUN) benchmarks.reproduction $(ARGS)

figures: $(STAMP)
	$(RUN) benchmarks.figures
	$(RUN) benchmarks.figures_certificate
	$(RUN) benchmarks.figures_vc_method
	$(RUN) benchmarks.figures_zones

clean:
	rm -rf "$(VENV)" build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find reports -mindepth 1 ! -name .gitkeep ! -name baseline.json -delete
	find vnav_drake systems verify tests benchmarks -name __pycache__ -prune -exec rm -rf {} +
