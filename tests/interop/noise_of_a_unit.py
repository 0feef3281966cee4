"""A noise file, written here: N and K of each channel, and those of the worst axis."""
import math

RATE_HZ = 200.0
# N and K by channel. The worst axes are y of the gyro, z and x of the accelerometer.
CHANNELS = {
    "gyro_x": (1.6e-4, 1.9e-5),
    "gyro_y": (1.9e-4, 2.3e-5),
    "gyro_z": (1.5e-4, 1.1e-5),
    "accel_x": (1.8e-3, 3.1e-4),
    "accel_y": (1.9e-3, 2.2e-4),
    "accel_z": (2.4e-3, 2.7e-4),
}
WORST = {"gyro": (1.9e-4, 2.3e-5), "accel": (2.4e-3, 3.1e-4)}


def write(folder):
    """Writes the file and returns its path."""
    text = f'format = "mimu-noise/1"\ndevice = "unit"\nsample_rate_hz = {RATE_HZ}\nduration_s = 7200.0\nconfidence = 0.95\n'
    for name, (n, k) in CHANNELS.items():
        si = "rad/s" if name.startswith("gyro") else "m/s^2"
        text += f'[[channel]]\nname = "{name}"\nunit = "{si}"\nsamples = 1440000\n'
        for key, value, unit in [("n", n, f"{si}/sqrt(Hz)"), ("k", k, f"{si}/sqrt(s)")]:
            text += f'[channel.{key}]\nvalue = {value}\nsigma = {value / 50}\nlower = {value * 0.96}\nupper = {value * 1.04}\nunit = "{unit}"\n'
    path = folder / "noise.toml"
    path.write_text(text)
    return path


def random_walk_variances(n, k, seconds):
    """Effect of white noise N and of a bias with random walk K after some time at rest: variances of their integrals."""
    return n**2 * seconds, k**2 * seconds


def close(ours, theirs, relative=1e-5):
    return math.isclose(ours, theirs, rel_tol=relative)
