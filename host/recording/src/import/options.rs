//! What to import and how.

use std::path::{Path, PathBuf};

use super::faces::Face;
use super::log_options::{LogOptions, file_name, said_if};
use super::per_column::Scale;
use super::preset::{Chosen, PresetUse};
use super::row_filter::RowFilter;
use super::source::HowToRead;
use crate::declared::{RawUnit, Reference};
use crate::digest;
use crate::error::{Argument, Error, Result};
use crate::manifest::{Source, check_gravity, check_rate};
use crate::unit_name::UNNAMED;
use crate::writer::SampleFormat;

/// What to import and how.
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Files; the later ones are joined onto the times of the first.
    pub files: Vec<PathBuf>,
    /// What is known of them. Columns: one list for each file; none if the headers have the names of a recording. A single file may have several, for
    /// sensors in separate columns or rows. Its gravity, unit and reference, if any, are those below.
    pub log: LogOptions,
    /// Local gravity in m/s².
    pub gravity_mps2: f64,
    /// Unit of the raw columns, after scaling.
    pub raw_unit: RawUnit,
    /// What is known of the true input.
    pub reference: Reference,
    /// Whether the files follow one another, each a step labelled with its file name. Otherwise they are joined on their times.
    pub sequence: bool,
    /// Face of the unit that was up in each file; the files are then a sequence. Otherwise empty.
    pub faces: Vec<Face>,
    /// The preset that was used; see [`ImportOptions::with_preset`].
    pub preset: Option<PresetUse>,
    /// Its warnings.
    pub preset_warnings: Vec<String>,
    /// Format of the samples.
    pub format: SampleFormat,
    /// Whether an existing recording is replaced.
    pub replace: bool,
}

impl ImportOptions {
    /// Options with the values that have no default.
    pub fn new(
        files: Vec<PathBuf>,
        gravity_mps2: f64,
        raw_unit: RawUnit,
        reference: Reference,
    ) -> Self {
        Self {
            files,
            log: LogOptions::default(),
            gravity_mps2,
            raw_unit,
            reference,
            sequence: false,
            faces: Vec::new(),
            preset: None,
            preset_warnings: Vec::new(),
            format: SampleFormat::default(),
            replace: false,
        }
    }

    /// Adds what a preset knows about the files where nothing was given by hand. The unit of the readings stays, because every caller gives it.
    pub fn with_preset(mut self, chosen: Chosen) -> Self {
        self.files = chosen.files;
        if self.log.columns.is_empty() {
            self.log.columns = chosen.columns;
        }
        let scales = Scale::beside(&chosen.scales, &self.log.scale);
        self.log.scale.extend(scales);
        self.log.rate_hz = self.log.rate_hz.or(chosen.rate_hz);
        self.log.preset = chosen.used.name.parse().ok();
        self.preset = Some(chosen.used);
        self.preset_warnings = chosen.warnings;
        self
    }

    /// Refuses options that contradict each other, or a recording at `out` that contains one of the files.
    pub(super) fn check(&self, out: &Path) -> Result<()> {
        let refuse = |problem: String, remedy: &str| Err(Error::new("import", problem, remedy));
        let (log, files) = (&self.log, self.files.len());
        let (lists, faces) = (log.columns.len(), self.faces.len());
        if files == 0 {
            return refuse("no file is given".to_owned(), "name the files to import");
        }
        let one_for_all = self.is_sequence() && lists == 1;
        let of_one_file = files == 1 && !self.is_sequence() && !log.means;
        if lists != 0 && lists != files && !one_for_all && !of_one_file {
            return refuse(
                format!("{files} files but {lists} lists of columns are given"),
                "give one list of columns for each file, in their order",
            );
        }
        if faces != 0 && faces != files {
            return refuse(
                format!("{files} files but {faces} faces are given"),
                "give one file for each face",
            );
        }
        if let Some(gap) = log.step_gap_s
            && !(gap > 0.0 && gap.is_finite())
        {
            return refuse(
                format!("{gap} s is not a pause"),
                "write the seconds that separate two dwells",
            );
        }
        let mut each = (1..).zip(&self.faces);
        if let Some((_, face)) = each.find(|(i, f)| self.faces[*i..].contains(f)) {
            return refuse(
                format!("the face {face} is given twice"),
                "give one file for each face, or name files with --sequence",
            );
        }
        // A command refuses most of these by itself.
        let only_samples = [
            ("a low byte is corrected", !log.signed_low_byte.is_empty()),
            (
                "codes are read",
                !log.twos_complement.is_empty() || !log.zero.is_empty(),
            ),
            (
                "rows are chosen",
                log.rows.is_some() || !log.filters.is_empty(),
            ),
            (
                "the rate of a turntable is a reference",
                self.reference == Reference::TurntableRate,
            ),
        ];
        if let Some((what, _)) = only_samples.iter().find(|(_, given)| *given && log.means) {
            let problem = format!("{what} for samples, but these are means");
            return refuse(problem, "import the samples, or leave it out");
        }
        for (both, problem) in [
            (
                log.step_gap_s.is_some() && (self.is_sequence() || log.means),
                "dwells are to be separated by pauses, but each file or row is a dwell already",
            ),
            (
                faces != 0 && log.inputs.is_some(),
                "the faces give the inputs, but a table of inputs is given too",
            ),
        ] {
            if both {
                return refuse(problem.to_owned(), "leave out one of the two");
            }
        }
        self.check_filters()?;
        if let Some(rate) = log.rate_hz {
            check_rate(rate, "import, sample_rate_hz")
                .map_err(|e| e.about(Argument::SampleRate))?;
        }
        check_gravity(self.gravity_mps2, "import, gravity")?;
        // A source inside the recording that is to be replaced would be deleted with it.
        for file in self.files.iter().chain(&self.log.inputs) {
            let (Ok(file), Ok(out)) = (file.canonicalize(), out.canonicalize()) else {
                continue;
            };
            if file.starts_with(&out) {
                let problem = format!("{} is inside the recording to be written", file.display());
                return refuse(problem, "choose another name for the recording");
            }
        }
        Ok(())
    }

    /// Name of the unit.
    pub(super) fn unit(&self) -> &str {
        self.log.device.as_deref().unwrap_or(UNNAMED)
    }

    /// Whether the files follow one another.
    pub(super) fn is_sequence(&self) -> bool {
        self.sequence || !self.faces.is_empty()
    }

    /// The options as arguments of `mimu import`, for the manifest. File names come without folders, which are useless on another machine and may be
    /// private.
    pub fn arguments(&self) -> Vec<String> {
        let files = self.files.iter().map(|file| file_name(file));
        let files: Vec<String> = match self.faces.is_empty() {
            true => files.collect(),
            false => self
                .faces
                .iter()
                .zip(files)
                .map(|(face, file)| format!("{face}={file}"))
                .collect(),
        };
        let log = LogOptions {
            gravity_mps2: Some(self.gravity_mps2),
            raw_unit: Some(self.raw_unit),
            reference: Some(self.reference),
            // The factors say it.
            units: None,
            ..self.log.clone()
        };
        [
            said_if("--faces", !self.faces.is_empty()),
            files,
            said_if("--sequence", self.sequence),
            log.arguments(),
        ]
        .concat()
    }

    /// Number of sources of rows: the files, or the lists of columns of a single file with several.
    pub(super) fn sources(&self) -> usize {
        match self.has_one_file_for_all() {
            true => self.log.columns.len(),
            false => self.files.len(),
        }
    }

    /// The file of a source.
    pub(super) fn file(&self, source: usize) -> &Path {
        let file = if self.has_one_file_for_all() {
            0
        } else {
            source
        };
        &self.files[file]
    }

    /// Whether each list of columns takes other columns or rows of the only file.
    pub(super) fn has_one_file_for_all(&self) -> bool {
        self.files.len() == 1 && self.log.columns.len() > 1
    }

    /// The filters of a source. If one column is to have several values, each value belongs to one source, in their order.
    fn filters(&self, source: usize) -> Vec<RowFilter> {
        let own = |filter: &&RowFilter| {
            let values: Vec<&RowFilter> = self.values(filter).collect();
            values.len() < 2 || values.get(source) == Some(filter)
        };
        self.log.filters.iter().filter(own).cloned().collect()
    }

    /// The filters of the column of `filter`.
    fn values<'a>(&'a self, filter: &'a RowFilter) -> impl Iterator<Item = &'a RowFilter> {
        let all = self.log.filters.iter();
        all.filter(move |other| other.column() == filter.column())
    }

    /// Refuses filters of one column with several values unless each belongs to a source.
    fn check_filters(&self) -> Result<()> {
        for filter in &self.log.filters {
            let values = self.values(filter).count();
            if values > 1 && (values != self.sources() || self.is_sequence()) {
                let problem = format!(
                    "the column {} is to have {values} values, but no row has two",
                    filter.column()
                );
                let remedy = "choose one value, or give a list of columns for the rows of each";
                return Err(Error::new("import", problem, remedy)
                    .about(Argument::Where)
                    .about(Argument::Columns));
            }
        }
        Ok(())
    }

    pub(super) fn how(&self, source: usize) -> HowToRead<'_> {
        HowToRead {
            list: self.log.columns.get(source),
            filters: self.filters(source),
            rows: self.log.rows.filter(|_| source == 0),
            rate_hz: self.log.rate_hz,
            skip_empty: self.has_one_file_for_all(),
            ..HowToRead::of(&self.log)
        }
    }
}

/// A file that was imported, for the manifest.
pub(super) fn source(path: &Path) -> Result<Source> {
    Ok(Source {
        file: file_name(path),
        sha256: digest::sha256(path)?,
    })
}
