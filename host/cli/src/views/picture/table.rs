//! The uncertainties of a unit's parameters, with their targets.

use mimu::quantity::significant;
use mimu_wizard::refit::{Aim, Progress};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Stylize as _;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::shapes::{framed, sign, text, wrapped};

/// The largest half-width of each kind; `unit` is the unit's name if there are several.
pub(super) fn draw_table(
    frame: &mut Frame,
    area: Rect,
    progress: Option<&Progress>,
    unit: Option<&str>,
) {
    let title = match unit {
        None => "half of the 95 % interval".to_string(),
        Some(name) => format!("half of the 95 % interval, {name}"),
    };
    let inner = framed(frame, area, &title, false);
    let sensors = progress.map_or(&[][..], |p| &p.sensors);
    if sensors.is_empty() {
        let why = progress.and_then(|p| p.not_yet.as_deref());
        let words = why.unwrap_or("nothing determined yet");
        frame.render_widget(text(wrapped(words, inner.width.into())), inner);
        return;
    }
    let mut lines = vec![Line::raw("      worst of   now   target").italic()];
    for sensor in sensors {
        for aim in &sensor.aims {
            lines.push(aim_line(sensor.sensor.name(), aim));
        }
    }
    frame.render_widget(Paragraph::new(lines), inner);
}

fn aim_line(sensor: &'static str, aim: &Aim) -> Line<'static> {
    let figure = format!(
        "{sensor:5} {:6} {} {:>6} {:>5} {:5} ",
        aim.parameter.name(),
        aim.axis,
        short(aim.half_width),
        significant_or_whole(aim.target),
        aim.unit
    );
    let met = aim.half_width <= aim.target;
    Line::from(vec![Span::raw(figure), sign(met, ["met", "not"])])
}

/// Three significant digits in six characters.
fn short(value: f64) -> String {
    match value.abs() {
        v if !(v < 1e6) => ">999 k".into(),
        v if v >= 1e5 => format!("{:.0} k", v / 1e3),
        v if v >= 100.0 => format!("{v:.0}"),
        _ => significant(value).chars().take(6).collect(),
    }
}

/// A target as given.
fn significant_or_whole(value: f64) -> String {
    format!("{value}").chars().take(6).collect()
}
