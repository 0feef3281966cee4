#!/usr/bin/env bash
# Builds the package with the profile of the tests, so that the crates that these have compiled are used, and tests it. The nightly tests are
# run by `-m nightly`. Usage: run.sh [pytest's arguments]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
venv=${CARGO_TARGET_DIR:-$here/../../target}/python
"$here/../../packaging/environment.sh" "$here/requirements.txt" "$venv"
"$venv/bin/maturin" build --quiet --locked --profile dev --interpreter "$venv/bin/python" --manifest-path "$here/../Cargo.toml" --out "$venv/wheels"
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall "$venv"/wheels/mimu-*.whl
exec "$venv/bin/python" -m pytest -q -p no:cacheprovider -m "not nightly" "$here" "$@"
