//! What the full screen of a session shows: a function of how the session stands, what has happened and what is asked, and of the
//! size of the terminal alone.

use mimu::quantity::{minutes, significant};
use mimu_wizard::event::{Standing, UnitStanding};
use mimu_wizard::refit::{Aim, Progress};
use mimu_wizard::step::sketch;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize as _};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph};

/// Least columns and rows of a terminal.
pub(crate) const LEAST: [u16; 2] = [80, 24];
/// Columns of what is to be done, and of one unit: half of the narrowest terminal.
const COLUMN: u16 = 40;
/// Rows of one unit: as many as the sketch of a box and two lines need as well.
const UNIT: u16 = 11;
/// Rows of a table of parameters: six of them, their heads and a frame.
const TABLE: u16 = 9;
/// Least rows of what has happened, where there is room.
const LOG: u16 = 8;
/// Cells of a bar; its middle is the limit.
const BAR: usize = 15;

/// All that the picture depends on.
pub(crate) struct Shown<'a> {
    /// How the session stands.
    pub standing: &'a Standing,
    /// What has happened, the last thing last.
    pub log: &'a [String],
    /// What is asked now.
    pub question: Option<&'a str>,
}

/// Draws it.
pub(crate) fn draw(frame: &mut Frame, shown: &Shown) {
    let area = frame.area();
    if area.width < LEAST[0] || area.height < LEAST[1] {
        let words = format!(
            "the terminal has {} x {} characters, and {} x {} are needed: make it larger",
            area.width, area.height, LEAST[0], LEAST[1]
        );
        let lines = wrapped(&words, area.width.into());
        frame.render_widget(text(lines), area);
        return;
    }
    let [head, body, keys] = Layout::vertical([
        Constraint::Length(3),
        Constraint::Fill(1),
        Constraint::Length(1),
    ])
    .areas(area);
    draw_head(frame, head, shown.standing);
    let units = shown.standing.units.len().max(1) as u16;
    let across = (area.width - COLUMN) / COLUMN;
    let rows = units.div_ceil(across);
    match rows * (UNIT + TABLE) + LOG <= body.height {
        true => draw_wide(frame, body, shown, across, rows),
        false => draw_narrow(frame, body, shown),
    }
    draw_keys(frame, keys, shown.question.is_some());
    if let Some(question) = shown.question {
        draw_question(frame, area, question);
    }
}

/// Every unit with its parameters, beside what is to be done, and below what has happened.
fn draw_wide(frame: &mut Frame, area: Rect, shown: &Shown, across: u16, rows: u16) {
    let standing = shown.standing;
    let [above, log] = Layout::vertical([
        Constraint::Length(rows * (UNIT + TABLE)),
        Constraint::Fill(1),
    ])
    .areas(area);
    let [left, units] =
        Layout::horizontal([Constraint::Length(COLUMN), Constraint::Fill(1)]).areas(above);
    draw_step(frame, left, standing);
    for (k, unit) in (0..).zip(&standing.units) {
        let wide = units.width / across.min(standing.units.len() as u16);
        let block = Rect {
            x: units.x + k % across * wide,
            y: units.y + k / across * (UNIT + TABLE),
            width: wide,
            height: UNIT + TABLE,
        };
        let [state, table] =
            Layout::vertical([Constraint::Length(UNIT), Constraint::Length(TABLE)]).areas(block);
        draw_unit(frame, state, unit, standing);
        draw_table(frame, table, standing.progress.get(usize::from(k)), None);
    }
    draw_log(frame, log, shown.log);
}

/// One unit whole, or several in short; the parameters of the one that is farthest from its targets.
fn draw_narrow(frame: &mut Frame, area: Rect, shown: &Shown) {
    let standing = shown.standing;
    let [above, below] =
        Layout::vertical([Constraint::Length(UNIT), Constraint::Fill(1)]).areas(area);
    let halves = || Layout::horizontal([Constraint::Length(COLUMN), Constraint::Fill(1)]);
    let [step, units] = halves().areas(above);
    let [table, log] = halves().areas(below);
    draw_step(frame, step, standing);
    match standing.units.as_slice() {
        [unit] => draw_unit(frame, units, unit, standing),
        all => draw_units(frame, units, all),
    }
    let several = standing.units.len() > 1;
    let worst = (0..standing.progress.len()).max_by(|a, b| {
        distance(&standing.progress[*a]).total_cmp(&distance(&standing.progress[*b]))
    });
    let name = worst
        .filter(|_| several)
        .and_then(|k| standing.units.get(k))
        .map(|u| u.unit.as_str());
    draw_table(frame, table, worst.map(|k| &standing.progress[k]), name);
    draw_log(frame, log, shown.log);
}

/// The largest half-width in targets.
fn distance(progress: &Progress) -> f64 {
    let aims = progress.sensors.iter().flat_map(|s| &s.aims);
    let all = aims.map(|a| a.half_width / a.target);
    match progress.sensors.len() {
        2 => all.fold(0.0, f64::max),
        _ => f64::INFINITY,
    }
}

fn draw_head(frame: &mut Frame, area: Rect, standing: &Standing) {
    let title = match standing.phase {
        "" => " mimu wizard ".to_string(),
        phase => format!(" mimu wizard: {phase} "),
    };
    let block = Block::bordered().title(title.bold());
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let [done, planned] = standing.dwells;
    let planned = planned.max(done);
    let right = format!(
        "{} thrown away   {}",
        standing.thrown,
        minutes(standing.elapsed_s.round())
    );
    let left = match planned {
        0 => String::new(),
        _ => format!("{done} of {planned} dwells "),
    };
    let room = usize::from(inner.width).saturating_sub(left.chars().count() + right.len() + 5);
    let mut spans = vec![Span::raw(format!(" {left}"))];
    if planned > 0 {
        spans.push(Span::raw(filled(done as f64 / planned as f64, room)).cyan());
    } else {
        spans.push(Span::raw(" ".repeat(room)));
    }
    spans.push(Span::raw(format!("   {right}")));
    frame.render_widget(Line::from(spans), inner);
}

fn draw_step(frame: &mut Frame, area: Rect, standing: &Standing) {
    let inner = framed(frame, area, "what to do", false);
    let wide = usize::from(inner.width);
    let lines = match &standing.step {
        None => {
            let words = match standing.phase {
                "warm-up" => "leave it still",
                "store" => "the calibration goes into the device",
                "diagnosis" => "nothing: what still errs is looked for",
                _ => "nothing now",
            };
            wrapped(words, wide)
        }
        Some(step) => {
            let mut words = step.words();
            if step.rate_dps == 0.0 {
                words.push_str(", at rest");
            }
            let mut lines = wrapped(&words, wide);
            lines.truncate(usize::from(UNIT - 2) - 7);
            lines.extend(sketch(&step.up()));
            lines
        }
    };
    frame.render_widget(text(lines), inner);
}

fn draw_unit(frame: &mut Frame, area: Rect, unit: &UnitStanding, standing: &Standing) {
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
    lines.push(rate.unwrap_or_else(|| Line::raw("rate   not known yet")));
    lines.push(temperature_line(unit, standing.phase == "warm-up"));
    lines.push(Line::raw(format!(
        "samples {}, {} lost",
        grouped(unit.samples),
        grouped(unit.lost)
    )));
    if let Some(why) = &unit.waiting {
        let words = wrapped(&format!("waits: {why}"), wide);
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

/// Several units where there is no room for each: two lines of each, those that wait first.
fn draw_units(frame: &mut Frame, area: Rect, units: &[UnitStanding]) {
    let inner = framed(frame, area, &format!("{} units", units.len()), false);
    let wide = usize::from(inner.width);
    let mut order: Vec<&UnitStanding> = units.iter().collect();
    order.sort_by_key(|u| u.waiting.is_none());
    let room = usize::from(inner.height);
    let fit = match 2 * units.len() <= room {
        true => units.len(),
        false => (room - 1) / 2,
    };
    let mut lines = Vec::new();
    for unit in &order[..fit] {
        let state = match (&unit.waiting, unit.left_s) {
            (Some(why), _) => format!("waits: {why}"),
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

/// Three digits, and no more than four characters.
fn capped(value: f64) -> String {
    match value {
        v if v < 9.995 => format!("{v:.2}"),
        v if v < 99.95 => format!("{v:.1}"),
        v if v < 999.5 => format!("{v:.0}"),
        _ => ">999".into(),
    }
}

fn tilt_line(unit: &UnitStanding) -> Line<'static> {
    match unit.tilt_deg {
        None => Line::raw("tilt   no pose is wanted"),
        Some(tilt) => Line::from(vec![
            Span::raw(format!(
                "tilt   {tilt:.1} of {} degrees ",
                unit.tilt_limit_deg
            )),
            sign(tilt <= unit.tilt_limit_deg, ["ok", "wrong"]),
        ]),
    }
}

fn temperature_line(unit: &UnitStanding, judged: bool) -> Line<'static> {
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

fn draw_table(frame: &mut Frame, area: Rect, progress: Option<&Progress>, unit: Option<&str>) {
    let title = match unit {
        None => "half of the 95 % interval".to_string(),
        Some(name) => format!("half of the 95 % interval, {name}"),
    };
    let inner = framed(frame, area, &title, false);
    let sensors = progress.map_or(&[][..], |p| &p.sensors);
    if sensors.is_empty() {
        let why = progress.and_then(|p| p.not_yet.as_deref());
        let words = why.unwrap_or("nothing is determined yet");
        frame.render_widget(text(wrapped(words, inner.width.into())), inner);
        return;
    }
    let mut lines = vec![Line::raw("      worst of    is   wanted").italic()];
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
        aim.parameter,
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

/// A target as it was given.
fn significant_or_whole(value: f64) -> String {
    format!("{value}").chars().take(6).collect()
}

fn draw_log(frame: &mut Frame, area: Rect, log: &[String]) {
    let inner = framed(frame, area, "what has happened", false);
    let (wide, high) = (usize::from(inner.width), usize::from(inner.height));
    let mut lines: Vec<String> = Vec::new();
    // Only what is seen is wrapped.
    for entry in log.iter().rev() {
        if lines.len() >= high {
            break;
        }
        lines.extend(wrapped(entry, wide).into_iter().rev());
    }
    lines.truncate(high);
    lines.reverse();
    frame.render_widget(text(lines), inner);
}

fn draw_keys(frame: &mut Frame, area: Rect, asked: bool) {
    let keys = match asked {
        true => " y yes   n no   q end, to go on later",
        false => " q end, to go on later   r have the last dwell again   s another step first",
    };
    let style = Style::new().add_modifier(Modifier::REVERSED);
    let wide = usize::from(area.width);
    frame.render_widget(Span::styled(format!("{keys:wide$}"), style), area);
}

fn draw_question(frame: &mut Frame, area: Rect, question: &str) {
    let wide = (area.width - 8).min(90);
    let mut lines = wrapped(question, usize::from(wide) - 4);
    lines.truncate(usize::from(area.height) - 8);
    lines.extend([String::new(), "y yes   n no".into()]);
    let high = lines.len() as u16 + 2;
    let box_area = Rect {
        x: area.x + (area.width - wide) / 2,
        y: area.y + (area.height - high) / 2,
        width: wide,
        height: high,
    };
    frame.render_widget(Clear, box_area);
    let block = Block::bordered()
        .title(" a question ".bold())
        .border_style(Style::new().fg(Color::Yellow));
    let inner = block.inner(box_area);
    frame.render_widget(block, box_area);
    let lines = lines.into_iter().map(|l| Line::raw(format!(" {l}")));
    frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()), inner);
}

/// A frame with a title; what is inside.
fn framed(frame: &mut Frame, area: Rect, title: &str, waits: bool) -> Rect {
    let title = clipped(title, usize::from(area.width).saturating_sub(4));
    let mut block = Block::bordered().title(format!(" {title} ").bold());
    if waits {
        block = block.border_style(Style::new().fg(Color::Yellow));
    }
    let inner = block.inner(area);
    frame.render_widget(block, area);
    inner
}

/// Met or not in a word; its colour says the same once more.
fn sign(met: bool, words: [&'static str; 2]) -> Span<'static> {
    match met {
        true => Span::raw(words[0]).green(),
        false => Span::raw(words[1]).red().bold(),
    }
}

/// A bar of so many cells.
fn filled(share: f64, cells: usize) -> String {
    let full = (share.clamp(0.0, 1.0) * cells as f64).round() as usize;
    format!("{}{}", "█".repeat(full), "·".repeat(cells - full))
}

/// Digits in groups of three.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

fn clipped(text: &str, wide: usize) -> String {
    match text.chars().count() <= wide {
        true => text.into(),
        false => text
            .chars()
            .take(wide.saturating_sub(1))
            .chain(['…'])
            .collect(),
    }
}

/// Lines of at most so many characters, broken at blanks where there are any; all but the first are indented.
fn wrapped(text: &str, wide: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    let mut length = 0;
    for word in text.split_whitespace() {
        let mut word: Vec<char> = word.chars().collect();
        loop {
            let begun = length > 0 && !(lines.len() > 1 && length == 2);
            let room = wide.saturating_sub(length + usize::from(begun));
            if word.len() > room && begun {
                lines.push("  ".into());
                length = 2;
                continue;
            }
            let rest = word.split_off(word.len().min(room.max(1)));
            if let Some(line) = lines.last_mut() {
                if begun {
                    line.push(' ');
                }
                line.extend(&word);
            }
            length += word.len() + usize::from(begun);
            if rest.is_empty() {
                break;
            }
            lines.push("  ".into());
            length = 2;
            word = rest;
        }
    }
    lines
}

fn text(lines: Vec<String>) -> Paragraph<'static> {
    Paragraph::new(lines.into_iter().map(Line::raw).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests;
