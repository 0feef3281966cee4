//! Curves over temperature as SVG: what each parameter changes by from the middle of the range, with its band, and the errors while the
//! temperature rises and falls.

use maud::{Markup, html};

use super::svg::{Frame, px, range};
use mimu::quantity::Sensor;
use mimu::readable;
use mimu_thermal::result::{CurveResult, SensorResult, ThermalResult};

/// Width and height of one panel, pixels.
const PANEL: (f64, f64) = (400.0, 330.0);

/// Colours that stay apart for the colour-blind (Okabe and Ito), as those of Allan curves.
const STYLE: &str = "text{font:13px sans-serif;fill:#000}.tick{font-size:12px}.name{font-size:13px}.heading{font-size:15px}\
path{fill:none;stroke-width:2}.grid{stroke:#e1e1e1;stroke-width:1}.zero{stroke:#888;stroke-width:1}.axis{stroke:#000;stroke-width:1}\
.a{stroke:#e69f00}.b{stroke:#0072b2}.c{stroke:#009e73}.noise{stroke:#888;stroke-dasharray:2 3}\
.band{stroke:none;opacity:.2}.a.band{fill:#e69f00}.b.band{fill:#0072b2}.c.band{fill:#009e73}\
.heating{stroke:#d55e00}.cooling{stroke:#56b4e9}";

/// Colours of the three numbers of a kind.
const CLASSES: [&str; 3] = ["a", "b", "c"];

/// Kinds of numbers: how their names begin, heading, whether they are shown relative to themselves.
const KINDS: [(&str, &str, bool); 4] = [
    ("scale", "scale factor", true),
    ("bias", "bias", false),
    ("misalignment", "misalignment", false),
    ("non_orthogonality", "non-orthogonality", false),
];

/// All of them, a row for each sensor.
pub fn svg(result: &ThermalResult) -> String {
    let of = |sensor: Sensor| match sensor {
        Sensor::Gyro => result.sensors.gyro.as_ref(),
        Sensor::Accel => result.sensors.accel.as_ref(),
    };
    let rows: Vec<(Sensor, &SensorResult)> = Sensor::BOTH
        .into_iter()
        .filter_map(|sensor| Some((sensor, of(sensor)?)))
        .collect();
    let (width, height) = (PANEL.0 * 5.0, PANEL.1 * rows.len() as f64);
    let drawn = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } {
            style { (STYLE) }
            rect width=(width) height=(height) fill="#fff" {}
            @for (k, (sensor, found)) in rows.iter().enumerate() {
                g transform={ "translate(0 " (PANEL.1 * k as f64) ")" } {
                    @for (i, kind) in KINDS.iter().enumerate() {
                        g transform={ "translate(" (PANEL.0 * i as f64) ")" } { (curves(result, *sensor, kind)) }
                    }
                    g transform={ "translate(" (PANEL.0 * 4.0) ")" } { (errors(result, *sensor, found)) }
                }
            }
        }
    };
    drawn.into_string() + "\n"
}

fn frame(result: &ThermalResult, y: std::ops::Range<f64>) -> Frame {
    Frame {
        across: 78.0..PANEL.0 - 12.0,
        down: 34.0..PANEL.1 - 46.0,
        x: result.range_c[0]..result.range_c[1],
        y,
    }
}

/// Temperature, value, lower and upper end of one curve, as changes from its middle.
type Points = Vec<(f64, f64, f64, f64)>;

/// One kind of numbers of a sensor.
fn curves(
    result: &ThermalResult,
    sensor: Sensor,
    (begins, heading, relative): &(&str, &str, bool),
) -> Markup {
    let prefix = format!("{}_{begins}_", sensor.name());
    let found = result.curves.iter().filter(|c| c.sensor == sensor);
    let found: Vec<&CurveResult> = found.filter(|c| c.name.starts_with(&prefix)).collect();
    let Some(first) = found.first() else {
        return html! {};
    };
    let unit = readable::parameter(&first.unit);
    let all: Vec<(String, Points)> = found
        .iter()
        .map(|curve| {
            let middle = curve.value[curve.value.len() / 2];
            let by = match relative {
                true => 1e6 / middle,
                false => unit.factor,
            };
            let change = |v: f64| (v - middle) * by;
            let points = (0..curve.temp_c.len()).map(|k| {
                let [low, high] = [curve.lower[k], curve.upper[k]].map(change);
                (curve.temp_c[k], change(curve.value[k]), low, high)
            });
            (curve.name[prefix.len()..].to_owned(), points.collect())
        })
        .collect();
    let frame = frame(
        result,
        range(all.iter().flat_map(|a| a.1.iter().flat_map(|p| [p.2, p.3]))),
    );
    let of_unit = match relative {
        true => "ppm",
        false => &unit.unit,
    };
    let key: Vec<(&str, &str)> = CLASSES
        .iter()
        .zip(&all)
        .map(|(c, a)| (*c, a.0.as_str()))
        .collect();
    html! {
        (frame.axes(&format!("{} {heading}", sensor.name()), true))
        @for (class, (_, points)) in CLASSES.iter().zip(&all) {
            @let band: Vec<_> = points.iter().map(|p| (p.0, p.2, p.3)).collect();
            (frame.band(&format!("{class} band"), &band))
            (frame.line(class, points.iter().map(|p| (p.0, p.1))))
        }
        (frame.x_name("die, °C", &frame))
        (frame.y_name(&format!("change from the middle, {of_unit}")))
        (legend(&frame, &key))
    }
}

/// Errors of dwells by temperature, heating and cooling apart.
fn errors(result: &ThermalResult, sensor: Sensor, found: &SensorResult) -> Markup {
    let unit = readable::error(found.unit);
    let points = |of: fn(&mimu_thermal::judge::Bin) -> Option<f64>| -> Vec<(f64, f64)> {
        let each = found.bins.iter();
        let [from, to] = result.range_c;
        each.filter_map(|b| {
            // The middle of what the dies were at.
            let middle = 0.5 * (b.from_c.max(from) + b.to_c.min(to));
            Some((middle, of(b)? * unit.factor))
        })
        .collect()
    };
    let lines = [
        ("heating", points(|b| b.heating)),
        ("cooling", points(|b| b.cooling)),
        ("noise", points(|b| Some(b.noise_floor))),
    ];
    let highest = lines.iter().flat_map(|l| l.1.iter().map(|p| p.1));
    let frame = frame(result, range(highest.chain([0.0])));
    let key = ["heating", "cooling", "noise"].map(|name| (name, name));
    html! {
        (frame.axes(&format!("{} error", sensor.name()), true))
        @for (class, points) in &lines { (frame.line(class, points.iter().copied())) }
        (frame.x_name("die, °C", &frame))
        (frame.y_name(&format!("rms over dwells, {}", unit.unit)))
        (legend(&frame, &key))
    }
}

/// Names of the lines, side by side above the frame's right end.
fn legend(frame: &Frame, key: &[(&str, &str)]) -> Markup {
    let wide = |name: &str| 26.0 + 7.5 * name.len() as f64;
    let mut x = frame.across.end - key.iter().map(|k| wide(k.1)).sum::<f64>();
    let y = frame.down.start - 12.0;
    let placed = key.iter().map(|(class, name)| {
        let at = x;
        x += wide(name);
        (at, class, name)
    });
    let placed: Vec<_> = placed.collect();
    html! {
        @for (x, class, name) in placed {
            path class=(class) d={ "M" (px(x)) " " (px(y)) "h16" } {}
            text class="tick" x=(px(x + 20.0)) y=(px(y + 4.0)) { (name) }
        }
    }
}
