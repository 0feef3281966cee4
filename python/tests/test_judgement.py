"""Every result has a judgement, the one of the command, and a suspect one is a warning of Python."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import mimu

KINDS = {"good", "untested", "suspect", "unexplained", "misfit"}


def test_every_result_has_the_judgement_of_its_json(by_hand: mimu.Recording, at_rest: mimu.Recording) -> None:
    fit = mimu.fit(by_hand)
    results: list[Any] = [fit, mimu.diagnose(by_hand), mimu.verify(by_hand, fit.calibration), mimu.allan(at_rest)]
    for result in results:
        assert result.judgement.kind in KINDS and result.judgement.reason
        assert result.to_dict()["judgement"] == {"kind": result.judgement.kind, "reason": result.judgement.reason}
        assert isinstance(result.warnings, list)
    # The recording of the calibration cannot contradict it.
    assert results[2].judgement.kind == "untested"


def test_times_in_milliseconds_are_warned_of_and_make_the_fit_suspect(by_hand: mimu.Recording) -> None:
    made = {}
    for name, times in [("s", by_hand.t), ("ms", 1e3 * by_hand.t)]:
        made[name] = mimu.Recording(times, by_hand.gyro, by_hand.accel, unit="count", gravity=9.80665)
    assert not made["s"].warnings and "Hz" in made["ms"].warnings[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        right = mimu.fit(made["s"])
    with pytest.warns(UserWarning, match="suspect"):
        wrong = mimu.fit(made["ms"])
    assert right.judgement.kind != "suspect" and wrong.judgement.kind == "suspect"
    # What it is about: the scale factors are a thousand times too large, with the same errors.
    assert right.gyro is not None and wrong.gyro is not None
    ratio = wrong.gyro.parameters["scale_x"].value / right.gyro.parameters["scale_x"].value
    assert abs(ratio / 1e3 - 1) < 0.01


def test_noise_of_readings_in_g_called_si_is_suspect_in_its_file_and_its_exports(at_rest: mimu.Recording) -> None:
    assert at_rest.gyro is not None and at_rest.accel is not None
    gyro, accel = np.degrees(at_rest.gyro), at_rest.accel / 9.81
    called = mimu.Recording(None, gyro, accel, unit="SI", gravity=9.81, rate_hz=100.0, device="rest")
    with pytest.warns(UserWarning, match="suspect"):
        noise = mimu.allan(called)
    assert noise.judgement.kind == "suspect"
    assert 'kind = "suspect"' in noise.to_toml()
    export = mimu.export("kalibr", noise=noise.noise, gyro_walk=1e-5, accel_walk=1e-4)
    assert "suspect" in str(export)
