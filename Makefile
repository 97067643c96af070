# Everything runs in its own environment, made on first use from the pinned requirements.
VENV ?= .venv
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
PIP := $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check

.PHONY: run test check docs newest oldest pythons release-check release-steps bench reports clean

# The main job: the pedestrian test at 10, 20, ... 60 km/h with every strategy, scored and drawn.
run: $(VENV)/.run
	$(VENV)/bin/smartmot-eval cpna --speeds 10..60

# Neighbours stay together, as they share results. Bytecode is kept: some tests start Python many times.
test: $(VENV)/.dev
	PYTHONDONTWRITEBYTECODE= $(VENV)/bin/python -m pytest -n 2 --dist worksteal

check: test
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports

# The documentation site in build/site; a warning fails it. Examples run, and their figures become part of it.
docs: $(VENV)/.docs
	$(VENV)/bin/python -m sphinx -b html -W --keep-going -q -j auto -c docs/site -d build/doctrees . build/site
	@echo "build/site/docs/index.html"

# The same project with other versions of its dependencies, and with every Python that is found.
newest oldest:
	PYTHON=$(PYTHON) .ci/versions $@

pythons:
	.ci/pythons all

# All that comes before an upload, in a clean clone of the last commit: `git` knows what belongs to the project.
# Data that lie beside the project lie beside the clone too.
release-check:
	@test -z "$$(git status --porcelain)" || { echo "commit first: the last commit is what is checked" >&2; exit 1; }
	rm -rf build/release && git clone --quiet . build/release
	test ! -d ../shared || ln -sfn "$$(realpath ../shared)" build/shared
	$(MAKE) -C build/release VENV=.venv release-steps

# `pythons` has all of `newest`, `check` has the examples.
release-steps: check oldest pythons
	.ci/docs
	.ci/distribution
	.ci/exports
	.ci/traffic
	.ci/container
	$(VENV)/bin/smartmot-eval reference --check
	$(MAKE) bench

# Each prints ratios against peers measured in the same run; peers come from PyPI into an environment of their own.
# All are run, also where one misses its goals. Left out are benchmarks without a peer, and those that take hours.
bench: $(VENV)/.dev
	status=0; for name in cpna opendrive tracking compare_trackers openscenario environment lidar; do \
		$(VENV)/bin/python -m benchmarks.$$name || status=1; done; exit $$status

clean:
	rm -rf $(VENV) build dist results *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/.run: requirements/run.txt pyproject.toml
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed; name it with PYTHON=..." >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(PIP) --requirement requirements/run.txt
	$(PIP) --no-deps --no-build-isolation --editable .
	touch $@

$(VENV)/.dev: requirements/dev.txt $(VENV)/.run
	$(PIP) --requirement requirements/dev.txt
	touch $@

$(VENV)/.docs: requirements/docs.txt $(VENV)/.run
	$(PIP) --requirement requirements/docs.txt
	touch $@

# The reference results in reports/, made again.
reports: $(VENV)/.run
	$(VENV)/bin/smartmot-eval reference
