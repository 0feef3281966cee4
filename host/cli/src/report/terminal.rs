//! Documents as text for a terminal.
//!
//! A result has one document: the HTML of its page. Here its blocks become lines. Headings of sections become empty lines, a `section` is indented, and
//! figures are left out. The attribute `data-head` is what a paragraph or the items of a list begin with.

use std::sync::OnceLock;

use maud::Markup;
use mimu::quantity::plural;

/// Width of text that does not go to a terminal, characters.
const COLUMNS: usize = 98;
/// Narrowest and widest text: narrower, tables no longer fold; wider, lines are hard to follow.
const WIDTHS: std::ops::RangeInclusive<usize> = 60..=120;
/// Narrowest first column and narrowest column of numbers, characters.
const LABEL: usize = 18;
const NUMBER: usize = 11;
/// Largest number of lines of a summary.
const SUMMARY: usize = 25;

/// Width of text, characters: that of the terminal, if the text goes to one.
pub(crate) fn columns() -> usize {
    static FOUND: OnceLock<usize> = OnceLock::new();
    *FOUND.get_or_init(|| {
        let width = terminal().map(|width| width.clamp(*WIDTHS.start(), *WIDTHS.end()));
        width.unwrap_or(COLUMNS)
    })
}

#[cfg(not(target_family = "wasm"))]
fn terminal() -> Option<usize> {
    let (terminal_size::Width(width), _) = terminal_size::terminal_size_of(std::io::stdout())?;
    Some(width.into())
}

/// A page has no terminal.
#[cfg(target_family = "wasm")]
fn terminal() -> Option<usize> {
    None
}

/// A document as text.
pub(crate) fn text(document: &Markup) -> String {
    let mut lines = Lines::default();
    lines.blocks(&parse(&document.0), "");
    lines.finish()
}

/// An element with its attributes as written, or without a tag words.
#[derive(Debug, Default)]
struct Element {
    tag: String,
    attributes: String,
    inside: Vec<Element>,
    words: String,
}

impl Element {
    fn attribute(&self, name: &str) -> Option<String> {
        let (_, value) = self.attributes.split_once(&format!("{name}=\""))?;
        value.split('"').next().map(plain)
    }

    fn is(&self, class: &str) -> bool {
        let classes = self.attribute("class").unwrap_or_default();
        classes.split(' ').any(|c| c == class)
    }

    /// Elements with this tag, at any depth.
    fn all(&self, tag: &str) -> Vec<&Self> {
        let each = self.inside.iter().flat_map(|e| match e.tag == tag {
            true => vec![e],
            false => e.all(tag),
        });
        each.collect()
    }

    /// Words with the signs of a keyboard.
    fn words(&self) -> String {
        let inside = || self.inside.iter().map(Self::words).collect();
        match self.tag.as_str() {
            "" => self.words.replace('−', "-"),
            "br" => " ".into(),
            "svg" => String::new(),
            "data" => typed(inside()),
            _ => inside(),
        }
    }
}

/// A number whose power of ten is raised, with `e`.
fn typed(number: String) -> String {
    let Some((digits, power)) = number.split_once("·10") else {
        return number;
    };
    let plain = |c: char| match "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|raised| raised == c)
    {
        Some(digit) => char::from(b'0' + digit as u8),
        None if c == '⁻' => '-',
        None => c,
    };
    format!("{digits}e{}", power.chars().map(plain).collect::<String>())
}

/// HTML that maud has written.
fn parse(html: &str) -> Vec<Element> {
    let mut open = vec![Element::default()];
    for piece in html.split('<') {
        let (tag, words) = piece.split_once('>').unwrap_or(("", piece));
        let (name, attributes) = tag.split_once(' ').unwrap_or((tag, ""));
        let name = name.trim_end_matches('/');
        if !name.is_empty() && !name.starts_with('/') {
            let (tag, attributes) = (name.into(), attributes.into());
            open.push(Element {
                tag,
                attributes,
                ..Element::default()
            });
        }
        if name.starts_with('/') || ["br", "hr"].contains(&name) {
            let whole = open.pop();
            if let Some(outer) = open.last_mut() {
                outer.inside.extend(whole);
            }
        }
        if !words.is_empty() {
            let words = Element {
                words: plain(words),
                ..Element::default()
            };
            if let Some(inner) = open.last_mut() {
                inner.inside.push(words);
            }
        }
    }
    open.pop().unwrap_or_default().inside
}

/// Text without the escapes of HTML.
fn plain(text: &str) -> String {
    let text = text.replace("&lt;", "<").replace("&gt;", ">");
    text.replace("&quot;", "\"").replace("&amp;", "&")
}

/// Lines of a text, and the warnings of a summary, which get the lines that the rest leaves them: their place, and the number of further lines that the
/// command prints.
#[derive(Debug, Default)]
struct Lines {
    done: Vec<String>,
    warnings: Option<(usize, Vec<String>, usize)>,
}

impl Lines {
    fn blocks(&mut self, elements: &[Element], pad: &str) {
        for e in elements {
            let head = |own: &str| {
                format!(
                    "{pad}{}",
                    e.attribute("data-head").as_deref().unwrap_or(own)
                )
            };
            let items = e.all("li");
            let items = items.iter().map(|item| (head("  - "), item.words()));
            match e.tag.as_str() {
                "" | "h1" | "nav" | "figure" | "svg" | "style" | "img" => {}
                "h2" | "hr" => self.space(),
                "h3" => {
                    self.space();
                    self.wrap(pad, &e.words());
                }
                "p" if e.is("line") => self.done.push(head("") + &e.words()),
                "p" => self.wrap(&head(""), &e.words()),
                "pre" => {
                    let lines = e.words();
                    self.done.extend(
                        lines
                            .lines()
                            .map(|line| format!("{pad}{}", line.trim_end())),
                    );
                }
                "dl" => self.terms(e, pad),
                "ul" if e.is("fitted") => {
                    let after = e.attribute("data-after").and_then(|n| n.parse().ok());
                    let items = items.map(|(head, words)| head + &words).collect();
                    self.warnings = Some((self.done.len(), items, after.unwrap_or(0)));
                }
                "ul" if e.is("lines") => self.done.extend(items.map(|(head, words)| head + &words)),
                "ul" => items.for_each(|(head, words)| self.wrap(&head, &words)),
                "table" => self.table(e, pad),
                "section" => self.blocks(&e.inside, &format!("{pad}  ")),
                _ => self.blocks(&e.inside, pad),
            }
        }
    }

    fn space(&mut self) {
        if self.done.last().is_some_and(|line| !line.is_empty()) {
            self.done.push(String::new());
        }
    }

    /// Wraps `head` and `text`. Further lines are indented to the beginning of the text, or only a little if the head is long.
    fn wrap(&mut self, head: &str, text: &str) {
        let (first, width) = (head.chars().count(), columns());
        let spaces = head.chars().take_while(|c| *c == ' ').count();
        let indent = if first > width / 3 { spaces + 2 } else { first };
        let (mut line, mut begun) = (head.to_string(), false);
        // An interval stays beside its value.
        for word in text.replace(" ± ", "\u{a0}±\u{a0}").split(' ') {
            if begun && line.chars().count() + 1 + word.chars().count() > width {
                self.done
                    .push(std::mem::replace(&mut line, " ".repeat(indent)));
                begun = false;
            }
            line += if begun { " " } else { "" };
            line += word;
            begun = true;
        }
        self.done.push(line.trim_end().into());
    }

    /// Terms and their descriptions: `term: description`, or in the class `aligned` all descriptions below each other.
    fn terms(&mut self, list: &Element, pad: &str) {
        let terms: Vec<String> = list.all("dt").iter().map(|t| t.words()).collect();
        let width = terms
            .iter()
            .map(|t| t.chars().count() + 2)
            .max()
            .unwrap_or(0);
        for (term, description) in terms.iter().zip(list.all("dd")) {
            let head = match list.is("aligned") {
                true => format!("{pad}{term:<width$}"),
                false => format!("{pad}{term}: "),
            };
            self.wrap(&head, &description.words());
        }
    }

    /// A table. Columns of the class `n` are aligned to the right, those of the class `page` left out. A table of the class `long` is not folded.
    fn table(&mut self, table: &Element, pad: &str) {
        let cell = |cell: &Element| match cell.words() {
            unknown if unknown == "–" => ("-".into(), cell.is("n")),
            words => (words, cell.is("n")),
        };
        let rows = table.all("tr").into_iter();
        let rows: Vec<Vec<(String, bool)>> = rows
            .map(|row| {
                row.inside
                    .iter()
                    .filter(|c| !c.is("page"))
                    .map(cell)
                    .collect()
            })
            .collect();
        let width = |c: usize| {
            let cells = || rows.iter().filter_map(|row| row.get(c));
            let longest = cells()
                .map(|cell| cell.0.chars().count())
                .max()
                .unwrap_or(0);
            match c {
                0 => (longest + 1).max(LABEL.saturating_sub(pad.len())),
                _ if cells().any(|cell| cell.1) => (longest + 2).max(NUMBER),
                _ => longest + 2,
            }
        };
        let widths: Vec<usize> = (0..rows.iter().map(Vec::len).max().unwrap_or(0))
            .map(width)
            .collect();
        let room = if table.is("long") {
            usize::MAX
        } else {
            columns() - pad.len()
        };
        for columns in folded(&widths, room) {
            for row in &rows {
                let mut line = pad.to_owned();
                for (c, (cell, right)) in columns.iter().filter_map(|c| Some((*c, row.get(*c)?))) {
                    let width = widths[c];
                    line += &match (c, right) {
                        (0, _) => format!("{cell:<width$}"),
                        (_, true) => format!("{cell:>width$}"),
                        _ => format!("  {cell:<0$}", width - 2),
                    };
                }
                self.done.push(line.trim_end().into());
            }
        }
    }

    /// All lines, of the warnings of a summary as many as it has room for.
    fn finish(mut self) -> String {
        if let Some((at, mut warnings, after)) = self.warnings.take() {
            let room = SUMMARY.saturating_sub(self.done.len() + after);
            let shown = if warnings.len() <= room {
                warnings.len()
            } else {
                room.saturating_sub(1)
            };
            let left = warnings.split_off(shown).len() as u64;
            let more = format!("warning: {} (--verbose)", plural(left, "more warning"));
            warnings.extend((left > 0).then_some(more));
            self.done.splice(at..at, warnings);
        }
        let lines = self.done.iter().flat_map(|line| [line, "\n"]);
        lines.collect::<String>().replace('\u{a0}', " ")
    }
}

/// The columns of a table, in blocks that fit into the room; each begins with the first column.
fn folded(widths: &[usize], room: usize) -> Vec<Vec<usize>> {
    let first = widths.first().copied().unwrap_or(0);
    let (mut blocks, mut width) = (vec![vec![0]], first);
    for (c, own) in widths.iter().enumerate().skip(1) {
        if width + own > room && width > first {
            blocks.push(vec![0]);
            width = first;
        }
        blocks
            .last_mut()
            .into_iter()
            .for_each(|block| block.push(c));
        width += own;
    }
    blocks
}

#[cfg(test)]
mod tests {
    use maud::html;

    use super::*;

    #[test]
    fn blocks_become_lines() {
        let document = html! {
            h1 { "Unit" } h2 { "Errors" }
            p data-head="judgement: " { strong { "good" } ": a & b" }
            section { dl { dt { "time" } dd { data value="-1.5e-7" { "−1.5·10⁻⁷" } " s" } } }
            figure { p { "drawn" } } h2 { "More" }
            ul class="lines" data-head="warning: " { li { "one" } li { "two" } }
        };
        let expected = "judgement: good: a & b\n  time: -1.5e-7 s\n\nwarning: one\nwarning: two\n";
        assert_eq!(text(&document), expected);
    }

    #[test]
    fn a_table_that_is_too_wide_goes_on_below_with_its_first_column() {
        let wide = html! { section { table {
            tr { th { "axis" } @for k in 0..12 { th class="n" { "column " (k) } } th class="page" { "of a page" } }
            tr { td { "x" } @for k in 0..12 { td class="n" { (k) } } td class="page" { "only" } }
        } } };
        let text = text(&wide);
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines.iter().all(|line| line.chars().count() <= columns()),
            "{text}"
        );
        assert_eq!(lines.len(), 4, "{text}");
        assert!(
            lines[2].starts_with("  axis") && lines[3].starts_with("  x"),
            "{text}"
        );
        assert!(
            text.contains("column 11") && !text.contains("page"),
            "{text}"
        );
    }

    #[test]
    fn a_summary_has_as_many_warnings_as_there_is_room_for() {
        let many = html! { p { "first" } ul class="fitted" data-head="warning: " { @for k in 0..40 { li { (k) } } } p { "next: last" } };
        let text = text(&many);
        assert_eq!(text.lines().count(), SUMMARY);
        assert!(
            text.ends_with("warning: 18 more warnings (--verbose)\nnext: last\n"),
            "{text}"
        );
    }
}
