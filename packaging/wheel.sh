#!/usr/bin/env bash
# Builds the wheel for distribution: for Python 3.10 and later on Linux with glibc 2.28 or later (Debian 10, Ubuntu 18.10, RHEL 8), with the command.
# zig links it, for the same reason as in dist.sh. Usage: wheel.sh [TARGET]; RUSTUP_TOOLCHAIN selects the compiler.
set -euo pipefail
cd "$(dirname "$0")/.."
target=${1:-x86_64-unknown-linux-gnu}
out=${CARGO_TARGET_DIR:-target}

tools=$out/dist-tools
packaging/environment.sh packaging/requirements.txt "$tools"
rm -rf "$out/wheels"
# The profile is in python/pyproject.toml. maturin checks that no symbol is newer than the tag allows.
PATH=$(realpath "$tools")/bin:$PATH maturin build --locked --zig --compatibility manylinux_2_28 --target "$target" \
    --manifest-path python/Cargo.toml --out "$out/wheels"
for wheel in "$out"/wheels/*.whl; do echo "$wheel: $(stat -c %s "$wheel") bytes"; done
