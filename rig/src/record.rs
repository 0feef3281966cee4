//! Recordings: a plan carried out with a unit of known truth, sample by sample in memory or as a folder on disk.

mod folder;
mod storage;

use std::path::{Path, PathBuf};

use crate::body::Further;
use crate::converter::{Converter, Readings};
use crate::field::FieldTruth;
use crate::flaws::{Flaws, Lost};
use crate::hands::Hands;
use crate::motion::{Carrier, Instant};
use crate::plan::{CarriedBy, Plan, Samples};
use crate::rig_file::RigTruth;
use crate::rotation::Vector;
use crate::table::Table;
use crate::unit::Unit;

/// One sample: the truth, and the device's readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Motion, step, and the table's reported values.
    pub instant: Instant,
    /// Time stamp, s.
    pub stamp_s: f64,
    /// Raw readings.
    pub readings: Readings,
    /// Raw readings of the further triads; NaN: empty cells.
    pub further: Vec<Vector>,
}

/// A plan being carried out: an iterator over its samples.
pub struct Run<'a> {
    plan: &'a Plan,
    carrier: Box<dyn Carrier>,
    unit: Unit,
    converter: Converter,
    further: Vec<Further>,
    field: FieldTruth,
    flaws: Flaws,
    lost: Lost,
    next: usize,
    /// Number of samples to take.
    count: usize,
    /// Number of samples still to be recorded.
    left: usize,
}

/// Carries out a plan in memory. The same plan, truth and seed give the same samples, bit by bit.
///
/// Errors: the plan exceeds the table's abilities, it takes too long, or the truth describes an impossible table or person.
pub fn samples<'a>(plan: &'a Plan, truth: &RigTruth, seed: u64) -> Result<Run<'a>, String> {
    let mut at = plan.clone();
    if !truth.earth_rate {
        at.place.rotation = 0.0;
    }
    let carrier = || -> Result<Box<dyn Carrier>, String> {
        Ok(match plan.carrier {
            CarriedBy::Table => Box::new(Table::new(&at, &truth.table)?),
            CarriedBy::Hands => {
                Box::new(Hands::new(&at, &truth.hands, seed)?.with_flaws(&truth.flaws, seed))
            }
        })
    };
    // The same motion again for each further triad, which gets it at other times.
    let period_s = 1.0 / plan.sample_rate_hz;
    let further = truth.further.iter();
    let further = further
        .map(|of| Ok(Further::new(of, carrier()?, period_s, seed)))
        .collect::<Result<_, String>>()?;
    let carrier = carrier()?;
    plan.check_length(carrier.duration_s())?;
    let dwells = plan.dwells();
    // All samples before the end. The ends of dwells are sums: a sample that is late by a rounding error still counts.
    let count = (carrier.duration_s() * plan.sample_rate_hz - 1e-6).ceil() as usize;
    let lost = Lost::new(&truth.flaws, period_s, seed);
    Ok(Run {
        plan,
        count,
        left: lost.recorded(count),
        lost,
        carrier,
        unit: Unit::new(&truth.unit, seed, period_s),
        converter: Converter::new(&truth.converter, &truth.unit, seed),
        further,
        field: truth.field.clone(),
        flaws: Flaws::new(&truth.flaws, dwells, period_s, seed),
        next: 0,
    })
}

impl Iterator for Run<'_> {
    type Item = Row;

    fn next(&mut self) -> Option<Row> {
        while self.next < self.count {
            let lacks = self.lost.lacks(self.next);
            let row = self.sample();
            if !lacks {
                self.left -= 1;
                return Some(row);
            }
        }
        None
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.left, Some(self.left))
    }
}

impl Run<'_> {
    /// Takes the next sample, whether it is recorded or lost.
    fn sample(&mut self) -> Row {
        // Multiplication instead of accumulation, because a millisecond has no exact binary value.
        let t_s = self.next as f64 / self.plan.sample_rate_hz;
        let stamp_s = self.flaws.stamp(self.next, t_s);
        self.next += 1;
        let mut instant = self.carrier.at(t_s);
        self.flaws.sway(&mut instant);
        let sensed = self.flaws.sensed(&instant);
        let pins = self.unit.step(&sensed, self.plan.chamber_c(t_s));
        let mut readings = self.converter.read(&pins);
        readings.temp_c = self.flaws.thermometer(t_s, readings.temp_c);
        let further = self.further.iter_mut();
        let at = (t_s, self.unit.board_c());
        let further = further.map(|triad| triad.read(at, &self.flaws, &self.field));
        Row {
            instant,
            stamp_s,
            readings,
            further: further.collect(),
        }
    }
}

impl ExactSizeIterator for Run<'_> {}

/// Destination of a recording.
#[derive(Debug, Clone)]
pub struct Output {
    /// Folder of the recording.
    pub folder: PathBuf,
    /// File of the truth. Only the judge of a test reads it, so it is outside the folder of the recording.
    pub truth: PathBuf,
    /// Storage format of the samples.
    pub samples: Samples,
    /// Whether an existing recording and truth may be replaced.
    pub replace: bool,
}

impl Output {
    /// Into `folder`, with the truth beside it (`folder.truth.toml`), in the plan's storage format; nothing is replaced.
    pub fn new(folder: &Path, plan: &Plan) -> Result<Self, String> {
        let Some(name) = folder.file_name() else {
            return Err(format!(
                "{}: has no name; give the folder to be made",
                folder.display()
            ));
        };
        let mut truth = name.to_owned();
        truth.push(".truth.toml");
        Ok(Self {
            // Without a slash or a dot after the name, because such a path cannot be the target of a rename.
            folder: folder.with_file_name(name),
            truth: folder.with_file_name(truth),
            samples: plan.samples,
            replace: false,
        })
    }
}

/// Carries out a plan and writes the recording, whole or not at all, and the truth beside it. Returns the
/// number of samples.
pub fn write(plan: &Plan, truth: &RigTruth, seed: u64, output: &Output) -> Result<usize, String> {
    folder::check(output)?;
    let run = samples(plan, truth, seed)?;
    let count = run.len();
    folder::write(plan, truth, seed, run, output)?;
    Ok(count)
}
