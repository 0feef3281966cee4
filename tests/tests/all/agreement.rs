//! Estimators that must agree, and models that must be inverse to each other.

use mimu::estimate::known_input::{inverse_form, kalman, least_squares, opposite_rates};
use mimu::estimate::{EarthShare, Observation};
use mimu::noise::wander::Slow;
use mimu::triad::{Angles, Triad};
use mimu_rig::ideal::Ideal;
use mimu_rig::random::Random;
use mimu_tests::bench;
use nalgebra::{SVector, Vector3};

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

#[test]
fn kalman_filter_with_a_diffuse_prior_agrees_with_least_squares_to_rounding() {
    let mut worst = [0.0_f64; 2];
    for seed in 0..200 {
        let mut random = Random::new(seed, "unit");
        let unit = unit(&mut random);
        let observations = on_a_table(&unit, 1000, &mut random);
        // With independent errors, and with wander that all dwells share and that is as large as the noise.
        let sigma = observations[0].variance.x.sqrt();
        let slow = Slow {
            instability: sigma,
            walk: 0.1 * sigma,
        };
        let spans: Vec<_> = (0..observations.len())
            .map(|i| [i as f64, i as f64 + 1.0])
            .collect();
        let wander = slow.covariance(&spans, [0.0, spans.len() as f64]);
        let wandering: Vec<_> = observations
            .iter()
            .map(|o| Observation {
                variance: o.variance.add_scalar(wander[(o.dwell, o.dwell)]),
                ..*o
            })
            .collect();
        let wander = std::array::from_fn(|_| wander.clone());
        for (observations, wander) in [(&observations, None), (&wandering, Some(&wander))] {
            let batch = least_squares(observations, wander).unwrap();
            let recursive = kalman(observations, wander).unwrap();
            worst[0] = worst[0].max(apart(&batch.triad, &recursive.triad, observations));
            let [a, b] = [&batch, &recursive].map(|e| e.triad.forward_covariance);
            worst[1] = worst[1].max((a - b).norm() / a.norm());
        }
    }
    // Readings of 2.5 V in f64 are rounded to 4e-16; the design's condition is below 5. The covariance also contains the extra white variance. Both
    // methods iterate it to 1e-6 if it is not zero.
    assert!(worst[0] < 1e-13, "output: {:e}", worst[0]);
    assert!(worst[1] < 1e-5, "covariance: {:e}", worst[1]);
}

#[test]
fn forward_and_inverse_model_agree_on_the_compensated_output() {
    let mut worst: f64 = 0.0;
    for seed in 0..1000 {
        let mut random = Random::new(seed, "unit");
        let unit = unit(&mut random);
        let observations = on_a_table(&noiseless(unit), 1, &mut random);
        let forward = least_squares(&observations, None).unwrap();
        // Without noise, both directions of regression must give the same calibration.
        for inverse in [inverse_form(&observations), opposite_rates(&observations)] {
            worst = worst.max(apart(
                &forward.triad,
                &inverse.unwrap().triad,
                &observations,
            ));
        }
        // The matrices alone must lead there and back as well.
        let x = Vector3::from_fn(|_, _| random.within(5.0));
        let back = forward
            .triad
            .inverse
            .apply(&forward.triad.forward.apply(&x));
        worst = worst.max((back - x).norm() / x.norm());
    }
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn physical_quantities_make_the_forward_model_again() {
    for seed in 0..200 {
        let mut random = Random::new(seed, "unit");
        let unit = unit(&mut random);
        let triad = least_squares(&on_a_table(&noiseless(unit), 1, &mut random), None)
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
        let mut triad = least_squares(&on_a_table(&noiseless(unit), 1, &mut random), None)
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

/// A converter so coarse that a sensor's code is constant within dwells.
#[test]
fn a_channel_without_noise_is_fitted_by_filter_and_least_squares_alike() {
    let unit = unit(&mut Random::new(3, "unit"));
    let mut observations = on_a_table(&unit, 1000, &mut Random::new(4, "noise"));
    for o in &mut observations {
        o.variance.y = 0.0;
    }
    let batch = least_squares(&observations, None).unwrap();
    let recursive = kalman(&observations, None).unwrap();
    assert!(apart(&batch.triad, &recursive.triad, &observations) < 1e-12);
}

/// The sign of a misalignment angle, against a drawing: θz > 0 turns the sensors by θz about z as seen from the body. A rate about the body's x then
/// reads +θz on the sensor y, and one about y reads -θz on the sensor x (fang (12), first column and first row).
#[test]
fn a_positive_misalignment_about_z_shows_x_on_the_sensor_y_positive() {
    let angle: f64 = 0.01;
    let mut random = Random::new(1, "unit");
    let mut unit = unit(&mut random);
    unit.matrix = [[1.0, -angle, 0.0], [angle, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let physical = least_squares(&on_a_table(&noiseless(unit), 1, &mut random), None)
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

/// xu's form regresses on the noisy side; its covariance must still equal the scatter of its results.
#[test]
fn covariance_of_the_inverse_form_is_the_scatter_of_its_results() {
    const RUNS: u64 = 2000;
    let unit = unit(&mut Random::new(7, "unit"));
    type Estimator =
        fn(&[Observation]) -> Result<mimu::estimate::Estimated, mimu::estimate::Failure>;
    for (name, estimator) in [
        ("poses", inverse_form as Estimator),
        ("rates", opposite_rates),
    ] {
        let (mut sum, mut squares) = (SVector::<f64, 12>::zeros(), SVector::<f64, 12>::zeros());
        let mut claimed = Vec::new();
        for seed in 0..RUNS {
            let dwells = on_a_table(&unit, 1000, &mut Random::new(seed, "noise"));
            let triad = estimator(&dwells).unwrap().triad;
            let at = mimu::triad::vector(&triad.inverse.matrix, &triad.inverse.offset);
            sum += at;
            squares += at.component_mul(&at);
            claimed.push(triad.inverse_covariance.diagonal());
        }
        let n = RUNS as f64;
        for i in 0..12 {
            let scatter = squares[i] / n - (sum[i] / n).powi(2);
            // The median is used, because the noise of some runs is taken for extra white variance.
            let mut claims: Vec<f64> = claimed.iter().map(|c| c[i]).collect();
            claims.sort_by(f64::total_cmp);
            let ratio = (claims[claims.len() / 2] / scatter).sqrt();
            // 2000 runs determine a sigma to 1.6 %; the tolerance is four times that.
            assert!(
                (0.93..1.07).contains(&ratio),
                "{name}, parameter {i}: claimed over found {ratio:.3}"
            );
        }
    }
}
