#!/usr/bin/env bash
# Tests the exports with their target programs. Usage: run.sh PATH-OF-MIMU [pytest's arguments]
set -euo pipefail
MIMU=$(realpath "$1")
export MIMU
shift
here=$(cd "$(dirname "$0")" && pwd)
venv=${CARGO_TARGET_DIR:-$here/../../target}/interop
"$here/../../packaging/environment.sh" "$here/requirements.txt" "$venv"
exec "$venv/bin/python" -m pytest -q -p no:cacheprovider "$here" "$@"
