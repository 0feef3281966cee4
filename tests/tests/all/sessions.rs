//! Several sessions of one unit: what they predict, and what is named.

use mimu::judgement::{Judgement, JudgementKind};
use mimu::sessions::Sessions;
use mimu::sessions::class::PartClass;
use mimu::sessions::contradiction::{Finding, Kind};
use mimu::{Calibration, Sensor, verify};
use mimu_tests::says;
use mimu_tests::sessions::{
    ARRAY_UNITS, Carrier, Life, Shares, by_others, by_single, losing, of_array, of_model, of_next,
    on_bench, study,
};
use rayon::prelude::*;

fn combined(fits: Vec<mimu::Fit>) -> Sessions {
    Sessions::combine(fits, PartClass::Consumer).expect("one unit")
}

#[test]
fn a_dropped_unit_is_found_and_only_the_sessions_since_are_used() {
    let all = combined(on_bench(1, Life::Dropped, 5));
    assert_eq!(all.used, [false, false, true, true, true]);
    assert!(
        all.findings.iter().any(|f| f.kind == Kind::Step(2)),
        "{:?}",
        all.findings
    );
    let made = Calibration::of_sessions(&all, "2026-01-01T00:00:00Z").expect("a calibration");
    assert_eq!(
        made.judgement.kind,
        JudgementKind::Suspect,
        "{}",
        made.judgement
    );
    assert!(
        made.judgement.reason.contains("between sessions 2 and 3"),
        "{}",
        made.judgement
    );
    let text = made.calibration.to_toml();
    let read = Calibration::parse(&text, "cal.toml").expect("it reads what it writes");
    assert_eq!(read.sessions.iter().filter(|s| s.used).count(), 3);
}

#[test]
fn a_unit_that_ages_was_not_dropped() {
    for seed in 1..7 {
        let all = combined(on_bench(seed, Life::Ageing, 7));
        let is_step = |f: &Finding| matches!(f.kind, Kind::Step(_));
        assert!(
            !all.findings.iter().any(is_step),
            "{seed}: {:?}",
            all.findings
        );
        let used = all.used.iter().filter(|used| **used).count();
        assert!(used >= 6, "{seed}: {:?} {:?}", all.used, all.sentences());
    }
}

/// Sets of four clean sessions of this many units, on a table and by hand. None may contradict itself, and no calibration may be better than a session that it is
/// made from. Prints how many sets have another finding.
fn clean_sets(units: u64) {
    for carrier in Carrier::ALL {
        let others = |seed: u64| {
            let fits = (0..4).map(|k| losing(carrier, (seed, Life::PowerOn, k), [0, 0]));
            let all = combined(fits.collect());
            let sentences = all.sentences();
            assert!(
                all.inconsistent.iter().all(Option::is_none),
                "{carrier:?} {seed}: {sentences:?}"
            );
            let made =
                Calibration::of_sessions(&all, "2026-01-01T00:00:00Z").expect("a calibration");
            let used = all.fits.iter().zip(&all.used).filter(|(_, used)| **used);
            let worst = used.map(|(fit, _)| Judgement::of_fit(fit).kind).max();
            let kind = made.judgement.kind;
            assert!(
                worst <= Some(kind.max(JudgementKind::Untested)),
                "{worst:?}: {}",
                made.judgement
            );
            usize::from(!all.findings.is_empty())
        };
        let found: usize = (1..=units).into_par_iter().map(others).sum();
        println!(
            "{carrier:?}: of {units} sets none contradicts itself, {found} have another finding"
        );
    }
}

#[test]
fn clean_sessions_do_not_contradict_themselves() {
    clean_sets(3);
}

#[test]
fn each_session_is_given_once_and_all_are_of_one_unit() {
    let mut fits = on_bench(5, Life::PowerOn, 3);
    for (k, fit) in fits.iter_mut().enumerate() {
        fit.prepared.place = format!("session {k}");
    }
    let mut twice = fits.clone();
    twice.push(fits[2].clone());
    twice[3].prepared.place = "copy".into();
    let error = Sessions::combine(twice, PartClass::Consumer)
        .expect_err("a copy")
        .to_string();
    says(&error, &["copy: it has the samples of session 2"]);
    for (fit, device) in fits.iter_mut().zip(["unnamed", "a", "b"]) {
        fit.prepared.manifest.device = device.into();
    }
    let error = Sessions::combine(fits, PartClass::Consumer)
        .expect_err("two units")
        .to_string();
    says(&error, &["session 2", "session 1"]);
}

#[test]
fn two_sessions_take_the_class_and_its_name_is_written() {
    let two = combined(on_bench(2, Life::PowerOn, 2));
    assert_eq!(two.prior, Some(PartClass::Consumer));
    let made = Calibration::of_sessions(&two, "2026-01-01T00:00:00Z").expect("a calibration");
    assert_eq!(
        made.judgement.kind,
        JudgementKind::Untested,
        "{}",
        made.judgement
    );
    let between = made
        .calibration
        .between_sessions
        .clone()
        .expect("two sessions");
    assert!(between.prior.expect("a prior").starts_with("consumer"));
    let table = made.calibration.accel.expect("an accelerometer");
    let next = table.next_power_on.clone().expect("an interval");
    // A power-on changes the bias by far more than a session leaves open.
    let of_expected = table.interval_o.expect("an interval");
    assert!(
        next.interval_o[0] > 1.2 * of_expected[0],
        "{next:?} {of_expected:?}"
    );
}

#[test]
fn an_error_that_the_calibration_announces_is_no_fault_of_it() {
    let mut fits = on_bench(4, Life::PowerOn, 4);
    let tomorrow = fits.pop().expect("four").prepared;
    let one = Calibration::of(&fits[0], &[], "2026-01-01T00:00:00Z").expect("a calibration");
    let several = Calibration::of_sessions(&combined(fits), "2026-01-01T00:00:00Z");
    let several = several.expect("a calibration").calibration;
    let by_one = verify(&tomorrow, &one).expect("judged");
    let by_several = verify(&tomorrow, &several).expect("judged");
    // Of one session nobody knows what a power-on does, so what it did is unexplained.
    assert_eq!(
        by_one.judgement.kind,
        JudgementKind::Unexplained,
        "{}",
        by_one.judgement
    );
    assert_eq!(
        by_several.judgement.kind,
        JudgementKind::Good,
        "{}",
        by_several.judgement
    );
    let accel = by_several.sensors[Sensor::Accel]
        .as_ref()
        .expect("an accelerometer");
    let announced = accel.next_power_on.expect("of several sessions");
    assert!(
        accel.rms < announced.hypot(2.0 * accel.noise_floor),
        "{accel:?}"
    );
    assert!(
        announced < 0.2,
        "it announces {announced} m/s², and 3 mg is usual"
    );
}

#[test]
fn a_temperature_that_nobody_records_is_named() {
    let all = combined(on_bench(3, Life::Temperature, 7));
    let found = all.together.as_ref().expect("biases move together");
    assert!(found.share > 0.6 && found.p < 0.01, "{found:?}");
    let named = all.sentences().iter().any(|s| s.contains("temperature"));
    assert!(named, "{:?}", all.sentences());
}

#[test]
fn the_model_predicts_left_out_sessions_as_often_as_it_says() {
    // Two sessions are judged with units drawn from their class.
    for (sessions, ratio) in [(2, 3.0), (3, 3.0), (5, 1.0), (8, 3.0)] {
        let [left_out, truth, wide] = of_model(sessions, ratio, 300);
        println!(
            "{sessions} sessions, changes {ratio} times the error of a fit: {left_out:.3} of left-out estimates, {truth:.3} of true values inside, {wide:.2} times as wide as with known variances"
        );
        // Three of 300 runs of three parameters: 0.007 is the standard deviation.
        assert!(
            (0.925..0.985).contains(&left_out),
            "{sessions} {ratio} {left_out}"
        );
    }
}

#[test]
#[ignore = "nightly: 20,000 sets of sessions, a minute"]
fn coverage_of_the_model() {
    println!(
        "| sessions | changes over the error of a fit | left-out estimates, % | true values, % | half-width over that of known variances |\n|---|---|---|---|---|"
    );
    for sessions in [2, 3, 4, 5, 9] {
        for ratio in [0.0, 0.5, 1.0, 3.0, 10.0] {
            let [left_out, truth, wide] = of_model(sessions, ratio, 1500);
            println!(
                "| {sessions} | {ratio} | {:.1} | {:.1} | {wide:.2} |",
                100.0 * left_out,
                100.0 * truth
            );
            if ratio >= 1.0 {
                assert!(
                    (0.93..0.985).contains(&left_out),
                    "{sessions} {ratio} {left_out}"
                );
            }
        }
    }
}

/// Standard deviations that a share of 95 % of `count` values may be off, and values of a session are correlated.
fn check(name: &str, shares: &Shares, least: f64) {
    for sensor in ["gyro", "accel"] {
        for kind in ["scale", "angle", "bias"] {
            let [inside, count] = shares.of(&format!("{sensor} {kind}"));
            let share = f64::from(inside) / f64::from(count);
            assert!(
                share > least,
                "{name}, {sensor} {kind}: {inside} of {count}"
            );
        }
    }
}

#[test]
#[ignore = "nightly: 24 units of eight sessions in five lives, minutes"]
fn coverage_on_the_bench() {
    println!(
        "| life | predicted | gyro scale | angles | bias | accel scale | angles | bias |\n|---|---|---|---|---|---|---|---|"
    );
    for life in Life::ALL {
        let [single, left_out, next] = study(life, 24, 8);
        println!("| {} | by one session |{}", life.name(), single.line());
        println!("| | left-out session by the others |{}", left_out.line());
        println!("| | the next session by those before |{}", next.line());
        check(life.name(), &left_out, 0.90);
    }
}

#[test]
#[ignore = "nightly: public recordings, nine sessions of eight units"]
fn coverage_on_the_array() {
    let mut all = [Shares::default(), Shares::default(), Shares::default()];
    for unit in 0..ARRAY_UNITS {
        let Some(fits) = of_array(unit) else { return };
        let single = by_single(&fits);
        let combined = combined(fits.clone());
        println!("unit {}: {:?}", unit + 1, combined.sentences());
        // All of them err by 5 to 21 times their noise.
        assert!(combined.inconsistent.iter().all(Option::is_none));
        let left_out = by_others(&combined);
        let (next, _) = of_next(fits);
        for (sum, one) in all.iter_mut().zip([single, left_out, next]) {
            *sum = std::mem::take(sum).merge(one);
        }
    }
    println!(
        "| predicted | gyro scale | angles | bias | accel scale | angles | bias |\n|---|---|---|---|---|---|---|"
    );
    for (name, shares) in [
        "by one session",
        "left-out session by the others",
        "the ninth by the eight before",
    ]
    .iter()
    .zip(&all)
    {
        println!("| {name} |{}", shares.line());
        for (name, [inside, count]) in &shares.all {
            println!("    {name}: {inside} of {count}");
        }
    }
    check("array", &all[1], 0.90);
}
