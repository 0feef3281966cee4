#!/usr/bin/env bash
# Builds and tests the command and the wheel on the system that they are for, macOS or Windows. Linux has dist.sh and wheel.sh, whose files run on
# older systems than the one that builds them. Usage: native.sh TARGET, as in aarch64-apple-darwin
set -euo pipefail
cd "$(dirname "$0")/.."
target=$1
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
name=mimu-$version-$target
case $target in *windows*) exe=.exe bin=Scripts ;; *) exe='' bin=bin ;; esac

# Tests of boards and of the wizard need pseudo-terminals and the emulator; those of the libraries need neither.
cargo test --locked -p mimu-core -p mimu-recording -p mimu-allan -p mimu -p mimu-thermal -p mimu-export --lib
cargo build --locked --profile dist --target "$target" -p mimu-cli --bin mimu
command=target/$target/dist/mimu$exe
./tests/example.sh "$command"

rm -rf "target/$name"
mkdir -p "target/$name/completions"
cp "$command" README.md CHANGELOG.md LICENSE-APACHE LICENSE-MIT "target/$name"
"$command" man -o "target/$name/man/man1"
for shell in bash zsh fish powershell; do "$command" completions $shell >"target/$name/completions/mimu.$shell"; done
tar -C target -czf "target/$name.tar.gz" "$name"

python -m venv target/dist-tools
"target/dist-tools/$bin/python" -m pip install --quiet --disable-pip-version-check "$(grep '^maturin' packaging/requirements.txt)" numpy pytest
rm -rf target/wheels
"target/dist-tools/$bin/maturin" build --locked --target "$target" --manifest-path python/Cargo.toml --out target/wheels
"target/dist-tools/$bin/python" -m pip install --quiet --no-deps target/wheels/*.whl
"target/dist-tools/$bin/python" -c "import mimu, numpy; mimu.Recording(None, numpy.eye(3), unit='count', rate_hz=50.0, gravity=9.81)"
