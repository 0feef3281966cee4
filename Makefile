# Everything that a new machine with rustup, gcc and make needs to test, try and measure mimu.

TOOLCHAIN := $(shell sed -n 's/^channel = "\(.*\)"/\1/p' rust-toolchain.toml)
TARGET := thumbv7em-none-eabihf
# Target of the page.
WEB_TARGET := wasm32-wasip1
CARGO := cargo +$(TOOLCHAIN)
# Built separately: in a common build, the second would get the vector table of the first.
FIRMWARE := $(CARGO) build --locked -p mimu-firmware --profile image --target $(TARGET)
COUNTED := $(CARGO) build --locked -p mimu-counted --profile image --target $(TARGET)
# All crates whose tests run on the PC. The Python extension module is tested from Python.
ON_PC := --workspace --exclude mimu-counted --exclude mimu-no-panic --features mimu-tests/studies

MDBOOK := 0.5.4
LOWEST := $(shell sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
PUBLISHED := mimu-core mimu-recording mimu-allan mimu mimu-thermal mimu-body mimu-device mimu-equipment mimu-export mimu-fleet mimu-wizard mimu-station mimu-cli

# Written when all tests have been built. Their build has the programs of the demo too, with other features of the dependencies than a build of these
# programs alone, which would compile everything again.
BUILT := $(or $(CARGO_TARGET_DIR),target)/debug/.tests-built

# Stages of `make test`; each can be run alone, as in `make clippy`. Tests are linked before they run, so that both times are shown.
STAGES := fmt clippy rustdoc images no-panic build-tests tests

.PHONY: help data test $(STAGES) run-tests interop python nightly dist book site lint msrv package wheel web web-tests demo example station papers blind clumsy bench budget count device fuzz audit toolchain

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' Makefile

# Automatic installation may be switched off, so it is requested explicitly. With the checks, a second run is fast and works offline.
toolchain:
	@rustup toolchain list | grep -q '^$(TOOLCHAIN)' \
	  && rustup target list --toolchain $(TOOLCHAIN) --installed | grep -q $(TARGET) \
	  && rustup target list --toolchain $(TOOLCHAIN) --installed | grep -q $(WEB_TARGET) \
	  && rustup component list --toolchain $(TOOLCHAIN) --installed | grep -q clippy \
	  && rustup component list --toolchain $(TOOLCHAIN) --installed | grep -q rustfmt \
	  || rustup toolchain install $(TOOLCHAIN) --profile minimal -c rustfmt -c clippy -t $(TARGET) -t $(WEB_TARGET)

test: toolchain ## formatting, lints, documentation, firmware, all tests but the nightly ones
	@set -e; took=; for stage in $(STAGES); do \
	  echo "== $$stage"; begun=$$(date +%s); \
	  $(MAKE) --no-print-directory $$stage; \
	  took="$$took$$(printf '%-12s %4d s' $$stage $$(( $$(date +%s) - begun )))\n"; \
	done; printf '\n%b' "$$took"

# A fresh build compiles each crate once, so intermediate results for incremental builds are not needed. The demo uses the builds of the
# tests: with another setting they would compile the workspace again.
test $(STAGES) run-tests interop demo nightly: export CARGO_INCREMENTAL = 0
# Lints and documentation share one check of the workspace: both run clippy's driver, with the flags of `cargo clippy -- -D warnings`. What runs is not built
# by it: it leaves out optimisations of rustc, and the image would not fit its budget.
clippy rustdoc: export RUSTC_WORKSPACE_WRAPPER = clippy-driver
clippy rustdoc: export CLIPPY_ARGS = -D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__
# Tests of devices and of the wizard wait for answers more than they compute.
test tests run-tests: export RUST_TEST_THREADS = 3
# Tests of Python use the extension module that `build-tests` has compiled; `make python` alone builds and tests the wheel.
test tests: export MIMU_LIBRARY = $(abspath $(or $(CARGO_TARGET_DIR),target))/debug/lib_mimu.so

fmt:
	$(CARGO) fmt --all --check

clippy:
	$(CARGO) check --locked $(ON_PC) --exclude mimu-firmware --all-targets
	$(CARGO) check --locked -p mimu-recording --no-default-features
	$(CARGO) check --locked -p mimu-recording --no-default-features --target $(WEB_TARGET)
	@# The page's C libraries are not needed to check Rust: nothing is linked.
	CC_wasm32_wasip1=true AR_wasm32_wasip1=true $(CARGO) check --locked -p mimu-web --target $(WEB_TARGET)
	$(CARGO) check --locked -p mimu-firmware -p mimu-counted -p mimu-no-panic --profile image --target $(TARGET)
	$(CARGO) check --locked -p mimu-firmware --profile image --features usb --target $(TARGET)
	$(CARGO) check --locked -p mimu-firmware --profile image --features matek-h743 --target $(TARGET)
	$(CARGO) check --locked -p mimu-firmware --profile image --features matek-h743,usb --target $(TARGET)

rustdoc:
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked --no-deps

# The tests run the images without USB. All images have the same name, so the Matek's is copied, and the Nucleo's is built last.
MATEK := $(FIRMWARE) --features matek-h743
IMAGES := $(or $(CARGO_TARGET_DIR),target)/$(TARGET)/image
images:
	$(MATEK),usb
	$(MATEK)
	cp $(IMAGES)/mimu-firmware $(IMAGES)/mimu-firmware-matek-h743
	$(CARGO) build --locked -p mimu-firmware --profile image --features usb --target $(TARGET)
	$(FIRMWARE)
	$(COUNTED)

no-panic:
	./tests/no_panic/check.sh $(CARGO)

# With the libraries, so that the extension module for Python is built with the features that the tests need: no crate is compiled twice.
build-tests:
	$(CARGO) build --locked $(ON_PC) --lib --tests
	@touch $(BUILT)

# Side by side: much of each is waiting.
tests:
	$(MAKE) --no-print-directory -j3 run-tests interop python

run-tests:
	python3 tests/run.py $(CARGO) test --locked $(ON_PC)

interop: build-tests
	./tests/interop/run.sh target/debug/mimu

DIST_TARGET ?= x86_64-unknown-linux-gnu
dist: toolchain ## an archive for any Linux with glibc 2.28 or later: command, manual, completions, udev rule; or DIST_TARGET=aarch64-unknown-linux-gnu
	@rustup target add --toolchain $(TOOLCHAIN) $(DIST_TARGET)
	./packaging/dist.sh "$(CARGO)" $(DIST_TARGET)

python: toolchain ## the Python package: builds the wheel and runs its tests
	RUSTUP_TOOLCHAIN=$(TOOLCHAIN) ./python/tests/run.sh

wheel: toolchain ## the wheel for distribution, target/wheels, for any Linux with glibc 2.28 or later, with the command; DIST_TARGET as for dist
	@rustup target add --toolchain $(TOOLCHAIN) $(DIST_TARGET)
	RUSTUP_TOOLCHAIN=$(TOOLCHAIN) ./packaging/wheel.sh $(DIST_TARGET)

book: toolchain ## the documentation as a site, target/book, with search; its links are checked
	@test "$$(target/tools/bin/mdbook --version 2>/dev/null)" = "mdbook v$(MDBOOK)" \
	  || $(CARGO) install --locked --root target/tools --no-default-features --features search --version $(MDBOOK) mdbook
	RUSTUP_TOOLCHAIN=$(TOOLCHAIN) "$$(RUSTUP_TOOLCHAIN=$(TOOLCHAIN) ./python/environment.sh)/bin/python" docs/book.py target/tools/bin/mdbook target/book

# As the repository's pages have it: the book, the page below page/, and the figures of benchmarks.yml if HISTORY is their file.
site: book web ## the documentation with the page in it, target/site, as .github/workflows/pages.yml publishes it
	rm -rf target/site
	cp -r target/book target/site
	cp -r target/web target/site/page
	@if [ -s "$(HISTORY)" ]; then mkdir target/site/benchmarks && python3 packaging/benchmarks.py page "$(HISTORY)" target/site/benchmarks/index.html; fi

lint: ## workflows, forms, citation, recipe, paper: what no test runs
	./packaging/lint.sh

# The lowest Rust version that builds the crates for PCs, determined by nalgebra. The emulator needs the newest, but only tests need the emulator.
msrv: ## the command compiles with the lowest Rust version stated in Cargo.toml
	rustup toolchain install $(LOWEST) --profile minimal
	cargo +$(LOWEST) check --locked -p mimu-cli

package: toolchain ## every published crate as an archive, and a build from it
	$(CARGO) package --locked $(PUBLISHED:%=-p %)

web: toolchain ## the page that calibrates in the browser: static files in target/web, to put on any server
	./web/build.sh $(CARGO)

# Compiling the page takes four minutes of processor time, so `make test` compiles its program for the PC only.
web-tests: web ## the page in Chromium, if there is one, against the command
	$(CARGO) build --locked -q -p mimu-cli -p mimu-rig --bin mimu --bin mimu-rig
	MIMU_PAGE=$(CURDIR)/target/web ./tests/interop/run.sh target/debug/mimu -k test_web -s

nightly: toolchain blind clumsy fuzz web-tests ## what takes hours: more seeds, ten minutes of samples, 300 supply cuts, coverage, blind, clumsy, fuzz; prints its figures
	$(FIRMWARE)
	$(CARGO) test --locked --release $(ON_PC) -- --ignored --nocapture --test-threads=2
	RUSTUP_TOOLCHAIN=$(TOOLCHAIN) ./python/tests/run.sh -m nightly

# Directory of the demo's recordings and page.
DEMO ?= target/demo-$(if $(filter nucleo,$(BOARD)),,$(BOARD)-)$(SEED)
SEED ?= 1
BOARD ?= nucleo
demo: toolchain ## calibrate and verify a board on the virtual bench; SEED=n is another unit with another effect, BOARD=matek one with a digital sensor
	@echo "The firmware, the emulated board and the command are compiled first: some minutes the first time (five on two idle cores)."
	@if [ $(BOARD) = matek ]; then $(MATEK) && cp $(IMAGES)/mimu-firmware $(IMAGES)/mimu-firmware-matek-h743; fi
	@$(FIRMWARE)
	@if [ -e $(BUILT) ] && [ -z "$$(find core host rig tests -name '*.rs' -newer $(BUILT) -print -quit)" ]; \
	then $(CARGO) build --locked $(ON_PC) --lib --tests; \
	else $(CARGO) build --locked -p mimu-cli -p mimu-board-tests --bin mimu --bin demo; fi
	@rm -rf $(DEMO)
	@target/debug/demo $(SEED) $(DEMO) $(BOARD)

data: ## bring the public recordings, 27 MB, into $MIMU_DATA or ../shared/data, so that the tests on real units run
	./tests/data.sh

example: toolchain ## import and fit a recording: the best real one available, or the small one in tests/
	$(CARGO) build --locked --release --bin mimu
	./tests/example.sh target/release/mimu

station: toolchain ## a session of a station with simulated boards, as docs/station.md shows it
	$(CARGO) build --locked --release --bin mimu --bin mimu-rig
	./tests/station/session.sh target/release/mimu target/release/mimu-rig

papers: toolchain ## compute every table and plot in docs/papers, and every table of the studies in docs/thermal (hours)
	$(CARGO) run --locked --release -p mimu-tests --bin papers
	$(CARGO) run --locked --release -p mimu-tests --features studies --bin thermal -- write

blind: toolchain ## undeclared effects on hundreds of units and in real recordings, and their diagnoses
	$(CARGO) run --locked --release -p mimu-tests --bin blind
	$(CARGO) run --locked --release -p mimu-tests --bin blind planted
	$(CARGO) run --locked --release -p mimu-tests --bin blind judged 100
	$(CARGO) run --locked --release -p mimu-tests --bin blind judged array

clumsy: toolchain ## 200 sessions of the wizard with people and boards that err, in virtual time
	$(CARGO) run --locked --release -p mimu-tests --features studies --bin clumsy 200

bench: toolchain ## rates and peak memory on four hours at 1 kHz, and of a diagnosis
	$(CARGO) bench --locked -p mimu-cli --bench four_hours
	$(CARGO) bench --locked -p mimu-tests --bench diagnosis
	$(CARGO) bench --locked -p mimu-rig --bench step

count: ## lines of each crate, public items, long functions, files that an addition touches
	@python3 tests/count.py

budget: toolchain ## instructions, load and memory of the firmware, counted on both emulated boards
	$(MATEK)
	cp $(IMAGES)/mimu-firmware $(IMAGES)/mimu-firmware-matek-h743
	$(FIRMWARE)
	$(COUNTED)
	$(CARGO) run --locked -p mimu-board-tests --bin budget

device: toolchain ## the nightly tests of the device
	$(FIRMWARE)
	$(CARGO) test --locked --release -p mimu-board-tests -- --ignored --nocapture

fuzz: toolchain ## mutated recordings, manifests and calibrations for ten minutes, or MIMU_FUZZ_SECONDS
	MIMU_FUZZ_SECONDS=$${MIMU_FUZZ_SECONDS:-600} $(CARGO) test --locked --release -p mimu-cli --test all fuzz -- --nocapture

audit: toolchain ## licences, advisories as far as the registry has them, duplicate dependencies
	@command -v cargo-deny >/dev/null || $(CARGO) install --locked cargo-deny
	cargo-deny --all-features check licenses bans sources
