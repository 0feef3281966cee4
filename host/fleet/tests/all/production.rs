//! Productions with faults that are known: which are found, and how often production without any raises an alarm.

use std::time::Instant;

use mimu::JudgementKind;
use mimu_fleet::{Fleet, Options, fleet};

use crate::plant::{Faults, Plant, processor_time};

fn result(plant: &Plant) -> Fleet {
    fleet(plant.tree(), None, &Options::default()).unwrap()
}

/// Names of everything that is found.
fn found(fleet: &Fleet) -> Vec<String> {
    let mut all: Vec<String> = fleet
        .different
        .iter()
        .map(|d| format!("{} {} {}", d.label, d.level, d.sensor))
        .collect();
    all.extend(fleet.changed.iter().map(|c| {
        format!(
            "{} {} since {} {}",
            c.label,
            c.level,
            c.chart.since.as_deref().unwrap_or("-"),
            c.chart.parameter
        )
    }));
    all.extend(fleet.changed_units.iter().map(|c| {
        format!(
            "unit {} {} {} since {}",
            c.unit,
            c.chart.sensor,
            c.chart.parameter,
            c.chart.since.as_deref().unwrap_or("-")
        )
    }));
    let charts = fleet
        .drift
        .iter()
        .flat_map(|d| &d.charts)
        .filter(|c| c.signal.is_some());
    all.extend(charts.map(|c| {
        format!(
            "drift {} {} since {}",
            c.sensor,
            c.parameter,
            c.since.as_deref().unwrap_or("-")
        )
    }));
    all
}

#[test]
fn production_without_faults_is_one_population() {
    let fleet = result(&Plant::new(1500, 1));
    assert_eq!(
        fleet.judgement.kind,
        JudgementKind::Good,
        "{} {:?} {:?}",
        fleet.judgement,
        found(&fleet),
        fleet.strangers
    );
    assert_eq!((fleet.units, fleet.measurements), (1500, 1500));
    let gyro = fleet.sensors.gyro.as_ref().unwrap();
    let accel = fleet.sensors.accel.as_ref().unwrap();
    // Gravity shows no misalignment of the accelerometer.
    assert_eq!((gyro.parameters.len(), accel.parameters.len()), (12, 9));
    let sigma = |name: &str| {
        gyro.parameters
            .iter()
            .find(|p| p.name == name)
            .unwrap()
            .sigma
    };
    for (name, truth) in [
        ("scale_x", 5e-3),
        ("misalignment_y", 6e-3),
        ("non_orthogonality_zx", 3e-3),
        ("bias_z", 0.01),
    ] {
        assert!(
            (sigma(name) / truth - 1.0).abs() < 0.1,
            "{name}: {} {truth}",
            sigma(name)
        );
    }
}

#[test]
fn a_bad_batch_a_drift_and_a_moved_fixture_are_found() {
    let faults = Faults {
        batch: 2.0,
        drift: 2.0,
        fixture: 2.0,
        ..Faults::default()
    };
    let fleet = result(&Plant {
        faults,
        ..Plant::new(2000, 2)
    });
    let found = found(&fleet);
    assert_eq!(fleet.judgement.kind, JudgementKind::Suspect);
    let has = |what: &str| found.iter().any(|f| f.starts_with(what));
    assert!(has("batch 07 gyro"), "{found:?}");
    // Fixture C moved on day 60, 2026-03-06.
    assert!(has("fixture C since 2026-03-0"), "{found:?}");
    // It begins on 2026-03-18 and grows slowly; the average last was at the centre some days later.
    assert!(
        has("drift accel bias_z since 2026-03") || has("drift accel bias_z since 2026-04-0"),
        "{found:?}"
    );
    let others = found
        .iter()
        .filter(|f| {
            f.starts_with("operator") || f.starts_with("fixture A") || f.contains("drift gyro")
        })
        .count();
    assert_eq!(others, 0, "{found:?}");
}

#[test]
fn operators_and_repetitions_are_separated_from_units() {
    let fleet = result(&Plant {
        repeated: 30,
        operator: 0.3,
        repetition: 0.2,
        fit: 0.1,
        ..Plant::new(300, 4)
    });
    let gage = fleet.gage.as_ref().unwrap();
    assert_eq!((gage.units, gage.measurements), ([30, 30], 180));
    assert_eq!(gage.factors, ["operator"]);
    // 0.2 of repetitions and 0.1 to 0.2 of fits; three operators scatter themselves, so their mean over 21 parameters counts.
    let sizes = |p: &mimu_fleet::result::GageOfParameter| {
        let kinds = [
            ("scale", 0),
            ("misalignment", 1),
            ("non_orthogonality", 2),
            ("bias", 3),
        ];
        let kind = kinds.iter().find(|k| p.name.starts_with(k.0)).unwrap().1;
        [crate::plant::GYRO, crate::plant::ACCEL][usize::from(p.sensor == mimu::Sensor::Accel)]
            [kind]
    };
    let count = gage.parameters.len() as f64;
    assert_eq!(count, 21.0);
    let mean = |of: &dyn Fn(&mimu_fleet::result::GageOfParameter) -> f64| {
        let squares = gage.parameters.iter().map(|p| (of(p) / sizes(p)).powi(2));
        (squares.sum::<f64>() / count).sqrt()
    };
    let repeatability = mean(&|p| p.repeatability.value);
    // The mean square of 2^u, u from -1 to 1, is 1.353.
    let expected = (0.2f64.powi(2) + 1.353 * 0.1f64.powi(2)).sqrt();
    assert!(
        (repeatability / expected - 1.0).abs() < 0.05,
        "{repeatability} {expected}"
    );
    let reproducibility = mean(&|p| p.reproducibility.value);
    assert!(
        (reproducibility / 0.3 - 1.0).abs() < 0.35,
        "{reproducibility}"
    );
    let units = mean(&|p| p.between_units.value);
    assert!((units - 1.0).abs() < 0.15, "{units}");
}

#[test]
fn a_calibration_that_contradicts_five_others_of_its_unit_is_named_and_not_used() {
    let mut tree = Plant {
        repeated: 20,
        repetition: 0.1,
        fit: 0.1,
        ..Plant::new(100, 5)
    }
    .tree();
    let (values, _) = tree.measurements[8].of.triads.gyro.as_mut().unwrap();
    values[5] += 3.0 * crate::plant::GYRO[1];
    let fleet = fleet(tree, None, &Options::default()).unwrap();
    let named: Vec<&str> = fleet
        .contradicting
        .iter()
        .map(|c| c.files[0].as_str())
        .collect();
    assert_eq!(named, ["u00001-2.toml"]);
    assert_eq!(fleet.contradicting[0].parameter, "misalignment_z");
    assert!(fleet.strangers.is_empty(), "{:?}", fleet.strangers);
}

#[test]
fn a_golden_unit_that_ages_is_named_and_one_that_does_not_is_none_of_the_findings() {
    let with = |golden: f64| {
        let faults = Faults {
            golden: Some(golden),
            ..Faults::default()
        };
        result(&Plant {
            faults,
            ..Plant::new(1000, 6)
        })
    };
    let aged = with(1.0);
    // It begins on 2026-03-18 and grows to five errors of a fit.
    let all = found(&aged);
    assert_eq!(all.len(), 1, "{all:?}");
    assert!(
        all[0].starts_with("unit golden gyro scale_x since 2026-03")
            || all[0].starts_with("unit golden gyro scale_x since 2026-04"),
        "{all:?}"
    );
    let change = aged.changed_units[0].chart.change.unwrap();
    assert!(
        (0.5..1.2).contains(&(change / crate::plant::GYRO[0])),
        "{change}"
    );
    assert!(aged.strangers.is_empty() && aged.contradicting.is_empty());
    assert!(
        aged.judgement.to_string().contains("unit golden changes"),
        "{}",
        aged.judgement
    );
    let constant = with(0.0);
    assert_eq!(
        constant.judgement.kind,
        JudgementKind::Good,
        "{}",
        constant.judgement
    );
}

#[test]
#[ignore = "nightly: 10,000 units, forty productions"]
fn ten_thousand_units_with_faults_and_without() {
    let faults = Faults {
        batch: 1.0,
        drift: 1.0,
        fixture: 1.0,
        stranger: 500,
        far: 6.0,
        golden: Some(1.0),
    };
    let plant = Plant {
        faults,
        ..Plant::new(10_000, 7)
    };
    let tree = plant.tree();
    let (begun, time) = (Instant::now(), processor_time());
    let with = fleet(tree, None, &Options::default()).unwrap();
    println!(
        "10,000 units: {:.1} s of processor time, {:.1} s elapsed",
        processor_time() - time,
        begun.elapsed().as_secs_f64()
    );
    println!("{}\n{:#?}", with.judgement, found(&with));
    let named = with
        .strangers
        .iter()
        .filter(|s| plant.is_stranger(s.unit[1..].parse().unwrap()))
        .count();
    println!(
        "strangers: {named} of 20, and {} others named",
        with.strangers.len() - named
    );
    assert!(named >= 18);
    assert!(
        found(&with)
            .iter()
            .any(|f| f.starts_with("unit golden gyro scale_x"))
    );
    let mut alarms = [0; 5];
    let productions = 40;
    for seed in 0..productions {
        let faults = Faults {
            golden: Some(0.0),
            ..Faults::default()
        };
        let none = result(&Plant {
            faults,
            ..Plant::new(2000, 100 + seed)
        });
        let signals = none
            .drift
            .iter()
            .flat_map(|d| &d.charts)
            .filter(|c| c.signal.is_some())
            .count();
        let each = [
            none.strangers.len(),
            none.different.len(),
            none.changed.len(),
            signals,
            none.changed_units.len(),
        ];
        (0..5).for_each(|k| alarms[k] += usize::from(each[k] > 0));
    }
    println!(
        "of {productions} productions of 2,000 units without faults, with strangers, labels, changed labels, drifts, changed units: {alarms:?}"
    );
    assert!(alarms.iter().all(|a| *a <= 3), "{alarms:?}");
}
