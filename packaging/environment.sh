#!/usr/bin/env bash
# Makes a virtual environment of Python with the packages of a requirements.txt, unless an up-to-date one exists.
# Usage: environment.sh REQUIREMENTS FOLDER
set -euo pipefail
if ! cmp -s "$1" "$2/requirements.txt"; then
    rm -rf "$2"
    python3 -m venv "$2"
    "$2/bin/pip" install --quiet --disable-pip-version-check -r "$1"
    cp "$1" "$2/requirements.txt"
fi
