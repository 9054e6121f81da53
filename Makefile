# The two commands a newcomer types are `make demo` and `make test`; the rest serves those who
# work on retraverse. Everything is made inside .venv.
PYTHON ?= python3
BIN := .venv/bin
SOURCES := pyproject.toml constraints.txt $(wildcard src/kernels/*)
# Where pip finds packages can be set with pip's own variables (PIP_INDEX_URL and so on).
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
PYTEST := $(BIN)/python -m pytest
EXTRAS := test,learned,formats,video,cluster
# An index that has torch's builds without CUDA: make test TORCH_INDEX=... (see the README).
TORCH_INDEX ?=

.PHONY: demo test test-full test-twin test-no-compiler check format docs bench clean

demo: .venv/core
	$(BIN)/retraverse demo

test: .venv/test
	$(PYTEST) -q -n 2 --dist loadscope
	$(MAKE) test-twin test-no-compiler

# Heavy tests (kills, faults, fuzzing) at the counts the promises were made for.
test-full: .venv/test
	RETRAVERSE_SCALE=1 $(PYTEST) -q -n 2 --dist loadscope
	$(MAKE) test-twin test-no-compiler

# The NumPy twins of the kernels, although the compiled ones are there; not on whole real drives,
# which they take minutes for.
test-twin: .venv/test
	RETRAVERSE_KERNELS=numpy $(PYTEST) -q -n 2 tests/unit/kernels tests/unit/techniques \
		tests/oracle tests/golden tests/contract --ignore tests/golden/test_int8_on_real_drives.py

# Install and run where no C++ compiler is, and no extra either.
test-no-compiler:
	tools/check-no-compiler $(PYTHON)

check: .venv/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(PYTEST) -q tests/unit/test_import_direction.py
	$(MAKE) docs

format: .venv/dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: .venv/dev
	$(BIN)/python tools/make_reference_pages.py
	$(BIN)/zensical build --clean

# Ratios inside one run; wants an idle machine. OPENBLAS_CORETYPE would slow the peer.
bench: .venv/test
	env -u OPENBLAS_CORETYPE -u OPENBLAS_L2_SIZE $(PYTEST) -q benchmarks --benchmark-only

.venv/python:
	$(PYTHON) -m venv .venv
	touch $@

.venv/core: .venv/python $(SOURCES)
	$(PIP) --editable .
	touch $@

.venv/test: .venv/python $(SOURCES)
	$(PIP) $(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX)) --editable '.[$(EXTRAS)]'
	touch $@ .venv/core

.venv/dev: .venv/test
	$(PIP) --editable '.[$(EXTRAS),dev]'
	touch $@

clean:
	rm -rf .venv build site demo
