//! Writes the code that removes effects: constants, state and functions.

use std::fmt::Write as _;

use mimu::quantity::Sensor;
use mimu_core::effects::REFERENCE_C;

use super::super::{list, number};
use super::Effects;

impl Effects {
    /// Sensitive directions of the sensors.
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

/// Name of a sensor's input.
fn input(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Gyro => "rate",
        Sensor::Accel => "force",
    }
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
