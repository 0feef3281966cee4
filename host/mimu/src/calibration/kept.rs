//! The calibration that a device keeps, as a file again.

use mimu_core::compensation::Affine;
use mimu_core::effects::{Sensor as DeviceSensor, Variable};
use nalgebra::{Matrix3, Vector3};

use super::effect::{DIRECTION, FORMULA as FORMULA_OF_EFFECTS, candidate};
use super::of_fit::{forward_table, physical_table};
use super::{
    Calibration, CoefficientTable, ConverterTable, EffectTable, FORMAT, FORMULA, FormTable,
    INVERSE_DIRECTION, OnDevice, Origin, TriadTable, What,
};
use crate::effects::candidate::Candidate;
use crate::effects::converter::{BITS, Converter};
use crate::effects::quantity::Quantity;
use crate::effects::readout;
use crate::effects::regressor::Product;
use crate::quantity::{AXES, Sensor};
use crate::triad::{Angles, Triad};
use mimu_recording::RawUnit;
use mimu_recording::error::{Error, Result};

/// What a device keeps of a calibration, raw in V: numbers of single precision, each as it is.
#[derive(Debug, Clone)]
pub struct Kept {
    /// Name of the unit.
    pub device: String,
    /// As in [`Calibration::unit_id`].
    pub unit_id: Option<String>,
    /// As in [`Calibration::created`].
    pub created: Option<String>,
    /// As in [`Origin::sha256`].
    pub sha256: Option<String>,
    /// Temperature of the node, °C.
    pub temp_c: f32,
    /// Inverse models of the gyro and of the accelerometer: rad/s and m/s² from V.
    pub models: [Affine<f32>; 2],
    /// What they lack. Converters of the axes of a triad are parts of one effect.
    pub effects: Vec<OnDevice<f32>>,
}

impl Calibration {
    /// The calibration that a device keeps, without what it does not keep: how well the numbers are known, what was known of the
    /// input, local gravity. The device makes the same bytes of it.
    ///
    /// # Errors
    /// An effect that this program does not know; `place` is where it comes from.
    pub fn kept(kept: &Kept, place: &str) -> Result<Self> {
        let singular = || Error::new(place, "C is singular", "upload a calibration again");
        let [gyro, accel] = &kept.models;
        let triad = |model, sensor| triad_table(model, sensor).ok_or_else(singular);
        let calibration = Self {
            format: FORMAT.into(),
            device: kept.device.clone(),
            unit_id: kept.unit_id.clone(),
            created: kept.created.clone(),
            tool: concat!("mimu ", env!("CARGO_PKG_VERSION")).into(),
            recording: Origin {
                sha256: kept.sha256.clone(),
                reference: None,
                raw_unit: RawUnit::Volt,
                gravity_mps2: None,
                temp_c: Some(f64::from(kept.temp_c)),
            },
            gyro: Some(triad(gyro, Sensor::Gyro)?),
            accel: Some(triad(accel, Sensor::Accel)?),
            effect_tables: effect_tables(&kept.effects, place)?,
            effects: Vec::new(),
        };
        calibration.checked(place)
    }
}

/// `None` if the matrix is singular.
fn triad_table(model: &Affine<f32>, sensor: Sensor) -> Option<TriadTable> {
    let inverse = Affine {
        matrix: model.matrix.map(f64::from),
        offset: model.offset.map(f64::from),
    };
    // Its sigmas are of no covariance, and are left out.
    let triad = Triad::from_inverse(inverse, Vec::new())?;
    let Affine { matrix, offset }: Affine<f64> = inverse;
    Some(TriadTable {
        formula: FORMULA.into(),
        direction: INVERSE_DIRECTION.into(),
        raw_unit: RawUnit::Volt,
        unit: sensor.unit().into(),
        frame: "body".into(),
        C: rows(&matrix),
        o: exact(&offset),
        sigma_C: None,
        sigma_o: None,
        interval_C: None,
        interval_o: None,
        parameters: Vec::new(),
        covariance: Vec::new(),
        judged: None,
        forward: forward_table(&triad.forward),
        physical: physical_table(&triad.physical(Angles::Exact)),
    })
}

// Also with the sign of a zero: the bytes that are made of it are the same then.

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

fn exact(vector: &Vector3<f64>) -> [f64; 3] {
    (*vector).into()
}

fn effect_tables(parts: &[OnDevice<f32>], place: &str) -> Result<Vec<EffectTable>> {
    let mut all: Vec<EffectTable> = Vec::new();
    for part in parts {
        let unknown = || {
            let problem = format!("it keeps the effect {:?}, which is not known here", part.id);
            Error::new(place, problem, "update mimu on this computer")
        };
        let table = effect_table(part).ok_or_else(unknown)?;
        let converters = !table.converters.is_empty();
        match all.iter_mut().find(|t| converters && t.id == table.id) {
            Some(known) => {
                known.converters.extend(table.converters);
                known.coefficients.extend(table.coefficients);
            }
            None => all.push(table),
        }
    }
    Ok(all)
}

fn effect_table(part: &OnDevice<f32>) -> Option<EffectTable> {
    let of = match &part.what {
        What::Term {
            axis, variables, ..
        } => candidate(&term_id(part.sensor, *axis, variables)?)?,
        _ => candidate(&part.id)?,
    };
    let (mut form, mut converters) = (None, Vec::new());
    let values: Vec<(usize, f32)> = match &part.what {
        What::Named {
            coefficients,
            form: value,
        } => {
            form = of.parameter().zip(*value).map(|(p, value)| FormTable {
                name: p.name.into(),
                value: f64::from(value),
            });
            // What was not determined is zero there, and stays out of the file.
            let all = || coefficients.iter().copied().enumerate();
            match all().any(|(_, c)| c != 0.0) {
                true => all().filter(|(_, c)| *c != 0.0).collect(),
                false => all().collect(),
            }
        }
        What::Code {
            axis,
            errors,
            weight,
            zero,
        } => {
            let converter = Converter::of(f64::from(*weight), f64::from(*zero));
            let codes =
                std::array::from_fn(|i| axis.is_none_or(|axis| axis == i).then_some(converter));
            converters = ConverterTable::of(&codes);
            let first = axis.map_or(0, readout::first_of);
            (first..first + BITS).zip(errors.iter().copied()).collect()
        }
        What::Term { coefficient, .. } => vec![(0, *coefficient)],
    };
    let active: Vec<usize> = values.iter().map(|v| v.0).collect();
    if !active.iter().all(|k| of.active.contains(k)) {
        return None;
    }
    let named = Candidate {
        active,
        ..of.clone()
    };
    let coefficients = named.names().into_iter().zip(&values);
    Some(EffectTable {
        id: of.id(),
        sensor: of.sensor.name().into(),
        about: of.about().into(),
        formula: FORMULA_OF_EFFECTS.into(),
        direction: DIRECTION.into(),
        form,
        converters,
        coefficients: coefficients
            .map(|((name, unit), (_, value))| CoefficientTable {
                name,
                value: f64::from(*value),
                sigma: None,
                unit,
            })
            .collect(),
    })
}

/// Public id of a term.
fn term_id(sensor: DeviceSensor, axis: usize, variables: &[Variable]) -> Option<String> {
    let sensor = match sensor {
        DeviceSensor::Gyro => Sensor::Gyro,
        DeviceSensor::Accel => Sensor::Accel,
    };
    let quantities: Vec<Quantity> = variables.iter().map(|v| quantity(*v)).collect();
    let product = Product::term(&quantities)?;
    Some(format!(
        "term:{sensor}_{}~{}",
        AXES.get(axis)?,
        product.name()
    ))
}

fn quantity(of: Variable) -> Quantity {
    match of {
        Variable::RateX => Quantity::Rate(0),
        Variable::RateY => Quantity::Rate(1),
        Variable::RateZ => Quantity::Rate(2),
        Variable::ForceX => Quantity::Force(0),
        Variable::ForceY => Quantity::Force(1),
        Variable::ForceZ => Quantity::Force(2),
        Variable::Temperature => Quantity::Temperature,
        Variable::TemperatureRate => Quantity::TemperatureRate,
        Variable::Time => Quantity::Time,
    }
}
