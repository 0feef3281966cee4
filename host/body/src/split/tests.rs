use std::f64::consts::TAU;

use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::{DwellSearch, Manifest, RawUnit, Reference, Samples};
use nalgebra::{DVector, Rotation3};

use super::*;

/// Numbers by chance, of which only the seed is given.
struct Random(u64);

impl Random {
    /// Between 0 and 1 (the generator of S. Vigna, splitmix64).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }

    fn across(&mut self, up: &Vector3<f64>) -> Vector3<f64> {
        let any = Vector3::from_fn(|_, _| self.normal());
        any - up * up.dot(&any)
    }
}

const TURNS: usize = 19;
/// Parameters that every fit takes from its turns.
const FITTED: usize = 9;

/// A body whose pairs have errors of these sizes (rms of the angle, rad) by a common part, and each by its own, of which `noise` is known. All fits take the same parameters
/// from the turns.
struct Simulated {
    common: f64,
    own: Vec<f64>,
    noise: f64,
    shared: f64,
    /// Whether turns that are rough have larger common errors.
    by_roughness: bool,
}

impl Simulated {
    fn body(&self, seed: u64) -> TurnErrors {
        let mut random = Random(seed);
        let ups: Vec<_> = (0..TURNS)
            .map(|_| Vector3::from_fn(|_, _| random.normal()).normalize())
            .collect();
        let conditions = (0..TURNS).map(|j| {
            let [angle, rate, roughness] = [(); 3].map(|()| random.uniform());
            [angle, rate, roughness, j as f64]
        });
        let conditions: Vec<_> = conditions.collect();
        // A basis of what the fits take.
        let mut design = DMatrix::from_fn(3 * TURNS, FITTED, |_, _| random.normal());
        for (j, up) in ups.iter().enumerate() {
            for k in 0..FITTED {
                let mut of = design.fixed_view_mut::<3, 1>(3 * j, k);
                let across = &of - up * up.dot(&of);
                of.copy_from(&across);
            }
        }
        let taken = design.qr().q();
        let left = 1.0 - FITTED as f64 / (2 * TURNS) as f64;
        let mut drawn = |size: &dyn Fn(usize) -> f64| {
            let each = ups.iter().enumerate();
            let each = each.map(|(j, up)| random.across(up) * (size(j) / 2.0_f64.sqrt()));
            DVector::from_iterator(3 * TURNS, each.flat_map(<[f64; 3]>::from))
        };
        let rough = |j: usize| match self.by_roughness {
            true => self.common * 1.7 * conditions[j][2],
            false => self.common,
        };
        let common = drawn(&rough) + drawn(&|_| self.shared);
        let pairs = self.own.iter().enumerate().map(|(i, own)| {
            let all = &common + drawn(&|_| *own);
            let residual = &all - &taken * (taken.transpose() * &all);
            PairErrors {
                pair: i as u8 + 1,
                errors: (0..TURNS)
                    .map(|j| residual.fixed_rows::<3>(3 * j).into_owned())
                    .collect(),
                noise: ups
                    .iter()
                    .map(|up| {
                        (Matrix3::identity() - up * up.transpose()) * (self.noise.powi(2) / 2.0)
                    })
                    .collect(),
                left,
            }
        });
        TurnErrors {
            pairs: pairs.collect(),
            shared: vec![self.shared.powi(2); TURNS],
            places: Vec::new(),
            conditions: conditions.clone(),
        }
    }

    fn splits(&self) -> Vec<Split> {
        (0..200)
            .map(|seed| split(&self.body(seed)).expect("pairs share turns"))
            .collect()
    }
}

/// How often a body without a common part is said to have one, at the rate of false alarms and at ten times that.
fn alarms(of: &Simulated) -> [usize; 2] {
    let splits = of.splits();
    [1.0, 10.0].map(|times| splits.iter().filter(|s| s.p < times * FALSE_ALARM).count())
}

/// Of 200 draws at a probability, so many or fewer are exceeded once in 500 times: 1 expected and 10 expected.
const MOST: [usize; 2] = [5, 20];

#[test]
fn without_a_common_part_none_is_found_beyond_the_rate_of_false_alarms() {
    for own in [
        vec![1.0; 2],
        vec![1.0; 8],
        vec![0.3, 1.0, 3.0],
        vec![0.5, 0.5, 0.5, 5.0],
    ] {
        let of = Simulated {
            common: 0.0,
            own: own.iter().map(|own| own * 1e-3).collect(),
            noise: 2e-4,
            shared: 0.0,
            by_roughness: false,
        };
        let found = alarms(&of);
        assert!(
            found[0] <= MOST[0] && (2..=MOST[1]).contains(&found[1]),
            "{own:?}: {found:?} of 200"
        );
    }
}

#[test]
fn what_is_known_to_be_common_is_no_finding() {
    let of = Simulated {
        common: 0.0,
        own: vec![1e-3; 4],
        noise: 1e-3,
        shared: 2e-3,
        by_roughness: false,
    };
    let found = alarms(&of);
    assert!(
        found[0] <= MOST[0] && found[1] <= MOST[1],
        "{found:?} of 200"
    );
    let unknown = of.splits().iter().filter(|s| s.common.rms > 1e-3).count();
    assert!(unknown > 150, "the common part contains it: {unknown}");
}

#[test]
fn intervals_contain_the_parts() {
    let pairs = [
        vec![1.5; 8],
        vec![1.0, 1.5, 1.0, 4.0],
        vec![1.0, 1.0, 2.0],
        vec![2.0; 2],
    ];
    for own in pairs {
        let of = Simulated {
            common: 4e-3,
            own: own.iter().map(|own| own * 1e-3).collect(),
            noise: 2e-4,
            shared: 0.0,
            by_roughness: false,
        };
        let splits = of.splits();
        let left = 1.0 - FITTED as f64 / (2 * TURNS) as f64;
        let inside = |part: &Part, truth: f64| {
            let truth = truth * left.sqrt();
            (part.lower..=part.upper).contains(&truth)
        };
        let common = splits
            .iter()
            .filter(|s| inside(&s.common, of.common))
            .count();
        let parts = splits.iter().flat_map(|s| s.own.iter().zip(&of.own));
        let each: Vec<bool> = parts.map(|((_, part), own)| inside(part, *own)).collect();
        let share = each.iter().filter(|is| **is).count() as f64 / each.len() as f64;
        assert!(
            (182..=199).contains(&common),
            "{own:?}: common {common} of 200"
        );
        assert!(share > 0.91, "{own:?}: own {share:.3}");
        let found = splits.iter().filter(|s| s.exceeds_noise).count();
        assert!(found > 190, "{own:?}: {found} of 200");
    }
}

#[test]
fn the_common_part_correlates_with_what_causes_it_and_with_nothing_else() {
    let of = Simulated {
        common: 4e-3,
        own: vec![5e-4; 6],
        noise: 2e-4,
        shared: 0.0,
        by_roughness: true,
    };
    let mut most = [0; 4];
    for split in of.splits() {
        let strongest = split.correlations.iter().enumerate();
        let strongest = strongest
            .min_by(|a, b| a.1.p.total_cmp(&b.1.p))
            .expect("a common part")
            .0;
        most[strongest] += 1;
        assert_eq!(split.correlations[2].covariate, "roughness");
    }
    assert!(most[2] > 120, "{most:?}");
    let unrelated = Simulated {
        by_roughness: false,
        ..of
    };
    let each = unrelated.splits();
    let each = each.iter().flat_map(|s| &s.correlations);
    let by_chance = each.filter(|c| c.p < 0.05).count();
    // 800 by chance, of which 40 are expected.
    assert!((20..=60).contains(&by_chance), "{by_chance} of 800");
}

#[test]
fn turns_that_some_pairs_lack_are_left_to_the_others() {
    let of = Simulated {
        common: 4e-3,
        own: vec![1e-3; 8],
        noise: 2e-4,
        shared: 0.0,
        by_roughness: false,
    };
    let mut body = of.body(3);
    let whole = split(&body).expect("pairs share turns");
    for (i, pair) in body.pairs.iter_mut().enumerate() {
        pair.errors[2 * i] = Vector3::repeat(f64::NAN);
    }
    let part = split(&body).expect("pairs share turns");
    assert_eq!([whole.turns, part.turns], [TURNS, TURNS]);
    assert!((part.common.rms / whole.common.rms - 1.0).abs() < 0.1);
    // One turn in which some err by far more does not count for a pair that lacks it.
    let before = split(&body).expect("pairs share turns").own[&8].rms;
    for pair in &mut body.pairs[..3] {
        let error = pair.errors[14];
        pair.errors[14] = error * (20e-3 / error.norm());
    }
    let after = split(&body).expect("pairs share turns").own;
    assert!(
        (after[&8].rms / before - 1.0).abs() < 0.1,
        "{} {before}",
        after[&8].rms
    );
    assert!(after[&1].rms > 2e-3, "{}", after[&1].rms);
    for pair in &mut body.pairs[1..] {
        pair.errors[5..].fill(Vector3::repeat(f64::NAN));
    }
    assert_eq!(split(&body), None);
}

#[test]
fn turns_of_several_recordings_narrow_the_intervals_of_the_pairs_that_all_have() {
    let of = Simulated {
        common: 4e-3,
        own: vec![1e-3; 4],
        noise: 2e-4,
        shared: 0.0,
        by_roughness: false,
    };
    let mut bodies: Vec<_> = (0..6).map(|seed| of.body(seed)).collect();
    bodies[3].pairs.remove(2);
    let joined = TurnErrors::joined(&bodies).expect("recordings");
    let [one, all] = [&bodies[0], &joined].map(|of| split(of).expect("pairs share turns"));
    assert_eq!(all.turns, 6 * TURNS);
    assert_eq!(all.own.keys().collect::<Vec<_>>(), [&1, &2, &4]);
    let left = 1.0 - FITTED as f64 / (2 * TURNS) as f64;
    let truth = of.common * left.sqrt();
    assert!((all.common.lower..=all.common.upper).contains(&truth));
    let width = |of: &Split| of.common.upper - of.common.lower;
    assert!(width(&all) < 0.6 * width(&one));
}

/// A unit that is held in twelve poses and turned between them by hand, a bump of half a second; each axis reads it by its own scale factor.
fn by_hand(mounted: &Matrix3<f64>, seed: u64) -> Samples {
    let mut random = Random(seed);
    let mut samples = Samples::default();
    let mut attitude = Rotation3::<f64>::identity();
    for pose in 0..14 {
        let turn = Vector3::from_fn(|_, _| random.normal()).normalize() * (1.0 + random.uniform());
        for k in 0..400 {
            // The last half second turns by a raised cosine.
            let at = (f64::from(k) - 350.0) / 50.0;
            let rate = match (pose < 13, at > 0.0) {
                (true, true) => turn * 2.0 * (1.0 - (TAU * at).cos()),
                _ => Vector3::zeros(),
            };
            let force = attitude.inverse() * Vector3::new(0.0, 0.0, 9.8);
            let noise =
                |random: &mut Random, size: f64| Vector3::from_fn(|_, _| size * random.normal());
            let rate_read = mounted * (rate + noise(&mut random, 1e-3));
            let force_read = mounted * (force + noise(&mut random, 0.01));
            samples.t_s.push(samples.t_s.len() as f64 / 100.0);
            for axis in 0..3 {
                samples.raw[axis].push(rate_read[axis]);
                samples.raw[3 + axis].push(force_read[axis]);
            }
            attitude *= Rotation3::from_scaled_axis(rate / 100.0);
        }
    }
    samples
}

/// The fit of a pair that is mounted so, in one motion that is sampled too slowly.
fn fitted(mounted: &Matrix3<f64>) -> Fit {
    let manifest = Manifest::new("unit", 100.0, 9.8, RawUnit::Si, Reference::Gravity);
    let prepared = Prepared::of(manifest, &by_hand(mounted, 5), DwellSearch::default());
    fit(prepared.expect("it has dwells"), Options::IN_SAMPLE).expect("it can be fitted")
}

#[test]
fn what_all_pairs_err_by_is_taken_out_of_the_turns_of_each_in_its_own_frame() {
    let mounted = [
        Matrix3::identity(),
        Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    ];
    let mut fits = mounted.each_ref().map(fitted);
    let errors = |fits: &[Fit; 3], take: bool| {
        let pairs = [0, 1, 2].map(|i| {
            let into_first = Rotation3::from_matrix_unchecked(mounted[i].transpose());
            (i as u8 + 1, &fits[i], into_first)
        });
        let errors = turn_errors(&pairs).expect("all turn");
        let own = if take {
            own_turns(&pairs, &errors)
        } else {
            Vec::new()
        };
        (errors, own)
    };
    let (before, own) = errors(&fits, true);
    for (fit, (_, prepared)) in fits.iter_mut().zip(own) {
        fit.prepared = prepared;
    }
    let (after, _) = errors(&fits, false);
    for (before, after) in before.pairs.iter().zip(&after.pairs) {
        for (before, after) in before.errors.iter().zip(&after.errors) {
            assert!(
                after.norm() < 0.05 * before.norm() + 1e-6,
                "{before} {after}"
            );
        }
    }
}

#[test]
fn one_motion_read_in_two_frames_errs_alike() {
    let mounted = Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let (first, second) = (fitted(&Matrix3::identity()), fitted(&mounted));
    let into_first = Rotation3::from_matrix_unchecked(mounted.transpose());
    let errors = turn_errors(&[(1, &first, Rotation3::identity()), (2, &second, into_first)]);
    let errors = errors.expect("both turn");
    assert_eq!(errors.conditions.len(), 13);
    let [a, b] = [0, 1].map(|i| &errors.pairs[i]);
    for (a, b) in a.errors.iter().zip(&b.errors) {
        // The axes that define the frame differ by the noise of their angles.
        assert!((a - b).norm() < 0.02 * a.norm() + 1e-6, "{a} {b}");
    }
    assert!(a.left > 0.3 && a.left < 0.9, "{}", a.left);
    // A raised cosine of half a second turns by half of its peak rate times half a second.
    let at = errors.conditions[0];
    assert!((at[0] / at[1] - 0.25).abs() < 0.01, "{at:?}");
}
