//! Draws the full screen of a session, from its state, its events, the present question and the size of the terminal alone.

mod shapes;
mod table;
mod unit;

use mimu::quantity::minutes;
use mimu_equipment::step::sketch;
use mimu_wizard::event::{Phase, SessionState};
use mimu_wizard::refit::Progress;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize as _};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph};

use shapes::{filled, framed, text, wrapped};
use table::draw_table;
use unit::{draw_unit, draw_units};

/// Smallest size of a terminal: columns and rows.
pub(crate) const LEAST: [u16; 2] = [80, 24];
/// Columns of the instruction and of one unit: half of the narrowest terminal.
const COLUMN: u16 = 40;
/// Rows of one unit: also enough for the sketch of a box and two lines.
const UNIT: u16 = 11;
/// Rows of a table of parameters: six of them, their headings and a frame.
const TABLE: u16 = 9;
/// Fewest rows of the log, if there is space.
const LOG: u16 = 8;

/// Everything that the picture shows.
pub(crate) struct Shown<'a> {
    /// State of the session.
    pub standing: &'a SessionState,
    /// Past events; the last entry is the latest.
    pub log: &'a [String],
    /// The present question.
    pub question: Option<&'a str>,
}

/// Draws the picture.
pub(crate) fn draw(frame: &mut Frame, shown: &Shown) {
    let area = frame.area();
    if area.width < LEAST[0] || area.height < LEAST[1] {
        let words = format!(
            "the terminal has {} x {} characters, but {} x {} are needed: make it larger",
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

/// Every unit with its parameters, next to the instruction, and the log below.
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

/// One unit in full, or several in short, and the parameters of the unit farthest from its targets.
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

/// The largest half-width relative to its target.
fn distance(progress: &Progress) -> f64 {
    let aims = progress.sensors.iter().flat_map(|s| &s.aims);
    let all = aims.map(|a| a.half_width / a.target);
    match progress.sensors.len() {
        2 => all.fold(0.0, f64::max),
        _ => f64::INFINITY,
    }
}

fn draw_head(frame: &mut Frame, area: Rect, standing: &SessionState) {
    let title = format!(" mimu wizard: {} ", standing.phase);
    let block = Block::bordered().title(title.bold());
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let [done, planned] = standing.dwells;
    let planned = planned.max(done);
    let right = format!(
        "{} discarded   {}",
        standing.discarded,
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

fn draw_step(frame: &mut Frame, area: Rect, standing: &SessionState) {
    let inner = framed(frame, area, "what to do", false);
    let wide = usize::from(inner.width);
    let lines = match &standing.step {
        None => {
            let words = match standing.phase {
                Phase::WarmUp => "leave the unit at rest",
                Phase::Store => "wait: the calibration is being stored",
                Phase::Diagnosis => "wait: the remaining error is being diagnosed",
                _ => "nothing now",
            };
            wrapped(words, wide)
        }
        Some(step) => {
            let spin = standing.units.first().and_then(|unit| unit.spin.as_ref());
            let words = match (spin, step.rate_dps) {
                (Some(spin), _) => spin.words(),
                (None, 0.0) => format!("{}, at rest", step.words()),
                (None, _) => step.words(),
            };
            let mut lines = wrapped(&words, wide);
            lines.truncate(usize::from(UNIT - 2) - 7);
            lines.extend(sketch(&step.up()));
            lines
        }
    };
    frame.render_widget(text(lines), inner);
}

fn draw_log(frame: &mut Frame, area: Rect, log: &[String]) {
    let inner = framed(frame, area, "events", false);
    let (wide, high) = (usize::from(inner.width), usize::from(inner.height));
    let mut lines: Vec<String> = Vec::new();
    // Only visible entries are wrapped.
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
        true => " y yes   n no   q end, resume later",
        false => " q end, resume later   r repeat the last dwell   s another pose first",
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

#[cfg(test)]
mod tests;
