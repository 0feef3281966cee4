//! The folder of a session: settings, journal and recordings. A session that is killed at any time resumes after its last dwell.
//!
//! | file | contents |
//! |---|---|
//! | `session.json` | settings and unit |
//! | `journal.jsonl` | a line for each completed action |
//! | `calibration/`, `verification/`, `confirmation/` | recordings that the other commands can read |
//! | `calibration.toml` | the calibration |
//! | `held-before.bin` | the calibration that the device stored before the session, in its encoding |
//! | `diagnosis.html`, `with-effects.toml` | page about the remaining errors, and the calibration with effects |
//!
//! The samples of a dwell are written to disk before its line in the journal. An incomplete line, and samples after the last line, are ignored.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use mimu::diagnose::Verdict;
use mimu_recording::{
    Argument, Batch, ClockRate, Columns, Error, Growing, MANIFEST_FILE, Manifest, Recorded,
    Recording, Restart, Result, SampleFormat,
};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use crate::part::Part;
use crate::procedure::SessionConfig;
use crate::spin::Spin;
use mimu_equipment::step::Step;

/// A line of the journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "entry", rename_all = "kebab-case")]
pub enum Entry {
    /// A dwell was completed.
    Dwell {
        /// The recording.
        part: Part,
        /// Number in the recording.
        number: i32,
        /// The completed dwell.
        step: Step,
        /// Requested direction up, if the user turned the unit after the request.
        #[serde(default)]
        asked: Option<[f64; 3]>,
        /// Time of its first sample, s.
        from_s: f64,
        /// Rows of the recording up to the end of the dwell.
        rows: u64,
        /// Bytes of its samples up to the end of the dwell.
        bytes: u64,
        /// Mean temperature, °C, if known.
        temp_c: Option<f64>,
    },
    /// Whole turns were made, and the unit was put back.
    Spin {
        /// The recording.
        part: Part,
        /// Number of the dwell in which they ended.
        number: i32,
        /// Their axis and number as the gyro shows them.
        spin: Spin,
    },
    /// A running dwell was discarded.
    Discarded {
        /// The requested dwell.
        step: Step,
        /// The reason.
        why: String,
    },
    /// A dwell is to be repeated; the previous one is discarded.
    Redo {
        /// The recording.
        part: Part,
        /// Number of the dwell.
        number: i32,
    },
    /// The device restarted, or the line was lost and restored.
    Interrupted {
        /// Description.
        why: String,
    },
    /// A calibration was made from a recording and earlier ones. If made again, it gets the same date and is identical byte by byte.
    Made {
        /// The last of these recordings.
        part: Part,
        /// Date, RFC 3339.
        created: String,
    },
    /// The calibration was verified.
    Verified {
        /// Whether the verification passed.
        passed: bool,
    },
    /// The remaining errors were diagnosed.
    Diagnosed {
        /// Verdict of the diagnosis.
        verdict: Verdict,
        /// Ids of the effects found.
        effects: Vec<String>,
    },
    /// A calibration was stored on the device.
    Stored {
        /// Hash of the calibration.
        hash: String,
        /// Ids of its effects.
        effects: Vec<String>,
    },
    /// The session is complete.
    Done,
}

/// Settings and unit of a session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Begun {
    /// `mimu-wizard-session/1`.
    pub format: String,
    /// Id of the unit.
    pub unit_id: String,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Settings.
    #[serde(rename = "asked")]
    pub config: SessionConfig,
}

/// The folder of a session.
#[derive(Debug)]
pub struct Folder {
    /// Path of the folder.
    pub path: PathBuf,
    journal: File,
    entries: Vec<Entry>,
}

const SESSION: &str = "session.json";
const JOURNAL: &str = "journal.jsonl";

impl Folder {
    /// Settings of the session in this folder, if there is one.
    pub fn begun(path: &Path) -> Result<Option<Begun>> {
        let file = path.join(SESSION);
        if !file.is_file() {
            return Ok(None);
        }
        let text = mimu_recording::read_text(&file)?;
        let begun: Begun = serde_json::from_str(&text).map_err(|e| {
            let remedy = "name another folder, or remove this one";
            Error::new(file.display(), e, remedy).about(Argument::Output)
        })?;
        Ok(Some(begun))
    }

    /// Begins a session in a new folder.
    pub fn create(path: &Path, begun: &Begun) -> Result<Self> {
        if path.exists() && fs::read_dir(path).is_ok_and(|mut d| d.next().is_some()) {
            let problem = "the folder is not empty and contains no session";
            let error = Error::new(path.display(), problem, "give another folder");
            return Err(error.about(Argument::Output));
        }
        let _parents = mimu_recording::Parents::create(path)?;
        fs::create_dir_all(path).map_err(|e| Error::io(path, &e))?;
        let text = serde_json::to_string_pretty(begun)
            .map_err(|e| Error::new(path.display(), e, "report this"))?;
        mimu_recording::result_file::stage(&path.join(SESSION), text + "\n")?.publish()?;
        Self::open(path)
    }

    /// Opens the folder of an existing session.
    pub fn open(path: &Path) -> Result<Self> {
        let file = path.join(JOURNAL);
        let io = |e: std::io::Error| Error::io(&file, &e);
        let text = match fs::read_to_string(&file) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(e) => return Err(io(e)),
        };
        let whole = text.rfind('\n').map_or(0, |at| at + 1);
        let mut entries = Vec::new();
        for (k, line) in (1..).zip(text[..whole].lines()) {
            let entry = serde_json::from_str(line).map_err(|e| {
                let place = format!("{}, line {k}", file.display());
                Error::new(place, e, "start a new session in another folder")
            })?;
            entries.push(entry);
        }
        let journal = OpenOptions::new()
            .create(true)
            .write(true)
            .truncate(false)
            .open(&file)
            .map_err(io)?;
        // An incomplete line is removed.
        journal.set_len(whole as u64).map_err(io)?;
        drop(journal);
        let journal = OpenOptions::new().append(true).open(&file).map_err(io)?;
        Ok(Self {
            path: path.to_owned(),
            journal,
            entries,
        })
    }

    /// Appends an entry to the journal, and waits until it is on disk.
    pub fn add(&mut self, entry: Entry) -> Result<()> {
        let file = self.path.join(JOURNAL);
        let mut line = serde_json::to_string(&entry)
            .map_err(|e| Error::new(file.display(), e, "report this"))?;
        line.push('\n');
        let written = self.journal.write_all(line.as_bytes());
        written
            .and_then(|()| self.journal.sync_data())
            .map_err(|e| Error::io(&file, &e))?;
        self.entries.push(entry);
        Ok(())
    }

    /// All entries so far.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The valid dwells of a recording, with their numbers.
    pub fn dwells(&self, of: Part) -> Vec<(i32, Step)> {
        let mut all: Vec<(i32, Step)> = Vec::new();
        for entry in &self.entries {
            match entry {
                Entry::Dwell {
                    part, number, step, ..
                } if *part == of => all.push((*number, *step)),
                Entry::Redo { part, number } if *part == of => all.retain(|d| d.0 != *number),
                _ => {}
            }
        }
        all
    }

    /// The whole turns of a recording.
    pub fn spins(&self, of: Part) -> Vec<Spin> {
        let spins = self.entries.iter().filter_map(|entry| match entry {
            Entry::Spin { part, spin, .. } if *part == of => Some(*spin),
            _ => None,
        });
        spins.collect()
    }

    /// The last valid dwell of any recording.
    pub fn last_dwell(&self) -> Option<Step> {
        let last = self.entries.iter().rev().find_map(|entry| match entry {
            Entry::Dwell { part, .. } => Some(*part),
            _ => None,
        });
        self.dwells(last?).last().map(|d| d.1)
    }

    /// Cause of a restart after the last dwell of the calibration, if its recording or that of the verification names one.
    pub fn restart_since_calibration(&self) -> Option<String> {
        let ends = self.entries.iter().filter_map(|entry| match entry {
            Entry::Dwell {
                part: Part::Calibration,
                from_s,
                step,
                ..
            } => Some(from_s + step.dwell_s),
            _ => None,
        });
        let end_s = ends.fold(f64::NEG_INFINITY, f64::max);
        let parts = [Part::Calibration, Part::Verification].into_iter();
        let written = parts.map(|part| self.file(part.name()).join(MANIFEST_FILE));
        let recorded = written.filter_map(|path| Manifest::read(&path).ok()?.recorded);
        let mut restarts = recorded.flat_map(|recorded| recorded.restarts);
        let since = restarts.find(|restart| restart.t_s >= end_s);
        since.map(|restart| restart.start)
    }

    /// Poses of a recording that the user turned the unit to: requested and recorded direction up.
    pub fn shown(&self, of: Part) -> Vec<[Vector3<f64>; 2]> {
        let shown = self.entries.iter().filter_map(|entry| match entry {
            Entry::Dwell {
                part,
                step,
                asked: Some(asked),
                ..
            } if *part == of => Some([Vector3::from(*asked), step.up()]),
            _ => None,
        });
        shown.collect()
    }

    /// Date of the first calibration from this recording, or `now` if there is none.
    pub fn created(&mut self, of: Part, now: impl FnOnce() -> String) -> Result<String> {
        let before = self.entries.iter().find_map(|entry| match entry {
            Entry::Made { part, created } if *part == of => Some(created.clone()),
            _ => None,
        });
        if let Some(created) = before {
            return Ok(created);
        }
        let created = now();
        self.add(Entry::Made {
            part: of,
            created: created.clone(),
        })?;
        Ok(created)
    }

    /// Whether the session is complete.
    pub fn is_done(&self) -> bool {
        self.entries.last() == Some(&Entry::Done)
    }

    /// Numbers of the discarded dwells.
    fn dropped(&self, of: Part) -> Vec<i32> {
        let redone = self.entries.iter().filter_map(|entry| match entry {
            Entry::Redo { part, number } if *part == of => Some(*number),
            _ => None,
        });
        redone.collect()
    }

    /// Number of dwells that were discarded while they ran.
    pub fn discarded(&self) -> usize {
        let discarded = |e: &&Entry| matches!(e, Entry::Discarded { .. });
        self.entries.iter().filter(discarded).count()
    }

    /// Temperatures of the first and the last dwell, °C.
    pub fn temperatures(&self) -> Option<[f64; 2]> {
        let mut all = self.entries.iter().filter_map(|entry| match entry {
            Entry::Dwell { temp_c, .. } => *temp_c,
            _ => None,
        });
        let first = all.next()?;
        Some([first, all.next_back().unwrap_or(first)])
    }

    /// Path of a file or a recording in the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

/// A recording in progress: on disk, and in memory for the fits after each dwell.
#[derive(Debug)]
pub struct OpenRecording {
    part: Part,
    growing: Growing,
    manifest: Manifest,
    /// All rows so far.
    pub samples: Batch,
}

impl OpenRecording {
    /// Begins a recording, or continues after the last dwell in the journal.
    pub fn begin(
        folder: &Folder,
        part: Part,
        columns: Columns,
        mut manifest: Manifest,
    ) -> Result<Self> {
        let directory = folder.file(part.name());
        let last = folder.entries().iter().rev().find_map(|entry| match entry {
            Entry::Dwell {
                part: of,
                rows,
                bytes,
                ..
            } if *of == part => Some((*rows, *bytes)),
            _ => None,
        });
        let mut samples = Batch::default();
        let growing = match last {
            None => {
                // Samples from before the first complete dwell are discarded.
                if directory.exists() {
                    fs::remove_dir_all(&directory).map_err(|e| Error::io(&directory, &e))?;
                }
                Growing::create(&directory, columns, &manifest)?
            }
            Some((rows, bytes)) => {
                // The power-on time was stored at the beginning. The recording's clock has continued since, whatever the device did.
                let written = Manifest::read(&directory.join(MANIFEST_FILE))?;
                manifest.power_on_s = written.power_on_s;
                let clocks = manifest.clock.into_iter().chain(written.clock);
                manifest.clock = clocks.min_by(|a, b| a.half_width.total_cmp(&b.half_width));
                manifest.recorded = match (manifest.recorded, written.recorded) {
                    (Some(now), Some(before)) => Some(Recorded {
                        restarts: before.restarts,
                        missing: now.missing + before.missing,
                        ..now
                    }),
                    (now, before) => now.or(before),
                };
                let growing = Growing::resume(&directory, columns, rows, bytes)?;
                let recording = Recording::open(&directory)?.with_written_times();
                if recording.columns != columns {
                    let problem = "its columns are not those that the board writes now";
                    let remedy = "start a new session in another folder";
                    return Err(Error::new(directory.display(), problem, remedy));
                }
                recording.for_each_batch(
                    |_| {},
                    |batch| {
                        samples.append(batch, 0..batch.len());
                        Ok(())
                    },
                )?;
                if samples.len() as u64 != rows {
                    let problem = format!(
                        "it has {} rows, but by the journal it should have {rows}",
                        samples.len()
                    );
                    let remedy = "start a new session in another folder";
                    return Err(Error::new(directory.display(), problem, remedy));
                }
                growing
            }
        };
        let mut recording = Self {
            part,
            growing,
            manifest,
            samples,
        };
        recording.manifest.dropped_steps = folder.dropped(part);
        Ok(recording)
    }

    /// Appends rows.
    pub fn write(&mut self, rows: &Batch) -> Result<()> {
        self.growing.write(rows)?;
        self.samples.append(rows, 0..rows.len());
        Ok(())
    }

    /// Rows and bytes that are on disk for certain.
    pub fn settled(&self) -> Result<(u64, u64)> {
        Ok((self.growing.rows(), self.growing.sync(&self.manifest)?))
    }

    /// Discards the dwell with this number.
    pub fn drop_dwell(&mut self, number: i32) {
        self.manifest.dropped_steps.push(number);
    }

    /// Records that samples are missing between received ones.
    pub fn missing(&mut self, samples: u64) {
        if let Some(recorded) = &mut self.manifest.recorded {
            recorded.missing += samples;
        }
    }

    /// Records that the device restarted at this time of the recording, s.
    pub fn restarted(&mut self, t_s: f64, start: String) {
        // A board of another maker tells nothing else of itself.
        let none = || Recorded {
            tool: concat!("mimu ", env!("CARGO_PKG_VERSION")).into(),
            ..Recorded::default()
        };
        let recorded = self.manifest.recorded.get_or_insert_with(none);
        recorded.restarts.push(Restart { t_s, start });
    }

    /// Records how fast the clock of its times runs. Whoever reads it corrects them: on disk they stay as they came, so that a comparison over a longer time
    /// improves all of them.
    pub fn set_clock(&mut self, clock: ClockRate) {
        self.manifest.clock = Some(clock);
    }

    /// The manifest.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Time of the last row, s.
    pub fn last_s(&self) -> Option<f64> {
        self.samples.t_s.last().copied()
    }

    /// Completes the recording, so that other commands can read it.
    pub fn finish(self, folder: &Folder) -> Result<PathBuf> {
        let format = SampleFormat::Csv;
        self.growing.finish(&self.manifest, format, None, |_| {})?;
        Ok(folder.file(self.part.name()))
    }
}
