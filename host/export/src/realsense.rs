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

use crc::{CRC_32_ISO_HDLC, Crc};
use mimu::quantity::Sensor;
use mimu_core::compensation::Affine;
use mimu_recording::error::Result;
use nalgebra::{Matrix3, Vector3};
use serde_json::json;

use crate::remaining::{self, Places};
use crate::{Export, Sources, driver, heading};

/// Size of the EEPROM.
const BYTES: usize = 520;
/// Value of unused bytes, as in the script.
const UNUSED: u8 = 0xff;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Layout of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Layout {
    /// Bytes of the camera's EEPROM
    Eeprom,
    /// calibration.json, as of Intel's script
    Json,
}

/// Options of the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// What to write
    #[cfg_attr(feature = "clap", arg(long, value_enum, default_value = "eeprom"))]
    pub layout: Layout,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// The bytes or the text.
///
/// # Errors
/// The calibration or a triad of it is missing, or C is singular.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let of = |sensor| options.driver.readings(calibration, place, sensor);
    let [accel, gyro] = [of(Sensor::Accel)?, of(Sensor::Gyro)?];
    let mut export = Export::new("realsense", from);
    let (matrices, gyro_unit) = match options.layout {
        Layout::Eeprom => ("sensitivity by columns", "deg/s"),
        Layout::Json => ("scale_and_alignment by columns", "rad/s"),
    };
    export.formulas.push(format!(
        "output = sensitivity reading - bias, SI to SI, in the frame of the calibration; {matrices}; bias of the accelerometer in m/s^2, of the gyro in {gyro_unit}"
    ));
    export.notes.extend([accel.line(), gyro.line()]);
    export.notes.push("Axes have to be those of the depth sensor; the recording has to be made with the camera's motion correction off.".into());
    export.notes.extend(heading::temperature(calibration));
    let places = Places {
        cross_terms: true,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    export.content = match options.layout {
        Layout::Eeprom => {
            export.notes.push("The table of serial numbers is empty and there is no extrinsic calibration, as in the files of Intel's script.".into());
            eeprom(&accel.inverse, &gyro.inverse)
        }
        Layout::Json => {
            let comments = heading::of_calibration(calibration, &export);
            let triad = |model: &Affine<f64>| json!({"scale_and_alignment": model.matrix.as_slice(), "bias": (-model.offset).as_slice()});
            let value = json!({
                "device_type": "D435i",
                "comment": comments,
                "imus": [{"accelerometer": triad(&accel.inverse), "gyroscope": triad(&gyro.inverse)}],
            });
            (format!("{value:#}") + "\n").into_bytes()
        }
    };
    Ok(export)
}

fn eeprom(accel: &Affine<f64>, gyro: &Affine<f64>) -> Vec<u8> {
    // Flags: intrinsic, not extrinsic.
    let mut table = vec![0, 1, 0, 0];
    table.extend([UNUSED; 48]);
    let in_degrees = gyro.offset.map(f64::to_degrees);
    for (matrix, offset) in [(&accel.matrix, accel.offset), (&gyro.matrix, in_degrees)] {
        table.extend(floats(matrix, &-offset));
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

fn floats(matrix: &Matrix3<f64>, bias: &Vector3<f64>) -> impl Iterator<Item = u8> {
    let values: Vec<f64> = matrix.iter().chain(bias.iter()).copied().collect();
    values.into_iter().flat_map(|v| (v as f32).to_le_bytes())
}
