//! The calibration of the inertial unit in RealSense cameras of the D400 family: the 520 bytes of the EEPROM, or calibration.json.
//!
//! librealsense computes `output = sensitivity reading - bias`, SI to SI, in the frame of the depth sensor (x right, y down, z forward). Therefore
//! sensitivity = C and bias = -o. Matrices are by columns. Floats and integers are little endian, except for the version in each header. A header
//! contains the size and the CRC-32 of what follows it. Three of them are nested: EEPROM, calibration info, calibration table.
//!
//! librealsense reads the bias of the gyro in deg/s, and so the bytes are written. Intel's script writes the mean of readings in rad/s, which is then
//! 57 times too small. calibration.json is in rad/s, both the script's and this one.
//!
//! Source: IntelRealSense/librealsense, src/ds/ds-private.h, `dm_v2_eeprom`; src/ds/ds-calib-parsers.cpp, `get_intrinsic`;
//! src/proc/motion-transform.cpp, `correct_motion_helper`; tools/rs-imu-calibration/rs-imu-calibration.py, `get_eeprom` (2025-07).

use clap::{Args, ValueEnum};
use crc::{CRC_32_ISO_HDLC, Crc};
use mimu::quantity::Sensor;
use mimu_recording::error::Result;
use serde_json::json;

use crate::convention::{Bias, Convention, Parts, Shape};
use crate::format::Unpack;
use crate::keyed::Keyed;
use crate::layout::{Entry, Numbers};
use crate::remaining::Places;
use crate::{Export, Page, Sources, Target, driver, heading};

/// Size of the EEPROM.
const BYTES: usize = 520;
/// Value of unused bytes, as in the script.
const UNUSED: u8 = 0xff;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Layout of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Layout {
    /// Bytes of the camera's EEPROM
    Eeprom,
    /// calibration.json, as of Intel's script
    Json,
}

/// Options of the file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// What to write
    #[arg(long, value_enum, default_value = "eeprom")]
    pub layout: Layout,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// The format.
pub struct RealSense;

impl Target for RealSense {
    type Options = Options;
    const NAME: &str = "realsense";
    const ABOUT: &str =
        "Both triads for a RealSense camera: bytes of its EEPROM, or calibration.json";
    const CONTENTS: &str = "C and o of both triads";
    const READERS: &str =
        "RealSense cameras of the D400 family with an inertial unit, such as the D435i";
    const CONVENTION: Convention = Convention::to_input(Shape::Whole, Bias::SubtractedFromInput);
    const LAYOUT: &[Entry] = &[
        Entry::of(
            Sensor::Accel,
            Numbers::LeftByColumns,
            "accelerometer/scale_and_alignment",
        ),
        Entry::of(Sensor::Accel, Numbers::Bias, "accelerometer/bias"),
        Entry::of(
            Sensor::Gyro,
            Numbers::LeftByColumns,
            "gyroscope/scale_and_alignment",
        ),
        Entry::of(Sensor::Gyro, Numbers::Bias, "gyroscope/bias"),
    ];
    const UNPACK: Option<Unpack> = Some(unpacked);
    const PAGES: &[Page] = &[
        Page::of("RealSense, EEPROM", "realsense.bin"),
        Page {
            options: "--layout json",
            ..Page::of("RealSense, calibration.json", "realsense.json")
        },
    ];

    /// # Errors
    /// The calibration or a triad of it is missing, or C is singular.
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let (calibration, readings) = options.driver.both(from)?;
        let mut export = Export::new::<Self>(from);
        let (matrices, gyro_unit) = match options.layout {
            Layout::Eeprom => ("sensitivity by columns", "deg/s"),
            Layout::Json => ("scale_and_alignment by columns", "rad/s"),
        };
        export.formula(format!(
            "output = sensitivity reading - bias, SI to SI, in the frame of the calibration; {matrices}; bias of the accelerometer in m/s^2, of the gyro in {gyro_unit}"
        ));
        export.note(readings.accel.line());
        export.note(readings.gyro.line());
        export.note("Axes have to be those of the depth sensor; the recording has to be made with the camera's motion correction off.");
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        let (accel, gyro) = (
            Self::CONVENTION.of(&readings.accel)?,
            Self::CONVENTION.of(&readings.gyro)?,
        );
        if options.layout == Layout::Eeprom {
            export.note("The table of serial numbers is empty and there is no extrinsic calibration, as in the files of Intel's script.");
            return Ok(export.with(eeprom(&accel, &gyro)));
        }
        let triad = |of: &Parts| json!({"scale_and_alignment": of.left.as_slice(), "bias": of.bias.as_slice()});
        let value = json!({
            "device_type": "D435i",
            "comment": heading::of(&export, from),
            "imus": [{"accelerometer": triad(&accel), "gyroscope": triad(&gyro)}],
        });
        Ok(export.with(format!("{value:#}\n")))
    }
}

fn eeprom(accel: &Parts, gyro: &Parts) -> Vec<u8> {
    // Flags: intrinsic, not extrinsic.
    let mut table = vec![0, 1, 0, 0];
    table.extend([UNUSED; 48]);
    let in_degrees = gyro.bias.map(f64::to_degrees);
    for (matrix, bias) in [(accel.left, accel.bias), (gyro.left, in_degrees)] {
        let values = matrix.iter().chain(bias.iter());
        table.extend(values.flat_map(|v| (*v as f32).to_le_bytes()));
    }
    table.extend([UNUSED; 96]);
    let mut info = with_header([2, 1], 0x20, table);
    info.extend([UNUSED; 32]);
    let mut all = with_header([2, 0], 0x20, info);
    all.resize(BYTES - HEADER, UNUSED);
    with_header([1, 1], 0x09, all)
}

/// Size of a header.
const HEADER: usize = 16;

fn with_header(version: [u8; 2], kind: u16, content: Vec<u8>) -> Vec<u8> {
    let mut out = version.to_vec();
    out.extend(kind.to_le_bytes());
    out.extend((content.len() as u32).to_le_bytes());
    out.extend([UNUSED; 4]);
    out.extend(CRC.checksum(&content).to_le_bytes());
    out.extend(content);
    out
}

/// The intrinsics of an EEPROM: the numbers behind its three headers, four flags and 48 bytes.
fn unpacked(bytes: &[u8], _: &str) -> Option<Keyed> {
    const FIRST: usize = 3 * HEADER + 4 + 48;
    let checked = (bytes.len() == BYTES).then(|| CRC.checksum(&bytes[HEADER..]).to_le_bytes());
    if checked? != bytes[HEADER - 4..HEADER] {
        return None;
    }
    let words = bytes[FIRST..FIRST + 96].chunks(4);
    let number = |word: &[u8]| Some(f64::from(f32::from_le_bytes(word.try_into().ok()?)));
    let numbers: Vec<f64> = words.map(number).collect::<Option<_>>()?;
    let mut file = Keyed::default();
    for (entry, range) in RealSense::LAYOUT.iter().zip([0..9, 9..12, 12..21, 21..24]) {
        let is_in_degrees = range == (21..24);
        let unit = if is_in_degrees {
            1f64.to_radians()
        } else {
            1.0
        };
        file.add(entry.key, numbers[range].iter().map(|v| v * unit));
    }
    Some(file)
}
