"""One log in the shapes that loggers write, imported without a word about it.

Each shape is right (units, axes, times), asked about (a question with the command to complete), refused, or wrong: taken for something that it
is not. Nothing may be wrong, because a wrong unit makes every number of a calibration wrong by its factor."""
import csv
import datetime
import math
import os
import subprocess

import numpy
import pytest

G = 9.80665
DEG = math.pi / 180
RATE = 100.0


def log():
    """Forty seconds in a hand: rests, and turns by 90 degrees about each axis. Times in s, rates in rad/s, forces in m/s² by rotating gravity."""
    random = numpy.random.default_rng(1)
    up, times, rates, forces = numpy.array([0.1, -0.2, 1.0]), [], [], []
    up /= numpy.linalg.norm(up)
    for k in range(4000):
        part, at = divmod(k, 400)
        rate = numpy.zeros(3)
        if at >= 250:
            rate[part % 3] = (1 if part % 2 else -1) * math.pi / 2 / 1.5
        up = up - numpy.cross(rate, up) / RATE
        up /= numpy.linalg.norm(up)
        times.append(k / RATE)
        rates.append(rate + [0.011, -0.02, 0.006] + 2e-3 * random.standard_normal(3))
        forces.append(G * up + [0.05, -0.1, 0.08] + 0.02 * random.standard_normal(3))
    return numpy.array(times), numpy.array(rates), numpy.array(forces)


T, W, F = log()


def table(names, columns, separator=",", decimals=6, head=(), end="\n"):
    """A text with these names (None: no header) and columns of numbers or texts."""
    def cell(value):
        return value if isinstance(value, str) else f"{value:.{decimals}f}" if not float(value).is_integer() or decimals else str(int(value))

    lines = list(head)
    if names:
        lines.append(separator.join(names))
    lines += [separator.join(cell(v) for v in row) for row in zip(*columns, strict=True)]
    return end.join(lines) + end


def xyz(array, scale=1.0, whole=False):
    return [numpy.round(array[:, i] * scale) if whole else array[:, i] * scale for i in range(3)]


def names(pattern, axes="xyz"):
    return [pattern.format(a, a.upper()) for a in axes]


def simple(time, accel, gyro, t=T, a=1.0, w=1.0, whole=False, order="tag", decimals=6, **more):
    """A table of time, accelerometer and gyro; `a`, `w`: units of the file in each m/s², rad/s."""
    parts = {"t": ([time], [t]), "a": (accel, xyz(F[: len(t)], a, whole)), "g": (gyro, xyz(W[: len(t)], w, whole))}
    heads = [name for key in order for name in parts[key][0]]
    columns = [column for key in order for column in parts[key][1]]
    return table(heads, columns, decimals=decimals, **more)


A, GY = names("a{0}"), names("g{0}")
ISO = [(datetime.datetime(2026, 3, 1, 12, 0, 0) + datetime.timedelta(seconds=float(t))).isoformat(timespec="milliseconds") for t in T]
MIDNIGHT = [(datetime.datetime(2026, 3, 1, 23, 59, 50) + datetime.timedelta(seconds=float(t))).strftime("%H:%M:%S.%f")[:-3] for t in T]
EPOCH = 1_772_000_000


def shapes():
    """Name, text or texts of files, and what is right: `si` (readings come out in SI), `count`, or `ask`."""
    dps = 1 / DEG
    yield "t, ax..gz in SI", simple("t", A, GY), "si"
    yield "ax..gz without a time", table(A + GY, xyz(F) + xyz(W)), "ask"
    yield "time, acc_x in g, gyr_x in deg/s", simple("time", names("acc_{0}"), names("gyr_{0}"), a=1 / G, w=dps), "si"
    yield "AccX(g), GyroX(dps)", simple("Timestamp", names("Acc{1}(g)"), names("Gyro{1}(dps)"), a=1 / G, w=dps), "si"
    yield "millis and counts", simple("millis", A, GY, t=T * 1000, a=16384 / G, w=131 * dps, whole=True, decimals=0), "count"
    yield "counts of 16.4 and 2048", simple("t_ms", names("accel_{0}"), names("gyro_{0}"), t=T * 1000, a=2048 / G, w=16.4 * dps, whole=True, decimals=0), "count"
    ros = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"] + names("field.orientation.{0}", "xyzw") \
        + names("field.angular_velocity.{0}") + names("field.linear_acceleration.{0}")
    ns = [str(EPOCH * 10**9 + round(t * 1e9)) for t in T]
    yield "rostopic echo -p", table(ros, [ns, [str(k) for k in range(len(T))], ns, ["imu"] * len(T)] + [T * 0] * 4 + xyz(W) + xyz(F)), "si"
    yield "EuRoC", table(["#timestamp [ns]"] + names("w_RS_S_{0} [rad s^-1]") + names("a_RS_S_{0} [m s^-2]"), [ns] + xyz(W) + xyz(F)), "si"
    phyphox = ["Time (s)"] + names("Acceleration {0} (m/s^2)"), ["Time (s)"] + names("Gyroscope {0} (rad/s)")
    yield "phyphox, two files", {"Accelerometer.csv": table(phyphox[0], [T] + xyz(F)), "Gyroscope.csv": table(phyphox[1], [T] + xyz(W))}, "si"
    logger = ["time", "seconds_elapsed"] + names("{0}", "zyx")
    yield "x, y, z in files of phones", {
        "TotalAcceleration.csv": table(logger, [ns, T] + xyz(F)[::-1]), "Gyroscope.csv": table(logger, [ns, T] + xyz(W)[::-1]),
    }, "si"
    pairs = [n for n in ["t"] + A + GY]
    values = [T] + xyz(F) + xyz(W)
    yield "labels before numbers", "\n".join(",".join(f"{n}:{v:.5f}" for n, v in zip(pairs, row, strict=True)) for row in zip(*values, strict=True)), "si"
    arduino = ["AcX", "AcY", "AcZ", "GyX", "GyY", "GyZ"]
    counts = xyz(F, 16384 / G, True) + xyz(W, 131 * dps, True)
    yield "AcX = 1 | AcY = 2", "\n".join(" | ".join(f"{n} = {v:.0f}" for n, v in zip(arduino, row, strict=True)) for row in zip(*counts, strict=True)), "ask"
    yield "blanks and labels", "\n".join(" ".join(f"{n}: {v:.5f}" for n, v in zip(pairs, row, strict=True)) for row in zip(*values, strict=True)), "si"
    rows = list(zip(*values, strict=True))
    yield "groups of axes", "\n".join(f"T: {t:.5f}, ACC: X={a:.5f},Y={b:.5f},Z={c:.5f}, GYRO: X={p:.5f},Y={q:.5f},Z={r:.5f}" for t, a, b, c, p, q, r in rows), "si"
    yield "three numbers behind a word", "\n".join(f"t: {t:.5f} acc: {a:.5f},{b:.5f},{c:.5f} gyro: {p:.5f},{q:.5f},{r:.5f}" for t, a, b, c, p, q, r in rows), "si"
    units = ["s"] + ["m/s2"] * 3 + ["rad/s"] * 3
    yield "labels and units", "\n".join(", ".join(f"{n}: {v:.5f} {u}" for n, v, u in zip(pairs, row, units, strict=True)) for row in rows), "si"
    yield "semicolons and decimal commas", simple("Zeit (s)", names("Accel {1} [m/s²]"), names("Gyro {1} [°/s]"), w=dps, separator=";").replace(".", ","), "si"
    yield "tabs", simple("Time", names("Acc_{1}"), names("Gyr_{1}"), separator="\t"), "si"
    yield "blanks", simple("t", A, GY, separator=" "), "si"
    yield "no header, with a time", table(None, [T] + xyz(F) + xyz(W)), "si"
    yield "no header, no time", table(None, xyz(F) + xyz(W)), "ask"
    yield "no header, gyro first, counts", table(None, [T] + xyz(W, 131 * dps, True) + xyz(F, 16384 / G, True), decimals=3), "count"
    yield "an index before the time", table(["index", "time"] + A + GY, [[str(k) for k in range(len(T))], T] + xyz(F) + xyz(W)), "si"
    yield "an unnamed index of pandas", table([""] + ["time"] + A + GY, [[str(k) for k in range(len(T))], T] + xyz(F) + xyz(W)), "si"
    yield "ISO times", table(["datetime"] + A + GY, [ISO] + xyz(F) + xyz(W)), "si"
    yield "ISO times with a zone", table(["timestamp"] + A + GY, [[t + "Z" for t in ISO]] + xyz(F) + xyz(W)), "si"
    yield "times of day over midnight", table(["Time"] + A + GY, [MIDNIGHT] + xyz(F) + xyz(W)), "si"
    sec = [str(EPOCH + int(t)) for t in T], [str(round((t % 1) * 1e9)) for t in T]
    yield "seconds and nanoseconds apart", table(["sec", "nanosec"] + A + GY, [*sec] + xyz(F) + xyz(W)), "si"
    stamp = ["header.stamp.secs", "header.stamp.nsecs"] + names("angular_velocity.{0}") + names("linear_acceleration.{0}")
    yield "header.stamp.secs", table(stamp, [*sec] + xyz(W) + xyz(F)), "si"
    yield "BOM", "\ufeff" + simple("t", A, GY), "si"
    units = ["s"] + ["m/s^2"] * 3 + ["deg/s"] * 3
    yield "a row of units", table(["Time"] + names("Acc {1}") + names("Gyr {1}"), [["s"] + [f"{v:.6f}" for v in T]] +
                                  [[u] + [f"{v:.6f}" for v in c] for u, c in zip(units[1:], xyz(F) + xyz(W, dps), strict=True)]), "si"
    yield "a row of units in brackets", table(["Time"] + names("Acc{1}") + names("Gyr{1}"), [["[ms]"] + [f"{v:.3f}" for v in T * 1000]] +
                                              [["[g]"] + [f"{v:.6f}" for v in c] for c in xyz(F, 1 / G)] + [["[dps]"] + [f"{v:.6f}" for v in c] for c in xyz(W, dps)]), "si"
    yield "names behind #", "# logged by a board\n# " + simple("t", A, GY), "si"
    yield "titles above the names", "My logger v1.2\nDate: today\n\n" + simple("Time", names("Accel {1}"), names("Gyro {1}")), "si"
    quoted = simple('"t"', [f'"{n}"' for n in A], [f'"{n}"' for n in GY])
    yield "quotes", quoted, "si"
    more = ["time"] + A + GY + names("mag_{0}") + names("q{0}", "wxyz") + ["roll", "pitch", "yaw"]
    yield "magnetometer, quaternion, angles", table(more, [T] + xyz(F) + xyz(W) + [T * 0 + 30, T * 0 - 10, T * 0 + 42] + [T * 0] * 7), "si"
    yield "gyro before accelerometer", simple("t", A, GY, order="tga"), "si"
    yield "labels of activities", table(["t"] + A + GY + ["activity"], [T] + xyz(F) + xyz(W) + [["walking"] * len(T)]), "si"
    yield "mg and mdps in whole numbers", simple("T [ms]", names("A_{1} [mg]"), names("G_{1} [mdps]"), t=T * 1000, a=1000 / G, w=1000 * dps, whole=True, decimals=0), "si"
    yield "mg and mdps, unnamed", simple("t", A, GY, a=1000 / G, w=1000 * dps, whole=True, decimals=3), "ask"
    yield "timestamp_us", simple("timestamp_us", names("accel_{0}"), names("gyro_{0}"), t=T * 1e6, decimals=5), "si"
    yield "TimeUS", simple("TimeUS", names("Acc{1}"), names("Gyr{1}"), t=T * 1e6), "si"
    betaflight = ["loopIteration", "time (us)"] + [f"gyroADC[{i}] (deg/s)" for i in range(3)] + [f"accSmooth[{i}]" for i in range(3)] + [f"motor[{i}]" for i in range(4)]
    yield "Betaflight", table(betaflight, [[str(8 * k) for k in range(len(T))], T * 1e6] + xyz(W, dps) + xyz(F, 2048 / G, True) + [T * 0 + 1500] * 4, decimals=2), "si"
    mavlink = ["timestamp", "xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag"]
    yield "MAVLink in mg and mrad/s", table(mavlink, [T] + xyz(F, 1000 / G, True) + xyz(W, 1000, True) + [T * 0] * 3, decimals=3), "ask"
    yield "p, q, r", table(["time", "p", "q", "r", "fx", "fy", "fz"], [T] + xyz(W) + xyz(F)), "si"
    ios = ["loggingTime(txt)", "motionTimestamp(s)"] + names("motionRotationRate{1}(rad/s)") + names("motionUserAcceleration{1}(G)") + names("accelerometerAcceleration{1}(G)")
    yield "iOS, with forces without gravity", table(ios, [[t.replace("T", " ") for t in ISO], T] + xyz(W) + [T * 0] * 3 + xyz(F, 1 / G)), "si"
    yield "trailing separators", simple("t", A, GY).replace("\n", ",\n"), "si"
    yield "CRLF", simple("t", A, GY, end="\r\n"), "si"
    yield "serial monitor", "\n".join(f"{t[11:]} -> {row}" for t, row in zip(ISO, table(None, xyz(F) + xyz(W)).splitlines(), strict=True)), "si"
    yield "deg/s under rad/s", simple("t", names("acc_{0} [m/s2]"), names("gyro_{0} [rad/s]"), w=dps), "si"
    yield "g under m/s²", simple("t", names("acc_{0} [m/s^2]"), names("gyro_{0} [rad/s]"), a=1 / G), "si"
    yield "temperature", table(["t"] + A + GY + ["temp"], [T] + xyz(F) + xyz(W) + [T * 0 + 31.5]), "si"
    yield "two units side by side", table(["t"] + names("a{0}1") + names("g{0}1") + names("a{0}2") + names("g{0}2"), [T] + xyz(F) + xyz(W) + xyz(F) + xyz(W)), "si"
    yield "accelerometer in counts, gyro in deg/s", simple("t", names("acc_{0}_raw"), names("gyro_{0}_dps"), a=8192 / G, w=dps).replace("~", ""), "ask"
    yield "ms under t", simple("t", A, GY, t=T * 1000), "si"
    yield "µs under timestamp", simple("timestamp", A, GY, t=T * 1e6, decimals=4), "si"
    yield "ms since 1970", table(["timestamp"] + A + GY, [[str(EPOCH * 1000 + round(t * 1000)) for t in T]] + xyz(F) + xyz(W)), "si"
    yield "s since 1970", table(["time"] + A + GY, [[f"{EPOCH + t:.3f}" for t in T]] + xyz(F) + xyz(W)), "si"
    yield "words in brackets", simple("Time since start in ms", names("Gyroscope {1} [deg/s]"), names("Accelerometer {1} [m/s^2]"), t=T * 1000).replace("Gyroscope", "§").replace("Accelerometer", "Gyroscope").replace("§", "Accelerometer").replace("[deg/s]", "[1]").replace("[m/s^2]", "[2]"), "si"
    yield "x-axis acceleration", simple("time", names("{0}-axis acceleration (g)"), names("{0}-axis angular velocity (deg/s)"), a=1 / G, w=dps), "si"
    yield "Accel.X, Gyro.X", simple("Time", names("Accel.{1}"), names("Gyro.{1}")), "si"
    yield "imu0_ax", simple("imu0_t", names("imu0_a{0}"), names("imu0_g{0}")), "si"
    yield "AX, AY", simple("T", names("A{1}"), names("G{1}")), "si"
    yield "LSM6DSO of a maker's board", simple("Time [us]", names("LSM6DSO_ACC_{1} [mg]"), names("LSM6DSO_GYRO_{1} [mdps]"), t=T * 1e6, a=1000 / G, w=1000 * dps), "si"
    yield "acc_x[g]", simple("time[s]", names("acc_{0}[g]"), names("gyro_{0}[dps]"), a=1 / G, w=dps), "si"
    yield "phyphox without gravity", {"Gyroscope.csv": table(phyphox[1], [T] + xyz(W)), "Linear.csv": table(["Time (s)"] + names("Linear Acceleration {0} (m/s^2)"), [T, *([T * 0] * 3)])}, "ask"
    still = slice(0, 240)
    rest = table(["t"] + A + GY, [T[still]] + [c[still] for c in xyz(F) + xyz(W)])
    yield "at rest, the gyro's unit unnamed", rest, "ask"
    yield "at rest, units in the names", simple("t", A, names("g{0}_dps"), t=T[:240], w=dps, a=1.0), "si"
    yield "words of another language", simple("時刻", names("加速度{1}"), names("角速度{1}")), "ask"
    # From files of strangers, at their first try.
    yield "a tenth of a unit in the name", simple("time (ms)", names("accelerometer {0} (mg)"), names("gyroscope {0} (0.1 deg/s)"), t=T * 1000, a=1000 / G, w=10 * dps, whole=True, decimals=0), "ask"
    yield "axes with a unit only", {"a.csv": table(names("{0}(m/s^2)") + ["timestamp_ns"], xyz(F) + [T * 1e9]), "b.csv": table(names("{0}(deg/s)") + ["timestamp_ns"], xyz(W, dps) + [T * 1e9])}, "si"
    yield "giro_x", simple("time_ms", names("acel_{0}"), names("giro_{0}"), t=T * 1000, a=1 / G, w=dps), "si"
    yield "a triad of an unknown word, and no gyro", simple("t", A, names("foo_{0}")), "ask"
    two = [w for pair in zip(xyz(F), xyz(F), strict=True) for w in pair] + [w for pair in zip(xyz(W), xyz(W), strict=True) for w in pair]
    both = [n for n in names("acc_{0}") + names("gyr_{0}") for _ in range(2)]
    yield "two sensors with the same names", table(["t"] + both, [T] + two), "ask"
    yield "counts without names in a file called gyro", {"gyroData.csv": table(None, xyz(W, 131 * dps, True) + [40000 + c for c in xyz(F, 800, True)], decimals=0)}, "ask"
    yield "a row is a whole gesture", table(None, [numpy.roll(F[:, k % 3], k) for k in range(300)]), "ask"
    yield "a counter, and no time", table(["sample"] + A + GY, [[str(k) for k in range(len(T))]] + xyz(F) + xyz(W)), "ask"
    yield "a counter called t", table(["t"] + A + GY, [[str(k) for k in range(len(T))]] + xyz(F) + xyz(W)), "ask"
    lines = simple("t", A, GY).splitlines()
    yield "the names once more in the middle", "\n".join(lines[:2000] + [lines[0]] + lines[2000:]) + "\n", "any"
    yield "a cut last row", simple("t", A, GY)[:-25], "any"
    yield "JSON lines", "\n".join(f'{{"t":{t:.2f},"acc":[{f[0]:.4f},{f[1]:.4f},{f[2]:.4f}],"gyro":{{"x":{w[0]:.5f},"y":{w[1]:.5f},"z":{w[2]:.5f}}}}}' for t, f, w in zip(T, F, W, strict=True)), "si"
    yield "ESP-IDF's log", "\n".join(f"I ({1000 * t:.0f}) IMU: {', '.join(f'{v:.5f}' for v in (*f, *w))}" for t, f, w in zip(T, F, W, strict=True)), "si"
    yield "Teleplot", "\n".join(f">{n}:{v:.5f}" for row in zip(T, *xyz(F), *xyz(W), strict=True) for n, v in zip(["t", *A, *GY], row, strict=True)), "si"
    yield "ustime", simple("ustime", A, GY, t=T * 1e6 + 2e9), "si"
    yield "ax_g, gx_dps", simple("t", names("a{0}_g"), names("g{0}_dps"), a=1 / G, w=dps), "si"
    yield "roll_rate", table(["t", *A, "roll_rate", "pitch_rate", "yaw_rate"], [T] + xyz(F) + xyz(W)), "si"


def outcome(folder, texts):
    """What `mimu import FILES -o rec` makes of the files: the readings in SI by the recording's unit, or the refusal."""
    files = []
    for name, text in (texts if isinstance(texts, dict) else {"log.csv": texts}).items():
        (folder / name).write_text(text, encoding="utf-8", newline="")
        files.append(name)
    done = subprocess.run([os.environ["MIMU"], "import", *files, "-o", "rec", "--format", "csv"], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        return ("asked" if "say it:" in done.stderr else "refused"), done.stderr.strip().splitlines()[-1]
    manifest = (folder / "rec" / "recording.toml").read_text()
    with open(folder / "rec" / "samples.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    unit = "si" if 'raw_unit = "SI"' in manifest else "count" if 'raw_unit = "count"' in manifest else "V"
    return unit, rows


def right(unit, rows):
    """Whether times and readings are those of the log. Counts may have any scale, the same for all axes."""
    try:
        t = numpy.array([float(r["t_s"]) for r in rows])
        found = {s: numpy.array([[float(r[f"{s}_{a}"] or "nan") for a in "xyz"] for r in rows]) for s in ("gyro", "accel")}
    except KeyError as missing:
        return f"{missing} is missing"
    if abs((t[-1] - t[0]) / (len(t) - 1) * RATE - 1) > 2e-3:
        return f"rate {(len(t) - 1) / (t[-1] - t[0]):.3f} Hz"
    for sensor, truth in (("gyro", W), ("accel", F)):
        ours, theirs = found[sensor], truth[: len(t)]
        ours = ours[: len(theirs)]
        scale = 1.0 if unit == "si" else numpy.nansum(ours * theirs) / numpy.nansum(theirs**2)
        error = numpy.nanmax(numpy.abs(ours / scale - theirs))
        if not error < 0.02 * numpy.abs(theirs).max():
            return f"{sensor} is off by {error:.3g}, as {numpy.nansum(ours * theirs) / numpy.nansum(theirs**2):.4g} times the truth"
    return None


def test_a_log_in_every_shape_is_right_or_asked_about(tmp_path, capsys):
    counts = {"right": 0, "asked": 0, "refused": 0, "wrong": 0}
    table, wanted = [], 0
    for number, (name, texts, expected) in enumerate(shapes()):
        folder = tmp_path / str(number)
        folder.mkdir()
        kind, what = outcome(folder, texts)
        if kind in ("asked", "refused"):
            verdict, detail = kind, what
        else:
            detail = right(kind, what)
            verdict = "right" if detail is None else "wrong"
        counts[verdict] += 1
        wanted += expected in ("si", "count")
        table.append((verdict, expected, name, detail or ""))
    with capsys.disabled():
        print()
        for verdict, expected, name, detail in table:
            mark = " " if (verdict == "right") == (expected in ("si", "count")) or expected == "any" else "!"
            print(f"{mark} {verdict:8} {name:45} {detail[:150]}")
        print(f"{len(table)} shapes: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items()) + f"; {wanted} can be read without a word")
    assert counts["wrong"] == 0
    readable = [verdict for verdict, expected, *_ in table if expected in ("si", "count")]
    assert readable.count("right") >= 0.85 * len(readable)
    assert all(verdict in ("asked", "refused") for verdict, expected, *_ in table if expected == "ask")


def test_a_question_has_the_command_that_answers_it(tmp_path):
    (tmp_path / "log.csv").write_text(table(A + GY, xyz(F) + xyz(W)))
    asked = subprocess.run([os.environ["MIMU"], "import", "log.csv", "-o", "rec"], cwd=tmp_path, capture_output=True, text=True)
    assert asked.returncode == 1 and "say it: mimu import log.csv -o rec --rate-hz" in asked.stderr, asked.stderr
    said = [os.environ["MIMU"], "import", "log.csv", "-o", "rec", "--rate-hz", "100", "--units", "m/s2,rad/s"]
    assert subprocess.run(said, cwd=tmp_path, capture_output=True).returncode == 0


def test_a_log_is_fitted_without_a_recording(tmp_path):
    (tmp_path / "log.csv").write_text(simple("time", A, GY, a=1 / G, w=1 / DEG))
    done = subprocess.run([os.environ["MIMU"], "fit", "log.csv", "-o", "cal.toml", "--only", "accel"], cwd=tmp_path, capture_output=True, text=True)
    assert "gyro in deg/s" in done.stderr, done.stderr
    again = subprocess.run([os.environ["MIMU"], "fit", "log.csv", "-o", "log.csv"], cwd=tmp_path, capture_output=True, text=True)
    assert again.returncode == 1 and (tmp_path / "log.csv").read_text().startswith("time,"), again.stderr


@pytest.mark.parametrize("units", ["g,deg/s", "deg/s,g"])
def test_units_that_are_said_hold(tmp_path, units):
    (tmp_path / "log.csv").write_text(simple("t", A, GY, a=1 / G, w=1 / DEG))
    done = subprocess.run([os.environ["MIMU"], "import", "log.csv", "-o", "rec", "--units", units, "--format", "csv"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "rec" / "samples.csv", newline="") as file:
        first = next(csv.DictReader(file))
    assert abs(float(first["accel_z"]) - F[0, 2]) < 1e-3
