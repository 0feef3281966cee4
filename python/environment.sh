#!/usr/bin/env bash
# Installs the package with its test requirements into the environment target/python, and prints this folder. The package is a wheel, built with
# the profile of the tests, or consists of the compiled extension module MIMU_LIBRARY and the files beside this one.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
venv=$(realpath -m "${CARGO_TARGET_DIR:-$here/../target}")/python
"$here/../packaging/environment.sh" "$here/tests/requirements.txt" "$venv" >&2
if [ -n "${MIMU_LIBRARY:-}" ]; then
    site=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("platlib"))')
    version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/../Cargo.toml")
    rm -rf "$site"/mimu "$site"/mimu-*.dist-info
    cp -r "$here/mimu" "$site/mimu"
    cp "$MIMU_LIBRARY" "$site/mimu/_mimu.abi3.so"
    mkdir "$site/mimu-$version.dist-info"
    printf 'Metadata-Version: 2.1\nName: mimu\nVersion: %s\n' "$version" >"$site/mimu-$version.dist-info/METADATA"
    printf '#!%s\nfrom mimu._command import main\nraise SystemExit(main())\n' "$venv/bin/python" >"$venv/bin/mimu"
    chmod +x "$venv/bin/mimu"
    echo "$venv"
    exit
fi
"$venv/bin/maturin" build --quiet --locked --profile dev --interpreter "$venv/bin/python" --manifest-path "$here/Cargo.toml" --out "$venv/wheels" >&2
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall "$venv"/wheels/mimu-*.whl >&2
echo "$venv"
