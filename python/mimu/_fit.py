"""A fit of both triads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from mimu import _mimu, _plot
from mimu._arguments import NoiseLike, Path, arguments, kept, noise_of, several
from mimu._error import Error
from mimu._mimu import Recording
from mimu._result import Array, GivesCalibration, Message, typed

Steps = Literal["given", "found"]
Sensor = Literal["gyro", "accel"]
Keep = Literal["all"] | Sequence[int]


@dataclass(frozen=True)
class Parameter:
    """A parameter with its uncertainty."""

    name: str
    value: float
    #: Standard deviation.
    sigma: float
    #: Ends of the 95 % interval.
    lower: float
    upper: float
    #: Unit of these four.
    unit: str


@dataclass(frozen=True)
class Dwell:
    """A time in which pose and rate are constant."""

    step: int
    label: str | None
    first_row: int
    rows: int
    start_s: float
    duration_s: float
    temp_c: float
    #: Gyro x, y, z, accelerometer x, y, z, in the unit of the readings.
    raw_mean: Array
    #: Why it is not used for the sensor; None if it is.
    gyro_not_used: str | None
    accel_not_used: str | None


@dataclass(frozen=True)
class Figures:
    """Errors of a sensor, root mean square."""

    #: On data held out of the fit; None if nothing was held out.
    held_out_rms: float | None
    #: On the fitted data.
    rms: float
    #: What noise alone would give.
    noise_floor: float
    unit: str
    #: The quantity whose errors these are.
    figure: str


@dataclass(frozen=True)
class Residual:
    """What the calibration leaves of one dwell or turn, SI."""

    #: Dwell, or that in which the turn ends.
    step: int
    #: Of x, y, z; that of a magnitude is the first.
    value: Array
    #: The same by a fit without it; None if nothing was held out.
    held_out: Array | None
    #: Standard deviation by noise alone.
    floor: float


@dataclass(frozen=True)
class Problem:
    """What is wrong with a recording."""

    #: As in ``"gaps"`` or ``"clipping"``.
    kind: str
    #: The sentence.
    text: str


@dataclass(frozen=True)
class SensorFit:
    """The calibration of one triad: ``x = C @ u + o``, raw to SI."""

    #: SI per raw unit.
    C: Array
    #: SI.
    o: Array
    #: Standard deviations of ``C``, and of ``o``.
    sigma: Array
    sigma_o: Array
    #: By name: ``C_xx`` to ``o_z``, and ``scale_x``, ``bias_x``, ``misalignment_x``, ``non_orthogonality_yz`` and so on.
    parameters: dict[str, Parameter]
    #: Of the nine elements of ``C`` by rows, then the three of ``o``: shape (12, 12), SI.
    covariance: Array
    #: One for every dwell or turn that was used.
    residuals: list[Residual]
    estimator: str
    held_out_rms: float | None
    rms: float
    noise_floor: float
    #: Unit of the three errors.
    unit: str
    #: The quantity whose errors these are.
    figure: str
    #: Dwells used.
    dwells: int
    #: Condition number of the experiment.
    condition: float
    #: For gyros with unknown input: errors at rest, rad/s.
    static_rms: float | None
    static_held_out_rms: float | None

    @staticmethod
    def _of(data: dict[str, Any], covariance: list[float]) -> SensorFit:
        # The first twelve parameters are C, by rows, and o.
        value, sigma = (np.array([p[key] for p in data["parameters"][:12]], dtype=float) for key in ("value", "sigma"))
        own = {
            "C": value[:9].reshape(3, 3), "o": value[9:], "sigma": sigma[:9].reshape(3, 3), "sigma_o": sigma[9:],
            "covariance": np.array(covariance, dtype=float).reshape(12, 12),
            "parameters": {p["name"]: p for p in data["parameters"]},
        }
        return typed(SensorFit, {**data, **own})


class Fit(GivesCalibration):
    """A calibration of a recording, judged on data held out of the fit."""

    _native: _mimu.Fit
    _questions = ("json", "text", "html", "calibration", "covariance")

    #: The triads; None if the recording has no such sensor.
    gyro: SensorFit | None
    accel: SensorFit | None
    #: By sensor, the errors. Quote ``held_out_rms``.
    held_out: dict[str, Figures]
    #: All dwells, used or not.
    dwells: list[Dwell]
    #: What is wrong with the recording, one for each kind.
    problems: list[Problem]
    #: Warnings, one sentence each, with its ``kind``.
    warnings: list[Message]

    def _fill(self, data: dict[str, Any]) -> None:
        sensors, covariance = data["sensors"], dict(self._native.covariance())
        self.gyro, self.accel = (SensorFit._of(sensors[s], covariance[s]) if s in sensors else None for s in ("gyro", "accel"))
        self.held_out = {name: typed(Figures, sensor) for name, sensor in sensors.items()}
        self.problems = [typed(Problem, {"kind": p["id"], "text": p["text"]}) for p in data["recording_problems"]]

    @overload
    def apply(self, gyro: ArrayLike, accel: ArrayLike, *, units: str | None = None) -> tuple[Array, Array]: ...
    @overload
    def apply(self, gyro: ArrayLike, accel: None = None, *, units: str | None = None) -> tuple[Array, None]: ...
    @overload
    def apply(self, gyro: None = None, *, accel: ArrayLike, units: str | None = None) -> tuple[None, Array]: ...
    @overload
    def apply(self, gyro: Recording) -> tuple[Array | None, Array | None]: ...

    def apply(self, gyro: Any = None, accel: Any = None, *, units: str | None = None) -> Any:
        """Compensated readings in rad/s and m/s², a row for each sample.

        Parameters
        ----------
        gyro : array_like of shape (n, 3), DataFrame or Recording, optional
            Readings in the unit of the recording. A :class:`mimu.Recording` stands for both sensors.
        accel : array_like of shape (n, 3) or DataFrame, optional
            Readings in the unit of the recording.
        units : str, optional
            Units of gyro and accel, such as ``deg/s,g``; by default those that the recording was given.

        Returns
        -------
        tuple of two arrays of shape (n, 3)
            Rates in rad/s and specific forces in m/s², with None for a sensor that was not given. A DataFrame stays one, with its index and columns.

        Examples
        --------
        >>> rate, force = fit.apply(gyro, accel)
        """
        return self.calibration.apply(gyro, accel, units=units)

    def to_dataframe(self) -> Any:
        """The parameters as a table of pandas: a row for each, with ``sensor``, ``parameter``, ``value``, ``sigma``, ``lower``, ``upper`` and ``unit``."""
        import pandas

        rows = [
            {"sensor": sensor, "parameter": p.name, "value": p.value, "sigma": p.sigma, "lower": p.lower, "upper": p.upper, "unit": p.unit}
            for sensor, fit in (("gyro", self.gyro), ("accel", self.accel)) if fit is not None for p in fit.parameters.values()
        ]
        return pandas.DataFrame(rows)

    def plot(self, sensor: Sensor = "accel", ax: Any = None) -> Any:
        """The residual of each dwell or turn with the noise that is due, on axes of matplotlib.

        ``sensor`` is ``"gyro"`` or ``"accel"``. Draws on ``ax``, or on axes of its own, and returns them.
        """
        of = getattr(self, sensor)
        if of is None:
            raise Error.of("sensor", f"the fit has no {sensor}", "give one that was fitted")
        ax = _plot.axes(ax)
        at = np.arange(len(of.residuals))
        held = [r.held_out is not None for r in of.residuals]
        size = [float(np.linalg.norm(r.held_out if r.held_out is not None else r.value)) for r in of.residuals]
        ax.plot(at, size, "o", label="held out" if all(held) and held else "residual")
        ax.plot(at, [r.floor for r in of.residuals], "_", color="0.5", label="noise")
        # A label for each is unreadable beyond a few dozen.
        every = max(1, len(at) // 20)
        ax.set_xticks(at[::every], [str(r.step) for r in of.residuals][::every])
        ax.set(xlabel="dwell", ylabel=f"error of the {sensor}, {of.unit}", yscale="log")
        ax.legend()
        return ax

    def __repr__(self) -> str:
        return f"<mimu.Fit of {self.device!r}: held out " + ", ".join(
            f"{name} {f.held_out_rms if f.held_out_rms is not None else f.rms:.4g} {f.unit}" for name, f in self.held_out.items()
        ) + ">"


def fit(
    recording: Recording,
    *,
    holdout: int = 4,
    only: Sensor | None = None,
    still: float | None = None,
    steps: Steps | None = None,
    keep: Keep | None = None,
    noise: NoiseLike | None = None,
    prior: Path | None = None,
    whole_turns: int | bool = False,
    placement: float | None = None,
    reference_error: Path | None = None,
    part: Path | None = None,
    field: float | None = None,
) -> Fit:
    """Calibrates the gyro and the accelerometer of a recording, and the further triads if it has any, as ``mimu fit`` does.

    Parameters
    ----------
    recording : Recording
        Dwells at rest in several poses, with turns between them for the gyro; or dwells with known inputs.
    holdout : int
        Blocks of time that are left out in turn, so that the error on them can be reported; 0 for none.
    only : {"gyro", "accel"}, optional
        Calibrates one sensor.
    still : float, optional
        Largest variance of a dwell, as a multiple of that of the quietest times.
    steps : {"given", "found"}, optional
        Takes the dwells of the step column as they are, or searches for them.
    keep : "all" or list of int, optional
        Dwells to use although the others contradict them.
    noise : Noise, Allan or path, optional
        Noise of the unit at rest: of :func:`mimu.allan`, or a file.
    prior : path, optional
        Population of the unit's kind, as ``mimu fleet --prior`` writes it: it determines what few poses leave open.
    whole_turns : bool or int, optional
        Turns by hand that end where they began; their number, if each has the same.
    placement : float, optional
        How well the unit is put back after whole turns, degrees.
    reference_error : path, optional
        How well the true inputs are known: tilt of a table, right angles, rate, gravity.
    part : str or path, optional
        Part whose data sheet the unit is compared with: a name as ``"icm42688p"``, or a file. ``to_dict()["data_sheet"]`` has the comparison.
    field : float, optional
        Size of the Earth's field at the place, µT, for a recording with a magnetometer; without it the field counts as 1. ``to_dict()["body"]`` has the places of the
        further triads, ``to_dict()["sensors"]`` their parameters.

    Returns
    -------
    Fit
        Quote ``fit.held_out["gyro"].held_out_rms``, and look at ``fit.judgement`` first.

    Raises
    ------
    mimu.Error
        The recording does not determine the calibration; the message says what is missing.

    Examples
    --------
    >>> fit = mimu.fit(mimu.Recording(t, gyro, accel, units="deg/s,g"))
    >>> fit.judgement.kind, fit.gyro.parameters["scale_x"].value
    """
    options = dict(
        holdout=holdout, only=only, still=still, steps=steps, keep=kept(keep), prior=prior, whole_turns=whole_turns,
        placement=placement, reference_error=reference_error, part=part, field=field,
    )
    return Fit(_mimu.fit(recording, arguments(options), noise=noise_of(noise)))


class SessionsFit(GivesCalibration):
    """One calibration of several sessions of a unit, with what the next power-on makes of it."""

    _native: _mimu.SessionsFit

    #: By sensor, then by name as ``"bias_x"``: ``value`` with ``lower`` and ``upper`` of the expected value, ``next_power_on`` with the interval of tomorrow, and
    #: ``between_sigma``. As in the JSON of ``mimu fit``.
    parameters: dict[str, dict[str, dict[str, Any]]]
    #: What does not fit one set of constant parameters, in sentences.
    findings: list[str]

    def _fill(self, data: dict[str, Any]) -> None:
        self.parameters = {name: {p["name"]: p for p in sensor["parameters"]} for name, sensor in data["sensors"].items()}

    def __repr__(self) -> str:
        return f"<mimu.SessionsFit of {self.device!r}: {self.judgement}>"


def fit_sessions(
    recordings: Sequence[Recording],
    *,
    part_class: Literal["consumer", "tactical"] = "consumer",
    holdout: int = 4,
    still: float | None = None,
    steps: Steps | None = None,
    noise: NoiseLike | None = None,
    field: float | None = None,
) -> SessionsFit:
    """Makes one calibration of several sessions of a unit, as ``mimu fit S1 S2 ...`` does.

    Parameters
    ----------
    recordings : sequence of Recording
        In the order in which they took place. The unit was switched off between them.
    part_class : {"consumer", "tactical"}
        How much such parts change between power-ons: used for one or two sessions.
    holdout, still, steps, noise, field
        As for :func:`mimu.fit`.

    Returns
    -------
    SessionsFit
        Look at ``judgement`` and ``findings`` first; ``parameters["gyro"]["bias_x"]["next_power_on"]`` is the interval of tomorrow.
    """
    options = {"class": part_class, "holdout": holdout, "still": still, "steps": steps, "field": field}
    return SessionsFit(_mimu.fit_sessions(several(recordings), arguments(options), noise=noise_of(noise)))
