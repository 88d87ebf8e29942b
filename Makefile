# On a fresh machine, `make demo` and `make test` do everything: they make .venv and install first. What
# `make demo` installs is enough for it alone; `make test` adds the rest.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
DEMO_INSTALLED := $(VENV)/.demo-installed
INSTALLED := $(VENV)/.installed
DEMO := demo
HEAVY := tests
# One test process for each core, and one thread in each: more threads would wait for one another.
# A process that has no more tests takes some of another. What Python compiled is
# kept even where it is told not to: a test that starts processes would compile anew in each.
PYTEST := PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal
TESTED := tests bsg_data bsg_models bsg_robot $(VENV)/links/bsg_cli

.DEFAULT_GOAL := help
.PHONY: help install demo test all heavy coverage faults lint format docs figures site bench package release test-lowest test-latest audit clean

help: ## Say what each target does.
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-11s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# What the locks fit is installed by its hashes; what they lack, such as CUDA's packages where torch
# comes from the package index, and all of it on another system, by constraints.txt alone.
# Of torch, the build for the processor alone is taken where pip finds it; else, also by hash, the index's.
PIP = $(BIN)/python -m pip install --quiet
LOCKED = $(PIP) --require-hashes --no-deps --requirement
CONSTRAINED = $(PIP) --constraint constraints.txt
IS_LOCKED = $(PYTHON) -c 'import platform, sys; sys.exit(not ((3, 11) <= sys.version_info[:2] <= (3, 12) and platform.system() == "Linux" and platform.machine() == "x86_64"))'

$(DEMO_INSTALLED): pyproject.toml constraints.txt requirements-torch-cpu.lock requirements-torch.lock requirements-demo.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Python 3.11 or later is needed; name it as in: make PYTHON=/path/to/python3.11 $(MAKECMDGOALS)" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@echo "installing into $(VENV); the first time takes a few minutes"
	@if $(IS_LOCKED); then \
	  { $(LOCKED) requirements-torch-cpu.lock 2>/dev/null || $(LOCKED) requirements-torch.lock; } && \
	  $(LOCKED) requirements-demo.lock; \
	else \
	  echo "the locks are not for this system: what is installed has no hashes"; \
	  $(CONSTRAINED) torch; \
	fi
	$(CONSTRAINED) --editable '.[train]'
	@touch $@

$(INSTALLED): $(DEMO_INSTALLED) requirements-test.lock
	@if $(IS_LOCKED); then echo "installing what the tests need"; $(LOCKED) requirements-test.lock; fi
	$(CONSTRAINED) --editable '.[test]'
	mkdir -p $(VENV)/links && ln -sfn ../../cli $(VENV)/links/bsg_cli
	@touch $@

install: $(INSTALLED) ## Make .venv and install the project with all that its tests need.

demo: $(DEMO_INSTALLED) ## Run the main job end to end on synthetic buildings; results in demo/.
	rm -rf $(DEMO)
	$(BIN)/bsg-data synth --out $(DEMO)/buildings --scenes 25 --seed 0
	$(BIN)/bsg-data build --hm3d $(DEMO)/buildings --room-layouts $(DEMO)/buildings/layouts --out $(DEMO)/dataset
	$(BIN)/bsg-data split $(DEMO)/dataset --ratios 0.6 0.2 0.2
	$(BIN)/bsg-data pairs $(DEMO)/dataset --draws 10
	$(BIN)/bsg-data check $(DEMO)/dataset
	$(BIN)/bsg-data info $(DEMO)/dataset --figure $(DEMO)/classes.png
	$(BIN)/bsg-train $(DEMO)/dataset --config quick --out $(DEMO)/ceci
	$(BIN)/bsg-train $(DEMO)/dataset --config ceci-sage --out $(DEMO)/ceci-sage --set training.epochs=100
	$(BIN)/bsg-evaluate $(DEMO)/dataset --model $(DEMO)/ceci --model $(DEMO)/ceci-sage --out $(DEMO)/evaluation --html $(DEMO)/report.html
	$(BIN)/bsg-search $(DEMO)/dataset --worlds layout --artifacts room-specific --mask explore --fraction 0.9 --episodes 30 --trace --out $(DEMO)/search
	@echo
	@echo "These buildings are synthetic and few: the figures show that it works, not how well."
	@echo "Open $(DEMO)/report.html in a browser: what was seen, what is believed, and how good that is."
	@echo "Open $(DEMO)/search/trace.html and press play: a robot with the shipped model and one without look for the same"
	@echo "thing; above is what each planner saves in all searches (docs/search.md)."
	@echo "More figures are in $(DEMO)/evaluation and $(DEMO)/classes.png. The dataset is $(DEMO)/dataset;"
	@echo "docs/loading.md opens it elsewhere, docs/evaluation.md says what the metrics are."

test: $(INSTALLED) lint ## Check format, style, types and behaviour: what to run before each commit.
	$(PYTEST) -m "not heavy" --doctest-modules $(TESTED)

all: $(INSTALLED) lint ## Run every check, with site, tutorials, wheel, Dask, browser, fuzz and kills.
	$(PYTEST) --doctest-modules $(TESTED)

heavy: $(INSTALLED) ## Run what `make all` has besides `make test`; HEAVY=tests/docs is a part.
	$(PYTEST) -m heavy $(HEAVY)

coverage: $(INSTALLED) ## Run all tests, and list the lines that none of them runs.
	$(PIP) 'pytest-cov>=5,<8'
	$(PYTEST) --cov --cov-report=term-missing

faults: $(INSTALLED) ## Kill, damage and feed everything in full; under an hour.
	$(PYTEST) --full tests/faults

lint: $(INSTALLED) ## Check format, style and types.
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/mypy docs/examples

format: $(INSTALLED) ## Format the code and mend what ruff can mend.
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

docs: $(INSTALLED) ## Write the generated parts of the docs anew, and execute the tutorials.
	$(BIN)/python scripts/write_docs.py
	$(BIN)/python scripts/site/execute.py docs/tutorials/*.md

figures: demo ## Draw the figures of the docs; that of the explorer needs Chromium.
	$(BIN)/python scripts/figures/concepts.py --out docs/figures
	$(BIN)/python scripts/figures/living.py --out docs/figures/living.svg
	$(BIN)/python scripts/figures/search.py $(DEMO)/dataset --scene 00017-sta13NdfxpY --out docs/figures/search.png
	$(BIN)/bsg-belief docs/home.json --out $(DEMO)/home.html --force
	chromium --headless --no-sandbox --window-size=1200,700 --screenshot=docs/figures/explorer.png "file://$(CURDIR)/$(DEMO)/home.html"

site: $(INSTALLED) ## Build the documentation as a site, strictly; open site/index.html.
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

bench: $(INSTALLED) ## Time the main jobs beside what people would use instead: make bench HM3D=PATH
	$(BIN)/python scripts/measure/speed.py $(if $(HM3D),--hm3d "$(HM3D)")

package: $(INSTALLED) ## Build wheel and source archive into dist, and try both in fresh environments.
	$(PIP) 'build>=1.2,<2'
	$(BIN)/python scripts/package/try_out.py --out dist --constraint constraints.txt

release: $(INSTALLED) ## Prepare a release: make release VERSION=0.2.0; stops before any upload.
	@test -n "$(VERSION)" || { echo "say which: make release VERSION=0.2.0" >&2; exit 2; }
	$(PIP) 'build>=1.2,<2' 'twine>=6,<8'
	$(BIN)/python scripts/package/release.py $(VERSION)

# Both leave .venv alone. uv resolves, because pip has no way to ask for the lowest versions.
# rerun-sdk is left out of the lowest versions: with it, NumPy and pyarrow would not be the lowest.
test-lowest: ## Run the tests with the lowest versions of the dependencies that pyproject.toml allows.
	@mkdir -p $(VENV) && echo "rerun-sdk; python_version < '3'" > $(VENV)/left-out.txt
	$(call TEST_RESOLVED,lowest-direct,--override $(VENV)/left-out.txt)

test-latest: ## Run the tests with the latest versions of the dependencies.
	$(call TEST_RESOLVED,highest)

define TEST_RESOLVED
	$(PYTHON) -m venv --clear $(VENV)/$(1) && $(VENV)/$(1)/bin/python -m pip install --quiet 'uv>=0.5,<1'
	$(VENV)/$(1)/bin/uv pip install --quiet --python $(VENV)/$(1)/bin/python --resolution $(1) $(2) --editable '.[test]'
	$(subst $(BIN)/,$(VENV)/$(1)/bin/,$(PYTEST)) tests
endef

audit: ## Ask pip-audit for known weaknesses of what is locked; needs the network.
	$(PYTHON) -m venv $(VENV)/audit
	$(VENV)/audit/bin/python -m pip install --quiet 'pip-audit>=2.7,<3'
	$(VENV)/audit/bin/pip-audit --strict --disable-pip --require-hashes \
	  $(addprefix --requirement ,requirements-torch.lock requirements-demo.lock requirements-test.lock)

clean: ## Remove the environment, the demos and all caches.
	rm -rf $(VENV) $(DEMO) build dist site *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
