//! Biases for the Linux driver inv_icm42600 (ICM-42600 and IIM-42600 families): a shell script that writes calibbias of its IIO devices.
//!
//! IIO calls calibbias "hardware applied calibration offset" and leaves its unit and sign to each driver. This driver takes SI and writes it to the
//! chip's OFFSET_USER registers, in steps of 1/32 deg/s within ±64 deg/s and of 0.5 mg within ±1 g; the chip adds it to its readings. InvenSense's own
//! driver writes the negative bias there. Therefore calibbias = -b.
//!
//! Other drivers take codes of a register, each in its own unit, so this file is for one driver. calibscale is missing in drivers of inertial units.
//! mount_matrix is read-only, one rotation for both triads, and describes how the chip is mounted: neither has a place here.
//!
//! Source: Linux 6.15, drivers/iio/imu/inv_icm42600/inv_icm42600_gyro.c and _accel.c, `write_offset`, `*_init` (names); Documentation/ABI/testing,
//! sysfs-bus-iio and sysfs-bus-iio-icm42600; InvenSenseInc/public.mcu.iim42652, Ixm42xxxSelfTest.c (5033be47, 2022-06) for the sign.

use std::fmt::Write as _;

use mimu::{PerSensor, STANDARD_GRAVITY, Sensor};
use mimu_recording::error::{Argument, Result};

use crate::biases::biases;
use crate::convention::{Bias, Convention, Shape, within};
use crate::layout::{Entry, Numbers};
use crate::remaining::{Places, Remaining};
use crate::{Export, Page, Sources, Target, driver};

/// One step of the registers, SI.
const STEP: PerSensor<f64> = PerSensor {
    gyro: std::f64::consts::PI / 180.0 / 32.0,
    accel: 0.5e-3 * STANDARD_GRAVITY,
};
/// Largest offset of the registers, steps: 12 bits with a sign.
const MOST: f64 = 2047.0;

/// Finds the one device that has both names, and stops where there are none or several.
const FIND: &str = r#"set -eu
root=${IIO_DEVICES:-/sys/bus/iio/devices}
# The device named $1, as in the file `name`; without it, the only one that ends like it.
find_device() {
    found=
    for device in "$root"/iio:device*; do
        name=$(cat "$device/name" 2>/dev/null) || continue
        case $name in
            $1) [ -z "$found" ] || { echo "several devices are named like $1: name the chip, as in: sh $0 icm42688" >&2; exit 1; }
                found=$device ;;
        esac
    done
    [ -n "$found" ] || { echo "no device in $root is named like $1: is the driver inv_icm42600 loaded?" >&2; exit 1; }
}
"#;

/// The format.
pub struct Iio;

impl Target for Iio {
    type Options = driver::Options;
    const NAME: &str = "iio";
    const ABOUT: &str =
        "Biases for the Linux driver inv_icm42600: a script that writes calibbias of IIO";
    const CONTENTS: &str = "biases";
    const READERS: &str = "Linux, driver inv_icm42600";
    const CONVENTION: Convention = Convention::to_input(Shape::Absent, Bias::AddedToReadings);
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Gyro, Numbers::Bias, "in_anglvel_{axis}_calibbias"),
        Entry::of(Sensor::Accel, Numbers::Bias, "in_accel_{axis}_calibbias"),
    ];
    const PAGES: &[Page] = &[Page::of("Linux IIO, inv_icm42600", "calibbias.sh")];

    /// # Errors
    /// The calibration is missing, C is singular, or a bias is beyond the range of the chip.
    fn export(from: &Sources, options: &driver::Options) -> Result<Export> {
        let (calibration, _) = from.calibration()?;
        let mut export = Export::new::<Self>(from);
        export.formula("output = scale * raw + calibbias on each axis of the chip, SI; the chip adds calibbias");
        export.leaves(calibration, Places::Axes);
        let mut body = String::new();
        let missing = "its calibbias stays unchanged";
        for (entry, parts) in biases::<Self>(options, from, missing, &mut export)? {
            let sensor = entry.sensor;
            let argument = sensor.pick(Argument::GyroZero, Argument::AccelZero);
            let rounding = Remaining::of_rounding(sensor, STEP[sensor]);
            export.remaining.push(rounding);
            let _ = writeln!(body, "find_device \"${{1:-i[ci]m4*}}-{sensor}\"");
            let keys = entry.written(&parts);
            for (i, (name, bias)) in keys.iter().enumerate() {
                let (most, unit) = (MOST * STEP[sensor], format!(" {}", sensor.unit()));
                let remedy = ("give the zero of the readings", argument);
                let value = (bias[0], 3, unit.as_str());
                within((sensor, i), name, value, [-most, most], remedy)?;
                let _ = writeln!(body, "echo {:.9} > \"$found/{name}\"", bias[0]);
            }
        }
        export.temperature(calibration);
        export.note("For the driver inv_icm42600. Record with calibbias 0, as after power-on, and in the axes of the chip: before mount_matrix.");
        export.note("Run it as root with the name of the chip, such as icm42688, if there are several; from a udev rule of the devices to have it at every start.");
        let head = export.head("#", from);
        Ok(export.with(format!("#!/bin/sh\n{head}{FIND}{body}")))
    }
}
