//! What to import and how.

use std::path::{Path, PathBuf};

use super::assignment::{ColumnList, Offset, Scale};
use super::broken::BrokenLimit;
use super::codes::{TwosComplement, Zero};
use super::comment_signs::{CommentSigns, TextFormat};
use super::faces::Face;
use super::foreign::HowToRead;
use super::preset::{Chosen, PresetUse};
use super::readings::Choice;
use super::row_filter::RowFilter;
use super::row_range::RowRange;
use super::time::Decimal;
use crate::digest;
use crate::error::{Argument, Error, Result};
use crate::manifest::{RawUnit, Reference, Source, TRUST_READINGS, check_gravity, check_rate};
use crate::separator::Separator;
use crate::signed_low_byte::SignedLowByte;
use crate::turntable::Turntable;
use crate::unit_name::UNNAMED;
use crate::writer::SampleFormat;

/// What to import and how.
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Files; the later ones are joined onto the times of the first.
    pub files: Vec<PathBuf>,
    /// One list for each file; none if the headers have the names of a recording. A single file may have several, for sensors in separate columns or rows.
    pub columns: Vec<ColumnList>,
    /// Separator of text files; detected if `None`.
    pub separator: Option<Separator>,
    /// Characters that begin the comment lines of text files.
    pub comments: CommentSigns,
    /// Sample rate in Hz. Files without time stamps need it; for others it decides between two possible units of the stamps.
    pub rate_hz: Option<f64>,
    /// Unit of the time stamps; detected if `None`.
    pub time_unit: Option<Decimal>,
    /// Local gravity in m/s².
    pub gravity_mps2: f64,
    /// Unit of the raw columns, after scaling.
    pub raw_unit: RawUnit,
    /// What is known of the true input.
    pub reference: Reference,
    /// Factors for columns; several for the same column multiply.
    pub scales: Vec<Scale>,
    /// What is added to columns after their factors; several for the same column add up.
    pub offsets: Vec<Offset>,
    /// Columns whose low byte a firmware took for a signed number. They are corrected in whole counts, before any factor.
    pub signed_low_bytes: Vec<SignedLowByte>,
    /// Columns of unsigned codes in two's complement.
    pub twos_complements: Vec<TwosComplement>,
    /// Codes at an input of 0, subtracted before any factor; several for the same column add up.
    pub zeros: Vec<Zero>,
    /// Topics of a log: one, or those of gyro and accelerometer. Without them, the only one with messages of an inertial unit, or the only two that
    /// have one sensor each.
    pub topics: Vec<String>,
    /// Which of several sensors of a topic of a log; without it, the only one.
    pub instance: Option<u32>,
    /// Name of the unit; without it, [`UNNAMED`].
    pub device: Option<String>,
    /// Latitude in degrees.
    pub latitude_deg: Option<f64>,
    /// The turntable, if the magnitude of its rate is known.
    pub turntable: Option<Turntable>,
    /// Table of the known input of each step.
    pub inputs: Option<PathBuf>,
    /// Whether the files follow one another, each a step labelled with its file name. Otherwise they are joined on their times.
    pub sequence: bool,
    /// Face of the unit that was up in each file; the files are then a sequence. Otherwise empty.
    pub faces: Vec<Face>,
    /// A longer pause than this, in s, begins a new step; `None` if a column numbers the steps, or they are found later.
    pub step_gap_s: Option<f64>,
    /// Filters of text and Parquet files: a row is read if it satisfies all of them. If one column is to have several values, each value chooses the
    /// rows of one list of columns.
    pub filters: Vec<RowFilter>,
    /// Which data rows of the first file are read, or of each file of a sequence; all if `None`.
    pub rows: Option<RowRange>,
    /// How many rows that cannot be read may be left out.
    pub skip_broken: BrokenLimit,
    /// Whether readings are used although they look like those of two devices, or wrongly coded.
    pub trust_readings: bool,
    /// Whether each row is the mean over a pose or a step instead of a sample.
    pub means: bool,
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
            columns: Vec::new(),
            separator: None,
            comments: CommentSigns::default(),
            rate_hz: None,
            time_unit: None,
            gravity_mps2,
            raw_unit,
            reference,
            scales: Vec::new(),
            offsets: Vec::new(),
            signed_low_bytes: Vec::new(),
            twos_complements: Vec::new(),
            zeros: Vec::new(),
            topics: Vec::new(),
            instance: None,
            device: None,
            latitude_deg: None,
            turntable: None,
            inputs: None,
            sequence: false,
            faces: Vec::new(),
            step_gap_s: None,
            filters: Vec::new(),
            rows: None,
            skip_broken: BrokenLimit::None,
            trust_readings: false,
            means: false,
            preset: None,
            preset_warnings: Vec::new(),
            format: SampleFormat::default(),
            replace: false,
        }
    }

    /// Adds what a preset knows about the files where nothing was given by hand. The unit of the readings stays, because every caller gives it.
    pub fn with_preset(mut self, chosen: Chosen) -> Self {
        self.files = chosen.files;
        if self.columns.is_empty() {
            self.columns = chosen.columns;
        }
        let scales = Scale::beside(&chosen.scales, &self.scales);
        self.scales.extend(scales);
        self.rate_hz = self.rate_hz.or(chosen.rate_hz);
        self.preset = Some(chosen.used);
        self.preset_warnings = chosen.warnings;
        self
    }

    /// Refuses options that contradict each other, or a recording at `out` that contains one of the files.
    pub(super) fn check(&self, out: &Path) -> Result<()> {
        let refuse = |problem: String, remedy: &str| Err(Error::new("import", problem, remedy));
        let (files, lists) = (self.files.len(), self.columns.len());
        if files == 0 {
            return refuse("no file is given".to_owned(), "name the files to import");
        }
        let one_for_all = self.is_sequence() && lists == 1;
        let of_one_file = files == 1 && !self.is_sequence() && !self.means;
        if lists != 0 && lists != files && !one_for_all && !of_one_file {
            return refuse(
                format!("{files} files but {lists} lists of columns are given"),
                "give one list of columns for each file, in their order",
            );
        }
        if !self.faces.is_empty() && self.faces.len() != files {
            return refuse(
                format!("{files} files but {} faces are given", self.faces.len()),
                "give one file for each face",
            );
        }
        if let Some(gap) = self.step_gap_s
            && !(gap > 0.0 && gap.is_finite())
        {
            return refuse(
                format!("{gap} s is not a pause"),
                "write the seconds that separate two dwells",
            );
        }
        if self.step_gap_s.is_some() && (self.is_sequence() || self.means) {
            let problem =
                "dwells are to be separated by pauses, but each file or row is a dwell already";
            return refuse(problem.to_owned(), "leave out one of the two");
        }
        if let Some((_, face)) = (1..)
            .zip(&self.faces)
            .find(|(i, f)| self.faces[*i..].contains(f))
        {
            let problem = format!("the face {face} is given twice");
            return refuse(
                problem,
                "give one file for each face, or name files with --sequence",
            );
        }
        if !self.faces.is_empty() && self.inputs.is_some() {
            let problem = "the faces give the inputs, but a table of inputs is given too";
            return refuse(problem.to_owned(), "give one of the two");
        }
        if self.means && !self.signed_low_bytes.is_empty() {
            return refuse(
                "a low byte is corrected in single samples, but these are means".to_owned(),
                "import the samples from which the means were computed",
            );
        }
        if self.means && !(self.twos_complements.is_empty() && self.zeros.is_empty()) {
            return refuse(
                "codes are read in single samples, but these are means".to_owned(),
                "import the samples, or give the means as readings",
            );
        }
        if self.means && self.rows.is_some() {
            return refuse(
                "rows are chosen by their numbers, but this is a table of means".to_owned(),
                "give a table with only these rows",
            );
        }
        if self.means && !self.filters.is_empty() {
            return refuse(
                "rows are chosen by a column, but this is a table of means".to_owned(),
                "give a table with only these rows",
            );
        }
        self.check_filters()?;
        if let Some(rate) = self.rate_hz {
            check_rate(rate, "import, sample_rate_hz")
                .map_err(|e| e.about(Argument::SampleRate))?;
        }
        check_gravity(self.gravity_mps2, "import, gravity")?;
        if self.means && self.reference == Reference::TurntableRate {
            let problem = "the rate of a turntable is a reference for samples, but these are means";
            return refuse(problem.to_owned(), "import the samples");
        }
        // A source inside the recording that is to be replaced would be deleted with it.
        for file in self.files.iter().chain(&self.inputs) {
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
        self.device.as_deref().unwrap_or(UNNAMED)
    }

    /// Whether the files follow one another.
    pub(super) fn is_sequence(&self) -> bool {
        self.sequence || !self.faces.is_empty()
    }

    /// The options as arguments of `mimu import`, for the manifest. File names come without folders, which are useless on another machine and may be
    /// private.
    pub fn arguments(&self) -> Vec<String> {
        let mut arguments: Vec<String> = self.files.iter().map(|file| file_name(file)).collect();
        if !self.faces.is_empty() {
            for (argument, face) in arguments.iter_mut().zip(&self.faces) {
                *argument = format!("{face}={argument}");
            }
            arguments.insert(0, "--faces".to_owned());
        }
        if self.means {
            arguments.push("--means".to_owned());
        }
        if self.sequence {
            arguments.push("--sequence".to_owned());
        }
        let mut option = |name: &str, value: String| arguments.extend([name.to_owned(), value]);
        if let Some(preset) = &self.preset {
            option("--preset", preset.name.to_owned());
        }
        for list in &self.columns {
            option("--columns", list.to_string());
        }
        if let Some(separator) = self.separator {
            option("--separator", separator.to_string());
        }
        if self.comments != CommentSigns::default() {
            option("--comment", self.comments.to_string());
        }
        if let Some(rate) = self.rate_hz {
            option("--rate-hz", rate.to_string());
        }
        if let Some(unit) = self.time_unit {
            option("--time-unit", unit.symbol().to_owned());
        }
        option("--gravity", self.gravity_mps2.to_string());
        option("--raw-unit", self.raw_unit.to_string());
        option("--reference", self.reference.to_string());
        for (name, value) in self.turntable.iter().flat_map(Turntable::arguments) {
            option(name, value);
        }
        for scale in &self.scales {
            option("--scale", scale.to_string());
        }
        for offset in &self.offsets {
            option("--offset", offset.to_string());
        }
        for codes in &self.twos_complements {
            option("--twos-complement", codes.to_string());
        }
        for zero in &self.zeros {
            option("--zero", zero.to_string());
        }
        for column in &self.signed_low_bytes {
            option("--signed-low-byte", column.to_string());
        }
        if self.skip_broken != BrokenLimit::None {
            arguments.push(format!("--skip-broken={}", self.skip_broken));
        }
        if self.trust_readings {
            arguments.push(TRUST_READINGS.to_owned());
        }
        let mut option = |name: &str, value: String| arguments.extend([name.to_owned(), value]);
        if let Some(gap) = self.step_gap_s {
            option("--step-gap", gap.to_string());
        }
        for filter in &self.filters {
            option("--where", filter.to_string());
        }
        if let Some(rows) = self.rows {
            option("--rows", rows.to_string());
        }
        for topic in &self.topics {
            option("--topic", topic.clone());
        }
        if let Some(instance) = self.instance {
            option("--instance", instance.to_string());
        }
        if let Some(device) = &self.device {
            option("--device", device.clone());
        }
        if let Some(latitude) = self.latitude_deg {
            option("--latitude", latitude.to_string());
        }
        if let Some(inputs) = &self.inputs {
            option("--inputs", file_name(inputs));
        }
        arguments
    }

    /// How the lines of text files are to be read.
    pub(super) fn text_format(&self) -> TextFormat {
        TextFormat {
            separator: self.separator,
            comments: self.comments,
        }
    }

    /// Number of sources of rows: the files, or the lists of columns of a single file with several.
    pub(super) fn sources(&self) -> usize {
        match self.has_one_file_for_all() {
            true => self.columns.len(),
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
        self.files.len() == 1 && self.columns.len() > 1
    }

    /// The filters of a source. If one column is to have several values, each value belongs to one source, in their order.
    fn filters(&self, source: usize) -> Vec<RowFilter> {
        let own = |filter: &&RowFilter| {
            let values: Vec<&RowFilter> = self.values(filter).collect();
            values.len() < 2 || values.get(source) == Some(filter)
        };
        self.filters.iter().filter(own).cloned().collect()
    }

    /// The filters of the column of `filter`.
    fn values<'a>(&'a self, filter: &'a RowFilter) -> impl Iterator<Item = &'a RowFilter> {
        let all = self.filters.iter();
        all.filter(move |other| other.column() == filter.column())
    }

    /// Refuses filters of one column with several values unless each belongs to a source.
    fn check_filters(&self) -> Result<()> {
        for filter in &self.filters {
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
            list: self.columns.get(source),
            format: self.text_format(),
            scales: &self.scales,
            offsets: &self.offsets,
            signed_low_bytes: &self.signed_low_bytes,
            twos_complements: &self.twos_complements,
            zeros: &self.zeros,
            filters: self.filters(source),
            rows: self.rows.filter(|_| source == 0),
            choice: Choice {
                topics: &self.topics,
                instance: self.instance,
            },
            part: 0,
            rate_hz: self.rate_hz,
            time_unit: self.time_unit,
            skip_broken: self.skip_broken,
            trust_readings: self.trust_readings,
            empty_zero_temperatures: false,
            skip_empty: self.has_one_file_for_all(),
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

/// Name of a file without its folder.
pub(super) fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}
