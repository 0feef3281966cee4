"""Logs for the tests of the page in the browser, made here without code of mimu."""
import numpy

G = 9.80665


def turned(rotation, axis, angle):
    """The rotation after a turn about an axis of the body."""
    x, y, z = axis
    k = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return rotation @ (numpy.eye(3) + numpy.sin(angle) * k + (1 - numpy.cos(angle)) * k @ k)


def by_hand(dwells=24, dwell_s=4.0, rate_hz=100.0, seed=1):
    """Time and readings of a unit that is turned by hand from pose to pose: rad/s and m/s², with errors of scale, bias and noise."""
    random = numpy.random.default_rng(seed)
    still, turn = int(dwell_s * rate_hz), int(1.5 * rate_hz)
    # A rate that begins and ends at rest.
    course = 1 - numpy.cos(2 * numpy.pi * (numpy.arange(turn) + 0.5) / turn)
    rotation, rates, forces = numpy.eye(3), [], []
    for _ in range(dwells):
        rates.append(numpy.zeros((still, 3)))
        forces.append(numpy.tile(rotation.T @ [0, 0, G], (still, 1)))
        axis = random.normal(size=3)
        axis /= numpy.linalg.norm(axis)
        angle = random.uniform(1.2, 2.8)
        for share in course / course.sum():
            middle = turned(rotation, axis, angle * share / 2)
            rates.append((axis * angle * share * rate_hz)[None])
            forces.append((middle.T @ [0, 0, G])[None])
            rotation = turned(rotation, axis, angle * share)
    rates, forces = numpy.concatenate(rates), numpy.concatenate(forces)
    gyro = rates * [1.01, 0.99, 1.02] + [0.01, -0.02, 0.005] + random.normal(0, 2e-3, rates.shape)
    accel = forces * [1.005, 0.998, 1.01] + [0.1, -0.05, 0.2] + random.normal(0, 2e-2, forces.shape)
    t = numpy.arange(len(rates)) / rate_hz
    return numpy.column_stack([t, gyro, accel])


NAMES = ["time", "gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"]


def write_csv(path, rows):
    with open(path, "w") as file:
        file.write(",".join(NAMES) + "\n")
        form = "%.4f" + ",%.9f" * 6 + "\n"
        for from_row in range(0, len(rows), 10000):
            part = rows[from_row : from_row + 10000]
            file.write((form * len(part)) % tuple(part.ravel()))
