//! Published schemes, and what a judgement says of them.

use std::f64::consts::PI;

use mimu::design::judgement::Judgement;
use mimu::design::model::{GRAVITY, Model, Term, Terms};
use mimu::design::reach::Carrier;
use mimu::design::schemes::{FANG_FILTERS, Scheme};
use mimu::design::{Problem, lack_of_fit};
use mimu::dwell::Sensor;
use mimu::estimate::{Observation, gravity_size, known_input};
use mimu::recording::Reference;
use nalgebra::Vector3;

use crate::{accel, close, terms};

#[test]
fn six_faces_are_d_optimal_and_fangs_nine_are_not() {
    let problem = accel(Reference::Table, "affine");
    let judge = |s: Scheme| problem.judge(&s.settings(Sensor::Accel).unwrap(), 1.0);
    let six = judge(Scheme::SixFace);
    assert!((six.d_efficiency - 1.0).abs() < 1e-7);
    let nine = judge(Scheme::FangNine);
    assert!(nine.d_efficiency < 0.96, "{}", nine.d_efficiency);
    // Its filters: det F = 1 by the rows of (26), so det(F'F/4) = 1/256, for each axis.
    let all = Scheme::FangNine.settings(Sensor::Accel).unwrap();
    for filter in FANG_FILTERS {
        let judged = problem.judge(&filter.map(|i| all[i]), 1.0);
        assert!(close(judged.determinant, 1.0 / 256.0, 1e-9));
        assert!(close(
            judged.d_efficiency,
            (27.0_f64 / 256.0).powf(0.25),
            1e-6
        ));
        // Nine dwells for every sensor halve the variance of its worst parameter and more.
        let worst = |j: &Judgement| {
            j.parameters[..4]
                .iter()
                .map(|p| p.sigma)
                .fold(0.0, f64::max)
        };
        assert!(worst(&judged) > 1.5 * worst(&nine));
    }
}

#[test]
fn sigmas_of_six_faces_are_those_of_the_arithmetic() {
    // Bias: mean of six. Scale factor: half the difference of two, over gravity.
    let problem = accel(Reference::Table, "affine");
    let judged = problem.judge(&Scheme::SixFace.settings(Sensor::Accel).unwrap(), 0.003);
    for p in &judged.parameters {
        let si = p.sigma * p.parameter.si;
        let known = match p.parameter.name.starts_with('b') {
            true => 0.003 / 6_f64.sqrt(),
            false => 0.003 / (2_f64.sqrt() * 9.80665),
        };
        assert!(close(si, known, 1e-12), "{}: {si}", p.parameter.name);
    }
    assert_eq!((judged.lack_of_fit_dof, judged.repetition_dof), (2, 0));
    assert!(close(judged.condition, 3_f64.sqrt(), 1e-9));
}

#[test]
fn the_estimators_claim_the_sigmas_that_the_design_promised() {
    let (settings, sigma) = (Scheme::Xu33.settings(Sensor::Accel).unwrap(), 1e-3);
    let observations: Vec<Observation> = settings
        .iter()
        .enumerate()
        .map(|(dwell, s)| Observation {
            dwell,
            raw: s.up * GRAVITY,
            variance: Vector3::repeat(sigma * sigma),
            input: s.up * GRAVITY,
        })
        .collect();
    // Columns of C or P by rows, then o or b: known_input gives P, b; gravity_size C, o.
    let known = known_input::least_squares(&observations)
        .unwrap()
        .triad
        .forward_covariance;
    let variances = vec![sigma * sigma; settings.len()];
    let size = gravity_size::estimate(&observations, &variances, GRAVITY)
        .unwrap()
        .triad;
    for (reference, covariance) in [
        (Reference::Table, known),
        (Reference::Gravity, size.inverse_covariance),
    ] {
        let judged = accel(reference, "affine").judge(&settings, sigma);
        for p in &judged.parameters {
            let axes: Vec<usize> = p.parameter.name[2..]
                .bytes()
                .map(|c| usize::from(c - b'x'))
                .collect();
            let place = match axes[..] {
                [i, j] => 3 * i + j,
                _ => 9 + axes[0],
            };
            let claimed = covariance[(place, place)].sqrt();
            let promised = p.sigma * p.parameter.si;
            assert!(
                close(claimed, promised, 1e-5),
                "{}: {claimed} {promised}",
                p.parameter.name
            );
        }
    }
}

#[test]
fn six_faces_cannot_notice_cubes_and_products() {
    let settings = Scheme::SixFace.settings(Sensor::Accel).unwrap();
    let model = Model::accel(Reference::Table, &Terms::default());
    let found = lack_of_fit::notices(&model, &settings);
    let of = |term: Term| found.iter().find(|n| n.term == term).unwrap();
    // On faces x³ = x and xy = 0. x² is 1 on two and 0 on four: apart from the mean, 4/3 of its square is left.
    assert_eq!((of(Term::Cubic).noticed, of(Term::Cubic).size), (0, None));
    assert_eq!((of(Term::Cross).noticed, of(Term::Cross).size), (0, None));
    assert_eq!(of(Term::Quadratic).noticed, 3);
    let size = lack_of_fit::NOTICED / (4.0_f64 / 3.0).sqrt();
    assert!(close(of(Term::Quadratic).size.unwrap(), size, 1e-9));
}

#[test]
fn a_singular_design_names_what_it_leaves_open() {
    let problem = accel(Reference::Gravity, "affine");
    let judged = problem.judge(&Scheme::SixFace.settings(Sensor::Accel).unwrap(), 1.0);
    assert_eq!(judged.d_efficiency, 0.0);
    assert_eq!(judged.undetermined(), ["C_yx", "C_zx", "C_zy"]);
}

#[test]
fn products_cannot_be_told_apart_by_the_size_of_gravity() {
    let model = Model::accel(Reference::Gravity, &terms("affine,cross"));
    let refused = Problem::accel(model, Carrier::ThreeAxis).unwrap_err();
    assert!(refused.problem.contains("cross_x_yz"), "{refused}");
}

#[test]
fn niu_and_xu_positions_are_as_published() {
    let xu = Scheme::Xu33.settings(Sensor::Accel).unwrap();
    // Appendix: F_x(7) = [g sin 30°, 0, -g cos 30°], F_y(10) = [-g cos 75°, g sin 75°, 0].
    let (s, c) = (30_f64.to_radians().sin(), 30_f64.to_radians().cos());
    assert!((xu[6].up - Vector3::new(s, 0.0, -c)).norm() < 1e-12);
    let (s, c) = (75_f64.to_radians().sin(), 75_f64.to_radians().cos());
    assert!((xu[20].up - Vector3::new(-c, s, 0.0)).norm() < 1e-12);
    assert_eq!(xu.len(), 33);
    // Adjacent dwells of niu are a quarter turn apart, or a turn about the vertical.
    let niu = Scheme::Niu8.settings(Sensor::Accel).unwrap();
    for k in 0..8 {
        let angle = niu[k].up.angle(&niu[(k + 1) % 8].up);
        assert!(angle == 0.0 || (angle - PI / 2.0).abs() < 1e-12);
    }
    assert!(niu.iter().all(|s| s.up.z <= 0.0));
    // 9 + 9 + 11 rates both ways, and rest three times.
    let rates = Scheme::XuRates.settings(Sensor::Gyro).unwrap();
    assert_eq!(rates.len(), 2 * 29 + 3);
    assert_eq!(rates.iter().filter(|s| s.rate == 0.0).count(), 3);
}
