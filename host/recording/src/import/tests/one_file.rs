//! Both sensors in one file: in other rows, in other columns, or in lines that look like comments.

use super::*;

/// Rows of an accelerometer (flag 1) and a gyro (flag 2) in turn, at 100 Hz since 1970.
fn flagged(rows: usize) -> String {
    let row = |i: usize| {
        let ms = 1_603_503_881_325_u64 + 10 * i as u64;
        let tenth = 0.1 * (i % 3) as f64;
        format!("{ms},1,{tenth},0.5,9.8\n{ms},2,0.0{},0.02,-0.03\n", i % 7)
    };
    "timestamp,flag,x,y,z\n".to_owned() + &(0..rows).map(row).collect::<String>()
}

const ACCEL: &str = "t_s=timestamp,accel_x=x,accel_y=y,accel_z=z";
const GYRO: &str = "t_s=timestamp,gyro_x=x,gyro_y=y,gyro_z=z";

fn filters(all: &[&str]) -> Vec<RowFilter> {
    all.iter().map(|text| text.parse().unwrap()).collect()
}

#[test]
fn two_values_of_a_column_choose_the_rows_of_two_sensors() {
    let text = flagged(500) + "1603503886325,7,1,2,3\n";
    let bench = Bench::new(&[("a.csv", &text)]);
    let mut options = bench.options(&["a.csv"], &[ACCEL, GYRO]);
    options.log.filters = filters(&["flag=1", "flag=2"]);
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!((summary.rows, manifest.sample_rate_hz), (500, 100.0));
    // Only the row of the third kind was not chosen by anybody.
    assert_eq!((summary.not_chosen, summary.interpolated), (1, 0));
    for i in [0, 123, 499] {
        assert_eq!(batch.raw[3][i], 0.1 * (i % 3) as f64);
        assert_eq!(batch.raw[0][i], (i % 7) as f64 / 100.0);
    }
    assert_eq!(manifest.sources.len(), 1);
    let with = manifest.imported_with.join(" ");
    assert!(with.contains("--where flag=1 --where flag=2"), "{with}");
    // The order of the lists is that of the values.
    options.log.columns.reverse();
    let (_, other, _) = bench.import(&options).unwrap();
    assert_eq!((other.raw[3][1], other.raw[0][1]), (0.01, 0.1));
}

#[test]
fn values_of_a_column_need_a_list_of_columns_each() {
    let bench = Bench::new(&[("a.csv", &flagged(200))]);
    let mut options = bench.options(&["a.csv"], &[ACCEL]);
    options.log.filters = filters(&["flag=1", "flag=2"]);
    let refused = import(&options, &bench.path("out"), |_| ()).unwrap_err();
    let arguments = &refused.refused().arguments;
    assert_eq!(arguments[..], [Argument::Where, Argument::Columns]);
    // A value that is not there is named.
    let mut options = bench.options(&["a.csv"], &[ACCEL, GYRO]);
    options.log.filters = filters(&["flag=1", "flag=3"]);
    assert!(bench.refused(&options).contains("flag=3"));
}

#[test]
fn rows_of_two_kinds_may_differ_in_width_and_rate() {
    let accel = |i: usize| format!("ACC,{:.3},{},0.5,9.8,extra\n", 0.01 * i as f64, i % 3);
    let gyro = |i: usize| format!("GYR,{:.3},{},0.02,0.03\n", 0.02 * i as f64 + 0.001, i % 5);
    let mut text = String::from("$LOGGER,v2\n");
    for i in 0..300 {
        if i % 2 == 0 {
            text += &gyro(i / 2);
        }
        text += &accel(i);
    }
    let bench = Bench::new(&[("a.csv", &text)]);
    let lists = [
        "-,t_s,accel_x,accel_y,accel_z,-",
        "-,t_s,gyro_x,gyro_y,gyro_z",
    ];
    let mut options = bench.options(&["a.csv"], &lists);
    options.log.filters = filters(&["1=ACC", "1=GYR"]);
    let (summary, batch, _) = bench.import(&options).unwrap();
    assert_eq!(
        (summary.sample_rate_hz, summary.time[1].rate_hz),
        (100.0, 50.0)
    );
    assert!(batch.raw[0].iter().all(|x| (0.0..=4.0).contains(x)));
    assert!(
        summary.not_chosen == 0 && summary.rows >= 296,
        "{summary:?}"
    );
}

#[test]
fn two_lists_take_two_clocks_from_the_columns_of_one_file() {
    let row = |i: usize| {
        let t = 0.01 * i as f64;
        format!("{t:.4},{},0.5,9.8,{:.4},{},2,3\n", i % 3, t + 0.002, i % 5)
    };
    let text = "ta,ax,ay,az,tg,gx,gy,gz\n".to_owned() + &(0..300).map(row).collect::<String>();
    let bench = Bench::new(&[("a.csv", &text)]);
    let lists = [
        "t_s=ta,accel_x=ax,accel_y=ay,accel_z=az",
        "t_s=tg,gyro_x=gx,gyro_y=gy,gyro_z=gz",
    ];
    let (summary, batch, _) = bench.import(&bench.options(&["a.csv"], &lists)).unwrap();
    assert_eq!((summary.time.len(), summary.not_chosen), (2, 0));
    // The accelerometer's second sample is 8 ms after the gyro's first of 10 ms.
    let at = batch
        .t_s
        .iter()
        .position(|t| (t - 0.01).abs() < 1e-9)
        .unwrap();
    assert!(
        (batch.raw[0][at] - 0.8).abs() < 1e-9,
        "{}",
        batch.raw[0][at]
    );
}

/// Messages of a receiver, each behind a percent sign: increments of velocity and angle in the order z, -y, x.
fn percent(rows: usize) -> String {
    let row = |i: usize| {
        let tow = 481_200.0 + 0.01 * i as f64;
        format!(
            "%RAWIMUSA,2387,{tow:.3};2387,{tow:.9},77,{},{},-980,205,-16,-6*0000abcd\n",
            660 + i % 3,
            115 + i % 5
        )
    };
    (0..rows).map(row).collect()
}

#[test]
fn lines_that_all_look_like_comments_are_named_and_read_if_none_is_a_comment() {
    let bench = Bench::new(&[("a.asc", &percent(400))]);
    let list = "-,-,-,-,t_s,-,accel_z,accel_y,accel_x,gyro_z,gyro_y,gyro_x,-";
    let mut options = bench.options(&["a.asc"], &[list]);
    options.log.separator = Some(",;*".parse().unwrap());
    let refused = import(&options, &bench.path("out"), |_| ()).unwrap_err();
    assert_eq!(refused.refused().arguments[..], [Argument::Comment]);
    let line = refused.to_string();
    assert!(line.contains("400 lines begin with %"), "{line}");
    options.log.comment = Some("none".parse().unwrap());
    options.log.scale = ["accel=0.5", "accel_y=-1"]
        .map(|s| s.parse().unwrap())
        .into();
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!((summary.rows, summary.sample_rate_hz), (400, 100.0));
    let first = [3, 4, 5].map(|c: usize| batch.raw[c][0]);
    assert_eq!(first, [-490.0, -57.5, 330.0]);
    let with = manifest.imported_with.join(" ");
    says(&with, &["--comment none", "--separator *,;"]);
    // Comments without numbers are a file without data.
    let empty = "# header only\n# nothing was recorded\n";
    assert!(one_refused(empty, "t_s,gyro_x,gyro_y,gyro_z").contains("no row of data"));
}

#[test]
fn rows_with_one_sensor_each_are_joined_if_each_has_a_list() {
    let row = |i: usize| match i % 2 {
        0 => format!("{:.3},{},0.02,0.03,,,\n", 0.005 * i as f64, i % 5),
        _ => format!("{:.3},,,,{},0.5,9.8\n", 0.005 * i as f64, i % 3),
    };
    let text = "t,gx,gy,gz,ax,ay,az\n".to_owned() + &(0..600).map(row).collect::<String>();
    let bench = Bench::new(&[("a.csv", &text)]);
    let all = "t_s=t,gyro_x=gx,gyro_y=gy,gyro_z=gz,accel_x=ax,accel_y=ay,accel_z=az";
    let (summary, ..) = bench.import(&bench.options(&["a.csv"], &[all])).unwrap();
    warns(&summary, "a list of columns");
    let lists = [
        "t_s=t,gyro_x=gx,gyro_y=gy,gyro_z=gz",
        "t_s=t,accel_x=ax,accel_y=ay,accel_z=az",
    ];
    let (summary, batch, _) = bench.import(&bench.options(&["a.csv"], &lists)).unwrap();
    assert_eq!((summary.sample_rate_hz, summary.empty_cells), (100.0, 0));
    assert!(
        summary.warnings.len() == 1,
        "only that of the interpolation: {summary:?}"
    );
    assert!(
        batch
            .raw
            .iter()
            .flatten()
            .all(|reading| reading.is_finite())
    );
}
