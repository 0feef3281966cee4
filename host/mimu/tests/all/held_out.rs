//! Parts of a recording that the other dwells do not determine are held out differently, or named; their errors are not averaged in.

use mimu::fit::Split;
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
    Prepared::of(manifest, &samples, mimu::signal::stillness::STILL_FACTOR).expect("readable")
}

/// Eighteen poses nearly along the axes: they show only 3e-4 of a misalignment's slope.
fn along_the_axes() -> Vec<[f64; 3]> {
    let pose = |k: usize| {
        let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut up = [3e-4 * sign, -3e-4, 3e-4];
        up[k / 2 % 3] = if (k / 6).is_multiple_of(2) { 1.0 } else { -1.0 };
        up
    };
    (0..18).map(pose).collect()
}

#[test]
fn where_a_block_holds_all_slanted_poses_one_dwell_in_four_is_held_out_instead() {
    let mut ups = along_the_axes();
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
    assert_eq!(
        (accel.held_out.split, accel.held_out.count),
        (Split::Interleaved, 4)
    );
    let [reason] = &accel.held_out.reasons[..] else {
        panic!("{:?}", accel.held_out.reasons);
    };
    assert!(
        reason.to_string().contains("block 4 cannot be held out"),
        "{reason}"
    );
    let worst = accel
        .residuals
        .iter()
        .map(|r| r.held_out.expect("each is held out").x.abs());
    assert!(worst.fold(0.0, f64::max) < 1e-3);
}

#[test]
fn a_block_that_cannot_be_cut_otherwise_is_named_and_not_averaged_in() {
    let mut ups = along_the_axes();
    // Each shows one angle that no other pose shows.
    ups.extend([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]]);
    let fitted = fit(recorded(&ups), Options::default()).expect("it is determined");
    let accel = fitted.sensor(Sensor::Accel).expect("an accelerometer");
    assert_eq!(accel.held_out.split, Split::Blocks);
    let reason = accel.held_out.reasons.last().expect("a reason");
    assert!(
        reason.to_string().contains("4 cannot be held out: without"),
        "{reason}"
    );
    assert!(
        reason
            .to_string()
            .contains("predictions for it are uncertain by"),
        "{reason}"
    );
    assert!(accel.residuals[16..].iter().all(|r| r.held_out.is_none()));
    for residual in &accel.residuals {
        let held_out = residual.held_out.map(|h| h.x.abs());
        assert!(held_out.is_none_or(|h| h < 1e-3), "{held_out:?}");
    }
}
