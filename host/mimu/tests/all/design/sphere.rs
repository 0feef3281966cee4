//! Attitudes and rates: optima on the sphere.

use mimu::plan::design::Problem;
use mimu::plan::design::exchange;
use mimu::plan::design::information::Inverse;
use mimu::plan::design::model::Setting;
use mimu::plan::design::reach::Fixture;
use mimu::plan::design::refinement::Region as _;
use mimu_recording::Reference;

use super::{accel, close, gyro};

#[test]
fn exchange_finds_what_looking_at_every_design_finds() {
    // 126 and 210 designs: multisets of few points.
    let problem = accel(Reference::Table);
    for n in [5, 6] {
        let candidates: Vec<Setting> = problem
            .reach
            .candidates()
            .into_iter()
            .skip(100)
            .step_by(310)
            .take(5 + n / 6)
            .collect();
        let rows = problem.reach.rows(&candidates);
        let mut best = f64::NEG_INFINITY;
        let mut design = vec![0; n];
        loop {
            best = best.max(
                Inverse::of(&rows, design.iter().copied())
                    .map_or(f64::NEG_INFINITY, |i| i.log_det()),
            );
            // The next multiset in lexicographic order.
            let Some(k) = (0..n).rev().find(|k| design[*k] + 1 < candidates.len()) else {
                break;
            };
            let next = design[k] + 1;
            design[k..].fill(next);
        }
        let found = &exchange::search(&rows, n, 20, 3)[0];
        assert!(
            best.is_finite() && (found.log_det - best).abs() < 1e-9,
            "{n}: {best} {found:?}"
        );
    }
}

#[test]
fn the_affine_optimum_is_one_in_twenty_seven() {
    // M = diag(1, 1/3, 1/3, 1/3): the trace over the sphere is constant, and the product of eigenvalues is largest if they are equal.
    for problem in [accel(Reference::Table), gyro("..300"), gyro("10,100,300")] {
        assert!(close(problem.reach.optimum().exp(), 1.0 / 27.0, 1e-6));
    }
}

#[test]
fn the_size_of_gravity_is_best_measured_all_over_the_sphere() {
    // The optimum is invariant under rotation, so it has the moments of the whole sphere: E x² = 1/3, E x⁴ = 1/5, E x²y² = 1/15. Cross products 1/15,
    // linear terms 1/3, squares det 4/675.
    let uniform = 15_f64.powi(-3) * 3_f64.powi(-3) * 4.0 / 675.0;
    let problem = accel(Reference::Gravity);
    assert!(close(problem.reach.optimum().exp(), uniform, 1e-6));
    // Spherical 4-designs exist for 12, 14 and from 16 on, but not for 13 and 15 (Hardin and Sloane 1996). 12 is the icosahedron.
    for n in [12, 13] {
        let judged = problem.judge(&problem.best(n, 1).unwrap(), 1.0);
        let attains = (judged.d_efficiency - 1.0).abs() < 1e-6;
        assert_eq!(
            attains,
            matches!(n, 12 | 14 | 16..),
            "{n}: {}",
            judged.d_efficiency
        );
        assert!(judged.d_efficiency < 1.0 + 1e-6);
    }
}

#[test]
fn on_a_two_axis_table_every_setting_is_within_its_tilt() {
    let problem = Problem::accel(Reference::Table, Fixture::TwoAxis).unwrap();
    let best = problem.best(12, 1).unwrap();
    assert!(
        best.iter()
            .all(|s| s.up.z >= 95_f64.to_radians().cos() - 1e-9)
    );
    // Rotated about z the optimum stays an optimum, so it is two rings, or one and the pole. With weight w at z = t and 1 - w at the lowest z = h:
    // one variance of z; (1-w)(1-h²)+w(1-t²) is shared by x and y. A scan over w and t:
    let h = 95_f64.to_radians().cos();
    let mut known = 0.0_f64;
    for i in 1..2000 {
        for j in 0..=400 {
            let w = f64::from(i) / 2000.0;
            let t = 1.0 - f64::from(j) / 400.0;
            let (mean, square) = (w * t + (1.0 - w) * h, w * t * t + (1.0 - w) * h * h);
            known = known.max((square - mean * mean) * ((1.0 - square) / 2.0).powi(2));
        }
    }
    assert!(
        close(problem.reach.optimum().exp(), known, 1e-4),
        "{} {known}",
        problem.reach.optimum().exp()
    );
}

/// Each fixture, with and without a known input.
#[test]
fn designs_approach_the_optimum_and_gravity_on_six_faces_is_refused() {
    use Fixture::{Faces, Hand, ThreeAxis, TwoAxis};
    use Reference::{Gravity, Table};
    for (fixture, reference) in [
        (ThreeAxis, Table),
        (ThreeAxis, Gravity),
        (TwoAxis, Table),
        (TwoAxis, Gravity),
        (Faces, Table),
        (Hand, Gravity),
    ] {
        let what = format!("{}, {reference:?}", fixture.name());
        let problem = Problem::accel(reference, fixture).unwrap();
        let judged = problem.judge(&problem.best(24, 1).unwrap(), 1.0);
        let range = 0.94..1.0 + 1e-6;
        assert!(
            range.contains(&judged.d_efficiency),
            "{what}: {}",
            judged.d_efficiency
        );
    }
    let refused = Problem::accel(Gravity, Faces).unwrap_err();
    assert!(
        refused.to_string().contains("C_yx, C_zx, C_zy"),
        "{refused}"
    );
}
