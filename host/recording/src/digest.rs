//! SHA-256 of files, computed while they are read.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
#[cfg(not(target_family = "wasm"))]
use std::thread;

use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// Runs `work` while another thread hashes the bytes of `path`. Returns what `work` returns, and the digest in hexadecimal as `sha256sum` prints it.
///
/// The file is read twice, the second time from the page cache. If the readers passed their chunks on in file order instead, the slower side would
/// hold up the other.
#[cfg(not(target_family = "wasm"))]
pub(super) fn while_hashing<T>(
    path: &Path,
    work: impl FnOnce() -> Result<T>,
) -> Result<(T, String)> {
    /// Tells the hashing thread to stop when the reading ends in an error, or panics.
    struct Stop<'a>(&'a AtomicBool, bool);
    impl Drop for Stop<'_> {
        fn drop(&mut self) {
            self.0.store(self.1, Ordering::Relaxed);
        }
    }
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let mut guard = Stop(&stop, true);
        let digest = thread::Builder::new()
            .name("sha256".to_owned())
            .spawn_scoped(scope, || sha256_until(path, &stop))
            .map_err(|error| Error::io(path, &error))?;
        let done = work()?;
        guard.1 = false;
        drop(guard);
        match digest.join() {
            Ok(hex) => Ok((done, hex?)),
            Err(_) => Err(super::ahead::reader_panicked(&path.display().to_string())),
        }
    })
}

/// The same without threads: one after the other.
#[cfg(target_family = "wasm")]
pub(super) fn while_hashing<T>(
    path: &Path,
    work: impl FnOnce() -> Result<T>,
) -> Result<(T, String)> {
    Ok((work()?, sha256(path)?))
}

/// Digest of a file in hexadecimal.
pub(super) fn sha256(path: &Path) -> Result<String> {
    sha256_until(path, &AtomicBool::new(false))
}

fn sha256_until(path: &Path, stop: &AtomicBool) -> Result<String> {
    let mut file = File::open(path).map_err(|error| Error::io(path, &error))?;
    let mut state = Sha256::new();
    let mut buffer = vec![0; 1 << 18];
    while !stop.load(Ordering::Relaxed) {
        match file.read(&mut buffer) {
            Ok(0) => break,
            Ok(length) => state.update(&buffer[..length]),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(Error::io(path, &error)),
        }
    }
    Ok(hex(&state.finalize()))
}

/// Bytes in hexadecimal.
pub(super) fn hex(bytes: &[u8]) -> String {
    let hex = |byte: &u8| {
        let digit = |nibble: u8| char::from(b"0123456789abcdef"[usize::from(nibble)]);
        [digit(byte >> 4), digit(byte & 15)]
    };
    bytes.iter().flat_map(hex).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_is_that_of_the_standard() {
        // FIPS 180-4 example: "abc".
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(&path).unwrap(), known);
        assert_eq!(
            while_hashing(&path, || Ok(7)).unwrap(),
            (7, known.to_owned())
        );
    }
}
