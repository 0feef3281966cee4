//! State of a unit: each figure with its limit, the reason why it waits, and the remaining time of a dwell.

use mimu_wizard::event::{Phase, SessionState, UnitState};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Stylize as _;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use crate::hint;

use super::shapes::{clipped, filled, framed, grouped, sign, wrapped};

/// Cells of a bar. The limit is in the middle.
const BAR: usize = 15;

/// One unit in full.
pub(super) fn draw_unit(frame: &mut Frame, area: Rect, unit: &UnitState, standing: &SessionState) {
    let waits = unit.waiting.is_some();
    let inner = framed(frame, area, &unit.unit, waits);
    let wide = usize::from(inner.width);
    let turning = standing.step.is_some_and(|s| s.rate_dps != 0.0);
    let mut lines = Vec::new();
    for (k, sensor) in ["gyro", "accel"].into_iter().enumerate() {
        let line = unit.motion.map(|m| {
            let words = match turning {
                true => ["steady", "uneven"],
                false => ["still", "moves"],
            };
            bar_line(sensor, m[k], unit.motion_limits[k], words)
        });
        lines.push(line.unwrap_or_else(|| Line::raw(format!("{sensor:6} nothing yet"))));
    }
    lines.push(tilt_line(unit));
    let rate = unit.rate_dps.map(|is| match standing.step {
        Some(step) => {
            let met = (is - step.rate_dps).abs() <= unit.rate_limit_dps;
            let words = format!("rate   {is:+.1} of {:+.1} deg/s ", step.rate_dps);
            Line::from(vec![Span::raw(words), sign(met, ["ok", "wrong"])])
        }
        None => Line::raw(format!("rate   {is:+.1} deg/s")),
    });
    lines.push(rate.unwrap_or_else(|| Line::raw("rate   unknown yet")));
    if let Some(spin) = &unit.spin {
        let turns = spin
            .turns
            .map_or_else(|| "to rest first".into(), |t| format!("{t:.1}"));
        let words = format!("turns  {turns} of {} about {}", spin.asked, spin.axis);
        lines.push(Line::raw(words).bold());
    }
    lines.push(temperature_line(unit, standing.phase == Phase::WarmUp));
    lines.push(Line::raw(format!(
        "samples {}, {} lost",
        grouped(unit.samples),
        grouped(unit.lost)
    )));
    if let Some(why) = &unit.waiting {
        let words = wrapped(&format!("waits: {}", hint::of_waiting(why)), wide);
        lines.extend(words.into_iter().map(|l| Line::raw(l).yellow()));
    }
    if let (Some(left), Some(step)) = (unit.left_s, standing.step) {
        lines.push(Line::raw("measures").green());
        let words = format!(" {left:4.1} s left");
        let cells = wide.saturating_sub(words.len());
        let bar = filled(1.0 - left / step.dwell_s, cells);
        lines.push(Line::from(vec![Span::raw(bar).green(), Span::raw(words)]));
    }
    frame.render_widget(Paragraph::new(lines), inner);
}

/// Several units without space for each: two lines per unit, waiting ones first.
pub(super) fn draw_units(frame: &mut Frame, area: Rect, units: &[UnitState]) {
    let inner = framed(frame, area, &format!("{} units", units.len()), false);
    let wide = usize::from(inner.width);
    let mut order: Vec<&UnitState> = units.iter().collect();
    order.sort_by_key(|u| u.waiting.is_none());
    let room = usize::from(inner.height);
    let fit = match 2 * units.len() <= room {
        true => units.len(),
        false => (room - 1) / 2,
    };
    let mut lines = Vec::new();
    for unit in &order[..fit] {
        let state = match (&unit.waiting, unit.left_s) {
            (Some(why), _) => format!("waits: {}", hint::of_waiting(why)),
            (None, Some(left)) => format!("measures, {left:.1} s left"),
            (None, None) => String::new(),
        };
        let of = |motion: f64| capped(motion);
        let motion = unit.motion.map_or_else(String::new, |[gyro, accel]| {
            format!(" gyro {} accel {}", of(gyro), of(accel))
        });
        let tilt = unit
            .tilt_deg
            .map_or_else(String::new, |t| format!(" tilt {t:.0}°"));
        lines.push(Line::raw(clipped(&format!("{}{motion}{tilt}", unit.unit), wide)).bold());
        lines.push(Line::raw(clipped(&format!("  {state}"), wide)));
    }
    if fit < units.len() {
        let more = units.len() - fit;
        lines.push(Line::raw(format!("{more} more: make the terminal larger")));
    }
    frame.render_widget(Paragraph::new(lines), inner);
}

fn bar_line(sensor: &str, value: f64, limit: f64, words: [&'static str; 2]) -> Line<'static> {
    let (share, met) = (value / limit, value <= limit);
    let middle = BAR / 2;
    let full = (share * middle as f64).round().min(BAR as f64) as usize;
    let cell = |k: usize| match k {
        k if k == middle => '|',
        k if k < full => '█',
        _ => '·',
    };
    let cells: String = (0..BAR).map(cell).collect();
    let bar = match met {
        true => Span::raw(cells).green(),
        false => Span::raw(cells).red(),
    };
    let figure = format!(" {} of {limit} ", capped(value));
    Line::from(vec![
        Span::raw(format!("{sensor:6}")),
        bar,
        Span::raw(figure),
        sign(met, words),
    ])
}

/// Three digits, at most four characters.
fn capped(value: f64) -> String {
    match value {
        v if v < 9.995 => format!("{v:.2}"),
        v if v < 99.95 => format!("{v:.1}"),
        v if v < 999.5 => format!("{v:.0}"),
        _ => ">999".into(),
    }
}

fn tilt_line(unit: &UnitState) -> Line<'static> {
    match unit.tilt_deg {
        None => Line::raw("tilt   no pose requested"),
        Some(tilt) => Line::from(vec![
            Span::raw(format!(
                "tilt   {tilt:.1} of {} degrees ",
                unit.tilt_limit_deg
            )),
            sign(tilt <= unit.tilt_limit_deg, ["ok", "wrong"]),
        ]),
    }
}

fn temperature_line(unit: &UnitState, judged: bool) -> Line<'static> {
    let Some(temp) = unit.temp_c else {
        return Line::raw("temp   not measured");
    };
    let mut spans = vec![Span::raw(format!("temp   {temp:.1} °C"))];
    match (unit.trend_c_per_min, unit.trend_limit_c_per_min) {
        (None, _) => {}
        (Some(trend), Some(limit)) if judged => {
            spans.push(Span::raw(format!(", {trend:+.2} of {limit}/min ")));
            spans.push(sign(trend.abs() <= limit, ["ok", "warms"]));
        }
        (Some(trend), _) => spans.push(Span::raw(format!(", {trend:+.2} °C/min"))),
    }
    Line::from(spans)
}
