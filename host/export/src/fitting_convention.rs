//! Which convention of a file fits a recording of its unit.
//!
//! Programs, and versions of one, differ in the direction of a matrix, in signs, units and the order of axes, and people copy numbers from one to another. Each
//! reading of the file's numbers becomes a calibration, whose errors the recording shows ([`TriadErrors`]). A reading other than the format's own counts only if the
//! format's errs significantly more ([`TriadErrors::exceeds`]). If several fit alike, the simplest is taken, and the others are named.

use std::ops::RangeInclusive;

use mimu::calibration::Calibration;
use mimu::calibration::verify::TriadErrors;
use mimu::judge::errors::UNEXPLAINED_SHARE;
use mimu::known_size;
use mimu::prepared::Prepared;
use mimu::quantity::{self, AXES, PerSensor, Sensor, plural};
use mimu::readable::{self, STANDARD_GRAVITY};
use mimu_allan::model::Term;
use mimu_core::compensation::Affine;
use mimu_recording::error::Result;
use mimu_recording::{RawUnit, Reference};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use crate::convention::{Bias, Convention, Maps, Parts};
use crate::foreign::Foreign;
use crate::layout::nothing;

/// Iterations of the bias that a file lacks.
const STEPS: usize = 10;
/// Two readings whose numbers differ by less, relative to the largest, are one.
const SAME: f64 = 1e-9;
/// A wrong convention multiplies the error by more: where the matrix is transposed, 0.127 deg become 51. A file whose numbers are wrong errs alike however it is
/// read, and the least of so many errors says nothing.
const WRONG_READING: f64 = 2.0;
/// Gravity on Earth, m/s², from Huascarán to the Arctic Ocean (9.764 to 9.834), and the standard constant of a program anywhere.
const ON_EARTH: RangeInclusive<f64> = 9.75..=9.85;

/// How the numbers of one triad were read.
#[derive(Debug, Clone, Serialize)]
pub struct Reading {
    /// The triad.
    pub sensor: Sensor,
    /// What was changed against the convention of the format; empty if that holds.
    pub changed: String,
    /// Other readings that the recording does not distinguish from it.
    pub alike: Vec<String>,
    /// Number of readings that were tried, if all are misfits: the numbers are wrong, and no convention makes them right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub none_fits_of: Option<usize>,
    /// Whether the bias is that of the recording, as the file has none.
    pub bias_of_recording: bool,
    /// Error in the convention of the format, in `unit`; null if it gives no calibration.
    pub rms_as_declared: Option<f64>,
    /// Error as read.
    pub rms: f64,
    /// Unit of the errors.
    pub unit: &'static str,
    /// White noise of the file, the worst axis, SI per √Hz; null if it has none.
    pub file_noise: Option<f64>,
    /// White noise within the dwells of the recording, likewise.
    pub noise: Option<f64>,
    #[serde(skip)]
    readable: (f64, &'static str),
}

impl Reading {
    /// One line or two.
    pub fn text(&self, format: &str) -> String {
        let (factor, unit) = self.readable;
        let show = |rms: f64| format!("{} {unit}", mimu::quantity::significant(factor * rms));
        let (sensor, rms) = (self.sensor, show(self.rms));
        let declared = self.rms_as_declared.map_or("no error".into(), show);
        let mut text = match self.changed.as_str() {
            _ if let Some(tried) = self.none_fits_of => {
                format!("{sensor}: fits in no way of the {tried} that were tried, error {rms}")
            }
            "" => format!("{sensor}: read as {format} reads it, error {rms}"),
            changed => {
                format!("{sensor}: fits {changed}, error {rms}; as {format} reads it {declared}")
            }
        };
        if self.bias_of_recording {
            text += ". The file has no bias, so that of this recording is used";
        }
        if let [first, ..] = self.alike.as_slice() {
            let more = match self.alike.len() - 1 {
                0 => String::new(),
                more => format!(", or in {}", plural(more as u64, "further way")),
            };
            text += &format!(". Read {first}{more}, it fits as well");
        }
        if let Some((file, here)) = self.file_noise.zip(self.noise) {
            let density = format!("{}/sqrt(Hz)", self.sensor.unit());
            let shown = |n: f64| readable::noise(&density).pop().map(|unit| unit.write(n));
            text += &format!(
                "\n{sensor} white noise: {} in the file, {} on the worst axis of this recording, {:.2} times as much",
                shown(file).unwrap_or_default(),
                shown(here).unwrap_or_default(),
                here / file
            );
        }
        text + "\n"
    }
}

/// The calibration of `foreign` as it fits `prepared`, and how each triad was read.
///
/// # Errors
/// No reading gives a calibration that the recording can judge: the error is that of the format's convention.
pub fn calibration(foreign: &Foreign, prepared: &Prepared) -> Result<(Calibration, Vec<Reading>)> {
    let raw_unit = prepared.manifest.raw_unit;
    if let Some(whole) = foreign.whole() {
        return Ok((whole.clone(), Vec::new()));
    }
    let mut models: PerSensor<Option<Affine<f64>>> = PerSensor::default();
    let mut all = Vec::new();
    // Readings in SI count as calibrated where the file has nothing. The gyro is judged with the accelerometer as that was read.
    for sensor in [Sensor::Accel, Sensor::Gyro] {
        let is_si = foreign.raw_unit(raw_unit) == RawUnit::Si;
        let parts = foreign.parts[sensor].or(is_si.then(nothing));
        let Some(parts) = parts else { continue };
        let with_bias = foreign.parts[sensor].is_none() || foreign.has_bias(sensor);
        let judged = |model: &Affine<f64>| {
            let mut models = models;
            models[sensor] = Some(*model);
            let calibration = foreign.with(&models, raw_unit).ok()?;
            TriadErrors::of(prepared, &calibration, sensor)
        };
        let mut candidates = Vec::new();
        let mut gravity = None;
        let mut all_readings = readings(&foreign.format.convention, &parts, sensor);
        match (foreign.parts[sensor].is_some(), all_readings.first()) {
            (true, Some((_, own))) => {
                gravity = other_gravity(prepared, sensor, own);
                let ranges = ranges(own);
                all_readings.extend(ranges.into_iter().chain(gravity.clone()));
            }
            _ => all_readings.truncate(1),
        }
        for (changed, mut model) in all_readings {
            if !with_bias {
                model.offset = bias(prepared, sensor, &model.matrix);
            }
            if let Some(judged) = judged(&model) {
                candidates.push((changed, model, judged));
            }
        }
        let best = candidates
            .iter()
            .min_by(|a, b| merit(a).total_cmp(&merit(b)));
        let Some(best) = best else {
            models[sensor] = foreign.format.convention.inverse(&parts);
            continue;
        };
        let fits = |c: &&Candidate| !c.2.exceeds(&best.2, gain(&c.1) / gain(&best.1));
        let mut fitting = candidates.iter().filter(fits);
        let declared = candidates.iter().find(|c| c.0.is_empty());
        let size = known_size(prepared, best.2.figure);
        let most = UNEXPLAINED_SHARE * size.unwrap_or(f64::INFINITY);
        let useless = |c: &&Candidate| best.2.rms > most && c.2.rms < WRONG_READING * best.2.rms;
        let none_fits = declared.filter(useless);
        let Some((changed, model, found)) = none_fits.or_else(|| fitting.next()) else {
            continue;
        };
        models[sensor] = Some(*model);
        let noise = white(prepared, sensor, model);
        let file = foreign.density(sensor, Term::N, Some(prepared.manifest.sample_rate_hz));
        if foreign.parts[sensor].is_none() && file.is_none() {
            continue;
        }
        all.push(Reading {
            sensor,
            changed: changed.clone(),
            alike: match none_fits {
                Some(_) => Vec::new(),
                // One more free number fits as well as none.
                None => fitting
                    .map(|c| c.0.clone())
                    .filter(|way| {
                        gravity
                            .as_ref()
                            .is_none_or(|(of_gravity, _)| way != of_gravity)
                    })
                    .collect(),
            },
            none_fits_of: none_fits.map(|_| candidates.len()),
            bias_of_recording: !with_bias,
            rms_as_declared: declared.map(|c| c.2.rms),
            rms: found.rms,
            unit: found.figure.unit(sensor),
            file_noise: file.map(|file| file.into_iter().fold(0.0, f64::max)),
            noise,
            readable: found.figure.readable(sensor),
        });
    }
    Ok((foreign.with(&models, raw_unit)?, all))
}

/// A reading: what it changes, its calibration, and how this is judged.
type Candidate = (String, Affine<f64>, TriadErrors);

/// What the best reading has least of: the error, and that at rest, where a bias shows, over the gain.
fn merit((_, model, found): &Candidate) -> f64 {
    found.rms * found.static_rms.map_or(1.0, |rms| rms / gain(model))
}

/// Output for a reading: the mean over all directions.
fn gain(model: &Affine<f64>) -> f64 {
    model.matrix.determinant().abs().cbrt()
}

/// The readings of these numbers, the format's own first and the simpler ones before others, each with what it changes.
fn readings(convention: &Convention, parts: &Parts, sensor: Sensor) -> Vec<(String, Affine<f64>)> {
    let mut all: Vec<(String, Affine<f64>)> = Vec::new();
    let mut add = |changed: [&str; 2], model: Option<Affine<f64>>| {
        let Some(model) = model else { return };
        let size = model.matrix.amax();
        let is_it = |other: &Affine<f64>| {
            (other.matrix - model.matrix).amax() < SAME * size
                && (other.offset - model.offset).amax() <= SAME * model.offset.amax()
        };
        if !all.iter().any(|(_, other)| is_it(other)) {
            let changed: Vec<&str> = changed.into_iter().filter(|c| !c.is_empty()).collect();
            all.push((changed.join(" and "), model));
        }
    };
    let matrices = matrices(parts);
    let biases = biases(convention, parts, sensor);
    // One change before two.
    for both in [false, true] {
        for (k, (of_matrix, left, right)) in matrices.iter().enumerate() {
            for (l, (of_bias, convention, bias)) in biases.iter().enumerate() {
                if (k > 0 && l > 0) == both {
                    let (left, right, bias) = (*left, *right, *bias);
                    let model = convention.inverse(&Parts { left, right, bias });
                    add([of_matrix, of_bias], model);
                }
            }
        }
    }
    let Some(own) = convention.inverse(parts) else {
        return all;
    };
    let units = match sensor {
        Sensor::Gyro => ("with its output in deg/s", 1f64.to_radians()),
        Sensor::Accel => ("with its output in g", STANDARD_GRAVITY),
    };
    let scaled = |factor: f64| Affine {
        matrix: own.matrix * factor,
        offset: own.offset * factor,
    };
    add([units.0, ""], Some(scaled(units.1)));
    for (axes, turned) in orders() {
        let matrix = own.matrix * turned;
        add([&axes, ""], Some(Affine { matrix, ..own }));
    }
    all
}

/// The calibration for a range of the recording that is not that of the file. A bias in the unit of the input stays.
fn ranges(own: &Affine<f64>) -> [(String, Affine<f64>); 6] {
    [2.0, 0.5, 4.0, 0.25, 8.0, 0.125].map(|wider| {
        let matrix = own.matrix * wider;
        let changed = format!("with the range of the recording {wider} times that of the file");
        (changed, Affine { matrix, ..*own })
    })
}

/// The calibration of an accelerometer with all scale factors changed alike, as by other gravity where it was made.
fn other_gravity(
    prepared: &Prepared,
    sensor: Sensor,
    own: &Affine<f64>,
) -> Option<(String, Affine<f64>)> {
    let sizes = prepared.observations(sensor).into_iter();
    let sizes: Vec<f64> = sizes
        .map(|o| (own.matrix * o.raw + own.offset).norm())
        .collect();
    // The gravity by which the relative errors are least.
    let there = sizes.iter().map(|s| s * s).sum::<f64>() / sizes.iter().sum::<f64>();
    if sensor == Sensor::Gyro
        || prepared.manifest.reference != Reference::Gravity
        || !ON_EARTH.contains(&there)
    {
        return None;
    }
    let factor = prepared.manifest.gravity_mps2 / there;
    let percent = quantity::significant(1e2 * (1.0 / factor - 1.0).abs());
    let side = if factor < 1.0 { "large" } else { "small" };
    let changed = format!(
        "if its scale factors are {percent} % too {side} alike, as with gravity taken as {there:.4} m/s² where it was made"
    );
    let (matrix, offset) = (own.matrix * factor, own.offset * factor);
    Some((changed, Affine { matrix, offset }))
}

/// Factors of the matrix, with what is changed.
fn matrices(parts: &Parts) -> Vec<(&'static str, Matrix3<f64>, Matrix3<f64>)> {
    let one = Matrix3::identity();
    let Parts { left, right, .. } = parts;
    let product = left * right;
    let mut all = vec![
        ("", *left, *right),
        ("with its matrix transposed", product.transpose(), one),
    ];
    if let Some(inverse) = product.try_inverse() {
        all.push(("with its matrix inverted", inverse, one));
        let both = inverse.transpose();
        all.push(("with its matrix inverted and transposed", both, one));
    }
    all.push(("with its right factor transposed", *left, right.transpose()));
    all.push(("with its factors in the other order", *right, *left));
    all
}

/// The bias, with what is changed.
fn biases(
    convention: &Convention,
    parts: &Parts,
    sensor: Sensor,
) -> Vec<(&'static str, Convention, Vector3<f64>)> {
    let bias = parts.bias;
    let other = match (convention.bias, convention.maps) {
        (Bias::AddedToReadings, Maps::ToInput) => Bias::AddedToInput,
        (Bias::SubtractedFromReadings, Maps::ToInput) => Bias::SubtractedFromInput,
        (Bias::AddedToInput, _) => Bias::AddedToReadings,
        (Bias::SubtractedFromInput, _) => Bias::SubtractedFromReadings,
        (own, _) => own,
    };
    let side = Convention {
        bias: other,
        ..*convention
    };
    let mut all = vec![
        ("", *convention, bias),
        ("with the sign of its bias changed", *convention, -bias),
        ("with its bias on the other side of the matrix", side, bias),
    ];
    match sensor {
        Sensor::Gyro => all.push((
            "with its bias in deg/s",
            *convention,
            bias * 1f64.to_radians(),
        )),
        Sensor::Accel => {
            all.push(("with its bias in g", *convention, bias * STANDARD_GRAVITY));
            all.push((
                "with its bias in mg",
                *convention,
                bias * 1e-3 * STANDARD_GRAVITY,
            ));
        }
    }
    all
}

/// The other orders and signs of axes that no mirror makes.
fn orders() -> Vec<(String, Matrix3<f64>)> {
    let mut all = Vec::new();
    for order in [
        [0, 1, 2],
        [1, 2, 0],
        [2, 0, 1],
        [0, 2, 1],
        [2, 1, 0],
        [1, 0, 2],
    ] {
        for signs in 0..8 {
            let sign = |i: usize| if (signs >> i) & 1 == 0 { 1.0 } else { -1.0 };
            let turned = Matrix3::from_fn(|i, j| if order[i] == j { sign(i) } else { 0.0 });
            if turned.determinant() > 0.0 {
                let axis = |i: usize| match sign(i) < 0.0 {
                    true => format!("-{}", AXES[order[i]]),
                    false => AXES[order[i]].to_owned(),
                };
                let axes = [0, 1, 2].map(axis).join(", ");
                all.push((
                    format!("with the recording's axes {axes} as its x, y, z"),
                    turned,
                ));
            }
        }
    }
    all
}

/// The offset that `matrix` lacks, by the recording: for known inputs their mean difference; else rests for a gyro, and for an accelerometer the one that gives
/// poses the magnitude of gravity best.
fn bias(prepared: &Prepared, sensor: Sensor, matrix: &Matrix3<f64>) -> Vector3<f64> {
    let all = prepared.observations(sensor);
    let mean = |of: &dyn Fn(&mimu::estimate::Observation) -> Vector3<f64>| {
        all.iter().map(of).sum::<Vector3<f64>>() / all.len().max(1) as f64
    };
    if all.iter().all(|o| o.input.iter().all(|x| x.is_finite())) {
        return mean(&|o| o.input - matrix * o.raw);
    }
    if sensor == Sensor::Gyro {
        return -matrix * mean(&|o| o.raw);
    }
    let gravity = prepared.manifest.gravity_mps2;
    let mut offset = Vector3::zeros();
    for _ in 0..STEPS {
        let (mut square, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for o in &all {
            let x = matrix * o.raw + offset;
            let along = x.normalize();
            square += along * along.transpose();
            right += along * (gravity - x.norm());
        }
        // Few poses leave a direction open: the smallest change is taken.
        let step = square
            .pseudo_inverse(1e-6 * square.amax())
            .map(|inverse| inverse * right);
        offset += step.unwrap_or_default();
    }
    offset
}

/// White noise of the worst axis within the dwells, SI per √Hz; `None` if it is not known.
fn white(prepared: &Prepared, sensor: Sensor, model: &Affine<f64>) -> Option<f64> {
    let channels = &prepared.noise.channels[sensor.channels()];
    let known = channels.iter().all(|c| c.known);
    let variances = Vector3::from_fn(|i, _| channels[i].model.white);
    let squares = model.matrix.map(|c| c * c) * variances;
    known.then(|| squares.max().sqrt())
}
