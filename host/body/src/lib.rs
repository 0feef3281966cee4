//! A body of triads: magnetometers and further inertial units on one carrier, beside its first gyro and accelerometer.
//!
//! [`Body::of`] takes a recording with more triads, and the fit of the first two. Further gyros and accelerometers are compared with the first of their
//! kind in the motion that all feel (`same_body.rs`), magnetometers by what the Earth's field keeps while the body turns (`field.rs`). Each gets its calibration, its
//! rotation, its delay, an accelerometer its lever arm, each with its interval; what a recording leaves open is not given, with the reason.

mod accel_delay;
pub mod aligned;
mod carrier;
mod clustered;
mod errors;
mod field;
mod fitted;
mod iron;
mod judge;
mod live;
mod pairs;
mod pieces;
mod relation;
pub mod result;
mod same_body;
mod series;
mod sessions;
pub mod split;
mod standing;
pub mod trajectory;
mod verify;

use mimu::fit::Fit;
use mimu::judgement::Judgement;
use mimu::quantity::{PerSensor, Sensor};
use mimu::signal::dwell::Dwell;
use mimu::triad::Estimate;
use mimu_recording::error::{Error, Result};
use mimu_recording::{RawUnit, Recording, TriadKind, TriadName};

pub use accel_delay::accel_delay_ms;
pub use fitted::{FittedTriad, Known};
pub use iron::Iron;
pub use live::{Departure, FieldSoFar};
pub use pairs::Pairs;
pub use split::Split;
pub use trajectory::ByTrajectory;
pub use verify::{TriadVerification, verify};

use carrier::{Carrier, Unit, read};
use field::Field;
use iron::Warmth;
use relation::{DELAY, Relation};
use series::Series;

/// What is given of a body.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// Size of the Earth's field at the place, µT. Without it magnetometers are calibrated in units of it.
    pub field_ut: Option<f64>,
}

impl Options {
    /// Refuses a field that is found nowhere on the Earth.
    ///
    /// # Errors
    /// The size of the field is impossible.
    pub fn check(&self) -> Result<()> {
        let Some(size) = self.field_ut.filter(|size| !(15.0..=75.0).contains(size)) else {
            return Ok(());
        };
        let problem = format!("the Earth's field is 22 to 67 µT, and {size} µT is given");
        let remedy = "give its size at the place, as a model of the field (WMM, IGRF) has it";
        Err(Error::new("field", problem, remedy))
    }
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

/// An accelerometer's delay is given if its errors in motion are at most so many times its noise.
const FAITHFUL: f64 = 5.0;

impl Body {
    /// The further triads of `recording`, whose gyro and accelerometer have the calibration `unit`. `None` if it has no more triads.
    ///
    /// # Errors
    /// The samples cannot be read; the size of the field is impossible.
    pub fn of(recording: &Recording, unit: &Fit, options: &Options) -> Result<Option<Self>> {
        Self::fitted(recording, &Unit::fitted(unit), options)
    }

    /// As [`Self::of`], with a gyro and an accelerometer that are taken as they read: in SI, less what the gyro reads in these dwells. Their errors, of a percent and half
    /// a degree, are in the intervals. Without a dwell the gyro's bias is found with the magnetometer. `None` too if the readings are not in SI.
    ///
    /// # Errors
    /// As of [`Self::of`].
    pub fn of_readings(
        recording: &Recording,
        dwells: &[Dwell],
        options: &Options,
    ) -> Result<Option<Self>> {
        let triads = recording.triads();
        let has = PerSensor::from_fn(|sensor| triads.contains(&carrier::first(sensor)));
        match recording.manifest.raw_unit == RawUnit::Si {
            true => Self::fitted(recording, &Unit::nominal(dwells, has), options),
            false => Ok(None),
        }
    }

    fn fitted(recording: &Recording, unit: &Unit, options: &Options) -> Result<Option<Self>> {
        options.check()?;
        let first = [TriadKind::Gyro, TriadKind::Accel].map(TriadName::first);
        let triads = recording.triads().into_iter();
        let more: Vec<TriadName> = triads.filter(|name| !first.contains(name)).collect();
        if more.is_empty() {
            return Ok(None);
        }
        let models = PerSensor::from_fn(|sensor| Some(unit.triads[sensor].as_ref()?.inverse));
        let warmth = match more.iter().any(|name| name.kind == TriadKind::Mag) {
            true => Warmth::read(recording)?,
            false => None,
        };
        let fitting = Fitting {
            carrier: Carrier::read(recording, &models)?,
            warmth: warmth.filter(Warmth::varies),
            unit,
        };
        let mut body = Self {
            triads: Vec::new(),
            refused: Vec::new(),
        };
        for name in more {
            match fitting.fitted(name, read(recording, name)?, options) {
                Ok(triad) => body.triads.push(triad),
                Err(why) => body.refused.push((name, why)),
            }
        }
        for triad in &mut body.triads {
            let dip = triad.dip_deg.as_ref().and_then(|dip| dip.as_ref().ok());
            let mirrored =
                dip.and_then(|dip| judge::mirrored(dip, recording.manifest.latitude_deg));
            let all = mirrored.into_iter().chain([triad.judgement.clone()]);
            triad.judgement = Judgement::worst(all).unwrap_or_else(|| triad.judgement.clone());
        }
        Ok(Some(body))
    }

    /// The names of its further triads.
    fn names(&self) -> impl Iterator<Item = TriadName> + '_ {
        let refused = self.refused.iter().map(|(name, _)| *name);
        self.triads.iter().map(|triad| triad.name).chain(refused)
    }

    /// The worst of its judgements.
    pub fn judgement(&self) -> Judgement {
        let of = self.triads.iter().map(|triad| triad.judgement.clone());
        let refused = self.refused.iter().map(|(_, why)| why.clone());
        Judgement::worst(of.chain(refused))
            .unwrap_or_else(|| judge::undetermined("it has no further triad"))
    }
}

/// The calibrations of the first two, and their readings.
struct Fitting<'a> {
    unit: &'a Unit,
    carrier: Carrier,
    /// The temperature, if it varies.
    warmth: Option<Warmth>,
}

impl Fitting<'_> {
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
        let sensor = match kind {
            TriadKind::Gyro => Sensor::Gyro,
            _ => Sensor::Accel,
        };
        let reference = self.carrier.reference(sensor);
        let Some((reference, unit)) = reference.zip(self.unit.triads[sensor].as_ref()) else {
            return Err(judge::undetermined(format!(
                "the first {sensor}, which it is compared with, is not calibrated"
            )));
        };
        let relation = same_body::relation(kind, raw, &reference).ok_or_else(|| {
            judge::undetermined(match sensor {
                Sensor::Gyro => "its scale factors and angles are not determined: turn the body about all three axes",
                Sensor::Accel => "its scale factors and angles are not determined: bring each axis up, down and in between",
            })
        })?;
        let by_reference = fitted::by_reference(&relation.calibration(), unit);
        let judgement = judge::same_body(
            &relation.errors,
            reference.signal(),
            &format!("the first {sensor}"),
            sensor.unit(),
        );
        let mut triad = FittedTriad::of(
            name,
            (&relation, by_reference),
            (sensor.unit(), same_body::WINDOW_S),
            judgement,
        )
        .ok_or_else(axes_alike)?;
        let excess = relation.errors.held_out_rms / relation.errors.noise_floor;
        if relation.undetermined(DELAY) >= DETERMINED {
            triad.delay_ms = Err(
                "its readings change too slowly to show a delay: turn and shake the body".into(),
            );
        } else if sensor == Sensor::Accel && excess > FAITHFUL {
            // Measured on eight chips with one clock: 2 to 5 times the interval off, where those of their gyros were right.
            triad.delay_ms = Err(format!(
                "it errs by {excess:.0} times its noise in motion, as where samples are too slow for it, and a delay would follow these errors"
            ));
        }
        if kind == TriadKind::Accel {
            triad.lever_arm_mm = arm_of(&relation, same_body::ARM);
        }
        Ok(triad)
    }

    fn magnetometer(
        &self,
        name: TriadName,
        raw: Series,
        options: &Options,
    ) -> std::result::Result<FittedTriad, Judgement> {
        let motion = self.carrier.motion();
        let Some((motion, gyro)) = motion.zip(self.unit.triads.gyro.as_ref()) else {
            return Err(judge::undetermined(
                "the first gyro, whose turns it is compared with, is not calibrated",
            ));
        };
        let size = options.field_ut.unwrap_or(1.0);
        let raw = raw.without_repeats();
        let known = (size, self.unit.rate_bias);
        let of = |warm| Field::of(&raw, motion, &self.unit.rests, known, warm);
        let warm = self.warmth.as_ref().map(|of| (of, of.mean_c()));
        // A field that is disturbed for another reason may change as the temperature does.
        let moving = warm.and_then(|_| of(warm));
        let moving = moving.filter(|field| judge::field(field, size).is_good());
        let field = moving.or_else(|| of(None)).ok_or_else(|| {
            judge::undetermined("the field turns too little in its readings: bring each axis to point each way, and turn about all three")
        })?;
        judge::determines(&field)?;
        let relation = &field.relation;
        let turned = fitted::turned_with(&relation.calibration(), gyro);
        let unit = match options.field_ut {
            Some(_) => "uT",
            None => "field",
        };
        let mut triad = FittedTriad::of(
            name,
            (relation, turned),
            (unit, field::TURN_S),
            judge::field(&field, size),
        )
        .ok_or_else(axes_alike)?;
        if relation.undetermined(DELAY) >= DETERMINED {
            triad.delay_ms = Err("the body turns too slowly to show a delay".into());
        }
        triad.dip_deg = Some(field.dip_deg());
        triad.iron = field.iron(&triad.rotation);
        triad.left_out = field.left_out.spans;
        Ok(triad)
    }
}

fn axes_alike() -> Judgement {
    judge::undetermined("two of its axes read the same")
}

/// The lever arm of an accelerometer, whose parameters begin at `first`.
fn arm_of(relation: &Relation, first: usize) -> Known<[Estimate; 3]> {
    let arm = [0, 1, 2].map(|i| first + i);
    if relation.at.len() <= arm[2] {
        return Err("without a gyro no rate is known".into());
    }
    let open = arm.map(|k| relation.undetermined(k));
    match open.into_iter().fold(0.0, f64::max) < DETERMINED {
        true => Ok(arm.map(|k| relation.estimate(k, 1e3))),
        false => Err(
            "the body turns too slowly to show a lever arm: turn it faster, about two axes".into(),
        ),
    }
}

/// Fewest readings of a triad.
const FEWEST: usize = 100;
