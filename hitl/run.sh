#!/usr/bin/env bash
# Hardware in the loop: the release image on a real board, from flashing to a recording. The unit lies still, z up.
#
# NOT RUN YET on a board: nobody has had one at hand. All but flashing and resetting holds on the emulated board, the wizard on a table included:
#   mimu-board serve &   then   MIMU_NO_PROBE=1 MIMU_PORT=/dev/pts/N hitl/run.sh cal.toml
#
#   hitl/run.sh [CALIBRATION.toml]     a calibration in volts; without one, what needs it is left out, and said
#   MIMU_PORT=/dev/ttyACM0             port of the board; without it the only one at which a device greets
#   MIMU_SECONDS=60                    length of the recording
#   MIMU_NO_PROBE=1                    neither flash nor reset
#   MIMU_WIZARD=hands                  the wizard too, with hands, cube or table; MIMU_DRIVER is the driver file of a turntable
set -euo pipefail
cd "$(dirname "$0")/.."

calibration=${1:-}
seconds=${MIMU_SECONDS:-60}
target=${CARGO_TARGET_DIR:-target}
mimu=${MIMU:-$target/release/mimu}
image=$target/thumbv7em-none-eabihf/image/mimu-firmware
chip=STM32H743ZITx
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

port=()
[ -z "${MIMU_PORT:-}" ] || port=(--port "$MIMU_PORT")

step() { printf '\n== %s\n' "$*"; }

# `json FILE EXPRESSION`: fails unless the expression holds of the result `r`.
json() {
  python3 - "$1" "$2" <<'PY'
import json, sys
r = json.load(open(sys.argv[1]))
if not eval(sys.argv[2]):
    sys.exit(f"hitl: {sys.argv[2]} does not hold of {json.dumps(r)[:600]}")
PY
}

# Asks the device, shows the answer and keeps it as $work/NAME.json.
ask() {
  local name=$1
  shift
  "$mimu" "$@" "${port[@]}" --json "$work/$name.json"
}

if [ -z "${MIMU_NO_PROBE:-}" ]; then
  step "build, flash and start"
  cargo build --locked --release --bin mimu
  cargo build --locked --profile image -p mimu-firmware --target thumbv7em-none-eabihf
  probe-rs download --chip "$chip" --verify "$image"
  probe-rs reset --chip "$chip"
  # The converter calibrates and the greeting is sent within a tenth of a second; the debugger's USB takes longer.
  sleep 2
fi

step "who is there"
ask info device info
json "$work/info.json" "r['board'] == 'NUCLEO-H743ZI2' and r['sample_rate_hz'] == 1000 and not r['warnings']"

step "the sensors heed their self-test pins"
ask self-test device self-test
json "$work/self-test.json" "all(t['verdict'] != 'failed' for t in r['results']) and not r.get('moved')"

step "counters from zero"
ask zero device counters --reset

step "$seconds s of samples, none missing"
ask record record -o "$work/rest" --for "${seconds}s" --gravity 9.81
json "$work/record.json" "r['missing'] == 0 and r['gaps'] == 0 and not r['restarts'] and not r['broken_off']"
json "$work/record.json" "r['samples'] == round($seconds * 1000) and r['saturated'] == 0 and r['without_reference'] == 0 and not any(r['temperature_left_out'])"

step "the Kalman bank on the device and on the PC, on the same samples"
ask kalman device kalman --force-mps2 0,0,9.81 --for 5s </dev/null
json "$work/kalman.json" "r['largest_distance_sigma'] < 0.1 and r['rejected'] == 0"

if [ -n "$calibration" ]; then
  step "a calibration up and down"
  ask upload device upload "$calibration"
  ask download device download -o "$work/held.toml"
  json "$work/download.json" "r['hash'] == json.load(open('$work/upload.json'))['hash']"
  # What is fetched is what is stored: sent again, there is nothing to write.
  ask again device upload "$work/held.toml"
  json "$work/again.json" "r['was_there']"

  step "compensated on the device as on the PC"
  ask check device check --calibration "$calibration" --for 10s
  json "$work/check.json" "r['holds'] and r['gyro']['ulps'] == 0 and r['accel']['ulps'] == 0"

  if [ -z "${MIMU_NO_PROBE:-}" ]; then
    step "after a reset it is still there"
    probe-rs reset --chip "$chip"
    sleep 2
    ask after device info
    json "$work/after.json" "r['stored']['hash'] == json.load(open('$work/upload.json'))['hash']"
  fi
else
  step "left out, without a calibration: upload, download, check"
fi

if [ -n "${MIMU_WIZARD:-}" ]; then
  # With MIMU_DRIVER nobody is asked; without it a person turns the board, and says yes and no.
  step "the wizard"
  driver=()
  [ -z "${MIMU_DRIVER:-}" ] || driver=(--driver "$MIMU_DRIVER" --yes)
  "$mimu" wizard -o "$work/session" --fixture "$MIMU_WIZARD" --gravity 9.81 "${driver[@]}" "${port[@]}" --json "$work/wizard.json"
  json "$work/wizard.json" "all(u['stored'] for u in r['units'])"
fi

step "nothing was lost, garbled or late"
ask counters device counters
json "$work/counters.json" "not [k for k in ('late', 'converter_overruns', 'stalls', 'queue_overruns', 'batches_dropped',
  'frames_garbled', 'receiver_overruns', 'flash_uncorrectable') if r['counters'][k]]"

printf '\nhitl: all of it holds\n'
