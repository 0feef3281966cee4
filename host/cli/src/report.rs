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
pub use design::{comparison_text, design_text, next_text};
pub use device::{
    check_text, counters_text, download_text, info_text, kalman_text, record_text, self_test_text,
    stream_text, upload_text,
};
pub use diagnosis::{DiagnosisReport, Made, diagnosis_json, diagnosis_page, diagnosis_text};
pub use json::{fit_json, import_json, verify_json};
pub use text::{dwell_table, fit_text, import_text, verify_text};
