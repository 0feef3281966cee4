//! Result files as TOML that people read: rows of a matrix one below the other, small tables on a line, small numbers with an exponent.

use serde::Serialize;
use toml_edit::{Array, DocumentMut, InlineTable, Item, Table, Value};

/// Text of `file` below a header of comments. Numbers have all their digits, so that they are read back exactly.
///
/// # Panics
/// If the type of `file` is not a table of TOML values. Its numbers do not matter.
pub fn to_toml(header: &str, file: &impl Serialize) -> String {
    let document = toml_edit::ser::to_document(file).expect("a table of numbers and strings");
    let laid_out = table(inline(document));
    format!("{header}{}", DocumentMut::from(laid_out))
}

/// The serializer may return some tables inline; here all are.
fn inline(document: DocumentMut) -> InlineTable {
    document.into_table().into_inline_table()
}

/// A table with a header; the tables in it, and those of an array of tables, have one each.
fn table(from: InlineTable) -> Table {
    let mut out = Table::new();
    for (key, value) in from {
        let item = match value {
            Value::InlineTable(inner) => Item::Table(table(inner)),
            Value::Array(array) if holds_tables(&array) => {
                let entries = array.into_iter().filter_map(|v| match v {
                    Value::InlineTable(inner) => Some(entry(inner)),
                    _ => None,
                });
                Item::ArrayOfTables(entries.collect())
            }
            other => Item::Value(laid_out(other)),
        };
        out.insert(&key, item);
    }
    out
}

/// An entry of an array of tables: each value is on one line, except a table that contains arrays, which has a header.
fn entry(from: InlineTable) -> Table {
    let mut out = Table::new();
    for (key, value) in from {
        let item = match value {
            Value::InlineTable(inner) if inner.iter().any(|(_, v)| v.is_array()) => {
                Item::Table(table(inner))
            }
            other => Item::Value(laid_out(other)),
        };
        out.insert(&key, item);
    }
    out
}

fn holds_tables(array: &Array) -> bool {
    !array.is_empty() && array.iter().all(Value::is_inline_table)
}

/// Puts each row of a matrix or of an array of tables on a line, and writes numbers as short as they are read back exactly.
fn laid_out(value: Value) -> Value {
    match value {
        // Display writes 1e-12 as 0.000000000001; Debug does not.
        Value::Float(x) => format!("{:?}", x.value())
            .parse()
            .unwrap_or(Value::Float(x)),
        Value::Array(array) => {
            let rows = array.iter().any(Value::is_array) || holds_tables(&array);
            let mut out: Array = array.into_iter().map(laid_out).collect();
            if rows {
                for row in out.iter_mut() {
                    row.decor_mut().set_prefix("\n  ");
                }
                out.set_trailing("\n");
                out.set_trailing_comma(true);
            }
            Value::Array(out)
        }
        Value::InlineTable(inner) => {
            let each = inner.into_iter().map(|(key, v)| (key, laid_out(v)));
            Value::InlineTable(each.collect())
        }
        other => other,
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
one = { x = 1e-9 }
many = [
  { x = 1.0 },
  { x = 2.0 },
]
about = "a"
"#;
        assert_eq!(to_toml("", &file), expected);
    }
}
