#!/usr/bin/env python3
"""A session of H. Carlsson's array of eight MPU-9150 as a log in counts, `gyro_x` to `accel8_z`:  python3 tests/array.py SESSION [CHIP] > log.csv

SESSION is 1 to 9. Of the chips 1 to 8, CHIP (1) comes first, as `gyro_x` to `accel_z`, and the others follow in order. The data are in $MIMU_DATA or ../shared/data.
"""

import os
import struct
import sys
from pathlib import Path

session, chip = int(sys.argv[1]), int((sys.argv[2:] or [1])[0])
order = [chip, *(k for k in range(1, 9) if k != chip)]
folder = Path(os.environ.get("MIMU_DATA") or Path(__file__).resolve().parents[2] / "shared/data")
data = (folder / f"carlsson_mpu9150x8/exp_{session}/data.bin").read_bytes()
# Head, clock of 64 MHz, accelerometer and gyro of each chip, sum.
packet = struct.Struct(">4xI48hH")

print("t_s", *(f"{kind}{n if n > 1 else ''}_{axis}" for n in range(1, 9) for kind in ("accel", "gyro") for axis in "xyz"), sep=",")
at = before = wraps = 0
while at + packet.size <= len(data):
    clock, *words, total = packet.unpack_from(data, at)
    if data[at] != 0xAA or sum(data[at : at + packet.size - 2]) & 0xFFFF != total:
        at += 1
        continue
    at += packet.size
    wraps += clock < before
    before = clock
    print(f"{((wraps << 32) + clock) / 64e6:.6f}", *(word for k in order for word in words[6 * k - 6 : 6 * k]), sep=",")
