#!/usr/bin/env bash
# The night with a real board: what only hours, a switched supply and a bad line can show. Run hitl/run.sh first. The unit lies still.
#
# NOT RUN YET on a board. All but the option bytes holds on the emulated board:
#   mimu-board serve --control 127.0.0.1:7007 &
#   MIMU_PORT=/dev/pts/N MIMU_POWER='hitl/bench.sh POWER' MIMU_NOISE='hitl/bench.sh GARBLE' MIMU_CUTS=20 MIMU_SECONDS=60 hitl/night.sh a.toml b.toml
#
#   hitl/night.sh A.toml B.toml        two different calibrations of this unit, in the raw unit of its board
#   MIMU_POWER='relay.py'              command that switches the supply with the argument on or off, by a relay; the debugger must not feed the board
#   MIMU_NOISE='noise.py'              command that disturbs the line with the argument on or off: a motor cable beside it; left out without it
#   MIMU_PORT=/dev/ttyACM0, MIMU_CUTS=300, MIMU_SECONDS=28800
set -euo pipefail
cd "$(dirname "$0")/.."

a=${1:?usage: hitl/night.sh A.toml B.toml}
b=${2:?usage: hitl/night.sh A.toml B.toml}
: "${MIMU_POWER:?MIMU_POWER is the command that switches the supply, with on or off}"
: "${MIMU_PORT:?MIMU_PORT is the port of the board}"
cuts=${MIMU_CUTS:-300}
seconds=${MIMU_SECONDS:-28800}
mimu=${MIMU:-${CARGO_TARGET_DIR:-target}/release/mimu}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

step() { printf '\n== %s\n' "$*"; }
fail() { printf 'hitl: %s\n' "$*" >&2; exit 1; }
power() { $MIMU_POWER "$1" >/dev/null; }

# `value FILE EXPRESSION`: the expression of the result `r`.
value() { python3 -c 'import json, sys; r = json.load(open(sys.argv[1])); print(eval(sys.argv[2]))' "$1" "$2"; }
holds() { [ "$(value "$1" "$2")" = True ] || fail "$2 does not hold of $1: $(head -c 600 "$1")"; }

# Asks the device, and keeps the answer as $work/NAME.json. After a power cycle the port may take some seconds.
ask() {
  local name=$1 try
  shift
  for try in 1 2 3 4 5 6; do
    "$mimu" "$@" --port "$MIMU_PORT" --json "$work/$name.json" >"$work/said" 2>&1 && return
    [ "$try" = 6 ] || sleep 2
  done
  cat "$work/said" >&2
  fail "mimu $*"
}

cycle() { power off; sleep 2; power on; sleep 1; }

step "option bytes: a failing supply resets the microcontroller at 2.6 V, and the banks are not swapped"
ask info device info
holds "$work/info.json" "r['brown_out_level'] == 3 and not r['banks_swapped']"
# If it does not hold:  STM32_Programmer_CLI -c port=SWD -ob BOR_LEV=3 SWAP_BANK=0

step "the supply is really off: the device starts from power-on, and knows that it has just been"
cycle
ask cycled device info
holds "$work/cycled.json" "r['start']['reason'] == 'power-on' and r['starts'] == 1 and r['powered_for_ms'] < 2000"

step "the converter's own factors come back with the calibration after a power cycle"
ask one device upload "$a"
cycle
ask factors record -o "$work/factors" --for 10s --gravity 9.81
holds "$work/factors.json" "r['own_factors'] == 0 and r['younger_unusable'] == 0"

step "$cuts cuts of the supply during an upload and its storing: one calibration is always there, whole"
begun=$(date +%s%N)
ask two device upload "$b"
took_ms=$((($(date +%s%N) - begun) / 1000000))
hash_a=$(value "$work/one.json" "r['hash']")
hash_b=$(value "$work/two.json" "r['hash']")
[ "$hash_a" != "$hash_b" ] || fail "$a and $b are the same calibration"
held=$hash_b kept=0 replaced=0
for ((k = 1; k <= cuts; k++)); do
  next=$a wanted=$hash_a
  [ "$held" != "$hash_a" ] || { next=$b wanted=$hash_b; }
  "$mimu" device upload "$next" --port "$MIMU_PORT" >/dev/null 2>&1 &
  upload=$!
  # Up to a fifth longer than an upload takes, so that some cuts come after it.
  sleep "$(python3 -c 'import random, sys; print(random.uniform(0, 1.2e-3 * float(sys.argv[1])))' "$took_ms")"
  power off
  # It would go on asking a dead line.
  kill "$upload" 2>/dev/null || true
  wait "$upload" 2>/dev/null || true
  sleep 1
  power on
  ask after device info
  found=$(value "$work/after.json" "(r['stored'] or {}).get('hash')")
  case $found in
    "$held") kept=$((kept + 1)) ;;
    "$wanted") replaced=$((replaced + 1)) ;;
    *) fail "after cut $k the device holds $found, and not $held or $wanted" ;;
  esac
  held=$found
done
printf '%s kept the older calibration, %s had the newer one\n' "$kept" "$replaced"
[ "$kept" -gt 0 ] && [ "$replaced" -gt 0 ] || [ "$cuts" -lt 20 ] || fail "all cuts came at the same side: change their times"

if [ -n "${MIMU_NOISE:-}" ]; then
  step "a disturbed line: every sample arrives or is counted as missing"
  $MIMU_NOISE on >/dev/null
  ask noisy record -o "$work/noisy" --for 60s --gravity 9.81 || true
  $MIMU_NOISE off >/dev/null
  rate=$(value "$work/info.json" "r['sample_rate_hz']")
  holds "$work/noisy.json" "abs(r['samples'] + r['missing'] - 60 * $rate) < 100"
  printf '%s samples missing in %s gaps\n' "$(value "$work/noisy.json" "r['missing']")" "$(value "$work/noisy.json" "r['gaps']")"
fi

step "$seconds s without a gap"
ask night record -o "$work/night" --for "${seconds}s" --gravity 9.81
holds "$work/night.json" "r['missing'] == 0 and r['gaps'] == 0 and not r['restarts'] and not r['broken_off']"

printf '\nhitl: the night holds\n'
