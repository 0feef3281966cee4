//! A C99 header: constants, and functions that convert raw readings to SI as `mimu apply` does, in single precision.
//!
//! The header needs only `<math.h>`, and that only if something depends on temperature or time. It computes the same as [`mimu_core::compensator`],
//! in the same order:
//!
//! 1. converter nonlinearity is removed from the raw reading, and `x = C u + o` (`PREFIX_gyro`, `PREFIX_accel`);
//! 2. C and o at the temperature of the dies, by cubic Hermite pieces as in [`mimu_core::table`] behind the lag of
//!    [`mimu_core::die`] (`PREFIX_follow`, some times a second);
//! 3. the other effects are removed from x (`PREFIX_remove_effects`), each evaluated as its regressor is written
//!    ([`mimu::effects::regressor`]), so that a new effect needs nothing here.

mod effects;
mod functions;

use std::fmt::Write as _;

use mimu::calibration::Calibration;
use mimu::quantity::{PerSensor, Sensor};
use mimu_core::compensation::Affine;
use mimu_recording::error::{Argument, Error, Result};

use crate::remaining::{self, Places};
use crate::{Export, Sources, heading};
use effects::Effects;

/// Options of the header.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Beginning of every name in the header
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "NAME", default_value = "mimu")
    )]
    pub prefix: String,
}

/// Text of the header.
///
/// # Errors
/// The calibration is missing, the prefix is not a valid C identifier, or an effect cannot be removed on a device.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, _) = from.calibration()?;
    let prefix = options.prefix.as_str();
    let mut letters = prefix.chars();
    let first = letters.next().is_some_and(|c| c.is_ascii_alphabetic());
    if !(first && letters.all(|c| c.is_ascii_alphanumeric() || c == '_')) {
        return Err(Error::new(
            "prefix",
            format!("{prefix:?} is not a name in C"),
            "use letters, digits and underscores, a letter first",
        )
        .about(Argument::Prefix));
    }
    let effects = Effects::of(calibration)?;
    let header = Header {
        prefix,
        calibration,
        effects: &effects,
    };
    let mut export = Export::new("c", from);
    export.formulas = header.formulas();
    let places = Places {
        cross_terms: true,
        temperature: true,
        effects: effects.left_out.is_empty(),
    };
    let remaining = remaining::of(calibration, places)?;
    let written = |source: &String| effects.written.contains(source);
    export.remaining = remaining
        .into_iter()
        .filter(|r| !written(&r.source))
        .collect();
    export.notes.push(
        "Single precision rounds: see docs/export.md for the bound; it is below 1e-6 of the largest term of the sum.".into(),
    );
    let comments = heading::comments("//", &heading::of_calibration(calibration, &export));
    export.content = header.text(&comments).into_bytes();
    Ok(export)
}

/// Everything that the header is written from.
struct Header<'a> {
    prefix: &'a str,
    calibration: &'a Calibration,
    effects: &'a Effects,
}

impl Header<'_> {
    /// The calibrated triads.
    fn sensors(&self) -> impl Iterator<Item = Sensor> + '_ {
        let both = Sensor::BOTH.into_iter();
        both.filter(|s| self.calibration.table(*s).is_some())
    }

    /// Whether C and o of `sensor` depend on temperature.
    fn has_curves(&self, sensor: Sensor) -> bool {
        let over = self.calibration.temperature.as_ref();
        over.is_some_and(|over| over.has(sensor))
    }

    /// Whether anything depends on the temperature of the dies.
    fn follows_dies(&self) -> bool {
        Sensor::BOTH.into_iter().any(|s| self.has_curves(s))
    }

    /// Whether the functions need temperature or time.
    fn follows(&self) -> bool {
        self.follows_dies() || self.effects.is_slow()
    }

    /// Whether the functions keep state between calls.
    fn has_state(&self) -> bool {
        self.follows() || !self.effects.is_empty()
    }

    fn lags_s(&self) -> PerSensor<f64> {
        let over = self.calibration.temperature.as_ref();
        over.and_then(|over| over.lags_s()).unwrap_or_default()
    }

    fn formulas(&self) -> Vec<String> {
        let prefix = self.prefix;
        let mut lines = vec![
            "x = C u + o, raw to SI, C by rows: x[i] = C[i][0] u[0] + C[i][1] u[1] + C[i][2] u[2] + o[i].".to_string(),
        ];
        let state = match self.has_state() {
            true => format!("{prefix}_state s; {prefix}_start(&s); "),
            false => String::new(),
        };
        let follow = match self.follows() {
            true => format!("several times per second {prefix}_follow(&s, dt_s, temp_c); "),
            false => String::new(),
        };
        let of = |sensor: Sensor| match self.has_curves(sensor) {
            true => format!("{prefix}_{sensor}(&s, raw, x); "),
            false => format!("{prefix}_{sensor}(raw, x); "),
        };
        let each: String = self.sensors().map(of).collect();
        let remove = match self.effects.is_empty() {
            true => String::new(),
            false => format!("{prefix}_remove_effects(&s, rate, force); "),
        };
        let all = format!("{state}{follow}with every sample {each}{remove}");
        lines.push(format!("Use: {}.", all.trim_end_matches("; ")));
        let array = |sensor: Sensor| {
            let (raw, [x, y, z], out, unit) = match sensor {
                Sensor::Gyro => ("g", ["gx", "gy", "gz"], "rate", "rad/s"),
                Sensor::Accel => (
                    "a",
                    ["ax", "ay", "az"],
                    "force",
                    "m/s^2, at rest it points up",
                ),
            };
            let state = if self.has_curves(sensor) { "&s, " } else { "" };
            format!(
                "  float {raw}[3] = {{(float){x}, (float){y}, (float){z}}}, {out}[3]; {prefix}_{sensor}({state}{raw}, {out});  // {unit}"
            )
        };
        lines.push("Readings are floats in the order x, y, z, raw as they are read, at the range that was calibrated:".into());
        lines.extend(self.sensors().map(array));
        if self.follows() {
            lines.push(format!(
                "{prefix}_follow takes the time in s since its last call (first call: since power-on) and the thermometer in degrees Celsius, NAN if it has no reading."
            ));
        }
        if self.follows_dies() {
            lines.push("Over temperature C and o are cubic Hermite segments between nodes; outside they continue along the slope for 5 K and are constant beyond.".into());
        }
        if !self.effects.written.is_empty() {
            lines.push(format!(
                "Effects that it removes: {}.",
                self.effects.written.join(", ")
            ));
        }
        lines
    }

    fn text(&self, comments: &str) -> String {
        let guard = format!("{}_H", self.prefix.to_uppercase());
        let mut out = format!("{comments}\n#ifndef {guard}\n#define {guard}\n\n");
        if self.has_state() {
            out += "#include <math.h>\n\n";
        }
        self.constants(&mut out);
        self.functions(&mut out);
        let _ = writeln!(out, "#endif");
        out
    }

    fn constants(&self, out: &mut String) {
        let prefix = self.prefix;
        for sensor in self.sensors() {
            let (Some(model), Some(table)) = (
                self.calibration.inverse(sensor),
                self.calibration.table(sensor),
            ) else {
                continue;
            };
            let (unit, raw) = (&table.unit, &table.raw_unit);
            if !self.has_curves(sensor) {
                let rows = [0, 1, 2].map(|i| list([0, 1, 2].map(|j| model.matrix[(i, j)])));
                let _ = writeln!(
                    out,
                    "// C of the {sensor}, {unit} per {raw}, and o, {unit}.\nstatic const float {prefix}_{sensor}_C[3][3] = {{\n    {}}};\nstatic const float {prefix}_{sensor}_o[3] = {};\n",
                    rows.join(",\n    "),
                    list(model.offset.iter().copied())
                );
            }
        }
        if let Some(over) = &self.calibration.temperature {
            let count = over.nodes.len();
            let temperatures = list(over.nodes.iter().map(|node| node.temp_c));
            let _ = writeln!(
                out,
                "// Temperatures of the dies at the nodes, degrees Celsius.\n#define {}_NODES {count}\nstatic const float {prefix}_node_c[{count}] = {temperatures};\n",
                prefix.to_uppercase()
            );
            for sensor in self.sensors().filter(|s| self.has_curves(*s)) {
                let _ = writeln!(
                    out,
                    "// Of the {sensor} at each node: C by rows and o, then their derivatives per kelvin.\nstatic const float {prefix}_{sensor}_nodes[{count}][2][12] = {{"
                );
                for table in over.nodes.iter().filter_map(|node| node.table(sensor)) {
                    let [model, slope] = [table.model(), table.slope()].map(|m| list(twelve(&m)));
                    let _ = writeln!(out, "    {{{model},\n     {slope}}},");
                }
                out.push_str("};\n\n");
            }
        }
        self.effects.constants(prefix, out);
    }
}

/// C by rows, then o.
fn twelve(model: &Affine<f64>) -> impl Iterator<Item = f64> + '_ {
    let rows = (0..9).map(|k| model.matrix[(k / 3, k % 3)]);
    rows.chain(model.offset.iter().copied())
}

/// The shortest decimal number that equals this value in single precision, as a C literal.
fn number(value: f64) -> String {
    format!("{:?}f", value as f32)
}

/// Numbers in braces.
fn list(values: impl IntoIterator<Item = f64>) -> String {
    let all: Vec<String> = values.into_iter().map(number).collect();
    format!("{{{}}}", all.join(", "))
}
