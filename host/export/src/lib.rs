//! Calibrations and noise in the formats of other programs.
//!
//! Each format is one file: what it [declares](Format) (name, help, convention, row of the documentation), its options, its formula and its source. To
//! add one, write its file and name its module and its format here.
//!
//! | module | contents |
//! |---|---|
//! | [`kalibr`], [`openvins`], [`px4`], [`core`] ... | one format each |
//! | [`format`](mod@format) | what a format declares, and the subcommands |
//! | [`convention`] | how programs write the model of a triad: direction, factors, sign and place of the bias |
//! | [`layout`] | where the numbers of a convention, and the noise, are in a file |
//! | [`keyed`] | the numbers of a text file by their keys, whatever its syntax |
//! | [`foreign`] | files of other programs, read |
//! | [`fitting_convention`] | which convention of a file fits a recording of its unit |
//! | [`driver`] | readings in SI, as converted by a driver |
//! | [`craft_axes`] | axes of the craft, and a calibration rotated between two choices of them |
//! | [`body`] | triads beyond the first gyro and accelerometer |
//! | [`worst_axis`] | noise for programs that have one number for three axes |
//! | [`intrinsics`] | triangular matrices and rotations, for Kalibr and OpenVINS |
//! | [`remaining`] | errors that remain because a format cannot store a part of the calibration |
//! | [`judged`] | judgements of the sources, and errors that every program inherits |
//! | `heading` | the comments at the head of every file |
//! | [`parameters`] | parameters of autopilots, and their file layouts |
//! | `biases` | biases of each axis alone, for Adafruit and IIO |
//! | `degrees_per_turn` | scale factors of a gyro alone, for SlimeNRF and the Pigeon 2 |
//! | `flight_codes` | the accelerometer in whole codes, for Betaflight and INAV |
//! | `template` | fixed text with places for values |

pub mod adafruit;
pub mod ardupilot;
pub mod autoware;
pub mod basalt;
pub mod betaflight;
mod biases;
pub mod body;
pub mod c;
pub mod convention;
pub mod core;
pub mod craft_axes;
mod degrees_per_turn;
pub mod depthai;
pub mod dlio;
pub mod driver;
pub mod fastlio;
pub mod fitting_convention;
mod flight_codes;
pub mod foreign;
pub mod format;
pub mod fusion;
mod gauss_markov;
pub mod gazebo;
mod heading;
pub mod iio;
pub mod imu_calib;
pub mod imu_tk;
pub mod inav;
pub mod intrinsics;
pub mod json;
pub mod judged;
pub mod kalibr;
pub mod keyed;
pub mod kf_gins;
pub mod layout;
pub mod liosam;
pub mod matlab;
pub mod navego;
pub mod openvins;
pub mod orbslam3;
pub mod parameters;
pub mod pigeon;
pub mod px4;
pub mod realsense;
pub mod remaining;
pub mod ros_imu;
pub mod rust;
pub mod slimenrf;
mod sources;
mod template;
pub mod vins;
pub mod worst_axis;
pub mod yaml;

use mimu::calibration::bias_cubic::BiasCubics;
use mimu::{Calibration, NoiseFile};
use serde::Serialize;

pub use crate::format::{Choice, Format, Noise, Nothing, Page, Target};
use crate::judged::JudgedSource;
use crate::parameters::Parameter;
use crate::remaining::{Places, Remaining};
pub use crate::sources::Sources;

/// `text` with the probability of the intervals of `noise` in place of `{}`; empty if it has none.
pub(crate) fn noise_interval(noise: &NoiseFile, text: &str) -> String {
    let percent = 100.0 * noise.confidence;
    match percent.is_finite() {
        true => text.replace("{}", &percent.to_string()),
        false => String::new(),
    }
}

/// All formats, in the order of `mimu export --help`.
pub static FORMATS: &[Format] = &[
    Format::of::<c::C>(),
    Format::of::<rust::Rust>(),
    Format::of::<json::Json>(),
    Format::of::<kalibr::Kalibr>(),
    Format::of::<openvins::OpenVins>(),
    Format::of::<vins::Vins>(),
    Format::of::<orbslam3::OrbSlam3>(),
    Format::of::<liosam::LioSam>(),
    Format::of::<fastlio::FastLio>(),
    Format::of::<dlio::Dlio>(),
    Format::of::<kf_gins::KfGins>(),
    Format::of::<navego::NaveGo>(),
    Format::of::<imu_calib::ImuCalib>(),
    Format::of::<imu_tk::ImuTk>(),
    Format::of::<fusion::Fusion>(),
    Format::of::<realsense::RealSense>(),
    Format::of::<depthai::DepthAi>(),
    Format::of::<basalt::Basalt>(),
    Format::of::<px4::Px4>(),
    Format::of::<ardupilot::ArduPilot>(),
    Format::of::<betaflight::Betaflight>(),
    Format::of::<inav::Inav>(),
    Format::of::<adafruit::Adafruit>(),
    Format::of::<slimenrf::SlimeNrf>(),
    Format::of::<pigeon::Pigeon>(),
    Format::of::<iio::Iio>(),
    Format::of::<ros_imu::RosImu>(),
    Format::of::<autoware::Autoware>(),
    Format::of::<gazebo::Gazebo>(),
    Format::of::<matlab::Matlab>(),
    Format::of::<core::Core>(),
];

/// An exported file.
#[derive(Debug, Clone, Serialize)]
pub struct Export {
    /// `mimu-export/1`.
    pub format: &'static str,
    /// Name of the format in the command.
    pub to: &'static str,
    /// Formulas that the program computes with the file, one line each.
    pub formulas: Vec<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// Judgements of its sources.
    pub judgements: Vec<JudgedSource>,
    /// Errors of the calibration itself, which every program inherits.
    pub calibration_errors: Vec<Remaining>,
    /// Parts of the calibration that the file cannot store, and the errors that this adds.
    pub remaining: Vec<Remaining>,
    /// Parameters in the order of the file, if it consists of parameters.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<Parameter>,
    /// Biases over temperature, if the format stores them as cubics.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cubics: Vec<BiasCubics>,
    /// Bytes of the file.
    #[serde(skip)]
    pub content: Vec<u8>,
    #[serde(skip)]
    noise: Noise,
    #[serde(skip)]
    further_triads: bool,
}

impl Export {
    /// An export of these sources, without content.
    pub(crate) fn new<T: Target>(from: &Sources) -> Self {
        let calibration = from.calibration.map(|(calibration, _)| calibration);
        let notes = match T::NOISE {
            Noise::Optional | Noise::Needed => from.other_device(),
            Noise::No | Noise::Only => None,
        };
        let without = calibration.filter(|_| !T::FURTHER_TRIADS);
        let notes = notes.into_iter().chain(without.and_then(body::no_place));
        Self {
            format: "mimu-export/1",
            to: T::NAME,
            formulas: Vec::new(),
            notes: notes.collect(),
            judgements: JudgedSource::all(from),
            calibration_errors: calibration.map(judged::errors_of).unwrap_or_default(),
            remaining: Vec::new(),
            parameters: Vec::new(),
            cubics: Vec::new(),
            content: Vec::new(),
            noise: T::NOISE,
            further_triads: T::FURTHER_TRIADS,
        }
    }

    pub(crate) fn formula(&mut self, line: impl Into<String>) {
        self.formulas.push(line.into());
    }

    pub(crate) fn note(&mut self, line: impl Into<String>) {
        self.notes.push(line.into());
    }

    /// For a format without curves: notes the temperature at which the exported calibration is valid.
    pub(crate) fn temperature(&mut self, calibration: &Calibration) {
        let temp_c = calibration.temperature.as_ref();
        if let Some(temp_c) = temp_c.and(calibration.recording.temp_c) {
            self.note(format!("The numbers are those at {temp_c:.1} °C."));
        }
    }

    /// For a format with continuous-time densities of the worst axis.
    pub(crate) fn continuous_densities(&mut self, noise: &NoiseFile) {
        let interval = noise_interval(noise, "; {} % interval behind each");
        self.formula(format!(
            "Continuous-time densities of the worst axis{interval}."
        ));
    }

    /// For a format without a place for a calibration.
    pub(crate) fn needs_calibrated(&mut self, from: &Sources) {
        if from.calibration.is_some() {
            self.note("The program has no place for a calibration: it needs calibrated readings, as `mimu apply` and the device make them.");
        }
    }

    /// Sets the errors of a format with these `places`.
    pub(crate) fn leaves(&mut self, calibration: &Calibration, places: Places) {
        self.remaining = remaining::of(calibration, places);
    }

    /// The comments at the head of the file, as comments with the sign `sign`.
    pub(crate) fn head(&self, sign: &str, from: &Sources) -> String {
        heading::comments(sign, &heading::of(self, from))
    }

    /// With the bytes of the file.
    pub(crate) fn with(mut self, content: impl Into<Vec<u8>>) -> Self {
        self.content = content.into();
        self
    }

    /// The lines for the terminal: judgements, of which one that is not good is a warning, formulas, notes and errors.
    pub fn for_terminal(&self) -> Vec<String> {
        heading::for_terminal(self)
    }
}
