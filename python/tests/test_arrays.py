"""Arrays in and out."""

from __future__ import annotations

import pickle
import tracemalloc
from pathlib import Path
from types import ModuleType

import mimu
import numpy as np
import pytest


def test_arrays_of_doubles_are_the_same_arrays_within_a_recording() -> None:
    log = np.random.default_rng(1).normal(size=(500, 8))
    # Columns of a table: successive rows are 64 bytes apart.
    t, gyro, accel, temp = np.arange(500) / 50.0, log[:, 0:3], log[:, 3:6], log[:, 6]
    rec = mimu.Recording(t, gyro, accel, temp, unit="count", gravity=9.81)
    assert rec.t is t and rec.gyro is gyro and rec.accel is accel and rec.temp_c is temp
    assert np.shares_memory(rec.gyro, log)
    assert rec.rate_hz == pytest.approx(50.0) and len(rec) == 500 and rec.step is None


def test_other_numbers_are_converted() -> None:
    counts = np.arange(600, dtype=np.int16).reshape(200, 3)
    rec = mimu.Recording(np.arange(200) / 10.0, counts, counts[::-1].tolist(), unit="count", gravity=9.81)
    assert rec.gyro is not None and rec.accel is not None
    assert rec.gyro.dtype == np.float64 and np.array_equal(rec.gyro, counts)
    assert np.array_equal(rec.accel, counts[::-1])


def test_dates_and_durations_are_seconds(arrays: mimu.Recording) -> None:
    pandas = pytest.importorskip("pandas")
    given = {"unit": "count", "gravity": 9.81}
    since = arrays.t - arrays.t[0]
    dates = np.datetime64("2026-03-29T01:59:59", "ns") + (since * 1e9).round().astype("timedelta64[ns]")
    abroad = pandas.DatetimeIndex(dates).tz_localize("UTC").tz_convert("Europe/Berlin")
    for t in (dates, pandas.Series(dates), abroad, dates - dates[0], dates.astype("datetime64[us]")):
        rec = mimu.Recording(t, arrays.gyro, arrays.accel, **given)
        np.testing.assert_allclose(rec.t, since, atol=1e-6)
    table = pandas.DataFrame(arrays.gyro, index=abroad, columns=["gx", "gy", "gz"])
    assert np.array_equal(mimu.Recording(gyro=table, **given).t, mimu.Recording(abroad, table, **given).t)
    by_rate = mimu.Recording(gyro=arrays.gyro, rate_hz=50.0, **given)
    assert by_rate.t[1] == 0.02 and len(by_rate) == len(arrays)


def test_a_result_or_its_file_is_taken_for_what_it_gives(arrays: mimu.Recording, tmp_path: Path) -> None:
    rows = np.hstack([arrays.gyro[:1], arrays.accel[:1]]) + np.random.default_rng(3).normal(size=(6000, 6))
    still = mimu.Recording(None, rows[:, :3], rows[:, 3:], unit="count", gravity=9.80665, rate_hz=50.0, device=arrays.device)
    noise, fit = mimu.allan(still), mimu.fit(arrays)
    noise.save(tmp_path / "noise.toml")
    fit.save(tmp_path / "cal.toml")
    expected = mimu.fit(arrays, noise=noise.noise).to_dict()["sensors"]
    assert expected != fit.to_dict()["sensors"]
    for given in (noise, tmp_path / "noise.toml", str(tmp_path / "noise.toml")):
        assert mimu.fit(arrays, noise=given).to_dict()["sensors"] == expected
    expected = mimu.allan(still, calibration=fit.calibration).to_dict()
    for given in (fit, tmp_path / "cal.toml", str(tmp_path / "cal.toml")):
        assert mimu.allan(still, calibration=given).to_dict()["channels"] == expected["channels"]


def test_any_layout_is_read_as_the_same_numbers(arrays: mimu.Recording) -> None:
    expected = mimu.fit(arrays).to_dict()
    fortran = {name: np.asfortranarray(getattr(arrays, name)) for name in ("gyro", "accel")}
    backwards = {name: np.ascontiguousarray(getattr(arrays, name)[::-1])[::-1] for name in ("gyro", "accel")}
    for layout in (fortran, backwards):
        rec = mimu.Recording(arrays.t, **layout, unit="count", gravity=9.80665, rate_hz=arrays.rate_hz, device=arrays.device)
        assert mimu.fit(rec).to_dict() == expected


def test_a_fit_copies_no_array_whole(chamber: ModuleType) -> None:
    # numpy's memory is traced, that of the compiled part is not. The test searches for a copy that Python holds.
    rec = mimu.Recording(**chamber.session().keywords())
    tracemalloc.start()
    mimu.fit(rec)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < rec.gyro.nbytes, f"{peak} bytes at the highest"


def test_compensated_arrays_follow_the_formula(arrays: mimu.Recording) -> None:
    fit = mimu.fit(arrays)
    gyro, accel = fit.apply(arrays.gyro, arrays.accel)
    for clean, raw, sensor in ((gyro, arrays.gyro, fit.gyro), (accel, arrays.accel, fit.accel)):
        np.testing.assert_allclose(clean, raw @ sensor.C.T + sensor.o, rtol=1e-12, atol=1e-12)
    assert fit.apply(accel=arrays.accel)[0] is None
    at_rest = np.linalg.norm(accel[:50], axis=1).mean()
    assert at_rest == pytest.approx(9.80665, abs=0.05)


def test_arrays_are_applied_in_the_units_that_the_recording_was_given(arrays: mimu.Recording) -> None:
    rate, force = mimu.fit(arrays).apply(arrays.gyro, arrays.accel)
    given = (np.degrees(rate), force / 9.80665)
    rec = mimu.Recording(arrays.t, *given, units="deg/s,g", gravity=9.80665, rate_hz=arrays.rate_hz)
    fit = mimu.fit(rec)
    assert rec.gyro is not None
    np.testing.assert_allclose(rec.gyro, rate, rtol=1e-12, atol=1e-15)
    expected = [si @ triad.C.T + triad.o for si, triad in ((rate, fit.gyro), (force, fit.accel))]
    for calibration in (fit, fit.calibration, pickle.loads(pickle.dumps(fit.calibration))):
        for clean, right in zip(calibration.apply(*given), expected, strict=True):
            np.testing.assert_allclose(clean, right, rtol=1e-9, atol=1e-9)
        in_si = calibration.apply(rate, force, units="rad/s,m/s2")
        np.testing.assert_allclose(in_si[0], expected[0], rtol=1e-9, atol=1e-9)
        with pytest.raises(mimu.Error, match="times gravity in deg/s,g"):
            calibration.apply(rate, force)


def test_columns_of_a_table_are_known_by_their_names(arrays: mimu.Recording) -> None:
    pandas = pytest.importorskip("pandas")
    gyro = pandas.DataFrame(arrays.gyro, columns=["gx", "gy", "gz"])[["gz", "gx", "gy"]]
    rec = mimu.Recording(arrays.t, gyro, arrays.accel, unit="count", gravity=9.80665, rate_hz=arrays.rate_hz)
    assert np.array_equal(rec.gyro, arrays.gyro)
    fit = mimu.fit(arrays)
    clean = fit.apply(gyro)[0]
    assert list(clean.columns) == ["gx", "gy", "gz"]
    assert np.array_equal(clean.to_numpy(), fit.apply(arrays.gyro)[0])


def test_the_truth_of_a_unit_in_a_chamber_is_found(chamber: ModuleType) -> None:
    session = chamber.session(seed=2)
    fit = mimu.thermal.fit(mimu.Recording(**session.keywords()))
    assert fit.verdict == "fitted"
    lag = fit.sensors["gyro"].lag_s
    assert lag is not None and lag.lower < chamber.LAG_S < lag.upper
    for axis, name in enumerate("xyz"):
        curve = fit.curves[f"gyro_bias_{name}"]
        truth = chamber.gyro_bias(curve.temp_c)[:, axis]
        half = 0.5 * (curve.upper - curve.lower)
        # At 33 temperatures of a smooth curve the errors are correlated: three intervals contain each of them.
        assert np.all(np.abs(curve.value - truth) < 3 * half), name
    clean = fit.calibration.apply(mimu.Recording(**session.keywords()))
    for values, known in zip(clean, (np.radians(session.ref_rate_dps), session.ref_force_mps2), strict=True):
        error = (values - known)[session.step >= 0]
        assert np.abs(np.nanmean(error, axis=0)).max() < 2e-3


def test_a_calibration_over_temperature_refuses_bare_arrays(chamber: ModuleType) -> None:
    session = chamber.session()
    calibration = mimu.thermal.fit(mimu.Recording(**session.keywords())).calibration
    assert calibration.over_temperature and calibration.range_c[0] < -15 and calibration.range_c[1] > 55
    with pytest.raises(mimu.Error, match="curves over temperature; give temp and t, of each row, or a mimu.Recording"):
        calibration.apply(session.gyro, session.accel)
    warm, cold = (calibration.inverse("gyro", at)[1] for at in (50.0, -10.0))
    assert not np.array_equal(warm, cold)
