//! Rows of a foreign text file with any separator and any lines above its data.

use std::fs::File;
use std::io::{BufRead, BufReader, Chain, Cursor, Read};
use std::path::{Path, PathBuf};

use super::SkippedLines;
use super::assignment::{ColumnList, Role};
use super::binary::{refuse_binary, without_zeros};
use super::broken::{Fault, Unreadable};
use super::comment_signs::{CommentSigns, TextFormat};
use super::labelled::{Samples, Taken};
use super::row_filter::{RowFilter, RowFilters};
use super::time::{Stamp, calendar_time};
use crate::cell::{self, Refusal, shorten};
use crate::columns::Column;
use crate::csv_file::BOM;
use crate::error::{Argument, Error, Result};
use crate::separator::Separator;

/// Bytes at the start within which the data must begin.
const HEAD: u64 = 1 << 18;

/// Longest line in bytes.
const LONGEST_LINE: u64 = 1 << 20;

/// The wanted cells of a row.
#[derive(Debug, Default)]
pub(super) struct Cells {
    /// Numbers in the order of the table's roles; NaN in the place of a step.
    pub numbers: Vec<f64>,
    /// Time stamp; among the numbers it is rounded.
    pub stamp: Stamp,
    /// Text of the step.
    pub step: Vec<u8>,
}

/// A text file, positioned at its next row.
#[derive(Debug)]
pub(super) struct TextTable {
    path: PathBuf,
    comments: CommentSigns,
    reader: BufReader<Chain<Cursor<Vec<u8>>, File>>,
    separator: Separator,
    /// Puts the rows together, if labels separate their cells.
    labelled: Option<Samples>,
    /// Position and role of each wanted cell.
    wanted: Vec<(usize, Role)>,
    /// Number of cells that a row must have; further cells must be empty.
    width: usize,
    /// Names of the columns in the file; empty if it has none.
    names: Vec<String>,
    filters: RowFilters,
    /// Position of the cell of each filter.
    filtered: Vec<usize>,
    line: Vec<u8>,
    line_number: u64,
    /// Line of the first row.
    first_row: u64,
    bytes: u64,
    length: u64,
    record: csv::ByteRecord,
    /// Lines of words among the rows, and the first of them: a logger that starts again writes its header or greeting once more.
    pub restarts: Option<(u64, u64)>,
    /// Whether its times are dates or times of day, which are in s.
    pub calendar: bool,
    pub skipped: SkippedLines,
    /// Zero bytes around the lines, which were left out.
    pub zero_bytes: u64,
    pub warnings: Vec<String>,
}

/// The line to report if no row fits the list: the first with data, or the first of all if none has data. Titles above the data have another width
/// than the rows in any file, so they tell nothing about the list.
struct Misfit {
    number: u64,
    problem: String,
    /// Whether it contains more numbers than words.
    data: bool,
}

/// What the lines before the first row have shown.
#[derive(Default)]
struct Search {
    /// The names in the line that is nearest to the wanted header.
    names: Vec<String>,
    misfit: Option<Misfit>,
    /// Line of the first row that the filters leave out. Such rows may come first, and have another width.
    left_out: Option<u64>,
}

impl Search {
    /// Keeps the names of a line if they are nearer to the wanted header.
    fn compare(&mut self, here: Vec<String>, list: Option<&ColumnList>) {
        if self.names.is_empty() || matches(list, &here) > matches(list, &self.names) {
            self.names = here;
        }
    }

    fn report(&mut self, misfit: Misfit) {
        let data = misfit.data;
        if self.misfit.as_ref().is_none_or(|first| data && !first.data) {
            self.misfit = Some(misfit);
        }
    }
}

/// Kind of a line, as far as it shows without the list of columns.
enum Kind {
    Blank,
    Comment,
    Other,
}

fn kind(line: &[u8], comments: CommentSigns) -> Kind {
    match (line.trim_ascii().is_empty(), comments.begins(line)) {
        (true, _) => Kind::Blank,
        (false, Some(_)) => Kind::Comment,
        (false, None) => Kind::Other,
    }
}

/// A line without its checksum in the manner of NMEA, `$VNYMR,1,2*5F`, and whether that is right: the exclusive or of what is between $ and *.
fn checksum(line: &[u8]) -> Option<(&[u8], bool)> {
    let (sentence, sum) = line.trim_ascii().split_last_chunk::<3>()?;
    let digits = std::str::from_utf8(sum).ok()?.strip_prefix('*')?;
    let sum = u8::from_str_radix(digits, 16).ok()?;
    let bytes = sentence.strip_prefix(b"$")?;
    Some((
        sentence,
        bytes.iter().fold(0, |all, byte| all ^ byte) == sum,
    ))
}

/// Splits a line into cells, without a checksum at its end. What a serial monitor puts before it (`15:04:23.125 -> 1,2,3`) is its first cell.
pub(super) fn split(separator: Separator, line: &[u8], cells: &mut csv::ByteRecord) {
    const ARROW: &[u8] = b" -> ";
    let line = match checksum(line) {
        Some((sentence, _)) if !separator.separates(b'*') => sentence,
        _ => line,
    };
    let arrow = line.windows(ARROW.len()).position(|part| part == ARROW);
    let Some(at) = arrow.filter(|at| calendar_time(&line[..*at]).is_some()) else {
        separator.split(line, cells);
        return;
    };
    let mut rest = csv::ByteRecord::new();
    separator.split(&line[at + ARROW.len()..], &mut rest);
    cells.clear();
    cells.push_field(line[..at].trim_ascii());
    cells.extend(&rest);
}

impl TextTable {
    /// Opens the file and finds its header and its first row; without `list` the names in the header must be those of a recording. Rows that do not
    /// satisfy `filters` are skipped.
    pub fn open(
        path: &Path,
        list: Option<&ColumnList>,
        format: TextFormat,
        filters: &[RowFilter],
    ) -> Result<TextTable> {
        let io = |error: std::io::Error| Error::io(path, &error);
        let mut file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut head = Vec::new();
        (&mut file).take(HEAD).read_to_end(&mut head).map_err(io)?;
        refuse_binary(path, &head)?;
        if head.starts_with(BOM) {
            head.drain(..BOM.len());
        }
        let whole_lines = match memchr::memrchr(b'\n', &head) {
            Some(end) if head.len() as u64 >= HEAD - BOM.len() as u64 => &head[..=end],
            _ => &head[..],
        };
        let lines: Vec<&[u8]> = whole_lines
            .split(|&byte| byte == b'\n')
            .map(without_zeros)
            .collect();
        let comments = format.comments;
        let separator = format.separator.unwrap_or_else(|| {
            let shown: Vec<&[u8]> = lines
                .iter()
                .filter(|line| matches!(kind(line, comments), Kind::Other))
                .copied()
                .collect();
            Separator::detect(&shown)
        });
        let (labelled, cells) = match separator {
            Separator::Labels => Self::labelled(path, &lines)?,
            _ => (None, Vec::new()),
        };
        let lines: Vec<&[u8]> = match cells.is_empty() {
            true => lines,
            false => cells.iter().map(Vec::as_slice).collect(),
        };
        let mut table = TextTable {
            path: path.to_owned(),
            comments,
            reader: BufReader::new(Cursor::new(Vec::new()).chain(file)),
            separator,
            labelled,
            wanted: Vec::new(),
            width: 0,
            names: Vec::new(),
            filters: RowFilters::new(filters),
            filtered: Vec::new(),
            line: Vec::new(),
            line_number: 0,
            first_row: 0,
            bytes: 0,
            length,
            record: csv::ByteRecord::new(),
            restarts: None,
            calendar: false,
            skipped: SkippedLines::default(),
            zero_bytes: 0,
            warnings: Vec::new(),
        };
        let position = |filter| table.position(filter, &lines);
        table.filtered = filters.iter().map(position).collect::<Result<_>>()?;
        table.find_rows(&lines, list)?;
        let (_, file) = table.reader.into_inner().into_inner();
        let start = Cursor::new(head).chain(file);
        table.reader = BufReader::with_capacity(1 << 18, start);
        Ok(table)
    }

    /// What puts rows of labelled `lines` together, and the lines with each row in the place of its first line.
    fn labelled(path: &Path, lines: &[&[u8]]) -> Result<(Option<Samples>, Vec<Vec<u8>>)> {
        let found = Samples::find(lines).ok_or_else(|| {
            let problem = "no labels come again from line to line";
            Error::new(
                path.display(),
                problem,
                "give the character that separates its cells",
            )
            .about(Argument::Separator)
        })?;
        let all = found.clone().all(lines);
        let first = all.first().map_or(0, |(number, _)| *number as usize);
        let mut cells: Vec<Vec<u8>> = lines[..first].iter().map(|line| line.to_vec()).collect();
        cells.resize(lines.len(), Vec::new());
        for (number, sample) in all {
            cells[number as usize] = sample.join(",").into_bytes();
        }
        Ok((Some(found), cells))
    }

    /// Roles in the order of [`Cells::numbers`].
    pub fn roles(&self) -> Vec<Role> {
        self.wanted.iter().map(|(_, role)| *role).collect()
    }

    /// Name of the column with the time stamps in the file, if it has names.
    pub fn time_name(&self) -> Option<String> {
        let time = self
            .wanted
            .iter()
            .find(|(_, role)| *role == Role::Column(Column::Time));
        let name = time.and_then(|(position, _)| self.names.get(*position));
        name.filter(|name| !name.is_empty()).cloned()
    }

    /// The column that the cell at `position` becomes, if it becomes one.
    fn column(&self, position: usize) -> Option<Column> {
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

    /// The cells of the last row, with their columns.
    pub fn all_cells(&self) -> impl Iterator<Item = (&[u8], Option<Column>)> {
        (0..self.width).map(|k| (&self.record[k], self.column(k)))
    }

    /// Share of the file that has been read.
    pub fn progress(&self) -> f64 {
        self.bytes as f64 / self.length.max(1) as f64
    }

    /// Position of a line, for messages.
    pub fn place(&self, row: u64) -> String {
        format!("{}, row {row}", self.path.display())
    }

    /// Reads the next row into `cells` and returns its line, or `None` at the end.
    pub fn next(&mut self, cells: &mut Cells) -> std::result::Result<Option<u64>, Unreadable> {
        loop {
            let Some((number, ended)) = self.next_line()? else {
                return Ok(None);
            };
            match kind(&self.line, self.comments) {
                Kind::Blank => self.skipped.blank += 1,
                Kind::Comment => self.skipped.comment += 1,
                Kind::Other => {
                    split(self.separator, &self.line, &mut self.record);
                    // Spreadsheets end with rows of nothing but separators.
                    if self.record.iter().all(<[u8]>::is_empty) {
                        self.skipped.blank += 1;
                        continue;
                    }
                    if ended && self.is_words() {
                        self.skipped.header += 1;
                        self.restarts.get_or_insert((0, number)).0 += 1;
                        continue;
                    }
                    if !self.filters.keep(&self.filtered, &self.record) {
                        continue;
                    }
                    if let Some(refusal) = self.misfit(&self.record, ended) {
                        let place = self.place(number);
                        let fault = match ended || self.record.len() > self.width {
                            true => Fault::Width,
                            false => Fault::Truncated,
                        };
                        return Err(Unreadable::row(number, fault, place, refusal));
                    }
                    if checksum(&self.line).is_some_and(|(_, right)| !right) {
                        let refusal = Refusal {
                            problem: "its checksum is wrong".into(),
                            remedy: "remove the row",
                        };
                        return Err(Unreadable::row(
                            number,
                            Fault::Checksum,
                            self.place(number),
                            refusal,
                        ));
                    }
                    self.parse(number, cells)?;
                    return Ok(Some(number));
                }
            }
        }
    }

    /// Puts the next line, or the next row of labelled lines, into `line`. Returns its number and whether it is whole, `None` at the end.
    fn next_line(&mut self) -> std::result::Result<Option<(u64, bool)>, Unreadable> {
        loop {
            let read = self.read_line()?;
            let number = self.line_number;
            let Some(samples) = &mut self.labelled else {
                return Ok(read.map(|ended| (number, ended)));
            };
            let sample = match read {
                None => samples.finish(),
                Some(ended) => match samples.take(number, &self.line) {
                    Taken::Part(before) => before,
                    Taken::Words if self.line.trim_ascii().is_empty() => {
                        self.skipped.blank += 1;
                        None
                    }
                    Taken::Words => {
                        self.skipped.header += 1;
                        self.restarts.get_or_insert((0, number)).0 += 1;
                        None
                    }
                    Taken::Damaged => {
                        let fault = if ended {
                            Fault::Width
                        } else {
                            Fault::Truncated
                        };
                        let refusal = Refusal {
                            problem: format!(
                                "{} has other labels than the rows",
                                shorten(&self.line)
                            ),
                            remedy: "correct or remove the line",
                        };
                        return Err(Unreadable::row(number, fault, self.place(number), refusal));
                    }
                },
            };
            match (sample, read) {
                (Some((number, sample)), _) => {
                    self.line = sample.join(",").into_bytes();
                    return Ok(Some((number, true)));
                }
                (None, None) => return Ok(None),
                (None, Some(_)) => {}
            }
        }
    }

    /// Reads the next line of the file, from the first row on. Returns whether it has an end, or `None` at the end of the file.
    fn read_line(&mut self) -> std::result::Result<Option<bool>, Unreadable> {
        loop {
            self.line.clear();
            let read = (&mut self.reader)
                .take(LONGEST_LINE)
                .read_until(b'\n', &mut self.line)
                .map_err(|error| Error::io(&self.path, &error))?;
            if read == 0 {
                return Ok(None);
            }
            self.bytes += read as u64;
            let ended = self.line.pop_if(|last| *last == b'\n').is_some();
            self.leave_out_zeros();
            // Preallocated space has no line ends.
            if !ended && self.line.is_empty() {
                continue;
            }
            self.line_number += 1;
            if !ended && read as u64 == LONGEST_LINE {
                let problem = "the line is longer than 1 MiB";
                let remedy = "give a text file with one row a line";
                return Err(Error::new(self.place(self.line_number), problem, remedy).into());
            }
            // Lines above were counted when the file was opened.
            if self.line_number >= self.first_row {
                return Ok(Some(ended));
            }
        }
    }

    /// The filters, with their counts.
    pub fn filters(&self) -> &RowFilters {
        &self.filters
    }

    /// At the end: refuses a value that no row had.
    pub fn check_filters(&self) -> Result<()> {
        self.filters.check(&self.path)
    }

    /// Position of the column of `filter`: by its name in one of the first lines, or else by its number from the left.
    fn position(&self, filter: &RowFilter, lines: &[&[u8]]) -> Result<usize> {
        let mut record = csv::ByteRecord::new();
        let mut named = lines.iter().filter_map(|line| {
            self.separator
                .split(self.comments.skipped(line), &mut record);
            // The number of a column is no cell of a row.
            let header = !self.mostly_numbers(record.iter());
            header.then(|| filter.position(&texts(&record))).flatten()
        });
        named.next().or(filter.number()).ok_or_else(|| {
            let name = shorten(filter.column().as_bytes());
            let problem = format!("no header has the column {name}");
            let remedy = "check the name; without a header, give the number of the column from the left: 1=3";
            Error::new(self.path.display(), problem, remedy).about(Argument::Where)
        })
    }

    /// Leaves out the zero bytes around the line, and the carriage return at its end.
    fn leave_out_zeros(&mut self) {
        if memchr::memchr(0, &self.line).is_some() {
            self.zero_bytes += self.line.iter().filter(|byte| **byte == 0).count() as u64;
            self.line = without_zeros(&self.line).to_vec();
        }
        self.line.pop_if(|last| *last == b'\r');
    }

    /// Number in a cell. If commas do not separate cells, one comma is a decimal point.
    fn number(&self, cell: &[u8]) -> std::result::Result<f64, Refusal> {
        if !self.separator.separates(b',')
            && !cell.contains(&b'.')
            && let Some(comma) = memchr::memchr(b',', cell)
        {
            let mut point = cell.to_vec();
            point[comma] = b'.';
            return cell::number(&point).map_err(|_| cell::no_number(cell));
        }
        cell::number(cell)
    }

    fn parse(&mut self, line: u64, cells: &mut Cells) -> std::result::Result<(), Unreadable> {
        cells.numbers.clear();
        cells.step.clear();
        let mut nanoseconds = None;
        for &(position, role) in &self.wanted {
            let cell = &self.record[position];
            if role == Role::Column(Column::Step) {
                cells.step.extend_from_slice(cell);
                cells.numbers.push(f64::NAN);
                continue;
            }
            let time = role == Role::Column(Column::Time);
            if time && let Some(stamp) = calendar_time(cell) {
                cells.stamp = stamp;
                cells.numbers.push(stamp.value);
                self.calendar = true;
                continue;
            }
            let number = self.number(cell).map_err(|refusal| {
                let place = format!("{}, column {}", self.place(line), role.name());
                Unreadable::row(line, Fault::Reading, place, refusal)
            })?;
            if time {
                cells.stamp = Stamp::in_cell(cell, number);
            }
            if role == Role::Nanoseconds {
                nanoseconds = Some(number);
            }
            cells.numbers.push(number);
        }
        if let Some(nanoseconds) = nanoseconds {
            cells.stamp = cells.stamp.with_nanoseconds(nanoseconds);
        }
        Ok(())
    }

    /// Whether the line has words in place of the readings: a header or a greeting.
    fn is_words(&self) -> bool {
        let count = |is: fn(&u8) -> bool| self.line.iter().filter(|byte| is(byte)).count();
        let words = count(u8::is_ascii_alphabetic) > count(u8::is_ascii_digit);
        let no_number = |cell: &[u8]| cell.is_empty() || self.number(cell).is_err();
        let short = self.record.len() < self.width;
        let mut wanted = self.wanted.iter().map(|(position, _)| position);
        words
            && self.record.iter().all(no_number)
            && (short || wanted.any(|position| !self.record[*position].is_empty()))
    }

    /// What is wrong with the width of a row.
    fn misfit(&self, record: &csv::ByteRecord, ended: bool) -> Option<Refusal> {
        let cells = record.len();
        if cells < self.width {
            let problem = match ended {
                true => format!("the row has {cells} cells, but {} are expected", self.width),
                false => format!(
                    "the file is truncated: its last row has {cells} of {} cells",
                    self.width
                ),
            };
            return Some(Refusal {
                problem,
                remedy: "correct or remove the row",
            });
        }
        // Spreadsheets write separators for empty cells at the end of a row.
        if record.iter().skip(self.width).all(<[u8]>::is_empty) {
            return None;
        }
        Some(Refusal {
            problem: format!("the row has {cells} cells, but {} are expected", self.width),
            remedy: "correct the row, or list - for each column to skip",
        })
    }

    /// Finds the first row among `lines` and, if columns are chosen by name, the header above it.
    fn find_rows(&mut self, lines: &[&[u8]], list: Option<&ColumnList>) -> Result<()> {
        if let Some(ColumnList::ByPosition(items)) = list {
            let place = |(position, role): (usize, &Option<Role>)| Some((position, (*role)?));
            self.wanted = items.iter().enumerate().filter_map(place).collect();
            self.width = items.len();
        }
        let mut search = Search::default();
        let mut record = csv::ByteRecord::new();
        for (index, line) in lines.iter().enumerate() {
            let number = index as u64 + 1;
            match kind(line, self.comments) {
                // Counted when the rows are read.
                Kind::Blank | Kind::Comment if search.left_out.is_some() => {}
                // The text after the last line break is not a line.
                Kind::Blank => self.skipped.blank += u64::from(index + 1 < lines.len()),
                Kind::Comment => {
                    // Many programs write the names of the columns after a #.
                    self.separator
                        .split(self.comments.skipped(line), &mut record);
                    self.take_comment(&record, list, number)?;
                }
                Kind::Other => {
                    split(self.separator, line, &mut record);
                    if self.take_line(&record, list, number, &mut search)? {
                        self.first_row = search.left_out.unwrap_or(number);
                        return Ok(());
                    }
                }
            }
        }
        match (search.left_out, &search.misfit) {
            (Some(number), None) => {
                self.first_row = number;
                Ok(())
            }
            _ => Err(self.no_row(lines, list, search)),
        }
    }

    /// Takes the names in a comment above the first row, and counts its line.
    fn take_comment(
        &mut self,
        record: &csv::ByteRecord,
        list: Option<&ColumnList>,
        number: u64,
    ) -> Result<()> {
        let open = self.wanted.is_empty();
        if open {
            self.take_header(&texts(record), list, number)?;
        } else if record.len() == self.width {
            self.names = texts(record);
        }
        match open && !self.wanted.is_empty() {
            true => self.skipped.header += 1,
            false => self.skipped.comment += 1,
        }
        Ok(())
    }

    /// Takes a line as the header or as a row, or notes in `search` what else it is. Returns whether it is the first row that the filters keep.
    fn take_line(
        &mut self,
        record: &csv::ByteRecord,
        list: Option<&ColumnList>,
        number: u64,
        search: &mut Search,
    ) -> Result<bool> {
        if self.wanted.is_empty() {
            let here = texts(record);
            self.take_header(&here, list, number)?;
            search.compare(here, list);
        } else if self.mostly_numbers(record.iter()) && !self.filters.hold(&self.filtered, record) {
            search.left_out.get_or_insert(number);
            return Ok(false);
        } else {
            let problem = match self.misfit(record, true) {
                Some(refusal) => refusal.problem,
                None if self.is_row(record) => return Ok(true),
                None => {
                    self.names = texts(record);
                    "it contains words".to_owned()
                }
            };
            search.report(Misfit {
                number,
                problem,
                data: self.mostly_numbers(record.iter()),
            });
        }
        self.skipped.header += u64::from(search.left_out.is_none());
        Ok(false)
    }

    /// Why none of `lines` is a row.
    fn no_row(&self, lines: &[&[u8]], list: Option<&ColumnList>, search: Search) -> Error {
        if self.wanted.is_empty() {
            let error = self.no_header(list, &search.names);
            return self.all_comments(lines).unwrap_or(error);
        }
        match search.misfit {
            Some(Misfit {
                number, problem, ..
            }) => Error::new(
                self.place(number),
                format!(
                    "no row fits the list of {} columns ({problem}; separator: {})",
                    self.width, self.separator
                ),
                "name every column, - for one to skip",
            )
            .about(Argument::Columns)
            .about(Argument::Separator),
            None => self.all_comments(lines).unwrap_or_else(|| {
                let problem = "the file has no row of data";
                Error::new(self.path.display(), problem, "record it again")
            }),
        }
    }

    /// The refusal of a file without a header with the wanted columns; `names` are in the line that is nearest to it.
    fn no_header(&self, list: Option<&ColumnList>, names: &[String]) -> Error {
        let (problem, remedy) = match list {
            None => (
                "no header has the names of a recording's columns".to_owned(),
                "name the columns",
            ),
            Some(ColumnList::ByName(wanted)) => {
                let missing = |(_, name): &&(Role, String)| !names.contains(name);
                let name = wanted.iter().find(missing).map_or("", |(_, name)| name);
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

    /// The refusal of a file whose lines are all comments, of which most contain numbers.
    fn all_comments(&self, lines: &[&[u8]]) -> Option<Error> {
        let filled = lines.iter().filter(|line| !line.trim_ascii().is_empty());
        let signs: Option<Vec<u8>> = filled.map(|line| self.comments.begins(line)).collect();
        let signs = signs.filter(|signs| !signs.is_empty())?;
        let digits = |line: &&&[u8]| line.iter().any(u8::is_ascii_digit);
        if 2 * lines.iter().filter(digits).count() < signs.len() {
            return None;
        }
        let (sign, count) = (char::from(signs[0]), signs.len());
        let problem = match signs.iter().all(|other| *other == signs[0]) {
            true => {
                format!("all of its {count} lines begin with {sign}, and are taken as comments")
            }
            false => {
                format!("all of its {count} lines are taken as comments, by their first characters")
            }
        };
        let problem = match self.length > HEAD {
            true => problem.replace("its", "its first"),
            false => problem,
        };
        let remedy = "if they contain the readings, say that no character begins a comment: none";
        let place = self.path.display();
        Some(Error::new(place, problem, remedy).about(Argument::Comment))
    }

    /// Takes the line as header if it has the wanted names.
    fn take_header(
        &mut self,
        names: &[String],
        list: Option<&ColumnList>,
        number: u64,
    ) -> Result<()> {
        let wanted = match list {
            Some(ColumnList::ByPosition(_)) => return Ok(()),
            Some(ColumnList::ByName(wanted)) => wanted.clone(),
            None => {
                let known = Role::all().map(|role| (role, role.name().to_owned()));
                let here: Vec<(Role, String)> =
                    known.filter(|(_, name)| names.contains(name)).collect();
                let sensor = |(role, _): &&(Role, String)| {
                    matches!(role, Role::Column(Column::Raw(_) | Column::Temperature))
                };
                if here.iter().find(sensor).is_none() {
                    return Ok(());
                }
                let ignored: Vec<&str> = names
                    .iter()
                    .filter(|name| !name.is_empty() && here.iter().all(|(_, known)| known != *name))
                    .map(String::as_str)
                    .collect();
                if !ignored.is_empty() {
                    let ignored = shorten(ignored.join(", ").as_bytes());
                    let place = self.place(number);
                    self.warnings
                        .push(format!("{place}: columns {ignored} are ignored"));
                }
                here
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
                    return Err(Error::new(self.place(number), problem, remedy));
                }
            }
        }
        self.wanted = positions;
        self.names = names.to_vec();
        let filled = |name: &&String| !name.is_empty();
        self.width = names
            .iter()
            .rposition(|name| filled(&name))
            .map_or(0, |last| last + 1);
        Ok(())
    }

    /// Whether a line of the right width is a row instead of words above the data: more of its cells are numbers than are not. Otherwise a row with
    /// one bad cell would be skipped silently as a header.
    fn is_row(&self, record: &csv::ByteRecord) -> bool {
        let numbers = self
            .wanted
            .iter()
            .filter(|(_, role)| *role != Role::Column(Column::Step));
        self.mostly_numbers(numbers.map(|(position, _)| &record[*position]))
    }

    fn mostly_numbers<'a>(&self, cells: impl Iterator<Item = &'a [u8]>) -> bool {
        let (mut right, mut wrong) = (0, 0);
        for cell in cells {
            match self.number(cell) {
                Ok(value) => right += usize::from(!value.is_nan()),
                Err(_) => wrong += 1,
            }
        }
        right > wrong
    }
}

/// The cells of a header.
fn texts(record: &csv::ByteRecord) -> Vec<String> {
    let text = |cell: &[u8]| String::from_utf8_lossy(cell).trim().to_owned();
    record.iter().map(text).collect()
}

/// Number of the wanted names that are among `names`.
fn matches(list: Option<&ColumnList>, names: &[String]) -> usize {
    match list {
        Some(ColumnList::ByName(wanted)) => {
            let here = wanted.iter().filter(|(_, name)| names.contains(name));
            here.count()
        }
        _ => 0,
    }
}
