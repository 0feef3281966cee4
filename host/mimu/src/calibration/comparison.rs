//! Differences between calibrations of one unit: over time, over switch-ons, between methods.
//!
//! Each parameter is judged by the spread of its values against its own standard deviations. For n files, `Σ (v - mean)²/σ²` with weights `1/σ²` has
//! a chi-square distribution with n - 1 degrees of freedom if only the uncertainty of the fits makes them differ. The least probable parameters are
//! judged first (Holm, 1979), so that in total 5 % of comparisons without a change name one.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::Calibration;
use super::body::BodyTriad;
use crate::judgement::Judgement;
use crate::one_unit::are_others;
use crate::quantity::{AXES, Sensor};
use crate::triad::Forward;
use mimu_recording::statistics::mean_and_variance;
use mimu_recording::{Error, NORMAL_95, RawUnit, Result, TriadName};

/// Probability that any parameter is named as changed although none has changed.
const FALSE_CHANGE: f64 = 0.05;
const ANGLES: [&str; 3] = ["yz", "zy", "zx"];

/// Calibrations side by side: `mimu-compare/1`.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// `mimu-compare/1`.
    pub format: &'static str,
    /// Files, in the order of the values.
    pub files: Vec<String>,
    /// The judgement of each file; null if it contains none.
    pub judgements: Vec<Option<Judgement>>,
    /// Parameters that all of them have.
    pub parameters: Vec<ComparedParameter>,
    /// What a person should know.
    pub notes: Vec<String>,
}

/// One parameter in all files.
#[derive(Debug, Clone, Serialize)]
pub struct ComparedParameter {
    /// The triad.
    pub sensor: TriadName,
    /// `scale factor x`, or a coefficient of an effect.
    pub name: String,
    /// Unit of all the numbers.
    pub unit: String,
    /// Value in each file.
    pub values: Vec<f64>,
    /// Standard deviation in each file; `None` if a file has none.
    pub sigmas: Option<Vec<f64>>,
    /// Mean of the values.
    pub mean: f64,
    /// Standard deviation of the values between the files.
    pub spread: f64,
    /// The part of it that the uncertainty of the fits does not explain: the repeatability. `None` without standard deviations.
    pub repeatability: Option<f64>,
    /// Probability of such a spread by the uncertainty of the fits alone; `None` without standard deviations.
    pub p: Option<f64>,
    /// Whether it changed, all parameters considered.
    pub changed: bool,
}

/// A value and its standard deviation, by sensor, name and unit.
type Named = (TriadName, String, String, f64, Option<f64>);

/// Compares calibrations, each given with its file.
///
/// # Errors
/// Fewer than two; readings in different units; no parameter that all have.
pub fn compare(all: &[(String, Calibration)]) -> Result<Comparison> {
    let [(first_file, first), others @ ..] = all else {
        return Err(too_few());
    };
    if others.is_empty() {
        return Err(too_few());
    }
    let mut notes = Vec::new();
    for (file, other) in others {
        let (ours, theirs) = (first.recording.raw_unit, other.recording.raw_unit);
        if ours != theirs {
            return Err(Error::new(
                file,
                format!(
                    "it is for readings in {theirs}, but {first_file} is for readings in {ours}"
                ),
                "compare calibrations of the same readings",
            ));
        }
        let ids = [&first.unit_id, &other.unit_id].map(|id| id.as_deref());
        if are_others(ids, [&first.device, &other.device]) {
            notes.push(format!(
                "{file} belongs to {:?}, but {first_file} belongs to {:?}",
                other.device, first.device
            ));
        }
        if let (Some(a), Some(b)) = (first.recording.temp_c, other.recording.temp_c)
            && (a - b).abs() > 5.0
        {
            notes.push(format!(
                "{file} is valid at {b:.1} °C, but {first_file} at {a:.1} °C: part of a change may be due to temperature"
            ));
        }
    }
    let ends = common_ends(all, &mut notes);
    let each: Vec<Vec<Named>> = all.iter().map(|(_, c)| parameters(c, &ends)).collect();
    let mut parameters = Vec::new();
    for (sensor, name, unit, ..) in &each[0] {
        let of = |one: &Vec<Named>| -> Option<(f64, Option<f64>)> {
            let found = one.iter().find(|p| p.0 == *sensor && p.1 == *name)?;
            Some((found.3, found.4))
        };
        let Some(found) = each.iter().map(of).collect::<Option<Vec<_>>>() else {
            notes.push(format!("{sensor} {name} is missing in some of them"));
            continue;
        };
        parameters.push(ComparedParameter::new(*sensor, name, unit, &found));
    }
    for (file, one) in all.iter().zip(&each).skip(1) {
        let new = one
            .iter()
            .filter(|p| !each[0].iter().any(|q| q.0 == p.0 && q.1 == p.1));
        notes.extend(new.map(|p| format!("{} {} is only in {}", p.0, p.1, file.0)));
    }
    if parameters.is_empty() {
        let remedy = "compare calibrations of the same sensor";
        return Err(Error::new(
            first_file,
            "the others have none of its parameters",
            remedy,
        ));
    }
    mark_changes(&mut parameters);
    Ok(Comparison {
        format: "mimu-compare/1",
        files: all.iter().map(|(file, _)| file.clone()).collect(),
        judgements: all.iter().map(|(_, c)| c.judgement.clone()).collect(),
        parameters,
        notes,
    })
}

fn too_few() -> Error {
    Error::new(
        "calibrations",
        "only one file was given",
        "name two or more files",
    )
}

impl ComparedParameter {
    fn new(sensor: TriadName, name: &str, unit: &str, found: &[(f64, Option<f64>)]) -> Self {
        let values: Vec<f64> = found.iter().map(|f| f.0).collect();
        let n = values.len() as f64;
        let (mean, variance) = mean_and_variance(values.iter().copied());
        let sigmas: Option<Vec<f64>> = found.iter().map(|f| f.1).collect();
        // Parameters that define the frame have no standard deviation, and are the same everywhere.
        let sigmas = sigmas.filter(|s| s.iter().all(|s| *s > 0.0));
        let p = sigmas.as_ref().map(|sigmas| {
            let weights = || sigmas.iter().map(|s| s.powi(-2));
            let total: f64 = weights().sum();
            let pooled = values
                .iter()
                .zip(weights())
                .map(|(v, w)| v * w)
                .sum::<f64>()
                / total;
            let each = values.iter().zip(weights());
            let chi2: f64 = each.map(|(v, w)| w * (v - pooled).powi(2)).sum();
            ChiSquared::new(n - 1.0).map_or(1.0, |d| d.sf(chi2))
        });
        let repeatability = sigmas.as_ref().map(|sigmas| {
            let own = sigmas.iter().map(|s| s * s).sum::<f64>() / n;
            (variance - own).max(0.0).sqrt()
        });
        Self {
            sensor,
            name: name.into(),
            unit: unit.into(),
            values,
            sigmas,
            mean,
            spread: variance.sqrt(),
            repeatability,
            p,
            changed: false,
        }
    }
}

impl ComparedParameter {
    /// Of two files, the second value minus the first, and the half-width of its 95 % interval if it is known. `None` for more files.
    pub fn difference(&self) -> Option<(f64, Option<f64>)> {
        let &[first, second] = self.values.as_slice() else {
            return None;
        };
        let half = self.sigmas.as_ref().map(|s| 1.96 * s[0].hypot(s[1]));
        Some((second - first, half))
    }
}

fn mark_changes(parameters: &mut [ComparedParameter]) {
    let judged = parameters.iter().enumerate();
    let mut judged: Vec<(usize, f64)> = judged.filter_map(|(k, c)| Some((k, c.p?))).collect();
    judged.sort_by(|a, b| a.1.total_cmp(&b.1));
    let count = judged.len();
    for (rank, (k, p)) in judged.into_iter().enumerate() {
        if p > FALSE_CHANGE / (count - rank) as f64 {
            break;
        }
        parameters[k].changed = true;
    }
}

/// Lower and upper end of the temperatures that all of several calibrations over temperature cover, °C; none if one has no curves.
fn common_ends(all: &[(String, Calibration)], notes: &mut Vec<String>) -> Vec<f64> {
    let ranges = all
        .iter()
        .map(|(_, c)| Some(c.temperature.as_ref()?.range_c));
    let Some(ranges) = ranges.collect::<Option<Vec<_>>>() else {
        return Vec::new();
    };
    let low = ranges
        .iter()
        .map(|r| r[0])
        .fold(f64::NEG_INFINITY, f64::max);
    let high = ranges.iter().map(|r| r[1]).fold(f64::INFINITY, f64::min);
    if low < high {
        return vec![low, high];
    }
    notes.push("their curves have no temperature in common".into());
    Vec::new()
}

/// Scale factors and biases of a calibration over temperature at `temp_c` of the dies.
fn at_temperature(calibration: &Calibration, sensor: Sensor, temp_c: f64) -> Option<[Values; 2]> {
    let over = calibration.temperature.as_ref()?;
    let model = Forward::of(&calibration.inverse_at(sensor, temp_c)?)?;
    let scale = [0, 1, 2].map(|k| model.matrix.row(k).norm());
    Some([
        (scale, over.sigmas(sensor, temp_c, |t| t.sigma_scale_factor)),
        (
            model.bias.into(),
            over.sigmas(sensor, temp_c, |t| t.sigma_bias),
        ),
    ])
}

/// Values of x, y, z and their standard deviations.
type Values = ([f64; 3], Option<[f64; 3]>);

/// Physical parameters, at `temperatures` too, and coefficients of effects.
fn parameters(calibration: &Calibration, temperatures: &[f64]) -> Vec<Named> {
    let mut all = Vec::new();
    for sensor in Sensor::BOTH {
        let Some(table) = calibration.table(sensor) else {
            continue;
        };
        let p = &table.physical;
        let raw = match table.raw_unit {
            RawUnit::Si => table.unit.clone(),
            unit => unit.to_string(),
        };
        let gain = match table.raw_unit {
            RawUnit::Si => String::new(),
            _ => format!("{raw}/({})", table.unit),
        };
        let deg = |values: [f64; 3]| values.map(f64::to_radians);
        let kinds = [
            (
                "scale factor",
                &AXES,
                gain.clone(),
                p.scale_factor,
                p.sigma_scale_factor,
            ),
            ("bias", &AXES, raw.clone(), p.bias, p.sigma_bias),
            (
                "misalignment",
                &AXES,
                "rad".into(),
                deg(p.misalignment_deg),
                p.sigma_misalignment_deg.map(deg),
            ),
            (
                "non-orthogonality",
                &ANGLES,
                "rad".into(),
                deg(p.non_orthogonality_deg),
                p.sigma_non_orthogonality_deg.map(deg),
            ),
        ];
        for (kind, names, unit, values, sigmas) in kinds {
            for i in 0..3 {
                let name = format!("{kind} {}", names[i]);
                let sigma = sigmas.map(|s| s[i]);
                all.push((name_of(sensor), name, unit.clone(), values[i], sigma));
            }
        }
        for temp_c in temperatures {
            let Some([scale, bias]) = at_temperature(calibration, sensor, *temp_c) else {
                continue;
            };
            for (kind, unit, (values, sigmas)) in
                [("scale factor", &gain, scale), ("bias", &raw, bias)]
            {
                for (i, axis) in AXES.iter().enumerate() {
                    let name = format!("{kind} {axis} at {temp_c:.1} °C");
                    let sigma = sigmas.map(|s| s[i]);
                    all.push((name_of(sensor), name, unit.clone(), values[i], sigma));
                }
            }
        }
    }
    all.extend(calibration.body.iter().flat_map(of_body));
    for effect in calibration.effects() {
        for c in effect.coefficients() {
            let name = format!("{} {}", effect.id(), c.name);
            let sensor = name_of(effect.sensor());
            all.push((sensor, name, c.unit, c.value, c.sigma));
        }
    }
    all
}

fn name_of(sensor: Sensor) -> TriadName {
    sensor.pick(TriadName::GYRO, TriadName::ACCEL)
}

/// C, o, rotation, delay and lever arm of a further triad.
fn of_body(triad: &BodyTriad) -> Vec<Named> {
    let mut all = Vec::new();
    let mut add = |name: String, unit: &str, value: Option<f64>, sigma: Option<f64>| {
        let named = |value| (triad.triad, name, unit.to_owned(), value, sigma);
        all.extend(value.map(named));
    };
    let per_raw = format!("{}/{}", triad.unit, triad.raw_unit);
    for (i, row) in AXES.iter().enumerate() {
        for (j, column) in AXES.iter().enumerate() {
            let sigma = Some(triad.sigma_C[i][j]);
            add(
                format!("C {row}{column}"),
                &per_raw,
                Some(triad.C[i][j]),
                sigma,
            );
        }
        add(
            format!("o {row}"),
            &triad.unit,
            Some(triad.o[i]),
            Some(triad.sigma_o[i]),
        );
        let of = |values: Option<[f64; 3]>, factor: f64| values.map(|v| factor * v[i]);
        let radian = 1f64.to_radians();
        let (value, half) = (triad.rotation_deg, triad.interval_rotation_deg);
        let sigma = of(half, radian / NORMAL_95);
        add(format!("rotation {row}"), "rad", of(value, radian), sigma);
        let (value, half) = (triad.lever_arm_mm, triad.interval_lever_arm_mm);
        let sigma = of(half, 1e-3 / NORMAL_95);
        add(format!("lever arm {row}"), "m", of(value, 1e-3), sigma);
    }
    let ms = |value: Option<f64>| value.map(|v| 1e-3 * v);
    let sigma = ms(triad.interval_delay_ms).map(|half| half / NORMAL_95);
    add("delay".into(), "s", ms(triad.delay_ms), sigma);
    all
}
