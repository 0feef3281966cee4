"""The Python reader of MCAP finds the samples as recorded and as written by `mimu apply`, and the dwells with their residuals."""
import collections
import json
import os
import subprocess

import jsonschema
import numpy
import pytest
from conftest import G, triad
from mcap.reader import make_reader


class File:
    """Messages by topic, in order of time, and what the reader reports about the file."""

    def __init__(self, path):
        self.messages = collections.defaultdict(list)
        with open(path, "rb") as file:
            reader = make_reader(file, validate_crcs=True)
            self.summary = reader.get_summary()
            self.metadata = {m.name: m.metadata for m in reader.iter_metadata()}
            file.seek(0)
            validators = {s.id: jsonschema.Draft202012Validator(json.loads(s.data)) for s in self.summary.schemas.values()}
            for schema, channel, message in reader.iter_messages():
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
                value = json.loads(message.data)
                # Validation of all samples takes minutes; all have the same structure.
                if channel.topic == "/dwells" or len(self.messages[channel.topic]) % 100 == 0:
                    validators[schema.id].validate(value)
                self.messages[channel.topic].append((message.log_time, schema.name, value))

    def triad(self, topic, key):
        return numpy.array([[m[2][key][axis] for axis in "xyz"] for m in self.messages[topic]])


@pytest.fixture(scope="module")
def by_hand(unit):
    path, result = unit.export("mcap", "--recording", "by-hand", name="unit.mcap")
    return File(path), result


def test_samples_are_as_recorded_and_as_applied(unit, by_hand):
    file, result = by_hand
    n = len(unit.raw["t_s"])
    counts = {c.topic: file.summary.statistics.channel_message_counts[i] for i, c in file.summary.channels.items()}
    assert counts["/raw"] == counts["/compensated"] == n
    for topic, samples, keys in [
        ("/raw", unit.raw, {"gyro": "gyro", "accel": "accel"}),
        ("/compensated", unit.applied, {"gyro": "angular_velocity", "accel": "linear_acceleration"}),
    ]:
        for sensor, key in keys.items():
            # The file of samples contains the same double.
            assert numpy.array_equal(file.triad(topic, key), triad(samples, sensor))
        stamps = [m[0] for m in file.messages[topic]]
        assert numpy.allclose(numpy.array(stamps) * 1e-9, samples["t_s"], atol=1e-9)
    assert file.messages["/raw"][0][2]["unit"] == "count"
    # The head is there.
    assert any("raw to SI" in line for line in file.metadata["mimu"].values())
    assert any("dwells from" in line for line in result["notes"])


def test_dwells_are_on_the_sphere_with_their_residuals(unit, by_hand):
    file, _ = by_hand
    names = {m[1] for m in file.messages["/dwells"]}
    assert names == {"foxglove.SceneUpdate"}
    entities = [e for m in file.messages["/dwells"] for e in m[2]["entities"]]
    sphere, *dwells = entities
    assert sphere["id"] == "gravity" and sphere["spheres"][0]["size"]["x"] == 2.0
    assert len(dwells) >= 9
    force = triad(unit.applied, "accel")
    lengths = []
    for dwell in dwells:
        known = {pair["key"]: pair["value"] for pair in dwell["metadata"]}
        mean, residual = (numpy.array(json.loads(known[key])) for key in ["force_mps2", "residual_mps2"])
        # The mean of the samples up to this end.
        end = round((dwell["timestamp"]["sec"] + 1e-9 * dwell["timestamp"]["nsec"] - unit.raw["t_s"][0]) / numpy.median(numpy.diff(unit.raw["t_s"])))
        assert numpy.allclose(force[end - 20 : end].mean(axis=0), mean, atol=0.1)
        # Only gravity is known: the residual is along the force and equals the error of its magnitude.
        assert numpy.allclose(residual, mean - G * mean / numpy.linalg.norm(mean), atol=1e-9)
        point = dwell["spheres"][0]["pose"]["position"]
        assert numpy.allclose([point[a] for a in "xyz"], mean / G)
        # The arrow begins at this point, and its x axis, rotated by its orientation, is along the residual.
        arrow = dwell["arrows"][0]
        q = arrow["pose"]["orientation"]
        along = [
            1 - 2 * (q["y"] ** 2 + q["z"] ** 2),
            2 * (q["x"] * q["y"] + q["z"] * q["w"]),
            2 * (q["x"] * q["z"] - q["y"] * q["w"]),
        ]
        length = arrow["shaft_length"] + arrow["head_length"]
        assert numpy.allclose(numpy.array(along) * length, residual * float(known["enlarged"]) / G, atol=1e-9)
        lengths.append(length)
    assert max(lengths) == pytest.approx(0.5)


def test_every_tenth_sample_over_temperature(thermal_unit):
    path, _ = thermal_unit.export("mcap", "--recording", "recording", "--every", "10", name="unit.mcap")
    file = File(path)
    assert numpy.array_equal(file.triad("/compensated", "angular_velocity"), triad(thermal_unit.applied, "gyro")[::10])
    assert numpy.array_equal([m[2]["temp_c"] for m in file.messages["/raw"]], thermal_unit.raw["temp_c"][::10])


def test_the_recording_is_not_overwritten(unit):
    before = (unit.folder / "by-hand" / "samples.csv").read_bytes()
    command = [os.environ["MIMU"], "export", "mcap", "--calibration", "cal.toml", "--recording", "by-hand", "-o", "by-hand/samples.csv"]
    done = subprocess.run(command, cwd=unit.folder, capture_output=True, text=True)
    assert done.returncode == 1 and "choose another name" in done.stderr
    assert (unit.folder / "by-hand" / "samples.csv").read_bytes() == before
