//! A recording on disk, read in a stream.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::batch::{Batch, SLICE};
#[cfg(feature = "parquet")]
use super::columns::Layout;
use super::columns::{Column, Columns};
use super::csv_file::{CsvFile, PIECE};
use super::digest;
use super::in_memory::{self, InMemory, PairInMemory};
use super::manifest::{MANIFEST_FILE, Manifest};
#[cfg(feature = "parquet")]
use super::parquet_file::ParquetFile;
use super::triad_name::{TriadKind, TriadName};
use super::warning::Warning;
use crate::error::{Error, Result};

/// A recording whose manifest and header have been checked; the samples are read by
/// [`Recording::for_each_batch`].
#[derive(Debug, Clone)]
pub struct Recording {
    /// Contents of `recording.toml`.
    pub manifest: Manifest,
    /// Directory that it is in.
    pub directory: PathBuf,
    /// `samples.csv` or `samples.parquet` in that directory. For samples in memory, this and `directory` are the name of the device.
    pub samples: PathBuf,
    /// What messages call it: its samples, or the log that they were imported from, with the pair that is viewed.
    pub place: String,
    /// Which of the optional columns there are.
    pub columns: Columns,
    /// One sentence for each thing that was ignored.
    pub warnings: Vec<Warning>,
    source: Samples,
    /// Ratio by which the times of the samples are divided: they are by a clock that is fast by this factor.
    clock_factor: Option<f64>,
}

#[derive(Debug, Clone)]
enum Samples {
    Csv(CsvFile),
    #[cfg(feature = "parquet")]
    Parquet(ParquetFile, Layout),
    InMemory(Arc<dyn InMemory>),
}

/// Result of reading all rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadSummary {
    /// Rows read.
    pub rows: u64,
    /// SHA-256 of the samples file, as `sha256sum` prints it; for samples in memory, of their numbers.
    pub sha256: String,
    /// One sentence for each thing that was ignored.
    pub warnings: Vec<Warning>,
}

impl Recording {
    /// Opens a recording: checks its manifest and the header of its samples, reads no row.
    pub fn open(directory: &Path) -> Result<Recording> {
        let manifest = directory.join(MANIFEST_FILE);
        if !manifest.is_file() {
            let (problem, remedy) = if !directory.exists() {
                ("there is no such file or directory", "check the path")
            } else if !directory.is_dir() {
                (
                    "this is a file, but a recording is a directory",
                    "import a foreign file with `mimu import`",
                )
            } else {
                (
                    "the directory has no recording.toml",
                    "import foreign files with `mimu import`",
                )
            };
            return Err(Error::new(directory.display(), problem, remedy));
        }
        let mut manifest = Manifest::read(&manifest)?;
        if manifest.means {
            return Err(Error::new(
                directory.display(),
                "it contains means of poses, which only fit and verify can use; this command needs samples",
                "use `mimu fit` or `mimu verify`, or import a recording of samples",
            ));
        }
        let csv = directory.join("samples.csv");
        let parquet = directory.join("samples.parquet");
        let mut warnings = Vec::new();
        let (samples, layout, source) = match (csv.exists(), parquet.exists()) {
            (true, true) => {
                return Err(Error::new(
                    directory.display(),
                    "it contains both samples.csv and samples.parquet",
                    "remove the wrong one",
                ));
            }
            (false, false) => {
                return Err(Error::new(
                    directory.display(),
                    "it contains neither samples.csv nor samples.parquet",
                    "add the samples, or import the recording again",
                ));
            }
            (true, false) => {
                let mut file = CsvFile::open(&csv)?;
                if manifest.unfinished {
                    let cut = file.leave_out_cut_row()?;
                    warnings.push(Warning::Unfinished {
                        folder: directory.to_owned(),
                        cut,
                    });
                }
                (csv, file.layout.clone(), Samples::Csv(file))
            }
            #[cfg(not(feature = "parquet"))]
            (false, true) => return Err(super::writer::without_parquet(&parquet)),
            #[cfg(feature = "parquet")]
            (false, true) => {
                let file = ParquetFile::open(&parquet)?;
                let names = file.names();
                let layout = Layout::from_names(&names, &parquet.display().to_string())?;
                for (name, _) in names.iter().zip(&layout.slots).filter(|(_, s)| s.is_some()) {
                    if file.leaf(name)?.is_text() {
                        return Err(Error::new(
                            format!("{}, column {name}", parquet.display()),
                            "the column contains text",
                            "write it as DOUBLE, FLOAT, INT32 or INT64",
                        ));
                    }
                }
                (parquet, layout.clone(), Samples::Parquet(file, layout))
            }
        };
        let clock_factor = manifest.by_computer();
        Ok(Recording {
            clock_factor,
            manifest,
            directory: directory.to_owned(),
            place: samples.display().to_string(),
            samples,
            columns: layout.columns,
            warnings: [warnings, layout.warnings].concat(),
            source,
        })
    }

    /// Its folder, or the log that it was imported from, with the pair that is viewed.
    pub fn name(&self) -> String {
        match self.place.strip_prefix(&self.samples.display().to_string()) {
            Some(pair) => format!("{}{pair}", self.directory.display()),
            None => self.place.clone(),
        }
    }

    /// A recording of samples in the memory of another program. Messages use the name of its device.
    ///
    /// # Errors
    /// The manifest is invalid; there are no rows, or neither sensor.
    pub fn in_memory(mut manifest: Manifest, samples: Arc<dyn InMemory>) -> Result<Recording> {
        manifest.check("recording in memory")?;
        let place = PathBuf::from(&manifest.device);
        let columns = samples.columns();
        let refuse = |problem, remedy| Err(Error::new(place.display(), problem, remedy));
        if samples.rows() == 0 {
            let remedy = "give each sample its time and readings";
            return refuse("the recording has no samples", remedy);
        }
        if !(columns.gyro || columns.accel) {
            let remedy = "give those of the gyro, of the accelerometer, or both";
            return refuse("it has the readings of neither sensor", remedy);
        }
        Ok(Recording {
            clock_factor: manifest.by_computer(),
            manifest,
            directory: place.clone(),
            place: place.display().to_string(),
            samples: place,
            columns,
            warnings: Vec::new(),
            source: Samples::InMemory(samples),
        })
    }

    /// The same samples with the times as they are written, by the board's clock.
    #[must_use]
    pub fn with_written_times(self) -> Self {
        Self {
            clock_factor: None,
            ..self
        }
    }

    /// The triads that its samples have, by number and kind: `gyro`, `accel`, `mag`, `gyro2` and so on.
    pub fn triads(&self) -> Vec<TriadName> {
        self.columns.triads().collect()
    }

    /// The same samples with the triads `gyroN` and `accelN` in the places of `gyro` and `accel`, where N is `number`. One of the two may be missing.
    ///
    /// Times, steps, temperature and known inputs stay; the other triads are left out, and with them what the manifest says of the first pair: where
    /// its readings saturate, and how it was set.
    ///
    /// # Errors
    /// There is neither of the two.
    pub fn pair(&self, number: u8) -> Result<Recording> {
        if number == 1 {
            return Ok(self.clone());
        }
        let [gyro, accel] =
            [TriadKind::Gyro, TriadKind::Accel].map(|kind| TriadName { kind, number });
        let triads = self.triads();
        if !triads.contains(&gyro) && !triads.contains(&accel) {
            let names: Vec<String> = triads.iter().map(ToString::to_string).collect();
            let problem = format!("it has neither {gyro} nor {accel}");
            let remedy = format!(
                "it has {}: choose the number of one of these",
                names.join(", ")
            );
            return Err(Error::new(&self.place, problem, remedy));
        }
        let source = match &self.source {
            Samples::Csv(file) => Samples::Csv(file.of_pair(number)),
            #[cfg(feature = "parquet")]
            Samples::Parquet(file, layout) => {
                Samples::Parquet(file.clone(), layout.of_pair(number))
            }
            Samples::InMemory(samples) => {
                let samples = samples.clone();
                Samples::InMemory(Arc::new(PairInMemory { samples, number }))
            }
        };
        let mut manifest = self.manifest.clone();
        manifest.rails = None;
        if let Some(recorded) = &mut manifest.recorded {
            recorded.sensors = None;
        }
        Ok(Recording {
            manifest,
            columns: self.columns.of_pair(number),
            source,
            place: format!("{}, pair {number}", self.place),
            ..self.clone()
        })
    }

    /// Number of rows, if it is known without reading; CSV does not contain it.
    pub fn rows(&self) -> Option<u64> {
        match &self.source {
            Samples::Csv(_) => None,
            #[cfg(feature = "parquet")]
            Samples::Parquet(file, _) => Some(file.rows()),
            Samples::InMemory(samples) => Some(samples.rows() as u64),
        }
    }

    /// Hands all rows to `consume`, in order and on this thread, while another reads the next ones; `progress` receives the share that
    /// is done, up to 1.
    ///
    /// An error is about the first bad row. Rows of a CSV file are numbered like lines in an editor, from 1 with the header. An error of `consume`
    /// ends the reading.
    pub fn for_each_batch(
        &self,
        progress: impl Fn(f64),
        consume: impl FnMut(&Batch) -> Result<()>,
    ) -> Result<ReadSummary> {
        self.in_pieces(PIECE, SLICE, progress, consume)
    }

    /// Whether one column can be read without the others; only in CSV it cannot.
    pub fn is_columnar(&self) -> bool {
        !matches!(self.source, Samples::Csv(..))
    }

    /// Whole columns of the recording, steps as numbers. In a CSV file every column is parsed.
    pub fn read_columns(
        &self,
        columns: &[Column],
        progress: impl Fn(f64),
    ) -> Result<Vec<Vec<f64>>> {
        let mut all = self.written_columns(columns, progress)?;
        if let Some(factor) = self.clock_factor {
            let times = all.iter_mut().zip(columns);
            let times = times.filter(|(_, column)| **column == Column::Time);
            times
                .flat_map(|(values, _)| values)
                .for_each(|t| *t /= factor);
        }
        Ok(all)
    }

    fn written_columns(&self, columns: &[Column], progress: impl Fn(f64)) -> Result<Vec<Vec<f64>>> {
        match &self.source {
            Samples::Csv(_) => {}
            #[cfg(feature = "parquet")]
            Samples::Parquet(file, layout) => {
                let column = |column: &Column| file.column(layout, *column);
                return columns.iter().map(column).collect();
            }
            Samples::InMemory(samples) => {
                let column = |column: &Column| {
                    let mut values = Vec::with_capacity(samples.rows());
                    samples.append(*column, 0..samples.rows(), &mut values)?;
                    Ok(values)
                };
                return columns.iter().map(column).collect();
            }
        }
        let mut all: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
        self.in_written_pieces(PIECE, SLICE, progress, |batch| {
            for (values, column) in all.iter_mut().zip(columns) {
                match batch.values(*column) {
                    Some(more) => values.extend_from_slice(more),
                    None => values.extend(batch.step.iter().copied().map(f64::from)),
                }
            }
            Ok(())
        })?;
        Ok(all)
    }

    /// [`Recording::for_each_batch`] with pieces of a chosen size, in rows of CSV and of Parquet.
    pub(super) fn in_pieces(
        &self,
        piece: usize,
        slice: usize,
        progress: impl Fn(f64),
        mut consume: impl FnMut(&Batch) -> Result<()>,
    ) -> Result<ReadSummary> {
        let Some(factor) = self.clock_factor else {
            return self.in_written_pieces(piece, slice, progress, consume);
        };
        self.in_written_pieces(piece, slice, progress, |batch| {
            let mut batch = batch.clone();
            batch.t_s.iter_mut().for_each(|t| *t /= factor);
            consume(&batch)
        })
    }

    #[cfg_attr(not(feature = "parquet"), expect(unused_variables))]
    fn in_written_pieces(
        &self,
        piece: usize,
        slice: usize,
        progress: impl Fn(f64),
        consume: impl FnMut(&Batch) -> Result<()>,
    ) -> Result<ReadSummary> {
        let (rows, sha256) = match &self.source {
            Samples::Csv(file) => digest::while_hashing(&self.samples, || {
                file.for_each_batch(piece, progress, consume)
            }),
            #[cfg(feature = "parquet")]
            Samples::Parquet(file, layout) => digest::while_hashing(&self.samples, || {
                file.for_each_batch(layout, slice, progress, consume)
            }),
            Samples::InMemory(samples) => {
                in_memory::for_each_batch(samples.as_ref(), progress, consume)
            }
        }?;
        Ok(ReadSummary {
            rows,
            sha256,
            warnings: self.warnings.clone(),
        })
    }
}
