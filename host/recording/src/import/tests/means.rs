//! Tables of means: what is read from them, and what is refused.

use super::*;

const TABLE: &str = "pose;n;ax;ay;az;sx;sy;sz;T\n\
    # a bench\n\
    \"up, level\";250;10;20;16384;1,5;2;2,5;24,5\n\
    down;300;12;-20;-16380;1;2;3;\n";
const LIST: &str = "step=pose,averaged=n,accel_x=ax,accel_y=ay,accel_z=az,accel_x_sd=sx,accel_y_sd=sy,accel_z_sd=sz,temp_c=T";

fn imported(text: &str, list: &str, scales: &[&str]) -> Result<PoseMeans> {
    let bench = Bench::new(&[("a.csv", text)]);
    let mut options = bench.options(&["a.csv"], &[]);
    if !list.is_empty() {
        options.log.columns = vec![list.parse()?];
    }
    options.log.means = true;
    options.log.scale = scales.iter().map(|s| s.parse().unwrap()).collect();
    let out = bench.path("out");
    let outcome = import(&options, &out, |_| ());
    assert_eq!(outcome.is_ok(), out.exists());
    let summary = outcome?;
    assert!(summary.means && summary.sample_rate_hz.is_nan());
    let error = Recording::open(&out).unwrap_err().to_string();
    assert!(error.contains("means of poses"), "{error}");
    let means = PoseMeans::open(&out)?;
    assert_eq!(summary.rows, means.poses.len() as u64);
    Ok(means)
}

#[test]
fn means_deviations_counts_names_and_temperature_are_read_and_scaled() {
    let means = imported(TABLE, LIST, &["accel=-0.5"]).unwrap();
    assert_eq!(means.manifest.step_labels, ["up, level", "down"]);
    assert!(means.manifest.imported_with.contains(&"--means".to_owned()));
    let [up, down] = &means.poses[..] else {
        panic!()
    };
    assert_eq!(up.raw[3..], [-5.0, -10.0, -8192.0]);
    assert_eq!(up.deviation[3..], [0.75, 1.0, 1.25]);
    assert_eq!(down.averaged[3..], [Some(300); 3]);
    assert_eq!(up.temp_c, 24.5);
    assert!(down.temp_c.is_nan() && down.raw[0].is_nan());
    assert!(means.columns.accel && !means.columns.gyro);
}

#[test]
fn a_table_by_the_names_of_a_recording_needs_no_list_and_no_noise() {
    let text = "accel_x,accel_y,accel_z,ref_force_x_mps2,accel_y_averaged\n1,2,3,9.8,7\n";
    let means = imported(text, "", &[]).unwrap();
    let pose = &means.poses[0];
    assert_eq!(pose.averaged, [None, None, None, None, Some(7), None]);
    assert_eq!(pose.reference[3], 9.8);
    assert!(pose.deviation[3].is_nan() && pose.label.is_empty());
}

#[test]
fn what_is_missing_or_wrong_in_a_table_of_means_is_named() {
    let with = |from: &str, to: &str| TABLE.replace(from, to);
    #[rustfmt::skip]
    let cases = [
        (TABLE.into(), LIST.replace("averaged=n,", ""), "accel_x_sd, but not the number of samples"),
        (TABLE.into(), LIST.replace("averaged=n", "t_s=n"), "means have no time"),
        (TABLE.into(), LIST.replace("accel_z=az,", ""), "column accel_z is missing"),
        (with("250", "2.5"), LIST.into(), "row 3, column averaged: 2.5 is not a number of samples"),
        (with("250", ""), LIST.into(), "row 3, column averaged: it is empty, but accel_x is not"),
        (with("1,5", ""), LIST.into(), "row 3, column accel_x_sd: it is empty"),
        (with("1,5", "-1"), LIST.into(), "-1 is negative"),
    ];
    for (text, list, says) in cases {
        let error = imported(&text, &list, &[]).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    // A table of means is not taken for samples.
    let error = one_refused("1,2,3,4\n", "accel_x,accel_y,accel_z,averaged");
    says(&error, &["column averaged belongs to a table of means"]);
    // Samples need their rate.
    let text = "format = \"mimu-recording/1\"\ndevice = \"u\"\ngravity_mps2 = 9.8\nraw_unit = \"V\"\nreference = \"gravity\"\n";
    let error = Manifest::parse(text, "recording.toml").unwrap_err();
    says(
        &error.to_string(),
        &["missing field `sample_rate_hz`; add the key"],
    );
}
