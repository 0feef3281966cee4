//! One triad for IMU-TK: acc.calib or gyro.calib.
//!
//! `x = T K (raw - B)`, raw readings to SI: nine numbers of T by rows, nine of the diagonal matrix K, and three of B. T has ones on its diagonal, so
//! T K = C, and B is the bias of the raw readings. `load` reads only these 21 numbers, so the comments are below them. Source: imu_tk,
//! include/imu_tk/calibration.h, `CalibratedTriad_` (2016-02).

use std::fmt::Write as _;

use clap::{Args, ValueEnum};
use mimu::quantity::Sensor;
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Shape};
use crate::format::Unpack;
use crate::keyed::Keyed;
use crate::layout::{Entry, Numbers};
use crate::remaining::Places;
use crate::{Export, Page, Sources, Target, driver};

/// The triad that the option names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Triad {
    /// Gyro
    Gyro,
    /// Accelerometer
    Accel,
}

/// Options of the file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Which triad: the program has a file for each
    #[arg(long, value_enum)]
    pub sensor: Triad,
}

/// The format.
pub struct ImuTk;

impl Target for ImuTk {
    type Options = Options;
    const NAME: &str = "imu-tk";
    const ABOUT: &str = "One triad for IMU-TK: acc.calib or gyro.calib";
    const CONTENTS: &str = "C and o of one triad (`--sensor gyro` or `accel`)";
    const READERS: &str = "IMU-TK";
    const CONVENTION: Convention =
        Convention::to_input(Shape::MisalignmentSensitivity, Bias::SubtractedFromReadings);
    const TAKES_RAW: bool = true;
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Accel, Numbers::Left, "accel/T"),
        Entry::of(Sensor::Accel, Numbers::Right, "accel/K"),
        Entry::of(Sensor::Accel, Numbers::Bias, "accel/B"),
        Entry::of(Sensor::Gyro, Numbers::Left, "gyro/T"),
        Entry::of(Sensor::Gyro, Numbers::Right, "gyro/K"),
        Entry::of(Sensor::Gyro, Numbers::Bias, "gyro/B"),
    ];
    const UNPACK: Option<Unpack> = Some(unpacked);
    const PAGES: &[Page] = &[
        Page {
            options: "--sensor accel",
            ..Page::of("IMU-TK, accelerometer", "acc.calib")
        },
        Page {
            options: "--sensor gyro",
            ..Page::of("IMU-TK, gyro", "gyro.calib")
        },
    ];

    /// # Errors
    /// The triad is not calibrated, or an error of [`Convention::of`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let (calibration, place) = from.calibration()?;
        let sensor = match options.sensor {
            Triad::Gyro => Sensor::Gyro,
            Triad::Accel => Sensor::Accel,
        };
        let parts = Self::CONVENTION.of(&driver::raw(calibration, place, sensor)?)?;
        let mut export = Export::new::<Self>(from);
        export.formula(format!(
            "{sensor}: output = T K (raw - B), {} to {}; above T and K by rows, then B",
            calibration.recording.raw_unit,
            sensor.unit()
        ));
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        export.remaining.retain(|r| r.sensor == sensor);
        let mut out = String::new();
        for entry in Self::LAYOUT.iter().filter(|entry| entry.sensor == sensor) {
            let each = if entry.numbers == Numbers::Bias { 1 } else { 3 };
            for row in entry.values(&parts).chunks(each) {
                let row: Vec<String> = row.iter().map(|v| format!("{v:.12e}")).collect();
                let _ = writeln!(out, "{}", row.join(" "));
            }
            out.push('\n');
        }
        out += &export.head("#", from);
        Ok(export.with(out))
    }
}

/// A file of 21 numbers and no keys. It does not say which triad it is of: its comments or its name do.
fn unpacked(bytes: &[u8], place: &str) -> Option<Keyed> {
    let file = Keyed::of(std::str::from_utf8(bytes).ok()?);
    let numbers: [f64; 21] = file.only_numbers()?.try_into().ok()?;
    let name = place.rsplit(['/', '\\']).next()?.to_lowercase();
    let triad = match name.contains("gyr") || file.text.contains("gyro: output") {
        true => "gyro",
        false => "accel",
    };
    let mut unpacked = Keyed::without_keys(file.text.clone());
    for (key, range) in [("T", 0..9), ("K", 9..18), ("B", 18..21)] {
        unpacked.add(&format!("{triad}/{key}"), numbers[range].iter().copied());
    }
    Some(unpacked)
}
