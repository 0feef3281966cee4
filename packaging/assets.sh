#!/usr/bin/env bash
# Lays out the files of a release: archives, checksums, installers, and the formula of Homebrew. Usage: assets.sh PACKAGES ADDRESS FOLDER;
# PACKAGES contains the archives at any depth, ADDRESS is that of the repository.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
packages=$1 address=$2 folder=$3
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/../Cargo.toml" | head -1)
mkdir -p "$folder"
find "$packages" -name "mimu-$version-*.tar.gz" -exec cp {} "$folder" \;
for target in {x86_64,aarch64}-unknown-linux-gnu {x86_64,aarch64}-apple-darwin x86_64-pc-windows-msvc; do
    test -f "$folder/mimu-$version-$target.tar.gz" || { echo "the archive for $target is missing" >&2; exit 1; }
done
(cd "$folder" && sha256sum -- *.tar.gz >SHA256SUMS)
filled() { sed -e "s|@VERSION@|$version|g" -e "s|@ADDRESS@|$address|g" "$1"; }
filled "$here/install.sh" >"$folder/install.sh"
filled "$here/install.ps1" >"$folder/install.ps1"
filled "$here/mimu.rb" >"$folder/mimu.rb"
while read -r hash name; do
    target=${name#"mimu-$version-"}
    sed -i "s|@SHA256 ${target%.tar.gz}@|$hash|" "$folder/mimu.rb"
done <"$folder/SHA256SUMS"
