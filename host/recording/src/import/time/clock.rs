//! The times of the rows of a file, from its stamps.

use std::path::Path;

use serde::Serialize;

use super::super::decimal::Decimal;
use super::counting::Counting;
use super::gap::Jitter;
use super::polled::Rounds;
use super::regular::{Irregular, Regular, numbers};
use super::stamp::{Seen, Stamp, Unit};
use super::stamps::Stamps;
use crate::error::{Argument, Error, Result};

/// Stamps beyond this many seconds are counted from the first whole second. Otherwise a double loses digits of the intervals between samples.
const FAR_S: f64 = 1e8;

/// Results about the stamps of a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TimeSummary {
    /// File, without its folder.
    pub file: String,
    /// Unit of the stamps; `None` if the given factor is another one, or if they count samples.
    pub unit: Option<Decimal>,
    /// Whether the stamps count samples; the given rate then makes times of them.
    pub counter: bool,
    /// Whether the unit was recognised instead of given.
    pub recognised: bool,
    /// Instant that was subtracted, in whole seconds.
    pub origin_s: i64,
    /// Rate of the straight line through count and stamp, Hz.
    pub rate_hz: f64,
    /// Whether the stamps are kept; otherwise the sample count gives the time.
    pub stamps_kept: bool,
    /// Deviations of the stamps from that time.
    pub jitter: Jitter,
    /// Places where samples are missing.
    pub gaps: u64,
    /// Samples missing in all gaps.
    pub missing: u64,
    /// Time without samples of the longest gap, s.
    pub longest_gap_s: f64,
    /// Time from the first row to the last, s.
    pub lasts_s: f64,
    /// How often the stamps wrapped to 0 and were unwrapped.
    pub wraps: u64,
    /// Rate within bursts of stamps, Hz: the sensor's rate if it pauses between bursts.
    pub rate_in_bursts_hz: Option<f64>,
    /// Rows left out because they repeat the row before, its stamp included.
    pub repeated_rows: u64,
    /// Rounds of a loop that read the unit at irregular times, if one did; the readings are then interpolated to the usual round.
    pub polled: Option<Rounds>,
}

/// The times of a file's rows.
#[derive(Debug, Clone)]
pub(in super::super) struct Times {
    unit: Unit,
    origin_s: i64,
    regular: Regular,
    /// Whether rows that repeat the one before are left out.
    pub drops_repeats: bool,
    pub summary: TimeSummary,
}

/// What is known about the times of a file apart from its stamps.
#[derive(Debug, Clone, Copy, Default)]
pub(in super::super) struct Known<'a> {
    /// Seconds per unit of the stamps.
    pub factor: Option<f64>,
    /// Whether the stamps count samples, as given.
    pub counter: bool,
    /// Unit in which a log counts, whose reader converted the stamps; it is only reported.
    pub native: Option<Decimal>,
    /// Given rate, Hz.
    pub rate_hz: Option<f64>,
    /// Name of the column in the file.
    pub name: Option<&'a str>,
    /// The times of the file to which it is joined.
    pub joined_to: Option<&'a Times>,
}

impl Times {
    /// The times of the rows of `path`.
    pub fn of(path: &Path, mut stamps: Stamps, known: &Known<'_>) -> Result<Times> {
        // A logger that is faster than its sensor writes rows twice. Bursts of a sensor at rest may look the same, but also contain equal stamps with
        // different readings.
        let drops_repeats = stamps.shared == 0 && !stamps.repeats.is_empty();
        if drops_repeats {
            let (mut row, mut repeats) = (0, stamps.repeats.iter().peekable());
            stamps.since_first.retain(|_| {
                row += 1;
                repeats.next_if_eq(&&(row - 1)).is_none()
            });
        }
        let problem = |irregular| refused(path, irregular);
        // Late hand-overs set few stamps back.
        if 4 * moves(&stamps, |step| step < 0.0) > stamps.since_first.len() {
            return Err(not_rising(path, &stamps, known));
        }
        let interval = Regular::interval(&stamps.since_first)
            .ok_or_else(|| not_rising(path, &stamps, known))?;
        let seen = Seen {
            first: stamps.first.value,
            interval,
            lasts: stamps.since_first.last().copied().unwrap_or_default(),
            rate_hz: known.rate_hz,
            name: known.name,
        };
        let unit = unit(path, &stamps, &seen, known)?;
        let counter = matches!(unit, Unit::Samples(_));
        let far = || {
            let first = unit.seconds(stamps.first.value);
            if first.abs() < FAR_S { 0 } else { first as i64 }
        };
        let origin_s = known.joined_to.map_or_else(far, |first| first.origin_s);
        let first_s = unit.seconds(stamps.first.since(unit.whole(origin_s)));
        for since in &mut stamps.since_first {
            *since = unit.seconds(*since);
        }
        let mut regular = match counter {
            true => Regular::of_counter(&stamps.since_first),
            false => Regular::find(&stamps.since_first, known.rate_hz),
        }
        .map_err(problem)?;
        let lasts_s = stamps.since_first.last().copied().unwrap_or_default();
        let longest_gap_s = regular.longest_gap_s(&stamps.since_first);
        regular.start_s += first_s;
        let summary = TimeSummary {
            file: path
                .file_name()
                .unwrap_or(path.as_os_str())
                .to_string_lossy()
                .into_owned(),
            unit: known.native.or(match unit {
                Unit::Decimal(unit) => Some(unit),
                Unit::Other(_) | Unit::Samples(_) => None,
            }),
            counter,
            recognised: known.factor.is_none() && !known.counter,
            origin_s,
            rate_hz: tidy(1.0 / regular.period_s),
            stamps_kept: regular.kept,
            jitter: regular.jitter,
            gaps: regular.gaps.len() as u64,
            missing: regular.missing(),
            longest_gap_s,
            lasts_s,
            wraps: stamps.wraps,
            rate_in_bursts_hz: regular.in_bursts_s.map(|period| tidy(1.0 / period)),
            repeated_rows: if drops_repeats {
                stamps.repeats.len() as u64
            } else {
                0
            },
            polled: regular.polled,
        };
        Ok(Times {
            unit,
            origin_s,
            regular,
            drops_repeats,
            summary,
        })
    }

    /// Whether stamps, read in this file's unit, overlap its times.
    fn overlaps(&self, seen: &Seen<'_>) -> bool {
        let begins = self.unit.seconds(seen.first) - self.origin_s as f64;
        let ends = begins + self.unit.seconds(seen.lasts);
        let start = self.regular.start_s;
        begins < start + self.summary.lasts_s && ends > start
    }

    /// Times of the rows with these stamps, s.
    pub fn of_rows(&self, stamps: &[Stamp]) -> Vec<f64> {
        let (regular, origin) = (&self.regular, self.unit.whole(self.origin_s));
        if regular.kept {
            let time = |stamp: &Stamp| self.unit.seconds(stamp.since(origin));
            return stamps.iter().map(time).collect();
        }
        let numbers = numbers(stamps.len(), &regular.gaps).into_iter();
        numbers
            .map(|number| regular.start_s + number as f64 * regular.period_s)
            .collect()
    }

    /// Time between samples, s.
    pub fn period_s(&self) -> f64 {
        self.regular.period_s
    }
}

/// Place of an error about the stamps.
fn time_column(path: &Path) -> String {
    format!("{}, column t_s", path.display())
}

/// A rate without its last digits, which are rounding of the time stamps.
fn tidy(rate_hz: f64) -> f64 {
    format!("{rate_hz:.7e}").parse().unwrap_or(rate_hz)
}

/// The unit of `stamps`, which `seen` describes: given, that of the file to which they are joined, or recognised.
fn unit(path: &Path, stamps: &Stamps, seen: &Seen<'_>, known: &Known<'_>) -> Result<Unit> {
    let counter = |rate_hz: Option<f64>, problem: String, remedy: &str| {
        let place = time_column(path);
        rate_hz
            .map(Unit::Samples)
            .ok_or_else(|| Error::new(place, problem, remedy).about(Argument::SampleRate))
    };
    if known.counter {
        return counter(known.rate_hz, "it counts samples".into(), "give their rate");
    }
    match (known.factor, known.joined_to) {
        (Some(factor), _) => return Ok(Unit::of_factor(factor)),
        // One clock makes the stamps of both.
        (None, Some(first)) if first.overlaps(seen) => return Ok(first.unit),
        (None, _) => {}
    }
    match Counting::of(stamps, seen) {
        Counting::Samples => {
            let name = seen
                .name
                .map_or("it".to_owned(), |name| format!("{name:?}"));
            let problem = format!(
                "{name} contains whole numbers that mostly rise by 1: they count samples, and give no time"
            );
            counter(known.rate_hz, problem, "give the rate of the samples")
        }
        Counting::Either => Err(count_or_clock(path, stamps, seen)),
        Counting::Clock => Ok(Unit::Decimal(
            Unit::recognise(seen).map_err(|both| either(path, seen, both))?,
        )),
    }
}

/// Refusal of whole numbers that are a plausible clock and a plausible counter with losses.
fn count_or_clock(path: &Path, stamps: &Stamps, seen: &Seen<'_>) -> Error {
    let rows = stamps.since_first.len() as f64;
    let missing = 100.0 * (1.0 - rows / (seen.lasts + 1.0));
    let unit = Unit::recognise(seen).unwrap_or_else(|[_, coarse]| coarse);
    let rate = three_digits(unit.per_second() as f64 / seen.interval);
    Error::new(
        time_column(path),
        format!(
            "it contains whole numbers whose smallest step is 1, without a period: a counter of samples of which {missing:.0} % are missing, or times in {unit} ({rate} Hz)"
        ),
        format!(
            "if they count samples, import the column as sample and give the rate; if they are times, give the unit: {}",
            unit.symbol()
        ),
    )
    .about(Argument::Columns)
    .about(Argument::SampleRate)
    .about(Argument::TimeUnit)
}

/// Number of steps between stamps that are as `wanted`.
fn moves(stamps: &Stamps, wanted: impl Fn(f64) -> bool) -> usize {
    let pairs = stamps.since_first.windows(2);
    pairs.filter(|pair| wanted(pair[1] - pair[0])).count()
}

/// Refusal of stamps that do not rise.
fn not_rising(path: &Path, stamps: &Stamps, known: &Known<'_>) -> Error {
    let rows = stamps.since_first.len() + stamps.repeats.len();
    if rows < 2 {
        return refused(path, Irregular::Short);
    }
    let (place, value) = (time_column(path), stamps.first.value);
    let since = &stamps.since_first;
    let [falling, rising] = [moves(stamps, |s| s < 0.0), moves(stamps, |s| s > 0.0)];
    if 4 * falling > 3 * since.len() {
        let last = value + since.last().copied().unwrap_or_default();
        let problem = format!("the time falls from {value} to {last}: the last row comes first");
        return Error::new(place, problem, "sort the rows by time");
    }
    if falling + rising > 0 {
        let mean = value + since.iter().sum::<f64>() / since.len() as f64;
        let problem = format!(
            "the time rises in {rising} rows and falls in {falling}, about {}: these are intervals from row to row instead of times",
            three_digits(mean)
        );
        let remedy = "skip the column and give the rate, or name another column as the time";
        return Error::new(place, problem, remedy)
            .about(Argument::Columns)
            .about(Argument::SampleRate);
    }
    if known.native.is_some() {
        let problem = format!("all {rows} messages have the same time");
        return Error::new(place, problem, "record again, with a clock that runs");
    }
    let problem = format!("the time is {value} in all {rows} rows");
    let remedy = "skip the column and give the rate, or name another column as the time";
    Error::new(place, problem, remedy)
        .about(Argument::Columns)
        .about(Argument::SampleRate)
}

fn refused(path: &Path, irregular: Irregular) -> Error {
    match irregular {
        Irregular::Short => Error::new(
            path.display(),
            "the times of fewer than two rows do not give the rate",
            "give the rate, and skip the time column",
        )
        .about(Argument::SampleRate),
        Irregular::SetBack(row) => Error::new(
            format!("{}, data row {}, column t_s", path.display(), row + 1),
            "the time goes back and stays back",
            "import the rows before that row, and those from it on, as separate recordings; or sort the rows by time",
        ),
        Irregular::OffTheCount(off_s) => Error::new(
            time_column(path),
            format!(
                "the times are up to {off_s:.3} s off the sample count, which late hand-overs do not explain, and their intervals are not multiples of one period"
            ),
            "remove repeated rows and wrong stamps; if no sample is missing, skip the time column and give the rate",
        )
        .about(Argument::SampleRate),
    }
}

/// Refusal of stamps that may be in one of two units, the finer one first.
fn either(path: &Path, seen: &Seen<'_>, both: [Decimal; 2]) -> Error {
    let reading = |unit: Decimal| {
        let per_second = unit.per_second() as f64;
        format!(
            "{unit} ({} Hz for {} s)",
            three_digits(per_second / seen.interval),
            three_digits(seen.lasts / per_second)
        )
    };
    let [fine, coarse] = both;
    let refused = |problem: String, remedy: String| {
        Error::new(time_column(path), problem, remedy).about(Argument::TimeUnit)
    };
    let problem = format!(
        "the times may be in {} or in {}",
        reading(coarse),
        reading(fine)
    );
    let remedy = format!("give the unit: {} or {}", coarse.symbol(), fine.symbol());
    match (seen.interval, coarse) {
        // A counter too rises by 1.
        (0.9..1.5, Decimal::Second) => refused(
            format!("{problem}, or count samples"),
            format!("{remedy}; if they count samples, give the rate"),
        )
        .about(Argument::SampleRate),
        _ => refused(problem, remedy),
    }
}

/// A number with three significant digits.
fn three_digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    rounded.to_string()
}
