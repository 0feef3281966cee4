//! Parameters of ArduPilot.
//!
//! ArduPilot subtracts from each axis of the readings, before its own scale factors, `c(T) - c(CALTEMP)` and then OFFS, where
//! `c = 1e-6 (k1 d + k2 d² + k3 d³)` with `d = T - 35 °C`, T held within TMIN to TMAX, which are within -70 to 80 °C. Source: Copter
//! documentation, "IMU Temperature Calibration"; parameter list, INS_TCAL1_*.

use mimu::calibration::bias_cubic::BiasCubics;
use mimu::quantity::{AXES, Sensor};
use mimu_recording::error::{Error, Result};

use crate::parameters::Parameter;
use crate::{Export, Sources, heading, parameters, px4};

/// Reference temperature, °C.
const REFERENCE_C: f64 = 35.0;
/// Coefficients are so many times those in SI.
const FACTOR: f64 = 1e6;
/// Temperatures that the limits may have, °C.
const RANGE_C: [f64; 2] = [-70.0, 80.0];
/// Largest offset that ArduPilot documents for an accelerometer, m/s².
const MOST_OFFSET: f64 = 3.5;

/// What a person knows of the autopilot.
pub type Options = parameters::Options;

/// Biases over temperature.
///
/// # Errors
/// There is no calibration, or it has no curves; those of [`BiasCubics::of`]; an offset beyond what ArduPilot takes.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let [from_c, to_c] = px4::range_of_curves(calibration, place)?;
    let range_c = [from_c.max(RANGE_C[0]), to_c.min(RANGE_C[1])];
    let mut export = Export::new("ardupilot");
    export.notes.push("ArduPilot measures gyro offsets again at every start (INS_GYR_CAL), at the temperature of that start.".into());
    if range_c != [from_c, to_c] {
        let note = "The range is cut to the -70 to 80 °C that ArduPilot has.";
        export.notes.push(note.into());
    }
    px4::cubics(calibration, options, range_c, REFERENCE_C, &mut export)?;
    parameters_of(&export.cubics, options.imu, &mut export.parameters)?;
    let comments = heading::comments("#", &heading::of_calibration(calibration, &export));
    export.content = options.text(&comments, &export.parameters).into_bytes();
    Ok(export)
}

fn parameters_of(sensors: &[BiasCubics], imu: u8, out: &mut Vec<Parameter>) -> Result<()> {
    let Some(first) = sensors.first() else {
        return Ok(());
    };
    let prefix = format!("INS_TCAL{imu}");
    out.push(Parameter::int8(format!("{prefix}_ENABLE"), 1));
    out.push(Parameter::real(format!("{prefix}_TMIN"), first.range_c[0]));
    out.push(Parameter::real(format!("{prefix}_TMAX"), first.range_c[1]));
    for cubics in sensors {
        let (short, long) = match cubics.sensor {
            Sensor::Gyro => ("GYR", "GYRO"),
            Sensor::Accel => ("ACC", "ACC"),
        };
        for power in 1..4 {
            for (axis, letter) in ["X", "Y", "Z"].iter().enumerate() {
                let name = format!("{prefix}_{short}{power}_{letter}");
                let scaled = FACTOR * cubics.coefficients[axis][power];
                out.push(Parameter::real(name, scaled));
            }
        }
        // Of the first unit PARAMETERS have no number; CALTEMP has one always.
        let offsets = match imu {
            1 => format!("INS_{long}OFFS"),
            imu => format!("INS_{short}{imu}OFFS"),
        };
        let name = format!("INS_{short}{imu}_CALTEMP");
        out.push(Parameter::real(name, cubics.settled_c));
        let settled = cubics.at(cubics.settled_c);
        for (axis, letter) in ["X", "Y", "Z"].iter().enumerate() {
            let offset = settled[axis];
            if cubics.sensor == Sensor::Accel && offset.abs() > MOST_OFFSET {
                return Err(Error::new(
                    format!("accel, axis {}", AXES[axis]),
                    format!(
                        "its bias is {offset:.2} m/s², and {offsets}_{letter} is from -3.5 to 3.5"
                    ),
                    "state with --accel-zero which raw reading the driver takes for no input",
                ));
            }
            out.push(Parameter::real(format!("{offsets}_{letter}"), offset));
        }
    }
    Ok(())
}
