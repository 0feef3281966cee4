//! Presentation of results: text, pages and plots.
//!
//! A result has one document, which is the HTML of its page at a level of detail. The terminal's text is made from it, and a notebook shows it.
//!
//! JSON is the result itself, in SI ([`mimu::result`]). A view receives only the result, so that it cannot show anything that JSON lacks. Units and
//! digits are those of [`mimu::readable`] and [`mimu::quantity`].

#[cfg(not(target_family = "wasm"))]
mod accept;
mod allan;
pub mod allan_plot;
mod apply;
mod body;
pub(crate) mod budget;
mod compare;
pub(crate) mod data_sheet;
mod design;
mod device;
mod diagnosis;
mod fit;
mod fleet;
pub mod fragment;
mod import;
mod noise_in_use;
mod page;
mod refusal;
mod sessions;
mod svg;
mod table;
mod terminal;
mod thermal;
mod thermal_plan;
pub(crate) mod thermal_plot;
mod trajectory;
mod unit;
mod verify;
mod wizard;

#[cfg(not(target_family = "wasm"))]
pub use accept::{accept_line, accept_text};
pub use allan::allan_text;
pub use apply::{apply_text, mean_text};
pub(crate) use body::{Joined, body_errors_text, body_text, delay_text, iron_text, split_text};
pub use compare::compare_text;
pub use design::{design_text, next_text};
pub use device::{
    check_text, counters_text, download_text, info_text, kalman_text, record_text, self_test_text,
    stream_text, trim_text, upload_text,
};
pub use diagnosis::{Detail, diagnosis_page, diagnosis_text, not_in_plan_text};
pub use fit::{dwell_table, fit_text};
pub use fleet::{fleet_page, fleet_text};
pub use import::import_text;
pub use noise_in_use::noise_in_use_text;
pub use page::Made;
pub(crate) use page::problems_text;
pub(crate) use refusal::{print_refusal, refused};
pub use sessions::sessions_text;
pub use thermal::{thermal_page, thermal_text};
pub use thermal_plan::thermal_plan_text;
pub(crate) use trajectory::{trajectories_text, trajectory_text};
pub use unit::{Particulars, UnitReport, trace_figure, unit_page};
pub use verify::verify_text;
pub use wizard::{wizard_lines, wizard_text};
