//! The calibration that results from a fit.

use mimu_core::table::is_temperature;
use nalgebra::{Matrix3, Vector3};

use super::body::BodyTriad;
use super::{
    Calibration, FORMULA, ForwardTable, INVERSE_DIRECTION, Judged, Origin, PhysicalTable,
    TriadTable,
};
use crate::effects::fitted::FittedEffect;
use crate::fit::{Fit, SensorFit};
use crate::judgement::Judgement;
use crate::quantity::{PerSensor, Sensor, inverse_names, rounded};
use crate::signal::blocks::extent;
use crate::triad::{Angles, Covariance, Estimate, Forward, Physical, Triad};
use mimu_recording::{Manifest, RawUnit, Reference, Result};

/// Digits of standard deviations and intervals.
const SIGMA_DIGITS: usize = 4;
/// Digits of error figures.
pub const FIGURE_DIGITS: usize = 7;

impl Calibration {
    /// The calibration of `fit`, made at `created` (RFC 3339). The fit is of readings without `effects`; the calibration stores their lasting part.
    ///
    /// # Errors
    /// An effect that cannot be removed, as when its sensor is not calibrated.
    pub fn of(fit: &Fit, effects: &[FittedEffect], created: &str) -> Result<Self> {
        // Their standard deviations have as many digits as those of the triads.
        let lasting = effects
            .iter()
            .map(|e| e.lasting().with_digits(SIGMA_DIGITS));
        let triad = |sensor| fit.sensor(sensor).map(|found| table(fit, found));
        let mut calibration = Self {
            gyro: triad(Sensor::Gyro),
            accel: triad(Sensor::Accel),
            effects: lasting.collect(),
            ..Self::without_triads(&fit.prepared.manifest, Judgement::of_fit(fit), created)
        };
        let recording = &mut calibration.recording;
        recording.temp_c = mean_temperature(fit);
        let range_c = extent(temperatures(fit));
        recording.temp_range_c = recording.temp_c.map(|_| range_c);
        // A recording in memory has none.
        let sha256 = &fit.prepared.condensed.sha256;
        recording.sha256 = Some(sha256.clone()).filter(|sha| !sha.is_empty());
        let place = format!("calibration of {:?}", calibration.device);
        calibration.checked(&place)
    }

    /// The calibration of these triads and further ones; a gyro or an accelerometer without a table is taken as it reads.
    ///
    /// # Errors
    /// There is none.
    pub fn of_body(
        manifest: &Manifest,
        triads: PerSensor<Option<TriadTable>>,
        body: Vec<BodyTriad>,
        judgement: Judgement,
        created: &str,
    ) -> Result<Self> {
        let calibration = Self {
            gyro: triads.gyro,
            accel: triads.accel,
            body,
            ..Self::without_triads(manifest, judgement, created)
        };
        let place = format!("calibration of {:?}", calibration.device);
        calibration.checked(&place)
    }

    fn without_triads(manifest: &Manifest, judgement: Judgement, created: &str) -> Self {
        let recording = Origin {
            reference: Some(manifest.reference),
            gravity_mps2: Some(manifest.gravity_mps2),
            clock: manifest.clock,
            ..Origin::of(manifest.raw_unit)
        };
        Self {
            unit_id: manifest.unit_id().map(str::to_owned),
            created: Some(created.into()),
            judgement: Some(judgement),
            sensors: manifest.sensors().cloned(),
            ..Self::empty(&manifest.device, recording)
        }
    }
}

/// Temperatures of the dwells, °C, as far as they are known.
fn temperatures(fit: &Fit) -> impl Iterator<Item = f64> {
    let dwells = fit.prepared.dwells.list.iter();
    dwells.map(|d| d.temp_c).filter(|t| is_temperature(*t))
}

/// Their mean, if any is known.
pub(super) fn mean_temperature(fit: &Fit) -> Option<f64> {
    let mean = temperatures(fit).sum::<f64>() / temperatures(fit).count() as f64;
    mean.is_finite().then_some(mean)
}

fn table(fit: &Fit, found: &SensorFit) -> TriadTable {
    let frame = match (fit.prepared.manifest.reference, found.sensor) {
        (Reference::Table, _) => "body: the axes of the ref_ columns",
        (Reference::TurntableRate, Sensor::Gyro) => {
            "body: x along the gyro's x, xy plane through its y"
        }
        (Reference::Gravity | Reference::TurntableRate, Sensor::Accel) => {
            "body: x along the accelerometer's x, xy plane through its y"
        }
        (Reference::Gravity, Sensor::Gyro) => {
            "body: the accelerometer's (x along its x, xy plane through its y)"
        }
    };
    let judged = Judged {
        estimator: fit.estimator(found.sensor).into(),
        figure: found.figure.description().into(),
        unit: found.figure.unit(found.sensor).into(),
        rms: rounded(found.rms(), FIGURE_DIGITS),
        held_out_rms: found.held_out_rms().map(|r| rounded(r, FIGURE_DIGITS)),
        noise_floor: Some(found.noise_floor())
            .filter(|floor| !floor.is_nan())
            .map(|floor| rounded(floor, FIGURE_DIGITS)),
        dwells: found.dwells,
        condition: rounded(found.estimated.condition, SIGMA_DIGITS + 1),
    };
    let raw_unit = fit.prepared.manifest.raw_unit;
    let removal = fit.prepared.bias_removal;
    let removal = removal.filter(|_| found.sensor == Sensor::Gyro);
    TriadTable {
        bias_removed: removal.map(|r| r.to_string()),
        ..triad_table(
            &found.estimated.triad,
            found.sensor,
            raw_unit,
            frame,
            judged,
        )
    }
}

/// The table of a triad whose axes are those of `frame`.
pub fn triad_table(
    triad: &Triad,
    sensor: Sensor,
    raw_unit: RawUnit,
    frame: &str,
    judged: Judged,
) -> TriadTable {
    let estimates = triad.inverse_estimates();
    let covariance = &triad.inverse_covariance;
    let physical = triad.physical(Angles::Exact);
    let sigmas = |i: usize| rounded(estimates[i].sigma, SIGMA_DIGITS);
    let intervals = |i: usize| rounded(estimates[i].interval, SIGMA_DIGITS);
    let degrees = 1f64.to_degrees();
    let exact = exact_table(triad, sensor, raw_unit, frame);
    TriadTable {
        sigma_C: Some([0, 3, 6].map(|i| [i, i + 1, i + 2].map(sigmas))),
        sigma_o: Some([9, 10, 11].map(sigmas)),
        interval_C: Some([0, 3, 6].map(|i| [i, i + 1, i + 2].map(intervals))),
        interval_o: Some([9, 10, 11].map(intervals)),
        parameters: inverse_names().into(),
        covariance: nested(covariance),
        // Noise alone: the key would repeat the covariance.
        covariance_by_noise: match triad.is_by_noise() {
            true => Vec::new(),
            false => nested(&triad.known_covariance()),
        },
        judged: Some(judged),
        physical: PhysicalTable {
            sigma_scale_factor: Some(sigmas_of(&physical.scale, 1.0)),
            sigma_bias: Some(sigmas_of(&physical.bias, 1.0)),
            sigma_misalignment_deg: Some(sigmas_of(&physical.misalignment, degrees)),
            sigma_non_orthogonality_deg: Some(sigmas_of(&physical.non_orthogonality, degrees)),
            ..exact.physical
        },
        ..exact
    }
}

/// The table of a triad whose uncertainty is unknown.
pub(super) fn exact_table(
    triad: &Triad,
    sensor: Sensor,
    raw_unit: RawUnit,
    frame: &str,
) -> TriadTable {
    TriadTable {
        formula: FORMULA.into(),
        direction: INVERSE_DIRECTION.into(),
        raw_unit,
        unit: sensor.unit().into(),
        frame: frame.into(),
        C: by_rows(&triad.inverse.matrix),
        o: plain(&triad.inverse.offset),
        bias_removed: None,
        sigma_C: None,
        sigma_o: None,
        interval_C: None,
        interval_o: None,
        parameters: Vec::new(),
        covariance: Vec::new(),
        covariance_by_noise: Vec::new(),
        judged: None,
        next_power_on: None,
        forward: forward_table(&triad.forward),
        physical: physical_table(&triad.physical(Angles::Exact)),
    }
}

/// A covariance as the file holds it.
pub(super) fn nested(covariance: &Covariance) -> Vec<Vec<f64>> {
    let row = |i| (0..12).map(|j| covariance[(i, j)] + 0.0).collect();
    (0..12).map(row).collect()
}

/// A standard deviation or an interval with the digits that it has in files.
pub(super) fn uncertainty(value: f64) -> f64 {
    rounded(value, SIGMA_DIGITS)
}

/// The forward model.
pub(super) fn forward_table(forward: &Forward) -> ForwardTable {
    ForwardTable {
        formula: "u = P x + b".into(),
        direction: "SI to raw".into(),
        P: by_rows(&forward.matrix),
        b: plain(&forward.bias),
    }
}

/// Physical quantities without their sigmas.
pub(super) fn physical_table(physical: &Physical) -> PhysicalTable {
    let degrees = 1f64.to_degrees();
    PhysicalTable {
        formula: "P = K Mo Mp, Mp = Rz Ry Rx by the misalignments, rows of Mo of unit length"
            .into(),
        scale_factor: values(&physical.scale, 1.0),
        sigma_scale_factor: None,
        bias: values(&physical.bias, 1.0),
        sigma_bias: None,
        misalignment_deg: values(&physical.misalignment, degrees),
        sigma_misalignment_deg: None,
        non_orthogonality_deg: values(&physical.non_orthogonality, degrees),
        sigma_non_orthogonality_deg: None,
    }
}

// Adding 0.0 makes minus zero, which only puzzles, zero.

pub(super) fn by_rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| matrix[(i, j)] + 0.0))
}

fn plain(vector: &Vector3<f64>) -> [f64; 3] {
    [0, 1, 2].map(|i| vector[i] + 0.0)
}

fn values(triple: &[Estimate; 3], unit: f64) -> [f64; 3] {
    triple.map(|e| e.value * unit + 0.0)
}

fn sigmas_of(triple: &[Estimate; 3], unit: f64) -> [f64; 3] {
    triple.map(|e| rounded(e.sigma * unit, SIGMA_DIGITS))
}
