//! `[[triad]]` of a rig file: a triad beyond the first gyro and accelerometer.

use serde::{Deserialize, Serialize};

use super::check::{axes, model, parts, refuse};
use super::resolve::triad;
use super::{AffineFile, AxesFile, Parts, RigFile};
use crate::body::{Between, FurtherTruth};
use crate::catalog::{MeasuredQuantity, Sensor};
use crate::converter::RawUnit;
use crate::refusal::{Refusal, within};
use crate::rotation::{Rotation, Vector, scale};

/// One `[[triad]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriadFile {
    /// Stem of its columns: `mag`, or `gyro`, `accel` or `mag` with a number from 2.
    pub name: String,
    /// Default: as the first of its kind; of a magnetometer AK8963.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<Parts>,
    /// Rotation vector from the triad's axes into body axes. Default 0.
    #[serde(default)]
    pub rotation_deg: Vector,
    /// From the board's origin, body axes. Default 0.
    #[serde(default)]
    pub lever_mm: Vector,
    /// Age of the input in a sample. Default 0.
    #[serde(default)]
    pub delay_ms: f64,
    /// Rows of the recording from sample to sample. Default 1.
    #[serde(default = "one")]
    pub every: u32,
    /// Cells of the other rows. Default: empty.
    #[serde(default)]
    pub between: Between,
    /// Quantisation; 0: none. Default: 1 count, or a code of the converter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_raw: Option<f64>,
    /// Field of iron on the board per kelvin of the board above 25 °C, triad's axes; only of a magnetometer. Default 0.
    #[serde(default)]
    pub iron_ut_per_c: Vector,
    /// Its sensors; directions are in the triad's axes.
    #[serde(default)]
    pub axes: AxesFile,
    /// A forward model in place of directions, sensitivities and nulls; columns are the triad's axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub affine: Option<AffineFile>,
}

fn one() -> u32 {
    1
}

/// Highest number of a triad of one kind.
const MOST: u32 = 64;

impl TriadFile {
    /// What it measures; `None` if its name is not that of a further triad.
    fn kind(&self) -> Option<MeasuredQuantity> {
        let (kind, least, number) = [
            ("gyro", MeasuredQuantity::Gyro, 2),
            ("accel", MeasuredQuantity::Accel, 2),
            ("mag", MeasuredQuantity::Mag, 1),
        ]
        .into_iter()
        .find_map(|(stem, kind, least)| Some((kind, least, self.name.strip_prefix(stem)?)))?;
        let n = match number {
            "" => 1,
            _ => number.parse().ok()?,
        };
        // Only a number that is written as in the names of columns: not 1, 02 or +2.
        let plain = number.is_empty() || (n > 1 && number == n.to_string());
        (plain && (least..=MOST).contains(&n)).then_some(kind)
    }

    /// Its sensors by the catalog; those of `unit` are the usual ones.
    fn parts(
        &self,
        file: &RigFile,
        i: usize,
    ) -> Result<(MeasuredQuantity, [&'static Sensor; 3]), Refusal> {
        let Some(kind) = self.kind() else {
            return Err(Refusal::new(
                format!("triad.{i}.name"),
                format!("\"{}\" names no further triad", self.name),
                "give mag, or gyro, accel or mag with a number from 2 to 64, as gyro2",
            ));
        };
        let usual = match kind {
            MeasuredQuantity::Gyro => file.unit.gyro.as_ref(),
            MeasuredQuantity::Accel => file.unit.accel.as_ref(),
            MeasuredQuantity::Mag => None,
        };
        let given = self.part.as_ref().or(usual);
        Ok((kind, parts(&format!("triad.{i}.part"), kind, given)?))
    }

    fn check(&self, file: &RigFile, i: usize) -> Result<(), Refusal> {
        let (kind, parts) = self.parts(file, i)?;
        let at = |key: &str| format!("triad.{i}.{key}");
        if file.triad[..i].iter().any(|other| other.name == self.name) {
            let problem = format!("triad `{}` occurs twice", self.name);
            return refuse(at("name"), problem, "remove one, or give another number");
        }
        axes(&at("axes"), &self.axes, &parts)?;
        model(&at("affine"), &self.affine, &at("axes"), &self.axes)?;
        within(&at("rotation_deg"), &self.rotation_deg, [-360.0, 360.0])?;
        within(&at("lever_mm"), &self.lever_mm, [-1e4, 1e4])?;
        if kind != MeasuredQuantity::Mag && self.iron_ut_per_c != [0.0; 3] {
            let problem = format!("`{}` feels no iron: only a magnetometer does", self.name);
            return refuse(at("iron_ut_per_c"), problem, "remove it");
        }
        within(&at("iron_ut_per_c"), &self.iron_ut_per_c, [-1e3, 1e3])?;
        within(&at("delay_ms"), &[self.delay_ms], [-1000.0, 1000.0])?;
        within(&at("every"), &[f64::from(self.every)], [1.0, 1e6])?;
        within(&at("step_raw"), self.step_raw.as_slice(), [0.0, 1e9])
    }
}

impl RigFile {
    /// Returns the first error of the further triads.
    pub(super) fn check_triads(&self) -> Result<(), Refusal> {
        let mut triads = self.triad.iter().enumerate();
        triads.try_for_each(|(i, triad)| triad.check(self, i))?;
        self.field.as_ref().map_or(Ok(()), |field| field.check())
    }

    /// Draws what the further triads do not give. `code_v` is a code of the converter.
    pub(super) fn further(&mut self, code_v: f64, seed: u64) -> Result<Vec<FurtherTruth>, Refusal> {
        let mut triads = std::mem::take(&mut self.triad);
        let resolved = triads.iter_mut().enumerate().map(|(i, file)| {
            let (kind, parts) = file.parts(self, i)?;
            let step_raw = *file.step_raw.get_or_insert(match parts[0].output {
                RawUnit::V => code_v,
                RawUnit::Count => 1.0,
            });
            let affine = file.affine.as_ref();
            Ok(FurtherTruth {
                name: file.name.clone(),
                kind,
                triad: triad(&mut file.axes, affine, parts, &file.name, seed),
                rotation: Rotation::by(file.rotation_deg.map(f64::to_radians)),
                lever: scale(1e-3, file.lever_mm),
                delay_s: 1e-3 * file.delay_ms,
                every: file.every,
                between: file.between,
                step_raw,
                iron_per_c: file.iron_ut_per_c,
            })
        });
        let resolved = resolved.collect::<Result<_, _>>();
        self.triad = triads;
        resolved
    }
}
