#!/usr/bin/env bash
# Builds the package with the profile of the tests, to reuse the crates that these have compiled. Installs it with its test requirements into the
# environment target/python, and prints this folder.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
venv=${CARGO_TARGET_DIR:-$here/../target}/python
"$here/../packaging/environment.sh" "$here/tests/requirements.txt" "$venv" >&2
"$venv/bin/maturin" build --quiet --locked --profile dev --interpreter "$venv/bin/python" --manifest-path "$here/Cargo.toml" --out "$venv/wheels" >&2
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall "$venv"/wheels/mimu-*.whl >&2
echo "$venv"
