#!/usr/bin/env bash
# The C compiler for the target of the page. The crate `cc` passes Rust's name of the target, which the compiler does not know.
arguments=()
for argument in "$@"; do
    case $argument in --target=*) ;; *) arguments+=("$argument") ;; esac
done
exec "$MIMU_WEB_PYTHON" -m ziglang cc -target wasm32-wasi "${arguments[@]}"
