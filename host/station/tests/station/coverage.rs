//! Whether the stated uncertainties contain the truth as often as they claim.

use super::bench::{GRAVITY, Unit, figure, found};

/// Units of a test.
const UNITS: u64 = 60;

/// How many of the deviations, in standard uncertainties, are within 1.96, and their root mean square.
fn coverage(deviations: &[f64]) -> (f64, f64) {
    let n = deviations.len() as f64;
    let within = deviations.iter().filter(|d| d.abs() <= 1.96).count() as f64;
    let square = deviations.iter().map(|d| d * d).sum::<f64>() / n;
    (within / n, square.sqrt())
}

#[test]
fn offsets_gravity_and_noise_are_within_their_uncertainties_as_often_as_stated() {
    let mut offsets = Vec::new();
    let mut with_earth = Vec::new();
    let (mut gravity, mut densities) = (Vec::new(), [Vec::new(), Vec::new()]);
    for seed in 1..=UNITS {
        let unit = Unit {
            earth: false,
            ..Unit::drawn(seed)
        };
        let (quantities, _) = found(&unit.samples(seed));
        for (axis, name) in ["x", "y", "z"].iter().enumerate() {
            let [value, sigma, repeatability] = figure(&quantities, &format!("gyro_{name}_offset"));
            let off = value - unit.gyro_offset_dps[axis];
            offsets.push(off / repeatability);
            with_earth.push(off / sigma);
            for (sensor, all) in ["gyro", "accel"].iter().zip(&mut densities) {
                let name = format!("{sensor}_{name}_noise_density");
                let truth = unit.density[usize::from(*sensor == "accel")];
                let [value, sigma, _] = figure(&quantities, &name);
                all.push((value - truth) / sigma);
            }
        }
        // The magnitude along z: offsets of x and y add 1e-4 of a g squared at most.
        let force: [f64; 3] = [0, 1, 2].map(|axis| {
            let up = f64::from(u8::from(axis == 2)) * GRAVITY / 9.80665;
            1e-3 * unit.accel_offset_mg[axis] + unit.accel_scale[axis] * up
        });
        let truth = force.iter().map(|g| g * g).sum::<f64>().sqrt() - GRAVITY / 9.80665;
        let [value, sigma, _] = figure(&quantities, "gravity_error");
        gravity.push((value - 1e3 * truth) / sigma);
    }
    let named = [
        ("gyro offset, type A", &offsets),
        ("gyro offset, with the Earth's rate", &with_earth),
        ("gravity error", &gravity),
        ("gyro noise density", &densities[0]),
        ("accel noise density", &densities[1]),
    ];
    for (name, deviations) in named {
        let (share, rms) = coverage(deviations);
        println!(
            "{name}: {:.1} % of {} within 1.96 standard uncertainties, rms {rms:.2}",
            100.0 * share,
            deviations.len()
        );
    }
    // Of 180 intervals of 95 %, fewer than 89 % hold by chance once in 3000.
    for (name, deviations) in named {
        let (share, _) = coverage(deviations);
        assert!(share >= 0.89, "{name}: {share}");
    }
}
