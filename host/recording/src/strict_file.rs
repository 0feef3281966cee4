//! A file whose end is an error instead of an empty read.

use std::fs::File;
use std::io::{BufReader, Error, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use parquet::errors::Result;
use parquet::file::reader::{ChunkReader, Length};

/// A file for the readers of `parquet`.
///
/// That crate skips unknown parts of a page header without noticing the end of the file (60.1, `ThriftReadInputProtocol::skip_bytes`). If one flipped
/// bit turns such a part into a list of 2³¹ numbers, a file of ten kilobytes is read for half an hour.
///
/// Its own readers of a file duplicate the handle, which WebAssembly cannot. Here one handle is shared, on one thread.
#[derive(Debug)]
pub(super) struct StrictFile(Arc<File>);

impl StrictFile {
    /// Opens it.
    pub fn open(path: &Path) -> std::io::Result<Self> {
        Ok(Self(Arc::new(File::open(path)?)))
    }
}

/// See [`StrictFile`].
#[derive(Debug)]
pub(super) struct EndIsError {
    file: Arc<File>,
    /// Where the next read begins: another reader may have moved the handle.
    at: u64,
}

impl Read for EndIsError {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut file = &*self.file;
        file.seek(SeekFrom::Start(self.at))?;
        match file.read(buffer)? {
            0 if !buffer.is_empty() => Err(Error::from(ErrorKind::UnexpectedEof)),
            length => {
                self.at += length as u64;
                Ok(length)
            }
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
        let file = self.0.clone();
        Ok(BufReader::new(EndIsError { file, at: start }))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let mut bytes = Vec::with_capacity(length);
        let file = self.0.clone();
        let read = EndIsError { file, at: start }
            .take(length as u64)
            .read_to_end(&mut bytes)?;
        match read == length {
            true => Ok(bytes.into()),
            false => Err(Error::from(ErrorKind::UnexpectedEof).into()),
        }
    }
}
