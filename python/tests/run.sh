#!/usr/bin/env bash
# Builds and tests the package. The nightly tests are run by `-m nightly`. Usage: run.sh [pytest's arguments]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
venv=$("$here/../environment.sh")
exec "$venv/bin/python" -m pytest -q -p no:cacheprovider -m "not nightly" "$here" "$@"
