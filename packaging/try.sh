#!/usr/bin/env bash
# A newcomer's way from a downloaded file to the first fit, with the seconds of each step. The file is an archive (mimu-*.tar.gz), a wheel
# (mimu-*.whl), or the folder of the page. Nothing of the repository is used but the log in tests/example. Usage: try.sh FILE
set -euo pipefail
file=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
example=$(cd "$(dirname "$0")/../tests/example" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

step() { # NAME COMMAND...
    local name=$1 began=$SECONDS
    shift
    "$@"
    printf '== %s: %d s\n' "$name" $((SECONDS - began))
}
# A log as a board writes it: time, specific force, rate.
{
    echo time,ax,ay,az,gx,gy,gz
    paste -d' ' "$example/accel.txt" "$example/gyro.txt" | awk '!/%/ { print $1 "," $2 "," $3 "," $4 "," $6 "," $7 "," $8 }'
} >log.csv
first_fit() { # COMMAND
    "$1" --version
    "$1" fit log.csv --gravity 9.80665 -o cal.toml
    grep -q '^format = "mimu-calibration' cal.toml
    "$1" export c --calibration cal.toml -o calibration.h
}
from_python() {
    "$1" -c 'import mimu; print(mimu.fit(mimu.read("log.csv", gravity=9.80665)))'
}
page() {
    for name in index.html page.js worker.js mimu.wasm sw.js example/accel.txt; do test -s "$1/$name"; done
    # The magic number of WebAssembly.
    test "$(head -c 4 "$1/mimu.wasm" | od -An -tx1 | tr -d ' \n')" = 0061736d
}

case $file in
*.tar.gz)
    step "unpacked" tar -xzf "$file"
    step "first fit" first_fit "$(echo "$folder"/mimu-*/mimu*)"
    ;;
*.whl)
    python=$(command -v python3 || command -v python)
    step "environment" "$python" -m venv env
    bin=$folder/env/bin
    [ -d "$bin" ] || bin=$folder/env/Scripts
    step "pip install" "$bin/python" -m pip install --quiet --disable-pip-version-check "$file"
    step "first fit of the command" first_fit "$bin/mimu"
    step "first fit from Python" from_python "$bin/python"
    ;;
*)
    step "files of the page" page "$file"
    ;;
esac
printf '== all: %d s\n' "$SECONDS"
