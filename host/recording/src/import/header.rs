//! The columns of a foreign table: which of its cells are wanted, and what they become.

use std::path::{Path, PathBuf};

use super::assignment::{ColumnList, Role};
use super::head::{Kind, LineFormat, texts};
use super::noticed::Noticed;
use super::row_filter::{RowFilter, RowFilters};
use crate::cell::{Refusal, shorten};
use crate::columns::Column;
use crate::error::{Argument, Error, Result};

/// Bytes at the start of a text file within which the data must begin.
pub(super) const HEAD: u64 = 1 << 18;

/// The columns of a table.
#[derive(Debug)]
pub(super) struct Header {
    path: PathBuf,
    pub format: LineFormat,
    /// Position and role of each wanted cell.
    pub wanted: Vec<(usize, Role)>,
    /// Number of cells that a row must have; further cells must be empty.
    pub width: usize,
    /// Names of the columns in the file; empty if it has none.
    names: Vec<String>,
    pub filters: RowFilters,
    /// Position of the cell of each filter.
    filtered: Vec<usize>,
}

/// The line to report if no row fits the list: the first with data, or the first of all if none has data. Titles above the data have another width
/// than the rows in any file, so they tell nothing about the list.
struct Misfit {
    number: u64,
    problem: String,
    /// Whether it contains more numbers than words.
    data: bool,
}

impl Header {
    fn new(path: &Path, format: LineFormat, filters: &[RowFilter]) -> Self {
        Self {
            path: path.to_owned(),
            format,
            wanted: Vec::new(),
            width: 0,
            names: Vec::new(),
            filters: RowFilters::new(filters),
            filtered: Vec::new(),
        }
    }

    /// The columns of a table whose `names` are known. Without `list` they must be those of a recording.
    #[cfg(feature = "parquet")]
    pub fn of_names(
        path: &Path,
        names: Vec<String>,
        list: Option<&ColumnList>,
        filters: &[RowFilter],
        noticed: &mut Noticed,
    ) -> Result<Self> {
        let format = LineFormat {
            separator: crate::separator::Separator::Comma,
            comments: Default::default(),
        };
        let mut header = Self::new(path, format, filters);
        header.take_list(list);
        header.take_names(&names, list, &path.display().to_string(), noticed)?;
        if header.wanted.is_empty() {
            return Err(header.no_header(list, &names));
        }
        if let Some(ColumnList::ByPosition(items)) = list
            && items.len() != names.len()
        {
            let (given, there) = (items.len(), names.len());
            let problem = format!("the file has {there} columns, the list of columns has {given}");
            let remedy = "name every column, - for one to skip, or choose by name: gyro_x=wx";
            return Err(Error::new(path.display(), problem, remedy).about(Argument::Columns));
        }
        let position = |filter: &RowFilter| {
            let at = filter.position(&names).or(filter.number());
            at.filter(|at| *at < names.len()).ok_or_else(|| {
                let name = shorten(filter.column().as_bytes());
                let remedy = format!("choose one of {}", names.join(", "));
                let problem = format!("the file has no column {name}");
                Error::new(path.display(), problem, remedy).about(Argument::Where)
            })
        };
        header.filtered = filters.iter().map(position).collect::<Result<_>>()?;
        header.width = names.len();
        header.names = names;
        Ok(header)
    }

    /// Finds the columns of a text file and its first row among its first `lines`. Returns the line of that row too.
    pub fn find(
        path: &Path,
        lines: &[&[u8]],
        (list, format): (Option<&ColumnList>, LineFormat),
        filters: &[RowFilter],
        noticed: &mut Noticed,
    ) -> Result<(Self, u64)> {
        let mut header = Self::new(path, format, filters);
        let position = |filter| header.position(filter, lines);
        header.filtered = filters.iter().map(position).collect::<Result<_>>()?;
        header.take_list(list);
        let mut record = csv::ByteRecord::new();
        let (mut met, mut misfit) = (Vec::new(), None::<Misfit>);
        // The first row that the filters leave out. Such rows may come first, and have another width.
        let mut left_out = None;
        for (number, line) in (1..).zip(lines) {
            let kind = format.kind(line);
            match kind {
                // Counted when the rows are read.
                Kind::Blank | Kind::Comment if left_out.is_some() => continue,
                Kind::Blank => {
                    // The text after the last line break is not a line.
                    noticed.skipped.blank += u64::from(number < lines.len() as u64);
                    continue;
                }
                Kind::Comment => format.split_header(line, &mut record),
                Kind::Other => format.split(line, &mut record),
            }
            let names = texts(&record);
            let comment = matches!(kind, Kind::Comment);
            if header.wanted.is_empty() {
                header.take_names(&names, list, &header.place(number), noticed)?;
                match comment && header.wanted.is_empty() {
                    true => noticed.skipped.comment += 1,
                    false => noticed.skipped.header += 1,
                }
                met.extend(names);
                continue;
            }
            if comment {
                noticed.skipped.comment += 1;
                if names.len() == header.width {
                    header.names = names;
                }
                continue;
            }
            let data = format.mostly_numbers(record.iter());
            if data && !header.filters.hold(&header.filtered, &record) {
                left_out.get_or_insert(number);
                continue;
            }
            let problem = match header.misfit(&record, true) {
                Some(refusal) => refusal.problem,
                None if header.is_row(&record) => {
                    return Ok((header, left_out.unwrap_or(number)));
                }
                None => {
                    header.names = names;
                    "it contains words".to_owned()
                }
            };
            if misfit.as_ref().is_none_or(|first| data && !first.data) {
                misfit = Some(Misfit {
                    number,
                    problem,
                    data,
                });
            }
            noticed.skipped.header += u64::from(left_out.is_none());
        }
        match (left_out, misfit) {
            (Some(number), None) => Ok((header, number)),
            (_, misfit) => Err(header.no_row(lines, list, &met, misfit)),
        }
    }

    /// Roles in the order of [`Cells::numbers`](super::table::Cells::numbers).
    pub fn roles(&self) -> Vec<Role> {
        self.wanted.iter().map(|(_, role)| *role).collect()
    }

    /// Positions of the cells that are read.
    #[cfg(feature = "parquet")]
    pub fn positions(&self) -> impl Iterator<Item = usize> {
        let wanted = self.wanted.iter().map(|(at, _)| at);
        wanted.chain(&self.filtered).copied()
    }

    /// Name of the column with the time stamps in the file, if it has names.
    pub fn time_name(&self) -> Option<String> {
        let time = Role::Column(Column::Time);
        let (position, _) = self.wanted.iter().find(|(_, role)| *role == time)?;
        let name = self.names.get(*position);
        name.filter(|name| !name.is_empty()).cloned()
    }

    /// The column that the cell at `position` becomes, if it becomes one.
    pub fn column(&self, position: usize) -> Option<Column> {
        let own = self.wanted.iter().find(|(at, _)| *at == position);
        own.and_then(|(_, role)| match role {
            Role::Column(column) => Some(*column),
            _ => None,
        })
    }

    /// Name of each cell of a row, empty if the file has none, and its column.
    pub fn all_names(&self) -> Vec<(String, Option<Column>)> {
        let name = |k: usize| self.names.get(k).cloned().unwrap_or_default();
        (0..self.width).map(|k| (name(k), self.column(k))).collect()
    }

    /// Position of a row, for messages.
    pub fn place(&self, row: u64) -> String {
        format!("{}, row {row}", self.path.display())
    }

    /// Whether the filters keep a row, which is counted.
    pub fn keep(&mut self, record: &csv::ByteRecord) -> bool {
        self.filters.keep(&self.filtered, record)
    }

    /// Whether a row has words in place of the readings: a header or a greeting.
    pub fn are_words(&self, record: &csv::ByteRecord) -> bool {
        let no_number = |cell: &[u8]| cell.is_empty() || self.format.number(cell).is_err();
        let mut wanted = self.wanted.iter().map(|(position, _)| position);
        let short = record.len() < self.width;
        record.iter().all(no_number)
            && (short || wanted.any(|position| !record[*position].is_empty()))
    }

    /// What is wrong with the width of a row.
    pub fn misfit(&self, record: &csv::ByteRecord, ended: bool) -> Option<Refusal> {
        let (cells, width) = (record.len(), self.width);
        // Spreadsheets write separators for empty cells at the end of a row.
        if cells >= width && record.iter().skip(width).all(<[u8]>::is_empty) {
            return None;
        }
        Some(Refusal {
            problem: match cells < width && !ended {
                false => format!("the row has {cells} cells, but {width} are expected"),
                true => {
                    format!("the file is truncated: its last row has {cells} of {width} cells")
                }
            },
            remedy: match cells < width {
                true => "correct or remove the row",
                false => "correct the row, or list - for each column to skip",
            },
        })
    }

    /// Position of the column of `filter`: by its name in one of the first lines, or else by its number from the left.
    fn position(&self, filter: &RowFilter, lines: &[&[u8]]) -> Result<usize> {
        let mut record = csv::ByteRecord::new();
        let mut named = lines.iter().filter_map(|line| {
            self.format.split_header(line, &mut record);
            // The number of a column is no cell of a row.
            let header = !self.format.mostly_numbers(record.iter());
            header.then(|| filter.position(&texts(&record))).flatten()
        });
        named.next().or(filter.number()).ok_or_else(|| {
            let name = shorten(filter.column().as_bytes());
            let problem = format!("no header has the column {name}");
            let remedy = "check the name; without a header, give the number of the column from the left: 1=3";
            Error::new(self.path.display(), problem, remedy).about(Argument::Where)
        })
    }

    /// Takes a list by position.
    fn take_list(&mut self, list: Option<&ColumnList>) {
        if let Some(ColumnList::ByPosition(items)) = list {
            let place = |(position, role): (usize, &Option<Role>)| Some((position, (*role)?));
            self.wanted = items.iter().enumerate().filter_map(place).collect();
            self.width = items.len();
        }
    }

    /// Why no line of `lines` is a row; `met` are the cells of those that might be a header.
    fn no_row(
        &self,
        lines: &[&[u8]],
        list: Option<&ColumnList>,
        met: &[String],
        misfit: Option<Misfit>,
    ) -> Error {
        let path = self.path.display();
        if let Some(Misfit {
            number, problem, ..
        }) = misfit
        {
            let (width, separator) = (self.width, self.format.separator);
            let problem = format!(
                "no row fits the list of {width} columns ({problem}; separator: {separator})"
            );
            return Error::new(
                self.place(number),
                problem,
                "name every column, - for one to skip",
            )
            .about(Argument::Columns)
            .about(Argument::Separator);
        }
        let mut filled = lines
            .iter()
            .filter(|line| !line.trim_ascii().is_empty())
            .peekable();
        let digits = |line: &&&[u8]| line.iter().any(u8::is_ascii_digit);
        let signs = |line: &&[u8]| self.format.comments.begins(line);
        if let Some(sign) = filled.peek().and_then(|line| signs(line))
            && filled.clone().all(|line| signs(line).is_some())
            && 2 * filled.clone().filter(digits).count() >= filled.clone().count()
        {
            let (sign, count) = (char::from(sign), filled.count());
            let problem = format!(
                "all of its first {count} lines begin with {sign} or such characters, and are taken as comments"
            );
            let remedy =
                "if they contain the readings, say that no character begins a comment: none";
            return Error::new(path, problem, remedy).about(Argument::Comment);
        }
        if self.wanted.is_empty() {
            return self.no_header(list, met);
        }
        Error::new(path, "the file has no row of data", "record it again")
    }

    /// The refusal of a file without a header with the wanted columns; `met` are the names that it may have.
    fn no_header(&self, list: Option<&ColumnList>, met: &[String]) -> Error {
        let (problem, remedy) = match list {
            None => (
                "no header has the names of a recording's columns".to_owned(),
                "name the columns",
            ),
            Some(ColumnList::ByName(wanted)) => {
                let missing = wanted.iter().find(|(_, name)| !met.contains(name));
                let name = missing.or(wanted.first()).map_or("", |(_, name)| name);
                let name = shorten(name.as_bytes());
                (
                    format!("no header has the column {name}"),
                    "check the name; it must be spelt as in the file",
                )
            }
            Some(ColumnList::ByPosition(_)) => (
                "all columns are skipped".to_owned(),
                "name the columns to be imported",
            ),
        };
        Error::new(self.path.display(), problem, remedy).about(Argument::Columns)
    }

    /// Takes a line at `place` as the header if it has the wanted names.
    fn take_names(
        &mut self,
        names: &[String],
        list: Option<&ColumnList>,
        place: &str,
        noticed: &mut Noticed,
    ) -> Result<()> {
        let wanted = match list {
            Some(ColumnList::ByPosition(_)) => return Ok(()),
            Some(ColumnList::ByName(wanted)) => wanted.clone(),
            None => {
                let filled = || names.iter().filter(|name| !name.is_empty());
                let known = filled().filter_map(|n| Some((Role::from_name(n)?, n.clone())));
                let known: Vec<(Role, String)> = known.collect();
                let sensor = |(role, _): &(Role, String)| match role {
                    Role::Column(column) => {
                        column.triad().is_some() || *column == Column::Temperature
                    }
                    _ => false,
                };
                if !known.iter().any(sensor) {
                    return Ok(());
                }
                let ignored = filled().filter(|name| Role::from_name(name).is_none());
                let ignored: Vec<&str> = ignored.map(String::as_str).collect();
                if !ignored.is_empty() {
                    let ignored = shorten(ignored.join(", ").as_bytes());
                    let warning = format!("{place}: columns {ignored} are ignored");
                    noticed.warnings.push(warning);
                }
                known
            }
        };
        let mut positions = Vec::new();
        for (role, name) in wanted {
            let mut found = (0..names.len()).filter(|&i| names[i] == name);
            match (found.next(), found.next()) {
                (None, _) => return Ok(()),
                (Some(position), None) => positions.push((position, role)),
                (Some(_), Some(_)) => {
                    let problem = format!("column {} appears twice", shorten(name.as_bytes()));
                    let remedy = "rename one of them, or give the columns by position";
                    return Err(Error::new(place, problem, remedy));
                }
            }
        }
        self.wanted = positions;
        self.names = names.to_vec();
        let filled = |name: &String| !name.is_empty();
        self.width = names.iter().rposition(filled).map_or(0, |last| last + 1);
        Ok(())
    }

    /// Whether a line of the right width is a row instead of words above the data: more of its cells are numbers than are not. Otherwise a row with
    /// one bad cell would be skipped silently as a header.
    fn is_row(&self, record: &csv::ByteRecord) -> bool {
        let numbers = self
            .wanted
            .iter()
            .filter(|(_, role)| *role != Role::Column(Column::Step));
        self.format
            .mostly_numbers(numbers.map(|(position, _)| &record[*position]))
    }
}
