//! Published schemes, and their judgements.

use std::f64::consts::PI;

use mimu::estimate::{EarthShare, Observation, known_input, magnitude};
use mimu::plan::design::Problem;
use mimu::plan::design::judgement::Judgement;
use mimu::plan::design::model::GRAVITY;
use mimu::plan::design::reach::{Fixture, Rates};
use mimu::quantity::Sensor;
use mimu::signal::power_ons::PowerOns;
use mimu_recording::Reference;
use nalgebra::Vector3;

use super::published::Scheme;
use super::{accel, close};

/// Indices into fang, Table 2, of the positions that the filters for x, y and z are given, fang (26)-(28).
const FANG_FILTERS: [[usize; 4]; 3] = [[0, 1, 2, 3], [4, 5, 2, 6], [7, 8, 6, 3]];

#[test]
fn six_faces_are_d_optimal_and_fangs_nine_are_not() {
    let problem = accel(Reference::Table);
    let judge = |s: Scheme| problem.judge(&s.settings(Sensor::Accel).unwrap(), 1.0);
    let six = judge(Scheme::SixFace);
    assert!((six.d_efficiency - 1.0).abs() < 1e-7);
    let nine = judge(Scheme::FangNine);
    assert!(
        close(nine.d_efficiency, 0.937_236, 1e-6),
        "{}",
        nine.d_efficiency
    );
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
        // Nine dwells for every sensor reduce the variance of its worst parameter to less than half.
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
            earth: EarthShare::NONE,
            change: Vector3::zeros(),
        })
        .collect();
    // Columns of C or P by rows, then o or b: known_input gives P and b; magnitude gives C and o.
    let known = known_input::least_squares(&observations, &[], None)
        .unwrap()
        .triad
        .forward_covariance;
    let variances = vec![sigma * sigma; settings.len()];
    let size = magnitude::by_gravity(&observations, &variances, GRAVITY, None, PowerOns::ONE)
        .unwrap()
        .triad;
    for (reference, covariance) in [
        (Reference::Table, known),
        (Reference::Gravity, size.inverse_covariance),
    ] {
        let judged = accel(reference).judge(&settings, sigma);
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
fn published_schemes_are_worth_what_plain_arithmetic_makes_of_the_printed_tables() {
    // det(F'F/n) of the printed positions, by elimination, over that of the optimum, for which the tests in `sphere` have closed forms.
    let span = Scheme::XuRates.rate_span();
    let gyro = Problem::gyro(span, Fixture::ThreeAxis, Rates::Any).unwrap();
    let known = accel(Reference::Table);
    let size = accel(Reference::Gravity);
    for (problem, scheme, determinant, efficiency) in [
        (&known, Scheme::SixFace, 1.0 / 27.0, 1.0),
        (&known, Scheme::FangNine, 0.028_577_960_68, 0.937_236),
        (&known, Scheme::Xu33, 0.027_217_694_80, 0.925_878),
        (&known, Scheme::Niu8, 1.0 / 64.0, 0.805_927),
        (&gyro, Scheme::XuRates, 4.136_584_323e-4, 0.325_088),
        (&size, Scheme::FangNine, 2.581_174_792e-9, 0.698_715),
        (&size, Scheme::Xu33, 3.702_093_339e-9, 0.727_283),
    ] {
        let settings = scheme.settings(problem.reach.model.sensor).unwrap();
        let judged = problem.judge(&settings, 1.0);
        let name = scheme.name();
        assert!(
            close(judged.determinant, determinant, 1e-9),
            "{name}: {}",
            judged.determinant
        );
        assert!(
            close(judged.d_efficiency, efficiency, 2e-6),
            "{name}: {}",
            judged.d_efficiency
        );
    }
}

#[test]
fn a_singular_design_names_what_it_leaves_open() {
    let problem = accel(Reference::Gravity);
    let judged = problem.judge(&Scheme::SixFace.settings(Sensor::Accel).unwrap(), 1.0);
    assert_eq!(judged.d_efficiency, 0.0);
    assert_eq!(judged.undetermined(), ["C_yx", "C_zx", "C_zy"]);
}

#[test]
fn niu_and_xu_positions_are_as_published() {
    let xu = Scheme::Xu33.settings(Sensor::Accel).unwrap();
    // Appendix, F_x(1) to F_z(11) in units of g: rows 2 to 5 with the first angles, rows 7 to 10 with the second.
    let (s, c) = (
        |deg: f64| deg.to_radians().sin(),
        |deg: f64| deg.to_radians().cos(),
    );
    let angles = [[15.0, 30.0, 45.0, 60.0], [30.0, 45.0, 60.0, 75.0]];
    let published = [
        vec![[-1.0, 0.0, 0.0]],
        angles[0].map(|a| [-c(a), 0.0, -s(a)]).into(),
        vec![[0.0, 0.0, -1.0]],
        angles[1].map(|a| [s(a), 0.0, -c(a)]).into(),
        vec![[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]],
        angles[0].map(|a| [-s(a), -c(a), 0.0]).into(),
        vec![[-1.0, 0.0, 0.0]],
        angles[1].map(|a| [-c(a), s(a), 0.0]).into(),
        vec![[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
        angles[0].map(|a| [0.0, -s(a), -c(a)]).into(),
        vec![[0.0, -1.0, 0.0]],
        angles[1].map(|a| [0.0, -c(a), s(a)]).into(),
        vec![[0.0, 0.0, 1.0]],
    ]
    .concat();
    assert_eq!((xu.len(), published.len()), (33, 33));
    for (k, (ours, theirs)) in xu.iter().zip(published).enumerate() {
        let off = (ours.up - Vector3::from(theirs)).norm();
        assert!(off < 1e-12, "position {k}: {} is {off} off", ours.up);
    }
    // Successive dwells of niu differ by a quarter turn, or by a turn about the vertical.
    let niu = Scheme::Niu8.settings(Sensor::Accel).unwrap();
    for k in 0..8 {
        let angle = niu[k].up.angle(&niu[(k + 1) % 8].up);
        assert!(angle == 0.0 || (angle - PI / 2.0).abs() < 1e-12);
    }
    assert!(niu.iter().all(|s| s.up.z <= 0.0));
    // 9 + 9 + 11 rates in both directions, and rest three times.
    let rates = Scheme::XuRates.settings(Sensor::Gyro).unwrap();
    assert_eq!(rates.len(), 2 * 29 + 3);
    assert_eq!(rates.iter().filter(|s| s.rate == 0.0).count(), 3);
}

/// Poses, and turns as (body axis, sense, direction of that axis).
type Cycle = Vec<([i32; 3], (usize, i32, i32))>;

/// Every cycle of eight quarter turns on a table that tilts by -90, 0 or 90 degrees about a horizontal axis and turns without limit about the unit's
/// z, starting at tilt 0: for each its poses, and its turns as (body axis, sense, direction of that axis).
fn cycles() -> Vec<Cycle> {
    fn go(tilt: i32, turn: i32, cycle: &mut Cycle, all: &mut Vec<Cycle>) {
        if cycle.len() == 8 {
            if (tilt, turn) == (0, 0) {
                all.push(cycle.clone());
            }
            return;
        }
        // The body direction that points up, z up at tilt 0; and the body axis along the tilt axis.
        let (c, s) = [(1, 0), (0, 1), (-1, 0), (0, -1)][turn as usize];
        let up = [tilt * s, tilt * c, i32::from(tilt == 0)];
        let (axis, points) = if c == 0 { (1, -s) } else { (0, c) };
        for sense in [1, -1] {
            if (tilt + sense).abs() <= 1 {
                cycle.push((up, (axis, points * sense, points)));
                go(tilt + sense, turn, cycle, all);
                cycle.pop();
            }
            cycle.push((up, (2, sense, tilt)));
            go(tilt, (turn + sense).rem_euclid(4), cycle, all);
            cycle.pop();
        }
    }
    let mut all = Vec::new();
    go(0, 0, &mut Vec::new(), &mut all);
    all
}

#[test]
fn every_cycle_that_fits_nius_words_holds_the_same_eight_poses() {
    let (mut fitting, mut as_built) = (0, 0);
    // Here z down is up: the table is the same upside down, with y reversed as well.
    let built: Vec<[i32; 3]> = Scheme::Niu8
        .settings(Sensor::Accel)
        .unwrap()
        .iter()
        .map(|s| [s.up.x as i32, -s.up.y as i32, -s.up.z as i32])
        .collect();
    for cycle in cycles() {
        let held = |pose: [i32; 3]| cycle.iter().filter(|(up, _)| *up == pose).count();
        let sides = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]];
        let turns = |axis, sense| cycle.iter().any(|(_, t)| (t.0, t.1) == (axis, sense));
        let both_ways = (0..3).all(|axis| turns(axis, 1) && turns(axis, -1));
        if !both_ways || held([0, 0, 1]) == 0 || sides.iter().any(|s| held(*s) == 0) {
            continue;
        }
        fitting += 1;
        assert!(held([0, 0, 1]) == 4 && sides.iter().all(|s| held(*s) == 1));
        // x and y point in the same direction in all their turns, as in the appendix. z cannot.
        let ways = |axis| {
            let each = cycle.iter().filter(|(_, t)| t.0 == axis);
            each.map(|(_, t)| t.2)
                .collect::<std::collections::BTreeSet<_>>()
                .len()
        };
        assert!(ways(0) == 1 && ways(1) == 1 && ways(2) > 1);
        let poses: Vec<[i32; 3]> = cycle.iter().map(|(up, _)| *up).collect();
        as_built += u32::from((0..8).any(|k| {
            let (end, start) = built.split_at(k);
            [start, end].concat() == poses
        }));
    }
    assert!(fitting == 24 && as_built > 0, "{fitting} {as_built}");
}
