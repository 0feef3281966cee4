#!/bin/sh
# Installs the command `mimu` for Linux or macOS from the archive of a release, whose SHA-256 is checked. The release's workflow writes its
# version and address into this file. Usage: install.sh [FOLDER]; by default into ~/.local/bin. MIMU_FROM is another place of the archives.
set -eu
version=@VERSION@
from=${MIMU_FROM:-@ADDRESS@/releases/download/v$version}
to=${1:-$HOME/.local/bin}

case $(uname -s)-$(uname -m) in
Linux-x86_64) target=x86_64-unknown-linux-gnu ;;
Linux-aarch64) target=aarch64-unknown-linux-gnu ;;
Darwin-arm64) target=aarch64-apple-darwin ;;
Darwin-x86_64) target=x86_64-apple-darwin ;;
*)
    echo "mimu has no archive for $(uname -s) on $(uname -m): build it from source" >&2
    exit 1
    ;;
esac
name=mimu-$version-$target
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
curl -sSfL -o "$name.tar.gz" "$from/$name.tar.gz"
curl -sSfL -o SHA256SUMS "$from/SHA256SUMS"
grep " $name.tar.gz\$" SHA256SUMS >expected || { echo "SHA256SUMS does not list $name.tar.gz" >&2; exit 1; }
if command -v sha256sum >/dev/null; then sha256sum -c expected >/dev/null; else shasum -a 256 -c expected >/dev/null; fi
tar -xzf "$name.tar.gz"
mkdir -p "$to"
cp "$name/mimu" "$to/mimu"
"$to/mimu" --version
case :$PATH: in *:"$to":*) ;; *) echo "$to is not on the PATH: add it" ;; esac
