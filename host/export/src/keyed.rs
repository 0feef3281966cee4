//! The numbers of a text file by their keys, whatever its syntax.
//!
//! JSON and XML are read by their libraries. All other files are lines: YAML as configurations of programs have it (mappings, lists of numbers in either style,
//! OpenCV's header and tags), assignments in C, Rust and MATLAB, lines for the CLI of a flight controller, and tables of parameters. A line gives a key and its
//! numbers, whose separators carry no meaning; YAML's indentation gives the path of the key. What is not a number ends a list, so an alias or an expression
//! gives too few numbers, which the reader of a format refuses by its key.

use serde_json::Value;

/// The keys of a file in their order.
#[derive(Debug, Clone, Default)]
pub struct Keyed {
    /// Path, its levels separated by `/`, and the numbers behind it.
    entries: Vec<(String, Vec<f64>)>,
    /// The text.
    pub text: String,
}

impl Keyed {
    /// The keys of this text.
    pub fn of(text: &str) -> Self {
        let mut keyed = Self::without_keys(text.into());
        let start = text.trim_start();
        if start.starts_with('{')
            && let Ok(value) = serde_json::from_str(text)
        {
            keyed.json("", &value);
        } else if start.starts_with('<')
            && let Ok(document) = roxmltree::Document::parse(text)
        {
            keyed.xml("", document.root_element());
        } else {
            keyed.lines();
        }
        keyed
    }

    /// A file with this text, and no keys yet.
    pub fn without_keys(text: String) -> Self {
        let entries = Vec::new();
        Self { entries, text }
    }

    /// Adds numbers of a file that is not text.
    pub fn add(&mut self, key: &str, values: impl IntoIterator<Item = f64>) {
        self.entries
            .push((key.into(), values.into_iter().collect()));
    }

    /// The numbers of the first path that ends in `key`. A key that begins with `*` is the end of a name.
    pub fn numbers(&self, key: &str) -> Option<&[f64]> {
        let is_it = |path: &str| match (key.strip_prefix('*'), path.strip_suffix(key)) {
            (Some(end), _) => path.ends_with(end),
            (None, Some(before)) => before.is_empty() || before.ends_with('/'),
            (None, None) => false,
        };
        let mut all = self.entries.iter();
        let found = all.find(|(path, values)| is_it(path) && !values.is_empty());
        found.map(|(_, values)| values.as_slice())
    }

    /// Whether a key that begins like `start` has a number other than 0.
    pub fn has_other_than_zero(&self, start: &str) -> bool {
        let is_it = |path: &str| match path.find(start) {
            Some(at) => at == 0 || path[..at].ends_with('/'),
            None => false,
        };
        let mut all = self.entries.iter();
        all.any(|(path, values)| is_it(path) && values.iter().any(|v| *v != 0.0))
    }

    /// The numbers of a file without keys.
    pub fn only_numbers(&self) -> Option<&[f64]> {
        match self.entries.as_slice() {
            [(key, values)] if key.is_empty() => Some(values),
            _ => None,
        }
    }

    fn json(&mut self, path: &str, value: &Value) {
        let below = |key: &str| [path, "/", key].concat();
        match value {
            Value::Object(all) => all.iter().for_each(|(k, v)| self.json(&below(k), v)),
            Value::Number(_) => self.add(path, value.as_f64()),
            Value::Array(all) => match all.iter().map(flat).collect::<Option<Vec<_>>>() {
                Some(rows) => self.add(path, rows.concat()),
                None => {
                    let each = all.iter().enumerate();
                    each.for_each(|(k, v)| self.json(&below(&k.to_string()), v));
                }
            },
            _ => {}
        }
    }

    fn xml(&mut self, path: &str, node: roxmltree::Node) {
        let path = [path, "/", node.tag_name().name()].concat();
        self.add(&path, numbers(node.text().unwrap_or_default()));
        for child in node.children().filter(roxmltree::Node::is_element) {
            self.xml(&path, child);
        }
    }

    fn lines(&mut self) {
        // Indentation and path of the mappings that a line is in.
        let mut within: Vec<(usize, String)> = Vec::new();
        let mut open = 0;
        for line in std::mem::take(&mut self.text).lines() {
            self.text += &[line, "\n"].concat();
            let line = without_comment(line);
            let content = line.trim_start();
            let indent = line.len() - content.len();
            let item = content.strip_prefix("- ").unwrap_or(content).trim();
            let pair = item
                .split_once(": ")
                .or(item.strip_suffix(':').map(|k| (k, "")));
            let brackets = |text: &str| {
                let count = |all: &[char]| text.chars().filter(|c| all.contains(c)).count();
                count(&['[', '{', '(']) as i64 - count(&[']', '}', ')']) as i64
            };
            if item.is_empty() || item.starts_with('%') {
                continue;
            } else if open > 0 || item.starts_with(['-', '.', '[', '{', '+']) || first_digit(item) {
                self.continued(item);
                open += brackets(item);
                continue;
            } else if let Some((name, value)) = pair.filter(|(name, _)| is_key(name)) {
                let depth = indent + usize::from(item.len() != content.trim_end().len());
                while within.last().is_some_and(|(outer, _)| *outer >= depth) {
                    within.pop();
                }
                let outer = within.last().map_or("", |(_, path)| path.as_str());
                let path = [outer, "/", name.trim_matches(['"', '\''])].concat();
                self.add(&path, numbers(value));
                open = brackets(value);
                within.push((depth, path));
            } else if let Some((name, value)) = assignment(item) {
                within.clear();
                self.add(&name, numbers(&value));
                open = brackets(&value);
            }
        }
    }

    /// Numbers of a list that began before.
    fn continued(&mut self, text: &str) {
        // Parameters of QGroundControl: vehicle, component, name, value, type.
        if let [_, _, name, value, _] = text.split('\t').collect::<Vec<_>>()[..] {
            return self.add(name, numbers(value));
        }
        if self.entries.is_empty() {
            self.add("", []);
        }
        if let Some((_, values)) = self.entries.last_mut() {
            values.extend(numbers(text));
        }
    }
}

fn first_digit(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit())
}

/// An array of numbers, whatever its rows.
fn flat(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Number(_) => Some(value.as_f64().into_iter().collect()),
        Value::Array(all) => Some(all.iter().map(flat).collect::<Option<Vec<_>>>()?.concat()),
        _ => None,
    }
}

fn without_comment(line: &str) -> &str {
    let starts = ["//", "#", " %", "\t%"].iter().filter_map(|sign| {
        let at = line.find(sign)?;
        // `/**:` is a node of ROS, and a sign within a word is part of it.
        let before = line[..at].chars().next_back();
        before
            .is_none_or(|c| c.is_whitespace() || c == ';' || c == ',')
            .then_some(at)
    });
    &line[..starts.min().unwrap_or(line.len())]
}

fn is_key(name: &str) -> bool {
    !name.contains(['=', ' ', ',', '(', '[']) && !name.is_empty()
}

/// Name and value of a line in another syntax than YAML: `set name = value`, `static const float name[3] = {...};`, `NAME,VALUE`, `echo VALUE > "PATH/NAME"`.
fn assignment(line: &str) -> Option<(String, String)> {
    if let Some(written) = line.strip_prefix("echo ") {
        let (value, path) = written.split_once('>')?;
        let name = path.trim().trim_matches('"').rsplit('/').next()?;
        return Some((name.into(), value.into()));
    }
    let (name, value) = match line.split_once('=') {
        // A type may be between the name and its value.
        Some((left, value)) => (left.split([':', '[']).next()?, value),
        None => line.split_at(line.find([',', ' ', '\t'])?),
    };
    let name = name.split_whitespace().next_back()?;
    Some((name.replace('.', "/"), value.into()))
}

/// The numbers at the beginning of `text`, whatever separates them.
fn numbers(text: &str) -> Vec<f64> {
    let separators = [' ', ',', ';', '[', ']', '{', '}', '(', ')', '\t', '"'];
    let words = text.split(separators).filter(|word| !word.is_empty());
    let number = |word: &str| word.trim_end_matches(['f', 'F']).parse().ok();
    words.map_while(number).collect()
}
