//! Arguments that several subcommands share.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mimu::data_sheet::Part;
use mimu::signal::dwell::Keep;
use mimu::signal::stillness::{DwellSearch, STILL_FACTOR, Steps};
use mimu::{Judgement, NoiseFile, Prepared, STANDARD_GRAVITY, Sensor, Warning, normal_gravity};
use mimu_recording::{Argument, Error, Reference, Result, WholeTurns};
use mimu_wizard::procedure::Targets;

use crate::overwriting::check_overwritten;
use crate::status::Status;

#[derive(Args)]
pub(crate) struct StillArgs {
    /// For dwells that are found: largest variance of a still window, as a multiple of the quietest
    #[arg(long = "still", value_name = "FACTOR", default_value_t = STILL_FACTOR, value_parser = |t: &str| number(t, 1.0, 1e9))]
    pub(crate) factor: f64,
    /// Where dwells come from: given by the column step, or found by stillness [default: the column if there is one]
    #[arg(long = "steps", value_name = "WHENCE", value_parser = choice(&[
        ("given", "From the column step, without a test for stillness", Steps::Given),
        ("found", "By stillness; the column step is ignored", Steps::Found),
    ]))]
    pub(crate) steps: Option<Steps>,
}

impl StillArgs {
    pub(crate) fn search(&self) -> DwellSearch {
        DwellSearch {
            still_factor: self.factor,
            steps: self.steps.unwrap_or_default(),
        }
    }
}

#[derive(Args)]
pub(crate) struct KeepArgs {
    /// Keep dwells and turns that the others contradict: `all`, or numbers of dwells, like 3,12
    ///
    /// A turn is kept with the dwell that it ends in. Without this option, if gravity is the only reference, a dwell or turn with a much
    /// larger error than the others predict is left out and named.
    #[arg(long = "keep", value_name = "all|N,...", value_parser = keep)]
    keep: Option<Keep>,
}

impl KeepArgs {
    /// `prepared`, with the dwells that must be kept.
    pub(crate) fn apply(&self, mut prepared: Prepared) -> Prepared {
        prepared.dwells.keep = self.keep.clone().unwrap_or_default();
        prepared
    }
}

fn keep(text: &str) -> std::result::Result<Keep, String> {
    if text == "all" {
        return Ok(Keep::Everything);
    }
    let steps: std::result::Result<Vec<i32>, _> =
        text.split(',').map(|n| n.trim().parse()).collect();
    steps
        .map(Keep::Steps)
        .map_err(|_| "write `all`, or the numbers of dwells separated by commas: 3,12".into())
}

/// A number within these limits.
pub(crate) fn number(text: &str, lowest: f64, highest: f64) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(v) if (lowest..=highest).contains(&v) => Ok(v),
        _ => Err(format!("write a number from {lowest:?} to {highest:?}")),
    }
}

/// Two temperatures, °C, the lower first: `-20..60`.
pub(crate) fn range_c(text: &str) -> std::result::Result<[f64; 2], String> {
    let ends = text.split_once("..");
    let ends = ends.and_then(|(from, to)| Some([from.parse().ok()?, to.parse().ok()?]));
    match ends {
        Some([from, to]) if -100.0 <= from && from < to && to <= 300.0 => Ok([from, to]),
        _ => Err("write FROM..TO in degrees Celsius, as in -20..60".into()),
    }
}

#[derive(Args)]
pub(crate) struct WholeTurnArgs {
    /// Turns of the unit that end where they began: several times about any axis, then put back where it lay, at rest before and after
    ///
    /// The gyro's scale factors follow from them better than from turns between poses, also about the vertical. With a number, each has that many turns: the
    /// scale factors then need not be known to a few per cent. recording.toml may say the same: whole_turns = { turns = 10, placement_deg = 1.0 }.
    #[arg(long = "whole-turns", value_name = "N", num_args = 0..=1, require_equals = true)]
    turns: Option<Option<u32>>,
    /// With --whole-turns: how well the unit is put back, degrees, half-width of the 95 % interval of its heading [default: 1]
    #[arg(long, value_name = "DEG", requires = "turns", value_parser = degrees)]
    placement: Option<f64>,
}

/// An angle in degrees, with or without its unit: `1`, `1deg`.
pub(crate) fn degrees(text: &str) -> std::result::Result<f64, String> {
    let number = text.trim_end_matches('°').trim_end_matches("deg");
    number
        .trim()
        .parse()
        .map_err(|_| "write degrees, such as 1deg".into())
}

/// What the two options state of whole turns, if there are any.
pub(crate) fn whole_turns(
    turns: Option<Option<u32>>,
    placement: Option<f64>,
) -> Result<Option<WholeTurns>> {
    let Some(turns) = turns else {
        return Ok(None);
    };
    let default = WholeTurns::default();
    let stated = WholeTurns {
        placement_deg: placement.unwrap_or(default.placement_deg),
        turns,
    };
    stated.check("whole turns")?;
    Ok(Some(stated))
}

impl WholeTurnArgs {
    /// `prepared`, with what is stated of its whole turns.
    pub(crate) fn apply(&self, mut prepared: Prepared) -> Result<Prepared> {
        let Some(stated) = whole_turns(self.turns, self.placement)? else {
            return Ok(prepared);
        };
        if prepared.manifest.reference != Reference::Gravity {
            return Err(Error::new(
                &prepared.place,
                "whole turns are turned by hand, with gravity as the reference",
                "leave --whole-turns out, or give a recording with reference = \"gravity\"",
            ));
        }
        prepared.manifest.whole_turns = Some(stated);
        Ok(prepared)
    }
}

#[derive(Args)]
pub(crate) struct NoiseArgs {
    /// Noise file of the unit at rest (`mimu allan -o`) [default: the noise within the dwells]
    ///
    /// The file also contains the wander of the bias from dwell to dwell, which dwells do not show. For readings in V or counts it has to
    /// come from raw readings of the same unit, with or without a calibration.
    #[arg(long = "noise", value_name = "FILE")]
    pub(crate) file: Option<PathBuf>,
}

impl NoiseArgs {
    /// The noise of the file, if one is given.
    pub(crate) fn read(&self) -> Result<Option<NoiseFile>> {
        self.file.as_deref().map(NoiseFile::read).transpose()
    }
}

/// `prepared`, with `noise` if there is any.
pub(crate) fn with_noise(prepared: Prepared, noise: Option<&NoiseFile>) -> Result<Prepared> {
    match noise {
        Some(noise) => prepared.with_noise(noise),
        None => Ok(prepared),
    }
}

#[derive(Args)]
pub(crate) struct PartArgs {
    /// Compare the unit with the data sheet of its part: a name (icm42688p, mpu6050, lsm6dso, lsm6dsv16x, bmi088, bmi270), or a file NAME.toml
    ///
    /// Sensitivity, zero-rate and zero-g offset, cross-axis sensitivity, nonlinearity and noise density (with --noise), each passed or failed with its
    /// interval taken into account.
    #[arg(long = "part", value_name = "NAME|FILE.toml")]
    name: Option<String>,
}

impl PartArgs {
    /// The part, if one is given.
    pub(crate) fn part(&self) -> Result<Option<Part>> {
        self.name.as_deref().map(Part::find).transpose()
    }
}

#[derive(Args)]
pub(crate) struct VerboseArgs {
    /// Print everything instead of a summary
    #[arg(long)]
    pub(crate) verbose: bool,
}

#[derive(Args)]
pub(crate) struct StrictArgs {
    /// Exit with status 3 unless the judgement is `good`
    #[arg(long)]
    strict: bool,
}

impl StrictArgs {
    /// The status of a command whose result is judged so.
    pub(crate) fn status(&self, judgement: &Judgement) -> Status {
        match self.strict && !judgement.is_good() {
            true => Status::NotGood,
            false => Status::Done,
        }
    }
}

#[derive(Args)]
pub(crate) struct WritingArgs {
    /// Replace a file that mimu did not write
    #[arg(long)]
    replace: bool,
    /// Write the calibration although it is judged a misfit; the file contains the judgement
    #[arg(long)]
    force: bool,
}

impl WritingArgs {
    /// Refuses to overwrite a file `output` that mimu did not write, before the work, but after a test whether it is an input.
    ///
    /// # Errors
    /// As of [`check_overwritten`], unless `--replace` is given.
    pub(crate) fn check(&self, output: Option<&Path>) -> Result<()> {
        check_overwritten(&[output.filter(|_| !self.replace)])
    }

    /// The error about a result of `place` that is judged a misfit and would therefore not be written; `remedy` says what to do.
    pub(crate) fn refusal(
        &self,
        judgement: &Judgement,
        place: &str,
        remedy: &str,
    ) -> Option<Error> {
        let why = judgement.needs_consent().filter(|_| !self.force)?;
        let problem = format!("no calibration is written, because {why}");
        Some(Error::new(place, problem, remedy).about(Argument::Force))
    }
}

#[derive(Args)]
pub(crate) struct JsonArgs {
    /// Write the result as JSON (`-`: to standard output, instead of the text)
    #[arg(long = "json", value_name = "PATH", global = true)]
    pub(crate) path: Option<PathBuf>,
}

impl JsonArgs {
    /// The file to write, unless JSON goes to standard output.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.path.as_deref().filter(|path| *path != Path::new("-"))
    }

    /// Whether JSON is requested.
    pub(crate) fn is_given(&self) -> bool {
        self.path.is_some()
    }

    /// Whether JSON replaces the text on standard output.
    pub(crate) fn is_standard_output(&self) -> bool {
        self.path.is_some() && self.file().is_none()
    }
}

/// Takes one of these words, each with its help and what it chooses: the types that it chooses from belong to crates without a command line.
pub(crate) fn choice<T: Copy + Send + Sync>(
    all: &'static [(&'static str, &'static str, T)],
) -> impl TypedValueParser<Value = T> {
    let value = |(word, help, _): &(&'static str, &'static str, T)| {
        PossibleValue::new(word).help((!help.is_empty()).then_some(*help))
    };
    let words = PossibleValuesParser::new(all.iter().map(value));
    words.map(|word| all.iter().find(|of| of.0 == word).unwrap_or(&all[0]).2)
}

/// A sensor by its name.
pub(crate) fn sensor() -> impl TypedValueParser<Value = Sensor> {
    choice(&[("gyro", "", Sensor::Gyro), ("accel", "", Sensor::Accel)])
}

/// Gravity, m/s², as given or of the latitude, and what is said of it where no height explains it; `None` if neither is given.
pub(crate) fn known_gravity(
    gravity: Option<f64>,
    latitude_deg: Option<f64>,
) -> Option<(f64, Option<String>)> {
    let off = |g| latitude_deg.and_then(|at| Warning::of_gravity(g, at));
    let given = gravity.map(|g| (g, off(g).map(|w| w.to_string())));
    given.or(latitude_deg.map(|at| (normal_gravity(at), None)))
}

/// Gravity where nothing is known of the place, m/s², and what is said of it.
pub(crate) fn assumed_gravity() -> (f64, Option<String>) {
    let said = "gravity is assumed to be 9.80665 m/s². It ranges from 9.78 at the equator to 9.83 at the poles, and every scale factor of the accelerometer errs by the same ratio: give --gravity or --latitude";
    (STANDARD_GRAVITY, Some(said.into()))
}

/// The gravity, after what is said of it was printed.
pub(crate) fn warned((gravity, said): (f64, Option<String>)) -> f64 {
    if let Some(said) = said {
        eprintln!("warning: {said}");
    }
    gravity
}

/// The wizard's targets, with those of `--target NAME=VALUE` in place of the defaults.
///
/// # Errors
/// A text that is none of `NAME=VALUE`, or a value that is not above 0.
pub(crate) fn targets(texts: &[String]) -> Result<Targets> {
    let mut targets = Targets::default();
    for text in texts {
        let wrong = |problem: &str| {
            let remedy = "write one of gyro-bias, gyro-scale, gyro-angle, accel-bias, accel-scale, accel-angle, =, and a number above 0";
            Error::new(format!("--target {text}"), problem, remedy)
        };
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| wrong("the = is missing"))?;
        let value: f64 = value
            .parse()
            .map_err(|_| wrong("the value is not a number"))?;
        if !(value > 0.0) {
            return Err(wrong("it is not above 0"));
        }
        let target = match name {
            "gyro-bias" => &mut targets.gyro_bias_dps,
            "gyro-scale" => &mut targets.gyro_scale_ppm,
            "gyro-angle" => &mut targets.gyro_angle_urad,
            "accel-bias" => &mut targets.accel_bias_mg,
            "accel-scale" => &mut targets.accel_scale_ppm,
            "accel-angle" => &mut targets.accel_angle_urad,
            _ => return Err(wrong("the parameter is unknown")),
        };
        *target = value;
    }
    Ok(targets)
}
