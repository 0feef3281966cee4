//! The dwells that are found in all recordings at hand: real ones, small inputs with faults, and some of the bench.

use std::path::Path;

use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::{DwellSearch, STILL_FACTOR, Steps};
use mimu_recording::error::Result;
use mimu_recording::{ImportOptions, RawUnit, Recording, Reference, Turntable, import};
use mimu_rig::random::Random;
use mimu_tests::bench;
use mimu_tests::by_hand::{self, Grade};
use mimu_tests::recordings::data_set;
use tempfile::TempDir;

const SIX: &str = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";

/// Prints a line of the table: number of dwells, those that both sensors use, their total, shortest and longest length.
fn line(name: &str, prepared: Result<Prepared>) {
    let dwells = match &prepared {
        Ok(prepared) => &prepared.dwells.list,
        Err(error) => return println!("| {name} | refused: {error} |"),
    };
    let usable = dwells.iter().filter(|d| {
        let mut recorded = Sensor::BOTH.iter();
        recorded.all(|s| {
            let absent = d.raw[s.channels()].iter().all(|m| m.n == 0);
            absent || d.faults[*s].is_none()
        })
    });
    let mut lengths: Vec<f64> = usable.map(|d| d.duration_s).collect();
    lengths.sort_by(f64::total_cmp);
    let [first, .., last] = lengths.as_slice() else {
        return println!("| {name} | {} | {lengths:?} |", dwells.len());
    };
    println!(
        "| {name} | {} | {} | {:.1} | {first:.1} | {last:.1} |",
        dwells.len(),
        lengths.len(),
        lengths.iter().sum::<f64>()
    );
}

fn found(recording: Result<Recording>, steps: Steps) -> Result<Prepared> {
    let search = DwellSearch {
        steps,
        ..STILL_FACTOR.into()
    };
    Prepared::read(&recording?, search, |_| ())
}

/// The dwells of foreign files, one list of columns for each; `change` sets what else an import needs.
fn of_files(
    files: &[(&Path, &str)],
    raw_unit: RawUnit,
    reference: Reference,
    change: impl FnOnce(&mut ImportOptions),
) -> Result<Prepared> {
    let folder = TempDir::new().expect("a folder");
    let paths = files.iter().map(|(path, _)| path.to_path_buf()).collect();
    let columns: Result<_> = files.iter().map(|(_, list)| list.parse()).collect();
    let mut options = ImportOptions::new(paths, 9.80665, raw_unit, reference);
    options.log.columns = columns?;
    change(&mut options);
    let out = folder.path().join("recording");
    import(&options, &out, |_| ())?;
    found(Recording::open(&out), Steps::AsRecorded)
}

fn by_hand(
    file: &Path,
    columns: &str,
    raw_unit: RawUnit,
    rate_hz: Option<f64>,
) -> Result<Prepared> {
    of_files(
        &[(file, columns)],
        raw_unit,
        Reference::Gravity,
        |options| {
            options.log.rate_hz = rate_hz;
        },
    )
}

fn real_ones() {
    if let Some(data) = data_set("imu_tk_xsens") {
        let files = [
            (data.join("xsens_acc.mat"), "t_s,accel_x,accel_y,accel_z"),
            (data.join("xsens_gyro.mat"), "t_s,gyro_x,gyro_y,gyro_z"),
        ];
        let files = files.each_ref().map(|(path, list)| (path.as_path(), *list));
        let rate = |options: &mut ImportOptions| options.log.rate_hz = Some(100.0);
        line(
            "xsens",
            of_files(&files, RawUnit::Count, Reference::Gravity, rate),
        );
    }
    if let Some(data) = data_set("mikoff_mpu9150x5") {
        for unit in 0..5 {
            let file = data.join(format!("imu{unit}.log"));
            let columns = "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z";
            line(
                &format!("mikoff imu{unit}"),
                by_hand(&file, columns, RawUnit::Si, Some(100.0)),
            );
        }
    }
    if let Some(data) = data_set("imucal_ferraris") {
        let file = data.join("annotated_session.csv");
        let columns = "-,sample,accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z";
        line(
            "ferraris, annotated",
            by_hand(&file, columns, RawUnit::Count, Some(204.8)),
        );
        let file = data.join("example_ferraris_session.csv");
        let columns = "sample,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";
        line(
            "ferraris, session",
            by_hand(&file, columns, RawUnit::Count, Some(102.4)),
        );
    }
    if let Some(data) = data_set("suarez_mpu6050") {
        for name in [
            "example_data_calibration",
            "example_data_tinit_calc",
            "imu_90_x_rot",
            "imu_static_test",
        ] {
            let file = data.join(name).with_extension("csv");
            let columns = "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z";
            line(
                &format!("suarez, {name}"),
                by_hand(&file, columns, RawUnit::Count, Some(100.0)),
            );
        }
    }
    if let Some(data) = data_set("freeimu_mpu6050_warmup") {
        let file = data.join("Tempdata01-02-14.csv");
        let columns = "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z,-,-,-,temp_c,-,-,t_s";
        let read = of_files(
            &[(&file, columns)],
            RawUnit::Count,
            Reference::Gravity,
            |options| {
                options.log.scale = vec!["temp_c=0.0029411765".parse().expect("a factor")];
                options.log.offset = vec!["temp_c=36.53".parse().expect("an offset")];
                options.log.time_unit = Some("ms".parse().expect("a unit"));
            },
        );
        line("freeimu, warm-up", read);
    }
    if let Some(data) = data_set("sunsided_mpu6050_rest") {
        let files = [
            (data.join("gyroscope.csv"), "t_s,gyro_x,gyro_y,gyro_z"),
            (
                data.join("accelerometer.csv"),
                "t_s,accel_x,accel_y,accel_z",
            ),
        ];
        let files = files.each_ref().map(|(path, list)| (path.as_path(), *list));
        let rate = |options: &mut ImportOptions| options.log.rate_hz = Some(99.33);
        line(
            "sunsided, rest",
            of_files(&files, RawUnit::Count, Reference::Gravity, rate),
        );
    }
    if let Some(data) = data_set("pan_tvac_gyro") {
        let file = data.join("TVCtest3_7_20.csv");
        let read = of_files(
            &[(&file, "t_s,-,-,-,gyro_x,gyro_y,gyro_z,temp_c")],
            RawUnit::Si,
            Reference::Gravity,
            |options| {
                options.log.time_unit = Some("ms".parse().expect("a unit"));
            },
        );
        line("pan, vacuum chamber", read);
    }
}

fn cases() {
    let Some(cases) = data_set("cases") else {
        return;
    };
    let file = |name: &str| cases.join(name);
    line(
        "range-change",
        by_hand(&file("range-change.csv"), SIX, RawUnit::Count, None),
    );
    let columns = "t_s,accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z";
    line(
        "columns-shift",
        by_hand(&file("columns-shift.csv"), columns, RawUnit::Count, None),
    );
    for name in ["gyro-high-pass", "gyro-zeroed-at-rest"] {
        let path = file(name).with_extension("csv");
        line(name, by_hand(&path, SIX, RawUnit::Count, None));
    }
    line(
        "poses-abut",
        by_hand(
            &file("poses-abut.csv"),
            "accel_x,accel_y,accel_z",
            RawUnit::Count,
            Some(50.0),
        ),
    );
    let player = ["rest.txt", "33.txt", "45.txt"].map(|name| file("record-player").join(name));
    let player = player
        .each_ref()
        .map(|path| (path.as_path(), "gyro_x,gyro_y,gyro_z"));
    let rates = ["rest=0", "33=200", "45=270"].map(|rate| rate.parse().expect("a rate"));
    let options = |options: &mut ImportOptions| {
        options.log.rate_hz = Some(100.0);
        options.sequence = true;
        (options.log.rate_dps, options.log.rate_error) = (rates.to_vec(), Some(0.001));
    };
    line(
        "record-player",
        of_files(&player, RawUnit::Si, Reference::TurntableRate, options),
    );
    for (path, columns) in player {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let rate = |options: &mut ImportOptions| {
            options.log.rate_hz = Some(100.0);
            options.log.rate_dps = vec!["200".parse().expect("a rate")];
            options.log.rate_error = Some(0.001);
        };
        let read = of_files(
            &[(path, columns)],
            RawUnit::Si,
            Reference::TurntableRate,
            rate,
        );
        line(&format!("record-player, {name} alone"), read);
    }
}

fn of_bench() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("example");
    let files = [
        (example.join("accel.txt"), "t_s,accel_x,accel_y,accel_z"),
        (example.join("gyro.txt"), "t_s,gyro_x,gyro_y,gyro_z"),
    ];
    let files = files.each_ref().map(|(path, list)| (path.as_path(), *list));
    line(
        "tests/example",
        of_files(&files, RawUnit::Count, Reference::Gravity, |_| ()),
    );
    let opened = |plan: &str,
                  file: &mimu_rig::rig_file::RigFile,
                  seed: u64,
                  reference: Option<Reference>| {
        let folder = bench::written(plan, file, seed);
        let mut recording = Recording::open(&folder.path().join("recording"))?;
        if let Some(reference) = reference {
            recording.manifest.reference = reference;
            let rates = ["200", "270"].map(|rate| rate.parse().expect("a rate"));
            recording.manifest.turntable = Some(Turntable::new(&rates, 0.001));
        }
        found(Ok(recording), Steps::Found)
    };
    for (grade, seed) in Grade::ALL
        .into_iter()
        .flat_map(|grade| [(grade, 1), (grade, 2)])
    {
        for flawed in [false, true] {
            let mut file = by_hand::unit(&[], grade, seed);
            if flawed {
                file.flaws = by_hand::flaw(seed);
            }
            let name = format!(
                "by hand, {grade:?} {seed}{}",
                if flawed { ", flawed" } else { "" }
            );
            line(&name, opened(&by_hand::plan(seed), &file, seed, None));
        }
    }
    let mut random = Random::new(3, "unit");
    let unit = bench::clean(bench::gyro(&mut random), bench::accel(&mut random));
    line(
        "table, steps ignored",
        opened(&bench::table_plan(Some(3)), &unit, 3, None),
    );
    let plan = bench::record_player_plan(14, [0.0; 2], 5);
    line(
        "record player of the bench",
        opened(&plan, &unit, 5, Some(Reference::TurntableRate)),
    );
}

#[test]
#[ignore = "prints a table"]
fn table_of_the_dwells_of_all_recordings_at_hand() {
    println!(
        "| recording | dwells | used | s in all | shortest, s | longest, s |\n|---|---|---|---|---|---|"
    );
    real_ones();
    cases();
    of_bench();
}
