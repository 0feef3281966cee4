//! Result files as TOML that people read: rows of a matrix one below the other, small numbers with an exponent.

use serde::Serialize;

/// Text of `file` below a header of comments. Numbers have all their digits, so that they are read back exactly.
///
/// # Panics
/// If `file` is no table of values that TOML has: a matter of its type, and not of its numbers.
pub fn to_toml(header: &str, file: &impl Serialize) -> String {
    let text = toml::to_string(file).expect("a table of numbers and strings");
    let mut out = header.to_string();
    let mut in_string = false;
    for line in text.lines() {
        let fences = line.matches("\"\"\"").count() + line.matches("'''").count();
        match line.split_once(" = ") {
            // What has a quote is a string or holds one: digits in it are not numbers.
            Some((key, value)) if !in_string && !line.contains(['"', '\'']) => {
                out.push_str(key);
                out.push_str(" = ");
                out.push_str(&laid_out(value));
            }
            _ => out.push_str(line),
        }
        out.push('\n');
        in_string ^= fences % 2 == 1;
    }
    out
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
    }

    #[test]
    fn numbers_are_read_back_to_the_last_bit_and_strings_are_left_alone() {
        let names = [
            "plain",
            "0.00000001",
            "a\nx = 0.00000001\n",
            "it's \"0.00000001\"",
            "'''\"\"\"\nx = [[0.00000001]]",
        ];
        for name in names {
            let file = File {
                name: name.into(),
                small: 5.740194614108059e-12,
                count: 3,
                rows: [[0.1 + 0.2, -1e300], [f64::MIN_POSITIVE, 1e-5]],
                empty: Vec::new(),
            };
            let text = to_toml("# header\n", &file);
            assert!(text.starts_with("# header\nname = "));
            let again: File = toml::from_str(&text).unwrap();
            assert_eq!(again, file, "{text}");
        }
    }

    #[test]
    fn a_matrix_is_written_by_rows_with_exponents() {
        let file = File {
            name: "unit".into(),
            small: 2.5e-7,
            count: 12,
            rows: [[1.0, -2e-9], [1e22, 4.5]],
            empty: Vec::new(),
        };
        let text = to_toml("", &file);
        let expected = "name = \"unit\"\nsmall = 2.5e-7\ncount = 12\nrows = [\n  [1.0, -2e-9],\n  [1e22, 4.5],\n]\nempty = []\n";
        assert_eq!(text, expected);
    }
}
