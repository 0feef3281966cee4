#!/usr/bin/env bash
# The compiler of C for the target of the page. `cc` names the target as Rust does, which the compiler does not know.
arguments=()
for argument in "$@"; do
    case $argument in --target=*) ;; *) arguments+=("$argument") ;; esac
done
exec "$MIMU_WEB_PYTHON" -m ziglang cc -target wasm32-wasi "${arguments[@]}"
