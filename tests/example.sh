#!/usr/bin/env bash
# Imports a recording by hand and calibrates it: the best real recording that is available, or the small simulated one beside this script. Usage:
# example.sh PATH-OF-MIMU
set -euo pipefail
mimu=$(realpath "$1")
here=$(cd "$(dirname "$0")" && pwd)
data=${MIMU_DATA:-$here/../../shared/data}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
if [ -f "$data/imu_tk_xsens/xsens_acc.mat" ]; then
    accel=$(realpath "$data/imu_tk_xsens/xsens_acc.mat")
    gyro=$(realpath "$data/imu_tk_xsens/xsens_gyro.mat")
    gravity=9.81744
else
    echo "no real recordings at hand (docs/recordings.md says where to get them): using the simulated one"
    accel=$here/example/accel.txt
    gyro=$here/example/gyro.txt
    gravity=9.80665
fi
cd "$out"
show() { printf '\n$ mimu %s\n' "${*##*/}"; "$mimu" "$@"; }
show import "$accel" "$gyro" \
    --columns t_s,accel_x,accel_y,accel_z --columns t_s,gyro_x,gyro_y,gyro_z \
    --gravity "$gravity" --raw-unit count --reference gravity --device by-hand -o by-hand
show fit by-hand -o cal.toml
printf '\n$ head -25 cal.toml\n'
head -25 cal.toml
