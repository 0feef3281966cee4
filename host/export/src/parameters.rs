//! What the exports to autopilots have in common: parameters and the layouts of their files, biases over temperature as cubics, and at one temperature
//! an offset and a factor for each axis.
//!
//! At one temperature both autopilots compute `x_i = (v_i - offset_i) scale_i` from the driver's value of a raw reading, `v_i = si_per_raw_i (u_i -
//! zero_i)`. With `u = P x + b`, and without the cross terms of P, `offset_i = si_per_raw_i (b_i - zero_i)` and `scale_i = 1 / (si_per_raw_i P_ii)`.

use std::fmt::Write as _;

use clap::Args;
use mimu::calibration::bias_cubic::{BiasCubics, Conversion};
use mimu::{BodyTriad, Calibration, Forward, PerSensor, Sensor};
use mimu_recording::{Argument, RawUnit, Result, TriadKind, TriadName};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use crate::convention::{Bias, Convention, Shape, within};
use crate::remaining::{self, Places};
use crate::{Export, Sources, body, driver, judged};

/// The convention of both autopilots at one temperature; a gyro has no scale.
pub(crate) const CONVENTION: Convention =
    Convention::to_input(Shape::Axes, Bias::SubtractedFromReadings);

/// Names of the axes in parameter names.
pub(crate) const LETTERS: [&str; 3] = ["X", "Y", "Z"];

/// A parameter of an autopilot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Name in the autopilot.
    pub name: String,
    /// Value, in single precision unless whole.
    pub value: f64,
    /// Its type in MAVLink: 2 is INT8, 6 INT32, 9 REAL32.
    #[serde(skip)]
    kind: u8,
}

impl Parameter {
    /// A value in single precision.
    pub fn real(name: String, value: f64) -> Self {
        // A zero without a sign.
        let (value, kind) = (f64::from(value as f32) + 0.0, 9);
        Self { name, value, kind }
    }

    /// An integer of 8 bits.
    pub fn int8(name: String, value: i8) -> Self {
        let (value, kind) = (value.into(), 2);
        Self { name, value, kind }
    }

    /// An integer of 32 bits.
    pub fn int32(name: String, value: i32) -> Self {
        let (value, kind) = (value.into(), 6);
        Self { name, value, kind }
    }

    /// The shortest decimal number without an exponent that equals the value in single precision.
    fn text(&self) -> String {
        match self.kind {
            9 => (self.value as f32).to_string(),
            _ => self.value.to_string(),
        }
    }
}

/// Options common to PX4 and ArduPilot.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Number of the inertial unit in the autopilot, from 1
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=3))]
    pub imu: u8,
    /// Device id of the gyro in the autopilot (CAL_GYROn_ID, INS_GYR_ID)
    #[arg(long, value_name = "ID")]
    pub gyro_id: Option<u32>,
    /// Device id of the accelerometer in the autopilot (CAL_ACCn_ID, INS_ACC_ID)
    #[arg(long, value_name = "ID")]
    pub accel_id: Option<u32>,
    /// File for QGroundControl, five columns with tabs; without it NAME,VALUE for MAVProxy and Mission Planner
    #[arg(long)]
    pub qgc: bool,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
    /// That of magnetometers.
    #[command(flatten)]
    pub mag: body::Options,
}

/// What an autopilot takes of magnetometers.
pub(crate) struct Compass {
    /// Unit of its readings, and how many of it are a microtesla.
    pub unit: (&'static str, f64),
    /// Sign of the offset; the matrix is symmetric.
    pub convention: Convention,
    /// Its formula of v, offset and a matrix S.
    pub formula: &'static str,
    /// Where the six numbers of S are.
    pub symmetric: &'static str,
}

/// A triad in the autopilot.
pub(crate) struct FurtherTriad {
    /// The triad.
    pub triad: TriadName,
    /// Its number in the autopilot, from 1.
    pub instance: u8,
    /// Offset of the readings, in the unit of the autopilot.
    pub offset: Vector3<f64>,
    /// Factors of an accelerometer's axes on the diagonal; the symmetric matrix of a magnetometer.
    pub scale: Matrix3<f64>,
}

/// Numbers of a [`FurtherTriad`] that an autopilot has parameters for.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum What {
    Offset,
    /// The diagonal of the scale.
    Scale,
    /// xy, xz and yz of a symmetric matrix.
    Beside,
}

/// A parameter of each axis.
pub(crate) struct Row {
    /// The triads that have it.
    pub kind: TriadKind,
    /// What it is.
    pub what: What,
    /// Its name: `{n}` is the instance, `{axis}` a letter.
    pub name: &'static str,
    /// Its range, with the decimals and the unit of the refusal, and what to do then.
    pub range: Option<([f64; 2], usize, &'static str, Remedy)>,
}

/// What to do about a number beyond its range.
pub(crate) type Remedy = (&'static str, Argument);

impl FurtherTriad {
    /// Adds the parameters of these rows; `number` is the instance in their names.
    ///
    /// # Errors
    /// A value is outside its range.
    pub fn write<'a>(
        &self,
        rows: impl IntoIterator<Item = &'a Row>,
        number: &str,
        export: &mut Export,
    ) -> Result<()> {
        let s = &self.scale;
        let own = |row: &&Row| row.kind == self.triad.kind;
        for row in rows.into_iter().filter(own) {
            let values = match row.what {
                What::Offset => self.offset,
                What::Scale => s.diagonal(),
                What::Beside => Vector3::new(s[(0, 1)], s[(0, 2)], s[(1, 2)]),
            };
            for (i, letter) in LETTERS.iter().enumerate() {
                let name = row.name.replace("{n}", number).replace("{axis}", letter);
                if let Some((range, decimals, unit, remedy)) = row.range {
                    let value = (values[i], decimals, unit);
                    within((self.triad, i), &name, value, range, remedy)?;
                }
                export.parameters.push(Parameter::real(name, values[i]));
            }
        }
        Ok(())
    }
}

impl Options {
    /// Device ids, as far as the user knows them. Autopilots store them bit by bit in signed parameters.
    pub fn ids(&self) -> PerSensor<Option<i32>> {
        PerSensor::from([self.gyro_id, self.accel_id]).map(|id| id.map(|id| id as i32))
    }

    /// The export with its comments and parameters in the layout of the file.
    pub(crate) fn file(&self, export: Export, from: &Sources) -> Export {
        let mut out = export.head("#", from);
        for parameter in &export.parameters {
            let (name, value, kind) = (&parameter.name, parameter.text(), parameter.kind);
            let _ = match self.qgc {
                false => writeln!(out, "{name},{value}"),
                true => writeln!(out, "1\t1\t{name}\t{value}\t{kind}"),
            };
        }
        export.with(out)
    }

    /// Adds the biases of each sensor as cubics, with their formula and remaining errors.
    ///
    /// # Errors
    /// An error of [`BiasCubics::of`] or [`BiasCubics::of_rest`].
    pub(crate) fn cubics(
        &self,
        from: &Sources,
        range_c: [f64; 2],
        reference_c: f64,
        export: &mut Export,
    ) -> Result<()> {
        let known = self.driver.conversions();
        export.note(OWN_AXES);
        for sensor in Sensor::BOTH {
            let known = &known[sensor];
            let (cubics, none) = match from.biases {
                Some(biases) => (
                    BiasCubics::of_rest(biases, sensor, known, range_c, reference_c)?,
                    format!("The recording has no readings of the {sensor}: none are written."),
                ),
                None => (
                    BiasCubics::of(from.calibration()?.0, sensor, known, range_c, reference_c)?,
                    format!("The calibration has no curves of the {sensor}, so none are written."),
                ),
            };
            let Some(cubics) = cubics else {
                export.note(none);
                continue;
            };
            if let Some(rms) = from.biases.and_then(|biases| biases.rms[sensor]) {
                let error = judged::error_of_curves(&cubics, rms);
                export.calibration_errors.push(error);
            }
            add(cubics, export);
        }
        if let Some((calibration, _)) = from.calibration {
            // Of the general errors only those of the effects are added: the cubics report their own.
            export.remaining.extend(remaining::effects(calibration));
        }
        Ok(())
    }

    /// The calibrated triads, SI; adds formulas, notes and the remaining errors.
    ///
    /// # Errors
    /// The calibration is missing, or an error of [`Conversion::of`].
    pub(crate) fn offsets(&self, from: &Sources, export: &mut Export) -> Result<Vec<FurtherTriad>> {
        let (calibration, _) = from.calibration()?;
        let known = self.driver.conversions();
        export.formula("x = (v - offset) scale on each axis, raw to SI; v is the driver's output for a raw reading; a gyro has no scale.");
        export.note(OWN_AXES);
        export.leaves(calibration, Places::Axes);
        let mut all = Vec::new();
        for sensor in Sensor::BOTH {
            let Some(forward) = calibration.inverse(sensor).as_ref().and_then(Forward::of) else {
                export.note(format!(
                    "The calibration has no {sensor}, so nothing is written for it."
                ));
                continue;
            };
            let conversion = Conversion::of(calibration, sensor, &known[sensor], &forward)?;
            let converted = converted(&conversion, sensor.unit());
            export.formula(format!("{sensor}: v = {converted}"));
            let si = calibration.recording.raw_unit == RawUnit::Si;
            if known[sensor].si_per_raw.is_none() && !si {
                export.note(format!(
                    "{sensor}: the driver is assumed to convert with the scale factors of the calibration. Give its factors with --{sensor}-si-per-raw."
                ));
            }
            let gain = conversion.gain(&forward);
            if sensor == Sensor::Gyro {
                let error = remaining::scale_factors(sensor, &gain);
                export.remaining.push(error);
            }
            all.push(FurtherTriad {
                triad: driver::name_of(sensor),
                instance: self.imu,
                offset: conversion.bias(&forward),
                scale: Matrix3::from_diagonal(&gain.map(f64::recip)),
            });
        }
        Ok(all)
    }
}

impl Options {
    /// The further triads that an autopilot with `most` of each kind takes; adds formulas and notes.
    ///
    /// # Errors
    /// A magnetometer's axes are mirrored, C is singular, or those of `body::Options::microtesla`.
    pub(crate) fn further(
        &self,
        from: &Sources,
        compass: &Compass,
        most: u8,
        export: &mut Export,
    ) -> Result<Vec<FurtherTriad>> {
        let Some((calibration, place)) = from.calibration else {
            return Ok(Vec::new());
        };
        let instance = |name: TriadName| match name.kind {
            TriadKind::Mag => name.number,
            _ => self.imu.saturating_add(name.number - 1),
        };
        let has = |name: TriadName| instance(name) <= most;
        export.notes.extend(body::left_out(calibration, has));
        let mut all = Vec::new();
        for triad in calibration.body.iter().filter(|triad| has(triad.triad)) {
            let (offset, scale) = match triad.triad.kind {
                TriadKind::Mag => {
                    match self.compass((calibration, place), triad, compass, export)? {
                        Some(numbers) => numbers,
                        None => continue,
                    }
                }
                _ => {
                    let readings = body::readings(triad, true, None, place)?;
                    body::note_driver(&readings, triad, false, export);
                    let scales = triad.triad.kind == TriadKind::Accel;
                    body::note_axes(&readings, scales, export);
                    let parts = CONVENTION.of(&readings)?;
                    (parts.bias, parts.left)
                }
            };
            all.push(FurtherTriad {
                triad: triad.triad,
                instance: instance(triad.triad),
                offset,
                scale,
            });
        }
        Ok(all)
    }

    fn compass(
        &self,
        calibration: (&Calibration, &str),
        mag: &BodyTriad,
        compass: &Compass,
        export: &mut Export,
    ) -> Result<Option<(Vector3<f64>, Matrix3<f64>)>> {
        let (unit, per_ut) = compass.unit;
        let Some(readings) = self.mag.microtesla(calibration, mag, export)? else {
            return Ok(None);
        };
        export.formula(format!(
            "{}: x = {} in {unit}, {}; v is the driver's output, {per_ut} {unit} for a microtesla of the readings below",
            mag.triad, compass.formula, compass.symmetric
        ));
        body::note_driver(&readings, mag, self.mag.mag_ut_per_raw.is_some(), export);
        let parts = compass.convention.of(&readings)?;
        body::note_rotation(mag, &parts.left, calibration.1, export)?;
        Ok(Some((per_ut * parts.bias, parts.right)))
    }
}

/// What to do about scale factors beyond the range.
pub(crate) const GIVE_FACTOR: Remedy = (
    "give the factor by which the driver converts",
    Argument::AccelConversion,
);

const OWN_AXES: &str =
    "Axes are those of the recording; they have to be those of the sensor in the autopilot.";

/// The driver's conversion in a formula.
fn converted(conversion: &Conversion, unit: &str) -> String {
    let list = |values: [f64; 3]| values.map(|v| format!("{v:.6}")).join(", ");
    let (factors, zeros) = (list(conversion.si_per_raw), list(conversion.zero_raw));
    format!("[{factors}] (raw - [{zeros}]) {unit}, raw to SI")
}

fn add(cubics: BiasCubics, export: &mut Export) {
    let sensor = cubics.sensor;
    if let Some(settled_c) = cubics.settled_c {
        export.note(format!(
            "{sensor}: the errors below are those with the scale factors of {settled_c:.1} °C."
        ));
    }
    let [from, to] = cubics.range_c;
    export.formula(format!(
        "{sensor}: reading = {}; the firmware then subtracts the bias, a cubic in (T - {:.1} °C) for T from {from:.1} to {to:.1} °C",
        converted(&cubics.conversion, cubics.unit),
        cubics.reference_c,
    ));
    export.remaining.extend(remaining::of_cubics(&cubics));
    export.cubics.push(cubics);
}
