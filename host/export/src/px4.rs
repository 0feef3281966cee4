//! Parameters of PX4.
//!
//! PX4 subtracts from each axis of the readings, before its own scale factors, a cubic of the temperature that its thermometer shows:
//! `X0 + X1 d + X2 d² + X3 d³` with `d = T - TREF`, held outside TMIN to TMAX. Source: PX4 User Guide, "Thermal Calibration and
//! Compensation"; parameter reference, TC_*.

use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::BiasCubics;
use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::{Error, Result};

use crate::parameters::Parameter;
use crate::{Export, Sources, heading, parameters, remaining};

/// What a person knows of the autopilot.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// What ArduPilot has too.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub common: parameters::Options,
    /// Device id of the gyro in PX4 (CAL_GYROn_ID)
    #[cfg_attr(feature = "clap", arg(long, value_name = "ID"))]
    pub gyro_id: Option<u32>,
    /// Device id of the accelerometer in PX4 (CAL_ACCn_ID)
    #[cfg_attr(feature = "clap", arg(long, value_name = "ID"))]
    pub accel_id: Option<u32>,
}

/// Biases over temperature.
///
/// # Errors
/// There is no calibration, or it has no curves; those of [`BiasCubics::of`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let ids = PerSensor {
        gyro: options.gyro_id,
        accel: options.accel_id,
    };
    let mut export = Export::new("px4");
    export.notes = notes(options);
    let [from_c, to_c] = range_of_curves(calibration, place)?;
    cubics(
        calibration,
        &options.common,
        [from_c, to_c],
        0.5 * (from_c + to_c),
        &mut export,
    )?;
    for cubics in &export.cubics {
        parameters_of(
            cubics,
            options.common.imu,
            ids[cubics.sensor],
            &mut export.parameters,
        );
    }
    let comments = heading::comments("#", &heading::of_calibration(calibration, &export));
    export.content = options
        .common
        .text(&comments, &export.parameters)
        .into_bytes();
    Ok(export)
}

/// Temperatures of the curves, °C.
///
/// # Errors
/// There are none.
pub(crate) fn range_of_curves(calibration: &Calibration, place: &str) -> Result<[f64; 2]> {
    let over = calibration.temperature.as_ref().ok_or_else(|| {
        Error::new(
            place,
            "it holds for one temperature: there are no curves",
            "fit recordings over temperature with `mimu thermal fit`",
        )
    })?;
    Ok(over.range_c)
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
        "Axes are those of the recording, which have to be those of the sensor in the autopilot."
            .into(),
    );
    for sensor in Sensor::BOTH {
        let known = std::mem::take(&mut conversions[sensor]);
        let Some(cubics) = BiasCubics::of(calibration, sensor, &known, range_c, reference_c)?
        else {
            let note = format!("The calibration has no curves of the {sensor}: none are written.");
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

fn parameters_of(cubics: &BiasCubics, imu: u8, id: Option<u32>, out: &mut Vec<Parameter>) {
    let letter = match cubics.sensor {
        Sensor::Gyro => 'G',
        Sensor::Accel => 'A',
    };
    let prefix = format!("TC_{letter}{}", imu - 1);
    out.push(Parameter::int32(format!("TC_{letter}_ENABLE"), 1));
    if let Some(id) = id {
        // PX4 keeps the id in a signed parameter, bit by bit.
        out.push(Parameter::int32(format!("{prefix}_ID"), id as i32));
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

fn notes(options: &Options) -> Vec<String> {
    let mut notes = Vec::new();
    if options.gyro_id.is_none() || options.accel_id.is_none() {
        let n = options.common.imu - 1;
        notes.push(format!(
            "Set TC_G{n}_ID and TC_A{n}_ID to the sensors' device ids where they are missing here: PX4 finds a table by its id only."
        ));
    }
    notes.push("X0 contains the whole bias. PX4 also subtracts the offsets CAL_GYRO and CAL_ACC: set these to 0, or calibrate there again.".into());
    if !options.common.qgc {
        notes.push("MAVProxy's `param load` skips changes of less than 1e-6, such as X2 and X3: load this file by another program, or write it for QGroundControl.".into());
    }
    notes
}
