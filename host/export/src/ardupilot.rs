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

use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::BiasCubics;
use mimu::calibration::thermal_biases::ThermalBiases;
use mimu::quantity::Sensor;
use mimu_recording::error::{Argument, Result};

use crate::one_temperature::{self, LETTERS, within};
use crate::parameters::Parameter;
use crate::{Export, Sources, heading, parameters, px4};

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

/// Options of ArduPilot's parameters.
pub type Options = parameters::Options;

/// Parameters for biases over temperature, or for offsets and scale factors at one temperature.
///
/// # Errors
/// The calibration is missing, an offset or a scale factor exceeds ArduPilot's range, or an error of [`BiasCubics::of`], [`BiasCubics::of_rest`] or
/// `Conversion::of`.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let mut export = Export::new("ardupilot", from);
    if let Some(biases) = from.biases {
        return at_rest(biases, options, export);
    }
    let (calibration, _) = from.calibration()?;
    export.notes.push("ArduPilot measures gyro offsets again at every start (INS_GYR_CAL), at the temperature of that start.".into());
    export.notes.push("It accepts an accelerometer as calibrated only if INS_ACC_ID is its device id: give --accel-id, or calibrate there once and then load this file.".into());
    for (sensor, id) in options.ids() {
        let name = format!("INS_{}{}_ID", short(sensor), number(options.imu));
        export
            .parameters
            .extend(id.map(|id| Parameter::int32(name, id)));
    }
    match &calibration.temperature {
        Some(over) => {
            let range_c = cut(over.range_c, &mut export);
            px4::cubics(calibration, options, range_c, REFERENCE_C, &mut export)?;
            parameters_of(&export.cubics, options.imu, &mut export.parameters)?;
        }
        None => at_one_temperature(calibration, options, &mut export)?,
    }
    let comments = heading::comments("#", &heading::of_calibration(calibration, &export));
    export.content = options.text(&comments, &export.parameters).into_bytes();
    Ok(export)
}

/// `range_c`, limited to ArduPilot's range.
fn cut([from_c, to_c]: [f64; 2], export: &mut Export) -> [f64; 2] {
    let range_c = [from_c.max(RANGE_C[0]), to_c.min(RANGE_C[1])];
    if range_c != [from_c, to_c] {
        let note = "The range is limited to ArduPilot's -70 to 80 °C.";
        export.notes.push(note.into());
    }
    range_c
}

/// Writes the coefficients alone. ArduPilot's own calibration over temperature is made at rest too, and does the same: it leaves the offsets to the
/// calibrations at one temperature, with their CALTEMP. Source: libraries/AP_InertialSensor/AP_InertialSensor_tempcal.cpp, `save_calibration`.
fn at_rest(biases: &ThermalBiases, options: &Options, mut export: Export) -> Result<Export> {
    let (imu, n) = (options.imu, number(options.imu));
    let range_c = cut(biases.range_c, &mut export);
    px4::cubics_at_rest(biases, options, range_c, REFERENCE_C, &mut export)?;
    export.notes.push(format!("Scale factors and offsets stay the flight controller's own (INS_ACC{n}SCAL, INS_ACC{n}OFFS): a recording at rest does not show them."));
    if biases.has(Sensor::Accel) {
        export.notes.push(format!("accel: ArduPilot subtracts what the bias has changed by since the temperature INS_ACC{imu}_CALTEMP of its accelerometer calibration. Repeat that calibration after loading this file if the temperature is missing there (-300)."));
    }
    export.notes.push("gyro: its offsets are measured again at every start (INS_GYR_CAL), at the temperature of that start.".into());
    coefficients(&export.cubics, imu, &mut export.parameters);
    let comments = heading::comments("#", &heading::of_biases(biases, &export));
    export.content = options.text(&comments, &export.parameters).into_bytes();
    Ok(export)
}

/// Short name of a sensor in parameter names.
fn short(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Gyro => "GYR",
        Sensor::Accel => "ACC",
    }
}

/// Number of a unit in parameter names; the first unit has none.
fn number(imu: u8) -> String {
    match imu {
        1 => String::new(),
        imu => imu.to_string(),
    }
}

fn at_one_temperature(
    calibration: &Calibration,
    options: &Options,
    export: &mut Export,
) -> Result<()> {
    let imu = options.imu;
    export.notes.push(format!("ArduPilot subtracts INS_TCAL{imu}_* too: set INS_TCAL{imu}_ENABLE to 0, unless they come from a calibration without these offsets."));
    for of in one_temperature::offsets(calibration, options, export)? {
        for (axis, letter) in LETTERS.iter().enumerate() {
            let offset = offset_parameter(of.sensor, axis, imu, of.offset[axis])?;
            export.parameters.push(offset);
            if of.sensor == Sensor::Accel {
                let name = format!("INS_ACC{}SCAL_{letter}", number(imu));
                let remedy = (
                    "give the factor by which the driver converts",
                    Argument::AccelConversion,
                );
                within(of.sensor, axis, (&name, of.scale[axis], ""), SCALES, remedy)?;
                export
                    .parameters
                    .push(Parameter::real(name, of.scale[axis]));
            }
        }
    }
    Ok(())
}

/// Parameter of an offset, SI.
fn offset_parameter(sensor: Sensor, axis: usize, imu: u8, offset: f64) -> Result<Parameter> {
    let (short, number) = (short(sensor), number(imu));
    let name = format!("INS_{short}{number}OFFS_{}", LETTERS[axis]);
    if sensor == Sensor::Accel {
        let range = [-MOST_OFFSET, MOST_OFFSET];
        let remedy = (
            "give the raw reading that the driver treats as zero input",
            Argument::AccelZero,
        );
        within(sensor, axis, (&name, offset, " m/s²"), range, remedy)?;
    }
    Ok(Parameter::real(name, offset))
}

/// Parameters of the temperature range and the coefficients.
fn coefficients(sensors: &[BiasCubics], imu: u8, out: &mut Vec<Parameter>) {
    let Some(first) = sensors.first() else {
        return;
    };
    let prefix = format!("INS_TCAL{imu}");
    out.push(Parameter::int8(format!("{prefix}_ENABLE"), 1));
    out.push(Parameter::real(format!("{prefix}_TMIN"), first.range_c[0]));
    out.push(Parameter::real(format!("{prefix}_TMAX"), first.range_c[1]));
    for cubics in sensors {
        let short = short(cubics.sensor);
        for power in 1..4 {
            for (axis, letter) in LETTERS.iter().enumerate() {
                let name = format!("{prefix}_{short}{power}_{letter}");
                let scaled = FACTOR * cubics.coefficients[axis][power];
                out.push(Parameter::real(name, scaled));
            }
        }
    }
}

fn parameters_of(sensors: &[BiasCubics], imu: u8, out: &mut Vec<Parameter>) -> Result<()> {
    coefficients(sensors, imu, out);
    for cubics in sensors {
        let Some(settled_c) = cubics.settled_c else {
            continue;
        };
        let short = short(cubics.sensor);
        // CALTEMP of the first unit has its number; offsets of the first unit have none.
        let name = format!("INS_{short}{imu}_CALTEMP");
        out.push(Parameter::real(name, settled_c));
        let settled = cubics.at(settled_c);
        for axis in 0..3 {
            out.push(offset_parameter(cubics.sensor, axis, imu, settled[axis])?);
        }
    }
    Ok(())
}
