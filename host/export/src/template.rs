//! Fixed text with places for values, for the formats that are programs.
//!
//! `@NAME@` is replaced by the value of NAME. The lines from `%if NAME` to `%end` are written if the value is true, a list with elements or a text; those of
//! `%unless NAME` if it is not; those of `%each NAME` once for each element of the list. A name is looked up in the innermost element first.

use serde_json::Value;

/// The text with these values.
pub(crate) fn fill(template: &str, values: &Value) -> String {
    let lines: Vec<&str> = template.lines().collect();
    let mut out = String::new();
    write(&lines, &[values], &mut out);
    out
}

fn write(mut lines: &[&str], scope: &[&Value], out: &mut String) {
    while let [line, rest @ ..] = lines {
        let Some((kind, name)) = line.strip_prefix('%').and_then(|d| d.split_once(' ')) else {
            for (k, part) in line.split('@').enumerate() {
                match (k % 2, value(scope, part)) {
                    (0, _) => out.push_str(part),
                    (_, Value::String(text)) => out.push_str(text),
                    (_, other) => out.push_str(&other.to_string()),
                }
            }
            out.push('\n');
            lines = rest;
            continue;
        };
        let (block, after) = rest.split_at(end(rest));
        lines = after.get(1..).unwrap_or_default();
        let value = value(scope, name);
        let holds = match value {
            Value::Array(all) => !all.is_empty(),
            Value::String(text) => !text.is_empty(),
            other => *other == Value::Bool(true),
        };
        match (kind, value) {
            ("each", Value::Array(all)) => {
                for one in all {
                    write(block, &[scope, &[one]].concat(), out);
                }
            }
            ("if", _) if holds => write(block, scope, out),
            ("unless", _) if !holds => write(block, scope, out),
            _ => {}
        }
    }
}

/// Index of the `%end` of the block that begins with these lines.
fn end(lines: &[&str]) -> usize {
    let mut depth = 1;
    let is_end = |line: &&str| {
        depth += match line.strip_prefix('%') {
            Some("end") => -1,
            Some(_) => 1,
            None => 0,
        };
        depth == 0
    };
    lines.iter().position(is_end).unwrap_or(lines.len())
}

fn value<'a>(scope: &[&'a Value], name: &str) -> &'a Value {
    let found = scope.iter().rev().find_map(|values| values.get(name));
    found.unwrap_or(&Value::Null)
}

#[cfg(test)]
mod tests {
    use super::fill;
    use serde_json::json;

    #[test]
    fn blocks_follow_their_values_and_names_are_those_of_the_innermost_element() {
        let template =
            "a@n@\n%each all\n%if on\n@n@ of @m@\n%end\n%unless on\noff\n%end\n%end\nz\n";
        let values = json!({"n": 1, "m": "x", "all": [{"n": 2, "on": true}, {"n": 3, "on": []}]});
        assert_eq!(fill(template, &values), "a1\n2 of x\noff\nz\n");
    }
}
