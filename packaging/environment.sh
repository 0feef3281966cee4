#!/usr/bin/env bash
# A virtual environment of Python with the packages of a requirements.txt: made at the first call, and again where the file has changed.
# Usage: environment.sh REQUIREMENTS FOLDER
set -euo pipefail
if ! cmp -s "$1" "$2/requirements.txt"; then
    rm -rf "$2"
    python3 -m venv "$2"
    "$2/bin/pip" install --quiet --disable-pip-version-check -r "$1"
    cp "$1" "$2/requirements.txt"
fi
