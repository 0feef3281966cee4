//! The noise of the unit at rest, as used by the other commands.

use mimu::fit::{Options, fit};
use mimu::noise::noise_file::NoiseFile;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::warning::Warning;
use mimu_tests::bench;

const SEED: u64 = 3;

/// A recording with the true noise of its unit.
fn recorded() -> (Prepared, NoiseFile) {
    let file = bench::drawn(SEED, "unit");
    let prepared = bench::recorded(&bench::table_plan(Some(SEED)), &file, SEED);
    let noise = bench::noise_file(&file, SEED, prepared.condensed.period_s);
    (prepared, noise)
}

fn gyro_floor(prepared: Prepared) -> f64 {
    let fitted = fit(prepared, Options::IN_SAMPLE).unwrap();
    fitted.sensor(Sensor::Gyro).unwrap().noise_floor()
}

#[test]
fn a_channel_whose_dwells_are_not_as_noisy_as_the_file_says_keeps_its_own_noise_and_is_told_of() {
    let (prepared, mut noise) = recorded();
    let own = prepared.noise.variance(0, 3.0, f64::NAN);
    for channel in &mut noise.channel {
        if channel.name == "gyro_x" {
            let quiet = 0.1 * channel.n.as_ref().unwrap().value;
            channel.n.as_mut().unwrap().value = quiet;
        }
    }
    let stated = prepared.with_noise(&noise).unwrap();
    assert_eq!(stated.noise.variance(0, 3.0, f64::NAN), own);
    let told: Vec<_> = stated
        .dwells
        .warnings
        .iter()
        .map(Warning::to_string)
        .filter(|w| w.starts_with("gyro_x"))
        .collect();
    assert!(told.len() == 1 && told[0].contains("as noisy"), "{told:?}");
    assert!(
        !stated.noise.has_noise_at_rest(Sensor::Gyro)
            && stated.noise.has_noise_at_rest(Sensor::Accel)
    );
}

#[test]
fn wander_between_the_dwells_is_in_the_noise_floor() {
    let (prepared, mut noise) = recorded();
    let bare = gyro_floor(prepared.clone());
    for channel in &mut noise.channel {
        let walk = channel.n.as_ref().unwrap().value;
        channel.k.as_mut().unwrap().value = walk;
    }
    // With a random walk K = N/s, its variance averages K² T/6 over a session of length T; T is 22 dwells and the moves.
    let dwells = &prepared.dwells.list;
    let session_s = dwells.last().unwrap().last_s - dwells[0].start_s;
    let stated = gyro_floor(prepared.with_noise(&noise).unwrap());
    let expected = (1.0 / 3.0 + session_s / 6.0) / (1.0 / 3.0);
    let ratio = (stated / bare).powi(2);
    assert!(
        (0.7..1.4).contains(&(ratio / expected)),
        "{ratio} {expected}"
    );
}

#[test]
fn noise_is_that_of_the_temperature_of_the_dwell() {
    // fang, Table 5: variances that change with the temperature.
    let (mut prepared, mut noise) = recorded();
    let n = noise.channel.len();
    for i in 0..n {
        let mut warm = noise.channel[i].clone();
        noise.channel[i].temp_c = Some(20.0);
        warm.temp_c = Some(40.0);
        let hotter = 1.2 * warm.n.as_ref().unwrap().value;
        warm.n.as_mut().unwrap().value = hotter;
        noise.channel.push(warm);
    }
    for dwell in &mut prepared.dwells.list {
        dwell.temp_c = 30.0;
    }
    let stated = prepared.with_noise(&noise).unwrap();
    let white = |t| stated.noise.variance(0, 1e-6, t) * 1e-6;
    let cold = white(10.0);
    for (temp_c, known) in [
        (20.0, 1.0),
        (30.0, 0.5 * (1.0 + 1.44)),
        (40.0, 1.44),
        (90.0, 1.44),
    ] {
        assert!(
            (white(temp_c) / cold / known - 1.0).abs() < 1e-6,
            "{temp_c}"
        );
    }
}
