//! Turntables without flaws.

use mimu_rig::located::Source;
use mimu_rig::motion::{Carrier, Instant};
use mimu_rig::place::EARTH_RATE;
use mimu_rig::plan::Plan;
use mimu_rig::rotation::{dot, norm, scale};
use mimu_rig::table::{Table, TableTruth};

use super::assert_near;

pub fn plan(steps: &str) -> Plan {
    let head = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\nlatitude_deg = 30.5\n\
                gravity_mps2 = 9.793\n";
    Plan::parse(Source::new("PLAN.toml", format!("{head}{steps}"))).unwrap()
}

pub fn table(steps: &str, truth: &TableTruth) -> Table {
    Table::new(&plan(steps), truth).unwrap()
}

/// Middle of the first dwell.
fn first_dwell(table: &mut Table) -> Instant {
    let times = (0..).map(|k| f64::from(k) * 0.01);
    let dwell: Vec<f64> = times
        .skip_while(|t| table.at(*t).step != Some(0))
        .take(1)
        .collect();
    table.at(dwell[0] + 0.5)
}

#[test]
fn the_earth_turns_a_resting_board_by_its_rate_north_and_up() {
    let latitude = 30.5_f64.to_radians();
    let (north, up) = (EARTH_RATE * latitude.cos(), EARTH_RATE * latitude.sin());
    for (pose, expected) in [
        ("up = [0, 0, 1]", [0.0, north, up]),
        // Upside down about east: y points south, z down.
        ("up = [0, 0, -1]", [0.0, -north, -up]),
        // Heading 90 degrees: x points north, y west.
        ("up = [0, 0, 1]\nheading_deg = 90.0", [north, 0.0, up]),
        // Middle axis 90 degrees about east: z points south, y up.
        ("up = [0, 1, 0]", [0.0, up, -north]),
    ] {
        let mut table = table(
            &format!("[[step]]\n{pose}\ndwell_s = 2"),
            &TableTruth::ideal(),
        );
        assert_near(table.at(1.0).motion.rate, expected, 1e-18);
        assert_eq!(table.at(1.0).stated_rate, Some([0.0; 3]));
    }
    // At any attitude, the component along up is the vertical one, and the magnitude is the Earth's.
    let mut table = table(
        "[[step]]\nup = [1, -2, 0.5]\nheading_deg = 77\ndwell_s = 2",
        &TableTruth::ideal(),
    );
    let motion = table.at(1.0).motion;
    let along = dot(motion.rate, scale(1.0 / norm(motion.force), motion.force));
    assert!((along - up).abs() < 1e-18 && (norm(motion.rate) - EARTH_RATE).abs() < 1e-18);
}

#[test]
fn a_pose_has_up_where_the_plan_wants_it() {
    for up in [
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.3, -0.2, -0.9],
        [-1.0, 1.0, 1e-3],
    ] {
        let [x, y, z] = up;
        let steps = format!(
            "[[step]]\nup = [0.1, 0.7, 0.2]\ndwell_s = 1\n[[step]]\nup = [{x}, {y}, {z}]\ndwell_s = 1"
        );
        let mut table = table(&steps, &TableTruth::ideal());
        let end = table.duration_s();
        let instant = table.at(end - 0.5);
        assert_eq!(instant.step, Some(1));
        assert_near(instant.motion.force, scale(9.793 / norm(up), up), 1e-12);
    }
}

#[test]
fn a_table_without_outer_axis_spins_about_its_inner_axis_and_heads_only_upright() {
    let truth = TableTruth {
        axes: 2,
        middle_min_deg: -95.0,
        middle_max_deg: 95.0,
        ..TableTruth::ideal()
    };
    let instant = first_dwell(&mut table(
        "[[step]]\nup = [0, 0, 1]\nrate_dps = 50\ndwell_s = 2",
        &truth,
    ));
    assert_near(
        instant.stated_rate.unwrap(),
        [0.0, 0.0, 50f64.to_radians()],
        1e-15,
    );
    let instant = first_dwell(&mut table(
        "[[step]]\nup = [1, 0, 0]\nspin_dps = -50\ndwell_s = 2",
        &truth,
    ));
    assert_near(
        instant.stated_rate.unwrap(),
        [0.0, 0.0, -50f64.to_radians()],
        1e-15,
    );
    // The tilt axis turns in both directions, so the whole upper hemisphere is in reach.
    let instant = first_dwell(&mut table(
        "[[step]]\nup = [-1, -1, 0.5]\ndwell_s = 2",
        &truth,
    ));
    assert_near(
        instant.motion.force,
        scale(9.793 / 1.5, [-1.0, -1.0, 0.5]),
        1e-12,
    );
    // The tests of the plan check the limit itself.
    assert!(Table::new(&plan("[[step]]\nup = [0, 0, -1]\ndwell_s = 2"), &truth).is_err());
}
