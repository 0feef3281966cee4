//! What each format declares of itself, and the subcommand that this makes.

use clap::error::ErrorKind;
use clap::{ArgMatches, Args, Command, FromArgMatches, Subcommand};
use mimu::calibration::Calibration;
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Shape};
use crate::craft_axes::{CraftAxes, rotated};
use crate::keyed::Keyed;
use crate::layout::{Entry, NoiseKey};
use crate::{Export, FORMATS, Sources, layout};

/// Whether a format stores the noise of a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// It has no place for it.
    No,
    /// If it is given.
    Optional,
    /// It needs it.
    Needed,
    /// It stores nothing else: the program needs calibrated readings.
    Only,
}

/// An entry of the page in a browser.
#[derive(Debug, Clone, Copy)]
pub struct Page {
    /// What a person reads.
    pub label: &'static str,
    /// Name of the file.
    pub file: &'static str,
    /// Options after the name of the format, with spaces between them.
    pub options: &'static str,
}

impl Page {
    /// An entry without options.
    pub const fn of(label: &'static str, file: &'static str) -> Self {
        let options = "";
        Self {
            label,
            file,
            options,
        }
    }
}

/// A format: what it declares, and how its file is made. `--help`, the table in docs/export.md, and the lists of Python and the page follow from it.
pub trait Target {
    /// Its options on the command line.
    type Options: Args + Clone + 'static;
    /// Name in the command.
    const NAME: &str;
    /// The sentence of `--help`.
    const ABOUT: &str;
    /// What is in the file: its row in docs/export.md.
    const CONTENTS: &str;
    /// Who reads it: likewise.
    const READERS: &str;
    /// How it writes the model of a triad: unless it says otherwise C and o, as in the calibration file.
    const CONVENTION: Convention = Convention::to_input(Shape::Whole, Bias::AddedToInput);
    /// The axes of the craft, if the program's numbers are in these.
    const AXES: Option<CraftAxes> = None;
    /// Where the numbers of [`Self::CONVENTION`] are.
    const LAYOUT: &[Entry] = &[];
    /// Beginnings of keys with what its reader leaves out.
    const NOT_READ: &[&str] = &[];
    /// Whether the program takes the readings of the unit, in its own raw unit; otherwise those of a driver, in SI.
    const TAKES_RAW: bool = false;
    /// Where the noise is.
    const NOISE_KEYS: &[NoiseKey] = &[];
    /// Whether its densities are those of the readings that its calibration is for; otherwise those of calibrated ones.
    const NOISE_OF_READINGS: bool = false;
    /// Key of the messages a second.
    const RATE_KEY: Option<&str> = None;
    /// For a file that [`Keyed`] does not read: its numbers; `None` if it is another file. The second argument is its path.
    const UNPACK: Option<Unpack> = None;
    /// For a format that stores a whole calibration: that of a file, likewise.
    const WHOLE: Option<Whole> = None;
    /// Whether it stores noise.
    const NOISE: Noise = Noise::No;
    /// Whether it can be written from biases over temperature alone.
    const TAKES_BIASES: bool = false;
    /// Whether it has a place for triads beyond the first gyro and accelerometer.
    const FURTHER_TRIADS: bool = false;
    /// Its entries of the page.
    const PAGES: &[Page] = &[];

    /// The file.
    ///
    /// # Errors
    /// A source is missing, or the format cannot store the calibration or the noise.
    fn export(from: &Sources, options: &Self::Options) -> Result<Export>;
}

/// For formats without options.
#[derive(Debug, Clone, Args)]
pub struct Nothing {}

/// Reads the numbers of a file with these bytes and this path; `None` if it is another file.
pub type Unpack = fn(&[u8], &str) -> Option<Keyed>;

/// Reads the calibration of a file with these bytes and this path; `None` if it is another file.
pub type Whole = fn(&[u8], &str) -> Option<Result<Calibration>>;

type Make = dyn Fn(&Sources) -> Result<Export>;

/// A [`Target`] among the others.
pub struct Format {
    /// Name in the command.
    pub name: &'static str,
    /// Whether it stores noise.
    pub noise: Noise,
    /// Whether it can be written from biases over temperature alone.
    pub takes_biases: bool,
    /// What is in the file, and who reads it.
    pub row: [&'static str; 2],
    /// Its entries of the page.
    pub pages: &'static [Page],
    pub(crate) convention: Convention,
    axes: Option<CraftAxes>,
    pub(crate) layout: &'static [Entry],
    pub(crate) not_read: &'static [&'static str],
    pub(crate) takes_raw: bool,
    pub(crate) noise_keys: &'static [NoiseKey],
    pub(crate) noise_of_readings: bool,
    pub(crate) rate_key: Option<&'static str>,
    pub(crate) unpack: Option<Unpack>,
    pub(crate) whole: Option<Whole>,
    about: &'static str,
    augment: fn(Command) -> Command,
    parse: fn(&ArgMatches) -> std::result::Result<Box<Make>, clap::Error>,
}

impl Format {
    pub(crate) const fn of<T: Target>() -> Self {
        Self {
            name: T::NAME,
            noise: T::NOISE,
            takes_biases: T::TAKES_BIASES,
            row: [T::CONTENTS, T::READERS],
            pages: T::PAGES,
            convention: T::CONVENTION,
            axes: T::AXES,
            layout: T::LAYOUT,
            not_read: T::NOT_READ,
            takes_raw: T::TAKES_RAW,
            noise_keys: T::NOISE_KEYS,
            noise_of_readings: T::NOISE_OF_READINGS,
            rate_key: T::RATE_KEY,
            unpack: T::UNPACK,
            whole: T::WHOLE,
            about: T::ABOUT,
            augment: T::Options::augment_args,
            parse: |matches| {
                let options = T::Options::from_arg_matches(matches)?;
                Ok(Box::new(move |from: &Sources| T::export(from, &options)))
            },
        }
    }

    /// The frame of a calibration that was read from a file of it.
    pub(crate) fn frame(&self) -> String {
        format!("that of {}", self.name)
    }

    /// How many of its keys `file` has.
    pub(crate) fn count(&self, file: &Keyed) -> usize {
        let entries = self.layout.iter().map(|entry| entry.key);
        let keys = entries.chain(self.noise_keys.iter().map(|key| key.key));
        keys.filter(|key| layout::is_there(key, file)).count()
    }

    /// This format with the options `arguments`.
    ///
    /// # Errors
    /// The arguments are not options of the format.
    pub fn chosen(&'static self, arguments: &[String]) -> std::result::Result<Choice, clap::Error> {
        let command = (self.augment)(Command::new(self.name).no_binary_name(true));
        let matches = command.try_get_matches_from(arguments)?;
        let make = (self.parse)(&matches)?;
        Ok(Choice { format: self, make })
    }
}

/// A format that was chosen, with its options.
pub struct Choice {
    /// The format.
    pub format: &'static Format,
    make: Box<Make>,
}

impl Choice {
    /// The file of this format.
    ///
    /// # Errors
    /// Those of [`Target::export`], or noise and calibration belong to different readings.
    pub fn export(&self, from: &Sources) -> Result<Export> {
        from.check_same_readings()?;
        let Some((calibration, place)) = from.calibration else {
            return (self.make)(from);
        };
        let table = calibration.accel.as_ref().or(calibration.gyro.as_ref());
        let is_source = |f: &&Format| table.is_some_and(|table| table.frame == f.frame());
        let source = FORMATS.iter().find(is_source);
        let axes = source.and_then(|source| source.axes).zip(self.format.axes);
        let (Some(source), Some((before, after))) = (source, axes.filter(|(a, b)| a != b)) else {
            return (self.make)(from);
        };
        let frame = format!("{}, rotated to {}", source.frame(), after.text());
        let calibration = rotated(calibration, &frame, place)?;
        let calibration = Some((&calibration, place));
        let mut export = (self.make)(&Sources {
            calibration,
            ..*from
        })?;
        let (from, to) = (source.name, self.format.name);
        export.note(format!(
            "Rotated by half a turn about x, so y and z change their signs: {from} has {}, and {to} {}.",
            before.text(),
            after.text()
        ));
        Ok(export)
    }
}

impl FromArgMatches for Choice {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let chosen = matches.subcommand();
        let chosen = chosen.and_then(|(n, of)| Some((FORMATS.iter().find(|f| f.name == n)?, of)));
        let (format, of) = chosen.ok_or_else(|| clap::Error::new(ErrorKind::MissingSubcommand))?;
        let make = (format.parse)(of)?;
        Ok(Self { format, make })
    }

    fn update_from_arg_matches(
        &mut self,
        matches: &ArgMatches,
    ) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Subcommand for Choice {
    fn augment_subcommands(command: Command) -> Command {
        let of = |f: &Format| {
            let command = (f.augment)(Command::new(f.name));
            command.about(f.about).long_about(None)
        };
        command.subcommands(FORMATS.iter().map(of))
    }

    fn augment_subcommands_for_update(command: Command) -> Command {
        Self::augment_subcommands(command)
    }

    fn has_subcommand(name: &str) -> bool {
        FORMATS.iter().any(|format| format.name == name)
    }
}
