"""A unit with known truth on a table in a temperature chamber: the data of the notebook and of a test, made in a second.

It shares no code with mimu. The chamber goes from -20 to 60 degrees Celsius and back in an hour and a half, while the table holds the unit
in one attitude after the other, at rest or turning about the vertical.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE_HZ = 20.0
GRAVITY = 9.81
DWELL_S, MOVE_S = 10.0, 2.0
#: Time constant of the dies behind the thermometer.
LAG_S = 25.0


@dataclass(frozen=True)
class Session:
    """What a data logger records, in counts, and the truth."""

    t: Array
    gyro: Array
    accel: Array
    temp: Array
    step: Array
    ref_rate_dps: Array
    ref_force_mps2: Array
    die_c: Array

    def keywords(self) -> dict[str, object]:
        """Arguments of ``mimu.Recording``."""
        names = ("t", "gyro", "accel", "temp", "step", "ref_rate_dps", "ref_force_mps2")
        known = {"unit": "count", "gravity": GRAVITY, "reference": "table", "device": "chamber"}
        return {**{name: getattr(self, name) for name in names}, **known}


def gyro_bias(die_c: Array) -> Array:
    """Counts, of x, y and z."""
    x = (np.asarray(die_c, dtype=float)[..., None] - 20.0) / 40.0
    return np.array([40.0, -25.0, 10.0]) + x * [30.0, -12.0, 20.0] + x**2 * [-8.0, 6.0, 4.0]


def accel_bias(die_c: Array) -> Array:
    """Counts, of x, y and z."""
    x = (np.asarray(die_c, dtype=float)[..., None] - 20.0) / 40.0
    return np.array([100.0, -60.0, 30.0]) + x * [20.0, 15.0, -30.0] + x**2 * [3.0, -4.0, 5.0]


#: Counts per rad/s and per m/s², with misalignments.
GYRO = 900.0 * (np.eye(3) + [[0.010, 0.004, -0.003], [-0.006, -0.015, 0.005], [0.002, -0.004, 0.008]])
ACCEL = 800.0 * (np.eye(3) + [[-0.012, 0.003, 0.005], [0.002, 0.009, -0.004], [-0.005, 0.001, 0.015]])


def session(seed: int = 1) -> Session:
    """One sweep."""
    random = np.random.default_rng(seed)
    knots_s = [0.0, 300.0, 2700.0, 3000.0, 5400.0]
    t = np.arange(int(knots_s[-1] * RATE_HZ)) / RATE_HZ
    temp = np.interp(t, knots_s, [-20.0, -20.0, 60.0, 60.0, -20.0])
    die_c, share = np.empty_like(temp), 1.0 - np.exp(-1.0 / (RATE_HZ * LAG_S))
    level = temp[0]
    for i, outside in enumerate(temp):
        level += share * (outside - level)
        die_c[i] = level
    thermometer = temp + random.normal(scale=0.02, size=len(t))
    number = (t // (DWELL_S + MOVE_S)).astype(int)
    dwells = number.max() + 1
    up = random.normal(size=(dwells, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    turning = np.where(np.arange(dwells) % 2 == 0, 0.0, random.choice([-60.0, 60.0], size=dwells))
    held = t - number * (DWELL_S + MOVE_S) < DWELL_S
    # During a move the input is between those of the two dwells, and unknown.
    blend = np.clip((t - number * (DWELL_S + MOVE_S) - DWELL_S) / MOVE_S, 0.0, 1.0)[:, None]
    after = np.minimum(number + 1, dwells - 1)
    force = GRAVITY * ((1 - blend) * up[number] + blend * up[after])
    rate_dps = (1 - blend) * (turning[:, None] * up)[number] + blend * (turning[:, None] * up)[after]
    gain = 1.0 + 2e-4 * (die_c[:, None] - 20.0)
    gyro = gain * (np.radians(rate_dps) @ GYRO.T) + gyro_bias(die_c) + random.normal(scale=1.5, size=(len(t), 3))
    accel = gain * (force @ ACCEL.T) + accel_bias(die_c) + random.normal(scale=4.0, size=(len(t), 3))
    unknown = ~held
    force[unknown], rate_dps[unknown] = np.nan, np.nan
    step = np.where(held, number, -1).astype(float)
    return Session(t, gyro, accel, thermometer, step, rate_dps, force, die_c)
