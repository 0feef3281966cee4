//! Parameters of PX4.
//!
//! Before its own scale factors, PX4 subtracts a cubic of its thermometer's temperature from each axis of the readings: `X0 + X1 d + X2 d² + X3 d³`
//! with `d = T - TREF`, where T is clamped to TMIN to TMAX. Source: PX4 User Guide, "Thermal Calibration and Compensation"; parameter reference,
//! TC_*.
//!
//! A calibration at one temperature becomes CAL_ACCn_XOFF, CAL_ACCn_XSCALE and CAL_GYROn_XOFF, n from 0. PX4 computes `(data - thermal_offset -
//! offset) * scale` for an accelerometer and `data - thermal_offset - offset` for a gyro, which has no scale there. The
//! driver has rotated the data to the axes of the board, x forward, y right, z down. Source: src/lib/sensor_calibration/Accelerometer.hpp and
//! Gyroscope.hpp, `Correct`; src/modules/sensors/module.yaml; msg/SensorAccel.msg for the axes.
//!
//! A magnetometer becomes CAL_MAGn_XOFF, in gauss, and the symmetric matrix of CAL_MAGn_XSCALE and CAL_MAGn_XODIAG: `rotation * (scale * (data - offset))`.
//! The rotation is the mounting (CAL_MAGn_ROT; as Euler angles, CAL_MAGn_ROLL and so on). Source: src/lib/sensor_calibration/Magnetometer.hpp, `Correct`;
//! Magnetometer.cpp, `set_offdiagonal` (XODIAG in row 1, column 2; YODIAG in row 1, column 3; ZODIAG in row 2, column 3); msg/SensorMag.msg for the unit.

use mimu::calibration::bias_cubic::BiasCubics;
use mimu::quantity::Sensor;
use mimu_recording::{Argument, Result, TriadKind};

use crate::convention::{Bias, Convention, Shape};
use crate::craft_axes::CraftAxes;
use crate::layout::{Entry, Numbers};
use crate::parameters::{CONVENTION, Compass, GIVE_FACTOR, Options, Parameter, Row, What};
use crate::remaining::Remaining;
use crate::{Export, Page, Sources, Target};

/// Range of PX4's scale factors of an accelerometer and of a magnetometer.
const SCALES: [f64; 2] = [0.1, 3.0];
/// Its parameters of each axis.
const ROWS: [Row; 6] = {
    const fn row(kind: TriadKind, what: What, name: &'static str) -> Row {
        let range = match (what, kind) {
            (What::Scale, TriadKind::Mag) => {
                Some((SCALES, 3, "", (GIVE_FACTOR.0, Argument::MagConversion)))
            }
            (What::Scale, _) => Some((SCALES, 3, "", GIVE_FACTOR)),
            _ => None,
        };
        Row {
            kind,
            what,
            name,
            range,
        }
    }
    [
        row(TriadKind::Gyro, What::Offset, "CAL_GYRO{n}_{axis}OFF"),
        row(TriadKind::Accel, What::Offset, "CAL_ACC{n}_{axis}OFF"),
        row(TriadKind::Accel, What::Scale, "CAL_ACC{n}_{axis}SCALE"),
        row(TriadKind::Mag, What::Offset, "CAL_MAG{n}_{axis}OFF"),
        row(TriadKind::Mag, What::Scale, "CAL_MAG{n}_{axis}SCALE"),
        row(TriadKind::Mag, What::Beside, "CAL_MAG{n}_{axis}ODIAG"),
    ]
};
/// Sensors of a kind.
const MOST: u8 = 4;
/// Its magnetometers.
const COMPASS: Compass = Compass {
    unit: ("gauss", 0.01),
    convention: Convention::to_input(Shape::RotationSymmetric, Bias::SubtractedFromReadings),
    formula: "S (v - offset)",
    symmetric: "S = [[XSCALE, XODIAG, YODIAG], [XODIAG, YSCALE, ZODIAG], [YODIAG, ZODIAG, ZSCALE]]",
};

/// The format.
pub struct Px4;

impl Target for Px4 {
    type Options = Options;
    const NAME: &str = "px4";
    const ABOUT: &str = "Parameters of PX4: TC_* over temperature, CAL_* at one";
    const CONTENTS: &str = "biases over temperature, or biases and scale factors at one temperature; magnetometers, further units";
    const READERS: &str = "PX4";
    const CONVENTION: Convention = CONVENTION;
    const AXES: Option<CraftAxes> = Some(CraftAxes::ForwardRightDown);
    const TAKES_BIASES: bool = true;
    const FURTHER_TRIADS: bool = true;
    // Before 2020 a gyro had scale factors too.
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Accel, Numbers::Bias, "CAL_ACC0_{AXIS}OFF"),
        Entry::of(Sensor::Accel, Numbers::LeftDiagonal, "CAL_ACC0_{AXIS}SCALE"),
        Entry::of(Sensor::Gyro, Numbers::Bias, "CAL_GYRO0_{AXIS}OFF"),
        Entry::of(Sensor::Gyro, Numbers::LeftDiagonal, "CAL_GYRO0_{AXIS}SCALE").optional(),
    ];
    // A compass that is not there has a rotation, but no offset.
    #[rustfmt::skip]
    const NOT_READ: &[&str] = &[
        "TC_G0", "TC_A0", "CAL_MAG0", "CAL_ACC1", "CAL_GYRO1", "CAL_ACC2", "CAL_GYRO2", "CAL_ACC3", "CAL_GYRO3",
        "CAL_MAG1_XOFF", "CAL_MAG2_XOFF", "CAL_MAG3_XOFF",
    ];
    const PAGES: &[Page] = &[Page {
        options: "--qgc",
        ..Page::of("PX4, for QGroundControl", "px4.params")
    }];

    /// # Errors
    /// The calibration is missing, a scale factor exceeds PX4's range, an error of `Options::further`, or an error of [`BiasCubics::of`], [`BiasCubics::of_rest`] or `Conversion::of`.
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let n = options.imu - 1;
        let mut export = Export::new::<Self>(from);
        let range_c = match from.biases {
            Some(biases) => Some(biases.range_c),
            None => from
                .calibration()?
                .0
                .temperature
                .as_ref()
                .map(|over| over.range_c),
        };
        let [gyro, accel] = match range_c {
            Some(_) => ["TC_G", "TC_A"],
            None => ["CAL_GYRO", "CAL_ACC"],
        };
        if options.gyro_id.is_none() || options.accel_id.is_none() {
            export.note(format!(
                "Set {gyro}{n}_ID and {accel}{n}_ID to the sensors' device ids if they are missing here: PX4 finds a table by its id only."
            ));
        }
        match range_c {
            Some(range_c) => over_temperature(options, from, range_c, &mut export)?,
            None => at_one_temperature(options, from, &mut export)?,
        }
        further(options, from, &mut export)?;
        if !options.qgc {
            export.note("MAVProxy's `param load` skips changes of less than 1e-6, such as X2 and X3: load this file with another program, or write it for QGroundControl.");
        }
        Ok(options.file(export, from))
    }
}

/// From a recording at rest it writes the same as PX4's own calibration over temperature, which is made at rest too: X0 of a gyro is its bias, X0 of
/// an accelerometer is 0 at TREF. Source: src/modules/temperature_compensation/temperature_calibration/gyro.cpp and accel.cpp,
/// `finish_sensor_instance`.
fn over_temperature(
    options: &Options,
    from: &Sources,
    [from_c, to_c]: [f64; 2],
    export: &mut Export,
) -> Result<()> {
    let n = options.imu - 1;
    if from.biases.is_none() {
        export.note("X0 contains the whole bias. PX4 also subtracts the offsets CAL_GYRO and CAL_ACC: set these to 0, or calibrate there again.");
    }
    options.cubics(from, [from_c, to_c], 0.5 * (from_c + to_c), export)?;
    if let Some(biases) = from.biases {
        export.note(format!("Scale factors stay the flight controller's own (CAL_ACC{n}_XSCALE, _YSCALE, _ZSCALE; a gyro has none): a recording at rest does not show them."));
        if biases.has(Sensor::Gyro) {
            export.note(format!("gyro: X0 is the whole reading at rest. PX4 also subtracts CAL_GYRO{n}_XOFF, _YOFF, _ZOFF: set these to 0, or calibrate the gyro there again."));
            export.remaining.push(Remaining::of_earth_rate());
        }
        if biases.has(Sensor::Accel) {
            export.note("accel: X0 is 0 at TREF, as gravity hides the bias. Calibrate the accelerometer in PX4 after loading this file.");
        }
    }
    for cubics in &export.cubics {
        let id = options.ids()[cubics.sensor];
        parameters_of(cubics, n, id, &mut export.parameters);
    }
    Ok(())
}

fn at_one_temperature(options: &Options, from: &Sources, export: &mut Export) -> Result<()> {
    let n = options.imu - 1;
    export.note("PX4 subtracts TC_* too: set TC_G_ENABLE and TC_A_ENABLE to 0, unless they come from a calibration without these offsets.");
    for of in options.offsets(from, export)? {
        let (sensor, prefix) = match of.triad.kind {
            TriadKind::Gyro => (Sensor::Gyro, "CAL_GYRO"),
            _ => (Sensor::Accel, "CAL_ACC"),
        };
        let id = options.ids()[sensor];
        let id = id.map(|id| Parameter::int32(format!("{prefix}{n}_ID"), id));
        export.parameters.extend(id);
        of.write(&ROWS, &n.to_string(), export)?;
    }
    Ok(())
}

/// Each further triad as the sensor with its number.
fn further(options: &Options, from: &Sources, export: &mut Export) -> Result<()> {
    let all = options.further(from, &COMPASS, MOST, export)?;
    let mut ids = Vec::new();
    for of in all {
        let stem = match of.triad.kind {
            TriadKind::Gyro => "CAL_GYRO",
            TriadKind::Accel => "CAL_ACC",
            TriadKind::Mag => "CAL_MAG",
        };
        let prefix = format!("{stem}{}", of.instance - 1);
        ids.push(format!("{prefix}_ID"));
        of.write(&ROWS, &(of.instance - 1).to_string(), export)?;
        if of.triad.kind == TriadKind::Mag {
            export.note(format!(
                "{}: for an external compass, {prefix}_ROT 100 with {prefix}_ROLL, _PITCH and _YAW sets such a mounting.",
                of.triad
            ));
        }
    }
    if !ids.is_empty() {
        let ids = ids.join(", ");
        export.note(format!("Set {ids} to the sensors' device ids if PX4 has not set them: it finds a calibration by its id only."));
    }
    Ok(())
}

fn parameters_of(cubics: &BiasCubics, n: u8, id: Option<i32>, out: &mut Vec<Parameter>) {
    let letter = cubics.sensor.pick('G', 'A');
    let prefix = format!("TC_{letter}{n}");
    out.push(Parameter::int32(format!("TC_{letter}_ENABLE"), 1));
    out.extend(id.map(|id| Parameter::int32(format!("{prefix}_ID"), id)));
    let limits = [
        ("TMIN", cubics.range_c[0]),
        ("TMAX", cubics.range_c[1]),
        ("TREF", cubics.reference_c),
    ];
    out.extend(limits.map(|(name, c)| Parameter::real(format!("{prefix}_{name}"), c)));
    for power in 0..4 {
        let of = |axis: usize| {
            let name = format!("{prefix}_X{power}_{axis}");
            Parameter::real(name, cubics.coefficients[axis][power])
        };
        out.extend([0, 1, 2].map(of));
    }
}
