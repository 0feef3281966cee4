//! What of a JSON is frozen, how it is written, and how two snapshots are compared.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use serde_json::{Map, Number, Value};

/// Keys that are not frozen: where and when, what the recording states, and what other numbers give.
const SKIPPED: [&str; 30] = [
    "tool",
    "created",
    "sha256",
    "device",
    "samples",
    "recording",
    "recordings",
    "text",
    "format",
    "gravity_mps2",
    "raw_unit",
    "period_s",
    "holdout_blocks",
    "duplicates",
    "means",
    "reference",
    "detection",
    // The dwells as they were read: `gyro_not_used` shows which are used.
    "averaged",
    "clipped",
    "first_row",
    "start_s",
    "raw_mean",
    "duration_s",
    "step",
    "temp_c",
    // Their figures are `rms`, `held_out_rms`, `noise_floor` and `scatter`.
    "residuals",
    // `verify` on the same recording is a command of its own.
    "second",
    // The upper end is frozen.
    "lower",
    // A plan for the effects that are not excited, which are frozen.
    "not_in_plan",
    // A drawing of the residuals.
    "picture",
];
/// Lists that are longer than this and have no names are frozen as number, mean and rms of each quantity.
const LONGEST: usize = 6;
/// Largest relative change of a number that is none. Two orders of the same sums differ by 1e-13, and a condition of 1e6 makes 1e-7 of it.
const RELATIVE: f64 = 1e-6;
/// The same of an estimate, in its standard deviations: an angle whose value happens to be near zero is not determined to a millionth of its value.
const OF_SIGMA: f64 = 1e-5;
/// Numbers below this are rounding errors of zero: 1e-12 rad/s are 2e-7 deg/h, and p < 1e-12 is printed as p < 1e-6.
const ZERO: f64 = 1e-12;
/// Columns of a line of a snapshot.
const WIDTH: usize = 120;

/// What is frozen of a result.
pub fn of(value: &Value) -> Value {
    reduced(value).unwrap_or(Value::Null)
}

/// Names, ids and kinds; a sentence has spaces, a path slashes at its beginning or a file's suffix.
fn is_id(text: &str) -> bool {
    !text.contains(char::is_whitespace) && text.len() <= 60 && !text.starts_with('/')
}

fn reduced(value: &Value) -> Option<Value> {
    match value {
        Value::String(text) => is_id(text).then(|| value.clone()),
        Value::Array(list) => Some(of_list(list)),
        Value::Object(all) => Some(estimate(all).unwrap_or_else(|| {
            let mut out = kept(all);
            // As of a diagnosis without effects.
            if out.contains_key("before") && out.get("before") == out.get("after") {
                out.insert("before".into(), "as_after".into());
            }
            Value::Object(out)
        })),
        Value::Number(number) => Some(digits(number)),
        Value::Null => None,
        Value::Bool(_) => Some(value.clone()),
    }
}

/// What is frozen of an object; what is empty is left out.
fn kept(all: &Map<String, Value>) -> Map<String, Value> {
    let each = all
        .iter()
        .filter(|(key, _)| !SKIPPED.contains(&key.as_str()));
    let each = each.filter_map(|(k, v)| Some((k.clone(), reduced(v)?)));
    each.filter(|(_, v)| match v {
        Value::Array(list) => !list.is_empty(),
        Value::Object(all) => !all.is_empty(),
        Value::String(text) => !text.is_empty(),
        _ => true,
    })
    .collect()
}

/// Eight digits: a millionth survives rounding, and noise of the last bits is not written.
fn digits(number: &Number) -> Value {
    match number.as_f64() {
        Some(x) if number.is_f64() => format!("{x:.7e}")
            .parse()
            .map_or(Value::Null, |x: f64| x.into()),
        _ => Value::Number(number.clone()),
    }
}

/// First element of an estimate.
const ESTIMATE: &str = "=";

/// A parameter: `["=", value, sigma, half-width of the interval]`.
fn estimate(all: &Map<String, Value>) -> Option<Value> {
    let number = |key: &str| all.get(key)?.as_f64();
    all.get("unit")?;
    let (value, sigma) = (number("value")?, number("sigma")?);
    let numbers = [
        Some(value),
        Some(sigma),
        number("upper").map(|upper| upper - value),
    ];
    let numbers = numbers.map(|x| {
        x.and_then(Number::from_f64)
            .map_or(Value::Null, |x| digits(&x))
    });
    let list = Value::Array(std::iter::once(ESTIMATE.into()).chain(numbers).collect());
    let mut rest = kept(all);
    for own in ["name", "value", "sigma", "lower", "upper", "unit"] {
        rest.remove(own);
    }
    if rest.is_empty() {
        return Some(list);
    }
    rest.insert(ESTIMATE.into(), list);
    Some(Value::Object(rest))
}

/// A list: of things with names, by name; of ids, sorted; a long one of numbers, by its mean and rms.
fn of_list(list: &[Value]) -> Value {
    let name = |v: &Value| {
        let text = |key: &str| v.get(key).and_then(Value::as_str).filter(|t| is_id(t));
        let first = ["id", "name", "kind", "unit_id"]
            .iter()
            .find_map(|key| text(key))?;
        let about = ["sensor", "about", "axis"].iter().find_map(|key| text(key));
        // As `accel` in `accel_scale_cubic`.
        let about = about.filter(|about| !first.starts_with(*about));
        Some(about.map_or(first.to_owned(), |about| format!("{first} {about}")))
    };
    // Of a triad's parameters in both forms, those that people read: C and o have the same values and the same covariance.
    let is_matrix =
        |v: &&Value| name(v).is_some_and(|n| n.starts_with("C_") || n.starts_with("o_"));
    let has_scale = list.iter().filter_map(name).any(|n| n == "scale_x");
    let list: Vec<&Value> = list
        .iter()
        .filter(|v| !(has_scale && is_matrix(v)))
        .collect();
    let names: Option<Vec<String>> = list.iter().map(|v| name(v)).collect();
    if let Some(names) = names.filter(|_| !list.is_empty()) {
        let said = |v: &Value| -> Option<Map<String, Value>> {
            match reduced(v)? {
                Value::Object(mut all) => {
                    for key in ["id", "name", "kind", "unit_id", "sensor", "about", "axis"] {
                        all.remove(key);
                    }
                    Some(all)
                }
                other => Some(Map::from_iter([("=".to_owned(), other)])),
            }
        };
        let all: Vec<Map<String, Value>> = list.iter().filter_map(|v| said(v)).collect();
        if all.iter().all(Map::is_empty) {
            let mut names = names;
            names.sort();
            return names.into();
        }
        let mut out = Map::new();
        for (name, mut of) in names.into_iter().zip(all) {
            let place = (1..).map(|n| match n {
                1 => name.clone(),
                n => format!("{name} {n}"),
            });
            let place = place
                .into_iter()
                .find(|p| !out.contains_key(p))
                .expect("endless");
            let of = match of.len() == 1 {
                true => of.remove("=").unwrap_or(Value::Object(of)),
                false => Value::Object(of),
            };
            out.insert(place, of);
        }
        return Value::Object(out);
    }
    if list.len() <= LONGEST {
        return list.iter().filter_map(|v| reduced(v)).collect();
    }
    let mut columns = BTreeMap::new();
    list.iter().for_each(|v| gather("", v, &mut columns));
    if let Some(numbers) = columns.remove("") {
        return numbers.value();
    }
    let columns = columns
        .into_iter()
        .map(|(key, column): (String, Column)| (key, column.value()));
    let mut out: Map<String, Value> = columns.collect();
    out.insert("entries".into(), list.len().into());
    Value::Object(out)
}

/// Values of one quantity in a long list.
#[derive(Default)]
struct Column {
    /// Of each element of a vector.
    numbers: Vec<Vec<f64>>,
    ids: BTreeMap<String, u64>,
}

impl Column {
    fn value(self) -> Value {
        if self.numbers.is_empty() {
            return Value::Object(self.ids.into_iter().map(|(k, n)| (k, n.into())).collect());
        }
        let moments = |x: &Vec<f64>| {
            let n = x.len() as f64;
            let square = x.iter().map(|x| x * x).sum::<f64>() / n;
            [x.iter().sum::<f64>() / n, square.sqrt()]
        };
        let moments = self.numbers.iter().flat_map(moments);
        let moments = moments.map(|x| Number::from_f64(x).map_or(Value::Null, |x| digits(&x)));
        let count = self.numbers[0].len().into();
        std::iter::once(count).chain(moments).collect()
    }

    fn add(&mut self, element: usize, x: f64) {
        if self.numbers.len() <= element {
            self.numbers.resize(element + 1, Vec::new());
        }
        self.numbers[element].push(x);
    }
}

/// Adds a value of a long list to its columns: `[count, mean, rms]`, of vectors mean and rms of each element.
fn gather(place: &str, value: &Value, columns: &mut BTreeMap<String, Column>) {
    let column = |columns: &mut BTreeMap<String, Column>, id: &str| {
        let column = columns.entry(place.to_owned()).or_default();
        *column.ids.entry(id.to_owned()).or_default() += 1;
    };
    match value {
        Value::Number(x) => {
            let column = columns.entry(place.to_owned()).or_default();
            column.add(0, x.as_f64().unwrap_or(f64::NAN));
        }
        Value::Bool(true) => column(columns, "true"),
        Value::Bool(false) => column(columns, "false"),
        Value::Null => column(columns, "null"),
        Value::String(text) if is_id(text) => column(columns, text),
        Value::String(_) => column(columns, "a sentence"),
        Value::Array(list) if list.iter().all(Value::is_number) && list.len() <= 6 => {
            let column = columns.entry(place.to_owned()).or_default();
            for (k, x) in list.iter().enumerate() {
                column.add(k, x.as_f64().unwrap_or(f64::NAN));
            }
        }
        Value::Array(list) => list.iter().for_each(|v| gather(place, v, columns)),
        Value::Object(all) => {
            for (key, v) in all
                .iter()
                .filter(|(key, _)| !SKIPPED.contains(&key.as_str()))
            {
                let place = if place.is_empty() {
                    key.clone()
                } else {
                    format!("{place}.{key}")
                };
                gather(&place, v, columns);
            }
        }
    }
}

/// The text of a snapshot: keys sorted, and a value on one line where it fits.
pub fn text(value: &Value) -> String {
    let mut out = String::new();
    write(&mut out, value, 0, 0);
    out.push('\n');
    out
}

fn write(out: &mut String, value: &Value, depth: usize, before: usize) {
    let line = value.to_string();
    // Cases and commands begin lines of their own, so that a difference shows which.
    if depth > 2 && before + line.len() <= WIDTH {
        out.push_str(&line);
        return;
    }
    let indent = " ".repeat(depth + 1);
    let mut separator = "\n";
    match value {
        Value::Object(all) if !all.is_empty() => {
            out.push('{');
            let sorted: BTreeMap<_, _> = all.iter().collect();
            for (key, v) in sorted {
                let key = format!("{indent}{}: ", Value::from(key.as_str()));
                let _ = write!(out, "{separator}{key}");
                write(out, v, depth + 1, key.len());
                separator = ",\n";
            }
            let _ = write!(out, "\n{}}}", " ".repeat(depth));
        }
        Value::Array(all) if all.iter().any(|v| v.is_object() || v.is_array()) => {
            out.push('[');
            for v in all {
                let _ = write!(out, "{separator}{indent}");
                write(out, v, depth + 1, indent.len());
                separator = ",\n";
            }
            let _ = write!(out, "\n{}]", " ".repeat(depth));
        }
        Value::Array(all) if !all.is_empty() => {
            out.push('[');
            let mut at = WIDTH;
            for (k, v) in all.iter().enumerate() {
                let v = v.to_string();
                if k > 0 {
                    out.push(',');
                }
                if at + v.len() > WIDTH {
                    let _ = write!(out, "\n{indent}");
                    at = indent.len();
                }
                at += v.len() + 1;
                out.push_str(&v);
            }
            let _ = write!(out, "\n{}]", " ".repeat(depth));
        }
        _ => out.push_str(&line),
    }
}

/// A difference between a frozen result and the present one.
pub struct Difference {
    case: String,
    key: String,
    frozen: String,
    now: String,
    /// Relative change of a number; `None` of anything else.
    relative: Option<f64>,
}

/// All differences of a case.
pub fn differences(case: &str, frozen: &Value, now: &Value) -> Vec<Difference> {
    let mut out = Vec::new();
    compare(case, "", frozen, now, &mut out);
    out
}

fn compare(case: &str, key: &str, frozen: &Value, now: &Value, out: &mut Vec<Difference>) {
    let mut differ = |frozen: String, now: String, relative| {
        out.push(Difference {
            case: case.into(),
            key: key.into(),
            frozen,
            now,
            relative,
        });
    };
    match (frozen, now) {
        (Value::Object(a), Value::Object(b)) => {
            let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            for name in keys {
                let of = |all: &Map<String, Value>| all.get(name).cloned().unwrap_or_default();
                compare(case, &format!("{key} > {name}"), &of(a), &of(b), out);
            }
        }
        (Value::Array(a), Value::Array(b)) if ids(a).zip(ids(b)).is_some() => {
            let (a, b) = (ids(a).unwrap_or_default(), ids(b).unwrap_or_default());
            let less = |a: &[&str], b: &[&str]| {
                let only = a.iter().filter(|id| !b.contains(id));
                only.copied().collect::<Vec<_>>().join(" ")
            };
            if a != b {
                differ(less(&a, &b), less(&b, &a), None);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            // The value of an estimate to a share of its sigma.
            let sigma = match a.first() {
                Some(Value::String(first)) if first == ESTIMATE => a[2].as_f64().unwrap_or(0.0),
                _ => 0.0,
            };
            for (k, (x, y)) in a.iter().zip(b).enumerate() {
                let floor = if k == 1 { OF_SIGMA * sigma } else { 0.0 };
                match changed(x, y, floor) {
                    Some(None) => {}
                    Some(Some(relative)) => out.push(Difference {
                        case: case.into(),
                        key: format!("{key}[{k}]"),
                        frozen: x.to_string(),
                        now: y.to_string(),
                        relative: Some(relative),
                    }),
                    None => compare(case, &format!("{key}[{k}]"), x, y, out),
                }
            }
        }
        _ => match changed(frozen, now, 0.0) {
            Some(None) => {}
            Some(relative) => differ(frozen.to_string(), now.to_string(), relative),
            None if frozen == now => {}
            None => {
                let short = |v: &Value| match v {
                    Value::Object(_) | Value::Array(_) => "...".into(),
                    v => v.to_string(),
                };
                differ(short(frozen), short(now), None);
            }
        },
    }
}

fn ids(list: &[Value]) -> Option<Vec<&str>> {
    list.iter().map(Value::as_str).collect()
}

/// Relative change of two numbers if it is one; `None` if they are not both numbers.
fn changed(frozen: &Value, now: &Value, floor: f64) -> Option<Option<f64>> {
    let (a, b) = (frozen.as_f64()?, now.as_f64()?);
    let change = (b - a).abs();
    let allowed = (RELATIVE * a.abs().max(b.abs())).max(floor).max(ZERO);
    Some((change > allowed).then(|| change / a.abs().max(ZERO)))
}

/// All differences, kinds and ids first, then numbers by the size of their change.
pub fn report(mut all: Vec<Difference>) -> String {
    let order = |d: &Difference| d.relative.map_or(f64::INFINITY, f64::abs);
    all.sort_by(|a, b| {
        order(b)
            .total_cmp(&order(a))
            .then_with(|| (&a.case, &a.key).cmp(&(&b.case, &b.key)))
    });
    let cases: BTreeSet<&str> = all.iter().map(|d| d.case.as_str()).collect();
    let words = all.iter().filter(|d| d.relative.is_none()).count();
    let mut out = format!(
        "{} differences in {} cases: {words} kinds and ids, {} numbers\ncase{{key}}: frozen -> now, relative change\n",
        all.len(),
        cases.len(),
        all.len() - words
    );
    for d in &all {
        let key = d.key.trim_start_matches(" > ");
        let _ = write!(out, "{}{{{key}}}: {} -> {}", d.case, d.frozen, d.now);
        let _ = match d.relative {
            Some(relative) => writeln!(out, ", {relative:.1e}"),
            None => writeln!(out),
        };
    }
    out
}
