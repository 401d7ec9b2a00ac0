# DualCone. `make help` lists the targets. A machine needs rustup, Python 3.11, gcc and make; the
# rest is installed below .venv/ and build/.
#
# Places that several checkouts may share:
#   DUALCONE_VENVS    the virtual environments                  (default .venv)
#   DUALCONE_BLENDER  the real Blender that the tests start     (default build/blender-5.2)

PYTHON  ?= $(or $(shell command -v python3.11),python3)
VENVS   := $(abspath $(or $(DUALCONE_VENVS),.venv))
TOOLS   := $(VENVS)/tools
BPY_NEW := $(VENVS)/bpy-5.0
BPY_OLD := $(VENVS)/bpy-4.2

export DUALCONE_BLENDER := $(abspath $(or $(DUALCONE_BLENDER),build/blender-5.2))
export PATH := $(TOOLS)/bin:$(PATH)

# Blender does not read a wheel's glibc number: a wheel linked against a new glibc installs and
# then fails at import. zig links against the old one that the tag promises.
HOST_WHEEL := $(if $(filter Linux,$(shell uname -s)),--zig --compatibility manylinux_2_28)
CORE_FILES := Cargo.toml Cargo.lock .cargo/config.toml pyproject.toml $(shell find src python -type f -name '*.[rp][sy]*')
ADDON_FILES := $(shell find addon -type f -not -name '*.pyc')

.PHONY: help demo test lint format test-rust test-python test-blender extension extension-full extension-all bench bench-embree profile bench-paper scaling chart fuzz parity parity-references stability clean
.DELETE_ON_ERROR:

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-18s %s\n", $$1, $$2 }' Makefile

demo: $(BPY_NEW)/.ready build/site/.ready ## render the wheel loader: frames and a contact sheet in out/demo
	PYTHONPATH=build/site $(BPY_NEW)/bin/python scripts/demo.py

test: lint test-rust test-python test-blender ## everything that proves the project

lint: $(TOOLS)/.ready ## formatters and linters, changing nothing
	cargo fmt --check
	cargo clippy --locked --all-targets -- -D warnings
	cargo clippy --locked --all-targets --features python -- -D warnings
	@if command -v cargo-deny >/dev/null; then cargo deny check bans licenses sources; \
	  else echo "cargo deny: SKIPPED, it is not installed (cargo install --locked cargo-deny)"; fi
	ruff check
	ruff format --check
	pyright --pythonpath $(TOOLS)/bin/python

format: $(TOOLS)/.ready ## rewrite the sources as lint wants them
	cargo fmt
	ruff check --fix
	ruff format

test-rust: ## the renderer, without Python
	cargo test --locked

# bpy runs one Blender per process, so each version gets its own.
test-python: $(BPY_NEW)/.ready $(BPY_OLD)/.ready build/site/.ready ## the add-on in Blender 5.0 and 4.2 (bpy wheels)
	PYTHONPATH=build/site $(BPY_NEW)/bin/python -m pytest tests/python
	PYTHONPATH=build/site $(BPY_OLD)/bin/python -m pytest tests/python
	PYTHONPATH=build/site $(BPY_NEW)/bin/python -m pytest tests/stability

test-blender: extension $(BPY_NEW)/.ready ## the installed extension in the real Blender 5.2
	$(BPY_NEW)/bin/python -m pytest tests/blender

extension: build/extension.ready ## dist/dualcone-VERSION-PLATFORM.zip for this platform

# The denoiser's library, for a Blender that was built without it; 87 MB.
extension-full: build/extension.ready ## the same with OpenImageDenoise inside
	rm -rf build/wheel-full
	$(TOOLS)/bin/pip download --quiet --no-deps --dest build/wheel-full --requirement tests/requirements-full.txt
	$(TOOLS)/bin/python scripts/build_extension.py --full build/wheel/*.whl build/wheel-full/*.whl

extension-all: $(TOOLS)/.ready ## the same for all five platforms, cross-built
	$(TOOLS)/bin/python scripts/build_all.py

# `make scaling SCALING_FLAGS=--full` goes to 10 million triangles, `--write-docs` writes docs/scaling.md.
SCALING_FLAGS ?=

scaling: $(BPY_NEW)/.ready build/site/.ready ## time and memory against triangles, pixels, window, lamps
	PYTHONPATH=build/site $(BPY_NEW)/bin/python scripts/scaling.py $(SCALING_FLAGS)

bench: $(BPY_NEW)/.ready build/site/.ready ## speed and memory against their targets
	PYTHONPATH=build/site $(BPY_NEW)/bin/python scripts/bench.py
	PYTHONPATH=build/site $(BPY_NEW)/bin/python scripts/bench_export.py

# Debian's packages, unpacked without being installed; Embree 3.13 or another one that is installed.
bench-embree: ## the ray kernel beside Embree's and obvhs's
	mkdir -p build/embree
	@cd build/embree && apt-get download libembree-dev libembree3-3 libtbb12 \
	  && for package in *.deb; do dpkg-deb -x $$package .; done \
	  || echo "Embree's packages are not to be had here"
	cargo bench --locked --bench accel

profile: $(BPY_NEW)/.ready build/profile/.ready ## where a frame's time goes, as a table and a flame graph (needs perf)
	PYTHONPATH=build/profile/site $(BPY_NEW)/bin/python scripts/profile.py

bench-paper: $(BPY_NEW)/.ready build/site/.ready ## Table 1 and Figure 3 of the paper, measured again: docs/bench-paper.md
	PYTHONPATH=build/site $(BPY_NEW)/bin/python scripts/bench_paper.py

# What is charted, and how: `make chart CHART_FLAGS=--quick`, or `--size 240x135 --minutes 600`.
CHART_SCENES ?= indoor loader figure
CHART_FLAGS  ?=

chart: $(VENVS)/chart/.ready build/site/.ready ## speed against accuracy, Cycles too: out/chart/index.html (an hour)
	PYTHONPATH=build/site $(VENVS)/chart/bin/python -m dualcone.chart \
	  $(CHART_SCENES:%=blend_samples/%.blend) --out out/chart $(CHART_FLAGS)

parity: $(BPY_NEW)/.ready build/site/.ready ## every feature against Cycles: out/parity/index.html and docs/parity.md
	PYTHONPATH=build/site $(BPY_NEW)/bin/python scripts/parity.py --write-docs

# `make fuzz FUZZ=100-199` makes other scenes: a number is one.
FUZZ ?= 0-49

fuzz: $(BPY_NEW)/.ready build/site/.ready ## scenes that chance makes against Cycles; what differs is reduced to its cause
	PYTHONPATH=build/site $(BPY_NEW)/bin/python scripts/fuzz_parity.py $(subst -, ,$(FUZZ)) --keep out/fuzz

parity-references: $(BPY_NEW)/.ready build/site/.ready ## render the pictures of Cycles in tests/parity/references anew
	PYTHONPATH=build/site $(BPY_NEW)/bin/python scripts/parity.py --references

stability: $(BPY_NEW)/.ready build/site/.ready ## where sharing samples may fail: larger pictures, more seeds
	PYTHONPATH=build/site DUALCONE_STABILITY=long $(BPY_NEW)/bin/python -m pytest tests/stability -rP

clean: ## remove what was built, keep what was downloaded
	rm -rf build/site build/wheel build/extension.ready dist out
	cargo clean

$(VENVS)/%/.ready: tests/requirements-%.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11) and "Python 3.11 is needed, the only one that has bpy wheels of both versions; say where: make PYTHON=/path/to/python3.11")'
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/pip install --quiet --disable-pip-version-check --requirement $<
	touch $@

# The wheel, unpacked: venvs that several checkouts share must not hold one checkout's wheel.
build/site/.ready: $(CORE_FILES) $(TOOLS)/.ready
	rm -rf build/wheel build/site
	maturin build --release --locked $(HOST_WHEEL) --out build/wheel
	$(TOOLS)/bin/pip install --quiet --no-deps --target build/site build/wheel/*.whl
	touch $@

# With stacks that perf can read, and the lines of functions that are inlined.
build/profile/.ready: $(CORE_FILES) $(TOOLS)/.ready
	rm -rf build/profile
	CARGO_PROFILE_RELEASE_DEBUG=line-tables-only \
	  RUSTFLAGS="-C target-cpu=x86-64-v2 -C force-frame-pointers=yes" \
	  maturin build --release --locked --out build/profile/wheel
	$(TOOLS)/bin/pip install --quiet --no-deps --target build/profile/site build/profile/wheel/*.whl
	touch $@

build/extension.ready: build/site/.ready $(ADDON_FILES) scripts/build_extension.py
	$(TOOLS)/bin/python scripts/build_extension.py build/wheel/*.whl
	touch $@
