//! A screen as an SVG: runs of characters with one style as text, frames and bars as lines and rectangles.

use std::fmt::Write as _;

use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};

/// Width and height of a character.
const CELL: [f64; 2] = [8.4, 18.0];
const PAPER: &str = "#16181d";
const INK: &str = "#d5d9e0";

fn ink(cell: &Cell) -> &'static str {
    match cell.fg {
        Color::Green => "#7fc97f",
        Color::Red => "#f28779",
        Color::Yellow => "#ffd173",
        Color::Cyan => "#6fc3df",
        _ => INK,
    }
}

/// Which arms a frame character has from its middle: left, right, up, down.
fn arms(symbol: &str) -> Option<[bool; 4]> {
    let arms = match symbol {
        "─" => "lr",
        "│" => "ud",
        "┌" => "rd",
        "┐" => "ld",
        "└" => "ru",
        "┘" => "lu",
        _ => return None,
    };
    Some(['l', 'r', 'u', 'd'].map(|a| arms.contains(a)))
}

/// The whole screen.
pub fn of(buffer: &Buffer) -> String {
    let [w, h] = CELL;
    let (wide, high) = (
        w * f64::from(buffer.area.width) + 16.0,
        h * f64::from(buffer.area.height) + 16.0,
    );
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {wide:.0} {high:.0}\" font-family=\"monospace\" font-size=\"14\">\n\
         <rect width=\"100%\" height=\"100%\" rx=\"6\" fill=\"{PAPER}\"/>\n"
    );
    for y in 0..buffer.area.height {
        let top = 8.0 + h * f64::from(y);
        let mut x = 0;
        while x < buffer.area.width {
            let first = &buffer[(x, y)];
            let same = |x: u16| {
                let cell = &buffer[(x, y)];
                let alone = |s: &str| arms(s).is_some() || s == "█";
                let kind = |c: &Cell| alone(c.symbol()).then(|| c.symbol().to_owned());
                (cell.fg, cell.modifier, kind(cell)) == (first.fg, first.modifier, kind(first))
            };
            let end = (x..buffer.area.width)
                .find(|x| !same(*x))
                .unwrap_or(buffer.area.width);
            let left = 8.0 + w * f64::from(x);
            run(&mut svg, buffer, [x, end], y, [left, top]);
            x = end;
        }
    }
    svg.push_str("</svg>\n");
    svg
}

fn run(svg: &mut String, buffer: &Buffer, [from, to]: [u16; 2], y: u16, [left, top]: [f64; 2]) {
    let [w, h] = CELL;
    let first = &buffer[(from, y)];
    let wide = w * f64::from(to - from);
    let reversed = first.modifier.contains(Modifier::REVERSED);
    let fill = ink(first);
    if reversed || first.symbol() == "█" {
        let (top, high) = match reversed {
            true => (top, h),
            false => (top + 3.0, h - 6.0),
        };
        let _ = writeln!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{wide:.1}\" height=\"{high:.1}\" fill=\"{fill}\"/>"
        );
        if !reversed {
            return;
        }
    }
    if first.symbol() == "─" {
        let y = top + h / 2.0;
        let _ = writeln!(
            svg,
            "<path d=\"M{left:.1} {y:.1}h{wide:.1}\" stroke=\"{fill}\" stroke-opacity=\"0.6\"/>"
        );
        return;
    }
    if let Some(arms) = arms(first.symbol()) {
        let ends = [
            [-w / 2.0, 0.0],
            [w / 2.0, 0.0],
            [0.0, -h / 2.0],
            [0.0, h / 2.0],
        ];
        let mut path = String::new();
        for x in from..to {
            let middle = [left + w * (f64::from(x - from) + 0.5), top + h / 2.0];
            for (end, _) in ends.iter().zip(arms).filter(|e| e.1) {
                let _ = write!(
                    path,
                    "M{:.1} {:.1}l{:.1} {:.1}",
                    middle[0], middle[1], end[0], end[1]
                );
            }
        }
        let _ = writeln!(
            svg,
            "<path d=\"{path}\" stroke=\"{fill}\" stroke-opacity=\"0.6\"/>"
        );
        return;
    }
    let text: String = (from..to).map(|x| buffer[(x, y)].symbol()).collect();
    let trimmed = text.trim_start();
    let skipped = text.chars().count() - trimmed.chars().count();
    let trimmed = trimmed.trim_end();
    if trimmed.is_empty() {
        return;
    }
    let escaped = trimmed.replace('&', "&amp;").replace('<', "&lt;");
    let weight = match first.modifier.contains(Modifier::BOLD) {
        true => " font-weight=\"bold\"",
        false => "",
    };
    let fill = if reversed { PAPER } else { fill };
    let _ = writeln!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" textLength=\"{:.1}\" xml:space=\"preserve\" fill=\"{fill}\"{weight}>{escaped}</text>",
        left + w * skipped as f64,
        top + 13.5,
        w * trimmed.chars().count() as f64,
    );
}
