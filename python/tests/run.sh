#!/usr/bin/env bash
# Builds the package with the profile of the tests, so that the crates that these have compiled are used, and tests it. Makes a virtual
# environment of Python in target/ at the first run, and again where requirements.txt has changed. Usage: run.sh [pytest's arguments]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
venv=${CARGO_TARGET_DIR:-$here/../../target}/python
if ! cmp -s "$here/requirements.txt" "$venv/requirements.txt"; then
    rm -rf "$venv"
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$here/requirements.txt"
    cp "$here/requirements.txt" "$venv/requirements.txt"
fi
"$venv/bin/maturin" build --quiet --locked --profile dev --interpreter "$venv/bin/python" --manifest-path "$here/../Cargo.toml" --out "$venv/wheels"
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall "$venv"/wheels/mimu-*.whl
exec "$venv/bin/python" -m pytest -q -p no:cacheprovider "$here" "$@"
