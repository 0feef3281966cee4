//! Calibrations and noise in the formats of other programs.
//!
//! One file for each format, with its options, its formula and its source. To add a format: write its file, and add its variant to
//! [`Format`].
//!
//! | module | what |
//! |---|---|
//! | [`kalibr`], [`px4`], [`ardupilot`], [`core`] ... | one format each |
//! | [`remaining`] | the errors that a format leaves because it has no place for a part of the calibration |
//! | [`heading`] | the comments at the head of every file |
//! | [`parameters`] | parameters of autopilots, and how files hold them |

pub mod ardupilot;
pub mod c;
pub mod core;
pub mod heading;
pub mod json;
pub mod kalibr;
pub mod mcap;
mod one_temperature;
#[cfg(feature = "clap")]
mod options;
pub mod parameters;
pub mod px4;
pub mod remaining;
pub mod rust;

use std::path::PathBuf;

use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::BiasCubics;
use mimu::noise::noise_file::NoiseFile;
use mimu_recording::error::{Error, Result};
use serde::Serialize;

use crate::parameters::Parameter;
use crate::remaining::Remaining;

/// A format, with what a person decides about it.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Subcommand))]
pub enum Format {
    /// A C99 header: constants, and functions that make SI of raw readings
    C(c::Options),
    /// Noise for Kalibr: imu.yaml
    Kalibr(kalibr::Options),
    /// Parameters of PX4: TC_* over temperature, CAL_* at one
    Px4(px4::Options),
    /// Parameters of ArduPilot: INS_TCAL* over temperature, INS_ACCOFFS, INS_ACCSCAL and INS_GYROFFS at one
    #[cfg_attr(feature = "clap", command(name = "ardupilot"))]
    ArduPilot(ardupilot::Options),
    /// JSON with everything that the calibration file has, and a schema
    Json,
    /// MCAP for Foxglove: samples raw and compensated, and poses on the sphere of gravity
    Mcap(mcap::Options),
    /// The bytes that a device stores, for programs with mimu-core
    Core,
    /// Constants and a function for Rust programs with mimu-core
    Rust,
}

/// What an export is made from.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sources<'a> {
    /// The calibration, and the file that it is from.
    pub calibration: Option<(&'a Calibration, &'a str)>,
    /// Noise of the unit.
    pub noise: Option<&'a NoiseFile>,
}

/// What was made for another program.
#[derive(Debug, Clone, Serialize)]
pub struct Export {
    /// `mimu-export/1`.
    pub format: &'static str,
    /// The format, as the command names it.
    pub to: &'static str,
    /// What the program computes with the file, one line each.
    pub formulas: Vec<String>,
    /// What a person has to know or to do.
    pub notes: Vec<String>,
    /// What of the calibration has no place in the file, and the error that this leaves.
    pub remaining: Vec<Remaining>,
    /// In the order of the file, where it consists of parameters.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<Parameter>,
    /// Biases over temperature, where the format holds them as cubics.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cubics: Vec<BiasCubics>,
    /// Bytes of the file.
    #[serde(skip)]
    pub content: Vec<u8>,
}

impl Export {
    /// One without content yet.
    pub fn new(to: &'static str) -> Self {
        Self {
            format: "mimu-export/1",
            to,
            formulas: Vec::new(),
            notes: Vec::new(),
            remaining: Vec::new(),
            parameters: Vec::new(),
            cubics: Vec::new(),
            content: Vec::new(),
        }
    }
}

impl Sources<'_> {
    /// The calibration, and the file that it is from.
    ///
    /// # Errors
    /// There is none.
    pub fn calibration(&self) -> Result<(&Calibration, &str)> {
        self.calibration.ok_or_else(|| {
            Error::new(
                "--calibration",
                "this format is made from a calibration, and there is none",
                "name the file that `mimu fit -o` wrote",
            )
        })
    }

    /// The noise.
    ///
    /// # Errors
    /// There is none.
    pub fn noise(&self) -> Result<&NoiseFile> {
        self.noise.ok_or_else(|| {
            Error::new(
                "--noise",
                "this format is made from the noise of the unit, and there is none",
                "name the file that `mimu allan -o` wrote",
            )
        })
    }
}

impl Format {
    /// Files that it reads beside its [`Sources`]: no result may take their place.
    pub fn inputs(&self) -> Vec<PathBuf> {
        match self {
            Self::Mcap(options) => ["recording.toml", "samples.csv", "samples.parquet"]
                .map(|name| options.recording.join(name))
                .into(),
            _ => Vec::new(),
        }
    }

    /// The file of this format.
    ///
    /// # Errors
    /// A source is missing; the calibration or the noise has no place in the format, as each module says.
    pub fn export(&self, from: &Sources) -> Result<Export> {
        match self {
            Self::C(options) => c::export(from, options),
            Self::Kalibr(options) => kalibr::export(from, options),
            Self::Px4(options) => px4::export(from, options),
            Self::ArduPilot(options) => ardupilot::export(from, options),
            Self::Core => core::export(from),
            Self::Json => json::export(from),
            Self::Mcap(options) => mcap::export(from, options),
            Self::Rust => rust::export(from),
        }
    }
}
