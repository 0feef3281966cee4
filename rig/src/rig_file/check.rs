//! Checks of a rig file.

use super::{AffineFile, AxesFile, FORMAT, Parts, RigFile};
use crate::catalog::{MeasuredQuantity, Sensor, sensor, sensors};
use crate::converter::RawUnit;
use crate::effects::specs;
use crate::located::written;
use crate::refusal::{Refusal, within};
use crate::rotation::{Vector, cross, dot, norm, scale};

/// Smallest volume spanned by three unit directions: 1 is orthogonal, 0 coplanar. fang's table 3, far beyond any real unit, has 0.65.
const LEAST_VOLUME: f64 = 0.05;
/// Raw per SI, and the length of a direction, below which an axis counts as insensitive.
const LEAST_GAIN: f64 = 1e-9;

// Ranges of numbers, see `within`.
const GAIN: [f64; 2] = [-1e9, 1e9];
/// Twice the codes of 32 bits.
const RAW: [f64; 2] = [-1e10, 1e10];
const BANDWIDTH: [f64; 2] = [0.001, f64::INFINITY];
const LAG: [f64; 2] = [0.01, 1e6];
const HEATING: [f64; 2] = [0.0, 100.0];

pub(super) fn refuse(
    path: impl Into<String>,
    problem: impl Into<String>,
    remedy: impl Into<String>,
) -> Result<(), Refusal> {
    Err(Refusal::new(path, problem, remedy))
}

impl RigFile {
    /// Returns the first error.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        if self.format != FORMAT {
            return refuse(
                "format",
                format!("format is \"{}\"", self.format),
                format!("write \"{FORMAT}\""),
            );
        }
        let gyro = parts("unit.gyro", MeasuredQuantity::Gyro, self.unit.gyro.as_ref())?;
        let accel = parts(
            "unit.accel",
            MeasuredQuantity::Accel,
            self.unit.accel.as_ref(),
        )?;
        let unit = &self.unit;
        axes("unit.gyro_axes", &unit.gyro_axes, &gyro)?;
        axes("unit.accel_axes", &unit.accel_axes, &accel)?;
        for (name, affine, axes) in [
            ("gyro", &unit.gyro_affine, &unit.gyro_axes),
            ("accel", &unit.accel_affine, &unit.accel_axes),
        ] {
            let [affine_path, axes_path] =
                ["affine", "axes"].map(|table| format!("unit.{name}_{table}"));
            model(&affine_path, affine, &axes_path, axes)?;
        }
        self.check_numbers()?;
        self.curves.check()?;
        self.history.check()?;
        self.table.check()?;
        self.hands.check()?;
        self.flaws.check()?;
        self.check_triads()?;
        let analog = [&gyro, &accel].map(|parts| parts[0].output == RawUnit::V);
        if self.converter.raw_unit == Some(RawUnit::V) && !(analog[0] && analog[1]) {
            return refuse(
                "converter.raw_unit",
                "a digital part has no output in volts",
                "write \"count\"",
            );
        }
        if gyro[0].reference_v.is_none() {
            let problem = format!("{} has no reference pin", gyro[0].name);
            if unit.gyro_reference_v.is_some() {
                return refuse("unit.gyro_reference_v", problem, "remove it");
            }
            if self.converter.take_out_reference == Some(true) && analog[0] {
                let remedy = "write false, or take another gyro";
                return refuse("converter.take_out_reference", problem, remedy);
            }
        }
        let left = specs().count().saturating_sub(self.effect.len());
        if self.draw_effects.is_some_and(|n| n > left) {
            return refuse(
                "draw_effects",
                "more effects than there are beside the given ones",
                format!("give at most {left}"),
            );
        }
        for (i, effect) in self.effect.iter().enumerate() {
            if self.effect[..i].iter().any(|other| other.id == effect.id) {
                let remedy = "remove one, or move its contents into the other";
                return refuse(
                    format!("effect.{i}.id"),
                    format!("effect `{}` occurs twice", effect.id),
                    remedy,
                );
            }
            effect.numbers(i)?;
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), Refusal> {
        let (unit, thermal, converter) = (&self.unit, &self.thermal, &self.converter);
        // Error, drift and noise of a voltage: even at the worst of all three its sign stays.
        let (error, drift, noise) = ([-2e5, 2e5], [-2e3, 2e3], [0.0, 2e4]);
        for (path, value, range) in [
            (
                "unit.temperature_lag_s",
                unit.temperature_lag_s,
                [0.0, LAG[1]],
            ),
            (
                "unit.temperature_offset_c",
                unit.temperature_offset_c,
                [-100.0, 100.0],
            ),
            (
                "unit.temperature_noise_c",
                unit.temperature_noise_c,
                [0.0, 100.0],
            ),
            ("unit.supply_error_ppm", unit.supply_error_ppm, error),
            ("unit.supply_ppm_per_c", unit.supply_ppm_per_c, drift),
            ("unit.supply_noise_ppm", unit.supply_noise_ppm, noise),
            ("thermal.board_lag_s", thermal.board_lag_s, LAG),
            ("thermal.board_heating_c", thermal.board_heating_c, HEATING),
            (
                "thermal.on_before_s",
                thermal.on_before_s,
                [0.0, f64::INFINITY],
            ),
            ("converter.reference_v", converter.reference_v, [0.5, 10.0]),
            (
                "converter.reference_error_ppm",
                converter.reference_error_ppm,
                error,
            ),
            (
                "converter.reference_ppm_per_c",
                converter.reference_ppm_per_c,
                drift,
            ),
            (
                "converter.reference_noise_ppm",
                converter.reference_noise_ppm,
                noise,
            ),
            (
                "converter.gyro_divider",
                converter.gyro_divider,
                [0.01, 1.0],
            ),
            (
                "converter.accel_divider",
                converter.accel_divider,
                [0.01, 1.0],
            ),
            ("converter.noise_codes", converter.noise_codes, [0.0, 1e6]),
            ("converter.bits", converter.bits.map(f64::from), [1.0, 32.0]),
            (
                "converter.conversions",
                converter.conversions.map(f64::from),
                [1.0, 1000.0],
            ),
        ] {
            within(path, value.as_slice(), range)?;
        }
        for (path, values, range) in [
            ("thermal.die_lag_s", &thermal.die_lag_s, LAG),
            ("thermal.die_heating_c", &thermal.die_heating_c, HEATING),
        ] {
            within(path, values.as_slice().as_flattened(), range)?;
        }
        let pins = unit.gyro_reference_v.as_slice().as_flattened();
        within("unit.gyro_reference_v", pins, [0.1, 10.0])
    }
}

/// Catalog entries of the three axes of a triad, which must agree in the properties of the whole triad.
pub(super) fn parts(
    path: &str,
    kind: MeasuredQuantity,
    given: Option<&Parts>,
) -> Result<[&'static Sensor; 3], Refusal> {
    let names = match given {
        None => match kind {
            MeasuredQuantity::Gyro => ["ADXRS300"; 3],
            MeasuredQuantity::Accel => ["MMA7260QT"; 3],
            MeasuredQuantity::Mag => ["AK8963"; 3],
        },
        Some(Parts::One(name)) => [name.as_str(); 3],
        Some(Parts::Each(names)) => names.each_ref().map(String::as_str),
    };
    let found = names.map(|name| sensor(kind, name));
    if let [Some(x), Some(y), Some(z)] = found {
        for other in [y, z] {
            let alike = |s: &Sensor| (s.output, s.packages, s.ratiometric);
            if alike(x) != alike(other) {
                let problem = format!("{} and {} cannot be in one triad", x.name, other.name);
                let remedy = "choose parts with the same kind of output and package";
                refuse(path, problem, remedy)?;
            }
        }
        return Ok([x, y, z]);
    }
    let unknown = names[found.iter().position(Option::is_none).unwrap_or(0)];
    let known: Vec<_> = sensors()
        .iter()
        .filter(|s| s.kind == kind)
        .map(|s| s.name.as_str())
        .collect();
    Err(Refusal {
        path: path.to_owned(),
        problem: format!("no sensor has the name \"{unknown}\""),
        remedy: format!("known are: {}", known.join(", ")),
    })
}

/// Checks the forward model of a triad, which may give what its axes would give, but not both.
pub(super) fn model(
    path: &str,
    affine: &Option<AffineFile>,
    axes_path: &str,
    axes: &AxesFile,
) -> Result<(), Refusal> {
    let Some(affine) = affine else {
        return Ok(());
    };
    let matrix = format!("{path}.matrix");
    within(&matrix, affine.matrix.as_flattened(), GAIN)?;
    within(&format!("{path}.bias"), &affine.bias, RAW)?;
    span(&matrix, &affine.matrix)?;
    for (key, stated) in [
        ("directions", axes.directions.is_some()),
        (
            "sensitivity_raw_per_si",
            axes.sensitivity_raw_per_si.is_some(),
        ),
        ("null_raw", axes.null_raw.is_some()),
    ] {
        if stated {
            return refuse(
                format!("{axes_path}.{key}"),
                format!("`{key}` is given twice: [{path}] has it too"),
                "remove one of them",
            );
        }
    }
    Ok(())
}

pub(super) fn axes(path: &str, axes: &AxesFile, parts: &[&Sensor; 3]) -> Result<(), Refusal> {
    let at = |key: &str| format!("{path}.{key}");
    if let Some(directions) = &axes.directions {
        within(&at("directions"), directions.as_flattened(), [-1e6, 1e6])?;
        span(&at("directions"), directions)?;
    }
    let noise = [0.0, 1000.0];
    for (key, values, range) in [
        ("sensitivity_raw_per_si", &axes.sensitivity_raw_per_si, GAIN),
        ("null_raw", &axes.null_raw, RAW),
        ("bandwidth_hz", &axes.bandwidth_hz, BANDWIDTH),
        ("white_si", &axes.white_si, noise),
        ("instability_si", &axes.instability_si, noise),
        ("walk_si", &axes.walk_si, noise),
        ("white_per_sample", &axes.white_per_sample, [0.0, RAW[1]]),
    ] {
        within(&at(key), values.as_slice().as_flattened(), range)?;
    }
    let stated = axes.sensitivity_raw_per_si.iter().flatten();
    if let Some(v) = stated.copied().find(|v| v.abs() < LEAST_GAIN) {
        let problem = format!("`sensitivity_raw_per_si` is {}", written(v));
        let remedy = format!("give {LEAST_GAIN:e} or more, of either sign");
        return refuse(at("sensitivity_raw_per_si"), problem, remedy);
    }
    for (key, value, range) in [
        ("rc_hz", axes.rc_hz, BANDWIDTH),
        ("low_raw", axes.low_raw, RAW),
        ("high_raw", axes.high_raw, RAW),
    ] {
        within(&at(key), value.as_slice(), range)?;
    }
    // One of the two may come from the data sheet.
    let (low, high) = (
        axes.low_raw.unwrap_or(parts[0].low),
        axes.high_raw.unwrap_or(parts[0].high),
    );
    if low >= high {
        let key = if axes.low_raw.is_some() {
            "low_raw"
        } else {
            "high_raw"
        };
        let problem = format!("the lowest output, {low}, is not below the highest, {high}");
        return refuse(
            at(key),
            problem,
            "give `low_raw` and `high_raw`, the lower first",
        );
    }
    Ok(())
}

/// Three rows must span space.
fn span(path: &str, rows: &[Vector; 3]) -> Result<(), Refusal> {
    if let Some(i) = rows.iter().position(|r| norm(*r) < LEAST_GAIN) {
        let axis = ["x", "y", "z"][i];
        return refuse(
            path,
            format!("axis {axis} senses nothing"),
            "give its row a number that is not 0 or next to it",
        );
    }
    let [x, y, z] = rows.map(|r| scale(1.0 / norm(r), r));
    if dot(x, cross(y, z)).abs() < LEAST_VOLUME {
        return refuse(
            path,
            "the three sensitive axes lie in one plane",
            "turn one of them out of it",
        );
    }
    Ok(())
}
