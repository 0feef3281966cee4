"""Ctrl-C, and other threads during the work."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time

import mimu
import numpy as np
import pytest

LONG = """
import signal, sys, time
import numpy as np
import mimu
# A shell starts what it runs in the background with the signal ignored, and Python then leaves it ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
random = np.random.default_rng(1)
values = random.normal(size=(8_000_000, 6)) + [0, 0, 0, 0, 0, 9.81]
rec = mimu.Recording(None, values[:, :3], values[:, 3:], unit="SI", gravity=9.81, rate_hz=1000.0)
print("ready", flush=True)
try:
    mimu.allan(rec)
    print("done", flush=True)
except KeyboardInterrupt:
    # Another call works as before.
    mimu.design(n=6)
    print("interrupted", time.monotonic(), flush=True)
"""


def test_ctrl_c_interrupts_long_work_within_a_moment() -> None:
    # Eight million samples take 3.4 s.
    process = subprocess.Popen([sys.executable, "-c", LONG], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.5)
    asked = time.monotonic()
    process.send_signal(signal.SIGINT)
    said = process.stdout.readline().split()
    process.kill()
    process.wait()
    assert said[0] == "interrupted", said
    # Both clocks are that of the machine. Signals are checked twenty times a second, but the working thread takes a core.
    assert float(said[1]) - asked < 5.0


def test_other_threads_run_during_the_work(at_rest: mimu.Recording) -> None:
    counted, stop = [0], threading.Event()

    def count() -> None:
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0.001)

    beside = threading.Thread(target=count)
    beside.start()
    begun, before = time.monotonic(), counted[0]
    mimu.allan(at_rest)
    took, during = time.monotonic() - begun, counted[0] - before
    stop.set()
    beside.join()
    # Without the release of the lock it would not count at all.
    assert during > 20 * took, f"{during} in {took:.2f} s"


def test_two_fits_at_once_give_what_each_gives_alone(arrays: mimu.Recording) -> None:
    alone = mimu.fit(arrays).to_dict()
    found: list[dict[str, object]] = []
    threads = [threading.Thread(target=lambda: found.append(mimu.fit(arrays).to_dict())) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [alone] * 4


def test_an_array_that_shrinks_during_the_work_is_refused() -> None:
    values = np.random.default_rng(1).normal(size=(200_000, 3))
    t = np.arange(200_000) / 100.0
    rec = mimu.Recording(t, values, unit="SI", gravity=9.81, rate_hz=100.0)
    assert rec.gyro is values
    values.resize((50_000, 3), refcheck=False)
    with pytest.raises(mimu.Error, match="resized"):
        mimu.allan(rec)
