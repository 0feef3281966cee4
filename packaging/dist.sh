#!/usr/bin/env bash
# Packs the command `mimu` as an archive for Linux with glibc 2.28 or later (Debian 10, Ubuntu 18.10, RHEL 8), with manual, shell completions, udev
# rule and licences. Usage: dist.sh CARGO [TARGET]; TARGET is x86_64-unknown-linux-gnu or aarch64-unknown-linux-gnu.
#
# zig links the binary, because it has the symbols of every glibc: a binary linked on Debian 12 does not start on Debian 11. musl is not used: its
# allocator has one lock for all threads.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo=$1
target=${2:-x86_64-unknown-linux-gnu}
glibc=2.28
out=${CARGO_TARGET_DIR:-target}
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
name=mimu-$version-$target

tools=$out/dist-tools
packaging/environment.sh packaging/requirements.txt "$tools"
PATH=$(realpath "$tools")/bin:$PATH $cargo zigbuild --locked --profile dist --target "$target.$glibc" -p mimu-cli --bin mimu

folder=$out/$name
rm -rf "$folder"
mkdir -p "$folder/completions"
cp "$out/$target/dist/mimu" README.md CHANGELOG.md LICENSE-APACHE LICENSE-MIT packaging/70-mimu.rules "$folder"
# Manual and completions are the same for every target. A binary for another machine cannot run here, so the host's binary writes them.
host=$folder/mimu
if ! "$host" --version >/dev/null 2>&1; then
    $cargo build --locked --profile dist -p mimu-cli --bin mimu
    host=$out/dist/mimu
fi
"$host" man -o "$folder/man/man1"
for shell in bash zsh fish; do "$host" completions $shell >"$folder/completions/mimu.$shell"; done
tar -C "$out" --owner=0 --group=0 --sort=name -czf "$out/$name.tar.gz" "$name"

newest=$(objdump -T "$folder/mimu" | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -1)
echo "$out/$name.tar.gz: $(stat -c %s "$out/$name.tar.gz") bytes; mimu: $(stat -c %s "$folder/mimu") bytes, needs $newest"
# objdump cannot read a binary for another machine; the version is then not checked.
if [ -n "$newest" ] && [ "$(printf '%s\nGLIBC_%s\n' "$newest" "$glibc" | sort -V | tail -1)" != "GLIBC_$glibc" ]; then
    echo "the binary needs $newest, newer than $glibc" >&2
    exit 1
fi
