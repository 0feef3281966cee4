//! Documents of prose that people write, with the output of programs between markers.

use std::fmt::Write as _;

/// A computed part of the document.
pub struct Block {
    /// Name in its markers.
    pub name: &'static str,
    /// Markdown. `None` if the recording is not available: the document then keeps its text.
    pub text: Option<String>,
}

impl Block {
    /// From a table.
    pub fn table(name: &'static str, table: &Table) -> Self {
        Self {
            name,
            text: Some(table.markdown()),
        }
    }

    /// With the commit that it was made at, for tables that take too long to be made again by every test run: a reader sees how old the figures are.
    pub fn made_here(mut self) -> Self {
        if let (Some(text), Some(commit)) = (&mut self.text, commit()) {
            let _ = write!(text, "\nMade at commit {commit}.");
        }
        self
    }
}

/// The commit of the working tree, with `+` if there are changes to it.
fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = std::process::Command::new("git")
            .args(arguments)
            .current_dir(docs())
            .output();
        let text = String::from_utf8(output.ok()?.stdout).ok()?;
        Some(text.trim().to_owned())
    };
    let commit = git(&["rev-parse", "--short=8", "HEAD"]).filter(|c| !c.is_empty())?;
    let changed = git(&["status", "--porcelain", "--untracked-files=no", ".."])?;
    let changed = changed.lines().any(|l| !l.contains("docs/"));
    Some(commit + if changed { "+" } else { "" })
}

/// Markdown table with aligned columns.
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these column headings.
    pub fn new(headings: &[&str]) -> Self {
        Self {
            rows: vec![headings.iter().map(ToString::to_string).collect()],
        }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// As Markdown: the first column left-aligned, numbers right-aligned.
    pub fn markdown(&self) -> String {
        let columns = self.rows[0].len();
        let width = |c: usize| {
            let cells = self.rows.iter().filter_map(|r| r.get(c));
            cells.map(|t| t.chars().count()).max().unwrap_or(0).max(3)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        let mut out = String::new();
        for (r, row) in self.rows.iter().enumerate() {
            for (c, cell) in row.iter().enumerate() {
                let w = widths[c];
                let _ = match c {
                    0 => write!(out, "| {cell:<w$} "),
                    _ => write!(out, "| {cell:>w$} "),
                };
            }
            out.push_str("|\n");
            if r == 0 {
                let rule = |(c, w): (usize, &usize)| {
                    let dashes = "-".repeat(w + 1);
                    if c == 0 {
                        format!("|{dashes}-")
                    } else {
                        format!("|{dashes}:")
                    }
                };
                out.extend(widths.iter().enumerate().map(rule));
                out.push_str("|\n");
            }
        }
        out
    }
}

/// `x` to three significant digits, in the style of these documents: with an exponent from seven digits on.
pub fn significant(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let digits = 2 - x.abs().log10().floor() as i32;
    match digits {
        ..=-3 | 7.. => format!("{x:.2e}"),
        _ => format!("{x:.*}", digits.max(0) as usize),
    }
}

/// Pages of `docs/` with places for blocks, by their names within that folder.
pub struct Pages(Vec<(&'static str, String)>);

impl Pages {
    /// Reads the pages `names`.
    ///
    /// # Errors
    /// A page that cannot be read.
    pub fn read(names: &[&'static str]) -> Result<Self, String> {
        let read = |name: &&'static str| {
            let text = std::fs::read_to_string(docs().join(name));
            text.map(|t| (*name, t))
                .map_err(|e| format!("docs/{name}: {e}"))
        };
        names.iter().map(read).collect::<Result<_, _>>().map(Self)
    }

    /// The pages with every block in its place. Blocks and places must match one to one.
    ///
    /// # Errors
    /// A block without a place, or a place without a block.
    pub fn filled(&self, blocks: &[Block]) -> Result<Self, String> {
        let mut pages = self.0.clone();
        for block in blocks {
            let (open, close) = (
                format!("<!-- {} -->\n", block.name),
                format!("<!-- /{} -->", block.name),
            );
            let page = pages.iter_mut().find(|(_, text)| text.contains(&open));
            let (name, out) = page.ok_or(format!("no page has a place {open:?}"))?;
            let start = out.find(&open).unwrap_or_default() + open.len();
            let end = out
                .find(&close)
                .filter(|end| *end >= start)
                .ok_or(format!("docs/{name} has no {close:?}"))?;
            if let Some(text) = &block.text {
                out.replace_range(start..end, &format!("\n{}\n\n", text.trim_end()));
            }
        }
        let places: usize = pages.iter().map(|p| p.1.matches("<!-- /").count()).sum();
        if places != blocks.len() {
            let count = blocks.len();
            return Err(format!("the pages have {places} places for {count} blocks"));
        }
        Ok(Self(pages))
    }

    /// The first line that differs in words or by more than 3 % in a number: its page, as it is here, and as it is in `other`.
    pub fn first_difference<'a>(&'a self, other: &'a Self) -> Option<[&'a str; 3]> {
        let mut pages = self.0.iter().zip(&other.0);
        pages.find_map(|((name, here), (_, there))| {
            let mut lines = here.lines().zip(there.lines());
            let (a, b) = lines.find(|(a, b)| !agree(a, b))?;
            Some([*name, a, b])
        })
    }

    /// Writes the pages.
    ///
    /// # Errors
    /// A page that cannot be written.
    pub fn write(&self) -> Result<(), String> {
        let mut each = self.0.iter();
        each.try_for_each(|(name, text)| {
            std::fs::write(docs().join(name), text).map_err(|e| format!("docs/{name}: {e}"))
        })
    }
}

/// The folder of the documents.
pub fn docs() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

/// Whether two lines have the same words and the same numbers to 3 %. The tolerance allows for machines whose sine rounds differently.
fn agree(a: &str, b: &str) -> bool {
    let words = |line: &str| -> Vec<String> {
        let cells = line.replace('|', " ");
        cells.split_whitespace().map(ToString::to_string).collect()
    };
    let same = |a: &String, b: &String| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => (a - b).abs() <= 0.03 * a.abs().max(b.abs()),
        _ => a == b,
    };
    let (a, b) = (words(a), words(b));
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| same(a, b))
}
