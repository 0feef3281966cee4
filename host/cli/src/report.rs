//! What a fit or a verification says, as JSON for programs and as text for people.
//!
//! Both hold the same numbers. JSON is SI throughout; the text uses degrees and mm/s² where a person reads.

mod allan;
pub mod allan_plot;
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
