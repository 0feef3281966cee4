//! Time stamps of loggers that lose samples, pause or are slow. The virtual bench gives the true time of each sample.

use mimu_recording::error::Result;
use mimu_recording::{
    Batch, ImportOptions, ImportSummary, RawUnit, Recording, Reference, TimeSummary, import,
};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record::samples;
use mimu_rig::rig_file::{RigFile, RigTruth};

/// A session by hand as a logger writes it: whole microseconds since its start, then six counts.
struct Log {
    text: String,
    /// When each sample was taken, s.
    taken_s: Vec<f64>,
}

impl Log {
    fn new(rate_hz: f64, flaws: &str) -> Log {
        let plan = format!(
            "format = \"mimu-plan/1\"\nsample_rate_hz = {rate_hz:?}\ncarrier = \"hands\"\n[[step]]\nposes = 12\ndwell_s = 4.0\n"
        );
        let rig = format!(
            "format = \"mimu-rig/1\"\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n[flaws]\n{flaws}\n"
        );
        let plan = Plan::parse(Source::new("PLAN.toml", plan)).expect("a plan");
        let file = RigFile::parse(&Source::new("RIG.toml", rig)).expect("a rig");
        let truth = RigTruth::resolve(&file, 5).expect("a rig");
        let mut log = Log {
            text: String::new(),
            taken_s: Vec::new(),
        };
        for row in samples(&plan, &truth, 5).expect("a run") {
            let readings = row.readings.gyro.iter().chain(&row.readings.accel);
            let cells: Vec<String> = readings.map(|u| format!("{u:.0}")).collect();
            let stamp_us = 1e6 * (row.stamp_s + 300.0);
            log.text += &format!("{stamp_us:.0},{}\n", cells.join(","));
            log.taken_s.push(row.instant.motion.t_s);
        }
        log
    }

    /// Imports the log with the options that `with` sets. Returns the summary of its times, and the times of its rows relative to the first.
    fn import(&self, with: impl Fn(&mut ImportOptions)) -> Result<(TimeSummary, Vec<f64>)> {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, out) = (folder.path().join("log.csv"), folder.path().join("out"));
        std::fs::write(&file, &self.text).expect("written");
        let list = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";
        let mut options = ImportOptions::new(vec![file], 9.81, RawUnit::Count, Reference::Gravity);
        options.log.columns = vec![list.parse().expect("a list")];
        with(&mut options);
        let summary: ImportSummary = import(&options, &out, |_| ())?;
        let mut t_s: Vec<f64> = Vec::new();
        let each = |batch: &Batch| {
            t_s.extend(&batch.t_s);
            Ok(())
        };
        Recording::open(&out)?.for_each_batch(|_| (), each)?;
        let first = t_s[0];
        Ok((
            summary.time[0].clone(),
            t_s.iter().map(|t| t - first).collect(),
        ))
    }

    /// How many samples of `rate_hz` are missing between the first and the last, and in how many places.
    fn missing(&self, rate_hz: f64) -> (u64, u64) {
        let steps = self.taken_s.windows(2).map(|w| w[1] - w[0]);
        let lost = steps.map(|step| (step * rate_hz).round() as u64 - 1);
        lost.filter(|lost| *lost > 0)
            .fold((0, 0), |(all, places), lost| (all + lost, places + 1))
    }
}

#[test]
fn samples_that_a_logger_loses_or_pauses_for_are_counted_and_bend_no_time() {
    for (rate_hz, flaws) in [
        (250.0, "lost_share = 0.25"),
        (250.0, "lost_share = 0.02"),
        (100.0, "pause_after = 51\npause_s = 2.83"),
        (100.0, "pause_after = 300\npause_s = 7.0\nlost_share = 0.05"),
        (250.0, "lost_share = 0.1\nstamp_jitter_s = 0.0001"),
    ] {
        let log = Log::new(rate_hz, flaws);
        let (time, t_s) = log.import(|_| ()).expect("importable");
        assert!(
            (time.rate_hz / rate_hz - 1.0).abs() < 1e-5,
            "{flaws}: {time:?}"
        );
        assert_eq!((time.missing, time.gaps), log.missing(rate_hz), "{flaws}");
        let first = log.taken_s[0];
        let off = t_s
            .iter()
            .zip(&log.taken_s)
            .map(|(t, taken)| (t - taken + first).abs());
        // Rounding to microseconds, and the jitter of the stamps themselves at its largest.
        let most = if flaws.contains("jitter") { 1e-3 } else { 2e-6 };
        assert!(off.fold(0.0, f64::max) < most, "{flaws}");
    }
}

#[test]
fn a_buffer_that_is_handed_over_in_bursts_is_still_a_steady_stream_without_gaps() {
    // The intervals within a burst alone would mean 10 Hz, in milliseconds.
    let log = Log::new(100.0, "stamp_burst = 4");
    let (time, _) = log.import(|_| ()).expect("importable");
    assert_eq!((time.gaps, time.stamps_kept), (0, false), "{time:?}");
    assert!((time.rate_hz / 100.0 - 1.0).abs() < 1e-3, "{time:?}");
}
