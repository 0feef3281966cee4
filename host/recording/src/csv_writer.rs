//! `samples.csv`, written with numbers that read back exactly.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::batch::Batch;
use super::columns::{Column, Columns};
use crate::error::{Error, Result};

/// Bytes that are collected before they are written.
const BUFFER: usize = 1 << 20;

#[derive(Debug)]
pub(super) struct CsvWriter {
    path: PathBuf,
    file: File,
    text: Vec<u8>,
    columns: Vec<Column>,
}

impl CsvWriter {
    pub fn create(path: &Path, columns: Columns) -> Result<CsvWriter> {
        let columns: Vec<Column> = columns.present().collect();
        let names: Vec<&str> = columns.iter().map(|column| column.name()).collect();
        let mut text = Vec::with_capacity(2 * BUFFER);
        text.extend_from_slice(names.join(",").as_bytes());
        text.push(b'\n');
        Ok(CsvWriter {
            path: path.to_owned(),
            file: File::create(path).map_err(|error| Error::io(path, &error))?,
            text,
            columns,
        })
    }

    /// Continues after the first `bytes` bytes of a file that [`Self::create`] began; the rest is cut off.
    pub fn append(path: &Path, columns: Columns, bytes: u64) -> Result<CsvWriter> {
        let io = |error: std::io::Error| Error::io(path, &error);
        let file = File::options().append(true).open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        if length < bytes {
            let problem = format!("it has {length} bytes, but had {bytes} before");
            return Err(Error::new(path.display(), problem, "start a new recording"));
        }
        file.set_len(bytes).map_err(io)?;
        Ok(CsvWriter {
            path: path.to_owned(),
            file,
            text: Vec::with_capacity(2 * BUFFER),
            columns: columns.present().collect(),
        })
    }

    pub fn write(&mut self, batch: &Batch) -> Result<()> {
        let columns: Vec<Option<&[f64]>> = self.columns.iter().map(|&c| batch.values(c)).collect();
        for row in 0..batch.len() {
            for values in &columns {
                match values {
                    Some(values) => write_number(values[row], &mut self.text),
                    None => write_integer(i64::from(batch.step[row]), &mut self.text),
                }
                self.text.push(b',');
            }
            if let Some(last) = self.text.last_mut() {
                *last = b'\n';
            }
            if self.text.len() >= BUFFER {
                self.flush()?;
            }
        }
        Ok(())
    }

    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        self.file
            .sync_all()
            .map_err(|error| Error::io(&self.path, &error))
    }

    /// The file, for another thread to wait for the disk.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Hands everything to the operating system, which keeps it even if this program is killed.
    pub fn flush(&mut self) -> Result<()> {
        self.file
            .write_all(&self.text)
            .map_err(|error| Error::io(&self.path, &error))?;
        self.text.clear();
        Ok(())
    }
}

/// Appends the shortest text that reads back as the same number; nothing for NaN.
pub(super) fn write_number(value: f64, text: &mut Vec<u8>) {
    if value.is_nan() {
        return;
    }
    // Counts are whole, and an i64 holds them exactly below 2^53. Minus zero keeps its sign below.
    if value.fract() == 0.0 && value.abs() < 9e15 && (value != 0.0 || value.is_sign_positive()) {
        return write_integer(value as i64, text);
    }
    text.extend_from_slice(ryu::Buffer::new().format(value).as_bytes());
}

fn write_integer(value: i64, text: &mut Vec<u8>) {
    text.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_count_is_written_without_a_point(count in -70000_i32..70000) {
            let mut text = Vec::new();
            write_number(f64::from(count), &mut text);
            prop_assert_eq!(text, count.to_string().into_bytes());
        }
    }

    #[test]
    fn odd_numbers_keep_their_bits_and_their_shortest_form() {
        for (value, expected) in [
            (-0.0, "-0.0"),
            (0.1, "0.1"),
            (1e300, "1e300"),
            (5e-324, "5e-324"),
            (f64::NAN, ""),
            (123.0, "123"),
        ] {
            let mut text = Vec::new();
            write_number(value, &mut text);
            assert_eq!(String::from_utf8(text).unwrap(), expected);
        }
    }
}
