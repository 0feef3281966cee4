# Everything that a fresh machine with rustup, gcc and make needs to test, try and measure mimu.

TOOLCHAIN := $(shell sed -n 's/^channel = "\(.*\)"/\1/p' rust-toolchain.toml)
TARGET := thumbv7em-none-eabihf
CARGO := cargo +$(TOOLCHAIN)

.PHONY: help test demo papers blind bench budget device fuzz audit toolchain

help: ## this list
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' Makefile

# Automatic installation may be switched off, so it is asked for. The list makes a second run offline and quick.
toolchain:
	@rustup toolchain list | grep -q '^$(TOOLCHAIN)' \
	  && rustup target list --toolchain $(TOOLCHAIN) --installed | grep -q $(TARGET) \
	  && rustup component list --toolchain $(TOOLCHAIN) --installed | grep -q clippy \
	  && rustup component list --toolchain $(TOOLCHAIN) --installed | grep -q rustfmt \
	  || rustup toolchain install $(TOOLCHAIN) --profile minimal -c rustfmt -c clippy -t $(TARGET)

test: toolchain ## formatting, lints, documentation, firmware, all tests
	$(CARGO) fmt --all --check
	$(CARGO) clippy --locked --all-targets -- -D warnings
	$(CARGO) clippy --locked -p mimu-no-panic --release --target $(TARGET) -- -D warnings
	$(CARGO) clippy --locked -p mimu-firmware -p mimu-counted --release --target $(TARGET) -- -D warnings
	$(CARGO) clippy --locked -p mimu-firmware --release --features usb --target $(TARGET) -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked --no-deps
# Before the image without it, which has the same name and is what the tests run.
	$(CARGO) build --locked -p mimu-firmware --release --features usb --target $(TARGET)
	$(CARGO) build --locked -p mimu-firmware --release --target $(TARGET)
	$(CARGO) build --locked -p mimu-counted --release --target $(TARGET)
	./tests/no_panic/check.sh $(CARGO)
	$(CARGO) test --locked
	$(CARGO) test --locked -p mimu-firmware --lib
	$(CARGO) run --locked -p mimu-tests --bin papers -- --check
	$(CARGO) run --locked -p mimu-tests --bin budget -- --check

demo: toolchain ## import and fit a recording: the best real one at hand, or the small one in tests/
	$(CARGO) build --locked --release -p mimu
	./tests/demo.sh target/release/mimu

papers: toolchain ## compute every figure and plot of docs/papers.md
	$(CARGO) run --locked --release -p mimu-tests --bin papers

blind: toolchain ## undeclared effects on hundreds of units, and what the diagnosis says of them
	$(CARGO) run --locked --release -p mimu-tests --bin blind

bench: toolchain ## rates and peak memory on four hours at 1 kHz, and of a diagnosis
	$(CARGO) bench --locked -p mimu --bench four_hours
	$(CARGO) bench --locked -p mimu-tests --bench diagnosis

budget: toolchain ## instructions, load and memory of the firmware, counted on the emulated board
	$(CARGO) build --locked -p mimu-firmware --release --target $(TARGET)
	$(CARGO) build --locked -p mimu-counted --release --target $(TARGET)
	$(CARGO) run --locked -p mimu-tests --bin budget

device: toolchain ## ten minutes of the device's samples, and 300 power cuts while a calibration is stored, drawn into docs/device
	$(CARGO) build --locked -p mimu-firmware --release --target $(TARGET)
	MIMU_DEVICE_SECONDS=600 MIMU_CUTS=300 $(CARGO) test --locked --release -p mimu-tests \
	  --test device_serial --test device_power -- --nocapture

fuzz: toolchain ## mutated recordings, manifests and calibrations for ten minutes, or MIMU_FUZZ_SECONDS
	MIMU_FUZZ_SECONDS=$${MIMU_FUZZ_SECONDS:-600} $(CARGO) test --locked --release -p mimu --test fuzz -- --nocapture

audit: toolchain ## licences, advisories as far as the registry has them, duplicate dependencies
	@command -v cargo-deny >/dev/null || $(CARGO) install --locked cargo-deny
	cargo-deny --all-features check licenses bans sources
