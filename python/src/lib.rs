//! The extension module of the Python package `mimu`.
//!
//! This module only converts: arrays and options in, results out. The libraries compute. The package's Python files define the contents of a result,
//! which are those of the command's JSON.
//!
//! | module | what |
//! |---|---|
//! | [`arrays`] | arrays that Python holds, and what is refused of them |
//! | [`recording`] | a recording of arrays or on disk |
//! | [`fit`], [`diagnosis`], [`allan`], [`thermal`], [`design`], [`verification`] | one result each |
//! | [`calibration`], [`noise`], [`export`] | the files |
//! | [`error`] | errors in Python |
//! | [`work`] | work during which other threads run, and which Ctrl-C interrupts |
//! | [`command`] | the command itself |

mod allan;
mod arrays;
mod calibration;
mod command;
mod design;
mod diagnosis;
mod error;
mod export;
mod fit;
mod noise;
mod recording;
mod thermal;
mod verification;
mod work;

use pyo3::prelude::*;

/// The compiled part of mimu; use the package `mimu`.
#[pymodule]
mod _mimu {
    #[pymodule_export]
    use super::allan::{Allan, allan};
    #[pymodule_export]
    use super::calibration::{Calibration, load_calibration, parse_calibration};
    #[pymodule_export]
    use super::command::{options, run};
    #[pymodule_export]
    use super::design::{Design, design};
    #[pymodule_export]
    use super::diagnosis::{Diagnosis, diagnose};
    #[pymodule_export]
    use super::export::{Export, export, write};
    #[pymodule_export]
    use super::fit::{Fit, SessionsFit, fit, fit_sessions};
    #[pymodule_export]
    use super::noise::{Noise, NoiseInUse, load_noise, noise_in_use, parse_noise};
    #[pymodule_export]
    use super::recording::{Recording, open, read, unpickled_arrays, unpickled_files};
    #[pymodule_export]
    use super::thermal::{ThermalFit, thermal_fit};
    #[pymodule_export]
    use super::verification::{Verification, verify};
}
