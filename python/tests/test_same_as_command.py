"""Numbers equal those of the command to the last digit, because both are read from the same JSON."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from typing import Any

import mimu
import numpy as np
import pytest
from conftest import EXAMPLE, json_of, run


def without(data: dict[str, Any], *keys: str) -> dict[str, Any]:
    """``data`` without the keys that name the place of a recording."""
    return {key: value for key, value in data.items() if key not in keys}


def undated(text: str) -> str:
    """``text`` of a file without its date, which it must contain."""
    rest, found = re.subn(r"^created = \"20\d\d-\S+Z\"$", "created", text, flags=re.MULTILINE)
    assert found == 1, text[:300]
    return rest


def test_an_import_reports_and_reads_what_the_command_does(folder: Path) -> None:
    files = (EXAMPLE / "accel.txt", EXAMPLE / "gyro.txt")
    columns = ["t_s,accel_x,accel_y,accel_z", "t_s,gyro_x,gyro_y,gyro_z"]
    read = mimu.read(*files, columns=columns, gravity=9.80665, raw_unit="count", reference="gravity")
    command = json_of(
        "import", *files, *(f"--columns={c}" for c in columns), "--gravity=9.80665", "--raw-unit=count", "--reference=gravity", "-o",
        folder.with_name("again"),
    )
    assert without(read.imported, "recording") == without(command, "recording")
    by_command = mimu.read(folder)
    for name in ("t", "gyro", "accel"):
        assert np.array_equal(getattr(read, name), getattr(by_command, name)), name
    assert len(read) == command["rows"]


def test_a_fit_is_that_of_the_command(folder: Path, by_hand: mimu.Recording) -> None:
    assert mimu.fit(by_hand).to_dict() == json_of("fit", folder)
    other = mimu.fit(by_hand, holdout=0, only="accel", still=20.0, keep="all").to_dict()
    assert other == json_of("fit", folder, "--holdout=0", "--only=accel", "--still=20", "--keep=all")


def test_a_fit_of_arrays_is_that_of_the_same_numbers_in_a_file(folder: Path, arrays: mimu.Recording) -> None:
    # The digest of arrays is that of their numbers; the digest of a file is that of its bytes.
    assert without(mimu.fit(arrays).to_dict(), "sha256") == without(json_of("fit", folder), "sha256")


def test_whole_turns_reference_and_part_are_those_of_the_command(folder: Path, by_hand: mimu.Recording, tmp_path: Path) -> None:
    part = mimu.fit(by_hand, part="icm42688p").to_dict()
    assert part == json_of("fit", folder, "--part", "icm42688p") and part["data_sheet"]["rows"]
    fit = mimu.fit(by_hand, whole_turns=True, placement=2.0).to_dict()
    assert fit == json_of("fit", folder, "--whole-turns", "--placement=2") != json_of("fit", folder)
    with pytest.raises(mimu.Error, match="reference.toml"):
        mimu.fit(by_hand, reference_error=tmp_path / "reference.toml")


def test_text_and_calibration_are_those_of_the_command(folder: Path, by_hand: mimu.Recording, tmp_path: Path) -> None:
    fit = mimu.fit(by_hand)
    printed = run("fit", folder, "-o", tmp_path / "cal.toml").stdout
    assert printed.startswith(str(fit))
    assert undated(fit.to_toml()) == undated((tmp_path / "cal.toml").read_text())


def test_attributes_are_the_numbers_of_the_json(by_hand: mimu.Recording) -> None:
    fit = mimu.fit(by_hand)
    data = fit.to_dict()["sensors"]["accel"]
    values = {p["name"]: p for p in data["parameters"]}
    assert fit.accel is not None
    for i, a in enumerate("xyz"):
        assert fit.accel.o[i] == values[f"o_{a}"]["value"]
        for j, b in enumerate("xyz"):
            assert fit.accel.C[i, j] == values[f"C_{a}{b}"]["value"]
            assert fit.accel.sigma[i, j] == values[f"C_{a}{b}"]["sigma"]
    assert fit.accel.parameters["bias_x"].unit == values["bias_x"]["unit"] == "count"
    assert fit.held_out["accel"].held_out_rms == data["held_out_rms"]
    assert [d.step for d in fit.dwells] == [d["step"] for d in fit.to_dict()["dwells"]]


def test_a_diagnosis_is_that_of_the_command(folder: Path, by_hand: mimu.Recording) -> None:
    found = mimu.diagnose(by_hand, verify=[by_hand])
    command = json_of("diagnose", folder, "--verify", folder)
    # The command identifies the other recording by its path.
    for one in (here := found.to_dict(), command):
        assert one["second"].pop("recording").endswith("by-hand")
    assert here == command
    assert found.verdict == command["verdict"]
    assert [effect.id for effect in found.effects] == [effect["id"] for effect in command["effects"]]


def test_a_body_is_split_as_by_the_command(by_hand: mimu.Recording, tmp_path: Path) -> None:
    # Three pairs that read one motion: what the recorded unit errs by is common to them.
    random = np.random.default_rng(3)
    mounted = [np.eye(3) + random.normal(scale=0.01, size=(3, 3)) for _ in range(6)]
    for name in ("one", "two"):
        triads = [readings @ turned for turned, readings in zip(mounted, 3 * [by_hand.gyro, by_hand.accel], strict=True)]
        log = np.column_stack([by_hand.t, *(of + random.normal(scale=0.3, size=of.shape) for of in triads)])
        names = [f"{kind}{number}_{axis}" for number in ("", 2, 3) for kind in ("gyro", "accel") for axis in "xyz"]
        for columns, file in ((19, f"{name}.csv"), (7, f"{name}-alone.csv")):
            np.savetxt(tmp_path / file, log[:, :columns], delimiter=",", header=",".join(["t_s", *names][:columns]), comments="", fmt="%.6f")
    given = {"gravity": 9.80665, "raw_unit": "count", "device": "array"}
    one, two, *alone = (mimu.read(tmp_path / f"{name}.csv", **given) for name in ("one", "two", "one-alone", "two-alone"))
    found = mimu.diagnose([one], verify=[two])
    command = json_of("diagnose", tmp_path / "one.csv", "--verify", tmp_path / "two.csv", "--gravity=9.80665", "--raw-unit=count", "--device=array")
    assert found.to_dict()["body"] == command["body"] and found.to_dict()["sensors"] == command["sensors"]
    body = found.body
    assert body is not None and body.turns == command["body"]["turns"] and sorted(body.own) == sorted(body.judged) == ["1", "2", "3"]
    assert body.exceeds_noise and body.common.lower < body.common.rms < body.common.upper and body.own["2"].rms < 0.5 * body.common.rms
    assert body.judged["3"].kind == command["body"]["judged"]["3"]["kind"]
    # It is taken out of the recording that is diagnosed, and out of the one that judges.
    whole = mimu.diagnose(alone[:1], verify=alone[1:])
    assert whole.body is None
    for rms in (lambda of: of.sensors["gyro"].held_out_rms_before, lambda of: of.to_dict()["second"]["before"]["sensors"]["gyro"]["rms"]):
        assert rms(found) < 0.7 * rms(whole)


def test_noise_is_that_of_the_command(at_rest: mimu.Recording, tmp_path: Path) -> None:
    path = at_rest.save(tmp_path / "rest")
    noise = mimu.allan(mimu.read(path))
    command = json_of("allan", path, "-o", tmp_path / "noise.toml")
    assert noise.to_dict() == command
    assert undated(noise.to_toml()) == undated((tmp_path / "noise.toml").read_text())
    assert np.array_equal(noise["gyro_x"].adev, command["channels"][0]["adev"])
    # From arrays without a file, except for the name of the recording.
    memory = mimu.allan(at_rest).to_dict()
    for here, there in zip(memory["channels"], command["channels"], strict=True):
        assert without(here, "recording") == without(there, "recording")


def test_noise_in_use_is_that_of_the_command(folder: Path, by_hand: mimu.Recording, at_rest: mimu.Recording, tmp_path: Path) -> None:
    fit, noise = mimu.fit(by_hand), mimu.allan(at_rest)
    fit.save(tmp_path / "cal.toml")
    noise.save(tmp_path / "noise.toml")
    found = mimu.noise_in_use(by_hand, fit, noise)
    command = json_of(
        "noise", folder, "--calibration", tmp_path / "cal.toml", "--noise", tmp_path / "noise.toml", "-o", tmp_path / "in-use.toml"
    )
    assert found.to_dict() == command
    assert found.noise.to_toml() == (tmp_path / "in-use.toml").read_text()
    assert [d.value for d in found.densities] == [d["value"] for d in command["densities"]]
    assert found.nees.in_use.value == command["nees"]["in_use"]["value"]
    # The calibration was made from the same recording.
    assert found.judgement.kind == "untested"


def test_several_sessions_are_those_of_the_command(folder: Path, tmp_path: Path) -> None:
    recording = mimu.read(folder)
    found = mimu.fit_sessions([recording], part_class="tactical")
    command = json_of("fit", folder, "--class", "tactical", "-o", tmp_path / "cal.toml")
    assert found.to_dict() == command
    assert found.judgement.kind == command["judgement"]["kind"]
    next_bias = found.parameters["gyro"]["bias_x"]["next_power_on"]
    own = found.parameters["gyro"]["bias_x"]
    assert next_bias[0] < own["lower"] < own["upper"] < next_bias[1]
    assert "next_power_on" in found.calibration.to_toml()
    with pytest.raises(mimu.Error, match="samples of"):
        mimu.fit_sessions([recording, recording])
    with pytest.raises(mimu.Error, match="^part_class: invalid value 'medical'.*consumer, tactical"):
        mimu.fit_sessions([recording], part_class="medical")  # type: ignore[arg-type]


def test_a_prior_that_is_none_is_refused_by_its_name(by_hand: mimu.Recording, tmp_path: Path) -> None:
    none = tmp_path / "none.toml"
    none.write_text("format = 'mimu-calibration/1'\n")
    with pytest.raises(mimu.Error, match="none.toml"):
        mimu.fit(by_hand, prior=none)


def test_curves_over_temperature_are_those_of_the_command(chamber: ModuleType, tmp_path: Path) -> None:
    recording = mimu.Recording(**chamber.session().keywords())
    path = recording.save(tmp_path / "sweep")
    of_file = mimu.thermal.fit([mimu.read(path)])
    assert of_file.to_dict() == json_of("thermal", "fit", path)
    of_arrays = mimu.thermal.fit(recording)
    assert without(of_arrays.to_dict(), "recordings") == without(of_file.to_dict(), "recordings")


def test_a_design_is_that_of_the_command() -> None:
    design = mimu.design(n=12, reference="gravity")
    assert design.to_dict() == json_of("design", "-n", 12, "--reference", "gravity")
    assert design.positions.shape == (12, 3)
    gyro = mimu.design(n=9, sensor="gyro", dwell=12.5)
    assert gyro.to_dict() == json_of("design", "-n", 9, "--sensor", "gyro", "--dwell", 12.5)
    assert gyro.rates_dps is not None and len(gyro.rates_dps) == len(gyro.positions)


def test_the_next_experiment_is_that_of_the_command(folder: Path, arrays: mimu.Recording, tmp_path: Path) -> None:
    ids = ["gyro_g_sensitivity", "accel_scale_cubic"]
    found = mimu.next_experiment(ids, reference="gravity", table="hand", seed=3)
    asked = ("design", "--effects", ",".join(ids), "--reference", "gravity", "--table", "hand", "--seed", 3)
    assert found.to_dict() == json_of(*asked, "-o", tmp_path / "plan.toml")
    assert found.to_toml() == (tmp_path / "plan.toml").read_text()
    assert [e.id for e in found.effects] == ids and len(found.positions) == len(found.begin_s)
    # After a recording on disk, and after arrays.
    command = json_of("design", "--effects", "accel_scale_cubic", "--after", folder, "--chamber", "25,45,5")
    for after in (folder, arrays):
        assert mimu.next_experiment("accel_scale_cubic", after=after, chamber=(25, 45, 5)).to_dict() == command


def test_a_verification_is_that_of_the_command(folder: Path, by_hand: mimu.Recording, tmp_path: Path) -> None:
    mimu.fit(by_hand).calibration.save(tmp_path / "cal.toml")
    judged = mimu.verify(by_hand, mimu.load(tmp_path / "cal.toml"))
    assert judged.to_dict() == json_of("verify", folder, "--calibration", tmp_path / "cal.toml")


def test_readings_are_compensated_as_by_the_command(folder: Path, by_hand: mimu.Recording, tmp_path: Path) -> None:
    fit = mimu.fit(by_hand)
    fit.calibration.save(tmp_path / "cal.toml")
    done = run("apply", folder, "--calibration", tmp_path / "cal.toml", "-o", tmp_path / "clean")
    assert done.returncode == 0, done.stderr
    clean = mimu.read(tmp_path / "clean")
    gyro, accel = fit.apply(by_hand)
    assert np.array_equal(gyro, clean.gyro, equal_nan=True) and np.array_equal(accel, clean.accel, equal_nan=True)


def test_exports_are_those_of_the_command(by_hand: mimu.Recording, at_rest: mimu.Recording, tmp_path: Path) -> None:
    # In volts, which the formats for the device of mimu need.
    volts = {"gyro": by_hand.gyro / 1000, "accel": by_hand.accel / 1000, "unit": "V", "gravity": by_hand.gravity_mps2}
    mimu.fit(mimu.Recording(by_hand.t, rate_hz=by_hand.rate_hz, **volts)).calibration.save(tmp_path / "cal.toml")
    # The exported file names the calibration file.
    calibration = mimu.load(tmp_path / "cal.toml")
    noise = mimu.allan(at_rest).noise
    noise.save(tmp_path / "noise.toml")
    for name, options, flags in [
        ("c", {}, []), ("rust", {}, []), ("json", {}, []), ("core", {}, []), ("px4", {"qgc": True}, ["--qgc"]), 
        ("ardupilot", {"accel_zero": 1.35, "gyro_zero": 2.04}, ["--accel-zero=1.35", "--gyro-zero=2.04"]),
        ("fusion", {}, []), ("imu-calib", {}, []), ("imu-tk", {"sensor": "gyro"}, ["--sensor=gyro"]), ("realsense", {}, []),
        ("depthai", {"imu": "BMI270"}, ["--imu=BMI270"]), ("basalt", {}, []), ("matlab", {"name": "mine"}, ["--name=mine"]),
    ]:
        made = mimu.export(name, calibration=calibration, **options)
        done = run("export", name, *flags, "--calibration", tmp_path / "cal.toml", "-o", tmp_path / name)
        assert done.returncode == 0, f"{name}: {done.stderr}"
        assert made.content == (tmp_path / name).read_bytes(), name
    for name in ("kalibr", "vins", "orbslam3", "liosam", "fastlio", "ros-imu", "gazebo"):
        made = mimu.export(name, noise=mimu.load_noise(tmp_path / "noise.toml"))
        done = run("export", name, "--noise", tmp_path / "noise.toml", "-o", tmp_path / name)
        assert done.returncode == 0, f"{name}: {done.stderr}"
        assert made.content == (tmp_path / name).read_bytes(), name
