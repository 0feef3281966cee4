//! Noise in use: nothing is inflated where nothing is wrong, and what is wrong comes out as itself. On real units, each session by the calibration
//! of the others.

use mimu::Calibration;
use mimu::in_use::{Against, Cause, NoiseInUse, noise_in_use};
use mimu::noise::noise_file::NoiseFile;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::sessions::Sessions;
use mimu::sessions::class::PartClass;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_rig::random::Random;
use mimu_tests::flight::{self, Flight};
use mimu_tests::noise_in_use::{Wrong, case, row};
use mimu_tests::sessions::{ARRAY_SESSIONS, ARRAY_UNITS, of_array, of_array_recorded};
use nalgebra::Vector3;
use rayon::prelude::*;

const HEAD: &str = "| wrong | seed | segments | gyro white | accel white | gyro walk | accel walk | NEES Allan | with calibration | in use | causes |";

fn cases(wrong: Wrong, poses: usize, seeds: std::ops::Range<u64>) -> Vec<(u64, NoiseInUse)> {
    let all: Vec<_> = seeds
        .into_par_iter()
        .filter_map(|seed| match case(wrong, poses, seed) {
            Ok(found) => Some((seed, found)),
            Err(refused) => {
                println!("{wrong:?}, seed {seed}: {refused}");
                None
            }
        })
        .collect();
    println!("{HEAD}");
    for (seed, found) in &all {
        println!("{}", row(wrong, *seed, found));
    }
    all
}

/// How many of the four intervals of the factor contain 1, and how many there are.
fn not_inflated(all: &[(u64, NoiseInUse)]) -> (usize, usize) {
    let ends = all.iter().flat_map(|(_, found)| &found.densities);
    let ends: Vec<[f64; 2]> = ends.filter_map(|d| d.factor_interval).collect();
    (
        ends.iter().filter(|i| i[0] <= 1.0 + 1e-9).count(),
        ends.len(),
    )
}

fn first_of_gyro(found: &NoiseInUse) -> Option<Cause> {
    let causes = found.causes.iter();
    causes
        .filter(|c| c.sensor == Some(Sensor::Gyro))
        .map(|c| c.cause)
        .next()
}

#[test]
#[ignore = "nightly: twenty seeds of five units"]
fn table_of_causes() {
    let mut named = Vec::new();
    for (wrong, cause) in [
        (Wrong::Nothing, None),
        (Wrong::Calibrated, None),
        (Wrong::Scale, Some(Cause::Scale)),
        (Wrong::GSensitivity, Some(Cause::GSensitivity)),
        (Wrong::Vibration, Some(Cause::Rectification)),
    ] {
        let all = cases(wrong, 40, 0..20);
        let (inside, count) = not_inflated(&all);
        let right = all
            .iter()
            .filter(|(_, f)| first_of_gyro(f) == cause)
            .count();
        let consistent = all
            .iter()
            .filter(|(_, f)| (0.8..=1.25).contains(&f.nees.in_use.value));
        println!(
            "{wrong:?}: factor 1 inside {inside} of {count}; cause right {right} of {}; NEES in use 0.8 to 1.25 in {}",
            all.len(),
            consistent.count()
        );
        named.push((wrong, inside, count, right, all.len()));
    }
    for (wrong, inside, count, right, runs) in named {
        if wrong == Wrong::Nothing {
            // 95 % of 80; fewer than 71 have a probability of 2e-2.
            assert!(inside * 80 >= 71 * count, "{inside} of {count}");
        }
        assert!(right * 10 >= 8 * runs, "{wrong:?}: {right} of {runs}");
    }
}

/// A flight of which biases, mounting, clock and reference are wrong, each by its own amount, and the white noise in motion is `white` times that at rest.
fn flight(seed: u64, white: f64) -> Flight {
    let mut random = Random::new(seed, "what is wrong");
    let mut vector = |size: f64| Vector3::from_fn(|_, _| size * random.normal());
    Flight {
        duration_s: 150.0,
        bias: [vector(0.05), vector(0.2)],
        mounting: vector(0.04),
        lever_m: vector(0.05),
        late_s: vector(0.02).x,
        reference: [vector(1e-3).x.abs(), vector(2e-3).x.abs()],
        white: [white; 2],
        ..Flight::default()
    }
}

fn flown(flight: &Flight, seed: u64) -> NoiseInUse {
    let (recording, trajectory) = flight.flown(seed);
    let calibration = Calibration::of_si(&recording.manifest).unwrap();
    let noise = flight::noise();
    let found = |against| noise_in_use(&recording, &calibration, &noise, against, |_| ());
    if flight.rests {
        let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).unwrap();
        return found(Against::Rests(&prepared)).unwrap();
    }
    found(Against::Trajectory(&trajectory)).unwrap()
}

/// Which of the four factors have the truth in their intervals.
fn true_factors(flight: &Flight, found: &NoiseInUse) -> [bool; 4] {
    std::array::from_fn(|k| {
        let [low, high] = found.densities[k].factor_interval.unwrap();
        let truth = flight
            .white
            .get(k)
            .map_or(1.0, |white| flight.in_segment(*white, found.segment_s));
        low <= truth + 1e-9 && truth <= high
    })
}

/// How many of the estimates have the truth in their intervals, and how many there are.
fn true_estimates(flight: &Flight, found: &NoiseInUse) -> (usize, usize) {
    let mounted = found.mounted.as_ref().unwrap();
    let vectors = [
        (found.biases.gyro, flight.bias[0]),
        (found.biases.accel, flight.bias[1]),
        (mounted.rotation_rad, flight.mounting),
        (mounted.lever_m, flight.lever_m),
    ];
    let each = vectors
        .into_iter()
        .flat_map(|(own, truth)| (0..3).map(move |k| (own[k], truth[k])));
    let all: Vec<_> = each.chain([(mounted.clock_s, -flight.late_s)]).collect();
    let inside = all
        .iter()
        .filter(|(own, truth)| (own.interval[0]..=own.interval[1]).contains(truth));
    (inside.count(), all.len())
}

/// Prints how often the intervals of flights contain the truth; the same as counts: factors, then estimates.
fn coverage(flights: impl Fn(u64) -> Flight + Sync, count: u64) -> (usize, usize) {
    let each = (0..count).into_par_iter().map(|seed| {
        let flight = flights(seed);
        let found = flown(&flight, seed);
        println!("{}", row(Wrong::Nothing, seed, &found));
        let estimates = found
            .mounted
            .is_some()
            .then(|| true_estimates(&flight, &found));
        (
            true_factors(&flight, &found),
            estimates.unwrap_or_default(),
            found.judgement.is_good(),
        )
    });
    let each: Vec<_> = each.collect();
    let factors = [0, 1, 2, 3].map(|k| each.iter().filter(|(inside, ..)| inside[k]).count());
    let estimates = each.iter().map(|(_, estimates, _)| estimates.0).sum();
    let all: usize = each.iter().map(|(_, estimates, _)| estimates.1).sum();
    let good = each.iter().filter(|(.., good)| *good).count();
    println!("of {count}: factors {factors:?}, estimates {estimates} of {all}, good {good}");
    (factors.into_iter().sum(), estimates)
}

#[test]
fn biases_mounting_and_clock_of_a_trajectory_are_no_noise() {
    // Each of what is wrong alone made factors of 20, 9 and 8 once.
    let flight = Flight {
        duration_s: 90.0,
        bias: [Vector3::new(0.0, 0.02, 0.076), Vector3::new(-0.1, 0.1, 0.2)],
        mounting: Vector3::new(0.04, -0.03, 0.04),
        lever_m: Vector3::new(0.05, 0.0, -0.05),
        late_s: 0.06,
        reference: [3e-4, 1e-3],
        white: [1.0; 2],
        ..Flight::default()
    };
    let found = flown(&flight, 1);
    println!("{}", row(Wrong::Nothing, 1, &found));
    assert_eq!(true_factors(&flight, &found), [true; 4]);
    let (inside, all) = true_estimates(&flight, &found);
    // Of thirteen 95 % intervals, four miss in one flight of three hundred.
    assert!(inside + 3 >= all, "{inside} of {all}");
    let clock = found.mounted.as_ref().unwrap().clock_s;
    assert!(
        clock.half() < 1e-3 && (clock.value + 0.06).abs() < 1e-3,
        "{clock:?}"
    );
}

#[test]
fn white_noise_in_motion_between_rests_is_the_motions() {
    let flight = Flight {
        duration_s: 150.0,
        white: [5.0, 1.0],
        rests: true,
        ..Flight::default()
    };
    let found = flown(&flight, 1);
    println!("{}", row(Wrong::Nothing, 1, &found));
    let [low, high] = found.densities[0].factor_interval.unwrap();
    assert!(
        low > 1.0 && (low..=high).contains(&flight.in_segment(5.0, found.segment_s)),
        "{low} to {high}"
    );
}

#[test]
#[ignore = "nightly: 120 flights and 120 records with rests"]
fn intervals_of_noise_in_use_contain_the_truth() {
    for white in [1.0, 3.0, 10.0] {
        println!("white noise in motion {white} times that at rest, by a trajectory");
        let (factors, estimates) = coverage(|seed| flight(seed, white), 40);
        // 95 % of 160 and of 520: fewer have a probability of 1e-2.
        assert!(factors >= 145 && estimates >= 481, "{factors}, {estimates}");
    }
    for white in [3.0, 5.0, 10.0] {
        println!("white noise in motion {white} times that at rest, by rests");
        let between_rests = |_| Flight {
            duration_s: 240.0,
            white: [white; 2],
            rests: true,
            ..Flight::default()
        };
        let (factors, _) = coverage(between_rests, 40);
        assert!(factors >= 145, "{factors}");
    }
}

/// Densities at rest of an MPU-6050, the same sensors: by `mimu allan` of the ten minutes of sunsided (docs/recordings.md).
fn at_rest() -> NoiseFile {
    let mut text = String::from(
        "format = \"mimu-noise/1\"\ndevice = \"mpu6050\"\nsample_rate_hz = 99.3\nduration_s = 655.0\nconfidence = 0.95\n",
    );
    for (name, unit, n) in [
        ("gyro_x", "rad/s", 2.19e-4),
        ("gyro_y", "rad/s", 1.60e-4),
        ("gyro_z", "rad/s", 1.69e-4),
        ("accel_x", "m/s^2", 2.98e-3),
        ("accel_y", "m/s^2", 3.07e-3),
        ("accel_z", "m/s^2", 4.90e-3),
    ] {
        text += &format!(
            "[[channel]]\nname = \"{name}\"\nunit = \"{unit}\"\nsamples = 65000\n\
             n = {{ value = {n:e}, sigma = 0.0, lower = {n:e}, upper = {n:e}, unit = \"{unit}\" }}\n"
        );
    }
    NoiseFile::parse(&text, "noise").unwrap()
}

#[test]
#[ignore = "nightly: 72 real sessions, minutes"]
fn sessions_of_the_array_by_the_calibration_of_the_others() {
    let noise = at_rest();
    let mut all: Vec<[f64; 2]> = Vec::new();
    let mut good = 0;
    for unit in 0..ARRAY_UNITS {
        let Some(fits) = of_array(unit) else { return };
        let of = |k: usize| {
            let mut others = fits.clone();
            others.remove(k);
            let sessions = Sessions::combine(others, PartClass::Consumer).ok()?;
            let made = Calibration::of_sessions(&sessions, "2026-01-01T00:00:00Z").ok()?;
            let (_folder, recording) = of_array_recorded(unit, k)?;
            let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).ok()?;
            let against = Against::Rests(&prepared);
            noise_in_use(&recording, &made.calibration, &noise, against, |_| ()).ok()
        };
        let found: Vec<_> = (0..ARRAY_SESSIONS).into_par_iter().map(of).collect();
        for (k, found) in found.into_iter().enumerate() {
            let found = found.unwrap_or_else(|| panic!("unit {unit}, session {k}"));
            println!("{}", row(Wrong::Calibrated, k as u64, &found));
            let nees = &found.nees;
            let [low, high] = nees.in_use.by_chance;
            good += usize::from((low.min(0.8)..=high.max(1.25)).contains(&nees.in_use.value));
            all.push([nees.allan.value, nees.in_use.value]);
        }
    }
    let quantiles = |k: usize| {
        let mut of: Vec<f64> = all.iter().map(|n| n[k]).collect();
        of.sort_by(f64::total_cmp);
        [0.1, 0.5, 0.9].map(|q| of[(q * (of.len() - 1) as f64) as usize])
    };
    println!(
        "{} sessions: NEES at 10, 50, 90 %: Allan {:.2?}, in use {:.2?}; good {good}",
        all.len(),
        quantiles(0),
        quantiles(1)
    );
    assert!(quantiles(1)[1] < 2.0 && quantiles(0)[1] > 5.0);
}
