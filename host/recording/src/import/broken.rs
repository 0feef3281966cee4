//! Rows that cannot be read: of which kinds, how many, and whether they may be left out.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use crate::cell::{Refusal, shorten};
use crate::error::{Argument, Error, Result};

/// Row numbers that are kept of each kind.
const LISTED: usize = 5;
/// After this many broken rows, reading stops if they are the majority: the file has another format than given.
const ENOUGH: u64 = 10_000;
/// Above this share the remaining rows are not a usable recording.
const LARGEST_SHARE: f64 = 0.5;

/// How many broken rows may be left out.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum BrokenLimit {
    /// None: the first one refuses the file.
    #[default]
    None,
    /// This share of the rows of a file.
    Share(f64),
    /// This many rows of a file, and at most half of it.
    Rows(u64),
}

impl BrokenLimit {
    fn allows(self, broken: u64, of: u64) -> bool {
        let share = broken as f64 / of.max(1) as f64;
        match self {
            Self::None => broken == 0,
            Self::Share(most) => share <= most,
            Self::Rows(most) => broken <= most && share <= LARGEST_SHARE,
        }
    }
}

impl FromStr for BrokenLimit {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let share = text.strip_suffix('%').map(|number| number.trim().parse());
        match (share, text.parse()) {
            (Some(Ok(percent)), _) if (0.0..=100.0 * LARGEST_SHARE).contains(&percent) => {
                Ok(Self::Share(percent / 100.0))
            }
            (None, Ok(rows)) => Ok(Self::Rows(rows)),
            _ => Err(Error::new(
                "broken rows",
                format!("{} is not a limit", shorten(text.as_bytes())),
                "give a number of rows (20), or a share of at most 50%",
            )),
        }
    }
}

impl fmt::Display for BrokenLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("0"),
            Self::Share(share) => write!(f, "{}%", 100.0 * share),
            Self::Rows(rows) => write!(f, "{rows}"),
        }
    }
}

/// The rows of a file that could not be read and were left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BrokenRows {
    /// File, without its folder.
    pub file: String,
    /// How many.
    pub rows: u64,
    /// Rows of the file, these included.
    pub of: u64,
    /// What is wrong with them.
    pub kinds: Vec<BrokenKind>,
}

/// Broken rows with the same problem.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BrokenKind {
    /// Their problem, as in "3 with no time".
    pub problem: &'static str,
    /// How many.
    pub rows: u64,
    /// Numbers of the first of these rows in the file.
    pub first_rows: Vec<u64>,
    /// The first row's error in full.
    pub example: String,
}

impl fmt::Display for BrokenRows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kinds: Vec<String> = self.kinds.iter().map(BrokenKind::to_string).collect();
        write!(
            f,
            "{} of {} rows are broken: {}",
            self.rows,
            self.of,
            kinds.join("; ")
        )
    }
}

impl fmt::Display for BrokenKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows: Vec<String> = self.first_rows.iter().map(u64::to_string).collect();
        let more = if self.rows > self.first_rows.len() as u64 {
            ", …"
        } else {
            ""
        };
        let noun = if self.rows == 1 { "row" } else { "rows" };
        let rows = rows.join(", ");
        write!(
            f,
            "{} with {} ({noun} {rows}{more})",
            self.rows, self.problem
        )
    }
}

/// Why a row cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    Width,
    /// The last row lacks its end: the card was pulled out, or the supply failed. It is left out without being asked.
    Truncated,
    Reading,
    Checksum,
    Time,
    Step,
}

impl Fault {
    fn words(self) -> &'static str {
        match self {
            Fault::Width => "another number of cells",
            Fault::Truncated => "a cut end",
            Fault::Reading => "a cell that is not a reading",
            Fault::Checksum => "a wrong checksum",
            Fault::Time => "no time",
            Fault::Step => "an invalid number in step",
        }
    }
}

/// What keeps a row from being read: its own fault, or one of the file.
#[derive(Debug)]
pub(crate) enum Unreadable {
    Row(BrokenRow),
    File(Error),
}

/// A row that cannot be read.
#[derive(Debug)]
pub(crate) struct BrokenRow {
    pub number: u64,
    fault: Fault,
    error: Error,
}

impl Unreadable {
    /// Row `number` at `place`.
    pub fn row(number: u64, fault: Fault, place: impl fmt::Display, refusal: Refusal) -> Self {
        let error = Error::new(place, refusal.problem, refusal.remedy);
        Self::Row(BrokenRow {
            number,
            fault,
            error,
        })
    }

    /// As an error that ends the reading. This is not a `From`, which would make `?` ambiguous in every dependent crate.
    pub fn into_error(self) -> Error {
        match self {
            Self::Row(row) => row.error,
            Self::File(error) => error,
        }
    }
}

impl From<Error> for Unreadable {
    fn from(error: Error) -> Self {
        Self::File(error)
    }
}

/// Counts the broken rows of a file while it is read.
#[derive(Debug, Default)]
pub(super) struct BrokenTally {
    limit: BrokenLimit,
    /// Rows so far, including the broken ones.
    pub rows: u64,
    broken: u64,
    first: Option<Error>,
    kinds: Vec<(Fault, BrokenKind)>,
}

impl BrokenTally {
    pub fn new(limit: BrokenLimit) -> Self {
        Self {
            limit,
            ..Self::default()
        }
    }

    /// Counts a broken row. If there are many and they are the majority, the file is refused without reading on.
    pub fn add(&mut self, row: BrokenRow) -> Result<()> {
        self.broken += 1;
        let refused = row.error.refused();
        let known = self.kinds.iter_mut().find(|(fault, _)| *fault == row.fault);
        match known {
            Some((_, kind)) => {
                kind.rows += 1;
                if kind.first_rows.len() < LISTED {
                    kind.first_rows.push(row.number);
                }
            }
            None => self.kinds.push((
                row.fault,
                BrokenKind {
                    problem: row.fault.words(),
                    rows: 1,
                    first_rows: vec![row.number],
                    example: format!("{}: {}", refused.place, refused.problem),
                },
            )),
        }
        self.first.get_or_insert(row.error);
        match self.broken >= ENOUGH && 2 * self.broken > self.rows {
            true => self.check(),
            false => Ok(()),
        }
    }

    /// Refuses a file with more broken rows than may be left out. The error reports the first one and summarises all.
    pub fn check(&self) -> Result<()> {
        let Some(first) = &self.first else {
            return Ok(());
        };
        let cut = self
            .kinds
            .iter()
            .any(|(fault, _)| *fault == Fault::Truncated);
        if self.limit.allows(self.broken - u64::from(cut), self.rows) {
            return Ok(());
        }
        let all = self
            .found(String::new())
            .map_or_else(String::new, |all| all.to_string());
        let error = first.clone().map(|refused| match self.limit {
            BrokenLimit::None => {
                if self.broken > 1 {
                    refused.problem += &format!(" ({all})");
                }
                refused.remedy += ", or leave broken rows out";
            }
            limit => {
                refused.problem += &format!(" ({all}; at most {limit} may be left out)");
                refused.remedy = "check the separator and the columns, or raise the limit".into();
            }
        });
        Err(error.about(Argument::SkipBroken))
    }

    /// What was left out of `file`.
    pub fn found(&self, file: String) -> Option<BrokenRows> {
        (self.broken > 0).then(|| BrokenRows {
            file,
            rows: self.broken,
            of: self.rows,
            kinds: self.kinds.iter().map(|(_, kind)| kind.clone()).collect(),
        })
    }
}
