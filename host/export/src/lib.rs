//! Calibrations and noise in the formats of other programs.
//!
//! Each format has a file with its options, its formula and its source. To add a format, write its file and add its variant to [`Format`].
//!
//! | module | contents |
//! |---|---|
//! | [`kalibr`], [`openvins`], [`px4`], [`core`] ... | one format each |
//! | [`worst_axis`] | noise for programs that have one number for three axes |
//! | [`driver`] | readings in SI, as converted by a driver |
//! | [`misalignment`] | misalignment times sensitivity, for IMU-TK and Fusion |
//! | [`intrinsics`] | triangular matrices and rotations, for Kalibr and OpenVINS |
//! | [`remaining`] | errors that remain because a format cannot store a part of the calibration |
//! | [`judged`] | judgements of the sources, and errors that every program inherits |
//! | [`heading`] | the comments at the head of every file |
//! | [`parameters`] | parameters of autopilots, and their file layouts |
//! | `degrees_per_turn` | scale factors of a gyro alone, for SlimeNRF and the Pigeon 2 |
//! | `flight_codes` | the accelerometer in whole codes, for Betaflight and INAV |

pub mod ardupilot;
pub mod autoware;
pub mod basalt;
pub mod betaflight;
pub mod c;
pub mod core;
mod degrees_per_turn;
pub mod depthai;
pub mod driver;
pub mod fastlio;
mod flight_codes;
pub mod fusion;
pub mod gazebo;
pub mod heading;
pub mod iio;
pub mod imu_calib;
pub mod imu_tk;
pub mod inav;
pub mod intrinsics;
pub mod json;
pub mod judged;
pub mod kalibr;
pub mod liosam;
pub mod matlab;
pub mod misalignment;
mod one_temperature;
pub mod openvins;
#[cfg(feature = "clap")]
mod options;
pub mod orbslam3;
pub mod parameters;
pub mod pigeon;
pub mod px4;
pub mod realsense;
pub mod remaining;
pub mod ros_imu;
pub mod rust;
pub mod slimenrf;
pub mod vins;
pub mod worst_axis;
pub mod yaml;

use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::BiasCubics;
use mimu::calibration::thermal_biases::ThermalBiases;
use mimu::noise::noise_file::{NoiseChannel, NoiseFile};
use mimu::quantity::{Sensor, significant};
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{RAW_COLUMNS, RawUnit};
use serde::Serialize;

use crate::judged::JudgedSource;
use crate::parameters::Parameter;
use crate::remaining::Remaining;

/// A format with its options.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Subcommand))]
pub enum Format {
    /// A C99 header: constants, and functions that convert raw readings to SI
    C(c::Options),
    /// Constants and a function for Rust programs with mimu-core
    Rust,
    /// JSON with the contents of the calibration file, and a schema
    Json,
    /// Noise and intrinsics for Kalibr: imu.yaml
    Kalibr(kalibr::Options),
    /// Noise and intrinsics for OpenVINS: kalibr_imu_chain.yaml
    #[cfg_attr(feature = "clap", command(name = "openvins"))]
    OpenVins(openvins::Options),
    /// Noise for VINS-Fusion and VINS-Mono
    Vins(vins::Options),
    /// Noise for ORB-SLAM3
    #[cfg_attr(feature = "clap", command(name = "orbslam3"))]
    OrbSlam3(orbslam3::Options),
    /// Noise for LIO-SAM
    #[cfg_attr(feature = "clap", command(name = "liosam"))]
    LioSam(liosam::Options),
    /// Noise for FAST-LIO
    #[cfg_attr(feature = "clap", command(name = "fastlio"))]
    FastLio(fastlio::Options),
    /// Accelerometer for the ROS package imu_calib: imu_calib.yaml
    ImuCalib(imu_calib::Options),
    /// One triad for IMU-TK: acc.calib or gyro.calib
    ImuTk(imu_tk::Options),
    /// Both triads for Fusion of x-io: a header in C
    Fusion,
    /// Both triads for a RealSense camera: bytes of its EEPROM, or calibration.json
    #[cfg_attr(feature = "clap", command(name = "realsense"))]
    RealSense(realsense::Options),
    /// Both triads and noise for an OAK camera: imuCalibrationParams of DepthAI
    #[cfg_attr(feature = "clap", command(name = "depthai"))]
    DepthAi(depthai::Options),
    /// Both triads and noise for Basalt: the inertial part of its calibration
    Basalt(basalt::Options),
    /// Parameters of PX4: TC_* over temperature, CAL_* at one
    Px4(px4::Options),
    /// Parameters of ArduPilot: INS_TCAL* over temperature, INS_ACCOFFS, INS_ACCSCAL and INS_GYROFFS at one
    #[cfg_attr(feature = "clap", command(name = "ardupilot"))]
    ArduPilot(ardupilot::Options),
    /// Biases of the accelerometer for Betaflight: lines of its CLI
    Betaflight(betaflight::Options),
    /// Biases and scale factors of the accelerometer for INAV: lines of its CLI
    Inav(inav::Options),
    /// Scale factors of the gyro for a SlimeVR tracker with SlimeNRF: the line `sens x,y,z` of its console
    #[cfg_attr(feature = "clap", command(name = "slimenrf"))]
    SlimeNrf(slimenrf::Options),
    /// Scale factors of the gyro for a Pigeon 2 of CTR Electronics: GyroScalarX, Y and Z in degrees per rotation
    Pigeon(pigeon::Options),
    /// Biases for the Linux driver inv_icm42600: a script that writes calibbias of IIO
    Iio(iio::Options),
    /// Covariances of sensor_msgs/Imu for ROS
    RosImu(ros_imu::Options),
    /// Biases of the gyro and noise for Autoware: imu_corrector.param.yaml
    Autoware(autoware::Options),
    /// Biases and noise for Gazebo: the element imu of SDF
    Gazebo(gazebo::Options),
    /// Errors and noise for MATLAB's imuSensor: JSON for loadparams
    Matlab(matlab::Options),
    /// The bytes that a device stores, for programs with mimu-core
    Core,
}

/// Largest share by which a scale factor may differ from 1 without a consequence: that of N is rarely known better.
const SAME_SCALE: f64 = 0.03;
/// Largest share by which two scale factors of one unit differ: temperature and age change it by less.
const OTHER_SCALE: f64 = 0.1;

/// Sources of an export.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sources<'a> {
    /// The calibration, and its file.
    pub calibration: Option<(&'a Calibration, &'a str)>,
    /// Instead of a calibration: biases over temperature of a unit that stayed at rest, for [formats that take them](Format::takes_biases).
    pub biases: Option<&'a ThermalBiases>,
    /// Noise of the unit.
    pub noise: Option<&'a NoiseFile>,
}

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
}

impl Export {
    /// An export of these sources, without content.
    pub fn new(to: &'static str, from: &Sources) -> Self {
        let calibration = from.calibration.map(|(calibration, _)| calibration);
        Self {
            format: "mimu-export/1",
            to,
            formulas: Vec::new(),
            notes: Vec::new(),
            judgements: JudgedSource::all(from),
            calibration_errors: calibration.map(judged::errors_of).unwrap_or_default(),
            remaining: Vec::new(),
            parameters: Vec::new(),
            cubics: Vec::new(),
            content: Vec::new(),
        }
    }
}

impl Sources<'_> {
    /// The calibration and its file.
    ///
    /// # Errors
    /// There is no calibration.
    pub fn calibration(&self) -> Result<(&Calibration, &str)> {
        self.calibration.ok_or_else(|| {
            Error::new(
                "export",
                "this format needs a calibration",
                "name a file of `mimu fit -o`",
            )
            .about(Argument::Calibration)
        })
    }

    /// Refuses noise of other readings than those that the calibration is for: one of the two then belongs to another unit, or to the unit with another
    /// range. Noise of calibrated readings in SI fits every calibration.
    fn check_same_readings(&self) -> Result<()> {
        let (Some((calibration, file)), Some(noise)) = (self.calibration, self.noise) else {
            return Ok(());
        };
        for channel in &noise.channel {
            let at = RAW_COLUMNS.iter().position(|name| *name == channel.name);
            let scaled = channel.raw_unit.as_ref().zip(channel.scale_factor);
            let Some(at) = at else { continue };
            let Some(table) = calibration.table(Sensor::BOTH[at / 3]) else {
                continue;
            };
            let ours = table.physical.scale_factor[at % 3];
            let Some((unit, scale)) = scaled else {
                self.check_alike(channel, ours, table.raw_unit)?;
                continue;
            };
            let raw = table.raw_unit.to_string();
            if *unit == raw && ((scale / ours).abs() - 1.0).abs() < OTHER_SCALE {
                continue;
            }
            return Err(Error::new(
                format!("{}, channel {}", noise.place, channel.name),
                format!(
                    "it was computed with a scale factor of {} {unit} per {}, and that of {file} is {} {raw}",
                    significant(scale),
                    channel.unit,
                    significant(ours)
                ),
                "give noise and calibration of the same unit",
            )
            .about(Argument::Noise));
        }
        Ok(())
    }

    /// Refuses noise of which nobody says whether it is that of readings in SI before the calibration or after it, if the two differ: the densities of a
    /// gyro whose driver reports half of the rate came out too small by half.
    fn check_alike(&self, channel: &NoiseChannel, scale: f64, raw: RawUnit) -> Result<()> {
        if raw != RawUnit::Si || (scale.abs() - 1.0).abs() < SAME_SCALE {
            return Ok(());
        }
        let place = self.noise.map_or("", |noise| noise.place.as_str());
        let problem = format!(
            "the calibration changes these readings by a factor of {}, and the file does not say whether its noise is that before or after",
            significant(1.0 / scale)
        );
        let remedy = "make it of the same readings with the calibration: mimu allan REC --calibration FILE -o noise.toml";
        let place = format!("{place}, channel {}", channel.name);
        Err(Error::new(place, problem, remedy).about(Argument::Noise))
    }

    /// A note if calibration and noise have the names of different units.
    pub(crate) fn other_device(&self) -> Option<String> {
        let ((calibration, _), noise) = self.calibration.zip(self.noise)?;
        (calibration.device != noise.device).then(|| {
            format!(
                "The calibration belongs to {:?} and the noise to {:?}: use the file only if these are one unit.",
                calibration.device, noise.device
            )
        })
    }

    /// The noise of the unit.
    ///
    /// # Errors
    /// The noise is missing.
    pub fn noise(&self) -> Result<&NoiseFile> {
        self.noise.ok_or_else(|| {
            Error::new(
                "export",
                "this format needs the noise of the unit",
                "record the unit at rest, and add its file: mimu allan REST --calibration cal.toml -o noise.toml, then --noise noise.toml",
            )
            .about(Argument::Noise)
        })
    }
}

impl Format {
    /// Whether it stores the noise of a unit.
    pub fn has_noise(&self) -> bool {
        matches!(
            self,
            Self::Kalibr(_)
                | Self::OpenVins(_)
                | Self::Vins(_)
                | Self::OrbSlam3(_)
                | Self::LioSam(_)
                | Self::FastLio(_)
                | Self::DepthAi(_)
                | Self::Basalt(_)
                | Self::RosImu(_)
                | Self::Autoware(_)
                | Self::Gazebo(_)
                | Self::Matlab(_)
        )
    }

    /// Whether it can be written from biases over temperature alone.
    pub fn takes_biases(&self) -> bool {
        matches!(self, Self::Px4(_) | Self::ArduPilot(_))
    }

    /// The file of this format.
    ///
    /// # Errors
    /// A source is missing, or the format cannot store the calibration or the noise, as each module describes.
    pub fn export(&self, from: &Sources) -> Result<Export> {
        from.check_same_readings()?;
        match self {
            Self::C(options) => c::export(from, options),
            Self::Kalibr(options) => kalibr::export(from, options),
            Self::OpenVins(options) => openvins::export(from, options),
            Self::Vins(options) => vins::export(from, options),
            Self::OrbSlam3(options) => orbslam3::export(from, options),
            Self::LioSam(options) => liosam::export(from, options),
            Self::FastLio(options) => fastlio::export(from, options),
            Self::ImuCalib(options) => imu_calib::export(from, options),
            Self::ImuTk(options) => imu_tk::export(from, options),
            Self::Fusion => fusion::export(from),
            Self::RealSense(options) => realsense::export(from, options),
            Self::Px4(options) => px4::export(from, options),
            Self::ArduPilot(options) => ardupilot::export(from, options),
            Self::DepthAi(options) => depthai::export(from, options),
            Self::Basalt(options) => basalt::export(from, options),
            Self::Betaflight(options) => betaflight::export(from, options),
            Self::Inav(options) => inav::export(from, options),
            Self::SlimeNrf(options) => slimenrf::export(from, options),
            Self::Pigeon(options) => pigeon::export(from, options),
            Self::Iio(options) => iio::export(from, options),
            Self::RosImu(options) => ros_imu::export(from, options),
            Self::Autoware(options) => autoware::export(from, options),
            Self::Gazebo(options) => gazebo::export(from, options),
            Self::Matlab(options) => matlab::export(from, options),
            Self::Core => core::export(from),
            Self::Json => json::export(from),
            Self::Rust => rust::export(from),
        }
    }
}
