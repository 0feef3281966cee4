//! Parameters of PX4.
//!
//! Before its own scale factors, PX4 subtracts a cubic of its thermometer's temperature from each axis of the readings: `X0 + X1 d + X2 d² + X3 d³`
//! with `d = T - TREF`, where T is clamped to TMIN to TMAX. Source: PX4 User Guide, "Thermal Calibration and Compensation"; parameter reference,
//! TC_*.
//!
//! A calibration at one temperature becomes CAL_ACCn_XOFF, CAL_ACCn_XSCALE and CAL_GYROn_XOFF, n from 0. PX4 computes `(data - thermal_offset -
//! offset) * scale` for an accelerometer and `data - thermal_offset - offset` for a gyro, which has no scale there. Source:
//! src/lib/sensor_calibration/Accelerometer.hpp and Gyroscope.hpp, `Correct`; src/modules/sensors/module.yaml.

use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::{BiasCubics, KnownConversion};
use mimu::calibration::thermal_biases::ThermalBiases;
use mimu::quantity::Sensor;
use mimu_recording::error::{Argument, Result};

use crate::one_temperature::{self, LETTERS, Offsets, within};
use crate::parameters::Parameter;
use crate::remaining::Remaining;
use crate::{Export, Sources, heading, judged, parameters, remaining};

/// Options of PX4's parameters.
pub type Options = parameters::Options;

const AXES_OF_THE_RECORDING: &str =
    "Axes are those of the recording; they have to be those of the sensor in the autopilot.";

/// Range of PX4's scale factors of an accelerometer.
const SCALES: [f64; 2] = [0.1, 3.0];

/// Parameters for biases over temperature, or for offsets and scale factors at one temperature.
///
/// # Errors
/// The calibration is missing, a scale factor exceeds PX4's range, or an error of [`BiasCubics::of`], [`BiasCubics::of_rest`] or `Conversion::of`.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let mut export = Export::new("px4", from);
    let head = if let Some(biases) = from.biases {
        needs_ids(options, ["TC_G", "TC_A"], &mut export);
        at_rest(biases, options, &mut export)?;
        loaded_by(options, &mut export);
        heading::of_biases(biases, &export)
    } else {
        let (calibration, _) = from.calibration()?;
        match &calibration.temperature {
            Some(over) => {
                needs_ids(options, ["TC_G", "TC_A"], &mut export);
                over_temperature(calibration, options, over.range_c, &mut export)?;
            }
            None => {
                needs_ids(options, ["CAL_GYRO", "CAL_ACC"], &mut export);
                at_one_temperature(calibration, options, &mut export)?;
            }
        }
        loaded_by(options, &mut export);
        heading::of_calibration(calibration, &export)
    };
    let comments = heading::comments("#", &head);
    export.content = options.text(&comments, &export.parameters).into_bytes();
    Ok(export)
}

fn needs_ids(options: &Options, [gyro, accel]: [&str; 2], export: &mut Export) {
    if options.gyro_id.is_none() || options.accel_id.is_none() {
        let n = options.imu - 1;
        export.notes.push(format!(
            "Set {gyro}{n}_ID and {accel}{n}_ID to the sensors' device ids if they are missing here: PX4 finds a table by its id only."
        ));
    }
}

fn loaded_by(options: &Options, export: &mut Export) {
    if !options.qgc {
        export.notes.push("MAVProxy's `param load` skips changes of less than 1e-6, such as X2 and X3: load this file with another program, or write it for QGroundControl.".into());
    }
}

/// Writes the same as PX4's own calibration over temperature, which is made at rest too: X0 of a gyro is its bias, X0 of an accelerometer is 0 at
/// TREF. Source: src/modules/temperature_compensation/temperature_calibration/gyro.cpp and accel.cpp, `finish_sensor_instance`.
fn at_rest(biases: &ThermalBiases, options: &Options, export: &mut Export) -> Result<()> {
    let n = options.imu - 1;
    let [from_c, to_c] = biases.range_c;
    cubics_at_rest(
        biases,
        options,
        [from_c, to_c],
        0.5 * (from_c + to_c),
        export,
    )?;
    export.notes.push(format!("Scale factors stay the flight controller's own (CAL_ACC{n}_XSCALE, _YSCALE, _ZSCALE; a gyro has none): a recording at rest does not show them."));
    if biases.has(Sensor::Gyro) {
        export.notes.push(format!("gyro: X0 is the whole reading at rest. PX4 also subtracts CAL_GYRO{n}_XOFF, _YOFF, _ZOFF: set these to 0, or calibrate the gyro there again."));
        export.remaining.push(Remaining::of_earth_rate());
    }
    if biases.has(Sensor::Accel) {
        export.notes.push("accel: X0 is 0 at TREF, as gravity hides the bias. Calibrate the accelerometer in PX4 after loading this file.".into());
    }
    let ids = options.ids();
    for cubics in &export.cubics {
        let id = ids[cubics.sensor];
        parameters_of(cubics, options.imu, id, &mut export.parameters);
    }
    Ok(())
}

/// Changes of each sensor's readings at rest as cubics. The remaining errors are added to `export`.
pub(crate) fn cubics_at_rest(
    biases: &ThermalBiases,
    options: &parameters::Options,
    range_c: [f64; 2],
    reference_c: f64,
    export: &mut Export,
) -> Result<()> {
    each_sensor(
        options,
        export,
        |sensor, known| BiasCubics::of_rest(biases, sensor, known, range_c, reference_c),
        |sensor| format!("The recording has no readings of the {sensor}: none are written."),
    )?;
    for cubics in &export.cubics {
        let rms = biases.rms[cubics.sensor];
        let error = rms.map(|rms| judged::error_of_curves(cubics, rms));
        export.calibration_errors.extend(error);
    }
    Ok(())
}

/// Adds the cubics that `of` finds for a sensor, or the note `none` where it finds none.
fn each_sensor(
    options: &parameters::Options,
    export: &mut Export,
    of: impl Fn(Sensor, &KnownConversion) -> Result<Option<BiasCubics>>,
    none: impl Fn(Sensor) -> String,
) -> Result<()> {
    let mut conversions = options.driver.conversions();
    export.notes.push(AXES_OF_THE_RECORDING.into());
    for sensor in Sensor::BOTH {
        let known = std::mem::take(&mut conversions[sensor]);
        match of(sensor, &known)? {
            Some(cubics) => add(cubics, export),
            None => export.notes.push(none(sensor)),
        }
    }
    Ok(())
}

/// Adds `cubics` with their formula and remaining errors.
fn add(cubics: BiasCubics, export: &mut Export) {
    if let Some(settled_c) = cubics.settled_c {
        export.notes.push(format!(
            "{}: the errors below are those with the scale factors of {settled_c:.1} °C.",
            cubics.sensor
        ));
    }
    let list = |values: [f64; 3]| values.map(|v| format!("{v:.6}")).join(", ");
    let [from, to] = cubics.range_c;
    export.formulas.push(format!(
        "{}: reading = [{}] (raw - [{}]) {}, raw to SI; the firmware then subtracts the bias, a cubic in (T - {:.1} °C) for T from {from:.1} to {to:.1} °C",
        cubics.sensor,
        list(cubics.conversion.si_per_raw),
        list(cubics.conversion.zero_raw),
        cubics.unit,
        cubics.reference_c,
    ));
    export.remaining.extend(remaining::of_cubics(&cubics));
    export.cubics.push(cubics);
}

fn over_temperature(
    calibration: &Calibration,
    options: &Options,
    [from_c, to_c]: [f64; 2],
    export: &mut Export,
) -> Result<()> {
    export.notes.push("X0 contains the whole bias. PX4 also subtracts the offsets CAL_GYRO and CAL_ACC: set these to 0, or calibrate there again.".into());
    let middle_c = 0.5 * (from_c + to_c);
    cubics(calibration, options, [from_c, to_c], middle_c, export)?;
    let ids = options.ids();
    for cubics in &export.cubics {
        let id = ids[cubics.sensor];
        parameters_of(cubics, options.imu, id, &mut export.parameters);
    }
    Ok(())
}

fn at_one_temperature(
    calibration: &Calibration,
    options: &Options,
    export: &mut Export,
) -> Result<()> {
    export.notes.push(
        "PX4 subtracts TC_* too: set TC_G_ENABLE and TC_A_ENABLE to 0, unless they come from a calibration without these offsets.".into(),
    );
    let ids = options.ids();
    let n = options.imu - 1;
    for Offsets {
        sensor,
        offset,
        scale,
    } in one_temperature::offsets(calibration, options, export)?
    {
        let prefix = match sensor {
            Sensor::Gyro => format!("CAL_GYRO{n}"),
            Sensor::Accel => format!("CAL_ACC{n}"),
        };
        let out = &mut export.parameters;
        out.extend(ids[sensor].map(|id| Parameter::int32(format!("{prefix}_ID"), id)));
        for (axis, letter) in LETTERS.iter().enumerate() {
            out.push(Parameter::real(
                format!("{prefix}_{letter}OFF"),
                offset[axis],
            ));
        }
        if sensor == Sensor::Gyro {
            continue;
        }
        for (axis, letter) in LETTERS.iter().enumerate() {
            let name = format!("{prefix}_{letter}SCALE");
            let remedy = (
                "give the factor by which the driver converts",
                Argument::AccelConversion,
            );
            within(sensor, axis, (&name, scale[axis], ""), SCALES, remedy)?;
            out.push(Parameter::real(name, scale[axis]));
        }
    }
    Ok(())
}

/// Biases of each sensor as cubics. The remaining errors are added to `export`.
pub(crate) fn cubics(
    calibration: &Calibration,
    options: &parameters::Options,
    range_c: [f64; 2],
    reference_c: f64,
    export: &mut Export,
) -> Result<()> {
    each_sensor(
        options,
        export,
        |sensor, known| BiasCubics::of(calibration, sensor, known, range_c, reference_c),
        |sensor| format!("The calibration has no curves of the {sensor}, so none are written."),
    )?;
    let places = remaining::Places {
        cross_terms: true,
        temperature: true,
        effects: false,
    };
    // Of the general errors only those of the effects are added: the cubics report their own.
    let general = remaining::of(calibration, places)?;
    let ids: Vec<String> = calibration.effects().iter().map(|e| e.id()).collect();
    let of_effects = general.into_iter().filter(|r| ids.contains(&r.source));
    export.remaining.extend(of_effects);
    Ok(())
}

fn parameters_of(cubics: &BiasCubics, imu: u8, id: Option<i32>, out: &mut Vec<Parameter>) {
    let letter = match cubics.sensor {
        Sensor::Gyro => 'G',
        Sensor::Accel => 'A',
    };
    let prefix = format!("TC_{letter}{}", imu - 1);
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
