//! Lines of text with labels among their numbers, as sketches, loggers and plotters write them: `ax:1,ay:2`, `Accel: 1, 2, 3 Gyro: 4, 5, 6`,
//! `a/g: 1 2 3 4 5 6`, `{"acc":[1,2,3]}`, `I (1234) imu: ax=1`, `>ax:1.5`.
//!
//! A sample may be spread over several lines: it ends where one of its labels comes again.

use serde_json::Value;

use super::time::calendar_time;

/// Units as they stand alone in a cell, or behind a number.
pub(crate) const UNITS: [&str; 34] = [
    "s", "ms", "us", "µs", "ns", "g", "mg", "m/(s^2)", "m/s^2", "m/s2", "m/s²", "mps2", "deg/s",
    "dps", "°/s", "mdps", "rad/s", "deg", "°C", "C", "degC", "uT", "µT", "Gauss", "gauss", "V",
    "counts", "count", "LSB", "raw", "Pa", "hPa", "kPa", "mV",
];

/// Name of the time that ESP-IDF and Teleplot write in ms.
const TIME_MS: &str = "time [ms]";

/// A number of a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    /// As it is written.
    pub text: String,
    /// The labels since the number before.
    labels: Vec<String>,
    unit: Option<String>,
}

/// The numbers of a line, and the time that a terminal or an operating system has written before them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Line {
    time: Option<(&'static str, String)>,
    /// In their order.
    pub numbers: Vec<Number>,
}

impl Line {
    /// Reads a line; `None` if something else than a unit follows its last number, or there is none.
    pub fn parse(text: &str) -> Option<Self> {
        let text = without_colours(text);
        let (time, tag, rest) = prefix(text.trim());
        let mut line = Self {
            time,
            numbers: Vec::new(),
        };
        if let Some(plot) = rest.strip_prefix('>').filter(|plot| plot.contains(':')) {
            return line.plotted(plot);
        }
        if rest.starts_with('{') {
            let json: Value = serde_json::from_str(rest).ok()?;
            line.take_json(&json, &[]);
            return (!line.numbers.is_empty()).then_some(line);
        }
        let mut labels: Vec<String> = Vec::new();
        let cells = rest.split(|c: char| c.is_whitespace() || ",;|{}[]\"()>".contains(c));
        for cell in cells {
            // A time of day has colons too.
            let clock = is_calendar_time(cell);
            let words: Vec<&str> = match clock {
                true => vec![cell],
                false => cell.split([':', '=']).collect(),
            };
            for word in words
                .into_iter()
                .filter(|word| word.contains(char::is_alphanumeric))
            {
                if let Some((number, unit)) = number(word).or(clock.then_some((word, None))) {
                    let (text, unit) = (number.to_owned(), unit.map(str::to_owned));
                    line.numbers.push(Number {
                        text,
                        labels: std::mem::take(&mut labels),
                        unit,
                    });
                    continue;
                }
                match line.numbers.last_mut() {
                    Some(last)
                        if labels.is_empty() && last.unit.is_none() && UNITS.contains(&word) =>
                    {
                        last.unit = Some(word.to_owned());
                    }
                    _ => labels.push(word.to_owned()),
                }
            }
        }
        let first = line.numbers.first_mut()?;
        if let Some(tag) = tag.filter(|_| first.labels.is_empty()) {
            first.labels.push(tag.to_owned());
        }
        labels.is_empty().then_some(line)
    }

    /// Takes the numbers of a value in JSON, with the `path` to each as its labels. Three numbers of a list are axes; others have their position as a label.
    fn take_json(&mut self, json: &Value, path: &[String]) {
        let within = |label: String| [path, &[label]].concat();
        let text = match json {
            Value::Object(members) => {
                return members
                    .iter()
                    .for_each(|(key, value)| self.take_json(value, &within(key.clone())));
            }
            Value::Array(items) => {
                for (k, item) in items.iter().enumerate() {
                    let label = match items.len() {
                        3 => ["x", "y", "z"][k].to_owned(),
                        _ => format!("no. {k}"),
                    };
                    self.take_json(item, &within(label));
                }
                return;
            }
            Value::Number(number) => number.to_string(),
            Value::String(text) => text.clone(),
            Value::Null | Value::Bool(_) => return,
        };
        if is_calendar_time(&text) || number(&text).is_some_and(|(_, unit)| unit.is_none()) {
            self.numbers.push(Number {
                text,
                labels: path.to_vec(),
                unit: None,
            });
        }
    }

    /// A line for Teleplot: `ax:1.5`, `ax:1627551892437:1.5§m/s²|np`.
    fn plotted(mut self, plot: &str) -> Option<Self> {
        let plot = plot.split('|').next()?;
        let (plot, unit) = plot
            .split_once('§')
            .map_or((plot, None), |(plot, unit)| (plot, Some(unit)));
        let mut parts = plot.split(':');
        let (label, value) = (parts.next()?, parts.next_back()?);
        if let Some(stamp) = parts.next() {
            self.time = Some((TIME_MS, stamp.to_owned()));
        }
        let (text, _) = number(value.trim())?;
        let (text, labels) = (text.to_owned(), vec![label.trim().to_owned()]);
        self.numbers.push(Number {
            text,
            labels,
            unit: unit.map(str::to_owned),
        });
        parts.next().is_none().then_some(self)
    }

    /// All labels, which a sound line of the same kind has too.
    pub fn labels(&self) -> String {
        let labels: Vec<String> = self.numbers.iter().map(|n| n.labels.join(" ")).collect();
        let filled = labels.iter().filter(|label| !label.is_empty());
        filled.map(String::as_str).collect::<Vec<&str>>().join(",")
    }

    /// The numbers as such, with the time before them if `timed`.
    pub fn values(&self, timed: bool) -> Option<Vec<f64>> {
        let time = self.time.iter().filter(|_| timed).map(|(_, text)| text);
        let texts = time.chain(self.numbers.iter().map(|number| &number.text));
        texts
            .map(|text| text.parse().ok().filter(|v: &f64| v.is_finite()))
            .collect()
    }

    /// The names of the numbers, if each has one.
    pub fn names(&self) -> Option<Vec<String>> {
        let named = self.named().into_iter().skip(self.time.iter().count());
        named
            .map(|(_, name, _)| (!name.is_empty()).then_some(name))
            .collect()
    }

    /// Key, name and text of each number, the time first. A label before several axes, as in `ACC: X=1,Y=2,Z=3`, or before three numbers belongs to each
    /// of them, `a/g` to three each; a unit behind the last belongs to all. The name is empty where labels do not distinguish the numbers.
    fn named(&self) -> Vec<(String, String, &str)> {
        let is_axis = |label: &String| ["x", "y", "z"].contains(&label.to_lowercase().as_str());
        let (mut group, mut groups) = (String::new(), 0);
        let mut all: Vec<(usize, String, String, &Number)> = Vec::new();
        // A number with labels, and those without any behind it.
        for run in self.numbers.chunk_by(|_, next| next.labels.is_empty()) {
            let labels = &run[0].labels;
            let whole = labels.join(" ");
            let axis_alone = labels.len() == 1 && is_axis(&labels[0]) && run.len() == 1;
            if !axis_alone {
                groups += 1;
                group = labels[..labels.len().saturating_sub(1)].join(" ");
            }
            let parts: Vec<&str> = whole.split('/').collect();
            for (k, number) in run.iter().enumerate() {
                let name = match run.len() {
                    1 if axis_alone => format!("{group} {whole}"),
                    1 => whole.clone(),
                    _ if labels.is_empty() => String::new(),
                    n if n == 3 * parts.len() => {
                        format!("{} {}", parts[k / 3], ["x", "y", "z"][k % 3])
                    }
                    _ => String::new(),
                };
                all.push((
                    groups,
                    format!("{group} {whole} {k}"),
                    name.trim().to_owned(),
                    number,
                ));
            }
        }
        let unit = |k: usize| {
            let rest = all[k..].iter().take_while(|other| other.0 == all[k].0);
            rest.filter_map(|other| other.3.unit.as_deref()).next()
        };
        let numbers = all.iter().enumerate().map(|(k, (_, key, name, number))| {
            let unit = unit(k)
                .map(|unit| format!(" [{unit}]"))
                .filter(|_| !name.is_empty());
            (
                key.clone(),
                format!("{name}{}", unit.unwrap_or_default()),
                number.text.as_str(),
            )
        });
        let time = self
            .time
            .iter()
            .map(|(name, text)| ("time".into(), (*name).into(), text.as_str()));
        time.chain(numbers).collect()
    }
}

fn is_calendar_time(text: &str) -> bool {
    calendar_time(text.as_bytes()).is_some()
}

/// The line without the colours of a terminal.
fn without_colours(text: &str) -> String {
    let mut parts = text.split("\u{1b}[");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| {
        all + part.split_once('m').map_or(part, |(_, rest)| rest)
    })
}

/// The time and the tag before the numbers, and the rest: `15:04:23.125 -> `, `[15:04:23.125] `, and ESP-IDF's `I (1234) imu: `.
fn prefix(text: &str) -> (Option<(&'static str, String)>, Option<&str>, &str) {
    let bracketed = || text.strip_prefix('[')?.split_once(']');
    if let Some((clock, rest)) = text.split_once(" -> ").or_else(bracketed)
        && is_calendar_time(clock)
    {
        return (
            Some(("time", clock.trim().to_owned())),
            None,
            rest.trim_start(),
        );
    }
    let of_esp = || {
        let (level, rest) = text.split_once(" (")?;
        let (clock, rest) = rest.split_once(") ")?;
        let (tag, rest) = rest.split_once(": ")?;
        let name = match is_calendar_time(clock) {
            true => "time",
            false => clock.parse::<u64>().ok().map(|_| TIME_MS)?,
        };
        ["E", "W", "I", "D", "V"].contains(&level).then(|| {
            let time = Some((name, clock.to_owned()));
            (time, Some(tag), rest)
        })
    };
    of_esp().unwrap_or((None, None, text))
}

/// The number at the beginning of a word, and the unit that is the rest of it.
fn number(word: &str) -> Option<(&str, Option<&str>)> {
    if !word.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) {
        return None;
    }
    let finite = |text: &str| text.parse::<f64>().is_ok_and(f64::is_finite);
    if finite(word) {
        return Some((word, None));
    }
    let mut units = UNITS
        .iter()
        .filter_map(|unit| word.strip_suffix(unit).map(|rest| (rest, *unit)));
    units
        .find(|(rest, _)| finite(rest))
        .map(|(rest, unit)| (rest, Some(unit)))
}

/// What a line is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Taken {
    /// Words, such as a greeting.
    Words,
    /// A line of numbers that is damaged.
    Damaged,
    /// It belongs to a sample, of which more may follow; the sample before it, if this line begins another.
    Part(Option<Sample>),
}

/// The number of the first line of a sample, and its cells.
pub(crate) type Sample = (u64, Vec<String>);

/// Puts the samples of labelled lines together.
#[derive(Debug, Clone)]
pub(crate) struct Samples {
    keys: Vec<String>,
    /// Name of each cell; empty where the labels do not say it.
    pub names: Vec<String>,
    /// First word of the first label.
    begins: String,
    open: Vec<String>,
    opened: u64,
}

impl Samples {
    /// Finds the labels that come again and again in the first lines of a file.
    pub fn find(lines: &[&[u8]]) -> Option<Self> {
        let texts = lines.iter().map(|line| String::from_utf8_lossy(line));
        let parsed: Vec<Line> = texts.filter_map(|text| Line::parse(&text)).collect();
        let mut found: Vec<(String, String, usize)> = Vec::new();
        for (key, name, _) in parsed.iter().flat_map(Line::named) {
            match found.iter_mut().find(|(known, ..)| *known == key) {
                Some((.., count)) => *count += 1,
                None => found.push((key, name, 1)),
            }
        }
        // A title, or a cut line, has other labels.
        let most = found.iter().map(|(.., count)| *count).max()?;
        found.retain(|(.., count)| 2 * count >= most);
        let known = |line: &&Line| {
            line.named()
                .iter()
                .all(|(key, ..)| found.iter().any(|f| f.0 == *key))
        };
        let alike = parsed.iter().filter(known).count();
        let labelled = parsed
            .iter()
            .filter(|line| !line.labels().is_empty())
            .count();
        if most < 2
            || found.len() < 2
            || 10 * alike < 9 * parsed.len()
            || 2 * labelled < parsed.len()
        {
            return None;
        }
        let begins = parsed.iter().find(known)?.numbers[0]
            .labels
            .first()
            .cloned();
        Some(Self {
            begins: begins.unwrap_or_default(),
            open: Vec::new(),
            opened: 0,
            keys: found.iter().map(|(key, ..)| key.clone()).collect(),
            names: found.into_iter().map(|(_, name, _)| name).collect(),
        })
    }

    /// Whether the labels name the cells, so that no readings have to.
    pub fn are_named(&self) -> bool {
        self.names.iter().filter(|name| !name.is_empty()).count() > 1
    }

    /// Takes the next line of the file and its number.
    pub fn take(&mut self, number: u64, line: &[u8]) -> Taken {
        let text = String::from_utf8_lossy(line);
        let parsed = Line::parse(&text);
        let named = parsed.as_ref().map(Line::named).unwrap_or_default();
        let at = |key: &str| self.keys.iter().position(|known| known == key);
        let cells: Vec<(usize, &str)> = named
            .iter()
            .filter_map(|(key, _, text)| Some((at(key)?, *text)))
            .collect();
        if cells.len() < named.len() || cells.iter().all(|(at, _)| self.keys[*at] == "time") {
            let alone = |(at, found): (usize, &str)| {
                let [before, behind] = [&text[..at], &text[at + found.len()..]];
                !before.ends_with(char::is_alphanumeric)
                    && !behind.starts_with(char::is_alphanumeric)
            };
            let ours = !self.begins.is_empty() && text.match_indices(&self.begins).any(alone);
            return match ours && text.contains(|c: char| c.is_ascii_digit()) {
                true => Taken::Damaged,
                false => Taken::Words,
            };
        }
        let again = |(at, _): &(usize, &str)| {
            self.keys[*at] != "time" && self.open.get(*at).is_some_and(|cell| !cell.is_empty())
        };
        let before = cells
            .iter()
            .any(again)
            .then(|| (self.opened, std::mem::take(&mut self.open)));
        if self.open.is_empty() {
            self.opened = number;
        }
        self.open.resize(self.keys.len(), String::new());
        for (at, text) in cells {
            if self.open[at].is_empty() {
                self.open[at] = text.to_owned();
            }
        }
        Taken::Part(before)
    }

    /// The last sample, at the end of the file.
    pub fn finish(&mut self) -> Option<Sample> {
        (!self.open.is_empty()).then(|| (self.opened, std::mem::take(&mut self.open)))
    }

    /// All samples of `lines`, whose numbers begin at 0.
    pub fn all(mut self, lines: &[&[u8]]) -> Vec<Sample> {
        let mut all = Vec::new();
        for (number, line) in (0..).zip(lines) {
            if let Taken::Part(before) = self.take(number, line) {
                all.extend(before);
            }
        }
        all.extend(self.finish());
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(line: &str) -> String {
        let lines = [line.as_bytes(); 3];
        let found = Samples::find(&lines).expect(line);
        let samples = found.clone().all(&lines);
        assert_eq!(samples.len(), 3, "{line}");
        found.names.join("|")
    }

    #[test]
    fn labels_among_the_numbers_are_their_names() {
        for (line, expected) in [
            ("t:1,ax:2,ay:-3", "t|ax|ay"),
            ("AcX = 1 | AcY = 2", "AcX|AcY"),
            (
                "GYRO: X=1.5,Y=-2,Z=3,ACC: X=4,Y=5,Z=6",
                "GYRO X|GYRO Y|GYRO Z|ACC X|ACC Y|ACC Z",
            ),
            (
                "Gyro: 1, 2, 3 Accel: 4, 5, 6",
                "Gyro x|Gyro y|Gyro z|Accel x|Accel y|Accel z",
            ),
            ("ax: 1.0 m/s^2, ay: 2.0 m/s^2", "ax [m/s^2]|ay [m/s^2]"),
            ("ax: 1.0g ay: 2.0g", "ax [g]|ay [g]"),
            (
                "Accel X: 1 Y: 2 Z: 3 m/s^2",
                "Accel X [m/s^2]|Accel Y [m/s^2]|Accel Z [m/s^2]",
            ),
            ("t=12 gyro x=1 y=2 z=3", "t|gyro x|gyro y|gyro z"),
            ("a/g:\t1\t2\t3\t4\t5\t6", "a x|a y|a z|g x|g y|g z"),
            (
                "\u{1b}[0;32mI (1234) imu: ax=1, ay=2\u{1b}[0m",
                "time [ms]|ax|ay",
            ),
            ("15:04:23.125 -> ax:1 ay:2", "time|ax|ay"),
            ("[15:04:23.125] ax:1 ay:2", "time|ax|ay"),
            (
                r#"{"type":"imu","t":12,"acc":{"x":1,"y":2},"gyro":[3,4,5]}"#,
                "acc x|acc y|gyro x|gyro y|gyro z|t",
            ),
            ("v: 1 2 3 4", "|||"),
        ] {
            assert_eq!(names(line), expected, "{line}");
        }
        for line in ["a:1,b", "1:a,2:b", "hello", "1,2,3"] {
            assert!(Samples::find(&[line.as_bytes(); 3]).is_none(), "{line}");
        }
    }

    #[test]
    fn a_sample_ends_where_a_label_comes_again() {
        let text = "Adafruit MPU6050 test!\nFilter bandwidth set to: 21 Hz\nRotation X: 9, Y: 9, Z: 9 rad/s\n\n\
            Acceleration X: 1, Y: 2, Z: 3 m/s^2\nRotation X: 4, Y: 5, Z: 6 rad/s\nTemperature: 30.5 degC\n\n\
            Acceleration X: 7, Y: 8, Z: 9 m/s^2\nRotation X: 1, Y: 2, Z: 3 rad/s\nTemperature: 31 degC\n";
        let lines: Vec<&[u8]> = text.lines().map(str::as_bytes).collect();
        let found = Samples::find(&lines).unwrap();
        let all: Vec<String> = found
            .all(&lines)
            .into_iter()
            .map(|(_, s)| s.join(" "))
            .collect();
        assert_eq!(all, ["9 9 9 1 2 3 ", "4 5 6 7 8 9 30.5", "1 2 3    31"]);
        let plot = ">t:1\n>ax:2§m/s²\n>ay:1627551892437:3|np\n".repeat(3);
        let lines: Vec<&[u8]> = plot.lines().map(str::as_bytes).collect();
        let found = Samples::find(&lines).unwrap();
        assert_eq!(found.names, ["t", "ax [m/s²]", "time [ms]", "ay"]);
        assert_eq!(
            found.all(&lines)[2],
            (
                6,
                vec!["1".into(), "2".into(), "1627551892437".into(), "3".into()]
            )
        );
    }
}
