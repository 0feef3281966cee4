#!/usr/bin/env bash
# Tests of the exports with the programs that they are for. Makes a virtual environment of Python in target/ at the first run, and again where
# requirements.txt has changed. Usage: run.sh PATH-OF-MIMU [pytest's arguments]
set -euo pipefail
export MIMU=$(realpath "$1")
shift
here=$(cd "$(dirname "$0")" && pwd)
venv=${CARGO_TARGET_DIR:-$here/../../target}/interop
if ! cmp -s "$here/requirements.txt" "$venv/requirements.txt"; then
    rm -rf "$venv"
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$here/requirements.txt"
    cp "$here/requirements.txt" "$venv/requirements.txt"
fi
exec "$venv/bin/python" -m pytest -q -p no:cacheprovider "$here" "$@"
