//! A body of triads: magnetometers and further inertial units on one carrier, beside its first gyro and accelerometer.
//!
//! [`Body::of`] takes a recording with more triads, and the fit of the first two. Further gyros and accelerometers are compared with the first of their
//! kind in the motion that all feel (`same_body.rs`), magnetometers by what the Earth's field keeps while the body turns (`field.rs`). Each gets its calibration, its
//! rotation, its delay, an accelerometer its lever arm, each with its interval; what a recording leaves open is not given, with the reason.

mod clustered;
mod field;
mod fitted;
mod judge;
mod pieces;
pub mod result;
mod same_body;
mod series;

use mimu::fit::Fit;
use mimu::judgement::Judgement;
use mimu::quantity::Sensor;
use mimu::triad::{Estimate, half_width_95};
use mimu_recording::error::{Error, Result};
use mimu_recording::{Column, Recording, TriadKind, TriadName};

pub use fitted::{FittedTriad, Known};

use field::{Field, Rest};
use same_body::{Reference, Relation};
use series::{Motion, Series};

/// What is given of a body.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// Size of the Earth's field at the place, µT. Without it magnetometers are calibrated in units of it.
    pub field_ut: Option<f64>,
}

/// The further triads of a body.
#[derive(Debug, Clone)]
pub struct Body {
    /// Those that were calibrated, in the order of their names.
    pub triads: Vec<FittedTriad>,
    /// Those that the recording does not determine, and why.
    pub refused: Vec<(TriadName, Judgement)>,
}

/// A delay or an arm is given if the data narrow what is known beforehand to this share of it.
const DETERMINED: f64 = 0.1;

impl Body {
    /// The further triads of `recording`, whose gyro and accelerometer have the calibration `unit`. `None` if it has no more triads.
    ///
    /// # Errors
    /// The samples cannot be read; the size of the field is impossible.
    pub fn of(recording: &Recording, unit: &Fit, options: &Options) -> Result<Option<Self>> {
        if let Some(size) = options.field_ut
            && !(15.0..=75.0).contains(&size)
        {
            let problem = format!("the Earth's field is 22 to 67 µT, and {size} µT is given");
            let remedy = "give its size at the place, as a model of the field (WMM, IGRF) has it";
            return Err(Error::new("field", problem, remedy));
        }
        let first = [TriadKind::Gyro, TriadKind::Accel].map(TriadName::first);
        let triads = recording.triads().into_iter();
        let more: Vec<TriadName> = triads.filter(|name| !first.contains(name)).collect();
        if more.is_empty() {
            return Ok(None);
        }
        let carrier = Carrier::read(recording, unit)?;
        let mut body = Self {
            triads: Vec::new(),
            refused: Vec::new(),
        };
        for name in more {
            let raw = read(recording, name)?;
            match carrier.fitted(name, raw, options) {
                Ok(triad) => body.triads.push(triad),
                Err(why) => body.refused.push((name, why)),
            }
        }
        Ok(Some(body))
    }
}

/// Raw readings of a triad.
fn read(recording: &Recording, name: TriadName) -> Result<Series> {
    let columns = [0, 1, 2].map(|axis| Column::of(name, axis));
    let columns = [Column::Time, columns[0], columns[1], columns[2]];
    let all = recording.read_columns(&columns, |_| ())?;
    Ok(Series::new(&all[0], [&all[1], &all[2], &all[3]]))
}

/// The first gyro and accelerometer, compensated.
struct Carrier<'a> {
    unit: &'a Fit,
    motion: Option<(Motion, f64)>,
    force: Option<(Series, f64)>,
    rests: Vec<Rest>,
}

impl<'a> Carrier<'a> {
    fn read(recording: &Recording, unit: &'a Fit) -> Result<Self> {
        let series = |sensor: Sensor| -> Result<Option<(Series, f64)>> {
            let Some(found) = unit.sensor(sensor) else {
                return Ok(None);
            };
            let kind = match sensor {
                Sensor::Gyro => TriadKind::Gyro,
                Sensor::Accel => TriadKind::Accel,
            };
            let raw = read(recording, TriadName::first(kind))?;
            let model = found.estimated.triad.inverse;
            let noise = raw.noise() * model.matrix.norm_squared() / 3.0;
            Ok(Some((raw.map(|u| model.apply(u)), noise)))
        };
        let rests = unit.sensor(Sensor::Accel).into_iter().flat_map(|accel| {
            let dwells = unit.prepared.dwells.list.iter();
            let own = dwells.filter(|d| d.faults.accel.is_none() && !d.spins() && !d.turn);
            own.filter_map(|d| {
                let force = accel
                    .estimated
                    .triad
                    .inverse
                    .apply(&d.raw_mean(Sensor::Accel));
                Some(Rest {
                    from_s: d.start_s,
                    to_s: d.start_s + d.duration_s,
                    up: force.try_normalize(1.0)?,
                })
            })
        });
        Ok(Self {
            motion: series(Sensor::Gyro)?.map(|(rate, noise)| (Motion::new(rate), noise)),
            force: series(Sensor::Accel)?,
            rests: rests.collect(),
            unit,
        })
    }

    /// A further triad, or why it has no calibration.
    fn fitted(
        &self,
        name: TriadName,
        raw: Series,
        options: &Options,
    ) -> std::result::Result<FittedTriad, Judgement> {
        if raw.len() < FEWEST {
            return Err(judge::undetermined(format!(
                "it has {} readings: leave its columns out",
                raw.len()
            )));
        }
        match name.kind {
            TriadKind::Mag => self.magnetometer(name, raw, options),
            kind => self.inertial(name, kind, &raw),
        }
    }

    fn inertial(
        &self,
        name: TriadName,
        kind: TriadKind,
        raw: &Series,
    ) -> std::result::Result<FittedTriad, Judgement> {
        let (sensor, found) = match kind {
            TriadKind::Gyro => (
                Sensor::Gyro,
                self.motion.as_ref().map(|(m, n)| (&m.rate, *n)),
            ),
            _ => (Sensor::Accel, self.force.as_ref().map(|(f, n)| (f, *n))),
        };
        let unit = self.unit.sensor(sensor);
        let (Some((series, noise)), Some(unit)) = (found, unit) else {
            return Err(judge::undetermined(format!(
                "the first {sensor}, which it is compared with, is not calibrated"
            )));
        };
        let motion = self.motion.as_ref().map(|(motion, _)| motion);
        let reference = Reference {
            motion,
            series,
            noise,
        };
        let relation = Relation::of(kind, raw, &reference).ok_or_else(|| {
            judge::undetermined(match sensor {
                Sensor::Gyro => "its scale factors and angles are not determined: turn the body about all three axes",
                Sensor::Accel => "its scale factors and angles are not determined: bring each axis up, down and in between",
            })
        })?;
        let reference_parts = fitted::by_reference(&relation.calibration, &unit.estimated.triad);
        let parts = [vec![relation.part()], reference_parts].concat();
        let placed = fitted::placed(&relation.calibration, &parts)
            .ok_or_else(|| judge::undetermined("two of its axes read the same"))?;
        let [delay, arm] = relation.undetermined;
        let at = |k: usize, scale: f64| estimate(&relation.covariance, relation.dof, k, scale);
        let delay_ms = match delay < DETERMINED {
            true => Ok(at(12, 1e3)(relation.delay_s)),
            false => Err(
                "its readings change too slowly to show a delay: turn and shake the body"
                    .to_string(),
            ),
        };
        let lever_arm_mm = match (kind, motion) {
            (TriadKind::Gyro, _) => Err("a gyro reads the same everywhere on a body".to_string()),
            (_, None) => Err("without a gyro no rate is known".to_string()),
            _ if arm < DETERMINED => Ok([0, 1, 2].map(|i| at(13 + i, 1e3)(relation.arm_m[i]))),
            _ => Err(
                "the body turns too slowly to show a lever arm: turn it faster, about two axes"
                    .to_string(),
            ),
        };
        let signal = series.x.iter().map(|x| x.norm_squared()).sum::<f64>() / series.len() as f64;
        Ok(FittedTriad {
            name,
            reference: TriadName::first(kind),
            unit: sensor.unit(),
            judgement: judge::same_body(&relation, (signal / 3.0).sqrt(), sensor),
            triad: placed.triad,
            rotation: placed.rotation,
            rotation_deg: placed.rotation_deg,
            delay_ms,
            lever_arm_mm,
            dip_deg: None,
            rms: relation.rms,
            held_out_rms: relation.held_out_rms,
            noise_floor: relation.noise_floor,
            window_s: same_body::WINDOW_S,
            windows: relation.windows,
            left_out: relation.left_out,
        })
    }

    fn magnetometer(
        &self,
        name: TriadName,
        raw: Series,
        options: &Options,
    ) -> std::result::Result<FittedTriad, Judgement> {
        let Some((motion, gyro)) = self
            .motion
            .as_ref()
            .map(|(m, _)| m)
            .zip(self.unit.sensor(Sensor::Gyro))
        else {
            return Err(judge::undetermined(
                "the first gyro, whose turns it is compared with, is not calibrated",
            ));
        };
        let size = options.field_ut.unwrap_or(1.0);
        let raw = raw.without_repeats();
        let field = Field::of(raw, motion, &self.rests, size).ok_or_else(|| {
            judge::undetermined("the field turns too little in its readings: bring each axis to point each way, and turn about all three")
        })?;
        judge::determines(&field)?;
        let turned = fitted::turned_with(&field.calibration, &gyro.estimated.triad);
        let parts = [vec![field.part()], turned].concat();
        let placed = fitted::placed(&field.calibration, &parts)
            .ok_or_else(|| judge::undetermined("two of its axes read the same"))?;
        let at = |k: usize, scale: f64| estimate(&field.covariance, field.dof, k, scale);
        let sine = field.dip_sine.clamp(-0.999_999, 0.999_999);
        let by_sine = (1.0 - sine * sine).sqrt().recip().to_degrees();
        let dip = match field.rests {
            0 => Err("no rest shows where up is".to_string()),
            _ => Ok(Estimate {
                value: sine.asin().to_degrees(),
                ..at(13, by_sine)(sine)
            }),
        };
        Ok(FittedTriad {
            name,
            reference: TriadName::first(TriadKind::Gyro),
            unit: if options.field_ut.is_some() {
                "uT"
            } else {
                "field"
            },
            judgement: judge::field(&field, size),
            triad: placed.triad,
            rotation: placed.rotation,
            rotation_deg: placed.rotation_deg,
            delay_ms: match field.delay_undetermined < DETERMINED {
                true => Ok(at(12, 1e3)(field.delay_s)),
                false => Err("the body turns too slowly to show a delay".to_string()),
            },
            lever_arm_mm: Err("a magnetometer reads the same everywhere on a body".to_string()),
            dip_deg: Some(dip),
            rms: field.rms,
            held_out_rms: field.held_out_rms,
            noise_floor: field.noise_floor,
            window_s: field::TURN_S,
            windows: field.turns,
            left_out: field.left_out,
        })
    }
}

/// Fewest readings of a triad.
const FEWEST: usize = 100;

/// A parameter with its interval, in units of `scale`, given its value.
fn estimate(
    covariance: &nalgebra::DMatrix<f64>,
    dof: f64,
    k: usize,
    scale: f64,
) -> impl Fn(f64) -> Estimate {
    let variance = covariance[(k, k)].max(0.0) * scale * scale;
    move |value| Estimate {
        value: value * scale,
        sigma: variance.sqrt(),
        interval: half_width_95([(variance, dof)].into_iter()),
    }
}
