//! Comparisons of the device's computation with the PC's, as text.

use std::fmt::Write as _;

use super::device::{line, printed};
use mimu::quantity::{AXES, significant};
use mimu_device::{Checked, DeviceResult, KalmanRun};

/// Result of `mimu device check`.
pub fn check_text(result: &DeviceResult<Checked>) -> String {
    let mut out = String::new();
    let found = &result.found;
    line!(
        out,
        "{}: {} samples compared, {} without a counterpart",
        result.port,
        found.samples,
        found.unpaired
    );
    line!(out, "largest difference, device minus PC:");
    for (sensor, d) in [("gyro", &found.gyro), ("accel", &found.accel)] {
        let unit = printed(d.unit);
        line!(
            out,
            "{sensor:<6} same precision {} ulps ({} {unit}), double precision {} {unit}, {:.0} % of the limit of rounding",
            d.ulps,
            significant(d.single),
            significant(d.double),
            100.0 * d.rounding_share
        );
    }
    if let Some([low, high]) = found.die_range_c {
        line!(
            out,
            "temperature of the dies during the comparison: {low:.2} to {high:.2} °C"
        );
    }
    if let Some(off) = found.die_temperature_k {
        line!(
            out,
            "lagged temperature of the dies: difference {} K",
            significant(off)
        );
    }
    if found.holds {
        line!(out, "device and PC agree to rounding");
    } else if !found.not_judged_for.is_empty() {
        line!(
            out,
            "not judged: {} depends on temperatures before the comparison",
            found.not_judged_for.join(", ")
        );
    } else {
        line!(out, "device and PC DIFFER");
    }
    out
}

/// Result of `mimu device kalman`.
pub fn kalman_text(result: &DeviceResult<KalmanRun>) -> String {
    let mut out = String::new();
    let run = &result.found;
    line!(
        out,
        "{}: Kalman bank of the {}, forward model u = P x + b, {}",
        result.port,
        run.triad,
        run.direction
    );
    for applied in &run.inputs {
        let [x, y, z] = applied.input;
        line!(
            out,
            "input {x:>9} {y:>9} {z:>9} {}   samples {} to {}",
            run.input_unit,
            applied.first,
            applied.last
        );
    }
    line!(
        out,
        "              device          sigma            PC   difference / sigma"
    );
    for (i, axis) in AXES.iter().enumerate() {
        for (k, (name, unit)) in run.parameters.iter().zip(&run.units).enumerate() {
            line!(
                out,
                "{axis} {name:<3} {:>14.7} {:>14} {:>13.7}   {:>10}   {unit}",
                run.device[i].mean[k],
                significant(run.device[i].sigma[k]),
                run.host[i].mean[k],
                significant(run.distance_sigma[i][k]),
            );
        }
    }
    line!(
        out,
        "largest difference {} sigma; samples rejected: {}",
        significant(run.largest_distance_sigma),
        run.rejected
    );
    out
}
