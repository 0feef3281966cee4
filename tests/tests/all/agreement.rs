//! Estimators that must agree, and models that must be inverse to each other.

use mimu::estimate::known_input::least_squares;
use mimu::estimate::{EarthShare, Observation};
use mimu::triad::{Angles, Triad};
use mimu_core::kalman::Filter;
use mimu_rig::ideal::Ideal;
use mimu_rig::random::Random;
use mimu_tests::bench;
use nalgebra::Vector3;

/// A gyro triad drawn by `random`, with 2 mV of noise in a sample.
fn unit(random: &mut Random) -> Ideal {
    let model = bench::gyro(random);
    Ideal {
        matrix: model.matrix,
        bias: model.bias,
        sigma: [2e-3; 3],
    }
}

fn noiseless(unit: Ideal) -> Ideal {
    Ideal {
        sigma: [0.0; 3],
        ..unit
    }
}

/// Dwells of a rate table: each axis in both directions at several rates, oblique axes, and rest. `n` samples each.
fn on_a_table(unit: &Ideal, n: u32, random: &mut Random) -> Vec<Observation> {
    let mut inputs = vec![Vector3::zeros(); 3];
    for axis in 0..3 {
        for rate in [0.5, 2.0, 5.0] {
            inputs.push(Vector3::ith(axis, rate));
            inputs.push(Vector3::ith(axis, -rate));
        }
    }
    let slanted = [
        [1.0, 1.0, 0.0],
        [0.0, -1.0, 1.0],
        [1.0, 0.0, -1.0],
        [1.0, 1.0, 1.0],
    ];
    inputs.extend(slanted.map(|a| Vector3::from(a) * 1.5));
    inputs.extend(slanted.map(|a| Vector3::from(a) * -1.5));
    let variance = Vector3::from(unit.sigma).map(|s| s * s / f64::from(n));
    inputs
        .into_iter()
        .enumerate()
        .map(|(dwell, input)| Observation {
            dwell,
            raw: unit.read(input.into(), n, random).into(),
            variance,
            input,
            earth: EarthShare::NONE,
            change: Vector3::zeros(),
        })
        .collect()
}

/// Largest difference of `a` and `b` on inputs of the experiment's size, relative to that size.
fn apart(a: &Triad, b: &Triad, observations: &[Observation]) -> f64 {
    let span = observations
        .iter()
        .map(|o| o.input.norm())
        .fold(0.0, f64::max);
    let on = |o: &Observation| (a.inverse.apply(&o.raw) - b.inverse.apply(&o.raw)).norm() / span;
    observations.iter().map(on).fold(0.0, f64::max)
}

/// The filters of the device, fed the same dwells.
#[test]
fn kalman_filter_with_a_diffuse_prior_agrees_with_least_squares_to_rounding() {
    let mut worst: f64 = 0.0;
    for seed in 0..200 {
        let mut random = Random::new(seed, "unit");
        let unit = unit(&mut random);
        let observations = on_a_table(&unit, 1000, &mut random);
        let batch = least_squares(&observations, &[], None).unwrap();
        let mut recursive = batch.triad.forward;
        for axis in 0..3 {
            let mut filter = Filter::<f64>::diffuse(observations[0].variance[axis], 1.0);
            for o in &observations {
                let (raw, variance) = (o.raw[axis], o.variance[axis]);
                filter.update(&(o.input / 5.0), raw, variance).unwrap();
            }
            let mean = filter.mean();
            recursive.bias[axis] = mean[0];
            let row = mean.fixed_rows::<3>(1).transpose() / 5.0;
            recursive.matrix.set_row(axis, &row);
        }
        let recursive = Triad::from_forward(recursive, Vec::new()).unwrap();
        worst = worst.max(apart(&batch.triad, &recursive, &observations));
    }
    // Readings of 2.5 V in f64 are rounded to 4e-16; the design's condition is below 5.
    assert!(worst < 1e-13, "output: {worst:e}");
}

#[test]
fn forward_and_inverse_model_lead_there_and_back() {
    let mut worst: f64 = 0.0;
    for seed in 0..1000 {
        let mut random = Random::new(seed, "unit");
        let unit = unit(&mut random);
        let observations = on_a_table(&noiseless(unit), 1, &mut random);
        let triad = least_squares(&observations, &[], None).unwrap().triad;
        let x = Vector3::from_fn(|_, _| random.within(5.0));
        let back = triad.inverse.apply(&triad.forward.apply(&x));
        worst = worst.max((back - x).norm() / x.norm());
    }
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn physical_quantities_make_the_forward_model_again() {
    for seed in 0..200 {
        let mut random = Random::new(seed, "unit");
        let unit = unit(&mut random);
        let triad = least_squares(&on_a_table(&noiseless(unit), 1, &mut random), &[], None)
            .unwrap()
            .triad;
        for angles in [Angles::Small, Angles::Exact] {
            let again = triad.physical(angles).forward();
            let off = (again.matrix - triad.forward.matrix).norm() / triad.forward.matrix.norm();
            assert!(off < 1e-12, "{angles:?}: {off:e}");
        }
    }
}

/// Sensors mounted in any orientation, including left-handed triads and sensors that point backwards.
#[test]
fn exact_quantities_make_the_forward_model_again_in_any_mounting() {
    for seed in 0..500 {
        let mut random = Random::new(seed, "unit");
        let unit = unit(&mut random);
        let mut triad = least_squares(&on_a_table(&noiseless(unit), 1, &mut random), &[], None)
            .unwrap()
            .triad;
        let axis = nalgebra::Unit::new_normalize(Vector3::from_fn(|_, _| random.normal()));
        let turn = nalgebra::Rotation3::from_axis_angle(&axis, random.within(std::f64::consts::PI));
        let mirror = if seed % 2 == 0 { 1.0 } else { -1.0 };
        triad.forward.matrix *= turn.matrix() * mirror;
        let again = triad.physical(Angles::Exact).forward();
        let off = (again.matrix - triad.forward.matrix).norm() / triad.forward.matrix.norm();
        assert!(off < 1e-12, "{seed}: {off:e}");
    }
}

/// The sign of a misalignment angle, against a drawing: θz > 0 turns the sensors by θz about z as seen from the body. A rate about the body's x then
/// reads +θz on the sensor y, and one about y reads -θz on the sensor x (fang (12), first column and first row).
#[test]
fn a_positive_misalignment_about_z_shows_x_on_the_sensor_y_positive() {
    let angle: f64 = 0.01;
    let mut random = Random::new(1, "unit");
    let mut unit = unit(&mut random);
    unit.matrix = [[1.0, -angle, 0.0], [angle, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let physical = least_squares(&on_a_table(&noiseless(unit), 1, &mut random), &[], None)
        .unwrap()
        .triad
        .physical(Angles::Exact);
    assert!(
        (physical.misalignment[2].value - angle).abs() < 1e-6,
        "{physical:?}"
    );
    assert!(
        physical
            .non_orthogonality
            .iter()
            .all(|b| b.value.abs() < 1e-4),
        "{physical:?}"
    );
}
