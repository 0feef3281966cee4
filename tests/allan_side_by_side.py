#!/usr/bin/env python3
"""Deviations of the same rates at the same times by mimu and by AllanTools: time, peak memory, largest difference.

    python3 -m venv venv && venv/bin/pip install allantools
    venv/bin/python tests/allan_side_by_side.py [SAMPLES]

Each runs in a process of its own, RUNS times in turn; the shortest time counts, which the machine disturbed least,
and the largest memory. The time is that of the curve alone, without reading the file or importing modules;
AllanTools is not asked to identify the noise and compute bounds, mimu is. Memory is the whole process's.
"""
import json
import os
import subprocess
import sys
import tempfile
import time

KINDS = {"allan": "oadev", "modified": "mdev", "hadamard": "ohdev"}
PER_DECADE = 10
RUNS = 3


def write_rates(path, samples):
    """White rates and a slow random walk. In a process of its own: a child's peak includes its parent's at the start."""
    import numpy

    random = numpy.random.default_rng(1)
    walk = 1e-3 * numpy.cumsum(random.standard_normal(int(samples)))
    (random.standard_normal(int(samples)) + walk).tofile(path)


def allantools(path, kind, clusters):
    """Prints what the bench of mimu prints."""
    import allantools
    import numpy

    rates = numpy.fromfile(path)
    clusters = numpy.loadtxt(clusters)
    start = time.perf_counter()
    taus, deviations, _, terms = getattr(allantools, KINDS[kind])(
        rates, rate=1.0, data_type="freq", taus=clusters
    )
    print("seconds", time.perf_counter() - start)
    for row in zip(taus, deviations, terms):
        print("%d %.17e %d" % row)


def by(name, *arguments):
    return [sys.executable, __file__, name, *arguments]


def measured(command):
    """Standard output of a command, and its peak memory in MB."""
    with tempfile.TemporaryFile("w+") as out:
        child = subprocess.Popen(command, stdout=out)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            sys.exit(f"{command[0]} failed")
        out.seek(0)
        seconds, *rows = out.read().splitlines()
    points = {int(m): (float(s), float(t)) for m, s, t in map(str.split, rows)}
    return float(seconds.split()[1]), usage.ru_maxrss / 1024, points


def built():
    """Path of the bench, built now."""
    command = "cargo bench -q -p mimu-allan --bench allan --no-run --message-format=json".split()
    messages = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    artefacts = map(json.loads, messages.splitlines())
    return next(
        a["executable"]
        for a in artefacts
        if a.get("target", {}).get("kind") == ["bench"] and a.get("executable")
    )


def main(samples):
    ours = built()
    with tempfile.TemporaryDirectory() as folder:
        path, clusters = os.path.join(folder, "rates"), os.path.join(folder, "clusters")
        subprocess.run(by("--rates", path, str(samples)), check=True)
        print(f"{samples} rates, {PER_DECADE} times a decade")
        print(f"{'':10}{'mimu':>18}{'allantools':>20}{'faster':>10}{'memory':>9}  largest difference")
        for kind in KINDS:
            runs = [], []
            for _ in range(RUNS):
                runs[0].append(measured([ours, "--file", path, kind, str(PER_DECADE)]))
                with open(clusters, "w") as out:
                    out.writelines(f"{m}\n" for m in runs[0][0][2])
                runs[1].append(measured(by("--allantools", path, kind, clusters)))
            (seconds, memory, points), theirs = (
                (min(r[0] for r in run), max(r[1] for r in run), run[0][2]) for run in runs
            )
            off = [
                (abs(deviation / theirs[2][m][0] - 1) * (2 * edf) ** 0.5, m)
                for m, (deviation, edf) in points.items()
                if m in theirs[2]
            ]
            worst = max(off)[0]
            print(
                f"{kind:10}{seconds:8.3f} s{memory:5.0f} MB{theirs[0]:10.2f} s{theirs[1]:5.0f} MB"
                f"{theirs[0] / seconds:9.0f}x{memory / theirs[1]:9.2f}  {worst:.3f} standard errors at {len(off)} times"
            )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--allantools"]:
        allantools(*sys.argv[2:])
    elif sys.argv[1:2] == ["--rates"]:
        write_rates(*sys.argv[2:])
    else:
        main(int(float(sys.argv[1])) if sys.argv[1:] else 10_000_000)
