"""What users of Python bring and expect: tables, plots, units, slices, pickles and other processes."""

from __future__ import annotations

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType

import matplotlib
import mimu
import numpy as np
import pandas as pd
import pint
import pytest
from conftest import EXAMPLE

matplotlib.use("Agg")


def test_columns_of_one_table_are_a_recording(arrays: mimu.Recording) -> None:
    log = np.column_stack([arrays.t, arrays.gyro, arrays.accel])
    rec = mimu.Recording(log[:, 0], log[:, 1:4], log[:, 4:7], unit="count", gravity=9.80665, rate_hz=arrays.rate_hz, device=arrays.device)
    assert mimu.fit(rec).to_dict() == mimu.fit(arrays).to_dict()
    assert mimu.Recording(log[:, 0], log[:, 1:4], log[:, 4:7], unit="count").rate_hz == pytest.approx(arrays.rate_hz, rel=1e-6)


def test_units_are_converted_as_the_command_converts_them(arrays: mimu.Recording, tmp_path: Path) -> None:
    calibration = mimu.fit(arrays).calibration
    rate, force = calibration.apply(arrays.gyro, arrays.accel)
    rec = mimu.Recording(arrays.t, np.degrees(rate), force / 9.80665, units="deg/s,g", gravity=9.80665)
    assert rec.unit == "SI"
    np.testing.assert_allclose(rec.gyro, rate, rtol=1e-14)
    np.testing.assert_allclose(rec.accel, force, rtol=1e-14)
    with pytest.raises(mimu.Error, match="the unit of the gyro is not given"):
        mimu.Recording(arrays.t, rate, force, units="g")
    with pytest.raises(mimu.Error, match="say the same"):
        mimu.Recording(arrays.t, rate, units="rad/s,m/s2", unit="SI")
    with pytest.raises(mimu.Error, match="unit of the readings is not given"):
        mimu.Recording(arrays.t, rate, force)


def test_arrays_with_a_meaning_of_their_own_are_refused_by_name(arrays: mimu.Recording) -> None:
    masked = np.ma.masked_less(arrays.gyro, 0)
    with pytest.raises(mimu.Error, match="gyro: it is a masked array"):
        mimu.Recording(arrays.t, masked, unit="count")
    quantity = pint.UnitRegistry().Quantity(arrays.accel, "m/s^2")
    with pytest.raises(mimu.Error, match=r"accel: it carries the unit meter / second"):
        mimu.Recording(arrays.t, arrays.gyro, quantity, unit="SI")


def test_a_slice_is_a_recording_of_the_same_unit(arrays: mimu.Recording, by_hand: mimu.Recording) -> None:
    for rec in (arrays, by_hand):
        part = rec[500:-100]
        assert len(part) == len(rec) - 600 and part.device == rec.device and part.unit == rec.unit
        assert np.array_equal(part.gyro, rec.gyro[500:-100]) and part.t[0] == rec.t[500]
        assert mimu.fit(part).accel is not None
    with pytest.raises(mimu.Error, match="changes the sample rate"):
        arrays[::2]


def test_a_table_of_pandas_stays_one(arrays: mimu.Recording) -> None:
    fit = mimu.fit(arrays)
    log = pd.DataFrame(arrays.gyro, columns=["gx", "gy", "gz"], index=arrays.t)
    rate, _ = fit.apply(log)
    assert list(rate.columns) == ["gx", "gy", "gz"] and rate.index.equals(log.index)
    np.testing.assert_array_equal(rate.to_numpy(), fit.apply(arrays.gyro)[0])
    samples = arrays.to_dataframe()
    assert list(samples.columns) == ["t_s", *(f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz")] and len(samples) == len(arrays)
    back = mimu.Recording(samples["t_s"], samples[["gyro_x", "gyro_y", "gyro_z"]], unit="count")
    assert np.array_equal(back.gyro, arrays.gyro)


def test_results_are_tables(arrays: mimu.Recording, at_rest: mimu.Recording, chamber: ModuleType) -> None:
    fit = mimu.fit(arrays)
    table = fit.to_dataframe().set_index(["sensor", "parameter"])
    assert table.loc[("accel", "scale_x"), "value"] == fit.accel.parameters["scale_x"].value
    noise = mimu.allan(at_rest)
    curves = noise.to_dataframe()
    assert set(curves["channel"]) == {c.name for c in noise.channels} and len(curves) == sum(len(c.tau_s) for c in noise.channels)
    thermal = mimu.thermal.fit(mimu.Recording(**chamber.session().keywords()))
    assert set(thermal.to_dataframe()["parameter"]) == set(thermal.curves)
    assert list(mimu.diagnose(arrays).to_dataframe().columns)[0] == "effect"


def test_results_are_drawn_on_axes(arrays: mimu.Recording, at_rest: mimu.Recording, chamber: ModuleType) -> None:
    from matplotlib import pyplot

    axes = pyplot.subplots(2, 2)[1].ravel()
    fit = mimu.fit(arrays)
    thermal = mimu.thermal.fit(mimu.Recording(**chamber.session().keywords()))
    drawn = [fit.plot(ax=axes[0]), fit.plot("gyro", axes[1]), mimu.allan(at_rest).plot(ax=axes[2]), thermal.plot("gyro_bias_x", axes[3])]
    assert drawn == list(axes)
    assert all(ax.get_lines() and ax.get_xlabel() and ax.get_ylabel() for ax in axes)
    assert len(axes[0].get_lines()[0].get_ydata()) == len(fit.accel.residuals)
    with pytest.raises(ValueError, match="has no gyro"):
        mimu.fit(arrays, only="accel").plot("gyro")
    pyplot.close("all")


def test_a_fit_says_how_its_parameters_depend_on_each_other(arrays: mimu.Recording) -> None:
    fit = mimu.fit(arrays)
    for sensor in (fit.gyro, fit.accel):
        sigma = np.sqrt(np.diag(sensor.covariance))
        np.testing.assert_allclose(sigma[:9].reshape(3, 3), sensor.sigma, rtol=1e-6)
        np.testing.assert_allclose(sigma[9:], sensor.sigma_o, rtol=1e-6)
        np.testing.assert_allclose(sensor.covariance, sensor.covariance.T, rtol=1e-9, atol=0)
    # An offset at 400 counts from the middle of the readings goes with the scale factor.
    assert abs(fit.accel.covariance[0, 9]) > 0
    assert len(fit.accel.residuals) == fit.accel.dwells and fit.accel.residuals[0].value.shape == (3,)
    assert all(problem.kind and problem.text for problem in fit.problems)


def test_a_result_stands_for_its_calibration_and_its_noise(arrays: mimu.Recording, at_rest: mimu.Recording, tmp_path: Path) -> None:
    fit, noise = mimu.fit(arrays), mimu.allan(at_rest)
    assert mimu.verify(arrays, fit).to_dict() == mimu.verify(arrays, fit.calibration).to_dict()
    assert mimu.export("c", calibration=fit).content == mimu.export("c", calibration=fit.calibration).content
    assert mimu.export("kalibr", noise=noise).content == mimu.export("kalibr", noise=noise.noise).content
    fit.save(tmp_path / "cal.toml")
    noise.save(tmp_path / "noise.toml")
    assert mimu.load(tmp_path / "cal.toml").to_toml() == fit.to_toml() and mimu.load_noise(tmp_path / "noise.toml").device == "rest"
    with pytest.raises(mimu.Error, match="this is a noise file"):
        mimu.load(tmp_path / "noise.toml")


def test_a_calibration_over_temperature_takes_arrays_with_their_temperatures(chamber: ModuleType) -> None:
    session = chamber.session()
    rec = mimu.Recording(**session.keywords())
    calibration = mimu.thermal.fit(rec).calibration
    expected = calibration.apply(rec)
    given = calibration.apply(rec.gyro, rec.accel, temp=rec.temp_c, t=rec.t)
    for one, other in zip(given, expected, strict=True):
        np.testing.assert_array_equal(one, other)


def _fitted(rec: mimu.Recording) -> mimu.Fit:
    return mimu.fit(rec)


def test_recordings_and_results_go_to_other_processes_and_back(
    arrays: mimu.Recording, by_hand: mimu.Recording, at_rest: mimu.Recording
) -> None:
    logs = mimu.read(EXAMPLE / "accel.txt", EXAMPLE / "gyro.txt", columns=["t_s,accel_x,accel_y,accel_z", "t_s,gyro_x,gyro_y,gyro_z"],
                     raw_unit="count", gravity=9.80665, device="by-hand")
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        there = list(pool.map(_fitted, [arrays, by_hand, logs]))
    here = [mimu.fit(rec) for rec in (arrays, by_hand, logs)]
    for one, other in zip(there, here, strict=True):
        assert one.to_dict() == other.to_dict() and str(one) == str(other)
        # But for the time at which it was made.
        ours, theirs = ([line for line in fit.to_toml().splitlines() if not line.startswith("created")] for fit in (one, other))
        assert ours == theirs
        assert np.array_equal(one.accel.covariance, other.accel.covariance)
    for result in (mimu.diagnose(arrays), mimu.allan(at_rest), mimu.design(n=6), mimu.verify(arrays, here[0]), mimu.export("json", calibration=here[0])):
        back = pickle.loads(pickle.dumps(result))
        assert back.to_dict() == result.to_dict() and str(back) == str(result)
    measured = mimu.allan(at_rest)
    noise = measured.noise
    assert pickle.loads(pickle.dumps(noise)).to_toml() == noise.to_toml()
    assert pickle.loads(pickle.dumps(measured)).noise.to_dict()["channel"] == noise.to_dict()["channel"]


def test_messages_name_keywords_and_no_options(arrays: mimu.Recording, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    np.savetxt(log, np.column_stack([arrays.gyro, arrays.accel])[:500], delimiter=",", header="gx,gy,gz,ax,ay,az", comments="")
    with pytest.raises(mimu.Error) as caught:
        mimu.read(log)
    assert "rate_hz" in str(caught.value) and "--" not in str(caught.value)
    with pytest.raises(ValueError, match="separator") as wrong:
        mimu.read(log, rate_hz=50, separator="nothing at all")
    assert isinstance(wrong.value, mimu.Error) and "--" not in str(wrong.value)
