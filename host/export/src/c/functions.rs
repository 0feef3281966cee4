//! The functions of the header.

use std::fmt::Write as _;

use mimu::quantity::Sensor;
use mimu_core::die::{BEYOND_C, RATE_SHARE};
use mimu_core::effects::REFERENCE_C;

use super::{Header, number};

impl Header<'_> {
    pub(super) fn functions(&self, out: &mut String) {
        let prefix = self.prefix;
        if self.has_state() {
            self.state(out);
        }
        if self.follows_dies() {
            self.model_at(out);
        }
        if self.has_state() {
            self.start(out);
        }
        if self.follows() {
            self.follow(out);
        }
        for sensor in self.sensors() {
            self.affine(sensor, out);
        }
        self.effects.functions(prefix, out);
    }

    /// Sensors with curves, and the filter of their dies' lag: its time constant, s, and the factor of the filtered minus the unfiltered temperature.
    fn dies(&self) -> Vec<(Sensor, f64, f64)> {
        let of = |sensor: Sensor| {
            let lag_s = self.lags_s()[sensor];
            let (filter_s, factor) = match lag_s < 0.0 {
                true => (-lag_s * RATE_SHARE, -1.0 / RATE_SHARE),
                false => (lag_s, 1.0),
            };
            (sensor, filter_s, factor)
        };
        let all = self.sensors().filter(|s| self.has_curves(*s));
        all.map(of).collect()
    }

    fn state(&self, out: &mut String) {
        let prefix = self.prefix;
        out.push_str("// What is remembered of one stream of samples.\ntypedef struct {\n");
        if self.follows() {
            out.push_str("    int known;            // whether there was a temperature\n    float thermometer_c;  // the last one\n");
        }
        for (sensor, filter_s, _) in self.dies() {
            let _ = writeln!(out, "    float {sensor}_model[12]; // C by rows, then o");
            if filter_s > 0.0 {
                let _ = writeln!(
                    out,
                    "    float {sensor}_behind;    // filtered temperature minus temperature, K"
                );
            }
        }
        self.effects.state(out);
        let _ = writeln!(out, "}} {prefix}_state;\n");
    }

    fn model_at(&self, out: &mut String) {
        let upper = self.prefix.to_uppercase();
        let text = MODEL_AT
            .replace("PREFIX", self.prefix)
            .replace("UPPER", &upper)
            .replace("BEYOND", &number(BEYOND_C));
        out.push_str(&text);
    }

    fn start(&self, out: &mut String) {
        let prefix = self.prefix;
        let _ = writeln!(
            out,
            "// To be called before anything else, and again where the stream begins anew.\nstatic inline void {prefix}_start({prefix}_state *s)\n{{"
        );
        if self.follows() {
            out.push_str("    s->known = 0;\n    s->thermometer_c = 0.0f;\n");
        }
        for (sensor, filter_s, _) in self.dies() {
            let _ = writeln!(
                out,
                "    {prefix}_model_at({prefix}_{sensor}_nodes, {}, s->{sensor}_model);",
                number(REFERENCE_C)
            );
            if filter_s > 0.0 {
                let _ = writeln!(out, "    s->{sensor}_behind = 0.0f;");
            }
        }
        self.effects.start(out);
        out.push_str("}\n\n");
    }

    fn follow(&self, out: &mut String) {
        let prefix = self.prefix;
        let lags = self.dies().iter().any(|(_, filter_s, _)| *filter_s > 0.0);
        if lags || !self.effects.lags_s.is_empty() {
            out.push_str(&LAGGED.replace("PREFIX", prefix));
        }
        let _ = writeln!(
            out,
            "// Follows time, s since the last call, and the thermometer, degrees Celsius; NAN where it has no reading.\nstatic inline void {prefix}_follow({prefix}_state *s, float dt_s, float thermometer_c)\n{{\n    const float dt = isfinite(dt_s) && dt_s > 0.0f ? dt_s : 0.0f;\n    const float now = isfinite(thermometer_c) ? thermometer_c : s->thermometer_c;\n    const float step = s->known ? now - s->thermometer_c : 0.0f;"
        );
        self.effects.follow_time(out);
        out.push_str("    (void)dt;\n    (void)step;\n    if (!s->known && !isfinite(thermometer_c))\n        return;\n");
        for (sensor, filter_s, factor) in self.dies() {
            let die = match filter_s > 0.0 {
                true => {
                    let lag = number(filter_s);
                    let _ = writeln!(
                        out,
                        "    if (s->known)\n        s->{sensor}_behind = {prefix}_lagged(s->{sensor}_behind, dt, step, {lag});"
                    );
                    match factor == 1.0 {
                        true => format!("now + s->{sensor}_behind"),
                        false => format!("now + {} * s->{sensor}_behind", number(factor)),
                    }
                }
                false => "now".into(),
            };
            let _ = writeln!(
                out,
                "    {prefix}_model_at({prefix}_{sensor}_nodes, {die}, s->{sensor}_model);"
            );
        }
        self.effects.follow_temperature(prefix, out);
        out.push_str("    s->thermometer_c = now;\n    s->known = 1;\n}\n\n");
    }

    fn affine(&self, sensor: Sensor, out: &mut String) {
        let prefix = self.prefix;
        let table = self.calibration.table(sensor);
        let raw_unit = table.map(|t| t.raw_unit.to_string()).unwrap_or_default();
        let curves = self.has_curves(sensor);
        let state = match curves {
            true => format!("const {prefix}_state *s, "),
            false => String::new(),
        };
        let _ = writeln!(
            out,
            "// {} from the raw reading of the {sensor}, {raw_unit}.\nstatic inline void {prefix}_{sensor}({state}const float raw[3], float x[3])\n{{\n    int i;",
            sensor.unit()
        );
        let row = match curves {
            true => "s->SENSOR_model[3 * i] * raw[0] + s->SENSOR_model[3 * i + 1] * raw[1] + s->SENSOR_model[3 * i + 2] * raw[2]\n             + s->SENSOR_model[9 + i]".to_string(),
            false => "PREFIX_SENSOR_C[i][0] * raw[0] + PREFIX_SENSOR_C[i][1] * raw[1] + PREFIX_SENSOR_C[i][2] * raw[2] + PREFIX_SENSOR_o[i]".to_string(),
        };
        let row = row
            .replace("PREFIX", prefix)
            .replace("SENSOR", sensor.name());
        let _ = writeln!(
            out,
            "    for (i = 0; i < 3; i++)\n        x[i] = {row};\n}}\n"
        );
    }
}

/// Same as [`mimu_core::table::Table`].
const MODEL_AT: &str = "\
// C by rows and o at this temperature of the dies, degrees Celsius.
static inline void PREFIX_model_at(const float nodes[][2][12], float die_c, float model[12])
{
    int low = 0, i;
    while (low < UPPER_NODES - 1 && die_c > PREFIX_node_c[low + 1])
        low++;
    if (low < UPPER_NODES - 1 && die_c >= PREFIX_node_c[low]) {
        const float width = PREFIX_node_c[low + 1] - PREFIX_node_c[low];
        const float w = (die_c - PREFIX_node_c[low]) / width, rest = 1.0f - w;
        const float a = (1.0f + 2.0f * w) * rest * rest, b = (1.0f + 2.0f * rest) * w * w;
        const float c = w * rest * rest * width, d = -w * w * rest * width;
        for (i = 0; i < 12; i++)
            model[i] = a * nodes[low][0][i] + b * nodes[low + 1][0][i] + c * nodes[low][1][i] + d * nodes[low + 1][1][i];
    } else {
        float away = die_c - PREFIX_node_c[low];
        away = away > BEYOND ? BEYOND : away < -BEYOND ? -BEYOND : away;
        for (i = 0; i < 12; i++)
            model[i] = nodes[low][0][i] + away * nodes[low][1][i];
    }
}

";

/// Same as [`mimu_core::die`].
const LAGGED: &str = "\
// Filtered temperature minus temperature after dt, in which the temperature rose by step: exact for a ramp.
static inline float PREFIX_lagged(float behind, float dt, float step, float lag_s)
{
    const float z = dt / lag_s;
    const float gone = -expm1f(-z);
    if (!(z > 0.0f))
        return behind - step;
    return behind - behind * gone - step * (gone / z);
}

";
