//! A recording that grows while it is received, and stays readable even if the program is killed.
//!
//! Rows are appended to `samples.csv` as they come and handed to the operating system at once, so that a killed program loses none. Another thread
//! syncs the file to disk every second, so that a power failure loses no more than that. Parquet files would be unreadable before they are finished,
//! and a journal of another format would need its own program to be read.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::batch::Batch;
use super::columns::Columns;
use super::csv_writer::CsvWriter;
use super::manifest::{MANIFEST_FILE, Manifest};
use super::parents::{Parents, folder};
use super::reader::Recording;
use super::result_file::stage;
use super::staging::{check_target, sync_directory};
use super::writer::{SampleFormat, Writer};
use crate::error::{Error, Result};

/// Time between two syncs to disk.
const SYNC: Duration = Duration::from_secs(1);

/// A recording that is being received.
#[derive(Debug)]
pub struct Growing {
    directory: PathBuf,
    csv: Option<CsvWriter>,
    columns: Columns,
    rows: u64,
    disk: Option<SyncThread>,
}

/// The thread that syncs the file to disk. A sync may take longer than the port can buffer, which is some tenths of a second.
#[derive(Debug)]
struct SyncThread {
    stop: Sender<()>,
    thread: JoinHandle<std::io::Result<()>>,
}

impl Growing {
    /// Refuses a directory in which no recording can be started.
    pub fn check(directory: &Path) -> Result<()> {
        check_target(directory, None)?;
        // Only a trial: when dropped, it removes the folders again.
        Parents::create(directory).map(drop)
    }

    /// Starts a recording in a new directory. Its manifest is written now and marks the recording as unfinished.
    pub fn create(directory: &Path, columns: Columns, manifest: &Manifest) -> Result<Self> {
        let place = directory.join(MANIFEST_FILE).display().to_string();
        manifest.check(&place)?;
        check_target(directory, None)?;
        let _parents = Parents::create(directory)?;
        fs::create_dir_all(directory).map_err(|error| Error::io(directory, &error))?;
        let mut csv = CsvWriter::create(&directory.join(SampleFormat::Csv.file_name()), columns)?;
        csv.flush()?;
        let disk = SyncThread::new(csv.file()).map_err(|error| Error::io(directory, &error))?;
        let growing = Self {
            directory: directory.to_owned(),
            csv: Some(csv),
            columns,
            rows: 0,
            disk,
        };
        growing.write_unfinished(manifest)?;
        sync_directory(folder(directory));
        Ok(growing)
    }

    /// Continues an unfinished recording after its first `rows` rows, which end at byte `bytes` of the samples file. The rest is cut off.
    pub fn resume(directory: &Path, columns: Columns, rows: u64, bytes: u64) -> Result<Self> {
        let path = directory.join(SampleFormat::Csv.file_name());
        let csv = CsvWriter::append(&path, columns, bytes)?;
        let disk = SyncThread::new(csv.file()).map_err(|error| Error::io(directory, &error))?;
        Ok(Self {
            directory: directory.to_owned(),
            csv: Some(csv),
            columns,
            rows,
            disk,
        })
    }

    /// Waits until everything written is on the disk, and the manifest so far; returns the size of the samples file in bytes.
    pub fn sync(&self, manifest: &Manifest) -> Result<u64> {
        let Some(csv) = &self.csv else {
            return Ok(0);
        };
        self.write_unfinished(manifest)?;
        let file = csv.file();
        let synced = file.sync_data().and_then(|()| file.metadata());
        synced
            .map(|m| m.len())
            .map_err(|error| Error::io(&self.directory, &error))
    }

    /// Appends rows. They must have the announced columns, and no value that a reader would refuse.
    pub fn write(&mut self, batch: &Batch) -> Result<()> {
        if let Some(column) = batch.ragged(&self.columns) {
            return Err(Error::new(
                format!("{}, column {}", self.directory.display(), column.name()),
                "the rows to be written do not have the announced columns",
                "report this error: it is a mistake in the program",
            ));
        }
        if self
            .disk
            .as_ref()
            .is_some_and(|disk| disk.thread.is_finished())
        {
            self.stop_syncing()?;
        }
        if let Some(csv) = &mut self.csv {
            csv.write(batch)?;
            csv.flush()?;
        }
        self.rows += batch.len() as u64;
        Ok(())
    }

    /// Rows so far.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Finishes the recording: `manifest` replaces the first one, and the samples are converted if `format` is Parquet. `complete` fills in what was
    /// known only at the end. A recording without rows is removed.
    pub fn finish(
        mut self,
        manifest: &Manifest,
        format: SampleFormat,
        mut complete: Option<&mut dyn FnMut(&mut Batch)>,
        progress: impl Fn(f64),
    ) -> Result<()> {
        self.stop_syncing()?;
        if self.rows == 0 {
            drop(self.csv.take());
            return fs::remove_dir_all(&self.directory)
                .map_err(|error| Error::io(&self.directory, &error));
        }
        if let Some(csv) = self.csv.take() {
            csv.finish()?;
        }
        let manifest = Manifest {
            unfinished: false,
            ..manifest.clone()
        };
        if format == SampleFormat::Csv && complete.is_none() {
            return self.write_manifest(&manifest);
        }
        let recording = Recording::open(&self.directory)?;
        let mut writer = Writer::create(&self.directory, self.columns, format, true)?;
        recording.for_each_batch(progress, |batch| match &mut complete {
            None => writer.write(batch),
            Some(complete) => {
                let mut batch = batch.clone();
                complete(&mut batch);
                writer.write(&batch)
            }
        })?;
        writer.finish(&manifest).map(drop)
    }

    fn write_unfinished(&self, manifest: &Manifest) -> Result<()> {
        self.write_manifest(&Manifest {
            unfinished: true,
            ..manifest.clone()
        })
    }

    /// Replaces the manifest.
    fn write_manifest(&self, manifest: &Manifest) -> Result<()> {
        stage(&self.directory.join(MANIFEST_FILE), manifest.to_toml()?)?.publish()?;
        sync_directory(&self.directory);
        Ok(())
    }

    /// Ends the syncing thread and returns its result.
    fn stop_syncing(&mut self) -> Result<()> {
        let Some(SyncThread { stop, thread }) = self.disk.take() else {
            return Ok(());
        };
        drop(stop);
        match thread.join() {
            Ok(done) => done.map_err(|error| Error::io(&self.directory, &error)),
            Err(_) => Err(Error::new(
                self.directory.display(),
                "the thread that writes to the disk failed",
                "report this",
            )),
        }
    }
}

impl SyncThread {
    /// `None` if files are in memory: there is no disk to sync.
    fn new(file: &File) -> std::io::Result<Option<Self>> {
        if cfg!(target_family = "wasm") {
            return Ok(None);
        }
        let file = file.try_clone()?;
        let (stop, stopped) = channel();
        let wait = move || {
            while stopped.recv_timeout(SYNC) == Err(RecvTimeoutError::Timeout) {
                file.sync_data()?;
            }
            Ok(())
        };
        let name = std::thread::Builder::new().name("disk".into());
        let thread = name.spawn(wait)?;
        Ok(Some(Self { stop, thread }))
    }
}

impl Drop for Growing {
    fn drop(&mut self) {
        // The result no longer matters: the recording was abandoned and stays unfinished.
        let _ = self.stop_syncing();
    }
}
