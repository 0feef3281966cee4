#!/usr/bin/env bash
# A session of a station with simulated boards: four boards at once, three sides of one, and one that comes back for re-calibration. Usage:
# session.sh PATH-OF-MIMU PATH-OF-MIMU-RIG
set -euo pipefail
mimu=$(realpath "$1")
rig=$(realpath "$2")
here=$(cd "$(dirname "$0")" && pwd)
out=$(mktemp -d)
trap 'kill ${boards:-} 2>/dev/null || true; rm -rf "$out"' EXIT
cd "$out"

# unit NAME SEED GYRO-Z-DPS ACCEL-SCALE RECORDING SIDE...
unit() {
    name=$1 seed=$2 offset=$3 scale=$4 recording=$5
    shift 5
    python3 - "$name" "$offset" "$scale" "${DWELL:-20.0}" "$*" >"$recording.plan.toml" 3>"$recording.rig.toml" <<'PY'
import math, os, sys
name, offset, scale, dwell, sides = sys.argv[1:]
gyro, accel = 65.5 * 180 / math.pi, 16384 / 9.80665 * float(scale)
diagonal = lambda s: [[s if i == j else 0.0 for j in range(3)] for i in range(3)]
print(f'format = "mimu-plan/1"\ndevice = "{name}"\nsample_rate_hz = 200.0\nsamples = "csv"\ncarrier = "table"\nsteps = false\nlatitude_deg = 48.1')
for side in sides.split():
    print(f"[[step]]\nup = [{side}]\ndwell_s = {dwell}")
os.write(3, f"""format = "mimu-rig/1"
[unit]
gyro = "MPU6050-gyro"
accel = "MPU6050-accel"
[unit.gyro_affine]
matrix = {diagonal(gyro)}
bias = [21.0, -31.0, {65.5 * float(offset)}]
[unit.accel_affine]
matrix = {diagonal(accel)}
bias = [40.0, 150.0, -60.0]
[curves.gyro]
power_on_sigma_deg_per_h = [60.0, 60.0, 60.0]
[curves.accel]
power_on_sigma_mg = [0.5, 0.5, 0.5]
[thermal]
on_before_s = inf
""".encode())
PY
    "$rig" record "$recording.plan.toml" --rig "$recording.rig.toml" --seed "$seed" -o "$recording" >/dev/null
}
show() {
    printf '\n$ mimu %s\n' "$*"
    status=0
    "$mimu" "$@" 2>&1 || status=$?
    printf '(exit status %s)\n' "$status"
}

unit A-1041 11 0.35 1 A-1041 0,0,1
unit A-1042 12 2.60 1 A-1042 0,0,1
unit A-1043 13 -0.10 1 A-1043.good 0,0,1
# Somebody takes it away too early.
DWELL=7.0 unit A-1044 14 0.20 1 A-1044 0,0,1 1,0,0
unit A-1041 21 0.35 1 x-up 1,0,0
unit A-1041 22 0.35 1 y-up 0,1,0
unit A-1041 23 0.35 1 z-up 0,0,1
# The lowest bit of A-1043's accelerometer y is stuck.
mkdir A-1043
cp A-1043.good/recording.toml A-1043
awk -F, -v OFS=, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "accel_y") y = i; print; next } { if ($y % 2 == 0) $y += 1; print }' \
    A-1043.good/samples.csv >A-1043/samples.csv

cat >limits.toml <<'TOML'
format = "mimu-limits/1"
product = "board, revision B"
part = "mpu6050"
ranges = { accel_g = 2, gyro_dps = 500 }
up = "+z"
rows = [
    { name = "gyro_offset", lower = -2, upper = 2, unit = "deg/s" },
    { name = "gravity_error", lower = -60, upper = 60, unit = "mg" },
    { name = "sample_rate", lower = 198, upper = 202, unit = "Hz" },
    { name = "tilt", upper = 5, unit = "deg" },
]
TOML
printf '$ cat limits.toml\n'
cat limits.toml
python3 "$here/boards.py" 7701=A-1041 7702=A-1042 7703=A-1043 7704=A-1044 >ready &
boards=$!
while ! grep -q ready ready; do sleep 0.1; done

show accept --port tcp://127.0.0.1:7701 --port tcp://127.0.0.1:7702 --port tcp://127.0.0.1:7703 --port tcp://127.0.0.1:7704 \
    --text t_us,ax,ay,az,gx,gy,gz,temp_c --unit A-1041 --unit A-1042 --unit A-1043 --unit A-1044 --for 10s --latitude 48.1 --limits limits.toml -o results
show accept x-up y-up z-up --faces --limits limits.toml
# A unit that comes back after a year: calibrated by hand then and now, and measured at rest now.
root=$here/../..
"$rig" record "$root/rig/plans/hands.toml" --rig "$root/rig/rigs/sessions.toml" --seed 31 -o then >/dev/null
"$rig" record "$root/rig/plans/hands.toml" --rig "$root/rig/rigs/sessions.toml" --seed 32 -o now >/dev/null
sed "s/^dwell_s.*/dwell_s = 20.0/" "$root/rig/plans/rest.toml" >rest.toml
"$rig" record rest.toml --rig now.truth.toml --seed 33 -o at-rest >/dev/null
"$mimu" fit then -o old.toml >/dev/null
"$mimu" fit now -o new.toml >/dev/null
cat >recalibration.toml <<'TOML'
format = "mimu-limits/1"
rows = [
    { name = "gyro_offset", lower = -0.1, upper = 0.1, unit = "deg/s" },
    { name = "gravity_error", lower = -2, upper = 2, unit = "mg" },
]
TOML
printf '\n$ cat recalibration.toml\n'
cat recalibration.toml
show accept at-rest --calibration new.toml --as-found old.toml --limits recalibration.toml
printf '\n$ ls results\n'
ls results | sed 's/-20[0-9T-]*Z/-TIME/'
