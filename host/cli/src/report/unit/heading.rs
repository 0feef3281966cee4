//! The heading of a certificate on a unit's page: laboratory, customer, item, dates and who signs, from `mimu-particulars/1`.

use std::path::Path;

use maud::{Markup, html};
use mimu_recording::{Error, Result, check_kind, parse_toml, read_text};
use serde::Deserialize;
use toml::value::Datetime;

const FORMAT: &str = "mimu-particulars/1";

/// What a certificate states that no recording contains (ISO/IEC 17025:2017, 7.8.2.1).
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particulars {
    format: String,
    number: String,
    received: Datetime,
    performed: Datetime,
    /// Absent: the day of the page.
    issued: Option<Datetime>,
    location: String,
    environment: String,
    calibrated_by: String,
    authorised_by: String,
    traceability: String,
    #[serde(default)]
    remarks: Vec<String>,
    laboratory: Party,
    customer: Party,
    item: Item,
}

/// Laboratory or customer; `reference` is an accreditation, or the number of an order.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Party {
    name: String,
    address: String,
    reference: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Item {
    description: String,
    identification: String,
    condition: String,
    settings: Option<String>,
}

impl Particulars {
    /// Reads the file.
    ///
    /// # Errors
    /// It cannot be read, has another format, lacks a key, or has an unknown one.
    pub fn read(path: &Path) -> Result<Self> {
        let (text, place) = (read_text(path)?, path.display().to_string());
        check_kind(&text, &place, "mimu-particulars")?;
        let found: Self = parse_toml(&text, &place, None)?;
        if found.format != FORMAT {
            let remedy = "docs/report.md has a whole file to start from";
            return Err(Error::new(
                place,
                format!("format is not {FORMAT:?}"),
                remedy,
            ));
        }
        Ok(found)
    }

    /// The top of the page, made on the day `created`.
    pub(super) fn head(&self, created: &str) -> Markup {
        let today = created.split('T').next().unwrap_or_default();
        let issued = self
            .issued
            .map_or_else(|| today.to_owned(), |day| day.to_string());
        let rows = [
            ("Item", self.item.description.clone()),
            ("Identification", self.item.identification.clone()),
            ("Condition", self.item.condition.clone()),
            ("Settings", self.item.settings.clone().unwrap_or_default()),
            ("Received", self.received.to_string()),
            (
                "Performed",
                format!("{}, {}", self.performed, self.location),
            ),
            ("Issued", issued),
            ("Environment", self.environment.clone()),
            ("Traceability", self.traceability.clone()),
        ];
        html! {
            h1 { "Calibration certificate " (self.number) }
            @for (what, of) in [("Laboratory", &self.laboratory), ("Customer", &self.customer)] {
                p { (what) ": " strong { (of.name) } ", " (of.address) @if let Some(reference) = &of.reference { ", " (reference) } }
            }
            dl { @for (what, text) in rows.iter().filter(|(_, text)| !text.is_empty()) { dt { (what) } dd { (text) } } }
            @for remark in &self.remarks { p { (remark) } }
            p {
                "The results relate only to this item, in the condition in which it was calibrated. Half of a 95 % interval is the expanded uncertainty, "
                "with the coverage factor of the effective degrees of freedom (JCGM 100:2008, G.4)."
            }
        }
    }

    /// The bottom of the page: where to sign.
    pub(super) fn signatures(&self) -> Markup {
        html! { @for (what, who) in [("Calibrated by", &self.calibrated_by), ("Authorised by", &self.authorised_by)] {
            p { (what) ": " (who) ". Date, signature: ______________________" }
        } }
    }
}
