//! What a rig file must not say.

use super::{AxesFile, FORMAT, Parts, RigFile};
use crate::catalog::{Kind, Sensor, sensor, sensors};
use crate::converter::RawUnit;
use crate::effects::specs;
use crate::rotation::{Vector, cross, dot, norm, scale};

/// Smallest volume that three unit directions may span: 1 is orthogonal, 0 in one plane. fang's table 3,
/// far beyond any unit, has 0.65.
const LEAST_VOLUME: f64 = 0.05;

/// One thing that is wrong, and where.
pub(super) struct Bad {
    pub path: String,
    pub problem: String,
    pub remedy: String,
}

fn bad(
    path: impl Into<String>,
    problem: impl Into<String>,
    remedy: impl Into<String>,
) -> Result<(), Bad> {
    Err(Bad {
        path: path.into(),
        problem: problem.into(),
        remedy: remedy.into(),
    })
}

/// What a number must be. Infinity is no filter, or warmed up for ever.
#[derive(Clone, Copy)]
enum Must {
    BeFinite,
    BePositive,
    BePositiveOrInf,
    NotBeNegative,
    NotBeNegativeOrInf,
    BeAFraction,
}

fn number(path: &str, values: &[f64], must: Must) -> Result<(), Bad> {
    let key = path.rsplit('.').next().unwrap_or(path);
    for &v in values {
        let (good, remedy) = match must {
            Must::BeFinite => (v.is_finite(), "give a finite number"),
            Must::BePositive => (v > 0.0 && v.is_finite(), "give a finite number above 0"),
            Must::BePositiveOrInf => (v > 0.0, "give a number above 0, or inf"),
            Must::NotBeNegative => (
                v >= 0.0 && v.is_finite(),
                "give 0 or a finite number above it",
            ),
            Must::NotBeNegativeOrInf => (v >= 0.0, "give 0 or more, or inf"),
            Must::BeAFraction => (v > 0.0 && v <= 1.0, "give a number above 0 and up to 1"),
        };
        if !good {
            return bad(path, format!("`{key}` is {v}"), remedy);
        }
    }
    Ok(())
}

impl RigFile {
    /// Complains of the first thing that is wrong.
    pub(super) fn check(&self) -> Result<(), Bad> {
        if self.format != FORMAT {
            return bad(
                "format",
                format!("format is \"{}\"", self.format),
                format!("write \"{FORMAT}\""),
            );
        }
        let gyro = self.sensors(Kind::Gyro)?;
        let accel = self.sensors(Kind::Accel)?;
        let unit = &self.unit;
        axes("unit.gyro_axes", &unit.gyro_axes)?;
        axes("unit.accel_axes", &unit.accel_axes)?;
        for (name, affine, axes) in [
            ("gyro", &unit.gyro_affine, &unit.gyro_axes),
            ("accel", &unit.accel_affine, &unit.accel_axes),
        ] {
            let Some(affine) = affine else { continue };
            let path = format!("unit.{name}_affine.matrix");
            number(&path, affine.matrix.as_flattened(), Must::BeFinite)?;
            number(
                &format!("unit.{name}_affine.bias"),
                &affine.bias,
                Must::BeFinite,
            )?;
            span(&path, &affine.matrix)?;
            for (key, stated) in [
                ("directions", axes.directions.is_some()),
                (
                    "sensitivity_raw_per_si",
                    axes.sensitivity_raw_per_si.is_some(),
                ),
                ("null_raw", axes.null_raw.is_some()),
            ] {
                if stated {
                    return bad(
                        format!("unit.{name}_axes.{key}"),
                        format!("`{key}` is stated twice: [unit.{name}_affine] has it too"),
                        "remove one of them",
                    );
                }
            }
        }
        self.check_numbers()?;
        let analog = [&gyro, &accel].map(|parts| parts[0].output == RawUnit::V);
        if self.converter.raw_unit == Some(RawUnit::V) && !(analog[0] && analog[1]) {
            return bad(
                "converter.raw_unit",
                "a digital part gives no volts",
                "write \"count\"",
            );
        }
        if self.converter.take_out_reference == Some(true)
            && analog[0]
            && gyro[0].reference_v.is_none()
        {
            return bad(
                "converter.take_out_reference",
                format!("{} has no reference pin to convert", gyro[0].name),
                "write false, or take another gyro",
            );
        }
        let kinds = specs().count();
        if self.draw_effects.is_some_and(|n| n > kinds) {
            return bad(
                "draw_effects",
                "more effects than there are",
                format!("give at most {kinds}"),
            );
        }
        for (i, effect) in self.effect.iter().enumerate() {
            if self.effect[..i].iter().any(|other| other.id == effect.id) {
                let remedy = "remove one, or put all of it into the other";
                return bad(
                    format!("effect.{i}.id"),
                    format!("effect `{}` stands twice", effect.id),
                    remedy,
                );
            }
            effect.numbers(i)?;
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), Bad> {
        use Must::{BeAFraction, BeFinite, BePositive, NotBeNegative, NotBeNegativeOrInf};
        let (unit, thermal, converter) = (&self.unit, &self.thermal, &self.converter);
        let one = |v: &Option<f64>| v.iter().copied().collect::<Vec<_>>();
        let all = |v: &Option<[f64; 4]>| v.iter().flatten().copied().collect::<Vec<_>>();
        for (path, values, must) in [
            (
                "unit.temperature_offset_c",
                one(&unit.temperature_offset_c),
                BeFinite,
            ),
            (
                "unit.temperature_noise_c",
                one(&unit.temperature_noise_c),
                NotBeNegative,
            ),
            (
                "unit.gyro_reference_v",
                unit.gyro_reference_v.iter().flatten().copied().collect(),
                BePositive,
            ),
            (
                "unit.supply_error_ppm",
                one(&unit.supply_error_ppm),
                BeFinite,
            ),
            (
                "unit.supply_ppm_per_c",
                one(&unit.supply_ppm_per_c),
                BeFinite,
            ),
            (
                "unit.supply_noise_ppm",
                one(&unit.supply_noise_ppm),
                NotBeNegative,
            ),
            ("thermal.board_lag_s", one(&thermal.board_lag_s), BePositive),
            ("thermal.die_lag_s", all(&thermal.die_lag_s), BePositive),
            (
                "thermal.board_heating_c",
                one(&thermal.board_heating_c),
                BeFinite,
            ),
            (
                "thermal.die_heating_c",
                all(&thermal.die_heating_c),
                BeFinite,
            ),
            (
                "thermal.on_before_s",
                one(&thermal.on_before_s),
                NotBeNegativeOrInf,
            ),
            (
                "converter.reference_v",
                one(&converter.reference_v),
                BePositive,
            ),
            (
                "converter.reference_error_ppm",
                one(&converter.reference_error_ppm),
                BeFinite,
            ),
            (
                "converter.reference_ppm_per_c",
                one(&converter.reference_ppm_per_c),
                BeFinite,
            ),
            (
                "converter.reference_noise_ppm",
                one(&converter.reference_noise_ppm),
                NotBeNegative,
            ),
            (
                "converter.gyro_divider",
                one(&converter.gyro_divider),
                BeAFraction,
            ),
            (
                "converter.accel_divider",
                one(&converter.accel_divider),
                BeAFraction,
            ),
            (
                "converter.noise_codes",
                one(&converter.noise_codes),
                NotBeNegative,
            ),
        ] {
            number(path, &values, must)?;
        }
        if let Some(bits) = converter.bits.filter(|b| !(1..=32).contains(b)) {
            return bad(
                "converter.bits",
                format!("`bits` is {bits}"),
                "give 1 to 32",
            );
        }
        if converter.conversions == Some(0) {
            return bad(
                "converter.conversions",
                "`conversions` is 0",
                "give 1 or more",
            );
        }
        Ok(())
    }

    /// Catalog entries of the three axes, which must agree in what concerns all three.
    pub(super) fn sensors(&self, kind: Kind) -> Result<[&'static Sensor; 3], Bad> {
        let (path, parts, usual) = match kind {
            Kind::Gyro => ("unit.gyro", &self.unit.gyro, "ADXRS300"),
            Kind::Accel => ("unit.accel", &self.unit.accel, "MMA7260QT"),
        };
        let names = match parts {
            None => [usual; 3],
            Some(Parts::One(name)) => [name.as_str(); 3],
            Some(Parts::Each(names)) => names.each_ref().map(String::as_str),
        };
        let found = names.map(|name| sensor(kind, name));
        if let [Some(x), Some(y), Some(z)] = found {
            for other in [y, z] {
                let alike = |s: &Sensor| (s.output, s.packages, s.ratiometric);
                if alike(x) != alike(other) {
                    let problem = format!("{} and {} do not make one triad", x.name, other.name);
                    let remedy = "take parts with the same kind of output and package";
                    bad(path, problem, remedy)?;
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
        Err(Bad {
            path: path.to_owned(),
            problem: format!("no sensor is called \"{unknown}\""),
            remedy: format!("known here: {}", known.join(", ")),
        })
    }
}

fn axes(path: &str, axes: &AxesFile) -> Result<(), Bad> {
    use Must::{BeFinite, BePositiveOrInf, NotBeNegative};
    let at = |key: &str| format!("{path}.{key}");
    let three = |v: &Option<[f64; 3]>| v.iter().flatten().copied().collect::<Vec<_>>();
    if let Some(directions) = &axes.directions {
        number(&at("directions"), directions.as_flattened(), BeFinite)?;
        span(&at("directions"), directions)?;
    }
    if let Some(v) = axes
        .sensitivity_raw_per_si
        .iter()
        .flatten()
        .find(|v| !v.is_normal())
    {
        let problem = format!("`sensitivity_raw_per_si` is {v}");
        return bad(
            at("sensitivity_raw_per_si"),
            problem,
            "give a finite number other than 0",
        );
    }
    for (key, values, must) in [
        ("null_raw", three(&axes.null_raw), BeFinite),
        ("bandwidth_hz", three(&axes.bandwidth_hz), BePositiveOrInf),
        (
            "rc_hz",
            axes.rc_hz.iter().copied().collect(),
            BePositiveOrInf,
        ),
        ("white_si", three(&axes.white_si), NotBeNegative),
        ("instability_si", three(&axes.instability_si), NotBeNegative),
        ("walk_si", three(&axes.walk_si), NotBeNegative),
        (
            "white_per_sample",
            three(&axes.white_per_sample),
            NotBeNegative,
        ),
    ] {
        number(&at(key), &values, must)?;
    }
    if let (Some(low), Some(high)) = (axes.low_raw, axes.high_raw)
        && !(low < high)
    {
        return bad(
            at("low_raw"),
            format!("lowest output {low} is not below the highest, {high}"),
            "swap them",
        );
    }
    Ok(())
}

/// Three rows must span space.
fn span(path: &str, rows: &[Vector; 3]) -> Result<(), Bad> {
    if let Some(i) = rows.iter().position(|r| norm(*r) == 0.0) {
        let axis = ["x", "y", "z"][i];
        return bad(
            path,
            format!("axis {axis} senses nothing"),
            "give its row a number other than 0",
        );
    }
    let [x, y, z] = rows.map(|r| scale(1.0 / norm(r), r));
    if dot(x, cross(y, z)).abs() < LEAST_VOLUME {
        return bad(
            path,
            "the three sensitive axes lie in one plane",
            "turn one of them out of it",
        );
    }
    Ok(())
}
