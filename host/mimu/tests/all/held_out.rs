//! Blocks that leave a fit undetermined are named, and no error of theirs is averaged in.

use mimu::quantity::Sensor;
use mimu::{Manifest, Options, Prepared, RawUnit, Reference, Samples, fit};

const G: f64 = 9.8;

/// An ideal accelerometer, two seconds in each of these poses, 100 samples a second.
fn recorded(ups: &[[f64; 3]]) -> Prepared {
    let mut samples = Samples::default();
    let noise = |k: usize| 1e-3 * ((k as f64 * 0.618_034).fract() - 0.5);
    for (step, up) in ups.iter().enumerate() {
        let size = up.iter().map(|u| u * u).sum::<f64>().sqrt();
        for _ in 0..200 {
            samples.t_s.push(samples.t_s.len() as f64 / 100.0);
            samples.step.push(step as i32);
            for axis in 0..3 {
                let force = G * up[axis] / size + noise(3 * samples.t_s.len() + axis);
                samples.raw[3 + axis].push(force);
            }
        }
    }
    let manifest = Manifest::new("unit", 100.0, G, RawUnit::Si, Reference::Gravity);
    Prepared::of(manifest, &samples, mimu::stillness::STILL_FACTOR).expect("readable")
}

#[test]
fn a_block_that_holds_all_slanted_poses_is_named_and_not_averaged_in() {
    let mut ups = Vec::new();
    // Nearly along the axes: 3e-4 of a misalignment's slope is all that they show.
    for k in 0..18 {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let mut up = [3e-4 * sign, -3e-4, 3e-4];
        up[k / 2 % 3] = if k / 6 % 2 == 0 { 1.0 } else { -1.0 };
        ups.push(up);
    }
    ups.extend([
        [1.0, 1.0, 0.0],
        [-1.0, 1.0, 0.0],
        [0.0, 1.0, 1.0],
        [0.0, -1.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, -1.0],
    ]);
    let fitted = fit(recorded(&ups), Options::default()).expect("it is determined");
    let accel = fitted.sensor(Sensor::Accel).expect("an accelerometer");
    let [reason] = &accel.not_held_out[..] else {
        panic!("{:?}", accel.not_held_out);
    };
    assert!(reason.starts_with("block 4 cannot be held out"), "{reason}");
    for residual in &accel.residuals {
        let held_out = residual.held_out.map(|h| h.x.abs());
        assert_eq!(held_out.is_none(), residual.dwell >= 18);
        assert!(held_out.is_none_or(|h| h < 1e-3), "{held_out:?}");
    }
}
