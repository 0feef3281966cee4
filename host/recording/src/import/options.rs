//! What is known of a log, and what to import and how.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use super::assignment::{ColumnList, Offset, Scale};
use super::broken::BrokenLimit;
use super::codes::{TwosComplement, Zero};
use super::comment_signs::{CommentSigns, TextFormat};
use super::faces::Face;
use super::foreign::HowToRead;
use super::preset::{Chosen, Preset, PresetUse};
use super::reading_units::ReadingUnits;
use super::readings::Choice;
use super::row_filter::RowFilter;
use super::row_range::RowRange;
use super::time::Decimal;
use crate::digest;
use crate::error::{Argument, Error, Result};
use crate::manifest::{RawUnit, Reference, Source, TRUST_READINGS, check_gravity, check_rate};
use crate::separator::Separator;
use crate::signed_low_byte::SignedLowByte;
use crate::turntable::{Turntable, TurntableRate};
use crate::unit_name::UNNAMED;
use crate::writer::SampleFormat;

/// What a person knows of a log, by hand or from a look at it: the options of every command that takes one, with the words of its help.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct LogOptions {
    /// Columns of a file from the left (`t_s,accel_x,-`; `-` skips one), or by the names in its header (`gyro_x=wx,t_s=time`); one list for
    /// each file, or several for a file with a sensor in other columns or rows (--where)
    ///
    /// Names of columns: t_s, step (numbers or labels), temp_c, gyro_x.., accel_x.., ref_rate_x_dps.., ref_force_x_mps2.., and sample, an
    /// index that gives the time with --rate-hz.
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "LIST", allow_hyphen_values = true)
    )]
    pub columns: Vec<ColumnList>,
    /// Maker or program whose columns, units and signs the files have [default: recognised by the header]
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME", value_parser = presets()))]
    pub preset: Option<Preset>,
    /// Each row is the mean over a pose or a rate, not a sample. Optional columns: standard deviation of a sample (`accel_x_sd`), number of
    /// samples (`averaged`, `accel_x_averaged`), inputs (ref_ columns) and names (`step`)
    #[cfg_attr(feature = "clap", arg(long))]
    pub means: bool,
    /// A pause of more than this number of seconds begins a new dwell, for files without rows between the poses
    #[cfg_attr(
        feature = "clap",
        arg(
            long = "step-gap",
            value_name = "SECONDS",
            allow_negative_numbers = true,
            conflicts_with = "means"
        )
    )]
    pub step_gap_s: Option<f64>,
    /// Import only the rows in which a column has this value, for one of several sensors in a file: `channel=3`; if repeated, a row must
    /// satisfy all, unless they are values of one column: then each belongs to a list of --columns
    #[cfg_attr(
        feature = "clap",
        arg(long = "where", value_name = "COLUMN=VALUE", conflicts_with = "means")
    )]
    pub filters: Vec<RowFilter>,
    /// Import only these data rows, the first and the last included, counted from 1: `..8799` for those before a fault in row 8800, `8800..`
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "FIRST..LAST", conflicts_with = "means")
    )]
    pub rows: Option<RowRange>,
    /// Sample rate, Hz. Files without a time column need it; in others it checks the rate of the stamps, and decides if stamps in bursts
    /// are ambiguous
    #[cfg_attr(feature = "clap", arg(long, allow_negative_numbers = true))]
    pub rate_hz: Option<f64>,
    /// Unit of the time stamps: s, ms, us or ns [default: recognised; required if two are possible]
    #[cfg_attr(feature = "clap", arg(long, value_name = "UNIT"))]
    pub time_unit: Option<Decimal>,
    /// Local gravity, m/s² [default: normal gravity at sea level at --latitude, or 9.80665 with a warning]
    #[cfg_attr(
        feature = "clap",
        arg(
            long = "gravity",
            value_name = "GRAVITY",
            allow_negative_numbers = true
        )
    )]
    pub gravity_mps2: Option<f64>,
    /// Unit of the raw columns, after --scale: V, count or SI (rad/s and m/s²) [default of bags, logs and most presets: SI]
    #[cfg_attr(feature = "clap", arg(long, value_name = "UNIT"))]
    pub raw_unit: Option<RawUnit>,
    /// Units of the readings in the file, which are converted to SI: one of g, mg, m/s2 and one of deg/s, mdeg/s, rad/s; or count, or V
    /// [default: by the names, by gravity at rest and by its turns]
    #[cfg_attr(feature = "clap", arg(long, value_name = "G,DEG/S", conflicts_with_all = ["raw_unit", "means"]))]
    pub units: Option<ReadingUnits>,
    /// Topic of a bag (sensor_msgs/Imu; give two if gyro and accelerometer have one each) or of a PX4 log (sensor_gyro, sensor_combined,
    /// vehicle_imu), or message of an ArduPilot log (IMU, GYR, IMT) [default: the only or the best one]
    #[cfg_attr(feature = "clap", arg(long))]
    pub topic: Vec<String>,
    /// Sensor of a PX4 or ArduPilot log, counted from 0 [default: the only one]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    pub instance: Option<u32>,
    /// What is known of the input: table (ref_ columns or --inputs), gravity (its magnitude at rest), or turntable-rate (the magnitude of
    /// the rate, as on a record player; needs --rate-dps and --rate-error) [default: gravity, unless there are ref_ columns, --inputs or
    /// --rate-dps]
    #[cfg_attr(feature = "clap", arg(long))]
    pub reference: Option<Reference>,
    /// Magnitudes of the turntable's rates, deg/s: 200 for 33 1/3 rpm, 270 for 45 rpm. The readings show which dwell has which rate, unless
    /// it is given by number, label or file name (`edge=270`, `rest=0`)
    #[cfg_attr(
        feature = "clap",
        arg(
            long,
            value_name = "RATE",
            value_delimiter = ',',
            requires = "rate_error",
            allow_negative_numbers = true
        )
    )]
    pub rate_dps: Vec<TurntableRate>,
    /// Error of these rates: half of a 95 % interval, like `0.1%`; no number of dwells reduces it
    #[cfg_attr(feature = "clap", arg(long, value_name = "PERCENT", requires = "rate_dps", value_parser = crate::turntable::rate_error))]
    pub rate_error: Option<f64>,
    /// Factor for a column, or for gyro or accel: `gyro=0.0174533`
    #[cfg_attr(feature = "clap", arg(long, value_name = "COLUMN=FACTOR"))]
    pub scale: Vec<Scale>,
    /// Number added to a column after its factor: `temp_c=36.53`
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "COLUMN=VALUE", allow_hyphen_values = true)
    )]
    pub offset: Vec<Offset>,
    /// Columns whose low byte the firmware read as a signed number: gyro, accel or a column; corrected exactly, before --scale
    ///
    /// `(high << 8) + (int8_t)low` is 256 counts too low if the low byte is 128 or more. The readings have to be whole counts.
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "COLUMN", conflicts_with = "means")
    )]
    pub signed_low_byte: Vec<SignedLowByte>,
    /// Raw columns of unsigned codes in two's complement, with their bits: `accel=12`
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "COLUMN=BITS", conflicts_with = "means")
    )]
    pub twos_complement: Vec<TwosComplement>,
    /// Code of raw columns at zero input, subtracted before --scale: `gyro=2048`
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "COLUMN=CODE", conflicts_with = "means")
    )]
    pub zero: Vec<Zero>,
    /// Name of the unit; recordings and calibrations of units with different names are not used together [default: unnamed]
    #[cfg_attr(feature = "clap", arg(long))]
    pub device: Option<String>,
    /// Latitude, degrees
    #[cfg_attr(
        feature = "clap",
        arg(
            long = "latitude",
            value_name = "LATITUDE",
            allow_negative_numbers = true
        )
    )]
    pub latitude_deg: Option<f64>,
    /// CSV file with the known input of each dwell or turn: step, ref_rate_x_dps.., ref_force_x_mps2.., turn_x_deg..
    ///
    /// One row for each number or label of the column step; leave unknown inputs empty: `step,turn_x_deg,ref_force_x_mps2`, then
    /// `face_up,,9.81` and `about_x,360,`.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub inputs: Option<PathBuf>,
    /// Separator of text files: comma, semicolon, tab, whitespace, or all characters that separate cells: `,;*` [default: recognised]
    #[cfg_attr(feature = "clap", arg(long))]
    pub separator: Option<Separator>,
    /// Characters that begin a comment line in text files, or none [default: #%]
    #[cfg_attr(feature = "clap", arg(long, value_name = "SIGNS"))]
    pub comment: Option<CommentSigns>,
    /// Leave out rows that cannot be read: at most this number (`=20`), or this share of each file (`=2%`) [without a value: 1%]
    #[cfg_attr(feature = "clap", arg(long, value_name = "LIMIT", num_args = 0..=1, require_equals = true, default_missing_value = "1%", conflicts_with = "means"))]
    pub skip_broken: Option<BrokenLimit>,
    /// Use the readings although they look like those of two devices in turn, wrongly coded, or of another range from some row on
    #[cfg_attr(feature = "clap", arg(long, conflicts_with = "means"))]
    pub trust_readings: bool,
}

#[cfg(feature = "clap")]
fn presets() -> impl clap::builder::TypedValueParser<Value = Preset> {
    use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser as _};
    let all = Preset::all().iter();
    let names = all.map(|preset| PossibleValue::new(preset.name).help(preset.title));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Preset>())
}

impl LogOptions {
    /// The options as words of a command line.
    pub fn arguments(&self) -> Vec<String> {
        // Every field by its name: the compiler says which option is missing below.
        let Self {
            columns,
            preset,
            means,
            step_gap_s,
            filters,
            rows,
            rate_hz,
            time_unit,
            gravity_mps2,
            raw_unit,
            units,
            topic,
            instance,
            reference,
            rate_dps,
            rate_error,
            scale,
            offset,
            signed_low_byte,
            twos_complement,
            zero,
            device,
            latitude_deg,
            inputs,
            separator,
            comment,
            skip_broken,
            trust_readings,
        } = self;
        let rates: Vec<String> = rate_dps.iter().map(TurntableRate::to_string).collect();
        // Rounded, so that a share of 0.001 is written as 0.1 % instead of 0.1000000001 %.
        let error = rate_error.map(|share| format!("{}%", (share * 1e8).round() / 1e6));
        [
            said_if("--means", *means),
            said("--preset", preset.map(|preset| preset.name)),
            said("--columns", columns),
            said("--separator", separator),
            said("--comment", comment),
            said("--rate-hz", rate_hz),
            said("--time-unit", time_unit.map(Decimal::symbol)),
            said("--gravity", gravity_mps2),
            said("--raw-unit", raw_unit),
            said("--units", units),
            said("--reference", reference),
            said("--rate-dps", (!rates.is_empty()).then(|| rates.join(","))),
            said("--rate-error", error),
            said("--scale", scale),
            said("--offset", offset),
            said("--twos-complement", twos_complement),
            said("--zero", zero),
            said("--signed-low-byte", signed_low_byte),
            skip_broken
                .iter()
                .map(|limit| format!("--skip-broken={limit}"))
                .collect(),
            said_if(TRUST_READINGS, *trust_readings),
            said("--step-gap", step_gap_s),
            said("--where", filters),
            said("--rows", rows),
            said("--topic", topic),
            said("--instance", instance),
            said("--device", device),
            said("--latitude", latitude_deg),
            said("--inputs", inputs.as_deref().map(file_name)),
        ]
        .concat()
    }

    /// How the lines of text files are to be read.
    pub(super) fn text_format(&self) -> TextFormat {
        TextFormat {
            separator: self.separator,
            comments: self.comment.unwrap_or_default(),
        }
    }

    /// Which sensor of a log is wanted.
    pub(super) fn choice(&self) -> Choice<'_> {
        Choice {
            topics: &self.topic,
            instance: self.instance,
        }
    }

    /// The turntable, if the magnitude of its rate is known.
    pub(super) fn turntable(&self) -> Option<Turntable> {
        self.rate_error
            .map(|error| Turntable::new(&self.rate_dps, error))
    }
}

/// The option `flag` with each of its values.
fn said<T: Display>(flag: &str, values: impl IntoIterator<Item = T>) -> Vec<String> {
    let each = values.into_iter();
    each.flat_map(|value| [flag.to_owned(), value.to_string()])
        .collect()
}

fn said_if(flag: &str, given: bool) -> Vec<String> {
    given.then(|| flag.to_owned()).into_iter().collect()
}

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
        let (files, lists) = (self.files.len(), self.log.columns.len());
        if files == 0 {
            return refuse("no file is given".to_owned(), "name the files to import");
        }
        let one_for_all = self.is_sequence() && lists == 1;
        let of_one_file = files == 1 && !self.is_sequence() && !self.log.means;
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
        if let Some(gap) = self.log.step_gap_s
            && !(gap > 0.0 && gap.is_finite())
        {
            return refuse(
                format!("{gap} s is not a pause"),
                "write the seconds that separate two dwells",
            );
        }
        if self.log.step_gap_s.is_some() && (self.is_sequence() || self.log.means) {
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
        if !self.faces.is_empty() && self.log.inputs.is_some() {
            let problem = "the faces give the inputs, but a table of inputs is given too";
            return refuse(problem.to_owned(), "give one of the two");
        }
        if self.log.means && !self.log.signed_low_byte.is_empty() {
            return refuse(
                "a low byte is corrected in single samples, but these are means".to_owned(),
                "import the samples from which the means were computed",
            );
        }
        if self.log.means && !(self.log.twos_complement.is_empty() && self.log.zero.is_empty()) {
            return refuse(
                "codes are read in single samples, but these are means".to_owned(),
                "import the samples, or give the means as readings",
            );
        }
        if self.log.means && self.log.rows.is_some() {
            return refuse(
                "rows are chosen by their numbers, but this is a table of means".to_owned(),
                "give a table with only these rows",
            );
        }
        if self.log.means && !self.log.filters.is_empty() {
            return refuse(
                "rows are chosen by a column, but this is a table of means".to_owned(),
                "give a table with only these rows",
            );
        }
        self.check_filters()?;
        if let Some(rate) = self.log.rate_hz {
            check_rate(rate, "import, sample_rate_hz")
                .map_err(|e| e.about(Argument::SampleRate))?;
        }
        check_gravity(self.gravity_mps2, "import, gravity")?;
        if self.log.means && self.reference == Reference::TurntableRate {
            let problem = "the rate of a turntable is a reference for samples, but these are means";
            return refuse(problem.to_owned(), "import the samples");
        }
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
            log: &self.log,
            list: self.log.columns.get(source),
            filters: self.filters(source),
            rows: self.log.rows.filter(|_| source == 0),
            part: 0,
            rate_hz: self.log.rate_hz,
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
