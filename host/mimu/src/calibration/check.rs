//! Checks whether a calibration file can be applied.

use mimu_core::compensation::{Affine, Implausible};
use mimu_core::table::{TEMPERATURE_RANGE_C, is_temperature};
use nalgebra::{Matrix3, Vector3};

use super::{
    Calibration, FORMAT, FORMAT_OF_CURVES, FORMULA, INVERSE_DIRECTION, TriadTable, effect,
};
use crate::quantity::{PerSensor, Sensor};
use crate::triad::Forward;
use mimu_recording::error::{Error, Result};

impl Calibration {
    /// The calibration, if it can be applied.
    pub(super) fn checked(self, place: &str) -> Result<Self> {
        self.check_format(place)?;
        for sensor in Sensor::BOTH {
            let Some(table) = self.table(sensor) else {
                continue;
            };
            let place = format!("{place}, [{sensor}]");
            let numbers = table
                .C
                .iter()
                .flatten()
                .chain(&table.o)
                .chain(table.covariance.iter().flatten())
                .chain(table.covariance_by_noise.iter().flatten());
            if !numbers.into_iter().all(|x| x.is_finite()) {
                return Err(Error::new(
                    place,
                    "C, o or covariance has an entry that is not a number",
                    "fit the recording again",
                ));
            }
            if table.direction != INVERSE_DIRECTION || table.formula != FORMULA {
                let problem = format!(
                    "formula {:?}, direction {:?}: only {FORMULA}, {INVERSE_DIRECTION}, can be applied",
                    table.formula, table.direction
                );
                return Err(Error::new(
                    place,
                    problem,
                    "use the version of mimu that wrote it",
                ));
            }
            if let Some((there, missing)) = table.half_uncertain() {
                return Err(Error::new(
                    place,
                    format!("it has {there} but not {missing}: the file is cut or was edited"),
                    "copy it again, or fit the recording again",
                ));
            }
            let known = table.sigma_C.is_some();
            let square = |rows: &[Vec<f64>]| rows.len() == 12 && rows.iter().all(|r| r.len() == 12);
            let is_square = |rows: &[Vec<f64>]| rows.is_empty() || square(rows);
            if known && !square(&table.covariance)
                || !is_square(&table.covariance)
                || !is_square(&table.covariance_by_noise)
            {
                return Err(Error::new(
                    place,
                    "covariance is not 12 by 12",
                    "fit the recording again",
                ));
            }
            if let Some(fault) = table.next_power_on.as_ref().and_then(|n| n.fault()) {
                return Err(Error::new(place, fault, "fit the recordings again"));
            }
            let inverse = self.inverse(sensor);
            let problem = inverse.as_ref().and_then(|model| implausible(model, None));
            let forward = inverse.as_ref().and_then(Forward::of);
            let (None, Some(forward)) = (&problem, forward) else {
                let problem = problem.unwrap_or_else(|| Implausible::Singular.to_string());
                return Err(Error::new(place, problem, "fit the recording again"));
            };
            check_both_ways(table, &forward, &place)?;
        }
        self.check_temperatures(place)?;
        self.check_body(place)?;
        let digits = |id: &str| id.len() == 24 && id.bytes().all(|b| b.is_ascii_hexdigit());
        if let Some(id) = self.unit_id.as_ref().filter(|id| !digits(id)) {
            return Err(Error::new(
                format!("{place}, unit_id"),
                format!("{id:?} is not a unit's number"),
                "write 24 hexadecimal digits, as `mimu device info` gives them, or leave the key out",
            ));
        }
        if self.gyro.is_none() && self.accel.is_none() && self.body.is_empty() {
            return Err(Error::new(
                place,
                "the file has neither [gyro] nor [accel]",
                "fit the recording again",
            ));
        }
        effect::check(&self, place)?;
        Ok(self)
    }

    /// Whether each further triad is there once, and can be applied.
    fn check_body(&self, place: &str) -> Result<()> {
        for (k, of) in self.body.iter().enumerate() {
            let arm = of.lever_arm_mm.iter().flatten();
            let rotation = of.rotation_deg.iter().flatten();
            let iron = of
                .iron
                .iter()
                .flat_map(|iron| iron.per_k.iter().chain([&iron.temp_c]));
            let numbers =
                of.C.iter()
                    .flatten()
                    .chain(&of.o)
                    .chain(rotation)
                    .chain(arm)
                    .chain(iron);
            let matrix = Matrix3::from_fn(|i, j| of.C[i][j]);
            let problem = if !numbers.chain(&of.delay_ms).all(|x| x.is_finite()) {
                "it has an entry that is not a number"
            } else if matrix.try_inverse().is_none() {
                "C is singular"
            } else if of.formula != FORMULA {
                "its formula is unknown: only x = C u + o can be applied"
            } else if self.body[..k].iter().any(|other| other.triad == of.triad) {
                "it is there twice"
            } else {
                continue;
            };
            let place = format!("{place}, [[body]] of {}", of.triad);
            return Err(Error::new(place, problem, "fit the recording again"));
        }
        Ok(())
    }

    fn check_format(&self, place: &str) -> Result<()> {
        let curves = self.temperature.is_some();
        let expected = if curves { FORMAT_OF_CURVES } else { FORMAT };
        let problem = match self.format.as_str() {
            format if format == expected => return Ok(()),
            FORMAT => {
                "the file has a [temperature], but its format is that of a calibration without one"
            }
            FORMAT_OF_CURVES => {
                "the file has no [temperature], but its format is that of a calibration with one"
            }
            other => {
                let problem = format!(
                    "format is {other:?}, and this program reads {FORMAT:?} and {FORMAT_OF_CURVES:?}"
                );
                let remedy = "use the version of mimu that wrote it";
                return Err(Error::new(place, problem, remedy));
            }
        };
        let remedy = "the file is cut or was edited: copy it again, or fit the recordings again";
        Err(Error::new(place, problem, remedy))
    }

    fn check_temperatures(&self, place: &str) -> Result<()> {
        let refuse = |problem: String| {
            let place = format!("{place}, [recording]");
            Err(Error::new(place, problem, "fit the recording again"))
        };
        let of = &self.recording;
        let range = of.temp_range_c;
        let problem = range.and_then(|range| problem_of_range("temp_range_c", range));
        let problem = problem.or_else(|| problem_of_temperature(of.temp_c?));
        if let Some(problem) = problem {
            return refuse(problem);
        }
        match &self.temperature {
            None => Ok(()),
            Some(all) => {
                let has = PerSensor::from_fn(|sensor| self.table(sensor).is_some());
                all.check(place, has)
            }
        }
    }
}

impl TriadTable {
    /// Of the entries that belong together, one that is there and one that is missing, if there are both.
    fn half_uncertain(&self) -> Option<(&'static str, &'static str)> {
        let all = [
            ("sigma_C", self.sigma_C.is_some()),
            ("sigma_o", self.sigma_o.is_some()),
            ("interval_C", self.interval_C.is_some()),
            ("interval_o", self.interval_o.is_some()),
            ("covariance", !self.covariance.is_empty()),
            ("[judged]", self.judged.is_some()),
        ];
        let there = all.iter().find(|(_, there)| *there)?;
        let missing = all.iter().find(|(_, there)| !*there)?;
        Some((there.0, missing.0))
    }
}

/// Why no sensor has this model, by the limits that the device has too; `slope`: derivative by the temperature, per kelvin.
pub(super) fn implausible(model: &Affine<f64>, slope: Option<&Affine<f64>>) -> Option<String> {
    model.check(slope).err().map(|problem| problem.to_string())
}

/// Refuses a file in which the two directions of the calibration disagree: one of them was edited.
fn check_both_ways(table: &TriadTable, forward: &Forward, place: &str) -> Result<()> {
    let (matrix, offset) = (forward.matrix, forward.bias);
    let off_p = Matrix3::from_fn(|i, j| table.forward.P[i][j] - matrix[(i, j)]);
    let off_b = Vector3::from(table.forward.b) - offset;
    // Both are written to all their digits; what an inversion loses stays far below.
    let alike = off_p.norm() <= 1e-6 * matrix.norm()
        && off_b.norm() <= 1e-6 * (offset.norm() + matrix.norm());
    if alike {
        return Ok(());
    }
    Err(Error::new(
        place,
        "C and o are not the inverse of forward.P and forward.b: the file was edited",
        "fit the recording again",
    ))
}

/// What is wrong with a range of temperatures, °C, that has this `name` in a file.
pub(super) fn problem_of_range(name: &str, [from, to]: [f64; 2]) -> Option<String> {
    let [least, most] = TEMPERATURE_RANGE_C;
    let right = is_temperature(from) && is_temperature(to) && from <= to;
    (!right).then(|| format!(
        "{name} is [{from}, {to}]; it has to increase, from {least} °C at least to {most} °C at most"
    ))
}

/// What is wrong with a temperature, °C.
pub(super) fn problem_of_temperature(temp_c: f64) -> Option<String> {
    let [least, most] = TEMPERATURE_RANGE_C;
    (!is_temperature(temp_c))
        .then(|| format!("temp_c is {temp_c}; it has to be from {least} to {most} °C"))
}
