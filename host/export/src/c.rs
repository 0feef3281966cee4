//! A C99 header: constants, and functions that convert raw readings to SI as `mimu apply` does, in single precision.
//!
//! The code is fixed (`c/calibration.h.in`); tables and the errors of effects are written from the calibration. The header needs only `<math.h>`, and
//! that only if something depends on temperature or time. It computes the same as [`mimu_core::compensator`], in the same order:
//!
//! 1. converter nonlinearity is removed from the raw reading, and `x = C u + o` (`PREFIX_gyro`, `PREFIX_accel`);
//! 2. C and o at the temperature of the dies, by cubic Hermite pieces as in [`mimu_core::table`] behind the lag of
//!    [`mimu_core::die`] (`PREFIX_follow`, some times a second);
//! 3. the other effects are removed from x (`PREFIX_remove_effects`), each evaluated as its regressor is written
//!    ([`mimu::effects::regressor`]), so that a new effect needs nothing here.

mod effects;

use clap::Args;
use mimu::{BodyTriad, Calibration, Sensor};
use mimu_core::compensation::Affine;
use mimu_core::die::{BEYOND_C, RATE_SHARE};
use mimu_core::effects::REFERENCE_C;
use mimu_recording::error::{Argument, Error, Result};
use nalgebra::Matrix3;
use serde_json::{Value, json};

use crate::format::Whole;
use crate::layout::{Entry, Numbers};
use crate::remaining::Places;
use crate::template::fill;
use crate::{Export, Page, Sources, Target, body};
use effects::Effects;

/// Options of the header.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Beginning of every name in the header
    #[arg(long, value_name = "NAME", default_value = "mimu")]
    pub prefix: String,
}

/// The format.
pub struct C;

impl Target for C {
    type Options = Options;
    const NAME: &str = "c";
    const ABOUT: &str = "A C99 header: constants, and functions that convert raw readings to SI";
    const CONTENTS: &str = "everything: affine model, curves, lags of the dies, effects";
    const READERS: &str = "any C99 compiler";
    const FURTHER_TRIADS: bool = true;
    const TAKES_RAW: bool = true;
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Gyro, Numbers::Left, "*_gyro_C"),
        Entry::of(Sensor::Gyro, Numbers::Bias, "*_gyro_o"),
        Entry::of(Sensor::Accel, Numbers::Left, "*_accel_C"),
        Entry::of(Sensor::Accel, Numbers::Bias, "*_accel_o"),
    ];
    const WHOLE: Option<Whole> = Some(program_text);
    const PAGES: &[Page] = &[Page::of("C header", "mimu.h")];

    /// # Errors
    /// The calibration is missing, the prefix is not a valid C identifier, or an effect cannot be removed on a device.
    fn export(from: &Sources, options: &Options) -> Result<Export> {
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
        let mut export = Export::new::<Self>(from);
        let mut values = header.values();
        let formulas = fill(include_str!("c/formulas.in"), &values);
        export.formulas = formulas.lines().map(String::from).collect();
        let places = match effects.left_out {
            0 => Places::Effects,
            _ => Places::Curves,
        };
        export.leaves(calibration, places);
        let written = |source: &String| effects.written.contains(source);
        export.remaining.retain(|r| !written(&r.source));
        export.note("Single precision rounds: see docs/export.md for the bound; it is below 1e-6 of the largest term of the sum.");
        values["comments"] = export.head("//", from).into();
        Ok(export.with(fill(include_str!("c/calibration.h.in"), &values)))
    }
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

    /// The calls in their order.
    fn calls(&self) -> String {
        let prefix = self.prefix;
        let mut calls = String::new();
        if self.has_state() {
            calls += &format!("{prefix}_state s; {prefix}_start(&s); ");
        }
        if self.follows() {
            calls += &format!("several times per second {prefix}_follow(&s, dt_s, temp_c); ");
        }
        let each = |s| format!("{prefix}_{s}({}raw, x)", self.with(s));
        let mut each: Vec<String> = self.sensors().map(each).collect();
        if !self.effects.is_empty() {
            each.push(format!("{prefix}_remove_effects(&s, rate, force)"));
        }
        if each.is_empty()
            && let Some(first) = self.calibration.body.first()
        {
            let at = format!("{prefix}_{}", first.triad).to_uppercase();
            each.push(format!(
                "{prefix}_triad_reading(&{prefix}_body[{at}], raw, x)"
            ));
        }
        format!("{calls}with every sample {}", each.join("; "))
    }

    /// The first argument of the function of a sensor.
    fn with(&self, sensor: Sensor) -> &'static str {
        if self.has_curves(sensor) { "&s, " } else { "" }
    }

    /// Values of the template.
    fn values(&self) -> Value {
        let mut values = self.effects.values();
        let over = self.calibration.temperature.as_ref();
        let nodes = over.map_or(&[][..], |over| &over.nodes);
        let dies: Vec<Value> = self.dies();
        let is_lagged = |die: &Value| die["lagged"] == true;
        let lagging = dies.iter().any(is_lagged) || values["lags"] != json!([]);
        let more = json!({
            "use": self.calls(),
            "written": self.effects.written.join(", "),
            "prefix": self.prefix,
            "PREFIX": self.prefix.to_uppercase(),
            "state": self.has_state(),
            "follows": self.follows(),
            "over_temperature": over.is_some(),
            "count": nodes.len(),
            "node_c": list(nodes.iter().map(|node| node.temp_c)),
            "sensors": self.sensors().filter_map(|s| self.sensor(s)).collect::<Value>(),
            "dies": dies,
            "lagging": lagging,
            "reference": number(REFERENCE_C),
            "reference_c": REFERENCE_C.to_string(),
            "beyond": number(BEYOND_C),
            "body": self.body(),
            "triads": self.calibration.body.len(),
            "first": self.calibration.body.first().map(|t| t.triad.to_string().to_uppercase()),
        });
        if let (Value::Object(all), Value::Object(more)) = (&mut values, more) {
            all.extend(more);
        }
        values
    }

    fn sensor(&self, sensor: Sensor) -> Option<Value> {
        let model = self.calibration.inverse(sensor)?;
        let table = self.calibration.table(sensor)?;
        let (raw, own, own_unit) = sensor.pick(
            ("g", "rate", "rad/s"),
            ("a", "force", "m/s^2, at rest it points up"),
        );
        Some(json!({
            "sensor": sensor.name(),
            "raw": raw,
            "own": own,
            "own_unit": own_unit,
            "with": self.with(sensor),
            "unit": sensor.unit(),
            "table_unit": table.unit,
            "raw_unit": table.raw_unit.to_string(),
            "curves": self.has_curves(sensor),
            "C": rows(&model.matrix),
            "o": list(model.offset.iter().copied()),
        }))
    }

    /// The further triads.
    fn body(&self) -> Value {
        let of = |(at, triad): (usize, &BodyTriad)| {
            let model = triad.in_reference();
            let rotation = triad.rotation();
            let known = [
                rotation.is_some(),
                triad.delay_ms.is_some(),
                triad.lever_arm_mm.is_some(),
            ];
            let known = known.map(|k| u8::from(k).to_string()).join(", ");
            let arm_m = triad.lever_arm_mm.unwrap_or_default().map(|mm| 1e-3 * mm);
            json!({
                "at": at,
                "NAME": triad.triad.to_string().to_uppercase(),
                "name": triad.triad.to_string(),
                "line": body::line(triad),
                "reference": triad.reference.to_string(),
                "unit": triad.unit,
                "C": rows(&model.matrix),
                "o": list(model.offset.iter().copied()),
                "R": rows(&rotation.unwrap_or_else(Matrix3::identity)),
                "has": known,
                "delay_s": number(1e-3 * triad.delay_ms.unwrap_or_default()),
                "lever_arm_m": list(arm_m),
            })
        };
        self.calibration.body.iter().enumerate().map(of).collect()
    }

    /// Sensors with curves: their nodes, and the filter of their dies' lag.
    fn dies(&self) -> Vec<Value> {
        let Some(over) = &self.calibration.temperature else {
            return Vec::new();
        };
        let of = |sensor: Sensor| {
            let tables = over.nodes.iter().filter_map(|node| node.table(sensor));
            let nodes = tables.map(|table| {
                let [model, slope] = [table.model(), table.slope()].map(|m| list(twelve(&m)));
                json!({"model": model, "slope": slope})
            });
            // The filter's time constant, s, and the factor of the filtered minus the unfiltered temperature.
            let lag_s = over.lags_s().unwrap_or_default()[sensor];
            let (filter_s, factor) = match lag_s < 0.0 {
                true => (-lag_s * RATE_SHARE, -1.0 / RATE_SHARE),
                false => (lag_s, 1.0),
            };
            let die = match (filter_s > 0.0, factor == 1.0) {
                (false, _) => "now".into(),
                (_, true) => format!("now + s->{sensor}_behind"),
                (_, false) => format!("now + {} * s->{sensor}_behind", number(factor)),
            };
            json!({
                "sensor": sensor.name(),
                "nodes": nodes.collect::<Value>(),
                "lagged": filter_s > 0.0,
                "filter_s": number(filter_s),
                "die": die,
            })
        };
        let all = self.sensors().filter(|s| self.has_curves(*s));
        all.map(of).collect()
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

/// A matrix by rows, without the outer braces.
fn rows(matrix: &Matrix3<f64>) -> String {
    let rows = matrix.row_iter();
    let rows: Vec<String> = rows.map(|row| list(row.iter().copied())).collect();
    rows.join(",\n    ")
}

/// Refuses a header whose curves, lags or effects are program text; `None` for any other file, whose constants are numbers.
fn program_text(bytes: &[u8], place: &str) -> Option<Result<Calibration>> {
    let text = std::str::from_utf8(bytes).ok()?;
    let functions = ["_remove_effects(", "_follow("].map(|name| text.contains(name));
    let is_one = text.contains("static inline") && functions.contains(&true);
    is_one.then(|| {
        let problem = "its curves or effects are program text, which is not read";
        let remedy = "give the calibration file, or its export as JSON";
        Err(Error::new(place, problem, remedy))
    })
}
