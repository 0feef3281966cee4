#!/usr/bin/env bash
# Builds the page: static files in target/web. Usage: build.sh CARGO [its arguments]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
target=${CARGO_TARGET_DIR:-$here/../target}
mkdir -p "$target"
target=$(cd "$target" && pwd)
out=$target/web

venv=$target/web-cc
"$here/../packaging/environment.sh" "$here/requirements.txt" "$venv"
export MIMU_WEB_PYTHON=$venv/bin/python ZIG_GLOBAL_CACHE_DIR=$venv/cache ZIG_LOCAL_CACHE_DIR=$venv/cache
export CC_wasm32_wasip1=$here/cc.sh AR_wasm32_wasip1=$here/ar.sh
"$@" build --locked -p mimu-web --profile page --target wasm32-wasip1

rm -rf "$out"
mkdir -p "$out/example"
cp "$here"/page/* "$out"
cp "$here/../tests/example"/{accel,gyro}.txt "$out/example"
cp "$here/../host/cli/src/report/page/style.css" "$out/report.css"
cp "$target/wasm32-wasip1/page/mimu-web.wasm" "$out/mimu.wasm"
cd "$out"
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/../Cargo.toml" | head -1)
sed -i "s/MIMU_VERSION/$version/" index.html
# The browser's cache is named by the hash of all files: if any byte changes, all files are loaded again.
files=$(find . -type f ! -name sw.js | sed 's|^\./||' | LC_ALL=C sort)
hash=$(echo "$files" | xargs sha256sum | sha256sum | cut -c1-16)
list=$(echo "$files" | sed 's/.*/"&",/' | tr -d '\n')
sed -i "s|\"HASH\"|\"$hash\"|; s|\"FILES\"|$list|" sw.js
printf '%-24s %9s %9s\n' file bytes gzip
for file in $files sw.js; do
    printf '%-24s %9d %9d\n' "$file" "$(stat -c %s "$file")" "$(gzip -9c "$file" | wc -c)"
done
printf '%-24s %9d %9d\n' all "$(cat $files sw.js | wc -c)" "$(for file in $files sw.js; do gzip -9c "$file"; done | wc -c)"
