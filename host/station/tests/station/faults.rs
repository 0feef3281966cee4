//! Each fault of a unit fails by the quantity that shows it, and a measurement that says nothing about the unit is refused.

use mimu::data_sheet::Part;
use mimu_recording::Batch;
use mimu_station::document::{Document, Verdict};
use mimu_station::gather::Samples;
use mimu_station::limits::Limits;
use mimu_station::quantities::measure;
use mimu_station::scale::Scale;

use super::bench::{COUNTS, LIMITS, RANGES, Unit, beyond, judged, up};

/// A unit whose readings were changed.
fn changed(unit: &Unit, change: impl Fn(&mut Batch)) -> Samples {
    let mut samples = unit.samples(7);
    change(&mut samples.batch);
    samples
}

#[test]
fn a_good_unit_passes() {
    for seed in 1..=5 {
        let document = judged(&Unit::default().samples(seed), LIMITS);
        assert_eq!(document.verdict, Verdict::Passed, "{:?}", beyond(&document));
        assert!(document.not_measured.is_empty(), "{document:?}");
        assert_eq!(document.up.as_deref(), Some("+z"));
    }
}

#[test]
fn each_fault_fails_by_its_own_quantity() {
    let good = Unit::default();
    let wrong_scale = Unit {
        accel_scale: [1.0, 1.0, 1.05],
        ..good.clone()
    };
    let offset = Unit {
        gyro_offset_dps: [0.0, 2.4, 0.0],
        ..good.clone()
    };
    let noisy = Unit {
        density: [0.011, 250.0],
        ..good.clone()
    };
    let slow = Unit {
        rate_hz: 960.0,
        ..good.clone()
    };
    let lossy = Unit {
        lost: 0.03,
        ..good.clone()
    };
    let upside_down = Unit {
        steps: up([0.0, 0.0, -1.0], 10.0),
        ..good.clone()
    };
    let map = |c: usize, of: fn(i64) -> i64| {
        changed(&good, move |batch| {
            batch.raw[c]
                .iter_mut()
                .for_each(|v| *v = of(*v as i64) as f64);
        })
    };
    #[rustfmt::skip]
    let cases = [
        ("scale factor", wrong_scale.samples(7), vec!["gravity_error"]),
        ("offset", offset.samples(7), vec!["gyro_y_offset"]),
        ("noise", noisy.samples(7), vec!["gyro_x_noise_density", "gyro_y_noise_density", "gyro_z_noise_density"]),
        ("rate", slow.samples(7), vec!["sample_rate"]),
        ("losses", lossy.samples(7), vec!["lost_samples"]),
        ("upside down", upside_down.samples(7), vec!["tilt"]),
        ("lowest bit set", map(1, |v| v | 1), vec!["gyro_y_stuck_bits"]),
        ("third bit clear", map(5, |v| v & !4), vec!["accel_z_stuck_bits"]),
    ];
    for (name, samples, expected) in cases {
        let document = judged(&samples, LIMITS);
        assert_eq!(document.verdict, Verdict::Failed, "{name}: {document:?}");
        assert_eq!(beyond(&document), expected, "{name}");
    }
}

#[test]
fn a_unit_that_moves_is_not_measured() {
    let good = Unit::default();
    // Turned to another side in the middle; tilted slowly by two degrees; knocked.
    let turned = Unit {
        steps: up([0.0, 0.0, 1.0], 4.0) + &up([0.0, 1.0, 0.0], 3.0),
        ..good.clone()
    };
    let tilted = Unit {
        steps: up([0.0, 0.0, 1.0], 4.0) + &up([0.0, 0.035, 1.0], 4.0),
        ..good.clone()
    };
    // By two degrees in four seconds.
    let creeping = changed(&good, |batch| {
        for k in 0..batch.raw[3].len() {
            let share = ((k as f64 - 2000.0) / 4000.0).clamp(0.0, 1.0);
            batch.raw[3][k] += (0.035 * COUNTS[1] * share).round();
        }
    });
    let knocked = changed(&good, |batch| {
        for k in 4500..4700 {
            let swing = (0.1 * k as f64).sin();
            batch.raw[0][k] += (400.0 * swing).round();
            batch.raw[3][k] += (2500.0 * swing).round();
        }
    });
    for (name, samples) in [
        ("turned", turned.samples(7)),
        ("tilted", tilted.samples(7)),
        ("creeping", creeping),
        ("knocked", knocked),
    ] {
        let document = judged(&samples, LIMITS);
        assert_eq!(
            document.verdict,
            Verdict::NotMeasured,
            "{name}: {:?}",
            beyond(&document)
        );
        let problem = document.problem.unwrap();
        assert!(problem.problem.contains("moved"), "{name}: {problem:?}");
        assert!(document.measurements.is_empty());
    }
}

#[test]
fn a_unit_on_another_side_than_the_file_asks_for_fails_without_a_row_of_tilt() {
    let limits = LIMITS.lines().filter(|line| !line.contains("\"tilt\""));
    let limits = limits.collect::<Vec<_>>().join("\n");
    assert!(limits.contains("up = \"+z\""), "{limits}");
    let upside_down = Unit {
        steps: up([0.0, 0.0, -1.0], 10.0),
        ..Unit::default()
    };
    let document = judged(&upside_down.samples(7), &limits);
    assert!(beyond(&document).contains(&"tilt"), "{document:?}");
}

#[test]
fn too_short_a_measurement_and_a_limit_without_a_measurement_are_refused() {
    let short = Unit {
        steps: up([0.0, 0.0, 1.0], 2.0),
        ..Unit::default()
    };
    let document = judged(&short.samples(7), LIMITS);
    let problem = document.problem.unwrap();
    assert!(problem.problem.contains("too few"), "{problem:?}");

    let three_sides = LIMITS.replace(
        "rows = [",
        "rows = [\n{ name = \"accel_offset\", lower = -50, upper = 50, unit = \"mg\" },",
    );
    let document = judged(&Unit::default().samples(7), &three_sides);
    let problem = document.problem.unwrap();
    assert!(
        problem.problem.contains("accel_offset") && problem.remedy.contains("--faces"),
        "{problem:?}"
    );
}

#[test]
fn a_silent_sensor_that_the_data_sheet_limits_is_no_pass() {
    let mut samples = Unit::default().samples(7);
    samples.batch.raw[3..].iter_mut().for_each(Vec::clear);
    let part = Part::find("mpu6050").unwrap();
    let scale = Scale::of(&samples, None, Some(&RANGES), Some(&part)).unwrap();
    let found = measure(&samples, &scale, None).unwrap();
    let judge = |part: Option<&Part>| {
        let limits = Limits::default();
        let document = Document::new("u", Vec::new(), "2026-01-01T00:00:00Z", &limits, part);
        document.judge(&found, &samples, &limits, part, &scale)
    };
    let refused = judge(Some(&part)).unwrap_err().to_string();
    assert!(refused.contains("limits the accel"), "{refused}");
    let judged = judge(None).unwrap();
    assert!(judged.not_measured.iter().any(|m| m.contains("accel")));
}
