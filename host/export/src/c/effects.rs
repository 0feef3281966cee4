//! Effects in the header: their regressors as expressions in C.

use std::fmt::Write as _;

use mimu::calibration::Calibration;
use mimu::effects::fitted::FittedEffect;
use mimu::effects::quantity::Quantity;
use mimu::effects::regressor::{Product, Regressor};
use mimu::quantity::{PerSensor, Sensor};
use mimu_core::die::BEYOND_C;
use mimu_core::effects::{DeviceEffect, Directions, RATE_LAG_S, REFERENCE_C};
use mimu_recording::error::{Error, Result};

use super::{list, number};

/// The effects of a calibration.
pub(super) struct Effects {
    /// Ids of those that are in the header.
    pub written: Vec<String>,
    /// And of those that are not.
    pub left_out: Vec<String>,
    /// Lags of the temperatures that they need, s.
    pub lags_s: Vec<f64>,
    /// Sums of the three axes.
    errors: PerSensor<[Vec<String>; 3]>,
    codes: PerSensor<[Option<usize>; 3]>,
    converters: Vec<DeviceEffect<f64>>,
    directions: PerSensor<Option<Directions<f64>>>,
    quantities: Vec<Quantity>,
    /// Temperatures that they see, °C.
    seen_c: Option<[f64; 2]>,
}

impl Effects {
    pub fn of(calibration: &Calibration) -> Result<Self> {
        let direction = |sensor| {
            let model = calibration.inverse(sensor)?;
            Directions::of(&model.matrix)
        };
        let mut all = Self {
            written: Vec::new(),
            left_out: Vec::new(),
            lags_s: Vec::new(),
            errors: PerSensor::default(),
            codes: PerSensor::default(),
            converters: Vec::new(),
            directions: PerSensor::from_fn(direction),
            quantities: Vec::new(),
            seen_c: calibration
                .limits()
                .map(|[from, to]| [from - BEYOND_C, to + BEYOND_C]),
        };
        for effect in calibration.effects() {
            if all.directions[effect.sensor()].is_none() {
                let place = format!(
                    "calibration of {:?}, [{}]",
                    calibration.device,
                    effect.sensor()
                );
                return Err(Error::new(
                    place,
                    "C is singular",
                    "fit the recording again",
                ));
            }
            let done = match effect.candidate.reads_code() {
                true => all.add_codes(effect),
                false => all.add(effect),
            };
            match done {
                Some(()) => all.written.push(effect.id()),
                None => all.left_out.push(effect.id()),
            }
        }
        all.quantities.sort_unstable();
        all.quantities.dedup();
        Ok(all)
    }

    /// Whether nothing is removed from compensated samples.
    pub fn is_empty(&self) -> bool {
        Sensor::BOTH
            .into_iter()
            .all(|sensor| self.is_none_of(sensor))
    }

    fn is_none_of(&self, sensor: Sensor) -> bool {
        self.errors[sensor].iter().all(Vec::is_empty)
    }

    /// Whether some follow temperature or time.
    pub fn is_slow(&self) -> bool {
        self.quantities.iter().any(|q| q.is_slow())
    }

    pub fn reads_code(&self) -> bool {
        !self.converters.is_empty()
    }

    fn has(&self, of: impl Fn(&Quantity) -> bool) -> bool {
        self.quantities.iter().any(of)
    }

    fn is_thermal(&self) -> bool {
        self.has(|q| q.is_thermal())
    }

    fn has_time(&self) -> bool {
        self.has(|q| *q == Quantity::Time)
    }

    fn turns(&self) -> bool {
        self.has(|q| matches!(q, Quantity::AngularAcceleration(_)))
    }

    fn add(&mut self, effect: &FittedEffect) -> Option<()> {
        let candidate = &effect.candidate;
        let slots = candidate.slots();
        let regressors = candidate.slot_regressors();
        let mut terms = Vec::new();
        for ((coefficient, axis), regressor) in slots.iter().zip(&regressors) {
            let value = effect.values.get(*coefficient)?;
            let written = self.regressor(regressor, effect.parameter, *axis)?;
            terms.push((*axis, format!("{} * {written}", number(*value))));
        }
        for (axis, term) in terms {
            self.errors[effect.sensor()][axis].push(term);
        }
        self.quantities
            .extend(regressors.iter().flat_map(Regressor::quantities));
        Some(())
    }

    fn add_codes(&mut self, effect: &FittedEffect) -> Option<()> {
        for part in effect.on_device::<f64>().ok()? {
            let converter = part.converter()?;
            let at = self.converters.len();
            self.converters.push(part);
            for (axis, code) in self.codes[effect.sensor()].iter_mut().enumerate() {
                if converter.axis.is_none_or(|only| only == axis) {
                    *code = Some(at);
                }
            }
        }
        Some(())
    }

    fn regressor(&mut self, of: &Regressor, parameter: f64, axis: usize) -> Option<String> {
        let mut quantity = |q: Quantity| self.quantity(q, parameter, axis);
        Some(match of {
            Regressor::Product(product) => written(product, &mut quantity)?,
            Regressor::Sum(a, b) => {
                let (a, b) = (written(a, &mut quantity)?, written(b, &mut quantity)?);
                format!("({a} + {b})")
            }
            Regressor::Absolute(q) => format!("fabsf({})", quantity(*q)?),
            Regressor::Decay(q) => format!("expf(-{} / {})", quantity(*q)?, number(parameter)),
            Regressor::Logarithm(q) => {
                format!("log1pf({} / {})", quantity(*q)?, number(parameter))
            }
            Regressor::Bit(_) => return None,
        })
    }

    /// A quantity as a function of errors has it; `None` where a stream of samples does not have it.
    fn quantity(&mut self, of: Quantity, parameter: f64, axis: usize) -> Option<String> {
        Some(match of {
            Quantity::Rate(i) => format!("rate[{i}]"),
            Quantity::Force(i) => format!("force[{i}]"),
            Quantity::Input => format!("own[{axis}]"),
            Quantity::InputAlong(i) => format!("own[{i}]"),
            Quantity::AngularAcceleration(i) => format!("s->angular_acceleration[{i}]"),
            Quantity::Temperature => "s->offset_c".into(),
            Quantity::TemperatureRate => {
                let lag = self.lag(RATE_LAG_S);
                format!("(s->lag_{lag} / {})", number(-RATE_LAG_S))
            }
            Quantity::TemperatureLag => format!("s->lag_{}", self.lag(parameter)),
            Quantity::Time => "(float)s->time_s".into(),
            Quantity::RateMagnitude => {
                "sqrtf(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2])".into()
            }
            Quantity::SessionTime | Quantity::RecordingTime | Quantity::Up => return None,
        })
    }

    /// Number of the temperature behind this lag, s.
    fn lag(&mut self, lag_s: f64) -> usize {
        let known = self.lags_s.iter().position(|known| *known == lag_s);
        known.unwrap_or_else(|| {
            self.lags_s.push(lag_s);
            self.lags_s.len() - 1
        })
    }

    /// Directions of the sensors, and the errors of converters.
    pub fn constants(&self, prefix: &str, out: &mut String) {
        for sensor in Sensor::BOTH.into_iter().filter(|s| !self.is_none_of(*s)) {
            let Some(directions) = &self.directions[sensor] else {
                continue;
            };
            for (name, what, matrix) in [
                ("D", "Sensitive directions by rows", directions.sensed),
                (
                    "R",
                    "Errors along them into errors in the body frame",
                    directions.to_body,
                ),
            ] {
                let rows = [0, 1, 2].map(|i| list([0, 1, 2].map(|j| matrix[(i, j)])));
                let _ = writeln!(
                    out,
                    "// {what}, of the {sensor}.\nstatic const float {prefix}_{sensor}_{name}[3][3] = {{\n    {}}};",
                    rows.join(",\n    ")
                );
            }
            out.push('\n');
        }
        for (at, converter) in self.converters.iter().enumerate() {
            let _ = writeln!(
                out,
                "// Errors of the nine highest bits of a converter, in units of the weight of bit 0.\nstatic const float {prefix}_code_{at}[9] = {};\n",
                list(converter.coefficients().iter().copied())
            );
        }
    }

    /// `u`, the reading of `sensor` without the errors of its converters; `None` if there are none.
    pub fn without_code_errors(&self, prefix: &str, sensor: Sensor) -> Option<String> {
        let codes = &self.codes[sensor];
        codes.iter().flatten().next()?;
        let of = |axis: usize| {
            let clean = codes[axis].and_then(|at| {
                let converter = self.converters[at].converter()?;
                let (weight, zero) = (number(converter.weight), number(converter.zero));
                Some(format!(
                    "{prefix}_clean(raw[{axis}], {weight}, {zero}, {prefix}_code_{at})"
                ))
            });
            let value = clean.unwrap_or_else(|| format!("raw[{axis}]"));
            format!("    u[{axis}] = {value};\n")
        };
        let each: String = (0..3).map(of).collect();
        Some(format!("    float u[3];\n{each}"))
    }

    pub fn state(&self, out: &mut String) {
        if self.has_time() {
            out.push_str(
                "    double time_s;        // since power-on; single precision would lose seconds within hours\n",
            );
        }
        if self.is_thermal() {
            let _ = writeln!(
                out,
                "    float offset_c;       // temperature above {REFERENCE_C} degrees Celsius, as effects see it"
            );
        }
        for at in 0..self.lags_s.len() {
            let _ = writeln!(
                out,
                "    float lag_{at};          // temperature behind a lag minus temperature, K"
            );
        }
        if self.is_empty() {
            return;
        }
        if self.turns() {
            out.push_str(
                "    float sample_rate_hz; // to be set after start: the angular acceleration is the difference to the sample before\n    float angular_acceleration[3];\n    float previous_rate[3];\n    int has_previous;\n",
            );
        }
        for sensor in Sensor::BOTH.into_iter().filter(|s| !self.is_none_of(*s)) {
            let _ = writeln!(
                out,
                "    float {sensor}_error[3];  // of the sample before, body frame\n    int has_{sensor}_error;"
            );
        }
    }

    pub fn start(&self, out: &mut String) {
        if self.has_time() {
            out.push_str("    s->time_s = 0.0;\n");
        }
        if self.is_thermal() {
            out.push_str("    s->offset_c = 0.0f;\n");
        }
        for at in 0..self.lags_s.len() {
            let _ = writeln!(out, "    s->lag_{at} = 0.0f;");
        }
        if !self.is_empty() {
            if self.turns() {
                out.push_str("    s->sample_rate_hz = 0.0f;\n");
            }
            out.push_str(&self.forget("    "));
        }
    }

    fn forget(&self, indent: &str) -> String {
        let mut text = String::new();
        if self.turns() {
            let _ = writeln!(text, "{indent}s->has_previous = 0;");
        }
        for sensor in Sensor::BOTH.into_iter().filter(|s| !self.is_none_of(*s)) {
            let _ = writeln!(text, "{indent}s->has_{sensor}_error = 0;");
        }
        text
    }

    pub fn follow_time(&self, out: &mut String) {
        if self.has_time() {
            out.push_str("    s->time_s += (double)dt;\n");
        }
    }

    pub fn follow_temperature(&self, prefix: &str, out: &mut String) {
        if !self.is_thermal() {
            return;
        }
        out.push_str("    {\n        float seen = now;\n");
        if let Some([least, most]) = self.seen_c {
            let (least, most) = (number(least), number(most));
            let _ = writeln!(
                out,
                "        seen = seen < {least} ? {least} : seen > {most} ? {most} : seen;"
            );
        }
        let _ = writeln!(out, "        seen -= {};", number(REFERENCE_C));
        if !self.lags_s.is_empty() {
            out.push_str("        const float risen = s->known ? seen - s->offset_c : 0.0f;\n");
        }
        for (at, lag_s) in self.lags_s.iter().enumerate() {
            let lag_s = number(*lag_s);
            let _ = writeln!(
                out,
                "        s->lag_{at} = {prefix}_lagged(s->lag_{at}, dt, risen, {lag_s});"
            );
        }
        out.push_str("        s->offset_c = seen;\n    }\n");
    }

    pub fn functions(&self, prefix: &str, out: &mut String) {
        if self.is_empty() {
            return;
        }
        out.push_str(&TIMES.replace("PREFIX", prefix));
        let sensors = || Sensor::BOTH.into_iter().filter(|s| !self.is_none_of(*s));
        for sensor in sensors() {
            let own = input(sensor);
            let _ = writeln!(
                out,
                "// Errors of the three sensors of the {sensor}, {unit}, by rate, rad/s, and force, m/s^2.\nstatic inline void {prefix}_{sensor}_errors(const {prefix}_state *s, const float rate[3], const float force[3], float e[3])\n{{\n    float own[3];\n    {prefix}_times({prefix}_{sensor}_D, {own}, own);\n    (void)s, (void)rate, (void)force, (void)own;",
                unit = sensor.unit()
            );
            for (axis, terms) in self.errors[sensor].iter().enumerate() {
                let sum = match terms.is_empty() {
                    true => "0.0f".into(),
                    false => terms.join("\n         + "),
                };
                let _ = writeln!(out, "    e[{axis}] = {sum};");
            }
            let _ = writeln!(out, "}}\n");
        }
        let _ = writeln!(
            out,
            "// Samples are missing: the next one does not follow the last.\nstatic inline void {prefix}_gap({prefix}_state *s)\n{{\n{}}}\n",
            self.forget("    ")
        );
        let _ = writeln!(
            out,
            "// Removes the effects from a compensated sample, rad/s and m/s^2 in the body frame, in place: with every sample in turn.\n// The error is that of the input without the error of the sample before; of a sample that none goes before it is found twice.\nstatic inline void {prefix}_remove_effects({prefix}_state *s, float rate[3], float force[3])\n{{\n    const float read_rate[3] = {{rate[0], rate[1], rate[2]}}, read_force[3] = {{force[0], force[1], force[2]}};\n    float e[3], clean[3];\n    int i, rounds;"
        );
        if self.turns() {
            out.push_str("    for (i = 0; i < 3; i++) {\n        s->angular_acceleration[i] = s->has_previous ? (rate[i] - s->previous_rate[i]) * s->sample_rate_hz : 0.0f;\n        s->previous_rate[i] = rate[i];\n    }\n    s->has_previous = 1;\n");
        }
        for sensor in sensors() {
            let own = input(sensor);
            let arguments = match sensor {
                Sensor::Gyro => "clean, read_force",
                Sensor::Accel => "read_rate, clean",
            };
            let text = REMOVE
                .replace("ARGUMENTS", arguments)
                .replace("OWN", own)
                .replace("SENSOR", sensor.name())
                .replace("PREFIX", prefix);
            out.push_str(&text);
        }
        out.push_str("    (void)read_rate, (void)read_force;\n}\n\n");
    }
}

/// Name of the input of a sensor.
fn input(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Gyro => "rate",
        Sensor::Accel => "force",
    }
}

fn written(
    product: &Product,
    quantity: &mut impl FnMut(Quantity) -> Option<String>,
) -> Option<String> {
    let mut factors = Vec::new();
    for (q, power) in product.parts() {
        let factor = quantity(q)?;
        factors.extend(std::iter::repeat_n(factor, usize::from(power)));
    }
    let sign = if product.sign < 0.0 { "-" } else { "" };
    Some(format!("{sign}{}", factors.join(" * ")))
}

const TIMES: &str = "\
static inline void PREFIX_times(const float m[3][3], const float v[3], float out[3])
{
    int i;
    for (i = 0; i < 3; i++)
        out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
}

";

const REMOVE: &str = "    for (rounds = s->has_SENSOR_error ? 1 : 2; rounds > 0; rounds--) {
        float squares = -1.0f;
        for (i = 0; i < 3; i++) {
            if (!s->has_SENSOR_error)
                s->SENSOR_error[i] = 0.0f;
            squares += s->SENSOR_error[i] * s->SENSOR_error[i] - read_OWN[i] * read_OWN[i];
        }
        // An error steeper than the input would lead out of all numbers.
        for (i = 0; i < 3; i++)
            clean[i] = squares < 0.0f ? read_OWN[i] - s->SENSOR_error[i] : read_OWN[i];
        PREFIX_SENSOR_errors(s, ARGUMENTS, e);
        PREFIX_times(PREFIX_SENSOR_R, e, s->SENSOR_error);
        s->has_SENSOR_error = 1;
    }
    for (i = 0; i < 3; i++)
        OWN[i] = read_OWN[i] - s->SENSOR_error[i];
";
