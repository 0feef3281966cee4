//! The separator of the cells of a text file.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::cell::shorten;
use crate::error::{Error, Result};

/// The separator of two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Separator {
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// A tab.
    Tab,
    /// Any number of blanks and tabs.
    Whitespace,
    /// Labels among the numbers, as in `ax:1 ay:2`; see [`labelled`](crate::labelled).
    Labels,
    /// Each of several characters, as in messages of receivers: `$A,1;2*5f` has four cells.
    AnyOf(Characters),
}

/// Some characters of ASCII.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Characters(u128);

impl Characters {
    /// Those of `text`; `None` if one is not a printable sign of ASCII, is a letter, a digit or part of a number, or if there is none.
    pub(crate) fn of(text: &str) -> Option<Self> {
        let fits = |b: &u8| (b.is_ascii_punctuation() && !b"+-.\"".contains(b)) || *b == b' ';
        let bits = text.bytes().map(|b| fits(&b).then(|| 1_u128 << b));
        let all = bits.reduce(|a, b| Some(a? | b?))??;
        Some(Self(all))
    }

    pub(crate) fn contains(self, byte: u8) -> bool {
        byte.is_ascii() && self.0 >> byte & 1 == 1
    }
}

impl fmt::Display for Characters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = (0..128_u8).filter(|byte| self.contains(*byte));
        f.write_str(&all.map(char::from).collect::<String>())
    }
}

impl Separator {
    /// Finds the separator that splits most of `lines` into the same number of cells, at least two.
    pub(crate) fn detect(lines: &[&[u8]]) -> Separator {
        // Whitespace comes last, because blanks may follow any other separator. Comma comes after semicolon, because semicolons may separate numbers
        // with decimal commas; it is left out if blanks separate such numbers.
        let candidates = [
            Separator::Tab,
            Separator::Semicolon,
            Separator::Comma,
            Separator::Whitespace,
        ];
        let mut record = csv::ByteRecord::new();
        let mut best = (0, Separator::Comma);
        let decimal = lines.iter().filter(|line| has_decimal_commas(line)).count();
        for candidate in candidates {
            if candidate == Separator::Comma && 2 * decimal > lines.len() {
                continue;
            }
            let mut widths: Vec<usize> = lines
                .iter()
                .map(|line| {
                    candidate.split(line, &mut record);
                    record.len()
                })
                .filter(|&width| width > 1)
                .collect();
            widths.sort_unstable();
            let alike = widths.chunk_by(|a, b| a == b).map(<[usize]>::len).max();
            let alike = alike.unwrap_or(0);
            if 2 * alike > lines.len() {
                return candidate;
            }
            if alike > best.0 {
                best = (alike, candidate);
            }
        }
        best.1
    }

    /// Whether `byte` separates cells.
    pub(crate) fn separates(self, byte: u8) -> bool {
        match self {
            Separator::Comma | Separator::Labels => byte == b',',
            Separator::Semicolon => byte == b';',
            Separator::Tab => byte == b'\t',
            Separator::Whitespace => byte.is_ascii_whitespace(),
            Separator::AnyOf(characters) => characters.contains(byte),
        }
    }

    /// Splits `line` into `cells`; quotes keep a separator inside a cell.
    pub(crate) fn split(self, line: &[u8], cells: &mut csv::ByteRecord) {
        cells.clear();
        let delimiter = match self {
            // The numbers of labelled lines are put together with commas.
            Separator::Comma | Separator::Labels => b',',
            Separator::Semicolon => b';',
            Separator::Tab => b'\t',
            Separator::AnyOf(characters) => {
                for cell in line.split(|&byte| characters.contains(byte)) {
                    cells.push_field(cell.trim_ascii());
                }
                return;
            }
            Separator::Whitespace => {
                let words = line.split(u8::is_ascii_whitespace);
                for word in words.filter(|word| !word.is_empty()) {
                    cells.push_field(word);
                }
                return;
            }
        };
        if memchr::memchr(b'"', line).is_none() {
            for cell in line.split(|&byte| byte == delimiter) {
                cells.push_field(cell.trim_ascii());
            }
            return;
        }
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(delimiter)
            .from_reader(line);
        // Reading from memory cannot fail, and any bytes make a record.
        let _ = reader.read_byte_record(cells);
        cells.trim();
    }
}

/// Whether a line consists of words between blanks, some with a comma, each comma single and between digits.
fn has_decimal_commas(line: &[u8]) -> bool {
    let mut words = line
        .split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty());
    let decimal = |word: &[u8]| {
        let mut parts = word.split(|&byte| byte == b',');
        let ends = [
            parts.next().and_then(<[u8]>::last),
            parts.next().and_then(<[u8]>::first),
        ];
        let digits = ends.iter().flatten().all(|byte| byte.is_ascii_digit());
        digits && ends[0].is_some() && parts.next().is_none() && !word.ends_with(b",")
    };
    line.contains(&b',') && words.clone().count() > 1 && words.all(decimal)
}

impl FromStr for Separator {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "," | "comma" => Ok(Separator::Comma),
            ";" | "semicolon" => Ok(Separator::Semicolon),
            "\t" | "tab" => Ok(Separator::Tab),
            " " | "whitespace" => Ok(Separator::Whitespace),
            "labels" => Ok(Separator::Labels),
            _ => Characters::of(text).map(Separator::AnyOf).ok_or_else(|| {
                Error::new(
                    "separator",
                    format!("{} is unknown", shorten(text.as_bytes())),
                    "write comma, semicolon, tab, whitespace, labels, or all characters that separate cells: ',;*'",
                )
            }),
        }
    }
}

impl Serialize for Separator {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl fmt::Display for Separator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Separator::AnyOf(characters) => return characters.fmt(f),
            Separator::Comma => "comma",
            Separator::Semicolon => "semicolon",
            Separator::Tab => "tab",
            Separator::Whitespace => "whitespace",
            Separator::Labels => "labels",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_separator_is_the_one_that_cuts_most_lines_alike() {
        for (lines, expected) in [
            (
                vec!["Fs,100", "a,b,c", "1,2,3", "4,5,6", "7,8,9"],
                Separator::Comma,
            ),
            (vec!["1.0, 2.0, 3.0", "1.0, 2.0, 3.0"], Separator::Comma),
            (vec!["1,5;2,5;3", "1,5;2,5;3"], Separator::Semicolon),
            (vec!["1,5 2,5 -3", "1,5  2,5e1 3"], Separator::Whitespace),
            (vec!["1, 2,3", "1, 2,5"], Separator::Comma),
            (vec!["1\t2\t3", "1\t\t3"], Separator::Tab),
            (vec!["  1.0e0   2 3", " 4 5 6"], Separator::Whitespace),
        ] {
            let lines: Vec<&[u8]> = lines.iter().map(|line| line.as_bytes()).collect();
            assert_eq!(Separator::detect(&lines), expected);
        }
        Separator::detect(&[]);
    }

    #[test]
    fn each_of_several_characters_separates_cells() {
        let separator: Separator = ",;*".parse().unwrap();
        let mut cells = csv::ByteRecord::new();
        separator.split(b"%RAW,7;8,-643*0000abcd", &mut cells);
        assert_eq!(cells, vec!["%RAW", "7", "8", "-643", "0000abcd"]);
        assert_eq!(
            separator.to_string().parse::<Separator>().unwrap(),
            separator
        );
        for text in ["", "ab", ",.", "\u{b5},"] {
            assert!(text.parse::<Separator>().is_err(), "{text}");
        }
    }

    #[test]
    fn quotes_keep_a_separator_inside_a_cell() {
        let mut cells = csv::ByteRecord::new();
        Separator::Comma.split(b" 1 ,\"a, b\",3", &mut cells);
        assert_eq!(cells, vec!["1", "a, b", "3"]);
    }
}
