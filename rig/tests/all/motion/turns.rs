//! Turns by an angle: their number in the recording, and their reported rate.

use std::f64::consts::{FRAC_PI_2, TAU};

use mimu_rig::motion::{Carrier, Instant};
use mimu_rig::plan::Plan;
use mimu_rig::rotation::{Vector, add, norm, scale};
use mimu_rig::table::{Table, TableTruth};

use super::assert_near;
use super::table::{plan, table};

/// States of step `n`, every `dt_s`.
fn numbered(table: &mut Table, n: u32, dt_s: f64) -> Vec<Instant> {
    let count = (table.duration_s() / dt_s) as usize;
    let all: Vec<Instant> = (0..count).map(|k| table.at(k as f64 * dt_s)).collect();
    all.into_iter().filter(|i| i.step == Some(n)).collect()
}

/// Integral over these times, by the trapezium rule.
fn integral(instants: &[Instant], dt_s: f64) -> Vector {
    instants.windows(2).fold([0.0; 3], |sum, pair| {
        let rates = add(pair[0].stated_rate.unwrap(), pair[1].stated_rate.unwrap());
        add(sum, scale(0.5 * dt_s, rates))
    })
}

const QUARTER: &str = "[[step]]\nup = [0, 0, 1]\ndwell_s = 1\n\
                       [[step]]\nturn_axis = \"AXIS\"\nturn_deg = ANGLE\nturn_dps = 10\n\
                       [[step]]\nstay = true\ndwell_s = 2\n";

fn quarter(axis: &str, angle: f64) -> String {
    QUARTER
        .replace("AXIS", axis)
        .replace("ANGLE", &angle.to_string())
}

#[test]
fn a_turn_is_numbered_from_rest_to_rest_and_its_rate_adds_up_to_its_angle() {
    // A trapezium of 10 deg/s with ramps of 200 deg/s²: 9.05 s for a quarter.
    for (axis, angle, along) in [
        ("inner", 90.0, [0.0, 0.0, 1.0]),
        ("inner", -90.0, [0.0, 0.0, -1.0]),
        ("middle", 90.0, [1.0, 0.0, 0.0]),
        ("outer", -90.0, [0.0, 0.0, -1.0]),
    ] {
        // Rate errors do not affect a turn by an angle, because the encoder ends it.
        let truth = TableTruth {
            rate_scale_ppm: [500.0; 3],
            ..TableTruth::ideal()
        };
        let dt = 1e-3;
        let mut table = table(&quarter(axis, angle), &truth);
        let turn = numbered(&mut table, 1, dt);
        let lasted = dt * turn.len() as f64;
        assert!((lasted - 9.05).abs() < 2e-3, "{lasted}");
        assert_near(integral(&turn, dt), scale(FRAC_PI_2, along), 2e-4 * TAU);
        let middle = turn[turn.len() / 2];
        assert_near(
            middle.stated_rate.unwrap(),
            scale(10f64.to_radians(), along),
            1e-12,
        );
        assert!(norm(turn[0].stated_rate.unwrap()) < 3e-3);
    }
}

/// niu's cycle, 3.2 and appendix A: its poses, both directions about each axis, and its duration of 152 s.
#[test]
fn niu_s_eight_steps_reach_five_poses_and_turn_both_ways_about_each_axis() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut plan = Plan::read(&folder.join("plans/niu-ramp.toml")).unwrap();
    (plan.rounds, plan.lead_in_s) = (2, 0.0);
    let rig = mimu_rig::rig_file::RigFile::read(&folder.join("rigs/niu-mtig.toml")).unwrap();
    let ideal = TableTruth {
        encoder_arcsec: [0.0; 3],
        nonorthogonality_arcsec: [0.0; 2],
        mounting_arcsec: [0.0; 3],
        settling: TableTruth::ideal().settling,
        ..rig.table
    };
    let mut table = Table::new(&plan, &ideal).unwrap();
    let (mut poses, mut turns) = (Vec::new(), Vec::new());
    let mut starts = Vec::new();
    let mut last = None;
    let dt = 0.01;
    let mut sum = [0.0; 3];
    for k in 0..(table.duration_s() / dt) as usize {
        let instant = table.at(k as f64 * dt);
        if instant.step != last && instant.step == Some(16) {
            starts.push(k as f64 * dt);
        }
        if let Some(step) = instant.step {
            if step % 2 == 1 {
                sum = if instant.step == last { sum } else { [0.0; 3] };
                sum = add(sum, scale(dt, instant.stated_rate.unwrap()));
                turns.resize((step as usize).div_ceil(2), sum);
                turns[(step as usize) / 2] = sum;
            } else {
                poses.resize(step as usize / 2 + 1, [0.0; 3]);
                poses[step as usize / 2] = scale(1.0 / 9.793, instant.motion.force);
            }
        }
        last = instant.step;
    }
    assert_eq!((poses.len(), turns.len()), (16, 16));
    // From dwell to dwell of a cycle: eight times 9 s, 9.05 s of turn, and 0.95 s to settle.
    assert!((starts[0] - 152.0).abs() < 0.02, "{starts:?}");
    let count = |v: &[Vector], of: Vector, size: f64| {
        v.iter()
            .filter(|x| norm(add(**x, scale(-size, of))) < 2e-3)
            .count()
    };
    for round in poses.chunks(8) {
        let of = |up| count(round, up, 1.0);
        assert_eq!(of([0.0, 0.0, -1.0]), 4);
        for up in [
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
        ] {
            assert_eq!(of(up), 1, "{up:?}");
        }
    }
    for round in turns.chunks(8) {
        for (axis, each) in [
            ([1.0, 0.0, 0.0], 1),
            ([0.0, 1.0, 0.0], 1),
            ([0.0, 0.0, 1.0], 2),
        ] {
            for side in [1.0, -1.0] {
                assert_eq!(
                    count(round, scale(side, axis), FRAC_PI_2),
                    each,
                    "{axis:?} {side}"
                );
            }
        }
    }
}

#[test]
fn a_turn_that_the_table_cannot_make_is_refused_with_its_line() {
    let two = TableTruth {
        axes: 2,
        middle_max_deg: 95.0,
        ..TableTruth::ideal()
    };
    #[rustfmt::skip]
    let cases = [
        (quarter("outer", 90.0), &two, "PLAN.toml:9: a turn about the outer axis, but the table has none"),
        (quarter("middle", 100.0), &two, "PLAN.toml:9: the turn ends with the middle axis at 100.0 degrees, but its range is -180.0 to 95.0"),
        (quarter("inner", 90.0).replace("turn_dps = 10", "turn_dps = 500"), &two, "PLAN.toml:9: `turn_dps` is more than the inner axis's 400"),
        (format!("rounds = 2\nround_s = 5\n{}", quarter("inner", 90.0)), &two, "PLAN.toml:7: round 1 is due at 5 s, but the one before ends at"),
    ];
    for (text, truth, complaint) in cases {
        let found = Table::new(&plan(&text), truth).unwrap_err();
        assert!(found.starts_with(complaint), "{found}");
    }
}
