//! Tables of an SQLite file, read page by page (<https://www.sqlite.org/fileformat2.html>).
//!
//! This reads just what a bag of ROS 2 needs: every row of a table, without indices and without SQL. The bundled C library would be ten times the
//! code of the whole import, and need a C compiler.

use std::cell::RefCell;
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

const SIGNATURE: &[u8] = b"SQLite format 3\0";

/// Bytes of the file's header, before the tree of the first page.
const HEADER: usize = 100;

/// Most levels of a tree. Each page except the leaves has at least two children, so 2^32 pages cannot have more levels.
const DEEPEST: usize = 40;

/// Longest content of a row, bytes: SQLite's own limit. Without it, a damaged length would be allocated.
const LONGEST: u64 = 1_000_000_000;

type Result<T> = std::result::Result<T, String>;

/// An open file.
pub(super) struct Database {
    file: RefCell<File>,
    page: usize,
    /// Bytes of a page that are in use.
    usable: usize,
    pages: u64,
}

/// A table: where its tree begins, and the names of its columns.
pub(super) struct Table {
    root: u64,
    columns: Vec<String>,
}

impl Table {
    /// Position of a column.
    pub fn column(&self, name: &str) -> Result<usize> {
        let at = self.columns.iter().position(|column| column == name);
        at.ok_or_else(|| format!("a table has no column {name}"))
    }
}

/// A row of a table; what did not fit into its page is read on demand.
pub(super) struct Row<'a> {
    database: &'a Database,
    id: i64,
    /// The beginning of its content.
    local: &'a [u8],
    length: u64,
    /// Page on which the rest begins.
    overflow: Option<u64>,
    /// Kind and position of each value.
    values: Vec<(u64, u64)>,
}

impl Row<'_> {
    /// A whole number; the number of the row if the column is the key.
    pub fn integer(&self, column: usize) -> Result<i64> {
        let (kind, at) = self.value(column)?;
        let width = match kind {
            0 => return Ok(self.id),
            1..=4 => kind as usize,
            5 => 6,
            6 => 8,
            8 => return Ok(0),
            9 => return Ok(1),
            _ => return Err("a whole number has another type".into()),
        };
        let bytes = self.local.get(at as usize..at as usize + width);
        let bytes = bytes.ok_or("a row is cut")?;
        let negative = bytes[0] & 0x80 != 0;
        let start = if negative { -1_i64 } else { 0 };
        Ok(bytes
            .iter()
            .fold(start, |number, byte| number << 8 | i64::from(*byte)))
    }

    /// The bytes of a text or a blob.
    pub fn bytes(&self, column: usize) -> Result<Vec<u8>> {
        let (kind, at) = self.value(column)?;
        let length = match kind {
            12.. => (kind - 12) / 2,
            _ => return Err("a text has another type".into()),
        };
        let end = at
            .checked_add(length)
            .filter(|end| *end <= self.length)
            .ok_or("a row is cut")?;
        let content = match end as usize <= self.local.len() {
            true => self.local.to_vec(),
            false => self.database.content(self)?,
        };
        Ok(content[at as usize..end as usize].to_vec())
    }

    /// A text.
    pub fn text(&self, column: usize) -> Result<String> {
        Ok(String::from_utf8_lossy(&self.bytes(column)?).into_owned())
    }

    fn value(&self, column: usize) -> Result<(u64, u64)> {
        let value = self.values.get(column).copied();
        value.ok_or_else(|| "a row has too few values".into())
    }
}

impl Database {
    /// Opens the file at `path`; the error does not name the file.
    pub fn open(path: &Path) -> Result<Database> {
        let mut file = File::open(path).map_err(|error| error.to_string())?;
        let mut header = [0; HEADER];
        file.read_exact(&mut header)
            .map_err(|_| "it is not an SQLite file")?;
        if !header.starts_with(SIGNATURE) {
            return Err("it is not an SQLite file".into());
        }
        let page = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 1 << 16,
            size => usize::from(size),
        };
        let usable = page.saturating_sub(usize::from(header[20]));
        if !page.is_power_of_two() || page < 512 || usable < 480 {
            return Err("its header is damaged".into());
        }
        let length = file.metadata().map_err(|error| error.to_string())?.len();
        Ok(Database {
            file: RefCell::new(file),
            page,
            usable,
            pages: length / page as u64,
        })
    }

    /// The tables by name, from the schema table that begins on the first page.
    pub fn tables(&self) -> Result<HashMap<String, Table>> {
        let mut tables = HashMap::new();
        self.rows(1, &mut |row| {
            if row.text(0)? == "table" {
                let (name, root, sql) = (row.text(1)?, row.integer(3)?, row.text(4)?);
                let root = u64::try_from(root).map_err(|_| "a table has no page")?;
                let columns = columns_of(&sql);
                tables.insert(name, Table { root, columns });
            }
            Ok(())
        })?;
        Ok(tables)
    }

    /// Hands every row of `table` to `take`, in the order of their numbers.
    pub fn each_row(
        &self,
        table: &Table,
        mut take: impl FnMut(&Row<'_>) -> Result<()>,
    ) -> Result<()> {
        self.rows(table.root, &mut take)
    }

    fn rows(&self, root: u64, take: &mut dyn FnMut(&Row<'_>) -> Result<()>) -> Result<()> {
        let mut seen = 0;
        self.walk(root, 0, &mut seen, take)
    }

    fn walk(
        &self,
        number: u64,
        depth: usize,
        seen: &mut u64,
        take: &mut dyn FnMut(&Row<'_>) -> Result<()>,
    ) -> Result<()> {
        *seen += 1;
        if depth > DEEPEST || *seen > self.pages {
            return Err("its pages form a circle".into());
        }
        let page = self.read(number)?;
        let start = if number == 1 { HEADER } else { 0 };
        let (kind, cells) = (page[start], usize::from(u16_at(&page, start + 3)?));
        let (interior, pointers) = match kind {
            0x05 => (true, start + 12),
            0x0d => (false, start + 8),
            _ => return Err(format!("page {number} does not belong to a table")),
        };
        for cell in 0..cells {
            let at = usize::from(u16_at(&page, pointers + 2 * cell)?);
            match interior {
                true => self.walk(u32_at(&page, at)?, depth + 1, seen, take)?,
                false => take(&self.row(&page, at)?)?,
            }
        }
        match interior {
            true => self.walk(u32_at(&page, start + 8)?, depth + 1, seen, take),
            false => Ok(()),
        }
    }

    /// The row in the cell at `at` of a leaf.
    fn row<'a>(&'a self, page: &'a [u8], at: usize) -> Result<Row<'a>> {
        let (length, at) = varint(page, at)?;
        let (id, at) = varint(page, at)?;
        if length > LONGEST {
            return Err("a row is too long".into());
        }
        let (whole, least) = (
            self.usable as u64 - 35,
            (self.usable as u64 - 12) * 32 / 255 - 23,
        );
        let kept = match length <= whole {
            true => length,
            false => match least + (length - least) % (self.usable as u64 - 4) {
                kept if kept <= whole => kept,
                _ => least,
            },
        };
        let end = at + kept as usize;
        let local = page.get(at..end).ok_or("a row reaches beyond its page")?;
        let overflow = match kept == length {
            true => None,
            false => Some(u32_at(page, end)?),
        };
        let (header, mut from) = varint(local, 0)?;
        let mut values = Vec::new();
        let mut value_at = header;
        while (from as u64) < header {
            let (kind, next) = varint(local, from)?;
            values.push((kind, value_at));
            let width = match kind {
                0 | 8 | 9 => 0,
                1..=4 => kind,
                5 => 6,
                6 | 7 => 8,
                _ => kind.saturating_sub(12) / 2,
            };
            value_at = value_at.checked_add(width).ok_or("a row is damaged")?;
            from = next;
        }
        Ok(Row {
            database: self,
            id: id as i64,
            local,
            length,
            overflow,
            values,
        })
    }

    /// All of the content of a row.
    fn content(&self, row: &Row<'_>) -> Result<Vec<u8>> {
        let mut content = row.local.to_vec();
        let mut next = row.overflow;
        while let Some(number) = next.filter(|_| (content.len() as u64) < row.length) {
            let page = self.read(number)?;
            let left = (row.length - content.len() as u64).min(self.usable as u64 - 4) as usize;
            content.extend_from_slice(&page[4..4 + left]);
            next = Some(u32_at(&page, 0)?).filter(|number| *number != 0);
        }
        match content.len() as u64 == row.length {
            true => Ok(content),
            false => Err("a row is cut".into()),
        }
    }

    /// Page `number`, from 1.
    fn read(&self, number: u64) -> Result<Vec<u8>> {
        if number == 0 || number > self.pages {
            return Err(format!(
                "it is truncated: it has {} pages, but page {number} is referred to",
                self.pages
            ));
        }
        let mut page = vec![0; self.page];
        let mut file = self.file.borrow_mut();
        let from = SeekFrom::Start((number - 1) * self.page as u64);
        let read = file.seek(from).and_then(|_| file.read_exact(&mut page));
        read.map_err(|error| error.to_string())?;
        Ok(page)
    }
}

/// Names of the columns, from the statement that created the table.
fn columns_of(sql: &str) -> Vec<String> {
    let inner = sql.split_once('(').map_or("", |(_, inner)| inner);
    let name = |part: &str| {
        let word = part.split_whitespace().next().unwrap_or_default();
        word.trim_matches(['"', '`', '[', ']']).to_owned()
    };
    inner.split(',').map(name).collect()
}

/// A number of 1 to 9 bytes, and where it ends.
fn varint(bytes: &[u8], at: usize) -> Result<(u64, usize)> {
    let mut number = 0_u64;
    for i in 0..9 {
        let byte = *bytes.get(at + i).ok_or("a number is cut")?;
        if i == 8 {
            return Ok((number << 8 | u64::from(byte), at + 9));
        }
        number = number << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Ok((number, at + i + 1));
        }
    }
    Err("a number is cut".into())
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16> {
    let two = bytes.get(at..at + 2).and_then(|two| two.try_into().ok());
    two.map(u16::from_be_bytes)
        .ok_or_else(|| "a page is damaged".into())
}

fn u32_at(bytes: &[u8], at: usize) -> Result<u64> {
    let four = bytes.get(at..at + 4).and_then(|four| four.try_into().ok());
    four.map(|four| u64::from(u32::from_be_bytes(four)))
        .ok_or_else(|| "a page is damaged".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The string of 9000 letters that `rosbags` wrote takes three pages; CDR puts 8 bytes before it and a 0 after it.
    #[test]
    fn a_blob_that_is_longer_than_a_page_is_put_together() {
        let bag = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/src/import/ros/fixtures/imu.db3"
        );
        let database = Database::open(Path::new(bag)).unwrap();
        let tables = database.tables().unwrap();
        let messages = &tables["messages"];
        let data = messages.column("data").unwrap();
        let mut lengths = Vec::new();
        let read = database.each_row(messages, |row| {
            let bytes = row.bytes(data)?;
            if bytes.len() > 4096 {
                assert_eq!(bytes[8..9008], [b'x'; 9000]);
                assert_eq!(bytes[9008..], [0]);
            }
            lengths.push(bytes.len());
            Ok(())
        });
        read.unwrap();
        assert_eq!((lengths.len(), lengths.iter().max()), (27, Some(&9009)));
        assert!(messages.column("size").is_err());
    }
}
