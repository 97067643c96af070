# Everything runs in its own environment, made on first use from the pinned requirements.
VENV ?= .venv
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
PIP := $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check

.PHONY: run test check newest oldest pythons release-check bench reports clean

# The main job: the pedestrian test at 10, 20, ... 60 km/h with every strategy, scored and drawn.
run: $(VENV)/.run
	$(VENV)/bin/smartmot-eval cpna --speeds 10..60 --out results

test: $(VENV)/.dev
	$(VENV)/bin/python -m pytest -n 2

check: test
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports

# The same project with other versions of its dependencies, and with every Python that is found.
newest oldest:
	PYTHON=$(PYTHON) .ci/versions $@

pythons:
	.ci/pythons all

# What has to pass before a release: the slow checks too. `pythons` has all of `newest`.
release-check: check oldest pythons
	.ci/exports
	$(VENV)/bin/smartmot-eval reference --check

# Each prints ratios against peers measured in the same run; peers come from PyPI into an environment of their own.
bench: $(VENV)/.run
	for name in cpna opendrive tracking openscenario; do \
		$(VENV)/bin/python -m benchmarks.$$name || exit 1; done

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

# The reference results in reports/, made again.
reports: $(VENV)/.run
	$(VENV)/bin/smartmot-eval reference
