//! Frames, bars and lines of text of the picture.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style, Stylize as _};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};

/// Draws a frame with a title, and returns the area inside.
pub(super) fn framed(frame: &mut Frame, area: Rect, title: &str, waits: bool) -> Rect {
    let title = clipped(title, usize::from(area.width).saturating_sub(4));
    let mut block = Block::bordered().title(format!(" {title} ").bold());
    if waits {
        block = block.border_style(Style::new().fg(Color::Yellow));
    }
    let inner = block.inner(area);
    frame.render_widget(block, area);
    inner
}

/// A word for met or not; the colour only repeats it.
pub(super) fn sign(met: bool, words: [&'static str; 2]) -> Span<'static> {
    match met {
        true => Span::raw(words[0]).green(),
        false => Span::raw(words[1]).red().bold(),
    }
}

/// A bar of this many cells.
pub(super) fn filled(share: f64, cells: usize) -> String {
    let full = (share.clamp(0.0, 1.0) * cells as f64).round() as usize;
    format!("{}{}", "█".repeat(full), "·".repeat(cells - full))
}

/// Digits in groups of three.
pub(super) fn grouped(number: u64) -> String {
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

/// `text`, shortened to this many characters.
pub(super) fn clipped(text: &str, wide: usize) -> String {
    match text.chars().count() <= wide {
        true => text.into(),
        false => text
            .chars()
            .take(wide.saturating_sub(1))
            .chain(['…'])
            .collect(),
    }
}

/// Lines of at most this many characters, broken at spaces if there are any. All but the first are indented.
pub(super) fn wrapped(text: &str, wide: usize) -> Vec<String> {
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

/// Lines without wrapping.
pub(super) fn text(lines: Vec<String>) -> Paragraph<'static> {
    Paragraph::new(lines.into_iter().map(Line::raw).collect::<Vec<_>>())
}
