# Targets are names only: what is up to date is decided by content, by the program itself.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: all mesh modes bundle simulate post help setup check test test-slow interpreters bench atlas chaos docs clean

VENV := .venv
# where environments hold their programs: Windows calls that folder otherwise
BIN := $(if $(filter Windows_NT,$(OS)),Scripts,bin)
READY := $(VENV)/.ready
TOOLS := $(VENV)/.tools
RUN := $(VENV)/$(BIN)/python
# the first Python on the path that is new enough; `make PYTHON=/path/to/python3.12` names another
CANDIDATES := python3 python3.13 python3.12 python3.11 python3.14 python
PYTHON ?= $(shell for p in $(CANDIDATES); do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && { command -v $$p; break; }; done)

all: $(READY) ## Reproduce every figure and table of the paper: results/report/index.html
	@$(RUN) -m papers.wang_wang_2019

mesh: $(READY) ## One stage of a scene alone, from its mesh recipes: make mesh SCENE=sps4/far_cb
modes: $(READY) ## From meshes, the modes of each flexible body
bundle: $(READY) ## From meshes and modes, the reduced flexible bodies
simulate: $(READY) ## From reduced bodies, the motion
post: $(READY) ## From the motion, derived series

mesh modes bundle simulate post:
	@$(RUN) stages/$@.py $(or $(SCENE),$(error say which scene: make $@ SCENE=sps4/far_cb))

help: ## This list
	@sed -nE 's/^([a-z-]+):.*## (.*)/  make \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 20

setup: $(TOOLS) ## Create .venv with the pinned versions (done by itself when needed)

check: $(TOOLS) ## Format, lint, types and import rules
	$(VENV)/$(BIN)/ruff format --check .
	$(VENV)/$(BIN)/ruff check .
	$(VENV)/$(BIN)/mypy
	$(VENV)/$(BIN)/lint-imports

test: $(TOOLS) ## Tests, except those marked slow
	$(RUN) -m pytest -q -n auto --dist loadfile --no-loadscope-reorder

test-slow: $(TOOLS) ## The tests marked slow
	$(RUN) -m pytest -q -n auto --dist loadfile --no-loadscope-reorder -m slow

# other Pythons that this machine may have; each gets an environment of its own and runs what `doctor` computes
OTHERS := python3.12 python3.13 python3.14 $(wildcard $(HOME)/.pyenv/versions/3.1[2-9]*/bin/python)

# tests of steps, contacts, joints, loads and derivatives that run with what Numba documents alone, too
CORE := $(addprefix tests/,analytic/test_mechanism_checks.py analytic/test_contact_surfaces.py analytic/test_effects.py \
	properties/test_dynamics_loads.py)

interpreters: $(TOOLS) ## A short run under every other Python, with the lowest and newest libraries; tests with plain Numba
	@try() { there=$(VENV)/others/$$1; echo "-- $$1"; p=$$2; extra=$$3; days=$$4; shift 4; \
		test $$there/.ready -nt constraints.txt && test $$there/.ready -nt pyproject.toml && \
		test $$there/.ready -nt .ci/lowest.txt && test -n "$$(find $$there/.ready -mtime -$$days)" || { \
			$$p -m venv $$there && $$there/$(BIN)/pip install -q --retries 1 --timeout 20 "$$@" -e ".$$extra" && \
			touch $$there/.ready; } || { echo "skipped: what it needs is not available here"; return 0; }; \
		FLEXCLEAR_RESULTS=$$there/results $$there/$(BIN)/python -m flexclear doctor; }; \
	ran=" "; for p in $(OTHERS); do \
		v=$$($$p -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) || continue; \
		case "$$ran" in *" $$v "*) continue;; esac; ran="$$ran$$v "; \
		try $$v $$p "" 365 -c constraints.txt || exit 1; \
	done; test "$$ran" != " " || echo "skipped: there is no other Python here"; \
	try lowest $(RUN) "[render]" 365 -c .ci/lowest.txt && try newest $(RUN) "[render]" 7 --upgrade --upgrade-strategy eager
	@echo "-- plain numba"; FLEXCLEAR_PLAIN_NUMBA=1 FLEXCLEAR_KERNELS=$(VENV)/others/plain $(RUN) -m pytest -q $(CORE)

bench: $(READY) ## Benchmarks of accuracy against cost: docs/benchmarks.md
	$(RUN) -m benchmarks evaluation peers runs commands cold growth ensembles exudyn siconos

chaos: $(READY) ## Periodic or chaotic, with evidence: docs/chaos.md (an hour; keeps every scene that is finished)
	@$(RUN) -m flexclear sections sps4/csj $(foreach d,sps4 sps4/damped,$(d)/far_csj_free $(d)/far_csj_fixed $(d)/far_csj_cb) --page docs/chaos.md

atlas: $(READY) ## Stability of 301 hard cases: docs/stability.md (half an hour; goes on where it stopped)
	@$(RUN) -m benchmarks stability

docs: $(READY) ## The documentation as a site: results/site/index.html
	@$(RUN) -c 'import distributed, ipykernel, mkdocs, nbclient' 2>/dev/null || \
	$(RUN) -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	@$(RUN) -m mkdocs build --quiet --strict --config-file benchmarks/site/mkdocs.yml
	@echo results/site/index.html

clean: ## Remove results and caches; .venv stays
	rm -rf results build dist pipeline/*.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find papers pipeline stages tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +

# Made once, and again when the versions that are asked for change. Bytecode is made of what is imported, when it is.
INSTALL := $(RUN) -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt

$(READY): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "flexclear needs Python >= 3.11: none of '$(CANDIDATES)' is; install one or say make PYTHON=/path/to/python3"; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "flexclear needs Python >= 3.11, $(PYTHON) is older"; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { echo "$(PYTHON) cannot make virtual environments: install its venv package (Debian, Ubuntu: apt-get install python3-venv)"; exit 1; }
	@echo "setting up $(VENV) with $(PYTHON); takes some minutes the first time"
	@test -x $(RUN) || "$(PYTHON)" -m venv $(VENV)
	@$(INSTALL) -e '.[render]'
	@touch $@

# what checks and tests take besides
$(TOOLS): $(READY)
	@$(INSTALL) -e '.[dev,render]'
	@touch $@
