//! A table of a result, built once: as text for a terminal, and as HTML for pages and notebooks.
//!
//! Cells are typed, so that both show a number with the same digits, and HTML has the value of the JSON beside it.

use maud::{Markup, html};
use mimu::quantity::{plus_minus, significant};

use super::page::written;
use super::text::columns;

/// Narrowest first column and narrowest column of numbers in text, characters.
const LABEL: usize = 18;
const NUMBER: usize = 11;

/// A cell. `factor` converts from SI to the unit of the column or the row.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    /// Words.
    Words(String),
    /// A name that a program knows: a file, an id.
    Code(String),
    /// A number in SI; unknown if it is not finite.
    Number { si: f64, factor: f64 },
    /// A number with the half-width of its interval.
    Interval { si: f64, half: f64, factor: f64 },
    /// A number with the ends of its interval.
    Between { si: f64, ends: [f64; 2] },
    /// A count.
    Count(u64),
    /// Nothing.
    Empty,
}

impl Cell {
    pub(super) fn number(si: f64, factor: f64) -> Self {
        Self::Number { si, factor }
    }

    /// A number, unknown if there is none.
    pub(super) fn known(si: Option<f64>, factor: f64) -> Self {
        Self::number(si.unwrap_or(f64::NAN), factor)
    }

    fn text(&self) -> String {
        match self {
            Self::Words(words) | Self::Code(words) => words.clone(),
            Self::Number { si, .. } if !si.is_finite() => "-".into(),
            Self::Number { si, factor } => significant(si * factor),
            Self::Interval { si, half, factor } => plus_minus(si * factor, half * factor),
            Self::Between { si, ends } => {
                let [value, low, high] = [*si, ends[0], ends[1]].map(significant);
                format!("{value} ({low} to {high})")
            }
            Self::Count(count) => count.to_string(),
            Self::Empty => String::new(),
        }
    }

    fn html(&self) -> Markup {
        let text = self.text();
        match self {
            Self::Words(_) => html! { (words(&text)) },
            Self::Code(_) => html! { code { (text) } },
            Self::Number { si, .. } if !si.is_finite() => html! { "–" },
            Self::Number { si, .. } | Self::Interval { si, .. } | Self::Between { si, .. } => {
                html! { data value=(si) { (written(&text)) } }
            }
            Self::Count(_) | Self::Empty => html! { (text) },
        }
    }
}

impl From<&str> for Cell {
    fn from(words: &str) -> Self {
        Self::Words(words.into())
    }
}

impl From<String> for Cell {
    fn from(words: String) -> Self {
        Self::Words(words)
    }
}

/// Words with a minus sign before their numbers. An `e` in them is no exponent.
fn words(text: &str) -> String {
    let mut out = String::new();
    let mut before = ' ';
    let mut letters = text.chars().peekable();
    while let Some(c) = letters.next() {
        let number = letters.peek().is_some_and(char::is_ascii_digit);
        out.push(match c == '-' && before == ' ' && number {
            true => '−',
            false => c,
        });
        before = c;
    }
    out
}

/// How a column is aligned, and where it is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    /// Numbers, aligned to the right.
    Numbers,
    /// Words, aligned to the left.
    Words,
    /// Words that are too long for a terminal.
    OnPage,
}

/// A table. Its first column names the rows.
#[derive(Debug, Clone)]
pub(super) struct Table {
    caption: String,
    columns: Vec<(String, Column)>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table with this caption, which only HTML shows, and this head of the first column.
    pub(super) fn new(caption: impl Into<String>, first: impl Into<String>) -> Self {
        Self {
            caption: caption.into(),
            columns: vec![(first.into(), Column::Words)],
            rows: Vec::new(),
        }
    }

    /// Adds columns of numbers.
    pub(super) fn numbers<T: Into<String>>(mut self, heads: impl IntoIterator<Item = T>) -> Self {
        let heads = heads.into_iter().map(|h| (h.into(), Column::Numbers));
        self.columns.extend(heads);
        self
    }

    /// Adds a column of words.
    pub(super) fn words(mut self, head: impl Into<String>) -> Self {
        self.columns.push((head.into(), Column::Words));
        self
    }

    /// Adds a column of words that only HTML shows.
    pub(super) fn on_page(mut self, head: impl Into<String>) -> Self {
        self.columns.push((head.into(), Column::OnPage));
        self
    }

    /// Adds a row. Cells that are missing at its end are empty.
    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        let mut cells: Vec<Cell> = cells.into_iter().collect();
        cells.resize(self.columns.len(), Cell::Empty);
        self.rows.push(cells);
    }

    /// As text, each line behind `indent`.
    pub(super) fn text(&self, indent: &str) -> String {
        let shown: Vec<usize> = (0..self.columns.len())
            .filter(|c| self.columns[*c].1 != Column::OnPage)
            .collect();
        let head: Vec<String> = self.columns.iter().map(|c| c.0.clone()).collect();
        let body = self.rows.iter();
        let body = body.map(|row| row.iter().map(Cell::text).collect());
        let lines: Vec<Vec<String>> = std::iter::once(head).chain(body).collect();
        let width = |c: usize| {
            let longest = lines.iter().map(|l| l[c].chars().count()).max();
            let longest = longest.unwrap_or(0);
            match (c, self.columns[c].1) {
                (0, _) => (longest + 1).max(LABEL - indent.chars().count()),
                (_, Column::Numbers) => (longest + 2).max(NUMBER),
                _ => longest,
            }
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let mut out = String::new();
        for (block, line) in self
            .blocks(&shown, &widths, indent.chars().count())
            .iter()
            .flat_map(|b| lines.iter().map(move |l| (b, l)))
        {
            let mut text = indent.to_string();
            for &c in block {
                let width = widths[c];
                text += &match (c, self.columns[c].1) {
                    (0, _) => format!("{:<width$}", line[c]),
                    (_, Column::Numbers) => format!("{:>width$}", line[c]),
                    _ => format!("  {:<width$}", line[c]),
                };
            }
            out += text.trim_end();
            out.push('\n');
        }
        out
    }

    /// The columns `shown`, in blocks that fit into the width of the text; each begins with the first column.
    fn blocks(&self, shown: &[usize], widths: &[usize], indent: usize) -> Vec<Vec<usize>> {
        let [first, others @ ..] = shown else {
            return Vec::new();
        };
        let begin = indent + widths[*first];
        let (mut blocks, mut width) = (vec![vec![*first]], begin);
        for &c in others {
            let last = blocks.len() - 1;
            if blocks[last].len() > 1 && width + widths[c] > columns() {
                blocks.push(vec![*first, c]);
                width = begin + widths[c];
            } else {
                blocks[last].push(c);
                width += widths[c];
            }
        }
        blocks
    }

    /// As HTML.
    pub(super) fn html(&self) -> Markup {
        let class = |c: usize| (self.columns[c].1 == Column::Numbers).then_some("n");
        html! {
            div class="scroll" { table {
                caption { (self.caption) }
                thead { tr { @for (c, (head, _)) in self.columns.iter().enumerate() { th class=[class(c)] { (words(head)) } } } }
                tbody { @for row in &self.rows { tr {
                    @for (c, cell) in row.iter().enumerate() { td class=[class(c)] { (cell.html()) } }
                } } }
            } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_html_have_the_same_digits() {
        let mut table = Table::new("Errors", "sensor").numbers(["held out", "bias"]);
        let half = 0.000_123;
        table.row([
            "gyro, deg".into(),
            Cell::number(0.0123, 180.0 / std::f64::consts::PI),
            Cell::Interval {
                si: -0.5,
                half,
                factor: 1.0,
            },
        ]);
        table.row(["accel".into(), Cell::known(None, 1.0)]);
        let lines = [
            "sensor               held out                  bias",
            "gyro, deg               0.705  -0.50000 ± 0.00012",
            "accel                       -",
        ];
        let text = table.text("");
        let words = |text: &str| {
            text.split_whitespace()
                .map(str::to_owned)
                .collect::<Vec<_>>()
                .join(" ")
        };
        assert_eq!(words(&text), words(&lines.join("\n")));
        let html = table.html().into_string();
        assert!(
            html.contains("<data value=\"0.0123\">0.705</data>"),
            "{html}"
        );
        assert!(html.contains("−0.50000 ± 0.00012"), "{html}");
        assert!(
            html.contains(">held out<") && html.contains(">gyro, deg<"),
            "{html}"
        );
    }

    #[test]
    fn a_table_that_is_too_wide_goes_on_below_with_its_first_column() {
        let mut table = Table::new("", "axis").numbers((0..12).map(|k| format!("column {k}")));
        table.row(std::iter::once("x".into()).chain((0..12).map(Cell::Count)));
        let text = table.text("  ");
        assert!(
            text.lines().all(|line| line.chars().count() <= columns()),
            "{text}"
        );
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert!(
            lines[2].starts_with("  axis") && lines[3].starts_with("  x"),
            "{text}"
        );
        assert!(text.contains("column 11"), "{text}");
    }

    #[test]
    fn columns_are_as_wide_as_their_longest_cell() {
        let mut table = Table::new("", "a name that is longer than eighteen").numbers(["n"]);
        table.row(["x".into(), Cell::Count(1_234_567_890_123)]);
        let text = table.text("  ");
        let widths: Vec<usize> = text.lines().map(|l| l.chars().count()).collect();
        assert_eq!(widths[0], widths[1]);
        assert!(text.lines().all(|l| l.starts_with("  ")));
    }
}
