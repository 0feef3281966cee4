#!/usr/bin/env bash
# Compiles mimu-core for the target and fails if any path of it leads to a panic.
# Usage: check.sh CARGO...
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
# With one unit and no debug information the assembly is code and nothing else.
"$@" rustc --locked --quiet -p mimu-no-panic --lib --release --target thumbv7em-none-eabihf \
    -- --emit "asm=$out/core.s" -C codegen-units=1 -C debuginfo=0
functions=$(grep -cE '^_R[A-Za-z0-9_]*mimu_no_panic[0-9]+[a-z_]+:' "$out/core.s" || true)
if [ "$functions" -lt 7 ]; then
    echo "no-panic check: only $functions functions in the assembly: the check looks at nothing" >&2
    exit 1
fi
# What is called from outside core::panicking (of which, and of core::fmt, the compiler leaves uncalled copies). Panics hide behind
# many names (unwrap_failed, slice_index_fail, panic_bounds_check), so it is the harmless ones that are listed.
calls=$(awk '/^[A-Za-z_].*:$/ { f = $1 }
             $1 ~ /^(bl|b|b\.w|blx)$/ && $2 ~ /^[A-Za-z_]/ && f !~ /4core(9panicking|3fmt)/ { print $2 }' "$out/core.s" | sort -u)
bad=$(grep -vE 'mimu_no_panic$|^_R[A-Za-z0-9_]*(9mimu_core|8nalgebra|4libm)|^__aeabi_|^mem(cpy|set|move)$' <<<"$calls" || true)
if [ -n "$bad" ]; then
    printf 'no-panic check: mimu-core calls what may panic:\n%s\n' "$bad" >&2
    exit 1
fi
echo "no-panic check: $functions functions of mimu-core, no path to a panic"
