//! Biases over temperature as parameters of PX4 and of ArduPilot.
//!
//! Both subtract from each axis of the readings, before their own scale factors, a cubic of the temperature that their thermometer
//! shows, held outside a range:
//!
//! | | PX4 | ArduPilot |
//! |---|---|---|
//! | subtracted | `X0 + X1 d + X2 d² + X3 d³` | `c(T) - c(CALTEMP)`, then `OFFS`; `c = 1e-6 (k1 d + k2 d² + k3 d³)` |
//! | d | T - TREF | T - 35 °C |
//! | range | TMIN to TMAX | TMIN to TMAX, within -70 to 80 °C |
//! | source | PX4 User Guide, "Thermal Calibration and Compensation"; parameter reference, TC_* | Copter documentation, "IMU Temperature Calibration"; parameter list, INS_TCAL1_* |

use std::fmt::Write as _;

use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::{BiasCubics, KnownConversion, Remainder};
use mimu::quantity::{AXES, Sensor};
use mimu::readable;
use mimu_recording::error::{Error, Result};
use serde::Serialize;

/// Reference temperature of ArduPilot, °C.
const ARDUPILOT_REFERENCE_C: f64 = 35.0;
/// Coefficients of ArduPilot are so many times those in SI.
const ARDUPILOT_FACTOR: f64 = 1e6;
/// Temperatures that ArduPilot's limits may have, °C.
const ARDUPILOT_RANGE_C: [f64; 2] = [-70.0, 80.0];
/// Largest offset that ArduPilot documents for an accelerometer, m/s².
const ARDUPILOT_MOST_OFFSET: f64 = 3.5;

/// Whose parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Autopilot {
    /// PX4: `TC_*`.
    Px4,
    /// ArduPilot: `INS_TCAL*`.
    ArduPilot,
}

/// How a file of parameters is laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// `NAME,VALUE`, as MAVProxy, pymavlink and Mission Planner read it.
    Pairs,
    /// Vehicle, component, name, value and type, between tabs, as QGroundControl reads it.
    QGroundControl,
}

/// What a person knows of the autopilot.
#[derive(Debug, Clone, PartialEq)]
pub struct AutopilotOptions {
    /// Whose parameters.
    pub autopilot: Autopilot,
    /// Layout of the file.
    pub layout: Layout,
    /// Number of the inertial unit in the autopilot, from 1.
    pub imu: u8,
    /// Numbers by which PX4 knows gyro and accelerometer.
    pub device_ids: [Option<u32>; 2],
    /// How its drivers convert the readings of gyro and accelerometer.
    pub conversions: [KnownConversion; 2],
}

/// A parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// As the autopilot knows it.
    pub name: String,
    /// Value, in single precision unless whole.
    pub value: f64,
    /// MAVLink's type of it: 2 is INT8, 6 INT32, 9 REAL32.
    #[serde(skip)]
    kind: u8,
}

/// Parameters and what they leave.
#[derive(Debug, Clone, Serialize)]
pub struct AutopilotExport {
    /// `mimu-export/1`.
    pub format: &'static str,
    /// `px4` or `ardupilot`.
    pub program: &'static str,
    /// File that was written.
    pub file: String,
    /// In the order of the file.
    pub parameters: Vec<Parameter>,
    /// Cubics of each triad.
    pub sensors: Vec<BiasCubics>,
    /// What a person has to know or to do.
    pub notes: Vec<String>,
}

impl Parameter {
    fn real(name: String, value: f64) -> Self {
        let value = f64::from(value as f32);
        Self {
            name,
            value,
            kind: 9,
        }
    }

    fn whole(name: String, value: u32, kind: u8) -> Self {
        Self {
            name,
            value: f64::from(value),
            kind,
        }
    }

    /// The shortest decimals, without an exponent, that are this number in single precision.
    fn text(&self) -> String {
        match self.kind {
            9 => (self.value as f32).to_string(),
            _ => self.value.to_string(),
        }
    }
}

/// Parameters of `calibration` for an autopilot; `file` is where they go.
///
/// # Errors
/// A calibration without curves over temperature; those of [`BiasCubics::of`]; an offset beyond what the autopilot takes.
pub fn autopilot(
    calibration: &Calibration,
    options: &AutopilotOptions,
    file: String,
) -> Result<(AutopilotExport, String)> {
    let Some(over) = &calibration.temperature else {
        return Err(Error::new(
            "--calibration",
            "it holds for one temperature: there are no curves",
            "fit recordings over temperature with `mimu thermal fit`",
        ));
    };
    let [from, to] = over.range_c;
    let (program, range_c, reference_c) = match options.autopilot {
        Autopilot::Px4 => ("px4", [from, to], 0.5 * (from + to)),
        Autopilot::ArduPilot => {
            let [least, most] = ARDUPILOT_RANGE_C;
            let range_c = [from.max(least), to.min(most)];
            ("ardupilot", range_c, ARDUPILOT_REFERENCE_C)
        }
    };
    let (mut sensors, mut parameters) = (Vec::new(), Vec::new());
    let mut notes = notes(options, range_c != over.range_c);
    for sensor in Sensor::BOTH {
        let known = &options.conversions[sensor as usize];
        match BiasCubics::of(calibration, sensor, known, range_c, reference_c)? {
            Some(cubics) => sensors.push(cubics),
            None => notes.push(format!(
                "The calibration has no curves of the {sensor}: none are written."
            )),
        }
    }
    if !calibration.effects().is_empty() {
        notes.push("The effects of the calibration are left out: they have no place here.".into());
    }
    match options.autopilot {
        Autopilot::Px4 => sensors
            .iter()
            .for_each(|c| px4(c, options, &mut parameters)),
        Autopilot::ArduPilot => ardupilot(&sensors, options, &mut parameters)?,
    }
    let export = AutopilotExport {
        format: "mimu-export/1",
        program,
        file,
        parameters,
        sensors,
        notes,
    };
    let text = text(calibration, &export, options.layout);
    Ok((export, text))
}

fn px4(cubics: &BiasCubics, options: &AutopilotOptions, out: &mut Vec<Parameter>) {
    let letter = match cubics.sensor {
        Sensor::Gyro => 'G',
        Sensor::Accel => 'A',
    };
    let prefix = format!("TC_{letter}{}", options.imu - 1);
    out.push(Parameter::whole(format!("TC_{letter}_ENABLE"), 1, 6));
    if let Some(id) = options.device_ids[cubics.sensor as usize] {
        out.push(Parameter::whole(format!("{prefix}_ID"), id, 6));
    }
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

fn ardupilot(
    sensors: &[BiasCubics],
    options: &AutopilotOptions,
    out: &mut Vec<Parameter>,
) -> Result<()> {
    let Some(first) = sensors.first() else {
        return Ok(());
    };
    let prefix = format!("INS_TCAL{}", options.imu);
    out.push(Parameter::whole(format!("{prefix}_ENABLE"), 1, 2));
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
                let scaled = ARDUPILOT_FACTOR * cubics.coefficients[axis][power];
                out.push(Parameter::real(name, scaled));
            }
        }
        let offsets = match options.imu {
            1 => format!("INS_{long}OFFS"),
            imu => format!("INS_{short}{imu}OFFS"),
        };
        let settled = cubics.at(cubics.settled_c);
        let name = format!("INS_{short}{}_CALTEMP", options.imu);
        out.push(Parameter::real(name, cubics.settled_c));
        for (axis, letter) in ["X", "Y", "Z"].iter().enumerate() {
            let offset = settled[axis];
            if cubics.sensor == Sensor::Accel && offset.abs() > ARDUPILOT_MOST_OFFSET {
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

fn notes(options: &AutopilotOptions, clipped: bool) -> Vec<String> {
    let mut notes = vec![
        "Axes are those of the recording, which have to be those of the sensor in the autopilot, and readings are converted as given below."
            .to_owned(),
    ];
    match options.autopilot {
        Autopilot::Px4 => {
            if options.device_ids.iter().any(Option::is_none) {
                let n = options.imu - 1;
                notes.push(format!(
                    "Set TC_G{n}_ID and TC_A{n}_ID to the sensors' device ids where they are not here: PX4 uses a table by its id only."
                ));
            }
            notes.push("X0 holds the whole bias: PX4 subtracts CAL_GYRO and CAL_ACC offsets beside it, so set these to 0 or calibrate there again.".into());
            if options.layout == Layout::Pairs {
                notes.push("MAVProxy's `param load` leaves out what changes by less than 1e-6, as X2 and X3 do: load this file by another program, or write it for QGroundControl.".into());
            }
        }
        Autopilot::ArduPilot => {
            notes.push("ArduPilot measures gyro offsets again at every start (INS_GYR_CAL), at the temperature of that start.".into());
            if clipped {
                notes.push("The range is cut to the -70 to 80 °C that ArduPilot has.".into());
            }
        }
    }
    notes
}

fn text(calibration: &Calibration, export: &AutopilotExport, layout: Layout) -> String {
    let mut out = format!(
        "# {}: biases over temperature, by mimu {}.\n",
        calibration.device,
        env!("CARGO_PKG_VERSION")
    );
    for line in said(export) {
        let _ = writeln!(out, "# {line}");
    }
    for parameter in &export.parameters {
        let (name, value, kind) = (&parameter.name, parameter.text(), parameter.kind);
        let _ = match layout {
            Layout::Pairs => writeln!(out, "{name},{value}"),
            Layout::QGroundControl => writeln!(out, "1\t1\t{name}\t{value}\t{kind}"),
        };
    }
    out
}

/// What a person has to know, line by line: for the file and for the terminal.
pub fn said(export: &AutopilotExport) -> Vec<String> {
    let mut lines = export.notes.clone();
    for cubics in &export.sensors {
        let [from, to] = cubics.range_c;
        let conversion = |values: [f64; 3]| {
            let values = values.map(|v| format!("{v:.6}"));
            values.join(", ")
        };
        lines.push(format!(
            "{}: {from:.1} to {to:.1} °C about {:.1} °C; reading = [{}] (raw - [{}]) {}",
            cubics.sensor,
            cubics.reference_c,
            conversion(cubics.conversion.si_per_raw),
            conversion(cubics.conversion.zero_raw),
            cubics.unit,
        ));
        lines.push(format!(
            "{}: error that remains, with scale factors as they are at {:.1} °C:",
            cubics.sensor, cubics.settled_c
        ));
        lines.extend(cubics.remains.iter().map(|r| remainder(r, cubics)));
    }
    lines
}

fn remainder(remainder: &Remainder, cubics: &BiasCubics) -> String {
    let readable = readable::parameter(cubics.unit);
    let (source, condition) = (remainder.source, remainder.condition);
    match (remainder.rms, remainder.max) {
        (Some(rms), Some(max)) => format!(
            "  {source}, {condition}: rms {}, at most {}",
            readable.write(rms),
            readable.write(max)
        ),
        _ => format!("  {source}: not known, {condition}"),
    }
}
