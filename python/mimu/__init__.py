"""Calibration of inertial units.

    import mimu

    rec = mimu.Recording(t, gyro, accel, unit="count", gravity=9.81)   # arrays; or mimu.read("log.csv", ...)
    fit = mimu.fit(rec)
    fit.accel.C, fit.accel.sigma, fit.held_out
    rate, force = fit.apply(gyro, accel)                               # rad/s, m/s²

Readings are in V, counts or SI (``unit``). Results are in SI unless a name says otherwise (``_dps``, ``_c``). Errors are
:class:`mimu.Error`. Ctrl-C interrupts every call. The wheel brings the command ``mimu`` as well.
"""

from importlib.metadata import version as _version

from mimu import thermal
from mimu._allan import Allan, Channel, NoiseCoefficient, allan
from mimu._design import (
    CoefficientSigma, Design, NextExperiment, ParameterSigma, Shown, design, next_experiment,
)
from mimu._diagnosis import Coefficient, Diagnosis, Effect, Leftover, NotExcited, Pairs, Rejected, SensorDiagnosis, TurnPart, diagnose
from mimu._error import Error
from mimu._files import Export, SensorVerification, Verification, export, load, load_noise, verify
from mimu._fit import Dwell, Figures, Fit, Parameter, SensorFit, SessionsFit, fit, fit_sessions
from mimu._mimu import Calibration, Noise, Recording
from mimu._noise_in_use import Biases, Cause, Consistency, Density, Estimate, Mounted, Nees, NoiseInUse, noise_in_use
from mimu._recording import read
from mimu._result import Judgement, Message
from mimu._table import fit_table, fit_table_schema, not_fitted

__version__ = _version("mimu")

__all__ = [
    "Allan", "Biases", "Calibration", "Cause", "Channel", "Coefficient", "CoefficientSigma", "Consistency", "Density", "Design", "Diagnosis", "Dwell",
    "Effect", "Error", "Estimate", "Export", "Figures", "Fit", "Judgement", "Leftover", "Message", "Mounted", "Nees", "NextExperiment", "Noise",
    "NoiseCoefficient", "NoiseInUse", "NotExcited", "Pairs", "Parameter", "ParameterSigma", "Recording", "Rejected",
    "SensorDiagnosis", "SensorFit", "SensorVerification", "SessionsFit", "Shown", "TurnPart", "Verification", "allan", "design", "diagnose",
    "export", "fit", "fit_sessions", "fit_table", "fit_table_schema", "load", "load_noise", "next_experiment", "noise_in_use", "not_fitted", "read",
    "thermal", "verify",
]
