//! Allan curves as SVG: gyros beside accelerometers, bounds as bands, fitted models, and where the coefficients are read.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use mimu::allan::model::{FLOOR, Term};
use mimu::quantity::Sensor;
use mimu::readable;
use mimu::result::allan::{AllanResult, ChannelResult, ModelResult};
use mimu_recording::error::{Error, Result};

/// Colours that stay apart for the colour-blind (Okabe and Ito).
const COLOURS: [RGBColor; 3] = [
    RGBColor(230, 159, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
];

/// Size of one panel, pixels.
const PANEL: (u32, u32) = (640, 520);

/// The curves of a single recording as SVG.
pub fn svg(result: &AllanResult) -> Result<String> {
    let sensors: Vec<Sensor> = Sensor::BOTH
        .into_iter()
        .filter(|s| result.channels.iter().any(|c| c.sensor() == *s))
        .collect();
    let mut text = String::new();
    let size = (PANEL.0 * sensors.len() as u32, PANEL.1);
    let drawn = {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        let draw = || -> std::result::Result<(), Box<dyn std::error::Error>> {
            root.fill(&WHITE)?;
            for (panel, sensor) in root.split_evenly((1, sensors.len())).iter().zip(&sensors) {
                let of_sensor = result.channels.iter().filter(|c| c.sensor() == *sensor);
                draw_panel(panel, result, *sensor, &of_sensor.collect::<Vec<_>>())?;
            }
            root.present()?;
            Ok(())
        };
        draw().map_err(|e| e.to_string())
    };
    drawn.map_err(|e| Error::new("--plot", e, "compute without --plot, and report this"))?;
    Ok(text)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw_panel(
    area: &Area,
    result: &AllanResult,
    sensor: Sensor,
    channels: &[&ChannelResult],
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let usual = &readable::noise(channels[0].unit)[0];
    let by = usual.factor;
    let ends = |values: &mut dyn Iterator<Item = f64>, room: f64| {
        let (low, high) = values
            .filter(|v| v.is_finite() && *v > 0.0)
            .fold((f64::INFINITY, 0.0f64), |(low, high), v| {
                (low.min(v), high.max(v))
            });
        if low < high {
            low / room..high * room
        } else {
            0.5..2.0
        }
    };
    let x = ends(
        &mut channels.iter().flat_map(|c| c.tau_s.iter().copied()),
        1.1,
    );
    // Of the longest times only the curve and not the whole of the band has to be seen.
    let y = ends(
        &mut channels.iter().flat_map(|c| c.adev.iter().map(|d| d * by)),
        1.6,
    );
    let title = match sensor {
        Sensor::Gyro => "Gyros",
        Sensor::Accel => "Accelerometers",
    };
    let kind = result.kind.unwrap_or_default();
    let mut chart = ChartBuilder::on(area)
        .caption(
            format!(
                "{title} of {}",
                result.device.as_deref().unwrap_or_default()
            ),
            ("sans-serif", 18),
        )
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(78)
        .build_cartesian_2d(
            x.clone().log_scale().with_key_points(ticks(&x)),
            y.clone().log_scale().with_key_points(ticks(&y)),
        )?;
    chart
        .configure_mesh()
        .x_desc("averaging time, s")
        .y_desc(format!("{kind} deviation, {}", usual.unit))
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .x_label_formatter(&|v| label(*v))
        .y_label_formatter(&|v| label(*v))
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()?;
    let at = |tau_s, deviation| clamped(tau_s, deviation, by, [y.start, y.end]);
    for (k, channel) in channels.iter().enumerate() {
        let band = COLOURS[k].mix(0.2);
        let high = at(&channel.tau_s, &channel.upper);
        let low = at(&channel.tau_s, &channel.lower).rev();
        chart.draw_series([Polygon::new(
            high.chain(low).collect::<Vec<_>>(),
            band.filled(),
        )])?;
    }
    for (k, channel) in channels.iter().enumerate() {
        let style = COLOURS[k].stroke_width(2);
        let curve = channel.tau_s.iter().zip(&channel.adev);
        let curve = curve.map(|(t, d)| (*t, d * by));
        chart
            .draw_series(LineSeries::new(curve, style))?
            .label(channel.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], style));
        if let Some(hadamard) = &channel.hadamard {
            let curve = at(&hadamard.tau_s, &hadamard.hdev);
            chart
                .draw_series(DashedLineSeries::new(curve, 7, 4, style))?
                .label(format!("{}, Hadamard", channel.name))
                .legend(move |(x, y)| {
                    plotters::element::DashedPathElement::new([(x, y), (x + 22, y)], 7, 4, style)
                });
        }
    }
    let thin = BLACK.stroke_width(1);
    for (k, (_, channel, model)) in models(channels).enumerate() {
        let [from, to] = model.range_s;
        let fitted = at(&channel.tau_s, &model.adev);
        let curve = fitted.filter(|(t, _)| (from..=to).contains(t));
        let series = chart.draw_series(DashedLineSeries::new(curve, 2, 3, thin))?;
        if k == 0 {
            series.label("models").legend(move |(x, y)| {
                plotters::element::DashedPathElement::new([(x, y), (x + 22, y)], 2, 3, thin)
            });
        }
    }
    for term in [Term::N, Term::B, Term::K] {
        let marks: Vec<(usize, (f64, f64))> = models(channels)
            .filter_map(|(k, channel, model)| Some((k, read_at(channel, model, term)?)))
            .map(|(k, (t, deviation))| (k, (t, deviation * by)))
            .filter(|(_, at)| x.contains(&at.0) && y.contains(&at.1))
            .collect();
        for (k, at) in &marks {
            chart.draw_series([EmptyElement::at(*at)
                + Circle::new((0, 0), 4, WHITE.filled())
                + Circle::new((0, 0), 4, COLOURS[*k].stroke_width(2))])?;
        }
        // One letter for all three: above the highest of them.
        if let Some((_, at)) = marks.iter().max_by(|a, b| a.1.1.total_cmp(&b.1.1)) {
            let style = ("sans-serif", 14)
                .into_text_style(area)
                .pos(Pos::new(HPos::Center, VPos::Bottom));
            let letter = Text::new(term.letter(), (0, -7), style);
            chart.draw_series([EmptyElement::at(*at) + letter])?;
        }
    }
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .label_font(("sans-serif", 14))
        .position(SeriesLabelPosition::LowerLeft)
        .draw()?;
    Ok(())
}

/// Points of a curve in a plot whose ordinate, `by` times the deviation, ends at `ends`.
fn clamped<'a>(
    tau_s: &'a [f64],
    deviation: &'a [f64],
    by: f64,
    [low, high]: [f64; 2],
) -> impl DoubleEndedIterator<Item = (f64, f64)> + Clone + 'a {
    let each = tau_s.iter().zip(deviation);
    each.map(move |(t, d)| (*t, (d * by).clamp(low, high)))
}

/// The channels that have a model, with the channel's number.
fn models<'a>(
    channels: &'a [&'a ChannelResult],
) -> impl Iterator<Item = (usize, &'a ChannelResult, &'a ModelResult)> {
    let with_model = |(k, c): (usize, &&'a ChannelResult)| Some((k, *c, c.model.as_ref()?));
    channels.iter().enumerate().filter_map(with_model)
}

/// Averaging time at which a plot shows a coefficient, and the deviation there: N at 1 s, K at 3 s, and B where the model has come
/// down to its floor.
fn read_at(channel: &ChannelResult, model: &ModelResult, term: Term) -> Option<(f64, f64)> {
    let value = channel.get(term).ok()?.value;
    match term {
        Term::N => Some((1.0, value)),
        Term::K => Some((3.0, value)),
        Term::B => {
            let floor_s = channel.useful_average_s.unwrap_or(model.range_s[1]);
            Some((floor_s, value * FLOOR.sqrt()))
        }
        Term::Q | Term::R => None,
    }
}

/// Round numbers in the range: powers of ten, and 2 and 5 times them where those are few.
fn ticks(range: &std::ops::Range<f64>) -> Vec<f64> {
    let (low, high) = (range.start, range.end);
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let steps: &[u32] = if (high / low).log10() > 3.0 {
        &[1]
    } else {
        &[1, 2, 5]
    };
    let all = decades.flat_map(|d| steps.iter().map(move |m| format!("{m}e{d}")));
    // From text: powers of ten by multiplication are off by a rounding, which a label would show.
    let all = all.filter_map(|t| t.parse().ok());
    all.filter(|t| (low..=high).contains(t)).collect()
}

fn label(value: f64) -> String {
    match value {
        v if (1e-3..1e5).contains(&v) => format!("{v}"),
        v => format!("{v:e}"),
    }
}
