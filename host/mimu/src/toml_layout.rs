//! Result files as TOML that people read: rows of a matrix one below the other, small tables on a line, small numbers with an exponent.

use serde::Serialize;

/// Text of `file` below a header of comments. Numbers have all their digits, so that they are read back exactly.
///
/// # Panics
/// If `file` is no table of values that TOML has: a matter of its type, and not of its numbers.
pub fn to_toml(header: &str, file: &impl Serialize) -> String {
    let text = toml::to_string(file).expect("a table of numbers and strings");
    let mut out = header.to_string();
    // Name of the array of tables that the line is in, and what is nested in this one of them.
    let mut array = None;
    let mut nested: Vec<Nested> = Vec::new();
    let mut in_string = false;
    for line in text.lines() {
        let fences = line.matches("\"\"\"").count() + line.matches("'''").count();
        let continued = in_string;
        in_string ^= fences % 2 == 1;
        let header = line.strip_prefix('[').filter(|_| !continued);
        if let Some(path) = header.map(|h| h.trim_matches(['[', ']'])) {
            let many = line.starts_with("[[");
            match path.split_once('.') {
                Some((parent, key)) if array == Some(parent) => {
                    Nested::begin(&mut nested, key, many)
                }
                _ => {
                    Nested::write(&mut nested, &mut out);
                    out.push('\n');
                    out.push_str(line);
                    out.push('\n');
                    array = many.then_some(path);
                }
            }
            continue;
        }
        let line = match line.split_once(" = ") {
            // What has a quote is a string or holds one: digits in it are not numbers.
            Some((key, value)) if !continued && !line.contains(['"', '\'']) => {
                format!("{key} = {}", laid_out(value))
            }
            _ => line.to_string(),
        };
        match nested.last_mut() {
            Some(table) => table.push(line, continued),
            None if continued || !line.is_empty() => {
                out.push_str(&line);
                out.push('\n');
            }
            None => {}
        }
    }
    Nested::write(&mut nested, &mut out);
    out
}

/// A table in one of an array of tables, or an array of them: written on a line each.
struct Nested {
    key: String,
    many: bool,
    tables: Vec<Vec<String>>,
}

impl Nested {
    fn begin(all: &mut Vec<Self>, key: &str, many: bool) {
        match all.last_mut().filter(|last| last.key == key) {
            Some(last) => last.tables.push(Vec::new()),
            None => all.push(Self {
                key: key.into(),
                many,
                tables: vec![Vec::new()],
            }),
        }
    }

    /// Adds a line, or to the string that the last one has begun.
    fn push(&mut self, line: String, continued: bool) {
        let Some(table) = self.tables.last_mut() else {
            return;
        };
        match table.last_mut().filter(|_| continued) {
            Some(last) => {
                last.push('\n');
                last.push_str(&line);
            }
            None if !line.is_empty() => table.push(line),
            None => {}
        }
    }

    fn write(all: &mut Vec<Self>, out: &mut String) {
        for Self { key, many, tables } in all.drain(..) {
            let tables = tables.iter().map(|t| format!("{{ {} }}", t.join(", ")));
            match many {
                true => {
                    let rows: String = tables.map(|t| format!("  {t},\n")).collect();
                    out.push_str(&format!("{key} = [\n{rows}]\n"));
                }
                false => tables.for_each(|t| out.push_str(&format!("{key} = {t}\n"))),
            }
        }
    }
}

/// A number or an array of them.
fn laid_out(value: &str) -> String {
    let matrix = value.starts_with("[[");
    let mut out = String::new();
    for token in value.split_inclusive([',', '[', ']']) {
        let (number, end) =
            token.split_at(token.len() - usize::from(token.ends_with([',', '[', ']'])));
        let space = if number.starts_with(' ') { " " } else { "" };
        out.push_str(space);
        match number.trim().parse::<f64>() {
            // Display writes 1e-12 as 0.000000000001; Debug does not, and both read back as they were.
            Ok(x) if number.contains('.') => out.push_str(&format!("{x:?}")),
            _ => out.push_str(number.trim()),
        }
        out.push_str(end);
    }
    match matrix {
        true => out
            .replacen("[[", "[\n  [", 1)
            .replace("], [", "],\n  [")
            .replacen("]]", "],\n]", 1),
        false => out,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, serde::Deserialize)]
    struct File {
        name: String,
        small: f64,
        count: u64,
        rows: [[f64; 2]; 2],
        empty: Vec<f64>,
        part: Part,
        list: Vec<Entry>,
    }

    #[derive(Debug, PartialEq, Serialize, serde::Deserialize)]
    struct Part {
        x: f64,
    }

    #[derive(Debug, PartialEq, Serialize, serde::Deserialize)]
    struct Entry {
        one: Option<Part>,
        many: Vec<Part>,
        about: String,
    }

    #[test]
    fn numbers_are_read_back_to_the_last_bit_and_strings_are_left_alone() {
        let names = [
            "plain",
            "0.00000001",
            "a\nx = 0.00000001\n\n[list.one]\n",
            "it's \"0.00000001\"",
            "'''\"\"\"\nx = [[0.00000001]]",
            "\n\n\n[[list]]",
        ];
        for name in names {
            let entry = |n: i32| Entry {
                one: (n > 1).then_some(Part { x: 1e-9 }),
                many: (0..n).map(|k| Part { x: f64::from(k) }).collect(),
                about: name.into(),
            };
            let file = File {
                name: name.into(),
                small: 5.740194614108059e-12,
                count: 3,
                rows: [[0.1 + 0.2, -1e300], [f64::MIN_POSITIVE, 1e-5]],
                empty: Vec::new(),
                part: Part { x: -3e-7 },
                list: vec![entry(0), entry(1), entry(2)],
            };
            let text = to_toml("# header\n", &file);
            assert!(text.starts_with("# header\nname = "));
            let again: File = toml::from_str(&text).unwrap();
            assert_eq!(again, file, "{text}");
        }
    }

    #[test]
    fn a_matrix_is_written_by_rows_and_what_an_entry_holds_on_a_line_each() {
        let file = File {
            name: "unit".into(),
            small: 2.5e-7,
            count: 12,
            rows: [[1.0, -2e-9], [1e22, 4.5]],
            empty: Vec::new(),
            part: Part { x: 0.5 },
            list: vec![Entry {
                one: Some(Part { x: 1e-9 }),
                many: vec![Part { x: 1.0 }, Part { x: 2.0 }],
                about: "a".into(),
            }],
        };
        let expected = r#"name = "unit"
small = 2.5e-7
count = 12
rows = [
  [1.0, -2e-9],
  [1e22, 4.5],
]
empty = []

[part]
x = 0.5

[[list]]
about = "a"
one = { x = 1e-9 }
many = [
  { x = 1.0 },
  { x = 2.0 },
]
"#;
        assert_eq!(to_toml("", &file), expected);
    }
}
