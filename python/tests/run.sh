#!/usr/bin/env bash
# Builds and tests the package. The nightly tests are run by `-m nightly`. Usage: run.sh [pytest's arguments]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
venv=$("$here/../environment.sh")
case " $* " in
*" nightly "*) "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$here/engines.txt" >&2 ;;
esac
exec "$venv/bin/python" -m pytest -q -p no:cacheprovider -m "not nightly" "$here" "$@"
