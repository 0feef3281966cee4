//! Rig files: drawn values, written values, refusals.

use mimu_rig::catalog::sensors;
use mimu_rig::effects::specs;
use mimu_rig::located::Source;
use mimu_rig::rig_file::{RigFile, RigTruth};

fn parse(text: &str) -> Result<RigFile, String> {
    RigFile::parse(&Source::new(
        "RIG.toml",
        format!("format = \"mimu-rig/1\"\n{text}"),
    ))
}

fn truth(text: &str, seed: u64) -> RigTruth {
    RigTruth::resolve(&parse(text).unwrap(), seed).unwrap()
}

#[test]
fn the_truth_is_a_rig_file_in_which_nothing_is_left_to_draw() {
    let mpu = "[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n";
    let xu = "[unit]\ngyro = [\"MSG7100D-300\", \"MSG7100D-300\", \"MSG7100D-3600\"]\naccel = \"MSA6000D-50\"\n";
    let affine =
        "[unit.gyro_affine]\nmatrix = [[1, 0, 0.1], [0, 2, 0], [0, 0.3, 3]]\nbias = [0, 0, 0]\n";
    for text in [
        "",
        "draw_effects = 7\n",
        mpu,
        xu,
        affine,
        "[[effect]]\nid = \"accel_size_effect\"\n",
        "[[triad]]\nname = \"gyro2\"\n[[triad]]\nname = \"mag\"\nevery = 3\n",
    ] {
        let first = truth(text, 11);
        let written = first.file.to_toml();
        let again = RigFile::parse(&Source::new("truth.toml", written.clone())).unwrap();
        assert_eq!(RigTruth::resolve(&again, 12).unwrap(), first, "{written}");
    }
}

#[test]
fn drawn_parameters_lie_within_the_data_sheet() {
    for seed in 0..200 {
        let unit = truth("", seed).unit;
        for (gyro, accel) in unit.gyro.axes.iter().zip(&unit.accel.axes) {
            let mv_per_dps = 1e3 * gyro.sensitivity.to_radians();
            assert!((4.6..=5.4).contains(&mv_per_dps), "{mv_per_dps}");
            assert!((2.3..=2.7).contains(&gyro.null));
            let mv_per_g = 1e3 * accel.sensitivity * 9.80665;
            assert!((740.0..=860.0).contains(&mv_per_g), "{mv_per_g}");
            assert!((1.485..=1.815).contains(&accel.null));
        }
    }
}

#[test]
fn every_catalog_file_is_read_and_has_a_name_of_its_own() {
    let names: Vec<_> = sensors().iter().map(|s| &s.name).collect();
    assert!(names.len() >= 7, "{names:?}");
    for name in &names {
        assert_eq!(names.iter().filter(|n| *n == name).count(), 1, "{name}");
    }
}

#[test]
fn a_complaint_names_the_line_what_is_wrong_and_what_to_do() {
    #[rustfmt::skip]
    let cases = [
        (
            "[unit]\ngyros = \"ADXRS300\"",
            "3: unknown field `gyros`, expected one of `gyro`, `accel`, `temperature`, `temperature_lag_s`, `temperature_offset_c`, `temperature_noise_c`, `gyro_reference_v`, `supply_error_ppm`, `supply_ppm_per_c`, `supply_noise_ppm`, `gyro_axes`, `accel_axes`, `gyro_affine`, `accel_affine`; correct or remove the key",
        ),
        ("[unit]\ngyro = 3", "3: `gyro`: expected the name of a sensor, or a list of three; correct the line"),
        (
            "[unit]\n\ngyro = \"ADXRS301\"",
            "4: no sensor has the name \"ADXRS301\"; known are: ADXRS300, MPU6050-gyro, ICM-42688-P-gyro, MSG7100D-300, MSG7100D-3600",
        ),
        (
            "[unit]\ngyro = [\"ADXRS300\", \"ADXRS300\", \"MPU6050-gyro\"]",
            "3: ADXRS300 and MPU6050-gyro cannot be in one triad; choose parts with the same kind of output and package",
        ),
        ("[unit.gyro_axes]\nwhite_si = [0, -1, 0]", "3: `white_si` is -1; give 0 to 1000"),
        (
            "[unit.accel_axes]\nnull_raw = [1, 1, 1]\nsensitivity_raw_per_si = [0.08, 0, 0.08]",
            "4: `sensitivity_raw_per_si` is 0; give 1e-9 or more, of either sign",
        ),
        (
            "[unit.gyro_axes]\ndirections = [[1, 0, 0], [0, 1, 0], [1, 1, 0.001]]",
            "3: the three sensitive axes lie in one plane; turn one of them out of it",
        ),
        (
            "[unit.accel_affine]\nbias = [0, 0, 0]\nmatrix = [[1, 0, 0], [0, 0, 0], [0, 0, 1]]",
            "4: axis y senses nothing; give its row a number that is not 0 or next to it",
        ),
        (
            "[unit.gyro_axes]\nnull_raw = [0, 0, 0]\n[unit.gyro_affine]\nmatrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nbias = [0, 0, 0]",
            "3: `null_raw` is given twice: [unit.gyro_affine] has it too; remove one of them",
        ),
        ("[thermal]\ndie_lag_s = [1, 1, 0, 1]", "3: `die_lag_s` is 0; give 0.01 to 1000000"),
        ("[converter]\nbits = 0", "3: `bits` is 0; give 1 to 32"),
        ("[converter]\ngyro_divider = 1.5", "3: `gyro_divider` is 1.5; give 0.01 to 1"),
        ("[unit]\naccel = \"MPU6050-accel\"\n[converter]\nraw_unit = \"V\"", "5: a digital part has no output in volts; write \"count\""),
        (
            "[[effect]]\nid = \"earth_rate\"\n\n[[effect]]\nid = \"accel_size_effect\"\narms_cm = [[0, 0, 0], [0, 0, 0], [0, 0, 0]]",
            "3: Earth rate is a true input here, not an effect; write `earth_rate = true` or false at the top",
        ),
        (
            "[[effect]]\nid = \"accel_size_effect\"\narms_cm = [[0, 0, 0], [0, 0, 0], [0, 0, 0]]",
            "4: `accel_size_effect` has no `arms_cm`; known are: arms_mm",
        ),
        (
            "[[effect]]\nid = \"gyro_bias_drift\"\n[[effect]]\nid = \"accel_bias_drift\"\nmg_per_hour = 3",
            "6: `mg_per_hour` is not a list of 3 numbers; give a list of 3 numbers, all finite",
        ),
        ("[unit.accel_axes]\nhigh_raw = 0.2", "3: the lowest output, 0.25, is not below the highest, 0.2; give `low_raw` and `high_raw`, the lower first"),
        ("[unit]\ngyro = \"MPU6050-gyro\"\ngyro_reference_v = [2.5, 2.5, 2.5]", "4: MPU6050-gyro has no reference pin; remove it"),
        ("[table]\naxes = 4", "3: `axes` is 4; give 2 or 3"),
        ("[table]\naxes = 3\nsettle_s = 1e308", "4: `settle_s` is 1e308; give 0 to 3600"),
        ("[table.settling]\ndamping = 1", "3: `damping` is 1; give 0.001 to 0.999"),
        ("table = 3", "2: `table`: invalid type: integer `3`, expected struct TableTruth; correct the line"),
        ("[hands]\nheld = true\naim_deg = nan", "4: `aim_deg` is NaN; give 0 to 90"),
        ("[hands]\nturn_s = [3, 1]", "3: `turn_s` is from 3 to 1; give the lowest first"),
        (
            "[[effect]]\nid = \"accel_thermal_misalignment\"\nmatrix_urad_per_c = [[1, 0, 0], [0, 0, 0], [0, 0, 0]]",
            "4: `matrix_urad_per_c` has a diagonal, which is a scale factor's part; give zeros there",
        ),
        ("[[effect]]\nid = \"gyro_warm_up\"\ntime_constant_s = 0", "4: `time_constant_s` is 0; give 0.06 to 600000"),
        (
            "[[effect]]\nid = \"gyro_warm_up\"\n[[effect]]\nid = \"gyro_warm_up\"",
            "5: effect `gyro_warm_up` occurs twice; remove one, or move its contents into the other",
        ),
    ];
    for (text, complaint) in cases {
        assert_eq!(parse(text).unwrap_err(), format!("RIG.toml:{complaint}"));
    }
    let all = specs().count();
    let one_stated = format!("draw_effects = {all}\n[[effect]]\nid = \"gyro_warm_up\"");
    for (text, most) in [("draw_effects = 1000", all), (one_stated.as_str(), all - 1)] {
        let says = "2: more effects than there are beside the given ones; give at most";
        assert_eq!(parse(text).unwrap_err(), format!("RIG.toml:{says} {most}"));
    }
    let unknown = parse("[[effect]]\nid = \"gyro_g\"").unwrap_err();
    assert!(
        unknown
            .starts_with("RIG.toml:3: no effect has the id `gyro_g`; known: gyro_g_sensitivity, "),
        "{unknown}"
    );
    let format = RigFile::parse(&Source::new("RIG.toml", "format = \"mimu-plan/1\"")).unwrap_err();
    assert_eq!(
        format,
        "RIG.toml:1: format is \"mimu-plan/1\"; write \"mimu-rig/1\""
    );
}
