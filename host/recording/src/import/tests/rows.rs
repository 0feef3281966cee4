//! Rows chosen by the value of a column.

use super::*;

/// Three sensors in turn, 10 ms apart each; the third measures on two ranges.
fn three_sensors(header: &str) -> String {
    let row = |i: u64| {
        let (time, channel) = (10 * (i / 3), i % 3 + 1);
        format!(
            "{channel},{time},{},{},{},{}\n",
            if i < 30 { "low" } else { "high" },
            channel,
            2 * channel,
            i
        )
    };
    format!("{header}{}", (0..60).map(row).collect::<String>())
}

const LIST: &str = "t_s=ms,accel_x=a,accel_y=b,accel_z=c";

fn chosen(text: &str, columns: &str, filters: &[&str]) -> Result<(ImportSummary, Batch, Manifest)> {
    let bench = Bench::new(&[("a.csv", text)]);
    let mut options = bench.options(&["a.csv"], &[columns]);
    options.log.filters = filters.iter().map(|text| text.parse().unwrap()).collect();
    bench.import(&options)
}

#[test]
fn each_of_the_sensors_in_one_file_is_a_recording() {
    let text = three_sensors("channel,ms,range,a,b,c\n");
    for channel in 1..=3 {
        let filter = format!("channel={channel}");
        let (summary, batch, manifest) = chosen(&text, LIST, &[&filter]).unwrap();
        assert_eq!((summary.rows, summary.not_chosen), (20, 40));
        assert_eq!(summary.sample_rate_hz, 100.0);
        assert!(batch.raw[3].iter().all(|a| *a == f64::from(channel)));
        assert_eq!(batch.raw[5][1], f64::from(channel - 1 + 3));
        assert!(
            manifest
                .imported_with
                .windows(2)
                .any(|w| w == ["--where".to_owned(), filter.clone()])
        );
    }
}

#[test]
fn several_choices_hold_at_once_and_numbers_are_compared_as_numbers() {
    let text = three_sensors("channel,ms,range,a,b,c\n");
    let (summary, batch, _) = chosen(&text, LIST, &["channel=02.0", "range=high"]).unwrap();
    assert_eq!(summary.rows, 10);
    assert_eq!(batch.raw[5][0], 31.0);
    // In a file without names, columns are chosen by number.
    let list = "-,t_s,-,accel_x,accel_y,accel_z";
    let bench = Bench::new(&[("a.csv", &three_sensors(""))]);
    let mut options = bench.options(&["a.csv"], &[list]);
    options.log.filters = vec!["1=3".parse().unwrap()];
    options.log.time_unit = Some("ms".parse().unwrap());
    assert_eq!(bench.import(&options).unwrap().1.raw[3], [3.0; 20]);
}

#[test]
fn a_broken_row_of_another_sensor_is_none_of_this_one() {
    let text = three_sensors("channel,ms,range,a,b,c\n").replace("2,10,low,2", "2,10,low,broken");
    assert_eq!(chosen(&text, LIST, &["channel=1"]).unwrap().0.rows, 20);
    let error = chosen(&text, LIST, &["channel=2"]).unwrap_err().to_string();
    assert!(error.contains("broken"), "{error}");
}

#[test]
fn a_value_that_never_occurs_is_refused_with_those_that_do() {
    let text = three_sensors("channel,ms,range,a,b,c\n");
    let refused = |filters: &[&str]| chosen(&text, LIST, filters).unwrap_err().to_string();
    let error = refused(&["channel=7"]);
    says(&error, &["channel=7", "\"1\", \"2\", \"3\""]);
    let error = refused(&["sensor=7"]);
    assert!(error.contains("\"sensor\""), "{error}");
    // `c` differs in each row; some of its values are listed.
    let error = refused(&["c=-1"]);
    assert!(error.contains("and others") && error.len() < 400, "{error}");
    for wrong in ["channel", "=3", "channel="] {
        assert!(wrong.parse::<RowFilter>().is_err(), "{wrong}");
    }
    let early = three_sensors("channel,ms,range,a,b,c\n").replace("3,60,low", "3,60,odd");
    let error = chosen(&early, LIST, &["channel=1", "range=odd"])
        .unwrap_err()
        .to_string();
    assert!(error.contains("all of channel=1 and range=odd"), "{error}");
}

#[test]
fn rows_of_a_parquet_file_are_chosen_alike() {
    let bench = Bench::new(&[("a.csv", &three_sensors("channel,ms,range,a,b,c\n"))]);
    let mut options = bench.options(
        &["a.csv"],
        &["step=range,t_s=ms,temp_c=channel,accel_x=a,accel_y=b,accel_z=c"],
    );
    options.log.time_unit = Some("ms".parse().unwrap());
    options.log.filters = vec!["channel=3".parse().unwrap()];
    bench.import(&options).unwrap();
    std::fs::copy(bench.path("out/samples.parquet"), bench.path("b.parquet")).unwrap();
    let mut options = bench.options(
        &["b.parquet"],
        &["t_s=t_s,accel_x=accel_x,accel_y=accel_y,accel_z=accel_z"],
    );
    options.log.time_unit = Some("s".parse().unwrap());
    options.log.filters = vec!["step=1".parse().unwrap()];
    let (summary, batch, _) = bench.import(&options).unwrap();
    assert_eq!((summary.rows, summary.not_chosen), (10, 10));
    assert_eq!(batch.raw[5][0], 32.0);
    options.log.filters = vec!["step=4".parse().unwrap()];
    assert!(bench.refused(&options).contains("\"0\", \"1\""));
    options.log.filters = vec!["range=4".parse().unwrap()];
    assert!(bench.refused(&options).contains("accel_x"));
}

#[test]
fn the_rows_before_and_after_a_fault_are_imported_apart() {
    let row = |i: u64| format!("{},{i},0,1\n", 10 * i);
    let text = (0..60).map(row).collect::<String>();
    let bench = Bench::new(&[("a.csv", &format!("ms,a,b,c\n{text}"))]);
    for (rows, first, count) in [("..20", 0.0, 20), ("21..", 20.0, 40), ("5..30", 4.0, 26)] {
        let mut options = bench.options(&["a.csv"], &[LIST]);
        options.log.rows = Some(rows.parse().unwrap());
        options.log.rate_hz = Some(100.0);
        let (summary, batch, manifest) = bench.import(&options).unwrap();
        assert_eq!((summary.rows, summary.not_chosen), (count, 60 - count));
        assert_eq!(batch.raw[3][0], first);
        let arguments = manifest.imported_with.windows(2);
        let given = ["--rows".to_owned(), rows.to_owned()];
        assert!(arguments.into_iter().any(|w| w == given));
    }
    let mut options = bench.options(&["a.csv"], &[LIST]);
    options.log.rows = Some("61..".parse().unwrap());
    assert!(bench.import(&options).is_err());
}

/// A compressed file of some kB, whose rows would fill the memory.
#[test]
fn more_rows_than_fit_into_memory_are_refused_with_their_number() {
    use parquet::data_type::DoubleType;
    use parquet::file::writer::SerializedFileWriter;
    let bench = Bench::new(&[]);
    let path = bench.path("a.parquet");
    let schema = parquet::schema::parser::parse_message_type("message m { optional double t_s; }");
    let schema = std::sync::Arc::new(schema.unwrap());
    let file = std::fs::File::create(&path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Default::default()).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    let nothing = vec![0; 1_000_000];
    for _ in 0..101 {
        let typed = column.typed::<DoubleType>();
        typed.write_batch(&[], Some(&nothing), None).unwrap();
    }
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    let error = bench.refused(&bench.options(&["a.parquet"], &["t_s=t_s"]));
    assert!(error.contains("it has 101000000 rows"), "{error}");
}
