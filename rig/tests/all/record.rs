//! Recordings: reproducible from the truth, complete or absent, and separate from the truth.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output};

use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record;
use mimu_rig::rig_file::{RigFile, RigTruth};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use tempfile::TempDir;

const TABLE: &str = "format = \"mimu-plan/1\"\ndevice = \"unit-3\"\nsample_rate_hz = 250.0\ncarrier = \"table\"\n\
                     latitude_deg = 30.5\ngravity_mps2 = 9.793\nchamber_c = [[0.0, 20.0], [10.0, 30.0]]\nlead_in_s = 0.5\n\
                     [[step]]\nup = [0.3, -0.5, 0.4]\ndwell_s = 1.0\n\
                     [[step]]\nup = [0.0, 1.0, 0.0]\nrate_dps = 100.0\ndwell_s = 2.0\nrepeat = 2\n";
const HANDS: &str = "format = \"mimu-plan/1\"\nsample_rate_hz = 250.0\ncarrier = \"hands\"\nlead_in_s = 2.0\n\
                     [[step]]\nposes = 5\ndwell_s = 1.0\n";
const RIG: &str = "format = \"mimu-rig/1\"\ndraw_effects = 3\n[hands]\nheld = true\n";

/// A temporary folder with the plans and a rig file.
struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        for (name, text) in [
            ("table.toml", TABLE),
            ("hands.toml", HANDS),
            ("rig.toml", RIG),
        ] {
            fs::write(bench.path().join(name), text).unwrap();
        }
        bench
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn run(&self, arguments: &str) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mimu-rig"));
        command
            .current_dir(self.path())
            .arg("record")
            .args(arguments.split_whitespace());
        command.output().unwrap()
    }

    fn record(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap()
    }

    /// The one-line error message of a run with exit status 1.
    fn refused(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert!(
            complaint.trim_end().lines().count() == 1 && complaint.contains("; "),
            "{complaint}"
        );
        complaint
    }

    fn read(&self, path: &str) -> String {
        fs::read_to_string(self.path().join(path)).unwrap()
    }
}

#[test]
fn the_truth_makes_the_same_samples_again_bit_by_bit() {
    for plan in ["table.toml", "hands.toml"] {
        let bench = Bench::new();
        bench.record(&format!("{plan} --rig rig.toml --seed 7 -o first"));
        bench.record(&format!("{plan} --rig first.truth.toml --seed 7 -o second"));
        let samples =
            |folder: &str| fs::read(bench.path().join(folder).join("samples.parquet")).unwrap();
        assert!(samples("first") == samples("second"));
        // Apart from the name of the recording, the truth of the truth is the same file.
        let truth = |name: &str| {
            bench
                .read(name)
                .lines()
                .skip(1)
                .map(String::from)
                .collect::<Vec<_>>()
        };
        assert_eq!(truth("first.truth.toml"), truth("second.truth.toml"));
        bench.record(&format!("{plan} --rig rig.toml --seed 8 -o other"));
        assert!(samples("first") != samples("other"));
    }
}

#[test]
fn a_recording_of_a_table_has_its_columns_its_steps_and_its_head() {
    let bench = Bench::new();
    let said = bench.record("table.toml --seed 1 -o rec --format csv");
    assert!(
        said.starts_with("rec: ") && said.contains("times real time"),
        "{said}"
    );
    let head: toml::Table = bench.read("rec/recording.toml").parse().unwrap();
    let text = |key: &str| head[key].as_str().unwrap();
    let number = |key: &str| head[key].as_float().unwrap();
    assert_eq!(
        (text("format"), text("device")),
        ("mimu-recording/1", "unit-3")
    );
    assert_eq!((text("raw_unit"), text("reference")), ("V", "table"));
    assert_eq!(
        [
            number("sample_rate_hz"),
            number("gravity_mps2"),
            number("latitude_deg")
        ],
        [250.0, 9.793, 30.5]
    );
    let samples = bench.read("rec/samples.csv");
    let mut lines = samples.lines();
    assert_eq!(
        lines.next().unwrap(),
        "t_s,step,temp_c,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,ref_rate_x_dps,ref_rate_y_dps,ref_rate_z_dps,\
         ref_force_x_mps2,ref_force_y_mps2,ref_force_z_mps2"
    );
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    // Half a second before the first dwell, and as many samples in a dwell as fit.
    assert!(rows[..125].iter().all(|row| row[1] == -1.0));
    let dwell = |step: f64| rows.iter().filter(move |row| row[1] == step);
    assert_eq!(
        [0.0, 1.0, 2.0, 3.0].map(|step| dwell(step).count()),
        [250, 500, 500, 0]
    );
    for row in dwell(1.0).chain(dwell(2.0)) {
        assert!(
            (row[10] - 100.0).abs() < 1e-2
                && row[9].abs() < 1e-2
                && (row[13] - 9.793).abs() < 1e-12
        );
    }
    for (k, row) in rows.iter().enumerate() {
        assert!(row[0] == k as f64 / 250.0 && row.iter().all(|x| x.is_finite()));
    }
}

#[test]
fn csv_parquet_and_memory_hold_the_same_numbers() {
    let bench = Bench::new();
    bench.record("table.toml --seed 5 -o a --format csv");
    bench.record("table.toml --seed 5 -o b --format parquet");
    let plan = Plan::parse(Source::new("table.toml", TABLE)).unwrap();
    let truth = RigTruth::resolve(&RigFile::default(), 5).unwrap();
    let run = record::samples(&plan, &truth, 5).unwrap();
    let csv = bench.read("a/samples.csv");
    let file = File::open(bench.path().join("b/samples.parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    assert_eq!(csv.lines().count(), run.len() + 1);
    let mut count = 0;
    for ((line, stored), row) in csv
        .lines()
        .skip(1)
        .zip(reader.get_row_iter(None).unwrap())
        .zip(run)
    {
        let text: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        let stored: Vec<f64> = stored
            .unwrap()
            .get_column_iter()
            .map(|(_, field)| match field {
                Field::Double(x) => *x,
                Field::Int(x) => f64::from(*x),
                other => panic!("{other}"),
            })
            .collect();
        assert_eq!(text, stored);
        assert_eq!(text[0], row.instant.motion.t_s);
        assert_eq!(text[2], row.readings.temp_c);
        assert_eq!(text[3..6], row.readings.gyro);
        assert_eq!(text[6..9], row.readings.accel);
        count += 1;
    }
    assert!(count > 1250);
}

#[test]
fn nothing_is_overwritten_unasked_and_nothing_but_a_recording_ever() {
    let bench = Bench::new();
    bench.record("table.toml --seed 1 -o rec");
    let before = fs::read(bench.path().join("rec/samples.parquet")).unwrap();
    assert!(
        bench
            .refused("table.toml --seed 2 -o rec")
            .contains("rec: exists already")
    );
    assert!(fs::read(bench.path().join("rec/samples.parquet")).unwrap() == before);
    bench.record("table.toml --seed 2 -o rec --replace --format csv");
    assert!(
        bench.path().join("rec/samples.csv").exists()
            && !bench.path().join("rec/samples.parquet").exists()
    );

    fs::write(bench.path().join("rec/notes.txt"), "dear diary").unwrap();
    assert!(
        bench
            .refused("table.toml --seed 2 -o rec --replace")
            .contains("is not a recording")
    );
    assert_eq!(bench.read("rec/notes.txt"), "dear diary");
    fs::create_dir(bench.path().join("empty")).unwrap();
    assert!(
        bench
            .refused("table.toml --seed 2 -o empty --replace")
            .contains("is not a recording")
    );
    assert!(
        bench
            .refused("table.toml --seed 2 -o table.toml --replace")
            .contains("is not a recording")
    );
    let complaint = bench.refused("table.toml --seed 2 -o new --truth table.toml --replace");
    assert!(
        complaint.contains("table.toml: exists and is not a truth"),
        "{complaint}"
    );
    assert_eq!(bench.read("table.toml"), TABLE);
    // A rig file written by hand has the format of a truth, but is not one.
    let complaint =
        bench.refused("table.toml --rig rig.toml --seed 2 -o new --truth rig.toml --replace");
    assert!(
        complaint.contains("rig.toml: exists and is not a truth"),
        "{complaint}"
    );
    assert_eq!(bench.read("rig.toml"), RIG);
}
