//! Mutations of a text: bytes, lines, words and numbers are changed by a seeded random generator.

pub use crate::random::Random;

/// Replacements for numbers, names and cells.
#[rustfmt::skip]
const ODD: &[&str] = &[
    "1e308", "-1e308", "1e30", "-1e29", "1e15", "-0", "-0.0", "1e-320", "4.9e-324", "1e-200", "inf", "-inf", "nan", "NaN", "", " ", "0", "1",
    "-1", "2147483647", "2147483648", "-2147483648", "9223372036854775807", "18446744073709551616",
    "99999999999999999999999999999999999999999", "1e999", "1e-999", "0x10", "1_000", "1,5", "1;5", "1.5.5", "--1", "+1", ".", "e", "1e", "é",
    "😀", "\u{2028}", "\u{feff}", "\0", "\u{7f}", "\t", "\r", "\"", "\"\"", "\"\n\"", "#", "%", "true", "[]", "[1, 2]", "{}", "\"SI\"",
    "\"V\"", "\"gravity\"", "\"table\"", "1979-05-27", "t_s", "step", "gyro_x", "accel_z",
];

/// Changes `text` somewhere, once or a few times.
pub fn mutate(text: &[u8], random: &mut Random) -> Vec<u8> {
    let mut text = text.to_vec();
    for _ in 0..1 + random.below(3) {
        if text.is_empty() {
            return text;
        }
        match random.below(4) {
            0 => mutate_bytes(&mut text, random),
            1 => mutate_lines(&mut text, random),
            _ => mutate_words(&mut text, random),
        }
    }
    text
}

pub fn mutate_bytes(text: &mut Vec<u8>, random: &mut Random) {
    let at = random.below(text.len());
    let length = (1 + random.below(64)).min(text.len() - at);
    match random.below(8) {
        0 => text[at] ^= 1 << random.below(8),
        1 => text[at] = random.bits() as u8,
        2 => text.truncate(at),
        3 => drop(text.drain(..at)),
        4 => drop(text.drain(at..at + length)),
        5 => {
            let piece = text[at..at + length].to_vec();
            let to = random.below(text.len() + 1);
            text.splice(to..to, piece);
        }
        6 => text.insert(at, random.bits() as u8),
        _ => text[at..at + length].fill(random.bits() as u8),
    }
}

fn mutate_lines(text: &mut Vec<u8>, random: &mut Random) {
    let mut lines: Vec<Vec<u8>> = text
        .split_inclusive(|b| *b == b'\n')
        .map(<[u8]>::to_vec)
        .collect();
    let at = random.below(lines.len());
    let many = (1 + random.below(lines.len())).min(lines.len() - at);
    match random.below(8) {
        0 => drop(lines.drain(at..at + 1)),
        1 => drop(lines.drain(at..at + many)),
        2 => lines.insert(at, lines[at].clone()),
        3 => {
            let piece = lines[at..at + many].to_vec();
            lines.splice(at..at, piece);
        }
        4 => {
            let other = random.below(lines.len());
            lines.swap(at, other);
        }
        5 => lines[at..at + many].reverse(),
        6 => lines.insert(at, vec![b'7'; 1 << random.below(14)]),
        _ => lines[at] = [&lines[at][..], b"\r\n\r\n"].concat(),
    }
    *text = lines.concat();
}

/// Words are separated by separators: cells, keys and values.
fn words(text: &[u8]) -> Vec<(usize, usize)> {
    let mut all = Vec::new();
    let mut from = 0;
    for (i, byte) in text.iter().enumerate() {
        if matches!(byte, b',' | b'\n' | b' ' | b'=' | b'[' | b']') {
            all.push((from, i));
            from = i + 1;
        }
    }
    all.push((from, text.len()));
    all
}

fn mutate_words(text: &mut Vec<u8>, random: &mut Random) {
    let odd = random.of(ODD).as_bytes().to_vec();
    let all = words(text);
    let (from, to) = all[random.below(all.len())];
    match random.below(6) {
        0..=2 => drop(text.splice(from..to, odd)),
        3 => {
            // The same odd word in a column, for some rows or for all.
            let column = random.below(15);
            let (first, last) = (random.below(700), 1 + random.below(700));
            *text = edit_column(text, column, first..first + last, |_| odd.clone());
        }
        4 => {
            // A column multiplied by a factor, or set to one value.
            let column = random.below(15);
            let factor = *random.of(&[
                &0.0, &-1.0, &1e-3, &1e3, &1e-12, &1e12, &1e25, &1e-30, &1e-300,
            ]);
            *text = edit_column(text, column, 1..usize::MAX, |cell| {
                let number: Option<f64> =
                    std::str::from_utf8(cell).ok().and_then(|c| c.parse().ok());
                number.map_or(cell.to_vec(), |n| (n * factor).to_string().into_bytes())
            });
        }
        _ => {
            let (a, b) = all[random.below(all.len())];
            let other = text[a..b].to_vec();
            text.splice(from..to, other);
        }
    }
}

/// Values that a sensor, or a program in between, may well write.
const NUMBERS: &[f64] = &[
    0.0,
    -0.0,
    1.0,
    -1.0,
    32767.0,
    -32768.0,
    1e9,
    1e15,
    -1e29,
    1e30,
    1e-12,
    -1e-30,
    1e-200,
    1e-320,
    f64::NAN,
];

/// Changes the numbers of a table but keeps it a table, so that it passes the reader.
pub fn mutate_numbers(text: &str, random: &mut Random) -> Vec<u8> {
    let (header, body) = text.split_once('\n').unwrap();
    let parse = |line: &str| {
        line.split(',')
            .map(|c| c.parse().unwrap_or(f64::NAN))
            .collect()
    };
    let mut rows: Vec<Vec<f64>> = body.lines().map(parse).collect();
    let mut header: Vec<&str> = header.split(',').collect();
    for _ in 0..1 + random.below(4) {
        let (from, length) = (random.below(rows.len()), 1 + random.below(rows.len()));
        let to = match random.below(3) {
            0 => from + 1,
            1 => (from + 1 + length % 40).min(rows.len()),
            _ => (from + length).min(rows.len()),
        };
        // Time and step are only two columns of fifteen, so they are chosen more often.
        let column = if random.one_in(8) {
            random.below(2)
        } else {
            random.below(header.len())
        };
        let odd = NUMBERS[random.below(NUMBERS.len())];
        let value = rows[from][column];
        let factor = [-1.0, 1e-3, 1e3, 1e-9, 1e9, 1e-40, 1e-160, 1e20][random.below(8)];
        let other = random.below(header.len());
        let whole = random.one_in(2);
        let (from, to) = if whole { (0, rows.len()) } else { (from, to) };
        match random.below(13) {
            0 => rows[from..to].iter_mut().for_each(|r| r[column] = odd),
            1 => rows[from..to].iter_mut().for_each(|r| r[column] = value),
            2 => rows[from..to].iter_mut().for_each(|r| r[column] *= factor),
            3 => rows[from..to].iter_mut().for_each(|r| r[column] += factor),
            4 if !whole => drop(rows.drain(from..to)),
            5 => rows[from..to]
                .iter_mut()
                .for_each(|r| r[column] = r[column].min(value)),
            6 => rows[from..to].iter_mut().for_each(|r| r[column] = r[other]),
            7 => rows[from..to]
                .iter_mut()
                .for_each(|r| r.swap(column, other)),
            8 => rows[from..to]
                .iter_mut()
                .for_each(|r| r[column] = (r[column] / 1000.0).round()),
            9 => rows
                .iter_mut()
                .skip(from % 7)
                .step_by(7)
                .for_each(|r| r[column] = odd),
            10 => rows[from..to]
                .iter_mut()
                .for_each(|r| r[column] += factor * (random.uniform() - 0.5)),
            11 => rows.truncate(to.max(2)),
            _ if header.len() > 5 => {
                header.remove(column);
                for row in &mut rows {
                    row.remove(column);
                }
            }
            _ => {}
        }
        if rows.is_empty() {
            break;
        }
    }
    let mut out = header.join(",");
    for row in &rows {
        let cell = |x: &f64| {
            if x.is_nan() {
                String::new()
            } else {
                format!("{x:?}")
            }
        };
        out.push('\n');
        out.push_str(&row.iter().map(cell).collect::<Vec<_>>().join(","));
    }
    out.into_bytes()
}

fn edit_column(
    text: &[u8],
    column: usize,
    rows: std::ops::Range<usize>,
    change: impl Fn(&[u8]) -> Vec<u8>,
) -> Vec<u8> {
    let lines = text.split(|b| *b == b'\n').enumerate().map(|(i, line)| {
        let mut cells: Vec<Vec<u8>> = line.split(|b| *b == b',').map(<[u8]>::to_vec).collect();
        if rows.contains(&i) && column < cells.len() {
            cells[column] = change(&cells[column]);
        }
        cells.join(&b',')
    });
    lines.collect::<Vec<_>>().join(&b'\n')
}
