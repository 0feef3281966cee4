//! Triads beyond the first gyro and accelerometer, for the formats with a place for them.
//!
//! A [`BodyTriad`] has C and o in its own frame, and R from there to the frame of its reference. A format with the whole matrix takes `R C`, which gives the
//! field in the frame of the gyro. One with a symmetric matrix S, as the autopilots' compasses, takes that of the polar factors `R C = Q S`: the size of the
//! field is right, and the rotation Q is left to the program's setting of the mounting. One with factors for each axis takes the sensor's own axes.
//!
//! A magnetometer in SI reads microtesla, as its calibration gives them. If its calibration knows no size of the field (unit `field`), the field counts as
//! 1: enough for directions, and no gauss.

use clap::Args;
use mimu::calibration::bias_cubic::KnownConversion;
use mimu::{BodyTriad, Calibration};
use mimu_recording::{Error, RawUnit, Result, TriadKind, TriadName};
use nalgebra::{Matrix3, Rotation3};

use crate::Export;
use crate::driver::{Readings, positive};

/// Unit of a magnetometer whose field has no known size.
pub(crate) const FIELD: &str = "field";

/// What the user knows of a magnetometer's driver.
#[derive(Debug, Clone, Default, Args)]
pub struct Options {
    /// µT per raw unit by which the driver converts a magnetometer; without it as the calibration does, and 1 for readings in µT
    #[arg(long, value_name = "UT", value_parser = positive)]
    pub mag_ut_per_raw: Option<f64>,
}

/// A note on the further triads of `calibration`, for a format without a place for them.
pub(crate) fn no_place(calibration: &Calibration) -> Option<String> {
    let names = list(calibration.body.iter().map(|triad| triad.triad));
    names.map(|names| {
        format!(
            "{names}: the format has a gyro and an accelerometer only, so this is not in the file."
        )
    })
}

/// A note on the further triads that `has` does not name.
pub(crate) fn left_out(
    calibration: &Calibration,
    has: impl Fn(TriadName) -> bool,
) -> Option<String> {
    let names = calibration.body.iter().map(|triad| triad.triad);
    let names = list(names.filter(|name| !has(*name)));
    names.map(|names| format!("{names}: the format has no place for it, so it is not in the file."))
}

/// The first magnetometer, for a format with a place for one; notes the triads that are left out.
pub(crate) fn only_mag<'a>(
    calibration: &'a Calibration,
    export: &mut Export,
) -> Option<&'a BodyTriad> {
    let is_it = |name: TriadName| name == TriadName::MAG;
    export.notes.extend(left_out(calibration, is_it));
    calibration.body.iter().find(|triad| is_it(triad.triad))
}

fn list(names: impl Iterator<Item = TriadName>) -> Option<String> {
    let names: Vec<String> = names.map(|name| name.to_string()).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// A number with so many decimals; zero has no sign.
fn rounded(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(size) if size.chars().all(|c| matches!(c, '0' | '.')) => size.into(),
        _ => text,
    }
}

/// What a file's head says of a triad.
pub(crate) fn line(triad: &BodyTriad) -> String {
    let three = |v: [f64; 3], digits: usize| {
        let values = v.map(|v| rounded(v, digits));
        format!("[{}]", values.join(", "))
    };
    let (name, reference) = (triad.triad, triad.reference);
    let mut line = format!(
        "{name}: readings in {}, output in {}",
        raw_unit(triad),
        triad.unit
    );
    match triad.rotation_deg {
        Some(vector) => {
            let vector = three(vector, 4);
            line +=
                &format!("; rotation vector from its frame to that of {reference} {vector} deg");
        }
        None => line += &format!("; its rotation to {reference} is not known"),
    }
    if let Some(delay_ms) = triad.delay_ms {
        line += &format!("; {delay_ms:.3} ms later than {reference}");
    }
    if let Some(arm_mm) = triad.lever_arm_mm {
        let arm_mm = three(arm_mm, 2);
        line += &format!("; at {arm_mm} mm from {reference}, in the frame of {reference}");
    }
    if let Some(iron) = triad.iron {
        let (per_k, unit) = (three(iron.per_k, 4), &triad.unit);
        line += &format!(
            "; at {:.1} °C: its iron adds {per_k} {unit} per kelvin, which is left",
            iron.temp_c
        );
    }
    line
}

/// Unit of the readings; those of a magnetometer in SI are in µT.
pub(crate) fn raw_unit(triad: &BodyTriad) -> String {
    match (triad.triad.kind, triad.raw_unit) {
        (TriadKind::Mag, RawUnit::Si) => "uT".into(),
        (_, unit) => unit.to_string(),
    }
}

/// Readings of a driver in the frame of the reference, or if `own` in that of the triad. Without a factor it is one for readings in SI or µT, and
/// otherwise that of the calibration.
///
/// # Errors
/// C is singular.
pub(crate) fn readings(
    triad: &BodyTriad,
    own: bool,
    si_per_raw: Option<f64>,
    place: &str,
) -> Result<Readings> {
    let model = if own {
        triad.model()
    } else {
        triad.in_reference()
    };
    let known = KnownConversion {
        si_per_raw,
        zero_raw: None,
    };
    let of = (triad.triad, triad.unit.as_str());
    Readings::of(of, &model, &known, triad.raw_unit, place)
}

impl Options {
    /// Readings of a magnetometer's driver, µT. `None`, with a note, if the size of the field is not known: gyro and accelerometer do not depend on it.
    ///
    /// # Errors
    /// C is singular, or the size of the field is not known and the calibration has nothing else.
    pub(crate) fn microtesla(
        &self,
        (calibration, place): (&Calibration, &str),
        mag: &BodyTriad,
        export: &mut Export,
    ) -> Result<Option<Readings>> {
        if mag.unit != FIELD {
            return readings(mag, false, self.mag_ut_per_raw, place).map(Some);
        }
        let problem = "its unit is that of the field, whose size is not known, and the program needs a magnetic flux density";
        let remedy = "fit the recording again with the size of the field: mimu fit --field UT";
        if calibration.gyro.is_none() && calibration.accel.is_none() {
            let place = format!("{place}, [[body]] {}", mag.triad);
            return Err(Error::new(place, problem, remedy));
        }
        export.note(format!(
            "{} is not in the file: {problem}. To have it there, {remedy}.",
            mag.triad
        ));
        Ok(None)
    }
}

/// Notes the factor that a driver is taken to have, if it is neither given nor one, and what it does.
pub(crate) fn note_driver(
    readings: &Readings,
    triad: &BodyTriad,
    given: bool,
    export: &mut Export,
) {
    export.note(readings.line());
    if !given && triad.raw_unit != RawUnit::Si {
        let name = triad.triad;
        export.note(format!(
            "{name}: the driver is assumed to convert with the scale factors of the calibration."
        ));
    }
}

/// Notes what an offset for each axis leaves of the readings, and with `scales` a factor for each.
pub(crate) fn note_axes(readings: &Readings, scales: bool, export: &mut Export) {
    let (name, p) = (readings.triad, &readings.forward.matrix);
    let across = (0..9).filter(|k| k / 3 != k % 3);
    let across = across.map(|k| (p[(k / 3, k % 3)] / p[(k / 3, k / 3)]).abs());
    let across = 100.0 * across.fold(0.0, f64::max);
    let off = 100.0 * p.diagonal().map(|gain| (gain.abs() - 1.0).abs()).max();
    let scales = match scales {
        true => String::new(),
        false => format!(", scale factors of up to {off:.2} %"),
    };
    export.note(format!(
        "{name}: what remains: cross terms of up to {across:.2} %{scales}."
    ));
}

/// Notes the rotation that is left where a program stores a symmetric matrix: `turned` is Q of `R C = Q S`.
///
/// # Errors
/// The axes are mirrored, which no rotation takes out.
pub(crate) fn note_rotation(
    triad: &BodyTriad,
    turned: &Matrix3<f64>,
    place: &str,
    export: &mut Export,
) -> Result<()> {
    let name = triad.triad;
    if turned.determinant() < 0.0 {
        let problem = "its axes form a left-handed system, and the program only rotates";
        let remedy = "record it with the axes of the program: invert one column, and fit again";
        return Err(Error::new(
            format!("{place}, [[body]] {name}"),
            problem,
            remedy,
        ));
    }
    if triad.rotation_deg.is_none() {
        export.note(format!(
            "{name}: its rotation to {} is not known, so the mounting has to be right in the program's settings.",
            triad.reference
        ));
        return Ok(());
    }
    let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(*turned).euler_angles();
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(|v| rounded(v.to_degrees(), 2));
    let degrees = Rotation3::from_matrix_unchecked(*turned)
        .angle()
        .to_degrees();
    export.note(format!(
        "{name}: the matrix of the file is symmetric. What it gives still has to be turned by {degrees:.2} deg to the frame of {}, first roll {roll}, then pitch {pitch}, then yaw {yaw} deg: if that is much, set the mounting in the program.",
        triad.reference
    ));
    Ok(())
}
