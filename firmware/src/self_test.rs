//! The self-test: responses of the sensors to their test inputs, and their supplies, compared with their data sheets.
//!
//! # What one pose cannot show
//!
//! The accelerometer has no input that deflects its mass, so the test relies on gravity. An axis perpendicular to gravity reads its null in
//! every range, and so does an axis that is stuck at its null; only a pose with this axis up distinguishes them. An axis that is stuck
//! elsewhere fails in all poses, because its reading above the null does not shrink with the range. The test shows that the gyros respond,
//! but their scale factors only to about a half. Their 5 V supply is not connected to any pin.

use nalgebra::Vector3;

use mimu_core::wire::{TestRow, TestTable, Verdict};

use crate::board::REFERENCE_V;
use crate::design_parameters::{
    ACCEL_NULL_V, GYRO_REFERENCE_TOLERANCE_V, GYRO_REFERENCE_V, GYRO_TEMPERATURE_RANGE_C,
    SELF_TEST_ACCEL_NULL_V, SELF_TEST_ACCEL_RATIO, SELF_TEST_ACCEL_SEEN_V,
    SELF_TEST_ACCEL_TOLERANCE_V, SELF_TEST_ACCEL_V, SELF_TEST_GYRO_V, SUPPLY_TOLERANCE,
};

#[cfg(target_os = "none")]
mod deflect;
#[cfg(target_os = "none")]
pub use deflect::SelfTest;

/// Measurements of a self-test.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Change of the gyros' outputs by ST1, V.
    pub gyro_st1_v: [f32; 3],
    /// The same by ST2.
    pub gyro_st2_v: [f32; 3],
    /// Outputs of the accelerometer at its finest range, V.
    pub accel_fine_v: [f32; 3],
    /// The same at its coarsest.
    pub accel_coarse_v: [f32; 3],
    /// By the TEMP pins, °C.
    pub temperatures_c: [f32; 3],
    /// Whether the TEMP pins are used ([`that_count`](crate::temperature::that_count)).
    pub temperatures_count: [bool; 3],
    /// Reference of the gyros, V.
    pub reference_v: f32,
    /// Supply of converter and accelerometer, V.
    pub supply_v: f32,
}

/// Names of the rows of an axis: its gyro's two inputs, its accelerometer, its TEMP pin.
const ROWS: [[&str; 4]; 3] = [
    [
        "gyro x, ST1",
        "gyro x, ST2",
        "accel x, null",
        "temperature x",
    ],
    [
        "gyro y, ST1",
        "gyro y, ST2",
        "accel y, null",
        "temperature y",
    ],
    [
        "gyro z, ST1",
        "gyro z, ST2",
        "accel z, null",
        "temperature z",
    ],
];

/// Fills the table of results.
pub fn judge(of: &Measured, table: &mut TestTable) {
    let about = |wanted: f32, by: f32| [wanted - by, wanted + by];
    // There is room for all rows, which the longest names show in a test.
    let mut push = |row: TestRow<'_>| {
        table.push(&row);
    };
    let [least, most] = SELF_TEST_GYRO_V;
    for (axis, [st1, st2, null, temperature]) in ROWS.into_iter().enumerate() {
        push(TestRow::within(
            st1,
            of.gyro_st1_v[axis],
            "V",
            [-most, -least],
        ));
        push(TestRow::within(
            st2,
            of.gyro_st2_v[axis],
            "V",
            [least, most],
        ));
        // Both ranges have the null in common.
        let (fine, coarse) = (of.accel_fine_v[axis], of.accel_coarse_v[axis]);
        let null_v = (fine * SELF_TEST_ACCEL_RATIO - coarse) / (SELF_TEST_ACCEL_RATIO - 1.0);
        let limits = about(ACCEL_NULL_V, SELF_TEST_ACCEL_NULL_V);
        let mut row = TestRow::within(null, null_v, "V", limits);
        if row.verdict == Verdict::Passed && (fine - coarse).abs() < SELF_TEST_ACCEL_SEEN_V {
            row.verdict = Verdict::NotShown;
        }
        push(row);
        let (temp_c, counts) = (of.temperatures_c[axis], of.temperatures_count[axis]);
        push(TestRow {
            verdict: match counts {
                true => Verdict::Passed,
                false => Verdict::Failed,
            },
            ..TestRow::within(temperature, temp_c, "\u{b0}C", GYRO_TEMPERATURE_RANGE_C)
        });
    }
    // The length of the change, not the change of the length, so that nulls cancel.
    let change = Vector3::from(of.accel_fine_v) - Vector3::from(of.accel_coarse_v);
    let limits = about(SELF_TEST_ACCEL_V, SELF_TEST_ACCEL_TOLERANCE_V);
    push(TestRow::within("gravity", change.norm(), "V", limits));
    let limits = about(GYRO_REFERENCE_V, GYRO_REFERENCE_TOLERANCE_V);
    push(TestRow::within("reference", of.reference_v, "V", limits));
    let limits = about(REFERENCE_V, SUPPLY_TOLERANCE * REFERENCE_V);
    push(TestRow::within("supply", of.supply_v, "V", limits));
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    /// A unit as the data sheets have it, with this specific force, g, and nulls of the accelerometer, V.
    fn unit(force_g: [f32; 3], nulls: [f32; 3]) -> Measured {
        let at = |v_per_g: f32| core::array::from_fn(|i| nulls[i] + v_per_g * force_g[i]);
        Measured {
            gyro_st1_v: [-0.27; 3],
            gyro_st2_v: [0.27; 3],
            accel_fine_v: at(0.8),
            accel_coarse_v: at(0.2),
            temperatures_c: [25.0; 3],
            temperatures_count: [true; 3],
            reference_v: 2.5,
            supply_v: 3.3,
        }
    }

    /// Names of the rows that fail, and of the axes that the pose does not show.
    fn judged(of: &Measured) -> (std::vec::Vec<std::string::String>, std::vec::Vec<char>) {
        let mut table = TestTable::new();
        judge(of, &mut table);
        let result = table.result();
        assert_eq!((result.rows().count(), result.is_whole()), (15, true));
        let with = |verdict| result.rows().filter(move |row| row.verdict == verdict);
        let failed = with(Verdict::Failed).map(|row| row.name.into()).collect();
        let not_shown = with(Verdict::NotShown).filter_map(|row| row.name.chars().nth(6));
        (failed, not_shown.collect())
    }

    #[track_caller]
    fn fails(of: &Measured, names: &[&str]) {
        assert_eq!(judged(of).0, names);
    }

    const NULLS: [f32; 3] = [1.485, 1.815, 1.65];
    const SLANTED: [f32; 3] = [0.6, -0.64, 0.48];

    #[test]
    fn a_unit_within_its_data_sheets_passes_in_any_pose() {
        for force in [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], SLANTED] {
            fails(&unit(force, NULLS), &[]);
        }
        let mut unit = unit(SLANTED, NULLS);
        unit.gyro_st1_v = [-0.16, -0.27, -0.44];
        unit.gyro_st2_v = [0.44, 0.16, 0.27];
        fails(&unit, &[]);
    }

    #[test]
    fn a_gyro_that_answers_less_or_more_than_its_data_sheet_allows_fails() {
        for wrong in [0.0, 0.09, 0.14, 0.46, -0.27] {
            let mut one = unit(SLANTED, NULLS);
            one.gyro_st1_v[1] = -wrong;
            fails(&one, &["gyro y, ST1"]);
            let mut one = unit(SLANTED, NULLS);
            one.gyro_st2_v[2] = wrong;
            fails(&one, &["gyro z, ST2"]);
        }
    }

    #[test]
    fn an_axis_that_is_stuck_off_its_null_fails_also_across_gravity() {
        for stuck_v in [0.0, 0.69, 1.2, 2.2, 3.3] {
            let mut one = unit([0.0, 0.0, 1.0], NULLS);
            (one.accel_fine_v[0], one.accel_coarse_v[0]) = (stuck_v, stuck_v);
            fails(&one, &["accel x, null"]);
        }
    }

    #[test]
    fn an_axis_that_ought_to_see_gravity_and_stays_at_its_null_fails() {
        // At 45 degrees the other alone has 0.7 of the length.
        let mut one = unit([0.0, 0.71, 0.71], [1.65; 3]);
        (one.accel_fine_v[1], one.accel_coarse_v[1]) = (1.65, 1.65);
        fails(&one, &["gravity"]);
        assert_eq!(judged(&one).1, ['x', 'y']);
    }

    #[test]
    fn temperature_reference_and_supply_fail_by_name() {
        let mut one = unit(SLANTED, NULLS);
        one.temperatures_count[2] = false;
        fails(&one, &["temperature z"]);
        let mut one = unit(SLANTED, NULLS);
        one.reference_v = 2.3;
        fails(&one, &["reference"]);
        let mut one = unit(SLANTED, NULLS);
        one.supply_v = 3.0;
        fails(&one, &["supply"]);
        one.supply_v = f32::NAN;
        fails(&one, &["supply"]);
    }
}
