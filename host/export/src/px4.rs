//! Parameters of PX4.
//!
//! PX4 subtracts from each axis of the readings, before its own scale factors, a cubic of the temperature that its thermometer shows:
//! `X0 + X1 d + X2 d² + X3 d³` with `d = T - TREF`, held outside TMIN to TMAX. Source: PX4 User Guide, "Thermal Calibration and
//! Compensation"; parameter reference, TC_*.
//!
//! A calibration at one temperature becomes CAL_ACCn_XOFF, CAL_ACCn_XSCALE and CAL_GYROn_XOFF, n from 0: PX4 computes
//! `(data - thermal_offset - offset) * scale` of an accelerometer and `data - thermal_offset - offset` of a gyro, which has no scale there.
//! Source: src/lib/sensor_calibration/Accelerometer.hpp and Gyroscope.hpp, `Correct`; src/modules/sensors/module.yaml.

use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::BiasCubics;
use mimu::quantity::Sensor;
use mimu_recording::error::{Argument, Result};

use crate::one_temperature::{self, LETTERS, Offsets, within};
use crate::parameters::Parameter;
use crate::{Export, Sources, heading, parameters, remaining};

/// What a person knows of the autopilot.
pub type Options = parameters::Options;

/// Scale that PX4 takes of an accelerometer.
const SCALES: [f64; 2] = [0.1, 3.0];

/// Biases over temperature, or offsets and scale factors at one.
///
/// # Errors
/// The calibration is missing; those of [`BiasCubics::of`] or of `Conversion::of`; a scale factor beyond what PX4 takes.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, _) = from.calibration()?;
    let mut export = Export::new("px4");
    if options.gyro_id.is_none() || options.accel_id.is_none() {
        let n = options.imu - 1;
        let [gyro, accel] = match calibration.temperature {
            Some(_) => ["TC_G", "TC_A"],
            None => ["CAL_GYRO", "CAL_ACC"],
        };
        export.notes.push(format!(
            "Set {gyro}{n}_ID and {accel}{n}_ID to the sensors' device ids if they are missing here: PX4 finds a table by its id only."
        ));
    }
    match &calibration.temperature {
        Some(over) => over_temperature(calibration, options, over.range_c, &mut export)?,
        None => at_one_temperature(calibration, options, &mut export)?,
    }
    if !options.qgc {
        export.notes.push("MAVProxy's `param load` skips changes of less than 1e-6, such as X2 and X3: load this file with another program, or write it for QGroundControl.".into());
    }
    let comments = heading::comments("#", &heading::of_calibration(calibration, &export));
    export.content = options.text(&comments, &export.parameters).into_bytes();
    Ok(export)
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

/// The biases of each sensor as cubics; what they leave goes to `export`.
pub(crate) fn cubics(
    calibration: &Calibration,
    options: &parameters::Options,
    range_c: [f64; 2],
    reference_c: f64,
    export: &mut Export,
) -> Result<()> {
    let mut conversions = options.conversions();
    export.notes.push(
        "Axes are those of the recording; they have to be those of the sensor in the autopilot."
            .into(),
    );
    for sensor in Sensor::BOTH {
        let known = std::mem::take(&mut conversions[sensor]);
        let Some(cubics) = BiasCubics::of(calibration, sensor, &known, range_c, reference_c)?
        else {
            let note =
                format!("The calibration has no curves of the {sensor}, so none are written.");
            export.notes.push(note);
            continue;
        };
        let list = |values: [f64; 3]| values.map(|v| format!("{v:.6}")).join(", ");
        let [from, to] = cubics.range_c;
        export.formulas.push(format!(
            "{sensor}: reading = [{}] (raw - [{}]) {}, raw to SI; minus the cubic of {from:.1} to {to:.1} °C about {:.1} °C",
            list(cubics.conversion.si_per_raw),
            list(cubics.conversion.zero_raw),
            cubics.unit,
            cubics.reference_c,
        ));
        export.notes.push(format!(
            "{sensor}: the errors below are those with the scale factors of {:.1} °C.",
            cubics.settled_c
        ));
        export.remaining.extend(remaining::of_cubics(&cubics));
        export.cubics.push(cubics);
    }
    let places = remaining::Places {
        cross_terms: true,
        temperature: true,
        effects: false,
    };
    // Of what is judged in general, the effects alone: cubics have their own account of the rest.
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
