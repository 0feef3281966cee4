//! Allan curves as SVG: gyros beside accelerometers, bounds as bands, fitted models, and where the coefficients are read.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use mimu::allan::model::{FLOOR, NoiseModel, Term};
use mimu::allan::recording::{Channel, Survey};
use mimu::quantity::Sensor;
use mimu_recording::error::{Error, Result};

/// Colours that stay apart for the colour-blind (Okabe and Ito).
const COLOURS: [RGBColor; 3] = [
    RGBColor(230, 159, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
];

/// Size of one panel, pixels.
const PANEL: (u32, u32) = (640, 520);

/// The curves of a survey as SVG.
pub fn svg(survey: &Survey) -> Result<String> {
    let sensors: Vec<Sensor> = Sensor::BOTH
        .into_iter()
        .filter(|s| survey.channels.iter().any(|c| c.sensor == *s))
        .collect();
    let mut text = String::new();
    let size = (PANEL.0 * sensors.len() as u32, PANEL.1);
    let drawn = {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        let draw = || -> std::result::Result<(), Box<dyn std::error::Error>> {
            root.fill(&WHITE)?;
            for (panel, sensor) in root.split_evenly((1, sensors.len())).iter().zip(&sensors) {
                let of_sensor = survey.channels.iter().filter(|c| c.sensor == *sensor);
                draw_panel(panel, survey, *sensor, &of_sensor.collect::<Vec<_>>())?;
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
    survey: &Survey,
    sensor: Sensor,
    channels: &[&Channel],
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let usual = channels[0].unit.deviation(sensor);
    let by = usual.factor;
    let points = || channels.iter().flat_map(|c| c.curve.iter());
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
    let x = ends(&mut points().map(|p| p.tau_s), 1.1);
    // Of the longest times only the curve and not the whole of the band has to be seen.
    let y = ends(&mut points().map(|p| p.deviation * by), 1.6);
    let title = match sensor {
        Sensor::Gyro => "Gyros",
        Sensor::Accel => "Accelerometers",
    };
    let kind = survey.options.kind.name();
    let mut chart = ChartBuilder::on(area)
        .caption(format!("{title} of {}", survey.device), ("sans-serif", 18))
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
        .y_desc(format!("{kind} deviation, {}", usual.name))
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .x_label_formatter(&|v| label(*v))
        .y_label_formatter(&|v| label(*v))
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()?;
    let inside = |v: f64| v.clamp(y.start, y.end);
    for (k, channel) in channels.iter().enumerate() {
        let band = COLOURS[k].mix(0.2);
        let high = channel
            .curve
            .iter()
            .map(|p| (p.tau_s, inside(p.upper * by)));
        let low = channel
            .curve
            .iter()
            .rev()
            .map(|p| (p.tau_s, inside(p.lower * by)));
        chart.draw_series([Polygon::new(
            high.chain(low).collect::<Vec<_>>(),
            band.filled(),
        )])?;
    }
    for (k, channel) in channels.iter().enumerate() {
        let style = COLOURS[k].stroke_width(2);
        let curve = channel.curve.iter().map(|p| (p.tau_s, p.deviation * by));
        chart
            .draw_series(LineSeries::new(curve, style))?
            .label(channel.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], style));
        if let Some(hadamard) = &channel.hadamard {
            let curve = hadamard.iter().map(|p| (p.tau_s, inside(p.deviation * by)));
            chart
                .draw_series(DashedLineSeries::new(curve, 7, 4, style))?
                .label(format!("{}, Hadamard", channel.name))
                .legend(move |(x, y)| {
                    plotters::element::DashedPathElement::new([(x, y), (x + 22, y)], 7, 4, style)
                });
        }
    }
    let thin = BLACK.stroke_width(1);
    for (k, (_, model)) in models(channels).enumerate() {
        let [from, to] = model.range_s;
        let curve = (0..=100).map(|i| from * (to / from).powf(f64::from(i) / 100.0));
        let curve = curve.map(|t| (t, inside(model.deviation(t) * by)));
        let series = chart.draw_series(DashedLineSeries::new(curve, 2, 3, thin))?;
        if k == 0 {
            series.label("models").legend(move |(x, y)| {
                plotters::element::DashedPathElement::new([(x, y), (x + 22, y)], 2, 3, thin)
            });
        }
    }
    for term in [Term::N, Term::B, Term::K] {
        let marks: Vec<(usize, (f64, f64))> = models(channels)
            .filter_map(|(k, model)| Some((k, read_at(model, term)?)))
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

/// The models of the channels that have one, with the channel's number.
fn models<'a>(channels: &'a [&Channel]) -> impl Iterator<Item = (usize, &'a NoiseModel)> {
    let with_model = |(k, c): (usize, &'a &Channel)| Some((k, c.model.as_ref()?));
    channels.iter().enumerate().filter_map(with_model)
}

/// Averaging time at which a plot shows a coefficient, and the deviation there: N at 1 s, K at 3 s, and B where the model has come
/// down to its floor.
fn read_at(model: &NoiseModel, term: Term) -> Option<(f64, f64)> {
    let value = model.get(term).ok()?.value;
    match term {
        Term::N => Some((1.0, value)),
        Term::K => Some((3.0, value)),
        Term::B => {
            let floor_s = model.useful_average_s().unwrap_or(model.range_s[1]);
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
