//! Rust source for programs with `mimu-core`: the stored numbers as readable constants, and a function that builds a
//! [`Compensator`](mimu_core::compensator::Compensator) from them.
//!
//! The alternative, the stored bytes as a constant and [`mimu_core::stored::decode`], is the format [`core`](crate::core). Here nothing is decoded.
//! The program therefore contains neither the decoder nor its checks, nodes and effects take only the room they need instead of that of 16 and 8, and
//! a change of the calibration is visible as a change of its numbers. Every `f32` is written as the shortest decimal number that equals it, so that
//! results match the device's to the last bit.

use std::fmt::Write as _;

use mimu::calibration::reference_node;
use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::{DeviceEffect, Directions, Variable};
use mimu_core::stored;
use mimu_core::table::Node;
use mimu_device::Image;
use mimu_recording::error::{Error, Result};
use nalgebra::Matrix3;

use crate::remaining::{self, Places};
use crate::{Export, Sources, heading};

/// Text of the module.
///
/// # Errors
/// The errors of [`Image::new`]: a triad is missing, readings are in SI, or an effect cannot be removed on a device.
pub fn export(from: &Sources) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let image = Image::new(calibration, place)?;
    let (mut nodes, mut effects) = (Vec::new(), Vec::new());
    let read = stored::read(&image.bytes, |n| nodes.push(*n), |e| effects.push(*e));
    let read = read.map_err(|refused| {
        let problem = format!("the device could not use it: {refused}");
        Error::new(place, problem, "fit the recording again")
    })?;
    let mut export = Export::new("rust", from);
    export.formulas = vec![
        "x = C u + o, raw to SI. compensator() makes it; state(), follow() and apply() of mimu_core::compensator::Compensator run it.".into(),
        format!("It computes the same as the device with the calibration of hash {}, to the last bit.", image.hash),
    ];
    export.notes.extend(image.warnings);
    let places = Places {
        cross_terms: true,
        temperature: true,
        effects: true,
    };
    export.remaining = remaining::of(calibration, places)?;
    let head = heading::comments("//!", &heading::of_calibration(calibration, &export));
    let text = Module {
        nodes: &nodes,
        effects: &effects,
        range_c: read.compensator.table.range_c(),
        lags_s: read.lags_s.map(|lags| [lags.gyro, lags.accel]),
    };
    export.content = text.write(&head).into_bytes();
    Ok(export)
}

struct Module<'a> {
    nodes: &'a [Node<f32>],
    effects: &'a [DeviceEffect<f32>],
    range_c: Option<[f32; 2]>,
    lags_s: Option<[f32; 2]>,
}

impl Module<'_> {
    fn write(&self, head: &str) -> String {
        let mut out = format!("{head}\n#![allow(clippy::approx_constant)]\n\n");
        out.push_str("use mimu_core::compensation::Affine;\nuse mimu_core::compensator::Compensator;\nuse mimu_core::die::DieLag;\n");
        if !self.effects.is_empty() {
            let mut used = vec!["DeviceEffect", "Directions", "Effects"];
            if self.effects.iter().any(|e| e.product().is_some()) {
                used.push("Variable");
            }
            let _ = writeln!(out, "use mimu_core::effects::{{{}}};", used.join(", "));
        }
        out.push_str("use mimu_core::table::{Node, Table};\n");
        let sensors = self.effects.iter().any(|e| e.product().is_some());
        out.push_str(match sensors {
            true => "use mimu_core::{PerSensor, Sensor};\n",
            false => "use mimu_core::PerSensor;\n",
        });
        let _ = write!(
            out,
            "\n/// Nodes over temperature.\npub const NODES: usize = {};\n/// Room for effects of a triad and kind.\npub const ROOM: usize = {};\n",
            self.nodes.len(),
            self.effects.len()
        );
        out.push_str(TRIAD);
        let _ = writeln!(
            out,
            "/// Temperature of the dies, °C; gyro (rad/s) and accelerometer (m/s²), raw to SI; their derivatives, per kelvin.\nconst NODE: [(f32, [Triad; 2], [Triad; 2]); NODES] = ["
        );
        for node in self.nodes {
            let _ = writeln!(
                out,
                "    (\n        {:?},\n        {},\n        {},\n    ),",
                node.temp_c,
                triads(&node.model),
                triads(&node.slope)
            );
        }
        out.push_str("];\n\n");
        self.constructor(&mut out);
        out
    }

    fn constructor(&self, out: &mut String) {
        out.push_str("/// The calibration, immutable, for any number of streams. `None` only if this version of mimu-core has no such effect.\npub fn compensator() -> Option<Compensator<f32, NODES, ROOM>> {\n");
        out.push_str("    let nodes = NODE.iter().map(|(temp_c, model, slope)| Node {\n        temp_c: *temp_c,\n        model: PerSensor::from(model.map(affine)),\n        slope: PerSensor::from(slope.map(affine)),\n    });\n    let table = Table::new(nodes).ok()?;\n");
        if let Some([from, to]) = self.range_c {
            let _ = writeln!(
                out,
                "    // Temperatures of the dies that it was found from, °C.\n    let table = table.with_range([{from:?}, {to:?}]).ok()?;"
            );
        }
        let lags = match self.lags_s {
            Some([gyro, accel]) => {
                format!("Some(PerSensor::from([{gyro:?}, {accel:?}]))")
            }
            None => "None".into(),
        };
        let _ = writeln!(
            out,
            "    // Seconds by which the dies of gyro and accelerometer follow the thermometer.\n    let lags = DieLag::of_triads({lags});"
        );
        let effects = match self.effects.is_empty() {
            true => "None",
            false => {
                self.push_effects(out);
                "Some(effects)"
            }
        };
        let _ = writeln!(
            out,
            "    Some(Compensator {{\n        table,\n        lags,\n        effects: {effects},\n    }})\n}}"
        );
    }

    fn push_effects(&self, out: &mut String) {
        let temperatures: Vec<f64> = self.nodes.iter().map(|n| n.temp_c.into()).collect();
        // Effects use the C that they were fitted with, as in the stored calibration.
        let at = reference_node(&temperatures).unwrap_or_default();
        let found_with = self.nodes[at].model.as_ref();
        let directions =
            found_with.map(|model| Directions::<f32>::of(&model.matrix.map(f64::from)));
        out.push_str("    // Sensitive directions by rows, and their inverse.\n    let mut effects = Effects::of(PerSensor {\n");
        for (sensor, of) in directions {
            let Some(of) = of else { continue };
            let _ = writeln!(
                out,
                "        {sensor}: Directions {{\n            sensed: affine(({}, [0.0; 3])).matrix,\n            to_body: affine(({}, [0.0; 3])).matrix,\n        }},",
                rows(&of.sensed),
                rows(&of.to_body)
            );
        }
        out.push_str("    })\n    .within(table.limits());\n");
        for effect in self.effects {
            let _ = writeln!(
                out,
                "    // {effect}\n    let effect = {};\n    effects.push(effect.ok()?).ok()?;",
                constructed(effect)
            );
        }
    }
}

/// The expression that constructs an effect.
fn constructed(effect: &DeviceEffect<f32>) -> String {
    let coefficients = list(effect.coefficients());
    let sensor = format!("Sensor::{:?}", effect.sensor());
    if let Some((axis, variables)) = effect.product() {
        let names: Vec<String> = variables
            .map(|v: Variable| format!("Variable::{v:?}"))
            .collect();
        let [coefficient] = effect.coefficients() else {
            return String::new();
        };
        let names = names.join(", ");
        return format!("DeviceEffect::term({sensor}, {axis}, {coefficient:?}, &[{names}])");
    }
    let nonlinear = effect.nonlinear();
    format!("DeviceEffect::named(\"{effect}\", &{coefficients}, {nonlinear:?})")
}

fn triads(of: &Compensation<f32>) -> String {
    let one = |a: &Affine<f32>| format!("({}, {})", rows(&a.matrix), list(a.offset.as_slice()));
    format!("[{}, {}]", one(&of.gyro), one(&of.accel))
}

fn rows(matrix: &Matrix3<f32>) -> String {
    let row = |i: usize| list(&[matrix[(i, 0)], matrix[(i, 1)], matrix[(i, 2)]]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}

fn list(values: &[f32]) -> String {
    format!("{values:?}")
}

const TRIAD: &str = "
/// C by rows, and o.
type Triad = ([[f32; 3]; 3], [f32; 3]);

fn affine((c, o): Triad) -> Affine<f32> {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = c;
    Affine {
        // By columns.
        matrix: [[xx, yx, zx], [xy, yy, zy], [xz, yz, zz]].into(),
        offset: o.into(),
    }
}

";
