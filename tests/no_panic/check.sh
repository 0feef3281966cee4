#!/usr/bin/env bash
# Compiles mimu-core for the target, fails if any path of it leads to a panic, and counts the instructions of the effects
# that run with every sample.
# Usage: check.sh CARGO...
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
# With one unit and no debug information the assembly is code and nothing else.
"$@" rustc --locked --quiet -p mimu-no-panic --lib --release --target thumbv7em-none-eabihf \
    -- --emit "asm=$out/core.s" -C codegen-units=1 -C debuginfo=0
functions=$(grep -cE '^_R[A-Za-z0-9_]*mimu_no_panic[0-9]+[a-z_]+:' "$out/core.s" || true)
if [ "$functions" -lt 13 ]; then
    echo "no-panic check: only $functions functions in the assembly: the check looks at nothing" >&2
    exit 1
fi
# What is called from outside core::panicking (of which, and of core::fmt, the compiler leaves uncalled copies). Panics hide behind
# many names (unwrap_failed, slice_index_fail, panic_bounds_check), so it is the harmless ones that are listed. A register holds a
# function of the table of effects, and they are all in the assembly.
calls=$(awk '/^[A-Za-z_].*:$/ { f = $1 }
             $1 ~ /^(bl|b|b\.w|blx)$/ && $2 ~ /^[A-Za-z_]/ && f !~ /4core(9panicking|3fmt)/ { print $2 }' "$out/core.s" | sort -u)
bad=$(grep -vE 'mimu_no_panic$|^_R[A-Za-z0-9_]*(9mimu_core|8nalgebra|4libm)|^__aeabi_|^mem(cpy|set|move|cmp)$|^r[0-9]+$' <<<"$calls" || true)
if [ -n "$bad" ]; then
    printf 'no-panic check: mimu-core calls what may panic:\n%s\n' "$bad" >&2
    exit 1
fi
echo "no-panic check: $functions functions of mimu-core, no path to a panic"
# Instructions from entry to return, which is what runs: nothing in there may jump backwards or call.
awk '/^_R[A-Za-z0-9_]*9mimu_core7effects3law[0-9]+[a-z_]+/ {
         name = $1; sub(/.*9mimu_core7effects3law[0-9]+/, "", name); sub(/f?E?Cs.*/, "", name); count = 0; delete seen; next
     }
     /^\.L?func_end|^\.Lfunc_end/ { if (name != "") print count, name; name = "" }
     name != "" && /^\.L[A-Za-z0-9_]*:/ { seen[substr($1, 1, length($1) - 1)] = 1 }
     name != "" && $1 ~ /^b/ && ($1 ~ /^blx?$/ || $2 in seen) { print 9999, name " jumps backwards or calls" }
     name != "" && $1 ~ /^[a-z]/ { count++ }' "$out/core.s" | sort -n >"$out/counts"
awk '{ printf "effects check: %3d instructions: %s\n", $1, $2 }
     $1 > 60 { print "effects check: " substr($0, index($0, " ") + 1) ": more than 60 instructions"; bad = 1 }
     END { if (NR < 7) { print "effects check: only " NR " effects in the assembly: the check looks at nothing"; bad = 1 } exit bad }' \
    "$out/counts" >&2
