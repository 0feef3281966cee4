//! Lines and warnings, for all results that people read.

use std::fmt::{Display, Write as _};

/// Width that text keeps to, characters.
pub(crate) const COLUMNS: usize = 98;

/// `head` and `text` in lines, the later ones below the beginning of the text, or a little in where the head is long.
pub(super) fn wrap(out: &mut String, head: &str, text: &str) {
    let first = head.chars().count();
    let spaces = head.chars().take_while(|c| *c == ' ').count();
    let indent = if first > COLUMNS / 3 {
        spaces + 2
    } else {
        first
    };
    let (mut line, mut begun) = (head.to_string(), false);
    for word in text.split(' ') {
        let longer = line.chars().count() + usize::from(begun) + word.chars().count();
        if begun && longer > COLUMNS {
            let _ = writeln!(out, "{line}");
            (line, begun) = (" ".repeat(indent), false);
        }
        if begun {
            line.push(' ');
        }
        line.push_str(word);
        begun = true;
    }
    let _ = writeln!(out, "{line}");
}

pub(crate) fn warn(out: &mut String, warnings: impl Iterator<Item = impl Display>) {
    for warning in warnings {
        let _ = writeln!(out, "warning: {warning}");
    }
}
