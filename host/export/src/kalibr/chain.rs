//! Further units of a body in Kalibr's result: imu1 and so on, each a gyro and an accelerometer with the same number.
//!
//! `T_i_b` takes a point from the frame b of imu0 to that of the unit, `x_i = C_i_b (x_b - r_b)` with r_b the unit's place, in metres. `time_offset` is added to
//! the unit's stamps to get those of imu0: the negative delay. The accelerometer defines the frame of each unit, so with `P = M Q` for the readings of a
//! triad against the input in the frame of the body, `C_i_b = Q_accel R0ᵀ`, `r_b = R0 arm` and `C_gyro_i = Q_gyro Q_accelᵀ`, where `x_b = R0 x_body`.
//!
//! Source: ethz-asl/kalibr, kalibr_imu_camera_calibration/IccSensors.py, `getTransformationFromBodyToImu`, `addAccelerometerErrorTerms`;
//! kalibr_common/ConfigReader.py, `ImuSetParameters` (2024-03).

use std::fmt::Write as _;

use mimu::{BodyTriad, Calibration, PerSensor};
use mimu_recording::{Result, TriadKind, TriadName};
use nalgebra::{Matrix3, Matrix4, Vector3};

use super::{KEYS, Kalibr, Options};
use crate::worst_axis::lines;
use crate::{Export, Sources, body, yaml};

/// Difference of the delays of a unit's two triads that counts as one delay, ms.
const SAME_DELAY_MS: f64 = 0.1;

/// The blocks of the further units; `r0` is the rotation from the frame of the calibration to that of imu0. Without `--result` only a note.
///
/// # Errors
/// C is singular, or the noise of a unit has no density.
pub(super) fn write(
    out: &mut String,
    from: &Sources,
    options: &Options,
    r0: &Matrix3<f64>,
    export: &mut Export,
) -> Result<()> {
    let Some((calibration, place)) = from.calibration else {
        return Ok(());
    };
    let others = body::left_out(calibration, |name| name.kind != TriadKind::Mag);
    export.notes.extend(others);
    let mut numbers: Vec<u8> = calibration.body.iter().map(|t| t.triad.number).collect();
    numbers.retain(|number| *number > 1);
    numbers.sort_unstable();
    numbers.dedup();
    if !numbers.is_empty() && !options.result {
        export.note("The further units are written with --result only: imu1 and so on, with T_i_b and time_offset.");
        return Ok(());
    }
    let mut described = false;
    for number in numbers {
        let name = format!("imu{}", number - 1);
        let of = |kind| find(calibration, TriadName { kind, number });
        let (Some(gyro), Some(accel)) = (of(TriadKind::Gyro), of(TriadKind::Accel)) else {
            export.note(format!("{name}: Kalibr's units have a gyro and an accelerometer, and this has one of them, so it is not in the file."));
            continue;
        };
        if gyro.rotation_deg.is_none() || accel.rotation_deg.is_none() {
            export.note(format!(
                "{name}: the rotation of {} or {} is not known, so it is not in the file.",
                gyro.triad, accel.triad
            ));
            continue;
        }
        let _ = writeln!(out, "\n{name}:");
        unit(out, [gyro, accel], r0, place, export)?;
        noise(out, from, options, [gyro, accel], place, export)?;
        described = true;
    }
    if described {
        export.formula("  imu1 and so on: x_i = C (x_b - r) with T_i_b = [C, -C r], b the frame of imu0, m; t_imu0 = t_imu + time_offset");
    }
    Ok(())
}

fn find(calibration: &Calibration, name: TriadName) -> Option<&BodyTriad> {
    calibration.body.iter().find(|triad| triad.triad == name)
}

fn unit(
    out: &mut String,
    [gyro, accel]: [&BodyTriad; 2],
    r0: &Matrix3<f64>,
    place: &str,
    export: &mut Export,
) -> Result<()> {
    let name = format!("imu{}", gyro.triad.number - 1);
    let mut factors = |triad: &BodyTriad| {
        let readings = body::readings(triad, false, None, place)?;
        body::note_driver(&readings, triad, false, export);
        Kalibr::factors(&readings)
    };
    let (of_gyro, of_accel) = (factors(gyro)?, factors(accel)?);
    let to_unit = of_accel.rotation * r0.transpose();
    let arm = Vector3::from(accel.lever_arm_mm.unwrap_or_default()) * 1e-3;
    if accel.lever_arm_mm.is_none() {
        export.note(format!(
            "{name}: its lever arm is not known: the translation of T_i_b is 0."
        ));
    }
    let mut pose = Matrix4::<f64>::identity();
    pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&to_unit);
    pose.fixed_view_mut::<3, 1>(0, 3)
        .copy_from(&(-to_unit * r0 * arm));
    let delay_ms = gyro.delay_ms.or(accel.delay_ms);
    match (gyro.delay_ms, accel.delay_ms) {
        (Some(a), Some(b)) if (a - b).abs() > SAME_DELAY_MS => export.note(format!(
            "{name}: time_offset is that of {}; {} is later by {:.3} ms.",
            gyro.triad,
            accel.triad,
            b - a
        )),
        (None, None) => export.note(format!("{name}: its delay is not known: time_offset is 0.")),
        _ => {}
    }
    let _ = writeln!(out, "  model: scale-misalignment\n  accelerometers:");
    yaml::matrix(out, "    ", "M", &of_accel.triangle);
    let _ = writeln!(out, "  gyroscopes:");
    yaml::matrix(out, "    ", "M", &of_gyro.triangle);
    yaml::matrix(out, "    ", "A", &Matrix3::zeros());
    let between = of_gyro.rotation * of_accel.rotation.transpose();
    yaml::matrix(out, "    ", "C_gyro_i", &between);
    yaml::matrix(out, "  ", "T_i_b", &pose);
    let offset_s = yaml::number(-1e-3 * delay_ms.unwrap_or_default());
    let _ = writeln!(out, "  time_offset: {offset_s}");
    Ok(())
}

/// Topic, rate and densities, if the noise file has those of this unit.
fn noise(
    out: &mut String,
    from: &Sources,
    options: &Options,
    [gyro, accel]: [&BodyTriad; 2],
    place: &str,
    export: &mut Export,
) -> Result<()> {
    let (file, number) = (from.noise()?, gyro.triad.number);
    let gain = |triad: &BodyTriad| -> Result<[f64; 3]> {
        Ok(body::readings(triad, false, None, place)?.noise_gain())
    };
    let gains = PerSensor::from([gain(gyro)?, gain(accel)?]);
    let name = format!("imu{}", number - 1);
    match options.noise.walks.of_unit(file, number, &gains)? {
        Some(densities) => *out += &lines("  ", &KEYS, &densities, f64::NAN),
        None => export.note(format!(
            "{name}: the noise file has no channels of {} and {}, so its densities are missing: add them for programs that need them.",
            gyro.triad, accel.triad
        )),
    }
    let rate = options.noise.rate_hz(file);
    let _ = writeln!(
        out,
        "  rostopic: \"/{name}\"\n  update_rate: {rate:.3}  # Hz"
    );
    Ok(())
}
