//! A file whose end is an error and not an empty read.

use std::fs::File;
use std::io::{BufReader, Error, ErrorKind, Read, Seek, SeekFrom};

use bytes::Bytes;
use parquet::errors::Result;
use parquet::file::reader::{ChunkReader, Length};

/// A file for the page reader of `parquet`.
///
/// That crate skips what it does not know in the header of a page without noticing the end of the file (60.1,
/// `ThriftReadInputProtocol::skip_bytes`): one flipped bit that makes a list of 2³¹ numbers of it, and a file of ten
/// kilobytes is read for half an hour.
#[derive(Debug)]
pub(super) struct StrictFile(pub File);

/// See [`StrictFile`].
#[derive(Debug)]
pub(super) struct EndIsError(File);

impl Read for EndIsError {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self.0.read(buffer)? {
            0 if !buffer.is_empty() => Err(Error::from(ErrorKind::UnexpectedEof)),
            length => Ok(length),
        }
    }
}

impl Length for StrictFile {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl ChunkReader for StrictFile {
    type T = BufReader<EndIsError>;

    fn get_read(&self, start: u64) -> Result<Self::T> {
        let mut file = self.0.try_clone()?;
        file.seek(SeekFrom::Start(start))?;
        Ok(BufReader::new(EndIsError(file)))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        self.0.get_bytes(start, length)
    }
}
