//! Parameters of ArduPilot.
//!
//! Before its own scale factors, ArduPilot subtracts `c(T) - c(CALTEMP)` and then OFFS from each axis of the readings, where
//! `c = 1e-6 (k1 d + k2 d² + k3 d³)` with `d = T - 35 °C`. T is clamped to TMIN to TMAX, which lie within -70 to 80 °C. Source: Copter
//! documentation, "IMU Temperature Calibration"; parameter list, INS_TCAL1_*.
//!
//! A calibration at one temperature becomes INS_ACCOFFS, INS_ACCSCAL and INS_GYROFFS (for the other units INS_ACC2OFFS, INS_ACC2SCAL, INS_GYR2OFFS
//! and so on). ArduPilot computes `(accel - offset) * scale` and `gyro - offset` after the rotation of the sensor and before that of the board.
//! Source: libraries/AP_InertialSensor/AP_InertialSensor_Backend.cpp, `_rotate_and_correct_accel` and `_gyro`; AP_InertialSensor.cpp for names and
//! ranges.

use mimu::quantity::Sensor;
use mimu_recording::error::{Argument, Result};

use crate::convention::{Convention, within};
use crate::parameters::{CONVENTION, GIVE_FACTOR, LETTERS, Options, Parameter};
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

/// The format.
pub struct ArduPilot;

impl Target for ArduPilot {
    type Options = Options;
    const NAME: &str = "ardupilot";
    const ABOUT: &str = "Parameters of ArduPilot: INS_TCAL* over temperature, INS_ACCOFFS, INS_ACCSCAL and INS_GYROFFS at one";
    const CONTENTS: &str =
        "biases over temperature, or biases and scale factors at one temperature";
    const READERS: &str = "ArduPilot";
    const CONVENTION: Convention = CONVENTION;
    const TAKES_BIASES: bool = true;
    const PAGES: &[Page] = &[Page::of("ArduPilot", "ardupilot.parm")];

    /// # Errors
    /// The calibration is missing, an offset or a scale factor exceeds ArduPilot's range, or an error of `BiasCubics::of`, `BiasCubics::of_rest` or
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
            let id = id.map(|id| Parameter::int32(name(options, sensor, "_ID"), id));
            export.parameters.extend(id);
        }
        match &calibration.temperature {
            Some(over) => {
                over_temperature(options, from, over.range_c, &mut export)?;
                settled(options, &mut export)?;
            }
            None => at_one_temperature(options, from, &mut export)?,
        }
        Ok(options.file(export, from))
    }
}

/// Name of a parameter of a sensor. The first unit has no number.
fn name(options: &Options, sensor: Sensor, what: &str) -> String {
    let number = match options.imu {
        1 => String::new(),
        imu => imu.to_string(),
    };
    format!("INS_{}{number}{what}", short(sensor))
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
    let (imu, acc) = (options.imu, name(options, Sensor::Accel, ""));
    export.note(format!("Scale factors and offsets stay the flight controller's own ({acc}SCAL, {acc}OFFS): a recording at rest does not show them."));
    if accel {
        export.note(format!("accel: ArduPilot subtracts what the bias has changed by since the temperature INS_ACC{imu}_CALTEMP of its accelerometer calibration. Repeat that calibration after loading this file if the temperature is missing there (-300)."));
    }
    export.note("gyro: its offsets are measured again at every start (INS_GYR_CAL), at the temperature of that start.");
}

/// Offsets at the temperature of the calibration. CALTEMP of the first unit has its number; offsets of the first unit have none.
fn settled(options: &Options, export: &mut Export) -> Result<()> {
    for cubics in &export.cubics {
        let Some(settled_c) = cubics.settled_c else {
            continue;
        };
        let name = format!("INS_{}{}_CALTEMP", short(cubics.sensor), options.imu);
        export.parameters.push(Parameter::real(name, settled_c));
        let settled = cubics.at(settled_c);
        for axis in 0..3 {
            let offset = offset(options, cubics.sensor, axis, settled[axis])?;
            export.parameters.push(offset);
        }
    }
    Ok(())
}

fn at_one_temperature(options: &Options, from: &Sources, export: &mut Export) -> Result<()> {
    let imu = options.imu;
    export.note(format!("ArduPilot subtracts INS_TCAL{imu}_* too: set INS_TCAL{imu}_ENABLE to 0, unless they come from a calibration without these offsets."));
    for (sensor, offsets, scale) in options.offsets(from, export)? {
        for (i, letter) in LETTERS.iter().enumerate() {
            export
                .parameters
                .push(offset(options, sensor, i, offsets[i])?);
            if sensor == Sensor::Accel {
                let name = name(options, sensor, &format!("SCAL_{letter}"));
                within((sensor, i), &name, (scale[i], 3, ""), SCALES, GIVE_FACTOR)?;
                export.parameters.push(Parameter::real(name, scale[i]));
            }
        }
    }
    Ok(())
}

/// Parameter of an offset, SI.
fn offset(options: &Options, sensor: Sensor, axis: usize, offset: f64) -> Result<Parameter> {
    let name = name(options, sensor, &format!("OFFS_{}", LETTERS[axis]));
    if sensor == Sensor::Accel {
        let range = [-MOST_OFFSET, MOST_OFFSET];
        let remedy = (
            "give the raw reading that the driver treats as zero input",
            Argument::AccelZero,
        );
        within((sensor, axis), &name, (offset, 3, " m/s²"), range, remedy)?;
    }
    Ok(Parameter::real(name, offset))
}

/// Short name of a sensor in parameter names.
fn short(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Gyro => "GYR",
        Sensor::Accel => "ACC",
    }
}
