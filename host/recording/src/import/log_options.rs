//! What is known of a log: the options of every command that takes one.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use super::assignment::ColumnList;
use super::broken::BrokenLimit;
use super::comment_signs::{CommentSigns, TextFormat};
use super::decimal::Decimal;
use super::instance::Instance;
use super::per_column::{Offset, Scale, TwosComplement, Zero};
use super::preset::Preset;
use super::reading_units::ReadingUnits;
use super::readings::Choice;
use super::row_filter::RowFilter;
use super::row_range::RowRange;
use crate::declared::{RawUnit, Reference};
use crate::manifest::TRUST_READINGS;
use crate::separator::Separator;
use crate::signed_low_byte::SignedLowByte;
use crate::turntable::{Turntable, TurntableRate};

/// What a person knows of a log, by hand or from a look at it: the options of every command that takes one, with the words of its help.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct LogOptions {
    /// Columns of a file from the left (`t_s,accel_x,-`; `-` skips one), or by the names in its header (`gyro_x=wx,t_s=time`); one list for
    /// each file, or several for a file with a sensor in other columns or rows (--where)
    ///
    /// Names of columns: t_s, step (numbers or labels), temp_c, gyro_x.., accel_x.., mag_x.., gyro2_x.., ref_rate_x_dps.., ref_force_x_mps2.., and sample, an
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
    /// Topic of a bag (sensor_msgs/Imu; give two if gyro and accelerometer have one each) or of a PX4 log (sensor_gyro or
    /// sensor_combined), or message of an ArduPilot log (IMU or GYR) [default: the only or the best one]
    #[cfg_attr(feature = "clap", arg(long))]
    pub topic: Vec<String>,
    /// Sensor of a PX4 or ArduPilot log, counted from 0, or all: the first that has a gyro and an accelerometer, and the others as gyro2, accel2 and so
    /// on [default: the only one]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    pub instance: Option<Instance>,
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
    /// Factor for a column, or for gyro, accel, mag, gyro2 and the like: `gyro=0.0174533`
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
    /// Characters that begin a comment line in text files, or none; by default these are # and %
    #[cfg_attr(feature = "clap", arg(long, value_name = "SIGNS"))]
    pub comment: Option<CommentSigns>,
    /// Leave out rows that cannot be read: at most this number (`=20`), or this share of each file (`=2%`) [without a value: 1%]
    #[cfg_attr(feature = "clap", arg(long, value_name = "LIMIT", num_args = 0..=1, require_equals = true, default_missing_value = "1%", conflicts_with = "means"))]
    pub skip_broken: Option<BrokenLimit>,
    /// Use the readings although they look wrongly coded, or of another range from some row on
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

pub(super) fn said_if(flag: &str, given: bool) -> Vec<String> {
    given.then(|| flag.to_owned()).into_iter().collect()
}

/// Name of a file without its folder.
pub(super) fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}
