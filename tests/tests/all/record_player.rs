//! A gyro on a record player: results from good recordings, and messages for bad ones.

use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::result::fit::FitResult;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::turntable::RatedDwells;
use mimu_cli::report::fit_text;
use mimu_recording::error::Result;
use mimu_recording::{
    ImportOptions, RawUnit, Recording, Reference, Turntable, TurntableRate, import,
};
use mimu_rig::random::Random;
use mimu_rig::rig_file::RigFile;
use mimu_tests::bench;
use mimu_tests::says;

fn unit(seed: u64) -> RigFile {
    let mut random = Random::new(seed, "unit");
    let gyro = bench::in_own_frame(bench::gyro(&mut random));
    bench::clean(gyro, bench::accel(&mut random))
}

fn turntable(rates: &str, error: f64) -> Turntable {
    let rates: Vec<TurntableRate> = rates
        .split(',')
        .map(|r| r.parse().expect("a rate"))
        .collect();
    Turntable::new(&rates, error)
}

/// The steps of a plan that `kept` selects by number.
fn steps(plan: &str, kept: impl Fn(usize) -> bool) -> String {
    let mut steps = plan.split("[[step]]");
    let head = steps.next().expect("a head").to_owned();
    let kept = steps.enumerate().filter(|(i, _)| kept(*i));
    kept.fold(head, |plan, (_, step)| plan + "[[step]]" + step)
}

const SEED: u64 = 5;

fn recorded(plan: &str, turntable: Turntable) -> Prepared {
    bench::on_a_turntable(plan, &unit(SEED), SEED, turntable)
}

fn fitted(plan: &str, turntable: Turntable) -> Result<Fit> {
    fit(recorded(plan, turntable), Options::default())
}

fn said(fit: &Fit) -> String {
    let of_sensors = fit.sensors.iter().flat_map(|s| &s.warnings);
    let all: Vec<String> = fit
        .warnings
        .iter()
        .chain(of_sensors)
        .map(ToString::to_string)
        .collect();
    all.join("\n")
}

fn refused(plan: &str, turntable: Turntable) -> String {
    let error = fitted(plan, turntable).expect_err("is refused").to_string();
    assert!(!error.contains('\n'), "{error}");
    error
}

#[test]
fn dwells_that_nobody_numbered_are_found_and_given_their_rates() {
    let plan = bench::record_player_plan(14, [0.0; 2], SEED);
    let folder = bench::written(&plan, &unit(SEED), SEED);
    let mut recording = Recording::open(&folder.path().join("recording")).expect("a recording");
    recording.manifest.reference = Reference::TurntableRate;
    recording.manifest.turntable = Some(turntable("200,270", 0.001));
    let found = mimu::signal::stillness::DwellSearch {
        steps: mimu::signal::stillness::Steps::Found,
        ..STILL_FACTOR.into()
    };
    let prepared = Prepared::read(&recording, found, |_| ()).expect("readable");
    let rated = RatedDwells::of(&prepared).expect("rated");
    // The bench's table slews at 60 deg/s between its rates and then rests for a while.
    assert!(rated.rests.len() >= 14, "{}", rated.rests.len());
    for rate in 0..2 {
        assert_eq!(rated.rate_of.iter().filter(|r| **r == rate).count(), 14);
    }
    let fit = fit(prepared, Options::default()).expect("a fit");
    let gyro = fit.sensor(Sensor::Gyro).expect("a gyro");
    assert_eq!(gyro.dwells, 28 + rated.rests.len());
    let held_out = gyro.held_out_rms().expect("held out").to_degrees();
    assert!(held_out < 0.1, "{held_out} deg/s held out");
    let accel = fit.sensor(Sensor::Accel).expect("an accelerometer");
    assert_eq!(accel.dwells, rated.rests.len(), "at rest only");
}

#[test]
fn the_error_of_the_rates_is_printed_and_in_the_intervals_and_no_number_of_dwells_reduces_it() {
    let plan = bench::record_player_plan(14, [0.0; 2], SEED);
    let relative = |fit: &Fit| {
        let triad = &fit.sensor(Sensor::Gyro).expect("a gyro").estimated.triad;
        let scale = triad.forward_estimates()[0];
        scale.interval / scale.value
    };
    let rough = fitted(&plan, turntable("200,270", 0.01)).expect("a fit");
    assert!(
        said(&rough).contains("known to ±1.00 % (95 %)"),
        "{}",
        said(&rough)
    );
    // For two rates with independent errors, the mean improves by √2 at most.
    assert!(
        (0.006..0.0105).contains(&relative(&rough)),
        "{}",
        relative(&rough)
    );
    let twice = fitted(
        &bench::record_player_plan(28, [0.0; 2], SEED),
        turntable("200,270", 0.01),
    );
    let twice = relative(&twice.expect("a fit"));
    assert!((twice / relative(&rough) - 1.0).abs() < 0.05, "{twice}");
}

#[test]
fn one_rate_without_rests_is_enough_in_many_orientations_and_names_what_lacks_in_few() {
    let plan = bench::record_player_plan(14, [0.0; 2], SEED);
    let only = |kept: fn(usize) -> bool| steps(&plan, kept);
    let fit = fitted(&only(|i| i % 3 == 1), turntable("200", 0.001)).expect("a fit");
    assert_eq!(fit.sensor(Sensor::Gyro).expect("a gyro").dwells, 14);
    assert!(
        said(&fit).contains("accel: not calibrated"),
        "{}",
        said(&fit)
    );
    let error = refused(&only(|i| i % 3 == 1 && i < 24), turntable("200", 0.001));
    says(&error, &["add dwells with each axis up, down"]);
}

#[test]
fn dwells_about_one_axis_are_refused_with_the_axes_that_did_not_turn() {
    let plan = bench::record_player_plan(14, [0.0; 2], SEED);
    let about_z: Vec<String> = (0..4)
        .map(|_| steps(&plan, |i| (12..18).contains(&i)))
        .collect();
    let (head, _) = about_z[0].split_once("[[step]]").expect("steps");
    let again = about_z
        .iter()
        .map(|p| p.strip_prefix(head).expect("a head"));
    let error = refused(
        &again.fold(head.to_owned(), |all, p| all + p),
        turntable("200,270", 0.001),
    );
    assert!(error.contains("no dwell turns about x, y"), "{error}");
}

#[test]
fn a_step_with_the_rate_of_another_speed_is_named() {
    let plan = bench::record_player_plan(14, [0.0; 2], SEED);
    // Step 4 turns at 200 deg/s.
    let error = refused(&plan, turntable("200,270,4=270", 0.001));
    says(&error, &["dwell 4", "270"]);
    let error = refused(&plan, turntable("200,270,edge=270", 0.001));
    says(&error, &["no dwell has the number or label edge"]);
    let error = refused(&plan, turntable("200", 0.001));
    assert!(error.contains("give all rates of the turntable"), "{error}");
}

#[test]
fn rates_that_contradict_each_other_are_said_and_readings_in_si_tell_33_rpm_from_45() {
    let off = bench::record_player_plan(14, [0.0, 0.02], SEED);
    let fit = fitted(&off, turntable("200,270", 0.001)).expect("a fit");
    assert!(
        said(&fit).contains("contradict each other"),
        "{}",
        said(&fit)
    );
    let text = fit_text(&FitResult::of(&fit), false);
    assert!(text.contains("next: correct the rates"), "{text}");
    // A unit that reports approximately rad/s: 5 mV/(deg/s) about 2.5 V.
    let plan = steps(&bench::record_player_plan(14, [0.0; 2], SEED), |i| {
        i % 3 < 2
    });
    let folder = bench::written(&plan, &unit(SEED), SEED);
    let said_of = |rate: &str| {
        let samples = folder.path().join("recording").join("samples.parquet");
        let mut options = ImportOptions::new(
            vec![samples],
            9.80665,
            RawUnit::Si,
            Reference::TurntableRate,
        );
        let per_volt = 200f64.to_radians();
        options.log.scale = vec![
            format!("gyro={per_volt}").parse().expect("a scale"),
            "accel=12.5".parse().expect("a scale"),
        ];
        options.log.offset = ["x", "y", "z"]
            .map(|axis| {
                format!("gyro_{axis}={}", -2.5 * per_volt)
                    .parse()
                    .expect("an offset")
            })
            .into();
        options.log.rate_dps = vec![rate.parse().expect("a rate")];
        options.log.rate_error = Some(0.001);
        let out = folder.path().join(rate);
        import(&options, &out, |_| ()).expect("imported");
        let recording = Recording::open(&out).expect("a recording");
        fit_warnings(Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable"))
    };
    assert!(!said_of("200").contains("33 1/3 rpm"), "{}", said_of("200"));
    let wrong = said_of("270");
    says(
        &wrong,
        &["was the turntable at 33 1/3 rpm while the rate of 45 rpm is given?"],
    );
}

fn fit_warnings(prepared: Prepared) -> String {
    match fit(prepared, Options::default()) {
        Ok(fit) => said(&fit),
        Err(error) => error.to_string(),
    }
}
