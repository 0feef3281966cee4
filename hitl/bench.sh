#!/usr/bin/env bash
# A relay and a noisy cable for hitl/night.sh, at the emulated board: bench.sh POWER|GARBLE on|off. MIMU_CONTROL is its address (127.0.0.1:7007).
set -euo pipefail
case "$1 $2" in
  POWER\ *) say="POWER ${2^^}" ;;
  GARBLE\ on) say="GARBLE 100" ;;
  GARBLE\ off) say="GARBLE 0" ;;
esac
address=${MIMU_CONTROL:-127.0.0.1:7007}
exec 3<>"/dev/tcp/${address%:*}/${address#*:}"
printf '%s\n' "$say" >&3
read -r answer <&3
[ "$answer" = OK ]
