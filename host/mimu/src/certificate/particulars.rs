//! What a certificate says that no recording contains: who calibrated what for whom, where and when.

use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;

use mimu_recording::error::{Error, Result};
use mimu_recording::{check_kind, parse_toml, read_text};

const FORMAT: &str = "mimu-particulars/1";

/// Keys without which no certificate is written (ISO/IEC 17025:2017, 7.8.2.1).
const REQUIRED: [&str; 14] = [
    "number",
    "received",
    "performed",
    "location",
    "environment",
    "calibrated_by",
    "authorised_by",
    "laboratory.name",
    "laboratory.address",
    "customer.name",
    "customer.address",
    "item.description",
    "item.identification",
    "item.condition",
];
/// Keys that are dates, in the order of time.
const DATES: [&str; 3] = ["received", "performed", "issued"];
const EXAMPLE: &str = "docs/report.md has a whole file to start from";

/// The particulars of a certificate, as its file states them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particulars {
    /// `mimu-particulars/1`.
    pub format: String,
    /// Number of the certificate, unique in the laboratory.
    pub number: String,
    /// Day on which the laboratory received the item, YYYY-MM-DD.
    #[serde(deserialize_with = "day")]
    pub received: String,
    /// Day of the recording.
    #[serde(deserialize_with = "day")]
    pub performed: String,
    /// Day of issue; without it, the day on which the certificate is made.
    #[serde(default, deserialize_with = "day")]
    pub issued: String,
    /// Where the calibration was performed.
    pub location: String,
    /// Conditions of the environment: temperature, humidity, pressure, and their ranges.
    pub environment: String,
    /// Who performed it: name and function.
    pub calibrated_by: String,
    /// Who authorises the certificate: name and function.
    pub authorised_by: String,
    /// Chain of calibrations from the reference to the SI, if the recording or `--reference-error` does not state it.
    #[serde(default)]
    pub traceability: String,
    /// What the laboratory adds: deviations from the method, settings, opinions.
    #[serde(default)]
    pub remarks: Vec<String>,
    /// The laboratory.
    pub laboratory: Party,
    /// The customer.
    pub customer: Party,
    /// The item.
    pub item: Item,
}

/// A laboratory or a customer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Party {
    /// Name.
    pub name: String,
    /// Address.
    pub address: String,
    /// Accreditation, or the number of an order.
    #[serde(default)]
    pub reference: String,
}

/// The calibrated item.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Item {
    /// What it is: kind, maker, type.
    pub description: String,
    /// Serial number or mark by which it is identified without doubt.
    pub identification: String,
    /// Its condition when it was received.
    pub condition: String,
    /// Settings: ranges, filters, rate. The recording may have them too.
    #[serde(default)]
    pub settings: String,
}

/// A day as text: TOML has dates of its own.
fn day<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<String, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Day {
        Date(toml::value::Datetime),
        Text(String),
    }
    Ok(match Day::deserialize(from)? {
        Day::Date(day) => day.to_string(),
        Day::Text(day) => day,
    })
}

impl Particulars {
    /// Reads the file. `has_traceability`: whether another file states that of the reference. `today` is the day of issue if the file has none, YYYY-MM-DD.
    ///
    /// # Errors
    /// All keys that are missing or empty, in one error; a key that is unknown; a day that is none, or before one that it has to follow.
    pub fn read(path: &Path, has_traceability: bool, today: &str) -> Result<Self> {
        let text = read_text(path)?;
        Self::parse(&text, &path.display().to_string(), has_traceability, today)
    }

    fn parse(text: &str, place: &str, has_traceability: bool, today: &str) -> Result<Self> {
        check_kind(text, place, "mimu-particulars")?;
        // The error of a file that is no TOML names its line.
        let table: toml::Table = parse_toml(text, place, None)?;
        let format = table.get("format").and_then(toml::Value::as_str);
        if format != Some(FORMAT) {
            let problem = format!("format is not {FORMAT:?}");
            return Err(Error::new(place, problem, EXAMPLE));
        }
        let missing: Vec<&str> = REQUIRED
            .into_iter()
            .chain((!has_traceability).then_some("traceability"))
            .filter(|key| !is_stated(&table, key))
            .collect();
        if !missing.is_empty() {
            return Err(Error::new(
                place,
                format!("a certificate needs {}", missing.join(", ")),
                format!("add what is missing or empty; {EXAMPLE}"),
            ));
        }
        let mut found: Self = parse_toml(text, place, None)?;
        if found.issued.trim().is_empty() {
            today.clone_into(&mut found.issued);
        }
        found.check_days(place)?;
        Ok(found)
    }

    fn check_days(&self, place: &str) -> Result<()> {
        let days = [&self.received, &self.performed, &self.issued];
        for (key, day) in DATES.into_iter().zip(days) {
            let parsed: Option<toml::value::Datetime> = day.parse().ok();
            if !parsed.is_some_and(|d| d.date.is_some() && d.time.is_none()) {
                return Err(Error::new(
                    format!("{place}, {key}"),
                    format!("{day:?} is no day"),
                    "write YYYY-MM-DD",
                ));
            }
        }
        for k in 1..DATES.len() {
            if days[k] < days[k - 1] {
                return Err(Error::new(
                    format!("{place}, {}", DATES[k]),
                    format!("{} is before {} = {}", days[k], DATES[k - 1], days[k - 1]),
                    "an item is received, calibrated, and then certified",
                ));
            }
        }
        Ok(())
    }
}

/// Whether `table` has text under the dotted `key`.
fn is_stated(table: &toml::Table, key: &str) -> bool {
    let value = match key.split_once('.') {
        Some((outer, inner)) => table.get(outer).and_then(|t| t.get(inner)),
        None => table.get(key),
    };
    value.is_some_and(|value| value.as_str().is_none_or(|text| !text.trim().is_empty()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: &str = r#"
format = "mimu-particulars/1"
number = "2026-117"
received = 2026-11-20
performed = "2026-11-26"
location = "room 12"
environment = "23.0 °C ± 0.5 K"
calibrated_by = "A. Weber"
authorised_by = "B. Roth"
traceability = "level K-17"
[laboratory]
name = "Inertial Laboratory"
address = "1 Long Road"
[customer]
name = "Example Ltd"
address = "2 Short Road"
[item]
description = "inertial unit"
identification = "SN 4711"
condition = "no damage"
"#;

    fn read(text: &str, has_traceability: bool) -> Result<Particulars> {
        Particulars::parse(text, "lab.toml", has_traceability, "2026-11-27")
    }

    #[test]
    fn the_day_of_issue_is_today_unless_it_is_stated() {
        let found = read(WHOLE, false).unwrap();
        assert_eq!(
            (&*found.received, &*found.issued),
            ("2026-11-20", "2026-11-27")
        );
    }

    #[test]
    fn one_error_names_all_that_is_missing() {
        let text = WHOLE
            .replace("number = \"2026-117\"\n", "")
            .replace("\"1 Long Road\"", "\" \"")
            .replace("traceability", "# traceability")
            .replace("[item]\ndescription = \"inertial unit\"\n", "[item]\n");
        let error = read(&text, false).unwrap_err().to_string();
        assert!(
            error.contains("needs number, laboratory.address, item.description, traceability;"),
            "{error}"
        );
        let error = read(&text, true).unwrap_err().to_string();
        assert!(!error.contains("traceability"), "{error}");
    }

    #[test]
    fn a_mistake_is_named() {
        for (from, to, named) in [
            ("2026-11-26", "2026-11-31", "\"2026-11-31\" is no day"),
            ("\"2026-11-26\"", "\"yesterday\"", "\"yesterday\" is no day"),
            (
                "\"2026-11-26\"",
                "2026-11-19",
                "before received = 2026-11-20",
            ),
            ("location", "locations", "needs location"),
            (
                "traceability",
                "tracability = 1\ntraceability",
                "unknown field `tracability`",
            ),
            ("mimu-particulars/1", "mimu-particulars/7", "format is not"),
            (
                "mimu-particulars/1",
                "mimu-calibration/1",
                "this is a calibration",
            ),
            ("number = ", "number = 7 #", "number"),
        ] {
            let error = read(&WHOLE.replace(from, to), false).unwrap_err();
            assert!(error.to_string().contains(named), "{to}: {error}");
        }
    }
}
