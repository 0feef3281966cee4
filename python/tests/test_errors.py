"""Refusals, and the parts of them that a program can read."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path

import mimu
import numpy as np
import pytest


def test_a_cell_that_is_no_number_is_named_with_file_row_and_column(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    rows = [f"{k / 50},{k},2,3,4,5,6" for k in range(100)]
    rows[41] = rows[41].replace(",4,5,6", ",four,5,6")
    log.write_text("t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n" + "\n".join(rows) + "\n")
    with pytest.raises(mimu.Error) as caught:
        mimu.read(log, raw_unit="count", gravity=9.81)
    error = caught.value
    assert (error.file, error.row, error.column) == (str(log), 43, "accel_x")
    assert error.kind == "invalid" and "four" in error.problem and error.remedy
    assert str(error) == f"{error.place}: {error.problem}; {error.remedy}"


def test_a_file_that_is_not_there_is_of_the_operating_system(tmp_path: Path) -> None:
    with pytest.raises(mimu.Error) as caught:
        mimu.load(tmp_path / "none.toml")
    assert caught.value.kind == "io" and caught.value.file == str(tmp_path / "none.toml")
    assert caught.value.row is None and caught.value.column is None


def test_a_time_that_goes_back_is_named_with_its_row() -> None:
    t = np.arange(300) / 50.0
    t[200] = 1.0
    values = np.random.default_rng(1).normal(size=(300, 3))
    with pytest.raises(mimu.Error, match="time goes back") as caught:
        mimu.fit(mimu.Recording(t, values, values, unit="count", gravity=9.81, device="log"))
    assert (caught.value.file, caught.value.row, caught.value.column) == ("log", 201, "t_s")


def test_an_experiment_that_does_not_determine_the_unit_is_of_its_own_kind() -> None:
    random = np.random.default_rng(1)
    still = random.normal(size=(3000, 6)) * 0.5 + [1, 2, 3, 10, 20, 800]
    with pytest.raises(mimu.Error) as caught:
        mimu.fit(mimu.Recording(None, still[:, :3], still[:, 3:], unit="count", gravity=9.81, rate_hz=50.0))
    assert caught.value.kind == "undetermined" and isinstance(caught.value, ValueError)


@pytest.mark.parametrize(
    ("keywords", "says"),
    [
        ({"gyro": np.zeros((10, 2))}, r"gyro: its shape is \(10, 2\), but \(10, 3\) is needed"),
        ({"accel": np.zeros((9, 3))}, r"accel: its shape is \(9, 3\), but \(10, 3\) is needed"),
        ({"gyro": np.zeros((10, 3)), "temp": np.zeros(7)}, r"temp: its shape is \(7,\), but \(10,\) is needed"),
        ({"gyro": np.zeros((10, 3)), "gravity": 1.0}, "looks like g"),
        ({"gyro": np.zeros((10, 3)), "unit": "mV"}, "write V, count or SI"),
        ({"gyro": np.zeros((10, 3)), "t": np.zeros(10)}, "the times do not give the sample rate"),
        ({}, "readings of neither sensor"),
        ({"t": None, "gyro": np.zeros((10, 3))}, r"neither times nor a sample rate.*\(rate_hz=\)"),
        ({"gyro": np.zeros((10, 3)), "rate_hz": 0.0}, "rate"),
        ({"gyro": np.zeros((0, 3)), "t": []}, "t"),
        ({"gyro": 1.0}, "gyro: its shape"),
        ({"gyro": [[1.0, 2.0, 3.0], [4.0]]}, "gyro: it is not an array of numbers"),
        ({"gyro": np.full((10, 3), "x")}, "gyro: it is not an array of numbers"),
        ({"gyro": np.zeros((10, 3)), "temp": np.arange(10).astype("datetime64[s]")}, "temp: it contains dates"),
        ({"gyro": np.zeros((10, 3)), "t": np.full(10, np.nan)}, "times do not give the sample rate"),
        ({"gyro": np.zeros((10, 3)), "reference": "moon"}, "moon"),
        ({"gyro": np.zeros((10, 3)), "unit": None, "units": "deg/s,furlong"}, "furlong"),
    ],
)
def test_arrays_that_do_not_fit_are_named(keywords: dict[str, object], says: str) -> None:
    given = {"t": np.arange(10) / 10.0, "unit": "count", "gravity": 9.81, **keywords}
    with pytest.raises(mimu.Error, match=says):
        mimu.Recording(**given)


def test_options_that_there_are_not_are_errors_of_type_or_value(arrays: mimu.Recording, tmp_path: Path) -> None:
    calibration = mimu.fit(arrays).calibration
    with pytest.raises(TypeError, match="qgroundcontrol"):
        mimu.export("px4", calibration=calibration, qgroundcontrol=True)
    with pytest.raises(ValueError, match="cannot be used with"):
        mimu.design(budget=10, sigma=0.01)
    with pytest.raises(mimu.Error, match="^only: invalid value 'best'.*accel"):
        mimu.fit(arrays, only="best")
    with pytest.raises(mimu.Error, match="one other recording"):
        mimu.diagnose(arrays, verify=[arrays, arrays])


@pytest.mark.parametrize(
    "wrong",
    [
        lambda rec, here: mimu.fit(rec, holdout=-1),
        lambda rec, here: mimu.fit(rec, holdout=1),
        lambda rec, here: mimu.fit(rec, still=float("nan")),
        lambda rec, here: mimu.fit(rec, keep="some"),
        lambda rec, here: mimu.fit(rec, keep=["a"]),
        lambda rec, here: mimu.fit(rec, only="magnetometer"),
        lambda rec, here: mimu.fit(rec, prior=here / "none.toml"),
        lambda rec, here: mimu.fit(rec, noise=here / "none.toml"),
        lambda rec, here: mimu.fit_sessions([]),
        lambda rec, here: mimu.fit_sessions([rec], part_class="best"),
        lambda rec, here: mimu.allan(),
        lambda rec, here: mimu.allan(rec, from_s=5, to_s=1),
        lambda rec, here: mimu.allan(rec, step=1, from_s=1),
        lambda rec, here: mimu.allan(rec, per_decade=0),
        lambda rec, here: mimu.allan(rec, confidence=2.0),
        lambda rec, here: mimu.verify(rec, here),
        lambda rec, here: mimu.diagnose([]),
        lambda rec, here: mimu.thermal.fit(rec, range_c=(60, -20)),
        lambda rec, here: mimu.thermal.fit(rec, lag_s=1e9),
        lambda rec, here: mimu.load(here),
        lambda rec, here: mimu.load_noise(here / "none.toml"),
        lambda rec, here: mimu.read(here),
        lambda rec, here: mimu.read(),
        lambda rec, here: mimu.read(here / "none.csv"),
        lambda rec, here: rec.save(here / "x", format="xlsx"),
        lambda rec, here: rec[::2],
        lambda rec, here: mimu.design(n=-1),
        lambda rec, here: mimu.next_experiment("none"),
        lambda rec, here: mimu.export("none"),
        lambda rec, here: mimu.export("px4"),
        lambda rec, here: mimu.fit(rec).save(here),
        lambda rec, here: mimu.export("c", calibration=mimu.fit(rec)).save(here),
        lambda rec, here: mimu.fit(rec).apply(np.zeros((3, 2))),
        lambda rec, here: mimu.fit(rec).apply([["a", "b", "c"]]),
        lambda rec, here: mimu.fit(rec).apply(rec, rec.accel),
        lambda rec, here: mimu.fit(rec).calibration.inverse("magnetometer"),
    ],
)
def test_whatever_is_refused_is_an_error_of_mimu(wrong: Callable[[mimu.Recording, Path], object], arrays: mimu.Recording, tmp_path: Path) -> None:
    with pytest.raises(mimu.Error) as caught:
        wrong(arrays, tmp_path)
    assert caught.value.problem and caught.value.remedy and "--" not in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        (lambda rec: mimu.fit("log.csv"), "recording"),
        (lambda rec: mimu.fit(rec, noise=3), "noise"),
        (lambda rec: mimu.allan(3), "recordings"),
        (lambda rec: mimu.allan(rec, calibration=rec), "calibration"),
        (lambda rec: mimu.diagnose(rec, verify=3), "verify"),
        (lambda rec: mimu.verify(rec, None), "calibration"),
        (lambda rec: mimu.thermal.fit(None), "recordings"),
        (lambda rec: mimu.noise_in_use(rec, None, None), "noise"),
    ],
)
def test_a_wrong_type_names_its_argument(wrong: Callable[[mimu.Recording], object], name: str, arrays: mimu.Recording) -> None:
    with pytest.raises(TypeError, match=name):
        wrong(arrays)


def test_what_a_log_does_not_say_is_asked_in_words_of_python(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("ax,ay,az,gx,gy,gz\n" + "0.1,0.2,9.8,0.01,0.02,0.03\n" * 200)
    with pytest.raises(mimu.Error) as caught:
        mimu.read(log)
    assert caught.value.remedy.startswith(f'say it: mimu.read("{log}", ') and 'rate_hz="RATE"' in caught.value.remedy


def test_an_error_comes_through_a_pickle_whole(tmp_path: Path) -> None:
    with pytest.raises(mimu.Error) as caught:
        mimu.load(tmp_path / "none.toml")
    error, back = caught.value, pickle.loads(pickle.dumps(caught.value))
    assert str(back) == str(error) and vars(back) == vars(error)


def test_gravity_that_nobody_gave_is_warned_of() -> None:
    values = np.ones((10, 3))
    rec = mimu.Recording(np.arange(10) / 10, values, unit="count")
    assert rec.gravity_mps2 == 9.80665 and "give gravity or latitude_deg" in rec.warnings[0]
    at = mimu.Recording(np.arange(10) / 10, values, unit="count", latitude_deg=48.1)
    assert 9.80 < at.gravity_mps2 < 9.82 and at.warnings == []
