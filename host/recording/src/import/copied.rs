//! A text file copied row by row, with its readings replaced.

use std::path::Path;

use super::broken::Unreadable;
use super::joined::Files;
use super::options::ImportOptions;
use super::table::{Cells, Table};
use crate::columns::Column;
use crate::csv_writer::write_number;
use crate::error::{Error, Result};
use crate::result_file::stage;
use crate::triad_name::{TriadKind, TriadName};

/// A triad whose readings are replaced, and the unit of the new ones.
pub struct ReplacedTriad {
    /// The triad.
    pub triad: TriadName,
    /// `rad/s`, `m/s^2`, or that of a magnetometer.
    pub unit: String,
}

impl ReplacedTriad {
    /// Ending of its columns' names: a name that says the unit of the raw readings would now be wrong.
    fn ending(&self) -> &str {
        match self.triad.kind {
            TriadKind::Gyro => "rad_s",
            TriadKind::Accel => "m_s2",
            TriadKind::Mag => &self.unit,
        }
    }
}

/// The rows that an import of one text file reads, with all of their columns, to be written as CSV with other readings. Lines without a row and rows that
/// the import leaves out are not copied.
pub struct CopiedTable {
    table: Table,
    cells: Cells,
    /// Lines of the rows that the import takes.
    numbers: std::vec::IntoIter<u64>,
    replaced: Vec<ReplacedTriad>,
    csv: csv::Writer<Vec<u8>>,
}

impl CopiedTable {
    /// Opens the file of `options`; the readings of these triads will be `replaced`.
    ///
    /// # Errors
    /// There are several files, it is not text, or its rows do not become samples one by one.
    pub fn open(options: &ImportOptions, replaced: Vec<ReplacedTriad>) -> Result<Self> {
        let path = options.file(0);
        let refuse = |problem: &str| {
            let remedy = "write a recording instead: name a folder";
            Err(Error::new(path.display(), problem, remedy))
        };
        if options.sources() != 1 || options.log.means || options.is_sequence() {
            return refuse("only a single file is copied");
        }
        let files = Files::read(options, &|_| {})?;
        if files.interpolates() {
            return refuse("its times are irregular, so its rows are interpolated");
        }
        if !files.first.is_text {
            return refuse("only text is copied");
        }
        let how = options.how(0);
        let table = Table::open(path, how.list, how.log.text_format(), &how.filters)?;
        let name = |(k, (name, column)): (usize, (String, Option<Column>))| match column {
            Some(column) if of(&replaced, column).is_some() => {
                let ending = of(&replaced, column).map_or("", ReplacedTriad::ending);
                format!("{}_{ending}", column.name())
            }
            Some(column) if name.is_empty() => column.name().to_owned(),
            None if name.is_empty() => format!("column_{}", k + 1),
            _ => name,
        };
        let names = table.header.all_names().into_iter().enumerate().map(name);
        let names: Vec<String> = names.collect();
        let mut csv = csv::Writer::from_writer(Vec::new());
        csv.write_record(&names)
            .map_err(|e| Error::new(path.display(), e, "copy it elsewhere"))?;
        Ok(Self {
            table,
            cells: Cells::default(),
            numbers: files.first.numbers.into_iter(),
            replaced,
            csv,
        })
    }

    /// Copies the next row, with these readings of the columns that are replaced; a NaN becomes an empty cell.
    ///
    /// # Errors
    /// The file has no further row: it has changed since it was imported.
    pub fn row(&mut self, readings: impl Fn(Column) -> f64) -> Result<()> {
        let ended = || {
            Error::new(
                "copy",
                "the file has changed while it was read",
                "run it again",
            )
        };
        let wanted = self.numbers.next().ok_or_else(ended)?;
        loop {
            match self.table.next(&mut self.cells) {
                Ok(Some(number)) if number == wanted => break,
                // Rows that the import leaves out.
                Ok(Some(_)) | Err(Unreadable::Row(_)) => {}
                Ok(None) => return Err(ended()),
                Err(Unreadable::File(error)) => return Err(error),
            }
        }
        let replaced = self.table.all_cells().map(|(cell, column)| match column {
            Some(column) if of(&self.replaced, column).is_some() => {
                let mut text = Vec::new();
                write_number(readings(column), &mut text);
                text
            }
            _ => cell.to_vec(),
        });
        self.csv
            .write_record(replaced)
            .map_err(|e| Error::new("copy", e, "run it again"))
    }

    /// Writes the copy to `out`.
    pub fn write(self, out: &Path) -> Result<()> {
        let bytes = self
            .csv
            .into_inner()
            .map_err(|e| Error::io(out, e.error()))?;
        stage(out, bytes)?.publish()
    }
}

/// The replaced triad that `column` is of.
fn of(replaced: &[ReplacedTriad], column: Column) -> Option<&ReplacedTriad> {
    let (triad, _) = column.triad()?;
    replaced.iter().find(|of| of.triad == triad)
}
