//! What a fit or a verification says, as JSON for programs and as text for people.
//!
//! Both hold the same numbers. JSON is SI throughout; the text uses degrees and mm/s² where a person reads.

mod allan;
mod design;
mod device;
mod diagnosis;
mod json;
mod text;

pub use allan::{allan_json, allan_text, allan_toml};
pub use design::{
    DesignReport, NextReport, comparison_json, comparison_text, design_json, design_text,
    next_json, next_text,
};
pub use device::{
    check_json, check_text, counters_json, counters_text, download_json, download_text, info_json,
    info_text, kalman_json, kalman_text, record_json, record_text, self_test_json, self_test_text,
    stream_json, stream_text, upload_json, upload_text,
};
pub use diagnosis::{DiagnosisReport, Made, diagnosis_json, diagnosis_page, diagnosis_text};
pub use json::{fit_json, import_json, verify_json};
pub use text::{dwell_table, fit_text, import_text, verify_text};
pub(crate) use text::{readable, three};

use crate::estimate::AXES;
use crate::recording::RawUnit;

/// Names of the twelve parameters of the inverse model, `C_xx` to `o_z`, in the order of the covariance.
pub fn inverse_names() -> [String; 12] {
    std::array::from_fn(|i| {
        if i < 9 {
            format!("C_{}{}", AXES[i / 3], AXES[i % 3])
        } else {
            format!("o_{}", AXES[i - 9])
        }
    })
}

/// Unit of a raw reading of a sensor whose SI unit is `si`.
fn raw_unit(raw: RawUnit, si: &str) -> String {
    match raw {
        RawUnit::Si => si.to_string(),
        other => other.to_string(),
    }
}

/// Unit of a scale factor, raw per SI.
fn scale_unit(raw: RawUnit, si: &str) -> String {
    match raw {
        RawUnit::Si => "1".to_string(),
        other => format!("{other}/({si})"),
    }
}
