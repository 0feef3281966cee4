//! Parameters of ArduPilot.
//!
//! Before its own scale factors, ArduPilot subtracts `c(T) - c(CALTEMP)` and then OFFS from each axis of the readings, where
//! `c = 1e-6 (k1 d + k2 d² + k3 d³)` with `d = T - 35 °C`. T is clamped to TMIN to TMAX, which lie within -70 to 80 °C. Source: Copter
//! documentation, "IMU Temperature Calibration"; parameter list, INS_TCAL1_*.
//!
//! A calibration at one temperature becomes INS_ACCOFFS, INS_ACCSCAL and INS_GYROFFS (for the other units INS_ACC2OFFS, INS_ACC2SCAL, INS_GYR2OFFS
//! and so on). ArduPilot computes `(accel - offset) * scale` and `gyro - offset` after the rotation of the sensor and before that of the board, x
//! forward, y right, z down. Source: libraries/AP_InertialSensor/AP_InertialSensor_Backend.cpp, `_rotate_and_correct_accel` and `_gyro`;
//! AP_InertialSensor.cpp for names and ranges.
//!
//! A magnetometer becomes COMPASS_OFS, in milligauss, which ArduPilot adds, and the symmetric matrix of COMPASS_DIA and COMPASS_ODI (COMPASS_OFS2 and so on for
//! the second): `matrix * ((mag + offsets) * COMPASS_SCALE)`, after the rotation of its mounting, which those numbers depend on. Source:
//! libraries/AP_Compass/AP_Compass_Backend.cpp, `correct_field`; AP_Compass.cpp for names and units; CompassCalibrator.cpp, `fit_acceptable`, for ranges.

use mimu::quantity::Sensor;
use mimu_recording::{Argument, Result, TriadKind};
use nalgebra::Matrix3;

use crate::convention::{Bias, Convention, Shape};
use crate::craft_axes::CraftAxes;
use crate::driver::name_of;
use crate::layout::{Entry, Numbers};
use crate::parameters::{
    CONVENTION, Compass, FurtherTriad, GIVE_FACTOR, LETTERS, Options, Parameter, Remedy, Row, What,
};
use crate::{Export, Page, Sources, Target};

/// Reference temperature, °C.
const REFERENCE_C: f64 = 35.0;
/// Factor between ArduPilot's coefficients and those in SI.
const FACTOR: f64 = 1e6;
/// Range of the temperature limits, °C.
const RANGE_C: [f64; 2] = [-70.0, 80.0];
/// Largest offset that ArduPilot documents for an accelerometer, m/s².
const MOST_OFFSET: f64 = 3.5;
/// Range of an accelerometer's scale factors that it documents.
const SCALES: [f64; 2] = [0.8, 1.2];

/// Its parameters of each axis.
const ROWS: [Row; 6] = {
    const fn row(kind: TriadKind, what: What, name: &'static str) -> Row {
        let range = match (kind, what) {
            (TriadKind::Accel, What::Offset) => {
                let most = [-MOST_OFFSET, MOST_OFFSET];
                Some((most, 3, " m/s²", GIVE_ZERO))
            }
            (TriadKind::Accel, _) => Some((SCALES, 3, "", GIVE_FACTOR)),
            (TriadKind::Mag, What::Offset) => {
                let most = [-MOST_COMPASS_OFFSET, MOST_COMPASS_OFFSET];
                Some((most, 0, " mG", GIVE_COMPASS_FACTOR))
            }
            (TriadKind::Mag, What::Scale) => Some((SOFT_IRON[0], 3, "", GIVE_COMPASS_FACTOR)),
            (TriadKind::Mag, _) => Some((SOFT_IRON[1], 3, "", GIVE_COMPASS_FACTOR)),
            (TriadKind::Gyro, _) => None,
        };
        Row {
            kind,
            what,
            name,
            range,
        }
    }
    [
        row(TriadKind::Gyro, What::Offset, "INS_GYR{n}OFFS_{axis}"),
        row(TriadKind::Accel, What::Offset, "INS_ACC{n}OFFS_{axis}"),
        row(TriadKind::Accel, What::Scale, "INS_ACC{n}SCAL_{axis}"),
        row(TriadKind::Mag, What::Offset, "COMPASS_OFS{n}_{axis}"),
        row(TriadKind::Mag, What::Scale, "COMPASS_DIA{n}_{axis}"),
        row(TriadKind::Mag, What::Beside, "COMPASS_ODI{n}_{axis}"),
    ]
};
/// What to do about an offset of an accelerometer, and about the numbers of a compass.
const GIVE_ZERO: Remedy = (
    "give the raw reading that the driver treats as zero input",
    Argument::AccelZero,
);
const GIVE_COMPASS_FACTOR: Remedy = (GIVE_FACTOR.0, Argument::MagConversion);

/// Inertial units, and magnetometers.
const MOST: u8 = 3;
/// Its magnetometers.
const COMPASS: Compass = Compass {
    unit: ("milligauss", 10.0),
    convention: Convention::to_input(Shape::RotationSymmetric, Bias::AddedToReadings),
    formula: "S (v + OFS)",
    symmetric: "S = [[DIA_X, ODI_X, ODI_Y], [ODI_X, DIA_Y, ODI_Z], [ODI_Y, ODI_Z, DIA_Z]]",
};
/// Largest COMPASS_OFFS_MAX, mG.
const MOST_COMPASS_OFFSET: f64 = 3000.0;
/// Its default, mG.
const USUAL_COMPASS_OFFSET: f64 = 1800.0;
/// Elements of its matrices that it accepts, on the diagonal and beside it.
const SOFT_IRON: [[f64; 2]; 2] = [[0.2, 5.0], [-1.0, 1.0]];

/// The format.
pub struct ArduPilot;

impl Target for ArduPilot {
    type Options = Options;
    const NAME: &str = "ardupilot";
    const ABOUT: &str = "Parameters of ArduPilot: INS_TCAL* over temperature, INS_ACCOFFS, INS_ACCSCAL and INS_GYROFFS at one";
    const CONTENTS: &str = "biases over temperature, or biases and scale factors at one temperature; magnetometers, further units";
    const READERS: &str = "ArduPilot";
    const CONVENTION: Convention = CONVENTION;
    const AXES: Option<CraftAxes> = Some(CraftAxes::ForwardRightDown);
    const TAKES_BIASES: bool = true;
    const FURTHER_TRIADS: bool = true;
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Accel, Numbers::Bias, "INS_ACCOFFS_{AXIS}"),
        Entry::of(Sensor::Accel, Numbers::LeftDiagonal, "INS_ACCSCAL_{AXIS}"),
        Entry::of(Sensor::Gyro, Numbers::Bias, "INS_GYROFFS_{AXIS}"),
    ];
    #[rustfmt::skip]
    const NOT_READ: &[&str] = &[
        "INS_TCAL1", "COMPASS_OFS", "INS_ACC2OFFS", "INS_ACC3OFFS", "INS_GYR2OFFS", "INS_GYR3OFFS",
    ];
    const PAGES: &[Page] = &[Page::of("ArduPilot", "ardupilot.parm")];

    /// # Errors
    /// The calibration is missing, an offset or a scale factor exceeds ArduPilot's range, an error of `Options::further`, or an error of `BiasCubics::of`, `BiasCubics::of_rest` or
    /// `Conversion::of`.
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let mut export = Export::new::<Self>(from);
        if let Some(biases) = from.biases {
            over_temperature(options, from, biases.range_c, &mut export)?;
            at_rest(options, biases.has(Sensor::Accel), &mut export);
            return Ok(options.file(export, from));
        }
        let (calibration, _) = from.calibration()?;
        export.note("ArduPilot measures gyro offsets again at every start (INS_GYR_CAL), at the temperature of that start.");
        export.note("It accepts an accelerometer as calibrated only if INS_ACC_ID is its device id: give --accel-id, or calibrate there once and then load this file.");
        for (sensor, id) in options.ids() {
            let id = id.map(|id| Parameter::int32(name(options.imu, sensor, "_ID"), id));
            export.parameters.extend(id);
        }
        match &calibration.temperature {
            Some(over) => {
                over_temperature(options, from, over.range_c, &mut export)?;
                settled(options, &mut export)?;
            }
            None => at_one_temperature(options, from, &mut export)?,
        }
        for of in options.further(from, &COMPASS, MOST, &mut export)? {
            further(&of, &mut export)?;
        }
        Ok(options.file(export, from))
    }
}

/// Number of an instance in a name. The first has none.
fn number(instance: u8) -> String {
    match instance {
        1 => String::new(),
        instance => instance.to_string(),
    }
}

/// Name of a parameter of a sensor of this inertial unit.
fn name(imu: u8, sensor: Sensor, what: &str) -> String {
    format!("INS_{}{}{what}", short(sensor), number(imu))
}

/// Cubics and their parameters, over a range that is limited to ArduPilot's.
fn over_temperature(
    options: &Options,
    from: &Sources,
    [from_c, to_c]: [f64; 2],
    export: &mut Export,
) -> Result<()> {
    let range_c = [from_c.max(RANGE_C[0]), to_c.min(RANGE_C[1])];
    if range_c != [from_c, to_c] {
        export.note("The range is limited to ArduPilot's -70 to 80 °C.");
    }
    options.cubics(from, range_c, REFERENCE_C, export)?;
    let Some(first) = export.cubics.first() else {
        return Ok(());
    };
    let out = &mut export.parameters;
    let prefix = format!("INS_TCAL{}", options.imu);
    out.push(Parameter::int8(format!("{prefix}_ENABLE"), 1));
    out.push(Parameter::real(format!("{prefix}_TMIN"), first.range_c[0]));
    out.push(Parameter::real(format!("{prefix}_TMAX"), first.range_c[1]));
    for cubics in &export.cubics {
        let short = short(cubics.sensor);
        for power in 1..4 {
            for (axis, letter) in LETTERS.iter().enumerate() {
                let name = format!("{prefix}_{short}{power}_{letter}");
                let scaled = FACTOR * cubics.coefficients[axis][power];
                out.push(Parameter::real(name, scaled));
            }
        }
    }
    Ok(())
}

/// Notes on coefficients alone. ArduPilot's own calibration over temperature is made at rest too, and writes the same: it leaves the offsets to the
/// calibrations at one temperature, with their CALTEMP. Source: libraries/AP_InertialSensor/AP_InertialSensor_tempcal.cpp, `save_calibration`.
fn at_rest(options: &Options, accel: bool, export: &mut Export) {
    let (imu, acc) = (options.imu, name(options.imu, Sensor::Accel, ""));
    export.note(format!("Scale factors and offsets stay the flight controller's own ({acc}SCAL, {acc}OFFS): a recording at rest does not show them."));
    if accel {
        export.note(format!("accel: ArduPilot subtracts what the bias has changed by since the temperature INS_ACC{imu}_CALTEMP of its accelerometer calibration. Repeat that calibration after loading this file if the temperature is missing there (-300)."));
    }
    export.note("gyro: its offsets are measured again at every start (INS_GYR_CAL), at the temperature of that start.");
}

/// Offsets at the temperature of the calibration. CALTEMP of the first unit has its number; offsets of the first unit have none.
fn settled(options: &Options, export: &mut Export) -> Result<()> {
    let offset = |row: &&Row| row.what == What::Offset;
    for cubics in export.cubics.clone() {
        let Some(settled_c) = cubics.settled_c else {
            continue;
        };
        let name = format!("INS_{}{}_CALTEMP", short(cubics.sensor), options.imu);
        export.parameters.push(Parameter::real(name, settled_c));
        let settled = FurtherTriad {
            triad: name_of(cubics.sensor),
            instance: options.imu,
            offset: cubics.at(settled_c),
            scale: Matrix3::identity(),
        };
        settled.write(ROWS.iter().filter(offset), &number(options.imu), export)?;
    }
    Ok(())
}

fn at_one_temperature(options: &Options, from: &Sources, export: &mut Export) -> Result<()> {
    let imu = options.imu;
    export.note(format!("ArduPilot subtracts INS_TCAL{imu}_* too: set INS_TCAL{imu}_ENABLE to 0, unless they come from a calibration without these offsets."));
    for of in options.offsets(from, export)? {
        of.write(&ROWS, &number(of.instance), export)?;
    }
    Ok(())
}

/// A further triad.
fn further(of: &FurtherTriad, export: &mut Export) -> Result<()> {
    let n = number(of.instance);
    of.write(&ROWS, &n, export)?;
    if of.triad.kind != TriadKind::Mag {
        return Ok(());
    }
    let scale = Parameter::real(format!("COMPASS_SCALE{n}"), 1.0);
    export.parameters.push(scale);
    let name = of.triad;
    if of.offset.amax() > USUAL_COMPASS_OFFSET {
        export.note(format!(
            "{name}: an offset exceeds 1800 mG: ArduPilot arms only with a larger COMPASS_OFFS_MAX."
        ));
    }
    export.note(format!("{name}: the numbers are for the readings after the rotation of its mounting (COMPASS_ORIENT{n}, AHRS_ORIENTATION). ArduPilot takes a compass for calibrated only if COMPASS_DEV_ID{n} is its id: calibrate there once, then load this file, with COMPASS_LEARN 0."));
    Ok(())
}

/// Short name of a sensor in parameter names.
fn short(sensor: Sensor) -> &'static str {
    sensor.pick("GYR", "ACC")
}
