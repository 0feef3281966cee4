//! Lists of the formats in other languages are those of [`FORMATS`].

use std::path::Path;

use mimu_export::{FORMATS, Format, Noise, Page};

/// Compares the part of `path` between two lines with `ours`; writes it where `MIMU_WRITE` is set.
fn compare(path: &str, [begin, end]: [&str; 2], ours: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path);
    let text = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = text.split_once(begin).unwrap();
    let at = rest.find(end).unwrap();
    if std::env::var_os("MIMU_WRITE").is_some() {
        let text = [before, begin, ours, &rest[at..]].concat();
        return std::fs::write(&path, text).unwrap();
    }
    assert!(
        &rest[..at] == ours,
        "{} does not list the formats as they declare themselves: run this test with MIMU_WRITE=1",
        path.display()
    );
}

#[test]
fn the_documentation_has_a_row_for_each_format() {
    let row = |f: &Format| format!("| `{}` | {} |\n", f.name, f.row.join(" | "));
    let rows: String = FORMATS.iter().map(row).collect();
    let head = "| format | what is in it | who reads it |\n|---|---|---|\n";
    compare("docs/export.md", [head, "\nMore: "], &rows);
}

#[test]
fn python_knows_the_name_of_each_format() {
    let mut lines = vec![String::new()];
    for name in FORMATS.iter().map(|f| format!(" \"{}\",", f.name)) {
        if lines[lines.len() - 1].len() + name.len() > 130 {
            lines.push(String::new());
        }
        lines.last_mut().unwrap().push_str(&name);
    }
    let lines: String = lines.iter().map(|line| format!("   {line}\n")).collect();
    compare(
        "python/mimu/_files.py",
        ["Format = Literal[\n", "]\n"],
        &lines,
    );
}

#[test]
fn the_page_offers_what_each_format_declares_for_it() {
    let entry = |f: &Format, page: &Page, of: &str| {
        let args = [f.name].into_iter().chain(page.options.split_whitespace());
        let args: Vec<String> = args.map(|a| format!("{a:?}")).collect();
        let (label, file, args) = (page.label, page.file, args.join(", "));
        format!("  {{ name: {label:?}, file: {file:?}, args: [{args}], of: {of:?} }},\n")
    };
    let mut lines = String::new();
    for of in ["calibration", "noise"] {
        for format in FORMATS {
            let noise = matches!(format.noise, Noise::Needed | Noise::Only);
            for page in format.pages.iter().filter(|_| noise == (of == "noise")) {
                lines += &entry(format, page, of);
            }
        }
    }
    compare(
        "web/page/exports.js",
        ["export const FORMATS = [\n", "];\n"],
        &lines,
    );
}
