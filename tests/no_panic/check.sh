#!/usr/bin/env bash
# Compiles mimu-core for the target, fails if a path can lead to a panic, and counts the instructions of the code that runs at every sample.
# Usage: check.sh CARGO...
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
# Emits the assembly of all crates, because mimu-core's callees must be searched as well. With one codegen unit and no debug information it contains
# only code. A separate target directory keeps these flags from rebuilding the caller's.
RUSTFLAGS="-C target-cpu=cortex-m7 -C codegen-units=1 -C debuginfo=0 --emit=asm" \
    "$@" build --locked --quiet -p mimu-no-panic --release --target thumbv7em-none-eabihf --target-dir "$out"
asm=("$out"/thumbv7em-none-eabihf/release/deps/*.s)
# Starts at the functions of mimu-no-panic and follows every call, branch and address, also through data such as a table of functions. A symbol that
# is reached but not found in the assembly belongs to the precompiled core, and must be in the list of harmless ones: panics have too many names to
# list (unwrap_failed, slice_index_fail, panic_bounds_check).
awk '
    # A local label is part of the function that contains it, unless it labels data.
    function node(name) { return name ~ /^\.L/ ? FILENAME "|" name : name }
    function is_data(name) { return name ~ /^\.L(anon|switch|__unnamed)/ }
    /^[^ \t.#@][^ \t]*:/ || /^\.L(anon|switch|__unnamed)[^ \t]*:/ {
        at = node(substr($1, 1, length($1) - 1)); defined[at] = 1
        if (at ~ /^_R[A-Za-z0-9_]*mimu_no_panic[0-9]+[a-z_]+$/) { reached[at] = 1; todo[++last] = at; functions++ }
        next
    }
    # Functions with equal code are merged into one with several names.
    $2 == "=" { name = node($1); defined[name] = 1; edges[name] = edges[name] " " node($3); next }
    at == "" { next }
    $1 ~ /^\.(section|type|size|globl|hidden|p2align|file|ident|fnstart|fnend|cantunwind|save|pad|setfp|vsave|eabi_attribute|ascii|asciz|string|zero|byte|short|text|syntax|code|thumb_func|cpu|fpu|weak|personality|handlerdata)/ { next }
    {
        text = $0; sub(/@.*/, "", text)
        while (match(text, /[A-Za-z_.$][A-Za-z0-9_.$]*/)) {
            word = substr(text, RSTART, RLENGTH); text = substr(text, RSTART + RLENGTH)
            if (word ~ /^(_R|_ZN|__)/ || word ~ /^mem(cpy|set|move|cmp)$/ || is_data(word) ||
                ($1 ~ /^(bl|b|b\.w|blx)$/ && word != $1 && word !~ /^(\.L|r[0-9]+$|lr$|pc$)/))
                edges[at] = edges[at] " " node(word)
        }
    }
    END {
        for (k = 1; k <= last; k++) {
            n = split(edges[todo[k]], to, " ")
            for (i = 1; i <= n; i++) if (!(to[i] in reached)) {
                reached[to[i]] = 1; from[to[i]] = todo[k]; todo[++last] = to[i]
            }
        }
        for (k = 1; k <= last; k++) {
            name = todo[k]
            if (name in defined || name ~ /^(__aeabi_|mem(cpy|set|move|cmp)$)/) continue
            if (name ~ /^_R[A-Za-z0-9_]*4core3str8converts9from_utf8$/) continue
            print "no-panic check: " from[name] " leads to " name; bad = 1
        }
        if (functions < 27) { print "no-panic check: only " functions + 0 " functions in the assembly: the check looks at nothing"; bad = 1 }
        if (bad) exit 1
        print "no-panic check: " functions " functions of mimu-core, " last " reached, no path to a panic"
    }' "${asm[@]}" >&2
# Counts the instructions from entry to return. These equal the executed ones, because the code must not jump backwards or call.
awk '/^_R[A-Za-z0-9_]*9mimu_core7effects3law[0-9]+[a-z_]+/ {
         name = $1; sub(/.*9mimu_core7effects3law[0-9]+/, "", name); sub(/f?E?(Cs|B[0-9]).*/, "", name); limit = 60; count = 0; delete seen; next
     }
     /^_R[A-Za-z0-9_]*9mimu_core6single10compensate:/ { name = "compensation"; limit = 150; count = 0; delete seen; next }
     /^_R[A-Za-z0-9_]*9mimu_core6kalman[A-Za-z0-9_]*6FilterfE6update/ { name = "kalman_update"; limit = 200; count = 0; delete seen; next }
     /^\.L?func_end|^\.Lfunc_end/ { if (name != "") print count, limit, name; name = "" }
     name != "" && /^\.L[A-Za-z0-9_]*:/ { seen[substr($1, 1, length($1) - 1)] = 1 }
     name != "" && $1 ~ /^b/ && ($1 ~ /^blx?$/ || $2 in seen) { print 9999, limit, name " jumps backwards or calls" }
     name != "" && $1 ~ /^[a-z]/ { count++ }' "$out"/thumbv7em-none-eabihf/release/deps/mimu_{no_panic,core}*.s | sort -u | sort -n >"$out/counts"
awk '{ printf "instructions: %3d of at most %3d: %s\n", $1, $2, $3 }
     $1 > $2 { print "too many instructions: " substr($0, index($0, $3)); bad = 1 }
     END { if (NR < 9) { print "only " NR " functions to count: the check looks at nothing"; bad = 1 } exit bad }' \
    "$out/counts" >&2
