//! Opens calibrations: files of mimu, and those of other programs, which state no uncertainty.

use std::path::{Path, PathBuf};

use mimu::calibration::Calibration;
use mimu_export::foreign::{self, Foreign};
use mimu_recording::{Error, RawUnit, Result};

/// A calibration as its file has it.
pub(crate) enum Opened {
    /// A file of mimu.
    Own(Box<Calibration>),
    /// A file of another program.
    Foreign(Box<Foreign>),
}

/// Opens the file at `path`. What no format knows is refused as a file of mimu.
pub(crate) fn open(path: &Path) -> Result<Opened> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, &e))?;
    if bytes.is_empty() {
        let remedy = "copy it again, or make it again";
        return Err(Error::new(path.display(), "the file is empty", remedy));
    }
    let is_own = |line: &str| line.starts_with("format = \"mimu-");
    let own = std::str::from_utf8(&bytes).is_ok_and(|text| text.lines().any(is_own));
    let other = match own {
        true => None,
        false => foreign::read(&bytes, &path.display().to_string())?,
    };
    Ok(match other {
        Some(other) => Opened::Foreign(Box::new(other)),
        None => Opened::Own(Box::new(Calibration::read(path)?)),
    })
}

/// Opens what these files have of one unit: IMU-TK writes one of each triad.
pub(crate) fn open_all(paths: &[PathBuf]) -> Result<Opened> {
    let mut all = paths.iter().map(|path| open(path));
    let none = || Error::new("calibration", "no file is given", "give one");
    let mut opened = all.next().ok_or_else(none)??;
    for (next, path) in all.zip(&paths[1..]) {
        opened = match (opened, next?) {
            (Opened::Foreign(before), Opened::Foreign(next)) => {
                Opened::Foreign(Box::new(before.with_triad_of(*next)?))
            }
            _ => {
                let problem = "this or the file before it is a calibration file of mimu, which has both triads";
                return Err(Error::new(path.display(), problem, "give that file alone"));
            }
        };
    }
    Ok(opened)
}

/// The calibration at `path`, of readings in counts if the file does not say their unit.
pub(crate) fn calibration(path: impl AsRef<Path>) -> Result<Calibration> {
    open(path.as_ref())?.of_readings(RawUnit::Count)
}

impl Opened {
    /// Local gravity where it was made, m/s², if it is known.
    pub fn gravity_mps2(&self) -> Option<f64> {
        match self {
            Self::Own(own) => own.recording.gravity_mps2,
            Self::Foreign(_) => None,
        }
    }

    /// The calibration as its program reads it, of readings in `raw_unit` if the file does not say their unit. A warning says what it lacks.
    pub fn of_readings(self, raw_unit: RawUnit) -> Result<Calibration> {
        let other = match self {
            Self::Own(own) => return Ok(*own),
            Self::Foreign(other) => other,
        };
        let calibration = other.calibration(raw_unit)?;
        let (place, name) = (&other.place, other.format.name);
        eprintln!(
            "{place}: read as {name} reads it; mimu verify shows whether another convention fits a recording of the unit"
        );
        for (sensor, _) in other.parts.present() {
            if !other.has_bias(sensor) {
                eprintln!("warning: {place}: it has no bias of the {sensor}, which is taken for 0");
            }
        }
        if let Some(left_out) = other.left_out() {
            eprintln!("warning: {left_out}");
        }
        Ok(calibration)
    }
}
