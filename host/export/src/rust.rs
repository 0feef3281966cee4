//! Rust source for programs with `mimu-core`: the stored numbers as readable constants, and a function that builds a
//! [`Compensator`](mimu_core::compensator::Compensator) from them.
//!
//! The alternative, the stored bytes as a constant and [`mimu_core::stored::decode`], is the format [`core`](crate::core). Here nothing is decoded.
//! The program therefore contains neither the decoder nor its checks, nodes and effects take only the room they need instead of that of 16 and 8, and
//! a change of the calibration is visible as a change of its numbers. Every `f32` is written as the shortest decimal number that equals it, so that
//! results match the device's to the last bit.

use mimu::calibration::{Calibration, DeviceCalibration, reference_node};
use mimu::{BodyTriad, PerSensor, Sensor};
use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::{DeviceEffect, Directions, Variable};
use mimu_core::stored;
use mimu_core::table::Node;
use mimu_device::Image;
use mimu_recording::{Error, RawUnit, Result, UNNAMED};
use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

use crate::format::Whole;
use crate::keyed::Keyed;
use crate::remaining::Places;
use crate::template::fill;
use crate::{Export, Nothing, Page, Sources, Target};

/// The format.
pub struct Rust;

impl Target for Rust {
    type Options = Nothing;
    const NAME: &str = "rust";
    const ABOUT: &str = "Constants and a function for Rust programs with mimu-core";
    const CONTENTS: &str = "everything, as constants";
    const READERS: &str = "Rust programs with `mimu-core`";
    const FURTHER_TRIADS: bool = true;
    const WHOLE: Option<Whole> = Some(whole);
    const PAGES: &[Page] = &[Page::of("Rust with mimu-core", "calibration.rs")];

    /// # Errors
    /// The errors of [`Image::new`]: a triad is missing, readings are in SI, or an effect cannot be removed on a device.
    fn export(from: &Sources, _: &Nothing) -> Result<Export> {
        let (calibration, place) = from.calibration()?;
        let image = Image::new(calibration, place)?;
        let (mut nodes, mut effects) = (Vec::new(), Vec::new());
        let read = stored::read(&image.bytes, |n| nodes.push(*n), |e| effects.push(*e));
        let read = read.map_err(|refused| {
            let problem = format!("the device could not use it: {refused}");
            Error::new(place, problem, "fit the recording again")
        })?;
        let mut export = Export::new::<Self>(from);
        export.formula("x = C u + o, raw to SI. compensator() makes it; state(), follow() and apply() of mimu_core::compensator::Compensator run it.");
        export.formula(format!(
            "It computes the same as the device with the calibration of hash {}, to the last bit.",
            image.hash
        ));
        export.notes.extend(image.warnings);
        export.leaves(calibration, Places::Effects);
        let [from_c, to_c] = read.compensator.table.range_c().unwrap_or_default();
        let lags = read
            .lags_s
            .map(|l| format!("Some(PerSensor::from([{:?}, {:?}]))", l.gyro, l.accel));
        let products = effects.iter().any(|e| e.product().is_some());
        let values = json!({
            "comments": export.head("//!", from),
            "count": nodes.len(),
            "nodes": nodes.iter().map(node).collect::<Value>(),
            "room": effects.len(),
            "effects": effects.iter().map(effect).collect::<Value>(),
            "products": products,
            "variable": if products { ", Variable" } else { "" },
            "directions": directions(&nodes),
            "ranged": read.compensator.table.range_c().is_some(),
            "from_c": format!("{from_c:?}"),
            "to_c": format!("{to_c:?}"),
            "lags": lags.unwrap_or("None".into()),
            "body": calibration.body.iter().map(further).collect::<Value>(),
            "triads": calibration.body.len(),
        });
        Ok(export.with(fill(include_str!("calibration.rs.in"), &values)))
    }
}

/// A further triad, in the frame of its reference.
fn further(triad: &BodyTriad) -> Value {
    let model = triad.in_reference();
    let single = Affine {
        matrix: model.matrix.map(|v| v as f32),
        offset: model.offset.map(|v| v as f32),
    };
    let rotation = triad.rotation().map(|r| rows(&r.map(|v| v as f32)));
    let delay_s = triad.delay_ms.map(|ms| (1e-3 * ms) as f32);
    let arm_m = triad.lever_arm_mm;
    let arm_m = arm_m.map(|mm| list(&mm.map(|mm| (1e-3 * mm) as f32)));
    let option = |text: Option<String>| text.map_or("None".into(), |text| format!("Some({text})"));
    json!({
        "name": triad.triad.to_string(),
        "reference": triad.reference.to_string(),
        "unit": triad.unit,
        "model": triad_of(&single),
        "rotation": option(rotation),
        "delay_s": format!("{delay_s:?}"),
        "lever_arm_m": option(arm_m),
    })
}

fn node(node: &Node<f32>) -> Value {
    json!({
        "temp_c": format!("{:?}", node.temp_c),
        "model": triads(&node.model),
        "slope": triads(&node.slope),
    })
}

/// Sensitive directions of C that the effects were fitted with, as in the stored calibration.
fn directions(nodes: &[Node<f32>]) -> Value {
    let temperatures: Vec<f64> = nodes.iter().map(|n| n.temp_c.into()).collect();
    let at = reference_node(&temperatures).unwrap_or_default();
    let found_with = nodes[at].model.as_ref().into_iter();
    let of = |(sensor, model): (Sensor, &Affine<f32>)| {
        let of = Directions::<f32>::of(&model.matrix.map(f64::from))?;
        let (sensed, to_body) = (rows(&of.sensed), rows(&of.to_body));
        Some(json!({"sensor": sensor.name(), "sensed": sensed, "to_body": to_body}))
    };
    found_with.filter_map(of).collect()
}

/// An effect and the expression that constructs it.
fn effect(effect: &DeviceEffect<f32>) -> Value {
    let coefficients = list(effect.coefficients());
    let constructed = match (effect.product(), effect.coefficients()) {
        (Some((axis, variables)), [coefficient]) => {
            let names = variables.map(|v: Variable| format!("Variable::{v:?}"));
            let names = names.collect::<Vec<_>>().join(", ");
            let sensor = effect.sensor();
            format!("DeviceEffect::term(Sensor::{sensor:?}, {axis}, {coefficient:?}, &[{names}])")
        }
        _ => {
            let nonlinear = effect.nonlinear();
            format!("DeviceEffect::named(\"{effect}\", &{coefficients}, {nonlinear:?})")
        }
    };
    json!({"id": effect.to_string(), "constructed": constructed})
}

fn triads(of: &Compensation<f32>) -> String {
    format!("[{}, {}]", triad_of(&of.gyro), triad_of(&of.accel))
}

fn triad_of(of: &Affine<f32>) -> String {
    format!("({}, {})", rows(&of.matrix), list(of.offset.as_slice()))
}

fn rows(matrix: &Matrix3<f32>) -> String {
    let row = |i: usize| list(&[matrix[(i, 0)], matrix[(i, 1)], matrix[(i, 2)]]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}

fn list(values: &[f32]) -> String {
    format!("{values:?}")
}

/// The calibration of such a file. Its effects are calls, which are not read.
fn whole(bytes: &[u8], place: &str) -> Option<Result<Calibration>> {
    let file = Keyed::of(std::str::from_utf8(bytes).ok()?);
    let numbers = file
        .numbers("NODE")
        .filter(|_| file.text.contains("mimu_core"))?;
    let affine = |of: &[f64]| Affine {
        matrix: Matrix3::from_row_slice(&of[..9]).cast(),
        offset: Vector3::from_column_slice(&of[9..12]).cast(),
    };
    let both = |of: &[f64]| PerSensor::from([affine(&of[..12]), affine(&of[12..])]);
    let nodes = numbers.as_chunks::<49>().0.iter().map(|of| Node {
        temp_c: of[0] as f32,
        model: both(&of[1..25]),
        slope: both(&of[25..]),
    });
    if file.text.contains("DeviceEffect") || file.text.contains("Some(PerSensor::from") {
        let problem = "its effects and lags are program text, which is not read";
        let remedy = "give the calibration file, or its bytes: mimu export core";
        return Some(Err(Error::new(place, problem, remedy)));
    }
    let units = [RawUnit::Volt, RawUnit::Count].into_iter();
    let mut named = units.filter(|unit| file.text.contains(&format!("readings in {unit},")));
    Some(Calibration::of_device(
        &DeviceCalibration {
            device: UNNAMED.into(),
            unit_id: None,
            sensors: None,
            raw_unit: named.next().unwrap_or(RawUnit::Volt),
            created: None,
            trimmed: None,
            sha256: None,
            nodes: nodes.collect(),
            range_c: None,
            lags_s: None,
            effects: Vec::new(),
        },
        place,
    ))
}
