//! Rates and peak memory on an ordinary recording: four hours at 1 kHz, 14.4 million rows, 13 columns.
//!
//! `make bench`, or `cargo bench -p mimu`. Prints figures and asserts nothing: times drift on shared machines. The
//! recording is made once, under the build directory; `MIMU_BENCH_HOURS` makes it shorter.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu_recording::{
    Batch, ColumnList, Columns, ImportOptions, Manifest, RawUnit, Recording, Reference,
    SampleFormat, Writer, import,
};

const RATE_HZ: f64 = 1000.0;
/// One input for so long, of which the first second is transit.
const DWELL_S: usize = 60;

fn main() {
    let hours: f64 = std::env::var("MIMU_BENCH_HOURS")
        .ok()
        .and_then(|h| h.parse().ok())
        .unwrap_or(4.0);
    let rows = (hours * 3600.0 * RATE_HZ) as u64;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    println!(
        "{:<34}{:>10}{:>9}{:>12}{:>11}",
        "", "file", "wall", "rate", "peak"
    );
    for (format, name) in [
        (SampleFormat::Parquet, "parquet"),
        (SampleFormat::Csv, "csv"),
    ] {
        let path = folder.join(format!("four-hours-{hours}-{name}"));
        if Recording::open(&path).is_err() {
            simulate(&path, format, rows);
        }
        let size = std::fs::metadata(path.join(format.file_name())).map_or(0, |m| m.len());
        let calibration = folder.join("bench.toml");
        let (wall, peak) = run(&["fit", path_str(&path), "-o", path_str(&calibration)]);
        line(
            &format!("fit of {rows} rows from {name}"),
            size,
            wall,
            rows,
            peak,
        );
    }
    by_hand(folder);
}

fn line(what: &str, size: u64, wall: Duration, rows: u64, peak_kib: u64) {
    let rate = rows as f64 / wall.as_secs_f64() / 1e6;
    println!(
        "{what:<34}{:>7.0} MB{:>7.2} s{rate:>7.2} Mrow/s{:>8} MB",
        size as f64 / 1e6,
        wall.as_secs_f64(),
        peak_kib / 1024
    );
}

/// Wall time of the command and the most memory it had, KiB.
fn run(arguments: &[&str]) -> (Duration, u64) {
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_mimu"))
        .args(arguments)
        .stdout(Stdio::null())
        .spawn()
        .expect("the command was just built");
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        // The high-water mark only rises, so a late look misses little.
        let now = std::fs::read_to_string(&status).unwrap_or_default();
        let mark = now.lines().find_map(|l| l.strip_prefix("VmHWM:"));
        let kib = mark.and_then(|m| m.trim().trim_end_matches(" kB").parse().ok());
        peak = peak.max(kib.unwrap_or(0));
        if let Some(status) = child.try_wait().expect("it is our child") {
            assert!(status.success(), "mimu {arguments:?} failed");
            return (start.elapsed(), peak);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn path_str(path: &Path) -> &str {
    path.to_str().expect("build directories are named in ASCII")
}

/// Fit of the recording by hand that the published tools are compared on, without the reading.
fn by_hand(folder: &Path) {
    let data = std::env::var("MIMU_DATA").map_or_else(
        |_| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let files = ["xsens_acc.mat", "xsens_gyro.mat"].map(|f| data.join("imu_tk_xsens").join(f));
    if !files.iter().all(|f| f.exists()) {
        println!("recording by hand: skipped, no recordings (set MIMU_DATA)");
        return;
    }
    let mut options =
        ImportOptions::new(files.to_vec(), 9.81744, RawUnit::Count, Reference::Gravity);
    options.log.columns = ["t_s,accel_x,accel_y,accel_z", "t_s,gyro_x,gyro_y,gyro_z"]
        .map(|list| list.parse::<ColumnList>().expect("known columns"))
        .to_vec();
    options.replace = true;
    let path = folder.join("xsens");
    import(&options, &path, |_| ()).expect("the files are known to be good");
    let recording = Recording::open(&path).expect("just imported");
    let start = Instant::now();
    let prepared = Prepared::read(&recording, mimu::signal::stillness::STILL_FACTOR, |_| ())
        .expect("known to be good");
    let reading = start.elapsed();
    let start = Instant::now();
    fit(prepared, Options::default()).expect("known to be good");
    println!(
        "recording by hand, 51 175 rows: read in {:.0} ms, accelerometer, gyro and four held-out refits in {:.0} ms",
        reading.as_secs_f64() * 1e3,
        start.elapsed().as_secs_f64() * 1e3
    );
}

/// A table that goes through rates and tilts; 13 columns, steps to be found from the inputs.
fn simulate(path: &Path, format: SampleFormat, rows: u64) {
    let columns = Columns {
        gyro: true,
        accel: true,
        reference: [true; 6],
        ..Columns::default()
    };
    let mut writer =
        Writer::create(path, columns, format, true).expect("the build directory can be written");
    let mut random = 0x6d69_6d75_u64;
    let mut noise = move || {
        random ^= random >> 12;
        random ^= random << 25;
        random ^= random >> 27;
        (random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut batch = Batch::default();
    for row in 0..rows {
        let (second, dwell) = (row as usize / 1000, row as usize / (1000 * DWELL_S));
        let (axis, sign) = (dwell % 3, if dwell / 3 % 2 == 0 { 1.0 } else { -1.0 });
        let moving = second % DWELL_S == 0;
        let mut input = [0.0; 6];
        if moving {
            input = [row as f64 % 1000.0 * 1e-2; 6];
        } else {
            input[axis] = sign * [0.0, 30.0, 100.0][dwell / 6 % 3];
            input[3 + axis] = sign * 9.80665;
        }
        batch.t_s.push(row as f64 / RATE_HZ);
        for c in 0..6 {
            let other = input[3 * (c / 3) + (c + 1) % 3];
            let (null, scale, sigma) = if c < 3 {
                (2.5, 0.005, 0.004)
            } else {
                (1.65, 0.08, 0.003)
            };
            let volts =
                null + 0.01 * c as f64 + scale * (input[c] + 0.01 * other) + 3.4 * sigma * noise();
            batch.raw[c].push((volts * 1e5).round() / 1e5);
            batch.reference[c].push(input[c]);
        }
        if batch.len() == 1 << 16 || row + 1 == rows {
            writer.write(&batch).expect("there is room");
            batch.clear();
        }
    }
    let manifest = Manifest::new("bench", RATE_HZ, 9.80665, RawUnit::Volt, Reference::Table);
    writer.finish(&manifest).expect("there is room");
}
